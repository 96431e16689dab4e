"""Correlations by level, expected or own: nothing is lost, and a linear system shows no trend."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import lfilter
from tests.identification.runs import modes_of

from sprung.identification import IdentificationSettings, LevelTrends, coss_ssi, cov_ssi
from sprung.identification.correlation import SegmentCorrelations, average, correlate_segments
from sprung.identification.levels import (
    correlate_by_level,
    expected_levels,
    joined_levels,
    level_sets,
    segment_levels,
    subsets_of_equal_width,
    trends_in_words,
)
from sprung.identification.subspace import eigenvalue_weights, poles_of_orders, realise
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


FEW_LAGS = 4


def segments_of_level(levels, n_products=100):
    """Segments of two channels with exactly these levels: every correlation is constant over the lags."""
    factors = np.array([[1.0, 2.0], [3.0, 1.5]])
    values = np.multiply.outer(np.asarray(levels, dtype=float), factors)[..., None] * np.ones(FEW_LAGS)
    counts = np.full((len(levels), FEW_LAGS), float(n_products))
    return SegmentCorrelations(values * n_products, counts, 10.0, ("a", "b"), ("a", "b"))


def averages(segments, found, *, is_biased=False):
    return [average(segments.take(subset.segments), is_biased=is_biased) for subset in found.subsets]


def sizes(found):
    return [len(subset.segments) for subset in found.subsets]


def test_level_is_the_smallest_rms_of_the_correlations() -> None:
    """F. Liu (2020), section 4.2, steps 3 and 4, from the definition."""
    samples = np.random.default_rng(0).normal(size=(3, 500)) * [[1.0], [0.1], [4.0]]
    recording = Recording(samples, 50.0, tuple(Channel(name) for name in "abc"))
    segments = correlate_segments(recording, n_lags=FEW_LAGS, segment=2.0)
    expected = []
    for k in range(5):
        part = samples[:, 100 * k : 100 * (k + 1)]
        rms = []
        for late in part:
            for early in part:
                values = [np.dot(late[m:], early[: 100 - m]) / (100 - m) for m in range(FEW_LAGS)]
                rms.append(np.sqrt(np.mean(np.square(values))))
        expected.append(min(rms))
    np.testing.assert_allclose(segment_levels(segments), expected, rtol=1e-10)


def test_equal_width_cuts_the_range_of_levels() -> None:
    """Levels 1 to 10 in three ranges of width 3: 1, 2, 3.5 | 4, 6 | 7, 8, 10 (an edge belongs to the upper range)."""
    segments = segments_of_level([10, 1, 4, 8, 2, 6, 7, 3.5])
    found = subsets_of_equal_width(segments, 3)
    assert [subset.level for subset in found.subsets] == [(1, 4), (4, 7), (7, 10)]
    assert [subset.segments.tolist() for subset in found.subsets] == [[1, 4, 7], [2, 5], [0, 3, 6]]
    assert found.notes == ()
    assert averages(segments, found)[0].values[0, 0, 0] == pytest.approx((1 + 2 + 3.5) / 3)


def test_a_poor_subset_is_merged_with_its_poorer_neighbour_and_that_is_noted() -> None:
    """Equal width over 0 to 30: ten segments below 10, none between, one at 30."""
    found = subsets_of_equal_width(segments_of_level([*range(10), 30]), 3)
    assert sizes(found) == [11]
    assert found.notes == (
        "level range 10 to 20 held 0 segment(s): merged with 20 to 30",
        "level range 10 to 30 held 1 segment(s): merged with 0 to 10",
    )
    assert found.subsets[0].level == (0, 30)


@settings(max_examples=60, deadline=None)
@given(
    levels=st.lists(st.floats(0.01, 100), min_size=1, max_size=60),
    n_subsets=st.integers(1, 6),
    min_segments=st.integers(1, 5),
)
def test_every_segment_is_in_exactly_one_subset_and_nothing_is_lost(levels, n_subsets, min_segments) -> None:
    segments = segments_of_level(levels)
    found = subsets_of_equal_width(segments, n_subsets, min_segments=min_segments)
    everywhere = np.concatenate([subset.segments for subset in found.subsets])
    assert sorted(everywhere) == list(range(len(levels)))
    assert len(found.notes) == n_subsets - len(found.subsets)
    assert min(sizes(found)) >= min(min_segments, len(levels))
    measured = segment_levels(segments)
    for lower, upper in zip(found.subsets, found.subsets[1:], strict=False):
        assert lower.level[1] == upper.level[0]
        assert measured[lower.segments].max() <= measured[upper.segments].min()
    parts = averages(segments, found)
    weighted = sum(part.n_segments * part.values for part in parts) / len(levels)
    np.testing.assert_allclose(weighted, average(segments).values, rtol=1e-12)
    assert sum(part.n_segments for part in parts) == len(levels)


QUIET = IdentificationSettings(harmonics=())


@pytest.mark.parametrize(("name", "rate"), [("chain3", 125.0), ("quarter", 250.0)])
def test_the_modal_filter_gives_the_pole_however_the_system_is_excited(known, name, rate) -> None:
    """Correlations C A^(m - 1) G' with another G' than that of the filter: the same eigenvalue."""
    correlations, poles, _ = known(name, rate)
    realisation = realise(correlations, block_rows=20, max_order=2 * len(poles))
    n_references = len(correlations.references)
    mixed = np.einsum(
        "crm,rs->csm", correlations.values, np.random.default_rng(0).normal(size=(n_references, n_references))
    )
    for pole in poles:
        eigenvalue = np.exp(pole / rate)
        numerator, denominator = eigenvalue_weights(realisation, 2 * len(poles), eigenvalue)
        n_lags = numerator.shape[-1]
        quotient = np.sum(numerator * mixed[..., 1 : n_lags + 1]) / np.sum(denominator * mixed[..., 1 : n_lags + 1])
        assert abs(quotient - eigenvalue) < 1e-8
        own = correlations.values[..., 1 : n_lags + 1]
        assert np.sum(denominator * own) == pytest.approx(1.0, abs=1e-8)


def driven(seed, *, hardening=0.0, friction=0.0, duration=200.0, rate=100.0):
    """Acceleration of two sensors on an oscillator of 5 Hz and 3 %, driven at slowly varying levels, 2:1."""
    generator = np.random.default_rng(seed)
    n_samples, steps = round(duration * rate), 4
    step = 1 / (rate * steps)
    level = 2.0 ** np.interp(np.arange(n_samples), np.arange(0, n_samples + 1500, 1500), _levels(generator, n_samples))
    force = 100.0 * level * generator.normal(size=n_samples)
    frequency = 2 * np.pi * 5.0
    position = velocity = 0.0
    motion = np.empty(n_samples)
    for k, push in enumerate(force.tolist()):
        for _ in range(steps):
            spring = frequency**2 * position * (1 + hardening * position**2)
            velocity += step * (push - spring - 0.06 * frequency * velocity - friction * np.sign(velocity))
            position += step * velocity
        motion[k] = push - frequency**2 * position * (1 + hardening * position**2) - 0.06 * frequency * velocity
    motion -= force
    samples = np.array([[1.0], [0.7]]) * motion
    samples += 0.1 * np.std(motion) * generator.normal(size=samples.shape)
    return Recording(samples, rate, (Channel("a"), Channel("b")))


def _levels(generator, n_samples):
    return generator.uniform(-0.5, 0.5, size=len(np.arange(0, n_samples + 1500, 1500)))


def test_a_linear_record_of_varying_level_has_no_trend() -> None:
    found = coss_ssi(driven(1), settings=QUIET)
    assert len(found.modes) == 1
    assert found.level_trends is not None
    assert not found.level_trends.is_detected.any()
    assert found.level_trends.level_ratio[0] > 1.2
    sentence = "no dependence on the level detected (highest subset over lowest: 1."
    assert any(note.startswith(sentence) for note in found.notes)
    average = cov_ssi(driven(1), settings=QUIET).modes
    difference = abs(found.modes.damping_ratio[0] - average.damping_ratio[0])
    assert difference < average.damping_ratio_std[0]


def test_a_hardening_spring_raises_the_frequency() -> None:
    found = coss_ssi(driven(2, hardening=4.0), settings=QUIET)
    trends = found.level_trends
    assert trends is not None
    nearest = int(np.argmax(trends.natural_frequency / trends.natural_frequency_std))
    assert trends.is_detected[nearest]
    assert trends.natural_frequency[nearest] > 0
    assert any("rises by" in note and "for twice the level: a nonlinearity" in note for note in found.notes)


def test_without_levels_there_is_no_trend() -> None:
    record = driven(3, duration=60.0)
    assert cov_ssi(record, settings=QUIET).level_trends is None
    assert coss_ssi(record, settings=replace(QUIET, has_own_levels=True)).level_trends is None
    assert coss_ssi(record, settings=replace(QUIET, n_subsets=1)).level_trends is None


def test_trends_in_words() -> None:
    modes = modes_of([13.2, 20.0], 0.02, np.ones((2, 2)))
    trends = LevelTrends(
        natural_frequency=np.array([-0.031, 0.001]),
        natural_frequency_std=np.array([0.004, 0.002]),
        damping_ratio=np.array([0.0, -0.012]),
        damping_ratio_std=np.array([0.001, 0.002]),
        p_value=np.array([1e-6, 1e-5]),
        level_ratio=np.array([2.0, 1.5]),
    )
    assert trends_in_words(modes, trends) == [
        "the frequency of the mode at 13.2 Hz falls by 3.1 % ± 0.4 % for twice the level: a nonlinearity",
        "the damping ratio of the mode at 20 Hz falls by 1.2 ± 0.2 percentage points for twice the level:"
        " a nonlinearity",
    ]
    chance = replace(trends, p_value=np.array([0.02, 0.5]))
    assert trends_in_words(modes, chance) == ["no dependence on the level detected (highest subset over lowest: 1.75)"]
    unknown = replace(trends, p_value=np.full(2, np.nan))
    assert trends_in_words(modes, unknown) == []
