"""Suspension telemetry: header, counts, parts, and damaged files."""

import struct

import numpy as np
import pytest

from sprung.errors import FormatError
from sprung.formats import read
from sprung.formats.settings import ReadSettings

COUNTS = np.random.default_rng(3).integers(0, 4096, (500, 2))


def sst(*, rate=1000, time=1_658_650_000, counts=COUNTS, tail=b""):
    return struct.pack("<3sBHHq", b"SST", 2, rate, 0, time) + counts.astype("<u2").tobytes() + tail


def test_counts_rate_and_start(tmp_path) -> None:
    (tmp_path / "run.SST").write_bytes(sst(tail=b"\1\2"))
    run = read(tmp_path / "run.SST")
    assert (run.names, run.sampling_rate, run.start) == (("fork", "shock"), 1000.0, 1_658_650_000 * 10**9)
    assert np.array_equal(run.samples, COUNTS.T)
    assert "fork: unit 'counts' is unknown, values as in the file" in run.history


def test_part_of_one_channel_without_a_clock(tmp_path) -> None:
    (tmp_path / "run.SST").write_bytes(sst(time=131_072))
    settings = ReadSettings(channels=("shock",), start=0.1, end=0.2)
    run = read(tmp_path / "run.SST", settings=settings)
    assert run.start is None
    assert np.array_equal(run.samples[0, :100], COUNTS[100:200, 1])


@pytest.mark.parametrize("content", [sst(rate=0), sst(counts=COUNTS[:0])])
def test_damaged_files_are_refused(tmp_path, content) -> None:
    (tmp_path / "run.SST").write_bytes(content)
    with pytest.raises(FormatError, match="cannot be read as SST"):
        read(tmp_path / "run.SST")
