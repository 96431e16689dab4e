"""Correlations by the level of the motion, and whether modes depend on it."""

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace

import numpy as np
from scipy import special

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import check_number, freeze
from sprung.identification.correlation import (
    Correlations,
    SegmentCorrelations,
    average,
    join_segments,
    lagged_sums,
    segment_bounds,
)
from sprung.identification.subspace import eigenvalue_weights, frequency_and_damping_changes, poles_of_orders, realise
from sprung.modal import Modes, Poles, mac
from sprung.recording import Recording


@dataclass(frozen=True, slots=True)
class _Rules:
    """Rules of sorting by level, and of the test whether modes depend on it."""

    #: Windows of the past over the number of lags: free motion that goes on, and slow variation of the excitation.
    windows: tuple[float, ...] = (0.125, 0.5, 2.0, 8.0)
    #: Future whose level is expected, over the number of lags.
    ahead: float = 0.25
    #: Samples between the past and the sample: filters without phase spread each sample over its neighbours.
    guard: int = 4
    #: A level counts at most like this multiple of the median power: one pothole does not decide.
    max_power: float = 4.0
    #: Number of ranges of level between which the test compares.
    n_levels: int = 6
    #: Probability of calling a trend in any mode of a record without one.
    false_trends: float = 0.01
    #: Largest order that is searched for a mode.
    max_order: int = 40
    #: Least MAC of shapes that are the same.
    same_shape: float = 0.8
    #: Most rows of the block matrix.
    max_matrix: int = 400
    #: Fewest block rows, where many channels would need more.
    min_rows: int = 20
    #: Fewest blocks of all levels.
    min_blocks: int = 8
    #: Fewest blocks, effectively, of one level.
    min_of_level: float = 4.0
    #: Least share of a mode in a range of levels over its standard deviation.
    min_share: float = 2.0
    #: Change over its standard deviation from which frequency or damping is named.
    clear: float = 2.5


