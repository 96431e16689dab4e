"""Correlations of segments against direct sums, closed forms and invariances."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sprung.errors import DataError
from sprung.identification.correlation import (
    average,
    correlate_segments,
    join_segments,
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


# Against direct sums


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


def test_a_segment_of_a_stretch_too_short_for_it_is_the_whole_stretch() -> None:
    found = correlate_segments(recorded(noise(1, 100), gaps=(60,)), n_lags=10, segment=1.0)
    np.testing.assert_array_equal(found.n_products[:, 0], [60, 40])


# Closed forms


@pytest.mark.parametrize("is_biased", [False, True])
def test_correlation_of_a_cosine_has_its_closed_form(is_biased) -> None:
    """2 sum_n cos(w n) cos(w (n + m)) = (N - m) cos(w m) + cos(w (N - 1)) sin((N - m) w) / sin(w)."""
    n, w, m = 400, 0.37, np.arange(30)
    doubled = (n - m) * np.cos(w * m) + np.cos(w * (n - 1)) * np.sin((n - m) * w) / np.sin(w)
    expected = doubled / 2 / (n if is_biased else n - m)
    segments = correlate_segments(recorded(np.cos(w * np.arange(n))), n_lags=30)
    np.testing.assert_allclose(average(segments, is_biased=is_biased).values[0, 0], expected, atol=1e-14)


def test_the_biased_form_falls_off_linearly_with_the_lag() -> None:
    """A constant: the unbiased correlation is 1 at every lag, the biased one (N - m) / N."""
    segments = correlate_segments(recorded(np.ones(200)), n_lags=40, segment=1.0)
    np.testing.assert_allclose(average(segments).values[0, 0], 1, atol=1e-13)
    np.testing.assert_allclose(average(segments, is_biased=True).values[0, 0], 1 - np.arange(40) / 50, atol=1e-13)


def test_the_output_comes_later_than_the_reference() -> None:
    """b repeats a three samples later: Lambda of b with reference a peaks at lag 3, of a with reference b nowhere."""
    a = np.random.default_rng(1).normal(size=20_000)
    found = average(correlate_segments(recorded([a, np.roll(a, 3)]), n_lags=8)).values
    np.testing.assert_allclose(found[1, 0], np.eye(8)[3], atol=0.04)
    np.testing.assert_allclose(found[0, 1], 0, atol=0.04)


def test_two_impulses_meet_at_their_distance_only() -> None:
    samples = np.zeros((2, 50))
    samples[0, 10], samples[1, 14] = 2.0, 3.0
    sums = correlate_segments(recorded(samples), n_lags=20).sums[0]
    expected = np.zeros((2, 2, 20))
    expected[0, 0, 0], expected[1, 1, 0], expected[1, 0, 4] = 4, 9, 6
    np.testing.assert_allclose(sums, expected, atol=1e-13)


def test_nothing_wraps_around() -> None:
    samples = np.zeros(64)
    samples[[0, 63]] = 1.0
    sums = correlate_segments(recorded(samples), n_lags=64).sums[0, 0, 0]
    np.testing.assert_allclose(sums, 2 * np.eye(64)[0] + np.eye(64)[63], atol=1e-14)


# Invariances


def test_a_gap_separates_like_two_records() -> None:
    samples = noise(2, 300)
    whole = correlate_segments(recorded(samples, gaps=(130,)), n_lags=10, segment=1.0, is_continued=True)
    parts = [
        correlate_segments(recorded(part), n_lags=10, segment=1.0, is_continued=True)
        for part in (samples[:, :130], samples[:, 130:])
    ]
    assert_same(whole.sums, join_segments(parts).sums)
    np.testing.assert_array_equal(whole.n_products, join_segments(parts).n_products)


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


@settings(max_examples=25, deadline=None)
@given(
    factors=st.lists(st.floats(1e-6, 1e6), min_size=3, max_size=3),
    order=st.permutations(range(3)),
    is_continued=st.booleans(),
)
def test_scaled_and_permuted_channels_scale_and_permute_the_correlations(factors, order, is_continued) -> None:
    recording = recorded(noise(3, 400))
    changed = recording.changed("scaled", samples=recording.samples * np.array(factors)[:, None])
    changed = changed.select([recording.names[k] for k in order])
    cut = {"n_lags": 9, "segment": 1.0, "is_continued": is_continued}
    before = average(correlate_segments(recording, **cut)).values
    after = average(correlate_segments(changed, **cut)).values
    scale = np.outer(factors, factors)[np.ix_(order, order)][:, :, None]
    assert_same(after / scale, before[np.ix_(order, order)], rtol=1e-10)


def test_correlations_of_references_are_columns_of_all() -> None:
    recording = recorded(noise(3, 200))
    every = correlate_segments(recording, n_lags=7)
    some = correlate_segments(recording, n_lags=7, references=["c", "a"])
    assert_same(some.sums, every.sums[:, :, [2, 0]])
