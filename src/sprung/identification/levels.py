"""Correlations by the level just before, which shows no trend in a linear system."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Indices, Real
from sprung._checks import freeze
from sprung.identification.correlation import (
    Correlations,
    SegmentCorrelations,
    average,
    lagged_sums,
    segment_bounds,
)
from sprung.recording import Recording

#: Window of the level over the span of the lags.
_WINDOW = 0.125
#: Samples between the window of the level and the sample: filters without phase spread each sample over its neighbours.
_GUARD = 4
#: Classes of level for each subset; beyond those of the first record each is this much wider, this many on each side.
_CLASSES, _STEP, _N_STEPS = 4, 1.4, 6
#: A level counts at most like this multiple of the median power: one pothole does not decide.
_MOST_POWER = 4.0


@dataclass(frozen=True, eq=False, slots=True)
class LevelScale:
    """Window of the level of a sample, and the classes of level.

    Parameters
    ----------
    window
        Number of samples over which the level is taken, at least 1.
    edges
        Rising bounds between the classes, shape (classes - 1,).
    """

    window: int
    edges: Real

    def __post_init__(self) -> None:
        freeze(self, edges=1)


@dataclass(frozen=True, eq=False, slots=True)
class LevelCorrelations:
    """Sums of lagged products by segment and by the level just before the earlier factor.

    Parameters
    ----------
    parts
        Sums of the products of each segment and class that occur together, in the order of the segments.
    segments, classes
        Segment and class of each part, shape (parts,).
    powers
        Sums over the same products of the mean square of all channels at the later factor, shape (parts, lags).
    scale
        Classes of level.
    span
        Lowest and highest level.
    """

    parts: SegmentCorrelations
    segments: Indices
    classes: Indices
    powers: Real
    scale: LevelScale
    span: tuple[float, float]

    def __post_init__(self) -> None:
        freeze(self, powers=2)
        freeze(self, segments=1, classes=1, dtype=np.intp)


@dataclass(frozen=True, eq=False, slots=True)
class LevelSet:
    """Correlations whose earlier factor follows on a level within a range.

    Parameters
    ----------
    level
        Lowest and highest level.
    correlations
        Average, with the blocks of all segments.
    powers
        Mean square of all channels at each lag, shape (lags,).
    """

    level: tuple[float, float]
    correlations: Correlations
    powers: Real

    def __post_init__(self) -> None:
        freeze(self, powers=1)


def past_levels(recording: Recording, window: int) -> Real:
    """Return the level just before each sample.

    Parameters
    ----------
    recording
        Recording whose channels are scaled to an RMS of about 1.
    window
        Number of samples.

    Returns
    -------
    numpy.ndarray
        Root of the mean square of all channels over `window` samples, of which the last is five samples earlier; 1 for
        the first samples of each stretch, which have no past. Shape (samples,).
    """
    levels = np.ones(recording.samples.shape[1])
    for stretch in recording.stretches():
        power = np.mean(recording.samples[:, stretch] ** 2, axis=0)
        total = np.concatenate([[0.0], np.cumsum(power)])
        late = window + _GUARD
        if len(power) > late:
            mean = (total[window : len(power) - _GUARD] - total[: len(power) - late]) / window
            levels[stretch.start + late : stretch.stop] = np.sqrt(np.maximum(mean, 0.0))
    return levels


def level_scale(recording: Recording, *, n_lags: int, n_subsets: int) -> LevelScale:
    """Return the classes of level for records like this one.

    Parameters
    ----------
    recording
        First prepared record.
    n_lags
        Number of lags of the correlations.
    n_subsets
        Number of subsets that the classes are joined to.

    Returns
    -------
    LevelScale
        Window of an eighth of the lags; classes with equal numbers of samples of this record, and wider ones beyond.
    """
    window = max(1, round(_WINDOW * n_lags))
    levels = past_levels(recording, window)
    shares = np.arange(1, _CLASSES * n_subsets) / (_CLASSES * n_subsets)
    edges = np.unique(np.quantile(levels, shares)) if len(shares) else np.ones(1)
    beyond = _STEP ** np.arange(1, _N_STEPS + 1)
    return LevelScale(window, np.concatenate([edges[0] / beyond[::-1], edges, edges[-1] * beyond]))


def correlate_by_level(
    recording: Recording,
    scale: LevelScale,
    *,
    n_lags: int,
    segment: float | None = None,
    references: Sequence[str] | None = None,
) -> LevelCorrelations:
    """Cut a recording into segments and correlate each, separately for each level just before.

    Parameters
    ----------
    recording
        Recording with finite samples, channels scaled to an RMS of about 1.
    scale
        Window of the level and classes.
    n_lags, segment, references
        As for `correlate_segments`; the later factor of a product may lie in the next segment.

    Returns
    -------
    LevelCorrelations

    Raises
    ------
    DataError
        If no stretch holds `n_lags` samples.

    Notes
    -----
    sum of y(n + m) y_ref(n) over the n of a segment whose level a(n) lies in a class. For a linear system whose
    excitation has no memory, E[y(n + m) z(n)] = C A^(m - 1) G for every z(n) made of the past up to n: all classes have
    the poles of the whole, however the level of the excitation varies. Sorting by the level of the products themselves
    selects the excitation after n, too, which biases damping.
    """
    names = recording.names if references is None else tuple(references)
    rows = [recording.index(name) for name in names]
    levels = past_levels(recording, scale.window)
    where = np.digitize(levels, scale.edges)
    power = np.mean(recording.samples**2, axis=0)
    sums, counts, powers, segments, classes = [], [], [], [], []
    for k, (first, last, stop) in enumerate(segment_bounds(recording, segment, n_lags)):
        late, here = recording.samples[:, first:stop], where[first:last]
        occurring = np.unique(here)
        masks = (here == occurring[:, None]).astype(np.float64)
        early = (masks[:, None] * late[rows, : last - first]).reshape(-1, last - first)
        products = lagged_sums(late, early, n_lags).reshape(len(late), len(occurring), len(rows), n_lags)
        sums.append(products.transpose(1, 0, 2, 3))
        has_later = np.minimum(last - first, stop - first - np.arange(n_lags))
        counts.append(np.concatenate([np.zeros((len(masks), 1)), np.cumsum(masks, axis=1)], axis=1)[:, has_later])
        powers.append(lagged_sums(power[None, first:stop], masks, n_lags)[0])
        segments.append(np.full(len(occurring), k))
        classes.append(occurring)
    return LevelCorrelations(
        SegmentCorrelations(
            np.concatenate(sums), np.concatenate(counts), recording.sampling_rate, recording.names, names
        ),
        np.concatenate(segments),
        np.concatenate(classes),
        np.concatenate(powers),
        scale,
        (float(levels.min()), float(levels.max())),
    )


def joined_levels(records: Sequence[LevelCorrelations]) -> LevelCorrelations:
    """Put the segments of several records, which have one scale, one after another."""
    first = records[0]
    offsets = np.cumsum([0, *(record.segments.max() + 1 for record in records)])
    return replace(
        first,
        parts=replace(
            first.parts,
            sums=np.concatenate([record.parts.sums for record in records]),
            n_products=np.concatenate([record.parts.n_products for record in records]),
            records=tuple(number for number, record in enumerate(records) for _ in record.segments),
        ),
        segments=np.concatenate(
            [record.segments + offset for record, offset in zip(records, offsets[:-1], strict=True)]
        ),
        classes=np.concatenate([record.classes for record in records]),
        powers=np.concatenate([record.powers for record in records]),
        span=(min(record.span[0] for record in records), max(record.span[1] for record in records)),
    )


def level_sets(levels: LevelCorrelations, n_subsets: int) -> tuple[LevelSet, ...]:
    """Return the averages over ranges of level with about equal numbers of products.

    Parameters
    ----------
    levels
        Correlations by segment and class.
    n_subsets
        Largest number of ranges, at least 1.

    Returns
    -------
    tuple of LevelSet
        Averages by rising level, with the same blocks.
    """
    n_classes = len(levels.scale.edges) + 1
    counts = np.bincount(levels.classes, levels.parts.n_products[:, 0], n_classes).astype(np.float64)
    middle = (np.cumsum(counts) - counts / 2) / counts.sum()
    subset = np.unique(np.minimum((middle * n_subsets).astype(int), n_subsets - 1), return_inverse=True)[1]
    weights = _weights(levels, counts)
    return tuple(
        _level_set(levels, np.flatnonzero(subset == k), weights)
        for k in range(subset.max() + 1)
        if counts[subset == k].any()
    )


def _weights(levels: LevelCorrelations, counts: Real) -> Real:
    """Return the weight of each class, less than 1 for levels far above the median."""
    inner = np.concatenate([levels.scale.edges[:1], levels.scale.edges])
    median = inner[np.searchsorted(np.cumsum(counts), counts.sum() / 2)]
    return np.minimum(1.0, _MOST_POWER * (median / inner) ** 2)


def _level_set(levels: LevelCorrelations, chosen: Indices, weights: Real) -> LevelSet:
    """Return the average over some classes."""
    parts, edges = levels.parts, np.concatenate([[-np.inf], levels.scale.edges, [np.inf]])
    is_chosen = np.isin(levels.classes, chosen)
    n_segments = int(levels.segments.max()) + 1
    factors = weights[levels.classes[is_chosen]]
    sums = np.zeros((n_segments, *parts.sums.shape[1:]))
    n_products = np.zeros((n_segments, parts.n_lags))
    np.add.at(sums, levels.segments[is_chosen], factors[:, None, None, None] * parts.sums[is_chosen])
    np.add.at(n_products, levels.segments[is_chosen], factors[:, None] * parts.n_products[is_chosen])
    # Sums by Fourier transforms are not exactly zero where there is no product.
    sums[np.broadcast_to(n_products[:, None, None] <= 0, sums.shape)] = 0.0
    records = (
        tuple(parts.records[row] for row in np.unique(levels.segments, return_index=True)[1]) if parts.records else ()
    )
    correlations = average(replace(parts, sums=sums, n_products=n_products, records=records))
    powers = np.sum(factors[:, None] * levels.powers[is_chosen], axis=0) / n_products.sum(axis=0)
    share = n_products[:, 0].sum() / (weights[levels.classes] * parts.n_products[:, 0]).sum()
    return LevelSet(
        (max(float(edges[chosen[0]]), levels.span[0]), min(float(edges[chosen[-1] + 1]), levels.span[1])),
        replace(correlations, n_segments=max(1, round(share * n_segments))),
        powers,
    )
