"""Subsets of segments of similar level: what CoSS-SSI averages apart (F. Liu 2020, section 4.2)."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Indices, Real
from sprung._checks import check_number
from sprung.identification.correlation import Correlations, SegmentCorrelations, average


def segment_levels(segments: SegmentCorrelations) -> Real:
    """Return the level of each segment, shape (segments,): the smallest RMS among its correlation functions.

    References
    ----------
    F. Liu (2020), section 4.2, steps 3 and 4.
    """
    values = segments.sums / np.maximum(segments.n_products, np.finfo(float).tiny)[:, None, None]
    rms = np.sqrt(np.mean(values**2, axis=-1))
    return rms.min(axis=(1, 2))


@dataclass(frozen=True, eq=False, slots=True)
class CorrelationSubset:
    """The segments of one range of levels and the average of their correlations.

    Parameters
    ----------
    level
        Lowest and highest level of the range.
    segments
        Indices of the segments, shape (segments,).
    correlations
        Their average.
    """

    level: tuple[float, float]
    segments: Indices
    correlations: Correlations


@dataclass(frozen=True, eq=False, slots=True)
class CorrelationSubsets:
    """Subsets by rising level, and what had to be merged to get them."""

    subsets: tuple[CorrelationSubset, ...]
    notes: tuple[str, ...] = ()


def subsets_of_equal_width(
    segments: SegmentCorrelations, n_subsets: int, *, min_segments: int = 2, is_biased: bool = False
) -> CorrelationSubsets:
    """Sort segments into ranges of level of equal width; the thesis' rule.

    Parameters
    ----------
    segments
        At least one.
    n_subsets
        J of the thesis, 2 to 5 there; 1 gives ACS-Cov-SSI.
    min_segments
        A subset with fewer is merged with its neighbour, and that is noted.
    is_biased
        As in `average`.

    References
    ----------
    F. Liu (2020), section 4.2, steps 4 to 6.
    """
    levels = segment_levels(segments)
    edges = np.linspace(levels.min(), levels.max(), int(check_number("n_subsets", n_subsets, at_least=1)) + 1)
    return _subsets(segments, levels, edges, min_segments, is_biased)


def subsets_of_equal_count(
    segments: SegmentCorrelations, n_subsets: int, *, min_segments: int = 2, is_biased: bool = False
) -> CorrelationSubsets:
    """Sort segments into ranges of level that hold equally many; parameters as `subsets_of_equal_width`."""
    levels = segment_levels(segments)
    quantiles = np.linspace(0, 1, int(check_number("n_subsets", n_subsets, at_least=1)) + 1)
    return _subsets(segments, levels, np.quantile(levels, quantiles), min_segments, is_biased)


def _subsets(
    segments: SegmentCorrelations,
    levels: Real,
    edges: Real,
    min_segments: int,
    is_biased: bool,
) -> CorrelationSubsets:
    """Average between `edges` of level, merging ranges that hold too few segments."""
    counts = _counts(levels, edges)
    notes = []
    while len(counts) > 1 and counts.min() < min_segments:
        poorest = int(np.argmin(counts))
        is_lower = poorest == len(counts) - 1 or (poorest > 0 and counts[poorest - 1] <= counts[poorest + 1])
        neighbour = poorest - 1 if is_lower else poorest + 1
        notes.append(
            f"level range {edges[poorest]:.3g} to {edges[poorest + 1]:.3g} held {counts[poorest]} segment(s):"
            f" merged with {edges[neighbour]:.3g} to {edges[neighbour + 1]:.3g}"
        )
        edges = np.delete(edges, max(poorest, neighbour))
        counts = _counts(levels, edges)
    where = np.digitize(levels, edges[1:-1])
    members = [np.flatnonzero(where == k) for k in range(len(counts))]
    return CorrelationSubsets(
        tuple(
            CorrelationSubset(
                (float(edges[k]), float(edges[k + 1])),
                chosen,
                average(segments.take(chosen), is_biased=is_biased),
            )
            for k, chosen in enumerate(members)
        ),
        tuple(notes),
    )


def _counts(levels: Real, edges: Real) -> Indices:
    """Return how many levels lie between each pair of edges."""
    return np.bincount(np.digitize(levels, edges[1:-1]), minlength=len(edges) - 1)