RULES = _Rules()
#: Bounds between the classes of level, 5 % wide.
_EDGES = np.geomspace(0.05, 20.0, 124)


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
    ahead = max(1, round(RULES.ahead * n_lags))
    for stretch in recording.stretches():
        total = np.concatenate([[0.0], np.cumsum(np.mean(recording.samples[:, stretch] ** 2, axis=0))])
        n_samples = len(total) - 1
        now = np.arange(n_samples)
        late = np.maximum(now - RULES.guard, 0)
        early = [np.maximum(late - max(1, round(window * n_lags)), 0) for window in RULES.windows]
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
    offsets = np.cumsum([0, *(record.segments.max() + 1 for record in records)])
    numbers = [record.segments + offset for record, offset in zip(records, offsets[:-1], strict=True)]
    return LevelCorrelations(
        parts=join_segments([record.parts for record in records]),
        segments=np.concatenate(numbers),
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
    return np.minimum(1.0, RULES.max_power * (median / inner) ** 2)


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


@dataclass(frozen=True, eq=False, slots=True)
class LevelTrends:
    """Change of frequency and damping of each mode with the level of the motion, NaN where unknown.

    Parameters
    ----------
    natural_frequency
        Relative change of the natural frequency for twice the level, shape (modes,).
    natural_frequency_std
        Its standard deviation, shape (modes,).
    damping_ratio
        Change of the damping ratio for twice the level, shape (modes,).
    damping_ratio_std
        Its standard deviation, shape (modes,).
    p_value
        Probability of changes at least as large in a linear system, for frequency and damping together, shape (modes,).
    level_ratio
        Level in the highest subset over that in the lowest, during the ring-down of each mode, shape (modes,).
    """

    natural_frequency: Real
    natural_frequency_std: Real
    damping_ratio: Real
    damping_ratio_std: Real
    p_value: Real
    level_ratio: Real

    def __post_init__(self) -> None:
        freeze(self, natural_frequency=1, natural_frequency_std=1, damping_ratio=1, damping_ratio_std=1)
        freeze(self, p_value=1, level_ratio=1)

    def of(self, modes: Indices) -> "LevelTrends":
        """Return the dependence of the modes with these indices, unknown for -1."""
        rows = [np.append(getattr(self, field.name), np.nan)[modes] for field in fields(self)]
        return LevelTrends(*rows)

    @property
    def is_detected(self) -> Booleans:
        """Whether each mode depends on the level beyond chance (1 % for any mode of a linear system)."""
        return np.asarray(self.p_value * max(len(self.p_value), 1) < RULES.false_trends, dtype=np.bool_)


def level_trends(modes: Modes, average: Correlations, sets: Sequence[LevelSet]) -> LevelTrends:
    """Return the dependence of modes on the level.

    Parameters
    ----------
    modes
        Modes on the channels of the correlations.
    average
        Correlations of all levels.
    sets
        Correlations by rising level, with the same blocks.

    Returns
    -------
    LevelTrends

    Notes
    -----
    The modal filter of each mode (`subspace.eigenvalue_weights`), made from the average, gives the pole of each range
    of levels without a new realisation, and its change with each block. Slope: least squares, weighted with the number
    of products, of ln frequency and of the damping ratio over log2 of the level. That is the RMS of all channels during
    the ring-down that follows, weighted with the mode's decay: it acts on the mode, while the expected level only sorts
    the products (an instrument), so that its error does not flatten the slope. p: Hotelling's T^2 of both slopes over
    the blocks.

    References
    ----------
    H. Hotelling (1931), The generalization of Student's ratio, Annals of Mathematical Statistics 2, 360-378.
    """
    rows = np.full((6, len(modes)), np.nan)
    if len(modes) and len(sets) > 1 and len(average.blocks) >= RULES.min_blocks:
        block_rows = min(average.n_lags // 2, max(RULES.max_matrix // len(average.channels), RULES.min_rows))
        largest = min((block_rows - 1) * len(average.channels), block_rows * len(average.references), RULES.max_order)
        realisation = realise(average, block_rows=block_rows, max_order=largest - largest % 2)
        poles = poles_of_orders(realisation, range(2, largest + 1, 2))
        for k in range(len(modes)):
            chosen = _nearest(poles, modes.take(np.array([k])))
            if chosen is not None:
                eigenvalue = np.exp(poles.poles[chosen] / average.sampling_rate)
                weights = eigenvalue_weights(realisation, poles.ladder[poles.rungs[chosen]], complex(eigenvalue))
                rows[:, k] = _trend(weights, abs(eigenvalue), sets)
    return LevelTrends(*rows)


def _nearest(poles: Poles, mode: Modes) -> int | None:
    """Return the most certain pole of the mode's shape near its frequency; None without one."""
    half_width = np.abs(mode.poles.real[0]) + 0.01 * np.abs(mode.poles[0])
    distance = np.abs(np.abs(poles.poles) - np.abs(mode.poles[0]))
    is_near = (distance <= half_width) & (mac(poles.mode_shapes, mode.mode_shapes)[:, 0] >= RULES.same_shape)
    is_near &= poles.poles.real < 0
    if not is_near.any():
        return None
    variance = poles.natural_frequency_std**2 + (poles.natural_frequency * poles.damping_ratio_std) ** 2
    squares = np.abs(poles.poles - mode.poles[0]) ** 2 / (2 * np.pi) ** 2 + variance
    return int(np.argmin(np.where(is_near, squares, np.inf)))


def _trend(weights: tuple[Complex, Complex], modulus: float, sets: Sequence[LevelSet]) -> Real:
    """Return slopes with standard deviations, p and ratio of levels; NaN where a subset hardly has the mode."""
    values, changes, levels = [], [], []
    for part in sets:
        value, change = _pole(weights, part.correlations)
        values.append(value)
        changes.append(change)
        decay = modulus ** (2 * np.arange(len(part.powers)))
        levels.append(np.log2(np.sum(decay * part.powers) / decay.sum()) / 2)
    y, blocks, x = np.array(values), np.array(changes), np.array(levels)
    is_known = np.isfinite(y).all(axis=1)
    shares = np.array([part.correlations.n_segments for part in sets], dtype=np.float64)[is_known, None]
    y, blocks, x = y[is_known], blocks[is_known], x[is_known, None]
    if len(x) < 2 or np.ptp(x) <= 0:
        return np.full(6, np.nan)
    away = x - np.sum(shares * x) / shares.sum()
    contrasts = shares * away / np.sum(shares * away**2)
    slopes = np.sum(contrasts * y, axis=0)
    spread = np.sum(contrasts[..., None] * blocks, axis=0)
    covariance = spread @ spread.T
    degrees = _degrees_of_freedom(spread)
    statistic = slopes @ np.linalg.solve(covariance, slopes) * (degrees - 1) / (2 * degrees)
    p_value = special.fdtrc(2, degrees - 1, statistic)
    deviations = np.sqrt(np.diag(covariance))
    return np.array([slopes[0], deviations[0], slopes[1], deviations[1], p_value, float(2 ** (x[-1, 0] - x[0, 0]))])


def _degrees_of_freedom(spread: Real) -> float:
    """Return the degrees of freedom of a variance from blocks that may differ in power, spread (values, blocks).

    Satterthwaite's: for n equally powerful normal blocks, 3 (sum of squares)^2 / sum of fourth powers is near n.
    """
    squares = spread**2
    of_equal = 3 * np.sum(squares, axis=1) ** 2 / np.sum(squares**2, axis=1)
    return max(min(float(np.min(of_equal)), spread.shape[1]) - 1, 3.0)


def _pole(weights: tuple[Complex, Complex], correlations: Correlations) -> tuple[Real, Real]:
    """Return ln frequency and damping ratio by the modal filter, and their changes with each block, (2, blocks)."""
    n_lags = weights[0].shape[-1]
    terms = [
        np.einsum("bcrm,crm->b", correlations.blocks[..., 1 : n_lags + 1], weight) * correlations.weights
        for weight in weights
    ]
    numerator, denominator = (term.sum() for term in terms)
    n_effective = 1 / np.sum(correlations.weights**2)
    scale = np.sqrt(n_effective / max(n_effective - 1, 0.1))
    eigenvalue = numerator / denominator
    share = np.sqrt(np.sum(np.abs(terms[1] - correlations.weights * denominator) ** 2))
    if n_effective < RULES.min_of_level or abs(denominator) < RULES.min_share * scale * share:
        return np.full(2, np.nan), np.full((2, len(terms[0])), np.nan)
    pole = np.log(eigenvalue) * correlations.sampling_rate
    change = scale * (terms[0] - eigenvalue * terms[1]) / numerator * correlations.sampling_rate
    frequency, damping = frequency_and_damping_changes(pole, change)
    modulus = np.abs(pole)
    return (
        np.array([np.log(modulus), -pole.real / modulus]),
        np.array([2 * np.pi * frequency / modulus, damping]),
    )


def trends_in_words(modes: Modes, trends: LevelTrends) -> list[str]:
    """Return a sentence for each dependence on the level that stands out of chance, or that there is none."""
    sentences = []
    for k in np.flatnonzero(trends.is_detected):
        frequency = trends.natural_frequency[k], trends.natural_frequency_std[k], "{:.2g} % ± {:.2g} %"
        damping = trends.damping_ratio[k], trends.damping_ratio_std[k], "{:.2g} ± {:.2g} percentage points"
        values = (("frequency", *frequency), ("damping ratio", *damping))
        is_clear = [abs(change) > RULES.clear * std for _, change, std, _ in values]
        for (quantity, change, std, form), names_it in zip(values, is_clear, strict=True):
            if names_it or not any(is_clear):
                sentences.append(
                    f"the {quantity} of the mode at {modes.natural_frequency[k]:.3g} Hz"
                    f" {'rises' if change > 0 else 'falls'} by {form.format(100 * abs(change), 100 * std)}"
                    " for twice the level: a nonlinearity"
                )
    if sentences:
        return sentences
    if not np.isfinite(trends.p_value).any():
        return []
    ratio = np.nanmedian(trends.level_ratio)
    return [f"no dependence on the level detected (highest subset over lowest: {ratio:.2f})"]
