"""Blocks in order of time become one recording; a frame is a block."""

from itertools import pairwise

import numpy as np
import pytest

from sprung.link import Frame, frame_block, joined
from sprung.recording import Channel, Gap, Recording

#: 2026-11-21, UTC ns.
BEGUN = 1_795_219_200_000_000_000


def test_gaps_and_steps_of_the_clock() -> None:
    channel = (Channel("a", "acceleration"),)

    def block(start):
        return Recording(np.zeros((1, 100)), 100.0, channel, BEGUN + round(start * 1e9))

    assert joined([block(0), block(1), block(2.01)]).gaps == ()
    (gap,) = joined([block(0), block(1), block(5)]).gaps
    assert (gap.index, gap.duration) == (200, pytest.approx(3.0))
    (back,) = joined([block(0), block(-3600)]).gaps
    assert (back.index, back.duration) == (100, 0.01)


def test_a_frame_is_a_block_of_its_samples() -> None:
    counts = np.array([[1, -2, 3], [-32768, 5, -6]])
    frame = Frame("v", 7, 9, BEGUN, 5_000_000, ("a", "b"), np.array([0.5, 2.0]), counts, 2)
    block = frame_block(frame, {"a": "acceleration", "other": "speed"})
    assert block.channels == (Channel("a", "acceleration"), Channel("b", "unknown"))
    assert (block.start, block.sampling_rate, block.n_samples, block.gaps) == (BEGUN, 200.0, 3, ())
    assert np.array_equal(block.samples, [[0.5, -1.0, 1.5], [np.nan, 10.0, -12.0]], equal_nan=True)


def test_pieces_of_a_recording_give_it_back() -> None:
    samples = np.random.default_rng(1).normal(size=(2, 700))
    whole = Recording(samples, 100.0, (Channel("a"), Channel("b")), BEGUN, (Gap(300, 2.0),))
    again = joined([whole.part(first, last) for first, last in pairwise((0, 1, 250, 350, 700))])
    assert np.array_equal(again.samples, samples)
    assert (again.start, again.gaps) == (BEGUN, whole.gaps)
