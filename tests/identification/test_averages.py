"""Averages of segments and their blocks, loud segments; what is refused."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import DataError, ParameterError
from sprung.identification.correlation import (
    MAX_BLOCKS,
    Correlations,
    SegmentCorrelations,
    average,
    correlate_segments,
    exact_correlations,
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


def assert_same(found, wanted, *, rtol=1e-12):
    """Equal relative to the largest value."""
    np.testing.assert_allclose(found, wanted, rtol=0, atol=rtol * np.abs(wanted).max())


# Averages and their blocks


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


def test_values_of_segments_of_unequal_length_are_the_sums_over_the_products() -> None:
    segments = correlate_segments(recorded(noise(1, 250), gaps=(50, 81)), n_lags=20)
    values = average(segments).values[0, 0]
    np.testing.assert_allclose(values, segments.sums.sum(axis=0)[0, 0] / segments.n_products.sum(axis=0))
    biased = average(segments, is_biased=True).values[0, 0]
    np.testing.assert_allclose(biased, segments.sums.sum(axis=0)[0, 0] / 250)


def test_spread_of_the_blocks_is_the_uncertainty_of_the_average() -> None:
    """White noise of variance 1: the standard deviation of a correlation of N products is 1 / sqrt(N) at lags > 0."""
    found = average(
        correlate_segments(recorded(np.random.default_rng(2).normal(size=(2, 64_000))), n_lags=40, segment=20)
    )
    n_blocks = len(found.blocks)
    variance = np.sum(found.weights[:, None, None, None] ** 2 * (found.blocks - found.values) ** 2, axis=0)
    deviation = np.sqrt(np.mean(variance[..., 1:]) * n_blocks / (n_blocks - 1))
    assert deviation == pytest.approx(1 / np.sqrt(64_000), rel=0.03)


# Loud segments


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


# Values


def test_known_correlations_have_one_block_and_names() -> None:
    values = np.arange(24.0).reshape(3, 2, 4)
    known = exact_correlations(values, sampling_rate=10.0)
    assert (known.channels, known.references) == (("1", "2", "3"), ("1", "2"))
    assert known.n_lags == 4
    np.testing.assert_array_equal(known.blocks, values[None])
    np.testing.assert_array_equal(known.is_cross, [[False, True], [True, False], [True, True]])


def test_select_takes_outputs_and_references_by_name() -> None:
    segments = correlate_segments(recorded(noise(3, 300)), n_lags=5, segment=1.0)
    chosen = average(segments).select(["c", "a"], ["b"])
    assert_same(chosen.values, average(segments).values[[2, 0]][:, [1]])
    assert_same(chosen.blocks, average(segments).blocks[:, [2, 0]][:, :, [1]])
    assert (chosen.channels, chosen.references) == (("c", "a"), ("b",))
    assert chosen.is_cross.all()


def test_correlations_cannot_be_changed() -> None:
    found = average(correlate_segments(recorded(noise(1, 50)), n_lags=5))
    for array in (found.values, found.blocks, found.weights):
        with pytest.raises(ValueError, match="read-only"):
            array[...] = 0


# Refusals


@pytest.mark.parametrize(
    ("n_samples", "options", "error", "sentence"),
    [
        (
            19,
            {"n_lags": 20},
            DataError,
            "no stretch of the recording is as long as 20 lags (0.4 s): record longer or use fewer block rows",
        ),
        (50, {"n_lags": 1}, ParameterError, "n_lags=1 must be at least 2"),
        (50, {"n_lags": 5, "references": ["a", "z"]}, ParameterError, "there is no channel 'z': the recording has a"),
        (
            0,
            {"n_lags": 2},
            DataError,
            "no stretch of the recording is as long as 2 lags (0.04 s): record longer or use fewer block rows",
        ),
    ],
)
def test_what_cannot_be_correlated_is_refused(n_samples, options, error, sentence) -> None:
    with pytest.raises(error) as refusal:
        correlate_segments(recorded(noise(1, n_samples)), **options)
    assert str(refusal.value) == sentence


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


def test_arrays_of_other_dimensions_are_refused() -> None:
    with pytest.raises(ParameterError, match=r"^values has 2 dimensions \(2, 3\), but must have 3$"):
        Correlations(np.zeros((2, 3)), np.zeros((1, 1, 2, 3)), np.ones(1), RATE, ("a",), ("a",))
