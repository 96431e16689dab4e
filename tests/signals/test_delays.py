"""Channels advanced by fractions of a sample."""

import numpy as np
import pytest

from sprung.signals.conditioning import advanced, advanced_linearly
from sprung.signals.data_faults import clipped_share, stuck_runs


@pytest.mark.parametrize("shift", [2.3, -2.3, 0.5, 7.0, -0.001])
@pytest.mark.parametrize("frequency", [0.003, 0.1, 0.4])
def test_a_sine_arrives_earlier(frequency, shift) -> None:
    """Sines up to 0.8 of half the sampling rate, known at every time, away from the ends."""
    phase = 2 * np.pi * frequency
    moved = advanced(np.sin(phase * np.arange(500)), shift)
    inner = slice(45, 455)
    assert moved[inner] == pytest.approx(np.sin(phase * (np.arange(500) + shift))[inner], abs=1e-4)


def test_only_what_was_recorded_is_there() -> None:
    line = np.arange(6.0)
    assert advanced(line, 0.5) == pytest.approx([0.5, 1.5, 2.5, 3.5, 4.5, np.nan], nan_ok=True)
    assert advanced(line, -0.5) == pytest.approx([np.nan, 0.5, 1.5, 2.5, 3.5, 4.5], nan_ok=True)
    assert np.isnan(advanced(line, 6.0)).all()
    assert np.isnan(advanced(line, -7.5)).all()
    assert np.isnan(advanced(np.full(4, np.nan), 0.5)).all()
    assert advanced(np.zeros(0), 0.5).size == 0


def test_nothing_crosses_a_gap_or_a_missing_value() -> None:
    halves = np.concatenate([np.zeros(50), 100 + np.arange(50.0)])
    moved = advanced(halves, 0.5, breaks=[50])
    assert moved[:49].tolist() == [0.0] * 49
    assert moved[50:99] == pytest.approx(100.5 + np.arange(49.0))
    assert np.flatnonzero(np.isnan(moved)).tolist() == [49, 99]
    halves[49] = np.nan
    assert np.flatnonzero(np.isnan(advanced(halves, 0.5))).tolist() == [48, 49, 99]


def test_no_shift_changes_nothing() -> None:
    values = np.random.default_rng(0).standard_normal(100)
    np.testing.assert_array_equal(advanced(values, 0.0), values)
    np.testing.assert_array_equal(advanced(values, 1.0)[:-1], values[1:])


def test_clipped_and_stuck_samples_stay_so() -> None:
    values = np.clip(np.sin(2 * np.pi * 0.011 * np.arange(2000)), -0.8, 0.8)
    assert clipped_share(advanced(values, 3.4)) == pytest.approx(clipped_share(values), rel=0.05)
    values[500:800] = 0.123
    starts, lengths = stuck_runs(advanced(values, 3.4), 100.0)
    assert (starts.tolist(), lengths.tolist()) == ([497], [300])


def test_a_constant_speed_stays_exactly_constant() -> None:
    speed = np.repeat([10.1, 10.1, 12.3], 10)
    moved = advanced_linearly(speed, 5.25)
    assert set(moved[:14]) == {10.1}
    assert moved[14] == pytest.approx(10.1 + 0.25 * 2.2)
    assert np.isnan(moved[24:]).all()
