"""Subsets of segments of similar level: membership, merging of poor ones, and that no segment is lost."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sprung.errors import ParameterError
from sprung.identification.correlation import SegmentCorrelations, average, correlate_segments, with_limited_power
from sprung.identification.levels import segment_levels, subsets_of_equal_width
from sprung.recording import Channel, Recording

N_LAGS = 4


def segments_of_level(levels, n_products=100):
    """Segments of two channels with exactly these levels: every correlation is constant over the lags."""
    factors = np.array([[1.0, 2.0], [3.0, 1.5]])
    values = np.multiply.outer(np.asarray(levels, dtype=float), factors)[..., None] * np.ones(N_LAGS)
    counts = np.full((len(levels), N_LAGS), float(n_products))
    return SegmentCorrelations(values * n_products, counts, 10.0, ("a", "b"), ("a", "b"))


def averages(segments, found, *, is_biased=False):
    return [average(segments.take(subset.segments), is_biased=is_biased) for subset in found.subsets]


def sizes(found):
    return [len(subset.segments) for subset in found.subsets]


def test_level_is_the_smallest_rms_of_the_correlations() -> None:
    """F. Liu (2020), section 4.2, steps 3 and 4, from the definition."""
    samples = np.random.default_rng(0).normal(size=(3, 500)) * [[1.0], [0.1], [4.0]]
    recording = Recording(samples, 50.0, tuple(Channel(name) for name in "abc"))
    segments = correlate_segments(recording, n_lags=N_LAGS, segment=2.0)
    expected = []
    for k in range(5):
        part = samples[:, 100 * k : 100 * (k + 1)]
        rms = []
        for late in part:
            for early in part:
                values = [np.dot(late[m:], early[: 100 - m]) / (100 - m) for m in range(N_LAGS)]
                rms.append(np.sqrt(np.mean(np.square(values))))
        expected.append(min(rms))
    np.testing.assert_allclose(segment_levels(segments), expected, rtol=1e-10)


def test_limiting_loud_segments_does_not_change_any_level() -> None:
    levels = [1.0, 2.0, 1.5, 1e6]
    limited = with_limited_power(segments_of_level(levels))
    assert limited.n_products.min() < 1
    np.testing.assert_allclose(segment_levels(limited), levels, rtol=1e-12)


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


def test_the_lowest_and_the_highest_range_merge_inwards() -> None:
    lowest = subsets_of_equal_width(segments_of_level([0, 11, 12, 13, 21, 22, 30]), 3)
    assert sizes(lowest) == [4, 3]
    assert lowest.notes == ("level range 0 to 10 held 1 segment(s): merged with 10 to 20",)
    highest = subsets_of_equal_width(segments_of_level([0, 1, 11, 12, 13, 30]), 3)
    assert sizes(highest) == [2, 4]
    assert highest.notes == ("level range 20 to 30 held 1 segment(s): merged with 10 to 20",)


@pytest.mark.parametrize("levels", [[3.0], [2.0, 2.0, 2.0, 2.0]])
def test_one_segment_or_one_level_gives_one_subset(levels) -> None:
    found = subsets_of_equal_width(segments_of_level(levels), 3)
    assert sizes(found) == [len(levels)]
    assert len(found.notes) == 2


def test_one_subset_is_the_overall_average() -> None:
    segments = segments_of_level([5, 1, 2, 9])
    found = subsets_of_equal_width(segments, 1)
    assert sizes(found) == [4]
    np.testing.assert_allclose(averages(segments, found)[0].values, average(segments).values, rtol=1e-14)


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


@pytest.mark.parametrize("is_biased", [False, True])
def test_the_mean_of_the_subsets_weighted_with_their_products_is_the_overall_average(is_biased) -> None:
    """Segments of a real cut: the number of products differs from segment to segment by one."""
    samples = np.random.default_rng(4).normal(size=(2, 2011)) * np.linspace(0.5, 2.0, 2011)
    recording = Recording(samples, 50.0, (Channel("a"), Channel("b")))
    segments = correlate_segments(recording, n_lags=6, segment=1.0)
    found = subsets_of_equal_width(segments, 3)
    assert len(found.subsets) > 1
    divisors = [
        segments.n_products[subset.segments][:, [0] * 6 if is_biased else range(6)].sum(axis=0)
        for subset in found.subsets
    ]
    parts = averages(segments, found, is_biased=is_biased)
    total = sum(n * part.values for n, part in zip(divisors, parts, strict=True))
    np.testing.assert_allclose(total / sum(divisors), average(segments, is_biased=is_biased).values, rtol=1e-12)


def test_the_order_of_segments_does_not_change_the_subsets() -> None:
    levels = np.random.default_rng(5).uniform(1, 9, size=24)
    order = np.random.default_rng(6).permutation(24)
    straight = subsets_of_equal_width(segments_of_level(levels), 3)
    shuffled = subsets_of_equal_width(segments_of_level(levels[order]), 3)
    for before, after in zip(straight.subsets, shuffled.subsets, strict=True):
        assert before.level == pytest.approx(after.level)
        assert sorted(before.segments) == sorted(order[after.segments])


def test_no_subset_at_all_is_refused() -> None:
    with pytest.raises(ParameterError, match=r"^n_subsets=0 must be at least 1$"):
        subsets_of_equal_width(segments_of_level([1, 2, 3]), 0)
