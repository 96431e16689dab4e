"""Correlations of segments, which add over segments and records, and the deviations of means over their blocks."""

import itertools
import math
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft

from sprung._arrays import Booleans, Indices, Real
from sprung._checks import check_number, freeze
from sprung.errors import DataError, ParameterError
from sprung.recording import Recording

#: Largest number of blocks kept with an average; their spread is its uncertainty.
MAX_BLOCKS = 64


@dataclass(frozen=True, eq=False, slots=True)
class SegmentCorrelations:
    """Sums of lagged products of each segment, which add over segments and records.

    Parameters
    ----------
    sums
        Sums over n of y_channel(n + m) y_reference(n) for lags m from 0, shape (segments, channels, references, lags).
    n_products
        Number of products in each sum, shape (segments, lags).
    sampling_rate
        Sampling rate [Hz].
    channels, references
        Names of the outputs and of the references.
    records
        Number of the record of each segment, from 0; empty: all belong to one record.
    """

    sums: Real
    n_products: Real
    sampling_rate: float
    channels: tuple[str, ...]
    references: tuple[str, ...]
    records: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, sums=4, n_products=2)

    @property
    def n_segments(self) -> int:
        """Number of segments."""
        return int(self.sums.shape[0])

    @property
    def n_lags(self) -> int:
        """Number of lags, lag 0 included."""
        return int(self.sums.shape[-1])

    def take(self, segments: Indices | Sequence[int]) -> "SegmentCorrelations":
        """Return only the given segments."""
        records = tuple(np.array(self.records)[segments].tolist()) if self.records else ()
        return replace(self, sums=self.sums[segments], n_products=self.n_products[segments], records=records)


@dataclass(frozen=True, eq=False, slots=True)
class Correlations:
    """Averaged correlations of one condition.

    Parameters
    ----------
    values
        Lambda_m = E[y(n + m) y_ref(n)] for lags m from 0, shape (channels, references, lags).
    blocks
        Averages over each of up to `MAX_BLOCKS` runs of consecutive segments, shape (blocks, channels, references,
        lags); `values` is their mean with `weights`.
    weights
        Share of each block in `values`, shape (blocks,), sum 1.
    sampling_rate
        Sampling rate [Hz].
    channels, references
        Names of the outputs and of the references.
    n_segments
        Number of segments averaged.
    n_products
        Number of products averaged at lag 0; infinite for exact correlations, or where it is not known.
    records
        Number of the record in which each block begins, from 0; empty: all belong to one record.
    """

    values: Real
    blocks: Real
    weights: Real
    sampling_rate: float
    channels: tuple[str, ...]
    references: tuple[str, ...]
    n_segments: int = 1
    n_products: float = np.inf
    records: tuple[int, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, values=3, blocks=4, weights=1)

    @property
    def n_lags(self) -> int:
        """Number of lags, lag 0 included."""
        return int(self.values.shape[-1])

    @property
    def is_cross(self) -> Booleans:
        """Whether channel and reference are different channels, shape (channels, references)."""
        return np.array([[channel != reference for reference in self.references] for channel in self.channels])

    @property
    def changes(self) -> Real:
        """Deviations of the blocks from `values`, scaled so that their squares add up to the variance of the average.

        Shape (blocks, channels, references, lags); empty where there is only one block.
        """
        n_blocks = len(self.blocks)
        if n_blocks < 2:
            return np.zeros((0, *self.values.shape))
        scale = self.weights * np.sqrt(n_blocks / (n_blocks - 1))
        return scale[:, None, None, None] * (self.blocks - self.values)

    def select(self, channels: Sequence[str], references: Sequence[str]) -> "Correlations":
        """Return only the given outputs and references."""
        pairs = np.ix_(
            [self.channels.index(name) for name in channels],
            [self.references.index(name) for name in references],
        )
        return replace(
            self,
            values=self.values[pairs],
            blocks=np.array([block[pairs] for block in self.blocks]),
            channels=tuple(channels),
            references=tuple(references),
        )


