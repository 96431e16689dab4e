"""Files, a simulator; continuing after a stop; the pace."""

import itertools
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import pytest

from sprung.formats import ReadSettings, read, write
from sprung.online.box import after, blocks_of, from_files, from_simulator, paced
from sprung.recording import Channel, Gap, Recording
from sprung.simulation import RoadDrive
from sprung.vehicles import read_vehicle

START = 1_700_000_000_000_000_000


def recording(n_samples=1000, *, rate=200.0, start=START, gaps=(), seed=1):
    samples = np.random.default_rng(seed).normal(size=(2, n_samples))
    channels = (Channel("acc_fl", "acceleration"), Channel("speed", "speed"))
    return Recording(samples, rate, channels, start, gaps)


def times(item):
    """Return the times of the samples [ns]."""
    lost = np.zeros(item.n_samples)
    for gap in item.gaps:
        lost[gap.index :] += gap.duration
    return item.start + np.round((np.arange(item.n_samples) / item.sampling_rate + lost) * 1e9).astype(int)


def assert_same(blocks, whole):
    """Blocks put one after the other are the whole: samples, times, channels; none has a gap or is long."""
    assert np.array_equal(np.concatenate([block.samples for block in blocks], axis=1), whole.samples, equal_nan=True)
    off = np.concatenate([times(block) for block in blocks]) - times(whole)
    assert np.abs(off).max() < 0.01e9 / whole.sampling_rate
    assert {block.channels for block in blocks} == {whole.channels}
    assert all(not block.gaps and block.duration < 1.5 for block in blocks)


@pytest.mark.parametrize("n_samples", [1, 2, 99, 100, 299, 300, 1000, 1099, 1100])
def test_blocks_of_a_recording_are_about_a_second(n_samples) -> None:
    whole = recording(n_samples)
    blocks = list(blocks_of(whole))
    assert_same(blocks, whole)
    assert all(block.n_samples == 200 for block in blocks[:-1])
    assert len(blocks) == 1 or blocks[-1].n_samples >= 100


def test_blocks_end_at_gaps() -> None:
    whole = recording(gaps=(Gap(1, 0.5), Gap(450, 3600.0), Gap(999, 0.1)))
    blocks = list(blocks_of(whole))
    assert [block.n_samples for block in blocks] == [1, 200, 249, 200, 200, 149, 1]
    assert_same(blocks, whole)


@pytest.mark.slow
@pytest.mark.parametrize("ending", [".csv", ".parquet"])
@pytest.mark.parametrize("gaps", [(), (Gap(700, 2.5), Gap(150_000, 90.0))])
def test_blocks_of_a_file_are_the_file(tmp_path: Path, ending, gaps) -> None:
    """Longer than the pieces in which it is read, with a gap in time."""
    path = tmp_path / f"run{ending}"
    write(recording(200_123, gaps=gaps), path)
    whole = read(path)
    assert whole.n_samples == 200_123
    assert len(whole.gaps) == len(gaps)
    blocks = list(from_files([path], start=0))
    assert_same(blocks, whole)
    assert sum(block.n_samples != 200 for block in blocks) <= len(gaps) + 1


def starts(blocks: Iterable[Recording]) -> list[float]:
    """Return the times of blocks after START [s]."""
    return [(block.start - START) / 1e9 for block in blocks if block.start is not None]


def text(n_samples, *, first=0.0, rate=100.0, pause=0.0):
    """Return a table whose seconds begin at `first`, with a pause after its first half."""
    seconds = first + np.arange(n_samples) / rate + pause * (np.arange(n_samples) >= n_samples // 2)
    return "t_s,a\n" + "".join(f"{second:.3f},{k}\n" for k, second in enumerate(seconds))


def test_files_without_time_follow_each_other(tmp_path: Path) -> None:
    """Seconds from anywhere do not count, but a pause does; so do rows where there are no seconds at all."""
    (tmp_path / "a.csv").write_text(text(200, first=50.0, pause=7.0))
    (tmp_path / "b.csv").write_text(text(100))
    (tmp_path / "c.csv").write_text("a\n" + "1\n" * 150)
    blocks = list(from_files([tmp_path / "a.csv", tmp_path / "b.csv"], start=START))
    assert starts(blocks) == pytest.approx([0, 8, 9])
    assert [block.n_samples for block in blocks] == [100, 100, 100]
    blocks = list(
        from_files([tmp_path / "c.csv", tmp_path / "b.csv"], start=START, settings=ReadSettings(sampling_rate=100.0))
    )
    assert starts(blocks) == pytest.approx([0, 1, 1.5])


@pytest.mark.parametrize("rate", [100.0, 200.0, 333.0, 1000 / 3])
def test_a_stop_anywhere_loses_and_repeats_nothing(rate) -> None:
    """The time is where the last sample that was kept ends, with an interval in whole nanoseconds, as in frames."""
    whole = recording(2000, rate=rate, gaps=(Gap(700, 20.0),))
    for n_kept in (0, 1, 199, 200, 201, 699, 700, 701, 1999, 2000):
        until = (times(whole)[n_kept - 1] if n_kept else START - round(1e9 / rate)) + round(1e9 / rate)
        blocks = list(after(blocks_of(whole), int(until)))
        found = np.concatenate([np.empty((2, 0)), *[block.samples for block in blocks]], axis=1)
        assert np.array_equal(found, whole.samples[:, n_kept:])
        if blocks:
            assert blocks[0].start == pytest.approx(times(whole)[n_kept], abs=1)


class Clock:
    """A clock that only moves when somebody sleeps, or works."""

    def __init__(self):
        self.now = 50.0
        self.slept = []

    def __call__(self):
        return self.now

    def sleep(self, seconds):
        self.slept.append(seconds)
        self.now += seconds


@pytest.mark.parametrize("pace", [0.5, 1.0, 20.0])
def test_blocks_come_as_fast_as_they_were_recorded(pace) -> None:
    clock = Clock()
    ends = []
    for block in paced(blocks_of(recording(1000, gaps=(Gap(400, 3600.0),))), pace, clock=clock, sleep=clock.sleep):
        ends.append(clock.now - 50.0)
        assert block.n_samples == 200
    assert ends == pytest.approx(np.arange(1, 6) / pace)


def test_pace_is_kept_when_work_takes_time() -> None:
    """Work of 0.4 s a block is made up for; work that takes longer than the blocks is not waited for."""
    clock = Clock()
    for _ in paced(blocks_of(recording(1000)), 1.0, clock=clock, sleep=clock.sleep):
        clock.now += 0.4
    assert clock.now == pytest.approx(50 + 5 + 0.4)
    clock = Clock()
    for _ in paced(blocks_of(recording(1000)), 10.0, clock=clock, sleep=clock.sleep):
        clock.now += 1.0
    assert clock.slept == pytest.approx([0.1])


def test_simulator_is_the_same_every_time_and_goes_on() -> None:
    vehicle = read_vehicle("zafira")

    def taken(n_blocks, seed=3):
        settings = RoadDrive(duration=3.0)
        return list(
            itertools.islice(from_simulator(vehicle, lambda _number: settings, start=START, seed=seed), n_blocks)
        )

    blocks = taken(7)
    assert starts(blocks) == [0, 1, 2, 3, 4, 5, 6]
    assert all(np.array_equal(one.samples, other.samples) for one, other in zip(blocks, taken(7), strict=True))
    assert not np.array_equal(blocks[0].samples, blocks[3].samples)
    assert not np.array_equal(blocks[0].samples, taken(1, seed=4)[0].samples)
