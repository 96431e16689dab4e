"""Correlations by the level predicted from the past, which shows no trend in a linear system."""

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

#: Windows of the past and of the future over the number of lags.
_WINDOWS, _AHEAD = (0.125, 0.5, 2.0, 8.0), 0.25
#: Samples between the windows of the past and the sample: filters without phase spread each sample over its neighbours.
_GUARD = 4
#: Bounds between the classes of level, 5 % wide.
_EDGES = np.geomspace(0.05, 20.0, 124)
#: A level counts at most like this multiple of the median power: one pothole does not decide.
_MOST_POWER = 4.0


@dataclass(frozen=True, eq=False, slots=True)
class LevelCorrelations:
    """Sums of lagged products by segment and by the level expected after the earlier factor.

    Parameters
    ----------
    parts
        Sums of the products of each segment and class that occur together, in the order of the segments.
    segments, classes
        Segment and class of each part, shape (parts,).
    powers
        Sums over the same products of the mean square of all channels at the later factor, shape (parts, lags).
    span
        Lowest and highest level.
    """

    parts: SegmentCorrelations
    segments: Indices
    classes: Indices
    powers: Real
    span: tuple[float, float]

    def __post_init__(self) -> None:
        freeze(self, powers=2)
        freeze(self, segments=1, classes=1, dtype=np.intp)


@dataclass(frozen=True, eq=False, slots=True)
class LevelSet:
    """Correlations after whose earlier factor a level within a range is expected.

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


def expected_levels(recording: Recording, n_lags: int) -> Real:
    """Return the level to be expected after each sample, from the past alone.

    Parameters
    ----------
    recording
        Recording whose channels are scaled to an RMS of about 1.
    n_lags
        Number of lags of the correlations.

    Returns
    -------
    numpy.ndarray
        Expected RMS of all channels over the next quarter of the lags, shape (samples,).

    Notes
    -----
    Linear prediction of the logarithm of the mean square from those over several windows that end five samples before:
    short ones hold the free motion that goes on, long ones a slow variation of the excitation. The first samples of
    each stretch have no past: their expected level is the mean.

    References
    ----------
    F. Corsi (2009), A simple approximate long-memory model of realized volatility, Journal of Financial Econometrics 7,
    174-196 (prediction from several windows).
    """
    pasts, futures = [], []
    ahead = max(1, round(_AHEAD * n_lags))
    for stretch in recording.stretches():
        total = np.concatenate([[0.0], np.cumsum(np.mean(recording.samples[:, stretch] ** 2, axis=0))])
        n_samples = len(total) - 1
        now = np.arange(n_samples)
        late = np.maximum(now - _GUARD, 0)
        early = [np.maximum(late - max(1, round(window * n_lags)), 0) for window in _WINDOWS]
        pasts.append([_log_power(total, first, np.where(late < n_lags / 8, first, late)) for first in early])
        end = now + ahead
        futures.append(_log_power(total, now, np.where(end <= n_samples, end, now)))
    past, future = np.concatenate(pasts, axis=1).T, np.concatenate(futures)
    has_past = np.asarray(np.isfinite(past).all(axis=1))
    is_known = has_past & np.isfinite(future)
    if not is_known.any():
        return np.ones(len(future))
    mean, centre = future[is_known].mean(), past[is_known].mean(axis=0)
    weights = np.linalg.lstsq(past[is_known] - centre, future[is_known] - mean, rcond=1e-8)[0]
    expected = np.full(len(future), mean)
    expected[has_past] += (past[has_past] - centre) @ weights
    return np.exp(expected / 2)


def _log_power(total: Real, first: Indices, end: Indices) -> Real:
    """Return the logarithm of the mean from the sums up to each sample, NaN over none."""
    power = (total[end] - total[first]) / np.maximum(end - first, 1)
    return np.log(np.where((end > first) & (power > 0), power, np.nan))


def correlate_by_level(
    recording: Recording,
    *,
    n_lags: int,
    segment: float | None = None,
    references: Sequence[str] | None = None,
) -> LevelCorrelations:
    """Cut a recording into segments and correlate each, separately for each level expected from the past.

    Parameters
    ----------
    recording
        Recording with finite samples, channels scaled to an RMS of about 1.
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
    sum of y(n + m) y_ref(n) over the n of a segment at which a level within the class is to be expected
    (`expected_levels`). For a linear system whose excitation has no memory, E[y(n + m) z(n)] = C A^(m - 1) G for every
    z(n) made of the past up to n: all classes have the poles of the whole, however the level of the excitation varies.
    Sorting by the level of the products themselves selects the excitation after n, too, which biases damping.
    """
    names = recording.names if references is None else tuple(references)
    rows = [recording.index(name) for name in names]
    levels = expected_levels(recording, n_lags)
    where = np.digitize(levels, _EDGES)
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
        (float(levels.min()), float(levels.max())),
    )


def joined_levels(records: Sequence[LevelCorrelations]) -> LevelCorrelations:
    """Put the segments of several records one after another."""
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


def level_sets(levels: LevelCorrelations, n_subsets: int, *, min_segments: float = 0.0) -> tuple[LevelSet, ...]:
    """Return the averages over ranges of level with about equal numbers of products.

    Parameters
    ----------
    levels
        Correlations by segment and class.
    n_subsets
        Largest number of ranges, at least 1.
    min_segments
        Smallest number of segments that the products of a range fill; a range with fewer, or with less than half of an
        equal share, is joined with its smaller neighbour. 0: as many ranges as there are.

    Returns
    -------
    tuple of LevelSet
        Averages by rising level, with the same blocks.
    """
    counts = np.bincount(levels.classes, levels.parts.n_products[:, 0], len(_EDGES) + 1).astype(np.float64)
    middle = (np.cumsum(counts) - counts / 2) / counts.sum()
    occurring = np.flatnonzero(counts)
    subsets = np.minimum((middle[occurring] * n_subsets).astype(int), n_subsets - 1)
    weights = _weights(counts)
    ranges = [occurring[subsets == k] for k in np.unique(subsets)]
    if min_segments > 0:
        least = max(min_segments / (int(levels.segments.max()) + 1), 0.5 / n_subsets)
        ranges = _with_share(ranges, counts / counts.sum(), least)
    return tuple(_level_set(levels, chosen, weights) for chosen in ranges)


def _with_share(ranges: list[Indices], shares: Real, least: float) -> list[Indices]:
    """Return neighbouring ranges of classes, joined until each has at least this share of the products."""
    joined = list(ranges)
    while len(joined) > 1:
        sizes = np.array([shares[chosen].sum() for chosen in joined])
        smallest = int(np.argmin(sizes))
        if sizes[smallest] >= least:
            break
        is_below = smallest > 0 and (smallest == len(joined) - 1 or sizes[smallest - 1] < sizes[smallest + 1])
        first = smallest - 1 if is_below else smallest
        joined[first : first + 2] = [np.concatenate(joined[first : first + 2])]
    return joined


def _weights(counts: Real) -> Real:
    """Return the weight of each class, less than 1 for levels far above the median."""
    inner = np.concatenate([_EDGES[:1], _EDGES])
    median = inner[np.searchsorted(np.cumsum(counts), counts.sum() / 2)]
    return np.minimum(1.0, _MOST_POWER * (median / inner) ** 2)


def _level_set(levels: LevelCorrelations, chosen: Indices, weights: Real) -> LevelSet:
    """Return the average over some classes."""
    parts, edges = levels.parts, np.concatenate([[-np.inf], _EDGES, [np.inf]])
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
