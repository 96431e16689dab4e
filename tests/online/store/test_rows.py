"""Rows refuse what no column holds."""

import pytest

from sprung.errors import ParameterError
from sprung.online.store import StoredFrame


def frames(*seqs, vehicle="zafira", boot=7):
    return [StoredFrame(vehicle, boot, seq, 1000 * seq, b"frame %d" % seq) for seq in seqs]


@pytest.mark.parametrize("wrong", [-1, 2**63, 1.0, "1"])
def test_numbers_that_no_frame_has_are_refused(store, wrong) -> None:
    with pytest.raises(ParameterError, match=r"boot=.* must be a whole number from 0 to 2\^63 - 1"):
        store.inbox.add_frames([StoredFrame("zafira", wrong, 0, 0, b"")], now=0)
    with pytest.raises(ParameterError, match="seq="):
        store.inbox.add_frames([*frames(0), StoredFrame("zafira", 7, wrong, 0, b"")], now=0)
    assert store.inbox.cursors() == {}
