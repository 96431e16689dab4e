"""Replayed samples have the time of the recording, where it has one."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.formats import write
from sprung.link import TIME_SET, TIME_UNKNOWN
from sprung.online.box.sources import replay_times
from sprung.recording import Channel, Recording

#: 2026-11-21 00:00 UTC.
NOW = 1_795_219_200_000_000_000
SECOND = 10**9


@pytest.fixture
def file_of(tmp_path):
    """Return a function that writes a minute of noise, with a start or without."""

    def written(name, start=None):
        samples = np.random.default_rng(1).standard_normal((1, 6000))
        path = tmp_path / name
        write(Recording(samples, 100.0, (Channel("acc", "acceleration"),), start), path)
        return path

    return written


def test_files_without_a_start_end_now(file_of) -> None:
    paths = [file_of("a.parquet"), file_of("b.parquet", NOW - 10**15), file_of("c.csv")]
    times = replay_times(paths, now=NOW)
    assert times.start == pytest.approx(NOW - 120 * SECOND, abs=SECOND)
    assert times.status == TIME_UNKNOWN
    assert times.notes == [
        f"no start time in {paths[0]} and 1 other file: samples count from 2026-11-20 23:58 UTC on, so that they end "
        "now; give --start TIME for the time of recording"
    ]


@pytest.mark.parametrize("text", ["2026-11-19T08:30", "2026-11-19 09:30:00+01:00"])
def test_a_given_start_counts(file_of, text) -> None:
    times = replay_times([file_of("a.parquet")], now=NOW, start=text)
    assert times.start == NOW - (39 * 3600 + 1800) * SECOND
    assert times.status == TIME_SET
    assert times.notes[0].endswith("samples count from 2026-11-19 08:30 UTC on, as given")


def test_a_given_start_that_no_file_needs_is_noted(file_of) -> None:
    path = file_of("a.parquet", NOW - 10**15)
    assert replay_times([path], now=NOW, start="2026-11-19").notes == [
        "--start is not used: every file states its own start time"
    ]
    assert replay_times([path], now=NOW).notes == []


def test_a_start_that_is_no_time_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"--start 'noon' is not a time: write it like 2026-11-21T08:30"):
        replay_times([], now=NOW, start="noon")
