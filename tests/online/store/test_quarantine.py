import pytest

from sprung.online.store import Cursor, Progress, QuarantineRow, StoredFrame, inbox


@pytest.fixture
def filled(store):
    """A store with five frames and a state."""
    store.inbox.add_frames([StoredFrame("zafira", 7, seq, 10 * seq, b"x%d" % seq) for seq in range(5)], now=0)
    store.results.commit(Progress("zafira", 7, done_seq=0, snapshot=b"state"))
    return store


def test_frames_are_moved_with_the_reason(filled) -> None:
    assert filled.quarantine.put_frames("zafira", 7, 2, 3, reason="it fails", now=9) == 2
    rows = [QuarantineRow("zafira", 7, seq, "raw", 10 * seq, b"x%d" % seq, "it fails", 9) for seq in (2, 3)]
    assert filled.quarantine.find("zafira") == rows
    assert [frame.seq for frame in filled.inbox.pending("zafira", 7, after=0, limit=9)] == [1, 4]
    assert filled.inbox.cursor("zafira", 7) == Cursor(contiguous=4, done=0)
    assert filled.quarantine.put_frames("zafira", 7, 2, 3, reason="again", now=10) == 0
    assert filled.inbox.add_frames([StoredFrame("zafira", 7, 2, 0, b"")], now=0) == {("zafira", 7): 4}
    assert filled.quarantine.find("zafira") == rows


def test_a_state_is_moved_with_the_reason(filled) -> None:
    assert filled.quarantine.put_state("zafira", reason="no CBOR", now=9)
    assert filled.results.snapshot("zafira") is None
    assert filled.quarantine.find("zafira") == [QuarantineRow("zafira", 7, 0, "state", 9, b"state", "no CBOR", 9)]
    assert not filled.quarantine.put_state("zafira", reason="again", now=10)
    filled.results.commit(Progress("zafira", 7, done_seq=0, snapshot=b"later"))
    assert filled.quarantine.put_state("zafira", reason="again", now=11)
    assert [row.payload for row in filled.quarantine.find("zafira")] == [b"later"]


def test_the_last_bytes_of_each_vehicle_are_kept(filled, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(inbox, "_MAX_QUARANTINED", 6)
    filled.inbox.add_frames([StoredFrame("other", 1, 0, 0, b"large frame")], now=0)
    for last, now in ((2, 1), (4, 2)):
        filled.quarantine.put_frames("zafira", 7, 1, last, reason="", now=now)
    filled.quarantine.put_frames("other", 1, 0, 0, reason="", now=3)
    assert [row.seq for row in filled.quarantine.find("zafira")] == [2, 3, 4]
    assert filled.quarantine.find("other") == []
    assert filled.quarantine.vehicles() == ["zafira"]


def test_what_was_quarantined_long_ago_is_deleted(filled) -> None:
    filled.quarantine.put_frames("zafira", 7, 1, 1, reason="", now=100)
    filled.quarantine.put_frames("zafira", 7, 2, 2, reason="", now=200)
    assert filled.delete_older(200) == 1
    assert [row.seq for row in filled.quarantine.find("zafira")] == [2]
