"""Frames are sent until the monitor has acknowledged them."""

from pathlib import Path

from sprung.link import Sending, Spool


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
