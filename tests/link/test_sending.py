"""Frames are sent until the monitor has acknowledged them."""

from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sprung.link import Sending, Spool


def held(spool):
    return [(boot, seq) for boot, seq, _ in spool.frames()]


@settings(max_examples=60, deadline=None)
@given(
    st.lists(st.one_of(st.integers(1, 20), st.just("again"), st.just("ack"), st.just("loss")), max_size=25), st.data()
)
def test_sending_delivers_all_whatever_is_lost(tmp_path_factory: pytest.TempPathFactory, steps, data) -> None:
    """A receiver that acknowledges the highest contiguous number, on a link that loses and is cut."""
    folder = tmp_path_factory.mktemp("spool")
    spool, now, received = Spool(folder, is_synced=False), 0.0, set()
    sending = Sending(spool, ahead=8, patience=10.0)

    def contiguous():
        return next(k for k in range(10**6) if k not in received) - 1

    for step in steps:
        now += 1.0
        if step == "again":
            sending.start_again(now)
        elif step == "ack":
            sending.acknowledged(spool.boot, contiguous(), now)
        elif step == "loss":
            list(sending.due(now))
        else:
            for _ in range(step):
                spool.append(lambda boot, seq: b"%d" % seq)
            arriving = list(sending.due(now))
            received |= {seq for _, seq, _ in arriving if data.draw(st.booleans())}
        assert sending.n_under_way <= 8
    for _ in range(200):
        now += 11.0
        received |= {seq for _, seq, _ in sending.due(now)}
        sending.acknowledged(spool.boot, contiguous(), now)
    assert contiguous() + 1 == spool.next_seq
    assert held(spool) == []


def test_no_more_is_sent_ahead_than_allowed_and_all_again_after_the_patience(tmp_path: Path) -> None:
    spool = Spool(tmp_path, is_synced=False)
    for _ in range(6):
        spool.append(lambda boot, seq: b"%d" % seq)
    sending = Sending(spool, ahead=4, patience=10.0)

    def due(now):
        return [seq for _, seq, _ in sending.due(now)]

    assert due(0.0) == [0, 1, 2, 3]
    assert due(10.0) == []
    sending.acknowledged(spool.boot, 1, 10.0)
    assert due(10.0) == [4, 5]
    assert due(20.0) == []
    assert due(20.1) == [2, 3, 4, 5]
    sending.start_again(21.0)
    assert due(21.0) == [2, 3, 4, 5]
    sending.acknowledged(spool.boot, 5, 22.0)
    assert (due(40.0), sending.n_under_way) == ([], 0)