def exact_correlations(
    values: Real,
    *,
    sampling_rate: float,
    channels: Sequence[str] | None = None,
    references: Sequence[str] | None = None,
) -> Correlations:
    """Return correlations that are known, not estimated, and have no uncertainty.

    Parameters
    ----------
    values
        Correlations for lags from 0, shape (channels, references, lags).
    sampling_rate
        Sampling rate [Hz].
    channels, references
        Names of the outputs and of the references; default: "1", "2", ... for both.

    Returns
    -------
    Correlations
        Correlations with a single block.
    """
    n_channels, n_references = values.shape[:2]
    return Correlations(
        values=values,
        blocks=values[None],
        weights=np.ones(1),
        sampling_rate=sampling_rate,
        channels=tuple(channels or [str(k + 1) for k in range(n_channels)]),
        references=tuple(references or [str(k + 1) for k in range(n_references)]),
    )


def correlate_segments(
    recording: Recording,
    *,
    n_lags: int,
    segment: float | None = None,
    references: Sequence[str] | None = None,
    is_continued: bool = False,
) -> SegmentCorrelations:
    """Cut a recording into segments and correlate each.

    Parameters
    ----------
    recording
        Recording with finite samples. Every stretch between gaps is cut into equal segments on its own.
    n_lags
        Number of lags, lag 0 included, at least 2.
    segment
        Smallest length of a segment [s]; a stretch is cut into as many segments as fit, so that no sample is lost.
        None: one segment for each stretch.
    references
        Names of the reference channels; None: all channels.
    is_continued
        Whether the later factor of a product may lie in the next segment of the same stretch, so that the sums of the
        segments add up to the correlation of the whole stretch; False: each segment alone (the form of the thesis).

    Returns
    -------
    SegmentCorrelations

    Raises
    ------
    DataError
        If no stretch holds `n_lags` samples.
    ParameterError
        If `n_lags` is below 2, or a reference is not a channel.

    Notes
    -----
    sum_n y(n + m) y_ref(n) by FFT of overlapping, zero-padded blocks, so that nothing wraps around (overlap-save). The
    mean is not removed.

    References
    ----------
    F. Liu (2020), eq. 4-1.
    """
    n_lags = int(check_number("n_lags", n_lags, at_least=2))
    names = recording.names if references is None else tuple(references)
    rows = [recording.index(name) for name in names]
    bounds = segment_bounds(recording, segment, n_lags)
    sums = np.empty((len(bounds), len(recording.channels), len(rows), n_lags))
    n_products = np.empty((len(bounds), n_lags))
    for k, (first, last, stop) in enumerate(bounds):
        end = stop if is_continued else last
        late = recording.samples[:, first:end]
        sums[k] = lagged_sums(late, late[rows, : last - first], n_lags)
        n_products[k] = np.minimum(last - first, end - first - np.arange(n_lags))
    return SegmentCorrelations(sums, n_products, recording.sampling_rate, recording.names, names)


