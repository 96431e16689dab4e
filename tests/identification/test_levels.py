"""Correlations by expected level: nothing is lost, only the past counts, and a linear system shows no trend."""

from itertools import pairwise

import numpy as np
import pytest
from scipy.signal import lfilter

from sprung.identification.correlation import average, correlate_segments
from sprung.identification.levels import correlate_by_level, expected_levels, joined_levels, level_sets
from sprung.identification.subspace import poles_of_orders, realise
from sprung.recording import Channel, Recording

N_LAGS = 24
POLE = 2 * np.pi * 8.0 * (-0.03 + 1j * np.sqrt(1 - 0.03**2))
RATE = 100.0


def recorded(samples):
    scaled = samples / samples.std(axis=1, keepdims=True)
    return Recording(scaled, RATE, tuple(Channel(f"a{k}") for k in range(len(samples))))


def oscillator(seed, n_samples, gain=1.0):
    """Two sensors, with noise, on an oscillator of 8 Hz and 3 % that white noise of the given gain drives."""
    generator = np.random.default_rng(seed)
    eigenvalue = np.exp(POLE / RATE)
    force = gain * generator.normal(size=n_samples)
    motion = lfilter([1.0], [1.0, -2 * eigenvalue.real, np.abs(eigenvalue) ** 2], force)
    return recorded(np.array([[1.0], [-0.6]]) * motion + generator.normal(size=(2, n_samples)))


def test_the_classes_add_up_to_the_correlations_of_the_segments() -> None:
    record = oscillator(0, 3000)
    levels = correlate_by_level(record, n_lags=N_LAGS, segment=4.0)
    whole = correlate_segments(record, n_lags=N_LAGS, segment=4.0, is_continued=True)
    assert len(np.unique(levels.classes)) > 5
    for k in range(whole.n_segments):
        of_segment = levels.segments == k
        np.testing.assert_allclose(levels.parts.sums[of_segment].sum(axis=0), whole.sums[k], atol=1e-8)
        np.testing.assert_array_equal(levels.parts.n_products[of_segment].sum(axis=0), whole.n_products[k])


def test_powers_are_the_mean_squares_at_the_later_factor() -> None:
    record = oscillator(1, 800)
    levels = correlate_by_level(record, n_lags=N_LAGS)
    power = np.mean(record.samples**2, axis=0)
    for lag in (0, 5):
        assert levels.powers[:, lag].sum() == pytest.approx(power[lag:].sum(), rel=1e-9)


def test_one_range_is_the_average() -> None:
    record = recorded(np.random.default_rng(2).normal(size=(2, 3000)))
    (only,) = level_sets(correlate_by_level(record, n_lags=N_LAGS, segment=4.0), 1)
    whole = average(correlate_segments(record, n_lags=N_LAGS, segment=4.0, is_continued=True))
    np.testing.assert_allclose(only.correlations.values, whole.values, atol=1e-9)
    np.testing.assert_allclose(only.correlations.blocks, whole.blocks, atol=1e-9)
    assert only.correlations.n_segments == whole.n_segments


def test_ranges_rise_in_level_and_share_the_products() -> None:
    gain = np.repeat([1.0, 3.0, 2.0, 4.0], 3000)
    record = oscillator(3, 12000, gain)
    sets = level_sets(correlate_by_level(record, n_lags=N_LAGS, segment=2.5), 3)
    assert len(sets) == 3
    for lower, upper in pairwise(sets):
        assert lower.level[1] <= upper.level[0] * (1 + 1e-9)
        assert upper.powers[0] > 1.5 * lower.powers[0]
    sizes = [part.correlations.n_segments for part in sets]
    assert min(sizes) > 0.2 * sum(sizes)
    assert len({len(part.correlations.blocks) for part in sets}) == 1


def test_the_expected_level_follows_a_step_and_starts_at_the_mean() -> None:
    levels = expected_levels(oscillator(4, 8000, np.repeat([1.0, 4.0], 4000)), N_LAGS)
    assert levels[4400:].mean() > 2.5 * levels[400:4000].mean()
    assert levels[0] == pytest.approx(np.exp(np.mean(np.log(levels))), rel=0.2)


def test_the_future_does_not_count() -> None:
    """A pothole changes the weights of the windows a little, and no level before it beyond that."""
    record = oscillator(5, 6000)
    samples = record.samples.copy()
    samples[:, 5000:5003] += 3.0
    before = expected_levels(record, N_LAGS)[:5000]
    after = expected_levels(record.changed("pothole", samples=samples), N_LAGS)[:5000]
    assert np.corrcoef(before, after)[0, 1] > 0.99
    np.testing.assert_allclose(after, before, rtol=0.1)


def test_records_keep_their_numbers() -> None:
    parts = [correlate_by_level(oscillator(seed, 2000), n_lags=N_LAGS, segment=5.0) for seed in range(3)]
    together = joined_levels(parts)
    assert np.unique(together.segments).tolist() == list(range(12))
    (only,) = level_sets(together, 1)
    assert only.correlations.records == (0,) * 4 + (1,) * 4 + (2,) * 4
    assert together.span == (min(part.span[0] for part in parts), max(part.span[1] for part in parts))


@pytest.mark.parametrize("gain", ["steady", "slow"])
def test_a_linear_system_has_the_same_pole_at_every_level(gain) -> None:
    """Sorted by the level of the products themselves, the damping differs by tens of per cent."""
    n_samples = 60000
    slow = 2.0 ** np.sin(2 * np.pi * np.arange(n_samples) / 3000) if gain == "slow" else 1.0
    sets = level_sets(correlate_by_level(oscillator(6, n_samples, slow), n_lags=40, segment=10.0), 3)
    for part in sets:
        poles = poles_of_orders(realise(part.correlations, block_rows=20, max_order=2), [2])
        assert abs(poles.natural_frequency[0] - 8.0) < 3 * poles.natural_frequency_std[0]
        assert abs(poles.damping_ratio[0] - 0.03) < 3 * poles.damping_ratio_std[0]
        assert poles.damping_ratio_std[0] < 0.004
