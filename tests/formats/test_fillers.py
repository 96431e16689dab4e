"""Numbers that a logger writes where it has no value."""

import numpy as np
import pytest

from sprung.formats import read, read_blocks
from sprung.formats.table import FillerCount, without_fillers

RNG = np.random.default_rng(2)


def text(values, unit="g"):
    rows = "".join(f"{k / 100:.2f},{a:.5f},{b:g}\n" for k, (a, b) in enumerate(zip(*values, strict=True)))
    return f"time,a [{unit}],b [{unit}]\n{rows}"


@pytest.mark.parametrize("number", [-999, 9999, 32767, -32768, -999.9])
def test_filler_becomes_a_missing_value_and_is_named(text_file, number) -> None:
    values = RNG.standard_normal((2, 2000))
    values[1, [50, 51, 52, 1700]] = number
    path = text_file(text(values))
    recording = read(path)
    assert recording.n_samples == 1996
    assert [(gap.index, round(gap.duration, 6)) for gap in recording.gaps] == [(50, 0.03), (1697, 0.01)]
    assert f"b: {number:g} in 4 rows is a filler, far from all other values: taken as missing" in recording.history
    blocks = np.concatenate([block.samples for block in read_blocks(path, block_samples=1000)], axis=1)
    assert np.array_equal(blocks, recording.samples)


def test_channel_that_mostly_holds_fillers_is_kept(text_file) -> None:
    values = RNG.standard_normal((2, 2000))
    values[1, 400:] = 9999
    recording = read(text_file(text(values)))
    assert recording.n_samples == 2000
    assert recording.gaps == ()


def test_raw_counts_at_their_limit_are_no_fillers(text_file) -> None:
    values = np.clip(np.round(20_000 * RNG.standard_normal((2, 2000))), -32768, 32767)
    recording = read(text_file(text(values, unit="-")))
    assert recording.n_samples == 2000
    assert np.array_equal(recording.samples, values)


def test_counts_over_blocks() -> None:
    values = RNG.standard_normal((3, 300))
    values[1, [3, 150, 299]] = -999
    values[2, [3, 150]] = -999  # too few
    count = FillerCount(3)
    for part in np.array_split(values, 7, axis=1):
        count.update(part)
    assert [count.fillers(channel) for channel in range(3)] == [{}, {-999.0: 3}, {}]
    cleaned = without_fillers(values, ((), (-999.0,), ()))
    assert np.isnan(cleaned).sum() == 3
    assert without_fillers(values, ((), (), ())) is values
