"""Reading block by block must give what reading at once gives."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from sprung.errors import DataError
from sprung.formats import read, read_blocks
from sprung.formats.grid import assemble, survey
from sprung.formats.table import Block, Column, Table, rebatch, within


def table(seconds, values, *, n_rows=1 << 16, stamps=True):
    """A table in memory."""

    def all_blocks():
        for first in range(0, values.shape[1], n_rows):
            rows = slice(first, first + n_rows)
            yield Block(1 + first, seconds[rows] if stamps else None, values[:, rows])

    def blocks(first=0, last=None):
        return within(all_blocks(), first, last)

    columns = tuple(Column(f"c{number}", f"c{number}") for number in range(len(values)))
    return Table(Path("run"), columns, "time" if stamps else None, blocks)


def recordings(source, *, sampling_rate=None, n_rows=None):
    facts = survey(source, source.blocks(), sampling_rate=sampling_rate)
    blocks = source.blocks() if n_rows is None else rebatch(source.blocks(), n_rows)
    return list(assemble(source, blocks, facts))


def sine(times):
    return np.stack([np.sin(2 * np.pi * 3 * times), np.cos(2 * np.pi * 2 * times)])


def joined(parts):
    samples = np.concatenate([part.samples for part in parts], axis=1)
    offsets = np.cumsum([0, *(part.n_samples for part in parts)])
    gaps = [
        (int(offset) + gap.index, gap.duration)
        for offset, part in zip(offsets[:-1], parts, strict=True)
        for gap in part.gaps
    ]
    return samples, gaps


def test_jitter_is_resampled_onto_the_true_signal() -> None:
    rng = np.random.default_rng(3)
    times = (np.arange(4000) + rng.uniform(-0.2, 0.2, 4000)) / 100
    (recording,) = recordings(table(times, sine(times)))
    uniform = times[0] + np.arange(recording.n_samples) / recording.sampling_rate
    assert recording.sampling_rate == pytest.approx(100, rel=1e-5)
    assert recording.samples[:, 10:-10] == pytest.approx(sine(uniform)[:, 10:-10], abs=2e-4)
    # Left as they are, the same samples would be off by a hundred times more.
    assert np.abs(sine(times) - sine(times[0] + np.arange(4000) / 100)).max() > 0.02


@pytest.mark.parametrize("n_rows", [300, 1000, 1777])
def test_blocks_of_a_jittering_clock_equal_the_whole(n_rows) -> None:
    rng = np.random.default_rng(4)
    times = (np.arange(10_000) + rng.uniform(-0.3, 0.3, 10_000)) / 100
    times[2000:] += 0.5
    times[5021:] += 3.2
    source = table(times, sine(times))
    (whole,) = recordings(source)
    samples, gaps = joined(recordings(source, n_rows=n_rows))
    np.testing.assert_allclose(samples, whole.samples, rtol=0, atol=1e-9, equal_nan=False)
    assert gaps == [(gap.index, pytest.approx(gap.duration, abs=1e-9)) for gap in whole.gaps]
    assert [gap.duration for gap in whole.gaps] == pytest.approx([0.5, 3.2], abs=0.012)


@pytest.mark.parametrize("cut", [999, 1000, 1001, 1064, 3000])
def test_gap_at_the_edge_of_a_block_is_kept(cut) -> None:
    index = np.arange(5000) + 50 * (np.arange(5000) >= cut)
    source = table(index / 100, sine(index / 100))
    parts = recordings(source, n_rows=1000)
    samples, gaps = joined(parts)
    assert samples == pytest.approx(sine(index / 100))
    assert gaps == [(cut, pytest.approx(0.5))]


def test_every_block_has_its_start() -> None:
    start = 1_700_000_000_000_000_000
    index = np.arange(10_000) + 100 * (np.arange(10_000) >= 4321)
    stamps = (start + index * 10_000_000).astype("M8[ns]")
    parts = recordings(table(stamps, sine(index / 100)), n_rows=1000)
    n_samples = np.cumsum([0, *(part.n_samples for part in parts)])[:-1]
    assert len(parts) > 5
    assert [part.start for part in parts] == [start + int(index[n]) * 10_000_000 for n in n_samples]


def test_rows_with_a_missing_value_leave_a_gap() -> None:
    values = sine(np.arange(1000) / 100)
    values[1, 300:320] = np.nan
    (recording,) = recordings(table(np.arange(1000) / 100, values))
    assert recording.n_samples == 980
    assert [(gap.index, gap.duration) for gap in recording.gaps] == [(300, pytest.approx(0.2))]
    assert "20 rows removed" in recording.history[-1]


def test_missing_values_without_time_stamps_leave_a_gap_too() -> None:
    values = sine(np.arange(1000) / 100)
    values[0, 300:320] = np.nan
    (recording,) = recordings(table(None, values, stamps=False), sampling_rate=100)
    assert [(gap.index, gap.duration) for gap in recording.gaps] == [(300, pytest.approx(0.2))]


def test_dead_channel_stays_and_costs_no_rows() -> None:
    values = sine(np.arange(1000) / 100)
    values[1, 400:] = np.nan
    parts = recordings(table(np.arange(1000) / 100, values), n_rows=200)
    samples, gaps = joined(parts)
    assert samples.shape == (2, 1000)
    assert np.isnan(samples[1, 400:]).all()
    assert gaps == []
    assert any("c1: dead, values in 400 of 1000 rows" in line for line in parts[0].history)


def test_places_of_a_slow_receiver_cost_no_rows() -> None:
    """Fixes once a second, none for 30 s: on lines between them, and the last one where they are far apart."""
    times = np.arange(6000) / 100
    fixes = np.full(6000, np.nan)
    fixes[::100] = 50 + 1e-4 * times[::100]
    fixes[2000:5000] = np.nan
    made = table(times, np.vstack([sine(times), fixes, fixes]))
    columns = (*made.columns[:2], Column("latitude", "latitude"), Column("lon", "lon"))
    (recording,) = recordings(replace(made, columns=columns))
    with pytest.raises(DataError, match="another rate"):  # lateral motion
        recordings(replace(made, columns=(*columns[:2], Column("lat", "lat"), Column("long", "long"))))
    assert recording.n_samples == 6000
    assert recording.samples[-1, :1900] == pytest.approx(50 + 1e-4 * times[:1900])
    assert recording.samples[-1, 1950:4999] == pytest.approx(fixes[1900], abs=6e-5)


def test_rows_of_other_channels_only_are_left_out_without_a_gap() -> None:
    """Two loggers in one file, merged by time: choosing one of them must give its uniform samples."""
    fast = np.arange(1000) / 100
    slow = 0.003 + np.arange(100) / 10
    times = np.concatenate([fast, slow])
    order = np.argsort(times)
    values = np.concatenate([fast, np.full(100, np.nan)])[order][None]
    (recording,) = recordings(table(times[order], values))
    assert recording.gaps == ()
    assert recording.samples[0] == pytest.approx(fast)


@pytest.mark.parametrize("ending", [".csv", ".parquet"])
def test_files_in_blocks_equal_files_at_once(tmp_path: Path, ending) -> None:
    from sprung.formats import write
    from sprung.recording import Channel, Gap, Recording

    rng = np.random.default_rng(5)
    samples = rng.standard_normal((3, 30_000))
    channels = (Channel("a", "acceleration"), Channel("b", "angular_velocity"), Channel("c"))
    recording = Recording(samples, 500.0, channels, start=10**18, gaps=(Gap(7000, 1.5), Gap(8000, 0.002)))
    path = tmp_path / f"run{ending}"
    write(recording, path)
    whole = read(path)
    parts = list(read_blocks(path, block_samples=1000))
    joint, gaps = joined(parts)
    assert len(parts) > 25
    assert np.array_equal(joint, whole.samples)
    assert gaps == [(7000, pytest.approx(1.5)), (8000, pytest.approx(0.002))]
    assert gaps == [(gap.index, pytest.approx(gap.duration)) for gap in whole.gaps]
