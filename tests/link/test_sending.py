"""Frames are sent until the monitor has acknowledged them."""

from contextlib import closing
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sprung.link import Sending, Spool
from sprung.link.spool import Disk


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


def test_a_frame_that_could_not_be_read_for_a_while_is_sent_later(tmp_path: Path) -> None:
    """The frames after it are acknowledged meanwhile, so that nothing is under way."""

    class FailingDisk(Disk):
        unreadable: Path | None = None

        def read(self, path: Path) -> bytes:
            if path == self.unreadable:
                raise OSError("Input/output error")
            return super().read(path)

    with closing(Spool(tmp_path, is_synced=False)) as spool:
        spool.append(lambda boot, seq: b"old")
        first = spool.boot
    (file,) = tmp_path.glob("*.spool")
    disk = FailingDisk()
    spool = Spool(tmp_path, is_synced=False, disk=disk)
    spool.append(lambda boot, seq: b"new")
    sending = Sending(spool, patience=10.0)
    disk.unreadable = file
    assert [payload for _, _, payload in sending.due(0.0)] == [b"new"]
    sending.acknowledged(spool.boot, 0, 1.0)
    disk.unreadable = None
    assert list(sending.due(5.0)) == []
    assert list(sending.due(12.0)) == [(first, 0, b"old")]