def segment_bounds(recording: Recording, segment: float | None, n_lags: int) -> list[tuple[int, int, int]]:
    """Return first sample and end of each segment, and the end of its stretch; parameters as `correlate_segments`.

    Raises
    ------
    DataError
        If no stretch holds `n_lags` samples.
    """
    bounds: list[tuple[int, int, int]] = []
    for stretch in recording.stretches():
        length = stretch.stop - stretch.start
        if length < n_lags:
            continue
        shortest = length if segment is None else max(round(segment * recording.sampling_rate), n_lags)
        n_segments = max(length // shortest, 1)
        edges = np.linspace(stretch.start, stretch.stop, n_segments + 1).round().astype(int)
        bounds += [(first, last, stretch.stop) for first, last in itertools.pairwise(edges)]
    if not bounds:
        raise DataError(
            f"no stretch of the recording is as long as {n_lags} lags"
            f" ({n_lags / recording.sampling_rate:.3g} s): record longer or use fewer block rows"
        )
    return bounds


def lagged_sums(late: Real, early: Real, n_lags: int) -> Real:
    """Return sums over n of late(n + m) early(n) for lags m from 0.

    Parameters
    ----------
    late
        Later factors, shape (channels, samples).
    early
        Earlier factors from the same first sample on, shape (references, up to as many samples).
    n_lags
        Number of lags.

    Returns
    -------
    numpy.ndarray
        Sums, shape (channels, references, lags).
    """
    n_early = early.shape[1]
    n_fft = int(fft.next_fast_len(min(max(8 * n_lags, 2048), n_early + n_lags - 1), real=True))
    step = n_fft - n_lags + 1
    cross = np.zeros((len(late), len(early), n_fft // 2 + 1), dtype=complex)
    for first in range(0, n_early, step):
        later = fft.rfft(late[:, first : first + n_fft], n_fft)
        earlier = fft.rfft(early[:, first : first + step], n_fft)
        cross += later[:, None] * earlier.conj()
    return np.asarray(fft.irfft(cross, n_fft)[..., :n_lags])


def join_segments(parts: Sequence[SegmentCorrelations]) -> SegmentCorrelations:
    """Put the segments of several records of one condition one after another.

    Raises
    ------
    ParameterError
        If the records differ in channels, references, lags or sampling rate.
    """
    first = parts[0]
    for part in parts[1:]:
        if (part.channels, part.references, part.n_lags) != (first.channels, first.references, first.n_lags):
            raise ParameterError("records of one condition must have the same channels, references and lags")
        if not np.isclose(part.sampling_rate, first.sampling_rate, rtol=1e-6):
            raise ParameterError(
                f"sampling rates {first.sampling_rate:g} Hz and {part.sampling_rate:g} Hz differ:"
                " bring the records to one rate first (--decimate-to)"
            )
    return replace(
        first,
        sums=np.concatenate([part.sums for part in parts]),
        n_products=np.concatenate([part.n_products for part in parts]),
        records=tuple(number for number, part in enumerate(parts) for _ in range(part.n_segments)),
    )


def with_limited_power(segments: SegmentCorrelations, *, most: float = 4.0) -> SegmentCorrelations:
    """Limit the power of each segment to a multiple of the median power.

    Parameters
    ----------
    segments
        Correlations of channels that are scaled to the same power.
    most
        Largest power over the median power: a segment with a pothole then counts like `most` ordinary segments, not
        like a hundred.

    Returns
    -------
    SegmentCorrelations
        Correlations in which sums and numbers of products of loud segments are multiplied by the same weight, so that
        the correlation of each single segment, and the average of equally loud ones, do not change.
    """
    power = np.linalg.norm(segments.sums[..., 0], axis=(1, 2)) / np.maximum(segments.n_products[:, 0], 1)
    limit = most * np.median(power[power > 0]) if power.any() else 1.0
    weights = limit / np.maximum(power, limit)
    return replace(
        segments,
        sums=segments.sums * weights[:, None, None, None],
        n_products=segments.n_products * weights[:, None],
    )


def average(segments: SegmentCorrelations, *, is_biased: bool = False) -> Correlations:
    """Average the segments' correlations.

    Parameters
    ----------
    segments
        Correlations of the segments of one condition.
    is_biased
        Whether the sum at lag m is divided by the number of products at lag 0 (1/N, the form of the thesis), which
        falls off as (N - m)/N and reads as additional damping where segments are short; False: by its own number of
        products.

    Returns
    -------
    Correlations

    Raises
    ------
    DataError
        If some lag has no product.

    References
    ----------
    F. Liu (2020), eq. 4-1 and section 4.2.
    """
    # The smallest power of two that leaves at most as many blocks.
    n_joined = 1 << max(0, math.ceil(math.log2(max(segments.n_segments, 1) / MAX_BLOCKS)))
    starts = np.arange(0, segments.n_segments, n_joined)
    sums = np.add.reduceat(segments.sums, starts)
    n_products = np.add.reduceat(segments.n_products, starts)
    divisors = np.broadcast_to(n_products[:, :1], n_products.shape) if is_biased else n_products
    if not np.all(divisors.sum(axis=0) > 0):
        raise DataError("the segments are shorter than the lags: use longer segments or fewer lags")
    return Correlations(
        values=sums.sum(axis=0) / divisors.sum(axis=0),
        blocks=sums / np.maximum(divisors, np.finfo(float).tiny)[:, None, None],
        weights=n_products[:, 0] / n_products[:, 0].sum(),
        sampling_rate=segments.sampling_rate,
        channels=segments.channels,
        references=segments.references,
        n_segments=segments.n_segments,
        n_products=float(n_products[:, 0].sum()),
        records=tuple(segments.records[start] for start in starts) if segments.records else (),
    )


@dataclass(frozen=True, slots=True)
class _Rules:
    """Rules of the deviations of means over blocks."""

    #: Parts of a record that are compared.
    n_parts: int = 8
    #: Fewest blocks in a part.
    min_blocks_of_part: int = 2
    #: Fewest blocks that show a deviation.
    min_blocks: int = 4
    #: Probability before any data that chance alone acts.
    prior_of_chance: float = 0.7
    #: Largest ratio of the variance of parts to that by chance.
    max_ratio: float = 100.0


_RULES = _Rules()
#: Ratios of the variance of parts to that by chance, and their probabilities before any data: larger ones less in
#: proportion to their root.
_RATIOS = np.concatenate([[1.0], np.geomspace(1.1, _RULES.max_ratio, 40)])
_PRIOR = (1 - _RULES.prior_of_chance) * _RATIOS**-0.5 / np.sum(_RATIOS[1:] ** -0.5)
_PRIOR[0] = _RULES.prior_of_chance


def deviation_of_mean(influences: Real, records: Indices | None = None) -> Real:
    """Return standard deviations of estimates from the influence of each block of the data on them.

    Parameters
    ----------
    influences
        Change of each estimate with each block, in the order of time, shape (blocks, values), scaled so that their
        squares add up to the variance of the estimate if blocks are independent.
    records
        Rising number of the record of each block, shape (blocks,); None: one record.

    Returns
    -------
    numpy.ndarray
        Standard deviations, shape (values,); NaN for fewer than four blocks.

    Notes
    -----
    Speed, level, load and temperature vary slowly, and with them the system: neighbouring blocks then deviate to the
    same side, and the variance of sums over eight parts of the record, or over records, exceeds that of single blocks.
    With r the ratio of both and n degrees of freedom of the former, the true ratio has the likelihood
    rho^(-n/2) exp(-n r / (2 rho)); the variance is multiplied by its mean a posteriori. A priori chance alone acts
    (rho = 1) with probability 0.7; otherwise ln rho, up to ln 100, has a density in proportion to rho^(-1/2). For few
    blocks the variance is that of Student's distribution. A variation slower than the record is not in it, with a
    single record.

    References
    ----------
    W. K. Newey and K. D. West (1987), A simple, positive semi-definite, heteroskedasticity and autocorrelation
    consistent covariance matrix, Econometrica 55, 703-708 (the problem).
    """
    influences = np.asarray(influences, dtype=np.float64)
    n_blocks = len(influences)
    if n_blocks < _RULES.min_blocks:
        return np.full(influences.shape[1:], np.nan)
    numbers = np.zeros(n_blocks, dtype=np.intp) if records is None else np.unique(records, return_inverse=True)[1]
    variance = np.sum(influences**2, axis=0) * (n_blocks - 1) / (n_blocks - 3)
    n_records = int(numbers.max()) + 1
    if n_blocks >= _RULES.n_parts * _RULES.min_blocks_of_part:
        variance = variance * _growth(influences, _parts(numbers), variance)
    if n_records > 1:
        variance = variance * _growth(influences, numbers, variance)
    return np.asarray(np.sqrt(variance))


def _parts(records: Indices) -> Indices:
    """Return the number of the part of each block: about eight in all, none of which reaches over two records."""
    n_records = int(records[-1]) + 1
    of_a_record = max(1, -(-_RULES.n_parts // n_records))
    parts = np.zeros(len(records), dtype=np.intp)
    for record in range(n_records):
        rows = np.flatnonzero(records == record)
        count = max(1, min(of_a_record, len(rows) // _RULES.min_blocks_of_part))
        parts[rows] = np.arange(len(rows)) * count // len(rows) + (parts[rows[0] - 1] + 1 if record else 0)
    return parts


def _growth(influences: Real, groups: Indices, variance: Real) -> Real:
    """Return the mean a posteriori of the variance of sums over groups of blocks over a variance by chance."""
    n_groups = int(groups.max()) + 1
    sums = np.zeros((n_groups, *influences.shape[1:]))
    np.add.at(sums, groups, influences)
    sums -= np.bincount(groups)[:, None] / len(groups) * sums.sum(axis=0)
    degrees = n_groups - 1
    among = np.sum(sums**2, axis=0) * n_groups / degrees
    ratio = among / np.maximum(variance, np.finfo(float).tiny)
    log_likelihood = -degrees / 2 * (np.log(_RATIOS)[:, None] + ratio / _RATIOS[:, None])
    weights = _PRIOR[:, None] * np.exp(log_likelihood - log_likelihood.max(axis=0))
    return np.asarray(np.sum(weights * _RATIOS[:, None], axis=0) / weights.sum(axis=0))
