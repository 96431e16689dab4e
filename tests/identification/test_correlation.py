"""Correlations of segments against direct sums, their averages and blocks, and deviations of means."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sprung.errors import DataError, ParameterError
from sprung.identification.correlation import (
    MAX_BLOCKS,
    SegmentCorrelations,
    average,
    correlate_segments,
    deviation_of_mean,
    join_segments,
    with_limited_power,
)
from sprung.recording import Channel, Gap, Recording

RATE = 50.0


def recorded(samples, *, gaps=(), sampling_rate=RATE):
    samples = np.atleast_2d(samples)
    channels = tuple(Channel(name) for name in "abcdef"[: len(samples)])
    return Recording(samples, sampling_rate, channels, gaps=tuple(Gap(index, 1.0) for index in gaps))


def noise(n_channels, n_samples, seed=0):
    """Noise with a memory, so that no correlation is zero."""
    white = np.random.default_rng(seed).normal(size=(n_channels, n_samples))
    return white + 0.5 * np.roll(white[::-1], 3, axis=1) + 0.3


def direct_sums(samples, rows, *, first, last, end, n_lags):
    """sum over n in [first, last) with n + m < end of y_channel(n + m) y_reference(n), term by term."""
    sums = np.zeros((len(samples), len(rows), n_lags))
    counts = np.zeros(n_lags)
    for m in range(n_lags):
        stop = min(last, end - m)
        counts[m] = stop - first
        for i, late in enumerate(samples):
            for j, row in enumerate(rows):
                sums[i, j, m] = np.dot(late[first + m : stop + m], samples[row][first:stop])
    return sums, counts


def assert_same(found, wanted, *, rtol=1e-12):
    """Equal relative to the largest value."""
    np.testing.assert_allclose(found, wanted, rtol=0, atol=rtol * np.abs(wanted).max())


@pytest.mark.parametrize("is_continued", [False, True])
@pytest.mark.parametrize("references", [None, ("b",), ("c", "a")])
@pytest.mark.parametrize("gaps", [(), (70,), (40, 45, 130)])
def test_sums_equal_the_direct_ones(is_continued, references, gaps) -> None:
    """Stretches of 200; of 70 and 130; of 40, 5 (shorter than the lags: left out), 85 and 70 samples."""
    samples, n_lags = noise(3, 200), 12
    recording = recorded(samples, gaps=gaps)
    found = correlate_segments(recording, n_lags=n_lags, segment=0.8, references=references, is_continued=is_continued)
    rows = [recording.index(name) for name in found.references]
    k = 0
    for stretch in recording.stretches():
        length = stretch.stop - stretch.start
        if length < n_lags:
            continue
        n_segments = max(length // 40, 1)
        edges = np.linspace(stretch.start, stretch.stop, n_segments + 1).round().astype(int)
        for first, last in itertools.pairwise(edges):
            end = stretch.stop if is_continued else last
            sums, counts = direct_sums(samples, rows, first=first, last=last, end=end, n_lags=n_lags)
            assert_same(found.sums[k], sums)
            np.testing.assert_array_equal(found.n_products[k], counts)
            k += 1
    assert found.n_segments == k
    assert found.references == (references or ("a", "b", "c"))


@settings(max_examples=50, deadline=None)
@given(
    size=st.tuples(st.integers(1, 3), st.integers(2, 300)),
    n_lags=st.integers(2, 60),
    length=st.integers(1, 120),
    is_continued=st.booleans(),
    seed=st.integers(0, 2**31),
)
def test_any_cut_adds_up_to_what_a_direct_sum_gives(size, n_lags, length, is_continued, seed) -> None:
    n_channels, n_samples = size
    samples = noise(n_channels, n_samples, seed)
    cut = {"n_lags": n_lags, "segment": length / RATE, "is_continued": is_continued}
    if n_lags > n_samples:
        with pytest.raises(DataError):
            correlate_segments(recorded(samples), **cut)
        return
    found = correlate_segments(recorded(samples), **cut)
    assert found.n_products[:, 0].sum() == n_samples
    assert found.n_products.min() > 0
    if is_continued:
        sums, counts = direct_sums(samples, range(n_channels), first=0, last=n_samples, end=n_samples, n_lags=n_lags)
        assert_same(found.sums.sum(axis=0), sums)
        np.testing.assert_array_equal(found.n_products.sum(axis=0), counts)


@pytest.mark.parametrize(("n_samples", "n_lags"), [(6_000, 4), (5_000, 900), (140_000, 3)])
def test_long_segments_are_summed_in_blocks_without_loss(n_samples, n_lags) -> None:
    """Several FFT blocks; blocks shorter than the lags would need; more blocks than are transformed at once."""
    samples = noise(2, n_samples)
    found = correlate_segments(recorded(samples), n_lags=n_lags)
    sums, counts = direct_sums(samples, [0, 1], first=0, last=n_samples, end=n_samples, n_lags=n_lags)
    assert_same(found.sums[0], sums)
    np.testing.assert_array_equal(found.n_products[0], counts)


@pytest.mark.parametrize("is_biased", [False, True])
def test_correlation_of_a_cosine_has_its_closed_form(is_biased) -> None:
    """2 sum_n cos(w n) cos(w (n + m)) = (N - m) cos(w m) + cos(w (N - 1)) sin((N - m) w) / sin(w)."""
    n, w, m = 400, 0.37, np.arange(30)
    doubled = (n - m) * np.cos(w * m) + np.cos(w * (n - 1)) * np.sin((n - m) * w) / np.sin(w)
    expected = doubled / 2 / (n if is_biased else n - m)
    segments = correlate_segments(recorded(np.cos(w * np.arange(n))), n_lags=30)
    np.testing.assert_allclose(average(segments, is_biased=is_biased).values[0, 0], expected, atol=1e-14)


def test_joined_records_add() -> None:
    """Values of the joined records: the sums over both, divided by the products of both."""
    parts = [correlate_segments(recorded(noise(2, n, n)), n_lags=6, segment=1.0) for n in (180, 420)]
    joined = average(join_segments(parts))
    expected = sum(part.sums.sum(axis=0) for part in parts) / sum(part.n_products.sum(axis=0) for part in parts)
    assert_same(joined.values, expected)
    assert joined.n_segments == sum(part.n_segments for part in parts)


@settings(max_examples=25, deadline=None)
@given(order=st.permutations(range(40)), is_biased=st.booleans())
def test_the_order_of_segments_does_not_matter(order, is_biased) -> None:
    segments = correlate_segments(recorded(noise(2, 2003)), n_lags=8, segment=1.0)
    assert segments.n_segments == 40
    shuffled = segments.take(order)
    assert_same(average(shuffled, is_biased=is_biased).values, average(segments, is_biased=is_biased).values)


@pytest.mark.parametrize("n_segments", [1, 2, 63, 64, 65, 128, 129, 200])
def test_blocks_are_runs_of_consecutive_segments_and_average_to_the_values(n_segments) -> None:
    segments = correlate_segments(recorded(noise(2, 20 * n_segments)), n_lags=5, segment=0.4)
    found = average(segments)
    assert found.n_segments == segments.n_segments == n_segments
    assert len(found.blocks) == len(found.weights) <= MAX_BLOCKS
    assert found.weights.sum() == pytest.approx(1)
    assert_same(np.tensordot(found.weights, found.blocks, 1), found.values)
    n_first = round(found.weights[0] * n_segments)
    assert_same(found.blocks[0], average(segments.take(range(n_first))).values)


def test_spread_of_the_blocks_is_the_uncertainty_of_the_average() -> None:
    """White noise of variance 1: the standard deviation of a correlation of N products is 1 / sqrt(N) at lags > 0."""
    found = average(
        correlate_segments(recorded(np.random.default_rng(2).normal(size=(2, 64_000))), n_lags=40, segment=20)
    )
    n_blocks = len(found.blocks)
    variance = np.sum(found.weights[:, None, None, None] ** 2 * (found.blocks - found.values) ** 2, axis=0)
    deviation = np.sqrt(np.mean(variance[..., 1:]) * n_blocks / (n_blocks - 1))
    assert deviation == pytest.approx(1 / np.sqrt(64_000), rel=0.03)


def loud_and_ordinary(power):
    """Ten equal segments of 20 samples, the fourth of them louder."""
    factors = np.ones(10)
    factors[3] = np.sqrt(power)
    return correlate_segments(recorded(np.tile(noise(2, 20), 10) * np.repeat(factors, 20)), n_lags=5, segment=0.4)


@pytest.mark.parametrize("power", [0.0, 1.0, 4.0])
def test_segments_up_to_four_times_the_median_power_stay_as_they_are(power) -> None:
    segments = loud_and_ordinary(power)
    limited = with_limited_power(segments)
    np.testing.assert_array_equal(limited.sums, segments.sums)
    np.testing.assert_array_equal(limited.n_products, segments.n_products)


def test_loudness_is_not_measured_against_silence() -> None:
    """Six silent segments, three ordinary ones and one hundred times louder: limited against the ordinary ones."""
    segments = loud_and_ordinary(100.0)
    heard = np.arange(10) < 4
    silenced = replace(segments, sums=segments.sums * heard[:, None, None, None])
    limited = with_limited_power(silenced)
    np.testing.assert_allclose(limited.n_products[:, 0] / 20, np.where(np.arange(10) == 3, 0.04, 1.0))
    silence = replace(segments, sums=np.zeros_like(segments.sums))
    np.testing.assert_array_equal(with_limited_power(silence).n_products, silence.n_products)


@pytest.mark.parametrize("power", [100.0, 1e8])
def test_a_loud_segment_counts_like_four_ordinary_ones_and_keeps_its_own_correlation(power) -> None:
    """Average of nine segments of power 1 and one of power P with weight 4/P: (9 + 4) / (9 + 4/P)."""
    ordinary = average(loud_and_ordinary(1.0)).values
    found = average(with_limited_power(loud_and_ordinary(power)))
    assert_same(found.values, ordinary * 13 / (9 + 4 / power))
    assert_same(found.blocks[3], power * ordinary)
    assert found.weights[3] == pytest.approx(4 / power / (9 + 4 / power))
    assert_same(np.tensordot(found.weights, found.blocks, 1), found.values)


def test_select_takes_outputs_and_references_by_name() -> None:
    segments = correlate_segments(recorded(noise(3, 300)), n_lags=5, segment=1.0)
    chosen = average(segments).select(["c", "a"], ["b"])
    assert_same(chosen.values, average(segments).values[[2, 0]][:, [1]])
    assert_same(chosen.blocks, average(segments).blocks[:, [2, 0]][:, :, [1]])
    assert (chosen.channels, chosen.references) == (("c", "a"), ("b",))
    assert chosen.is_cross.all()


@pytest.mark.parametrize(
    ("n_samples", "options", "error", "sentence"),
    [
        (19, {"n_lags": 20}, DataError, "no stretch of the recording is as long as 20 lags .0.4 s.: record longer"),
        (50, {"n_lags": 1}, ParameterError, "n_lags=1 must be at least 2"),
        (50, {"n_lags": 5, "references": ["a", "z"]}, ParameterError, "there is no channel 'z': the recording has a"),
        (0, {"n_lags": 2}, DataError, "no stretch of the recording is as long as 2 lags"),
    ],
)
def test_what_cannot_be_correlated_is_refused(n_samples, options, error, sentence) -> None:
    with pytest.raises(error, match=f"^{sentence}"):
        correlate_segments(recorded(noise(1, n_samples)), **options)


def test_records_of_different_channels_lags_or_rates_do_not_join() -> None:
    first = correlate_segments(recorded(noise(2, 50)), n_lags=5)
    for other in (
        correlate_segments(recorded(noise(1, 50)), n_lags=5),
        correlate_segments(recorded(noise(2, 50)), n_lags=6),
        correlate_segments(recorded(noise(2, 50)), n_lags=5, references=["a"]),
    ):
        with pytest.raises(ParameterError, match="records of one condition must have the same channels, references"):
            join_segments([first, other])
    faster = correlate_segments(recorded(noise(2, 50), sampling_rate=60.0), n_lags=5)
    with pytest.raises(ParameterError) as refusal:
        join_segments([first, faster])
    assert str(refusal.value) == (
        "sampling rates 50 Hz and 60 Hz differ: bring the records to one rate first (--decimate-to)"
    )


def test_lags_without_any_product_are_refused() -> None:
    empty = SegmentCorrelations(np.zeros((1, 1, 1, 3)), np.array([[2.0, 1.0, 0.0]]), RATE, ("a",), ("a",))
    with pytest.raises(DataError, match="the segments are shorter than the lags: use longer segments"):
        average(empty)


N_BLOCKS, N_RUNS = 48, 2000


def influences_of(values):
    """Influences of blocks on their mean, of which the squares add up to its variance for independent blocks."""
    n_blocks = len(values)
    return (values - values.mean(axis=0)) / n_blocks * np.sqrt(n_blocks / (n_blocks - 1))


def score(values, records=None):
    """Means over their standard deviations; the true mean is 0."""
    return values.mean(axis=0) / deviation_of_mean(influences_of(values), records)


def slow(generator, n_blocks, memory):
    """Unit variation that forgets over `memory` blocks."""
    forgetting = np.exp(-1 / memory)
    values = generator.normal(size=(n_blocks, N_RUNS))
    for k in range(1, n_blocks):
        values[k] = forgetting * values[k - 1] + np.sqrt(1 - forgetting**2) * values[k]
    return values


@pytest.mark.parametrize("n_blocks", [8, 24, 48, 64])
def test_independent_blocks_are_covered(n_blocks) -> None:
    scores = score(np.random.default_rng(1).normal(size=(n_blocks, N_RUNS)))
    assert 0.93 < np.mean(np.abs(scores) < 1.96) < 0.975
    assert 0.85 < np.sqrt(np.mean(scores**2)) < 1.1


def test_slow_variation_is_in_the_deviation() -> None:
    """Blocks alone would give scores of 1.7 and 2.3: most of the variance in excess is in the deviation."""
    generator = np.random.default_rng(2)
    chance = generator.normal(size=(N_BLOCKS, N_RUNS))
    for size, largest in ((0.7, 1.5), (2.0, 1.8)):
        values = chance + size * slow(generator, N_BLOCKS, 3.0)
        alone = values.mean(axis=0) / np.sqrt(np.sum(influences_of(values) ** 2, axis=0))
        assert np.sqrt(np.mean(score(values) ** 2)) < min(largest, 0.85 * np.sqrt(np.mean(alone**2)))


@pytest.mark.parametrize("size", [0.0, 0.5, 2.0])
def test_variation_between_records_is_in_the_deviation(size) -> None:
    generator = np.random.default_rng(3)
    records = np.repeat(np.arange(12), 5)
    values = generator.normal(size=(60, N_RUNS)) + size * generator.normal(size=(12, N_RUNS))[records]
    assert 0.8 < np.sqrt(np.mean(score(values, records) ** 2)) < 1.2


def test_a_drift_over_the_record_widens_the_deviation() -> None:
    """A ramp: the eight parts differ from each other far more than chance."""
    values = np.random.default_rng(4).normal(size=(N_BLOCKS, 50)) + np.linspace(-4, 4, N_BLOCKS)[:, None]
    influences = influences_of(values)
    ratio = deviation_of_mean(influences) / np.sqrt(np.sum(influences**2, axis=0))
    assert np.median(ratio) > 2


def test_too_few_blocks_give_no_deviation() -> None:
    assert np.isnan(deviation_of_mean(np.ones((3, 2)))).all()
    assert np.isfinite(deviation_of_mean(influences_of(np.random.default_rng(6).normal(size=(4, 2))))).all()
