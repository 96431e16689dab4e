"""Subsets of segments of similar level, which CoSS-SSI averages separately (F. Liu 2020, section 4.2)."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Indices, Real
from sprung._checks import check_number, freeze
from sprung.identification.correlation import SegmentCorrelations


def segment_levels(segments: SegmentCorrelations) -> Real:
    """Return the level of each segment, the smallest RMS among its correlation functions.

    Parameters
    ----------
    segments
        Correlations of the segments.

    Returns
    -------
    numpy.ndarray
        Levels, shape (segments,).

    References
    ----------
    F. Liu (2020), section 4.2, steps 3 and 4.
    """
    values = segments.sums / np.maximum(segments.n_products, np.finfo(float).tiny)[:, None, None]
    rms = np.sqrt(np.mean(values**2, axis=-1))
    return rms.min(axis=(1, 2))


@dataclass(frozen=True, eq=False, slots=True)
class LevelSubset:
    """Segments of one range of levels.

    Parameters
    ----------
    level
        Lowest and highest level of the range.
    segments
        Indices of the segments, shape (segments,).
    """

    level: tuple[float, float]
    segments: Indices

    def __post_init__(self) -> None:
        freeze(self, segments=1, dtype=np.intp)


@dataclass(frozen=True, eq=False, slots=True)
class LevelSubsets:
    """Segments sorted by level.

    Parameters
    ----------
    subsets
        Subsets by rising level.
    notes
        Ranges of level that were merged because they held too few segments, one sentence each.
    """

    subsets: tuple[LevelSubset, ...]
    notes: tuple[str, ...] = ()


def subsets_of_equal_width(segments: SegmentCorrelations, n_subsets: int, *, min_segments: int = 2) -> LevelSubsets:
    """Sort segments into ranges of level of equal width.

    Parameters
    ----------
    segments
        Correlations of at least one segment.
    n_subsets
        Number J of ranges, 2 to 5 in the thesis; 1 gives ACS-Cov-SSI.
    min_segments
        Smallest number of segments of a subset; a subset with fewer is merged with its neighbour, with a note.

    Returns
    -------
    LevelSubsets

    Raises
    ------
    ParameterError
        If `n_subsets` is below 1.

    References
    ----------
    F. Liu (2020), section 4.2, steps 4 to 6.
    """
    levels = segment_levels(segments)
    edges = np.linspace(levels.min(), levels.max(), int(check_number("n_subsets", n_subsets, at_least=1)) + 1)
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
    subsets = [
        LevelSubset((float(edges[k]), float(edges[k + 1])), np.flatnonzero(where == k)) for k in range(len(counts))
    ]
    return LevelSubsets(tuple(subsets), tuple(notes))


def _counts(levels: Real, edges: Real) -> Indices:
    """Return the number of levels between each pair of edges."""
    return np.bincount(np.digitize(levels, edges[1:-1]), minlength=len(edges) - 1)
