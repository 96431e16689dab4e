"""Records one at a time: the plan from the first usable one, bounded memory, bad records left out."""

import weakref
from dataclasses import replace

import numpy as np
import pytest
from tests.identification.runs import run

from sprung.errors import DataError
from sprung.identification import IdentificationSettings, RunningSummary, summarise
from sprung.identification.settings import ACS
from sprung.identification.steps import correlate, no_report
from sprung.recording import Channel, Gap
from sprung.signals.harmonics import Harmonic


def correlated(records, **settings):
    wishes = IdentificationSettings(**{"harmonics": (), **settings})
    return correlate(ACS, records, settings=wishes, vehicle=None, report=no_report).measured


def test_records_of_an_iterator_do_not_pile_up() -> None:
    """While a record is made, the generator and the identification may hold the one before it, and no older one."""
    held = []

    def one_by_one():
        for seed in range(5):
            record = run.__wrapped__(seed)
            held.append(weakref.ref(record.samples))
            assert all(samples() is None for samples in held[:-2])
            yield record

    found = correlated(one_by_one(), segment=10.0)
    assert len(held) == 5
    assert found.segments.n_segments == 30


def test_the_first_usable_record_makes_the_plan() -> None:
    """The first record is dead, the second too short, the third is good, the fourth is dead."""
    good = [run(0), run(1)]
    dead = good[0].changed("cable off", samples=np.zeros_like(good[0].samples))
    short = good[1].part(0, 150)
    found = correlated([dead, short, good[0], dead, good[1]], segment=10.0)
    alone = correlated(good, segment=10.0)
    assert found.plan == alone.plan
    np.testing.assert_array_equal(found.segments.sums, alone.segments.sums)
    assert [note.split(" left out")[0] for note in found.notes] == ["record 1", "record 2", "record 4"]


def test_known_lines_of_a_wheel_have_the_band_of_the_speeds_of_all_records() -> None:
    """Not of the recording that they were found in."""
    wheel = Harmonic(0.5, "speed", (20.0, 30.0), 0.01, 15.0, ("a",))

    def at(speed, seed):
        record = run(seed)
        samples = np.vstack([record.samples, np.full(record.n_samples, speed)])
        return replace(record, samples=samples, channels=(*record.channels, Channel("speed", "speed")))

    (line,) = correlated([at(10.0, 0), at(16.0, 1), at(12.0, 2)], segment=10.0, harmonics=(wheel,)).harmonics
    assert line.band == (pytest.approx(4.95), pytest.approx(8.08))
    assert replace(line, band=wheel.band) == wheel


def test_short_gaps_every_half_second_name_the_option_that_bridges_them() -> None:
    whole = run(0)
    kept = np.arange(whole.n_samples) % 60 < 50
    gaps = tuple(Gap(index, 10 / whole.sampling_rate) for index in range(50, int(kept.sum()), 50))
    with pytest.raises(DataError, match=r"across the gaps, usually of 0\.02 s, with --bridge 0\.022, record longer"):
        correlated([replace(whole, samples=whole.samples[:, kept], gaps=gaps)])


def test_without_a_usable_record_the_first_reason_is_raised() -> None:
    short = run(0).part(0, 150)
    dead = run(0).changed("cable off", samples=np.zeros((3, 30_000)))
    with pytest.raises(DataError, match=r"^the longest stretch without a gap has 150 samples"):
        correlated([short, dead])
    with pytest.raises(DataError, match=r"^there is no recording to identify modes from"):
        correlated([])


@pytest.mark.parametrize("method", ["cov", "coss"])
def test_records_as_they_come_give_what_all_of_them_give(method) -> None:
    records = [run(0), run(1, duration=30.0), run(2).part(0, 150), run(3, duration=30.0)]
    settings = IdentificationSettings(harmonics=(), segment=5.0, refine=False)
    running = RunningSummary(method, settings=settings, duration=sum(record.duration for record in records))
    with pytest.raises(DataError, match="there is no recording"):
        _ = running.summary
    for record in records:
        running.update(record)
    assert running.n_records == 4
    expected = summarise(method, records, settings=settings)
    assert running.summary.plan == expected.plan
    np.testing.assert_array_equal(running.summary.average.blocks, expected.average.blocks)
    for (level, own), (expected_level, of_all) in zip(running.summary.subsets, expected.subsets, strict=True):
        assert level == expected_level
        np.testing.assert_array_equal(own.values, of_all.values)
