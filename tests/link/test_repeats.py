"""Samples that were analysed before are recognised, and no others."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.link import TIME_SET, TIME_UNKNOWN, Frame, decode, encode, frame_block, quantised
from sprung.link.windows import Repeats
from sprung.recording import Channel, Gap, Recording

NOW = 1_795_219_200_000_000_000
SECOND = 10**9


def recording(seed, *, start=NOW, seconds=10):
    samples = np.random.default_rng(seed).standard_normal((2, 100 * seconds))
    return Recording(samples, 100.0, (Channel("a"), Channel("b")), start)


def taken(repeats, whole, *, first=0, last=None, step=100):
    """Whether each second was analysed before."""
    ends = range(first, whole.n_samples if last is None else last, step)
    return [repeats.update(whole.part(k, k + step)) for k in ends]


def test_a_recording_counts_once() -> None:
    repeats = Repeats()
    assert taken(repeats, recording(1)) == [False] * 10
    assert (repeats.repeated, repeats.end) == (0.0, NOW + 10 * SECOND)
    assert taken(repeats, recording(1)) == [True] * 10
    assert repeats.repeated == pytest.approx(10.0)
    assert taken(repeats, recording(2, start=NOW + 60 * SECOND)) == [False] * 10
    assert repeats.repeated == 0.0


def test_one_that_was_interrupted_continues_where_it_stopped() -> None:
    repeats = Repeats()
    taken(repeats, recording(1), last=400)
    assert taken(repeats, recording(1)) == [True] * 4 + [False] * 6


def test_other_samples_at_the_same_time_count() -> None:
    """A box whose clock begins anew with every start loses nothing."""
    repeats = Repeats()
    taken(repeats, recording(1))
    assert taken(repeats, recording(2)) == [False] * 10


def test_the_same_samples_at_another_time_count_where_the_time_is_known() -> None:
    repeats = Repeats()
    taken(repeats, recording(1))
    assert taken(repeats, recording(1, start=NOW + 3600 * SECOND)) == [False] * 10


def frames(whole, status):
    counts, scale, flags = quantised(whole.samples)
    frame = Frame("car", 1, 0, whole.start, 10**7, whole.names, scale, counts, 2, flags, time_status=status)
    return frame_block(decode(encode(frame)), {})


@pytest.mark.parametrize(("status", "is_repeated"), [(TIME_SET, False), (TIME_UNKNOWN, True)])
def test_samples_without_a_time_are_recognised_by_themselves(status, is_repeated) -> None:
    repeats = Repeats()
    assert not repeats.update(frames(recording(1), status))
    assert repeats.update(frames(recording(1, start=NOW + 3600 * SECOND), status)) is is_repeated


def test_samples_without_noise_are_not_recognised() -> None:
    repeats = Repeats()
    dead = replace(recording(1), samples=np.zeros((2, 1000)))
    assert taken(repeats, dead) == taken(repeats, dead) == [False] * 10
    missing = replace(dead, samples=np.full((2, 1000), np.nan))
    assert taken(repeats, missing) == taken(repeats, missing) == [False] * 10


def test_a_gap_within_a_block_is_part_of_it() -> None:
    repeats = Repeats()
    gappy = replace(recording(1), gaps=(Gap(500, 60.0),))
    assert [repeats.update(gappy), repeats.update(gappy)] == [False, True]
    assert repeats.end == NOW + 70 * SECOND


def test_it_continues_from_its_state_and_forgets() -> None:
    repeats = Repeats()
    taken(repeats, recording(1), last=400)
    again = Repeats.from_state(repeats.state())
    assert taken(again, recording(1), first=400) == [False] * 6
    assert taken(again, recording(1)) == [True] * 10
    again.forget()
    assert taken(again, recording(1)) == [False] * 10


def test_memory_is_bounded() -> None:
    repeats = Repeats()
    for seed in range(2100):
        repeats.update(recording(seed, seconds=1, start=NOW + 10 * seed * SECOND))
    assert len(repeats.state()["reached"]) == 2000
    assert repeats.update(recording(2099, seconds=1, start=NOW + 20990 * SECOND))
