"""Clocks that contradict themselves, and short gaps that are bridged."""

import numpy as np
import pytest
from tests.formats.conftest import said

from sprung.errors import DataError, FormatError, ParameterError
from sprung.formats import ReadSettings, read, read_blocks

RATE = 50.0


def file_of(write, stamps, *, header="time [s]"):
    rng = np.random.default_rng(3)
    return write(
        f"{header},a\n"
        + "".join(
            f"{stamp},{value:.6f}\n" for stamp, value in zip(stamps, rng.standard_normal(len(stamps)), strict=True)
        )
    )


SECONDS = np.arange(1000) / RATE
STEPPED_BACK = [f"{second:.2f}" for second in np.where(SECONDS < 10, SECONDS, SECONDS - 3)]
TO_THE_MINUTE = [f"2024-05-31 12:{int(second // 60):02d}" for second in np.arange(6000) / RATE]
TO_THE_SECOND = [f"2024-05-31 12:00:{int(second):02d}" for second in SECONDS]
MIXED = np.cumsum(np.tile([0.02] * 7 + [0.5], 125))
NO_TIME = [f"{second:.2f}" if index != 400 else "" for index, second in enumerate(SECONDS)]


@pytest.mark.parametrize(
    ("stamps", "error", "question"),
    [
        (STEPPED_BACK, FormatError, r"line 502: time runs backwards: .* state --sampling-rate"),
        (TO_THE_MINUTE, DataError, "share one time stamp: state --sampling-rate"),
        (TO_THE_SECOND, DataError, "1000 rows share 20 time stamps, too few for a rate: state --sampling-rate"),
        (MIXED, DataError, "time jumps 125 times in 1000 rows"),
        (NO_TIME, FormatError, "line 402: column .* holds no time"),
    ],
    ids=["steps back", "to the minute", "to the second", "mixed", "no time"],
)
def test_clock_that_contradicts_itself_is_questioned_and_overruled(text_file, stamps, error, question) -> None:
    path = file_of(text_file, stamps, header="time")
    with pytest.raises(error, match=question):
        read(path)
    recording = read(path, sampling_rate=RATE)
    assert (recording.sampling_rate, recording.n_samples, recording.gaps) == (RATE, len(stamps), ())
    assert said(recording, "50 Hz as stated, in place of an inconsistent clock (")
    blocks = list(read_blocks(path, sampling_rate=RATE, block_samples=1000))
    assert np.array_equal(np.concatenate([block.samples for block in blocks], axis=1), recording.samples)
    if error is DataError and stamps is not MIXED:
        assert np.datetime64(recording.start, "ns") == np.datetime64("2024-05-31T12:00")


def test_stamps_to_the_second_over_minutes_give_the_rate(text_file) -> None:
    stamps = (np.arange(9000) / RATE).astype(int)
    assert read(file_of(text_file, stamps)).sampling_rate == pytest.approx(RATE, rel=2e-3)
    recording = read(file_of(text_file, stamps), sampling_rate=52)
    assert recording.sampling_rate == 52
    assert said(recording, "several rows share a stamp")


def test_milliseconds_under_the_name_of_seconds(text_file) -> None:
    """0.05 Hz, and gaps of 44 s: really 50 Hz."""
    stamps = 20 * np.arange(700) + 44 * (np.arange(700) // 100)
    doubted = read(file_of(text_file, stamps))
    assert doubted.sampling_rate == pytest.approx(0.05)
    assert said(doubted, "is 0.05 Hz right?")
    recording = read(file_of(text_file, stamps), sampling_rate=RATE)
    assert recording.sampling_rate == RATE
    assert said(recording, "advances at 0.05 Hz, which is hardly that of a measurement of motion")
    plain = read(file_of(text_file, stamps, header="Time"))
    assert plain.sampling_rate == pytest.approx(RATE)
    assert [gap.duration for gap in plain.gaps] == pytest.approx([0.044] * 6)


def test_clean_clock_is_not_overruled(text_file) -> None:
    with pytest.raises(ParameterError, match="sampling_rate=52 contradicts the time column"):
        read(file_of(text_file, SECONDS), sampling_rate=52)


def sines(seconds):
    return np.stack([np.sin(2 * np.pi * 1.3 * seconds), np.cos(2 * np.pi * 0.7 * seconds)])


@pytest.mark.parametrize("jitter", [0.0, 0.2])
def test_short_gaps_are_bridged(text_file, jitter) -> None:
    index = np.setdiff1d(np.arange(2000), [300, 301, 302, *range(900, 960), 1400])
    seconds = (index + jitter * np.random.default_rng(1).uniform(-1, 1, index.size)) / RATE
    values = sines(seconds)
    rows = "".join(f"{t:.6f},{a:.9f},{b:.9f}\n" for t, a, b in zip(seconds, *values, strict=True))
    path = text_file("time,a,b\n" + rows)
    assert len(read(path).gaps) == (3 if not jitter else 2)  # where a clock is unsteady, one sample is no gap
    recording = read(path, settings=ReadSettings(bridge=0.5))
    assert [gap.duration for gap in recording.gaps] == pytest.approx([1.2], abs=0.03)
    assert said(recording, "bridged by cubic interpolation")
    if not jitter:
        assert said(recording, "2 gaps of 0.08 s in all bridged by cubic interpolation")
        assert recording.n_samples == 2000 - 60
        assert recording.samples[:, :900] == pytest.approx(sines(np.arange(900) / RATE), abs=1e-3)
    blocks = list(read_blocks(path, settings=ReadSettings(bridge=0.5), block_samples=1000))
    samples = np.concatenate([block.samples for block in blocks], axis=1)
    np.testing.assert_allclose(samples, recording.samples, rtol=0, atol=1e-6, equal_nan=False)


def test_gap_at_an_end_is_not_bridged(text_file) -> None:
    index = np.setdiff1d(np.arange(100), [2, 97])
    path = text_file("time,a\n" + "".join(f"{k / 50:.2f},{k}\n" for k in index))
    assert len(read(path, settings=ReadSettings(bridge=1.0)).gaps) == 2


def test_missing_values_are_bridged(text_file) -> None:
    text = "time,a,b\n" + "".join(f"{k / 50:.2f},{k},{k if k not in (40, 41) else ''}\n" for k in range(100))
    recording = read(text_file(text), settings=ReadSettings(bridge=0.1))
    assert recording.gaps == ()
    assert recording.samples == pytest.approx(np.stack([np.arange(100.0)] * 2))
