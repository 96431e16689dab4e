"""Faults of data that a channel shows by itself."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sprung.signals.data_faults import (
    clipped_share,
    constant_value,
    count_spikes,
    equal_runs,
    filler,
    has_runs,
    missing_share,
    plateaus,
    repeated_samples,
    rest_of,
    stuck_runs,
)

NOISE = np.random.default_rng(1).standard_normal(6000)


def test_runs_of_equal_values() -> None:
    values = np.array([1.0, 1.0, 2.0, np.nan, np.nan, 3.0, 3.0, 3.0])
    starts, lengths = equal_runs(values, breaks=[6])
    assert starts.tolist() == [0, 2, 3, 4, 5, 6]
    assert lengths.tolist() == [2, 1, 1, 1, 1, 2]
    at_10_hz = np.concatenate([np.arange(5.0), np.full(10, 7.0), np.arange(9.0)])
    assert [part.tolist() for part in stuck_runs(at_10_hz, 10.0)] == [[5], [10]]
    assert stuck_runs(at_10_hz, 11.0)[0].size == 0
    assert stuck_runs(at_10_hz, 10.0, breaks=[9])[0].size == 0


def test_shares_of_clipped_and_missing_values() -> None:
    assert clipped_share(np.array([0.0, 3.0, 3.0, 3.0, -1.0])) == pytest.approx(0.6)
    assert clipped_share(np.array([0.0, 3.0, 3.0, 3.0, -1.0]), breaks=[2]) == 0
    assert clipped_share(np.full(3, np.nan)) == 0
    assert missing_share(np.array([1.0, np.nan, np.inf, 2.0])) == pytest.approx(0.5)
    assert missing_share(np.zeros(0)) == 1


def test_a_constant_within_a_tolerance() -> None:
    assert constant_value(np.array([2.0, np.nan, 2.0])) == 2
    rising = 2 + 1e-13 * np.arange(3.0)
    assert constant_value(rising) is None
    assert constant_value(rising, tolerance=1e-12) == 2
    assert constant_value(np.full(3, np.nan)) is None


def test_rest_counts_while_the_vehicle_moves() -> None:
    values = NOISE.copy()
    values[1000:2500] = 0.5
    rest = rest_of(values, 100.0)
    assert (rest.n_resting, rest.longest, rest.value, rest.share) == (1500, 1500, 0.5, 0.25)
    assert rest.is_fault(100.0)
    moving = np.arange(6000) >= 2500
    assert rest_of(values, 100.0, is_moving=moving).n_resting == 0
    assert rest_of(values, 100.0, is_moving=moving).n_values == 3500


@pytest.mark.parametrize(("length", "is_fault"), [(90, False), (110, False), (150, True), (210, True)])
def test_rest_is_a_fault_from_two_per_cent_on(length, is_fault) -> None:
    values = NOISE.copy()
    values[1000 : 1000 + length] = 0.0
    assert rest_of(values, 100.0).is_fault(100.0) is is_fault


@pytest.mark.parametrize("value", [-999.0, 9999.0, 32767.0, -1e5])
def test_filler_is_a_repeated_value_far_outside(value) -> None:
    values = NOISE.copy()
    values[[3, 70, 71, 4000]] = value
    assert filler(values) == (value, 4)


def test_limits_spikes_and_impacts_are_no_fillers() -> None:
    spikes = NOISE.copy()
    spikes[[3, 70, 4000]] = [900.0, 800.0, -700.0]
    for values in (np.clip(NOISE, -1, 1), spikes, NOISE, np.zeros(50), np.full(5, np.nan), np.zeros(0)):
        assert filler(values) is None


def test_repeated_stretch_is_found_by_its_length() -> None:
    values = NOISE.copy()
    values[3000:3080] = values[500:580]
    assert repeated_samples(values, 100.0) == 80
    values[3040] += 1e-12
    assert repeated_samples(values, 100.0) == 0


def test_periodic_coarse_and_resting_channels_do_not_repeat() -> None:
    sine = np.sin(2 * np.pi * np.arange(6000) / 100)
    coarse = np.round(NOISE * 2) / 2
    quiet = np.where(np.arange(6000) % 7 == 0, 0.125, 0.0)
    for values in (sine, np.round(sine, 3), coarse, quiet, np.zeros(6000), np.full(6000, np.nan), NOISE[:60]):
        assert repeated_samples(np.asarray(values, dtype=np.float64), 100.0) == 0


def test_spikes_are_counted_by_place() -> None:
    values = NOISE.copy()
    values[[100, 2000, 4000]] += [30, 40, -40]
    assert count_spikes(values) == 3
    assert count_spikes(np.cumsum(NOISE)) == 0
    assert count_spikes(NOISE[:3]) == 0
    assert count_spikes(np.where(np.arange(6000) % 900 == 7, 0.125, 0.0)) == 0  # the smallest step of a resting sensor
    assert count_spikes(np.zeros(100)) == 0
    traces = np.zeros(6000)
    traces[[10, 11, 2000]] = 5e-324, 1e-300, 3.0  # of rounding, beside one spike
    assert count_spikes(traces) == 1
    pothole = np.convolve(NOISE, np.hanning(9), mode="same")
    pothole[3000:3020] += 40 * np.hanning(20)
    assert count_spikes(pothole) == 0


@given(seed=st.integers(0, 1000), gain=st.floats(1e-6, 1e6), offset=st.floats(-10, 10), decimals=st.integers(2, 9))
def test_healthy_noise_has_no_fault(seed, gain, offset, decimals) -> None:
    values = gain * (np.round(np.random.default_rng(seed).standard_normal(3000), decimals) + offset)
    assert filler(values) is None
    assert repeated_samples(values, 100.0) == 0
    assert count_spikes(values) == 0
    assert not rest_of(values, 100.0).is_fault(100.0)


@given(st.lists(st.sampled_from([0.0, 1.0, 2.0, 3.0, np.nan]), min_size=1, max_size=60))
def test_a_channel_without_runs_is_neither_stuck_nor_clipped(drawn) -> None:
    """Against the runs themselves, at any sampling rate; and a missing value is a reason to look closer."""
    values = np.array(drawn)
    if has_runs(values):
        return
    assert not np.isnan(values).any()
    assert stuck_runs(values, 1.0)[0].size == 0
    assert plateaus(values, values.min(), values.max()) == (0, 0)


def test_runs_within_the_range_that_are_short_are_none() -> None:
    rising = np.arange(30.0)
    assert not has_runs(np.concatenate([[-1.0], np.repeat(rising, 9), [40.0]]))
    assert has_runs(np.concatenate([rising, np.full(10, 12.5), rising]))
    assert has_runs(np.concatenate([rising, [29.0, 29.0]]))
    assert has_runs(np.concatenate([[0.0, 0.0], rising]))
