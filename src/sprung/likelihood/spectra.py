"""Statistics of the recordings that the likelihood needs: mean spectral matrices of segments of similar speed."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import TypeVar

import numpy as np

from sprung._arrays import Complex, Indices, Real
from sprung._checks import check_number, freeze
from sprung.errors import DataError
from sprung.likelihood.coordinates import RigidLayout
from sprung.recording import Recording

Matrices = TypeVar("Matrices", Real, Complex)

#: Variance with half-overlapping Hann windows, which count every sample about twice, over that of independent segments
#: and frequencies: the sum of the squared coherences of all overlapping pairs (19 / 9).
OVERCOUNT = 19 / 9
#: Length of a segment [s] and share of it that the next one repeats.
SEGMENT, OVERLAP = 5.12, 0.5
#: Lowest mean speed of a segment [m/s].
SLOWEST = 3.0
#: Coefficient of variation of the speed up to which a segment is used; where fewer than `_ENOUGH` segments are as
#: steady, the steadiest ones are used up to the second value.
STEADY, UNSTEADIEST = 0.02, 0.12
_ENOUGH = 60
#: Width of a speed class, relative to its speed.
CLASS_WIDTH = 0.05


@dataclass(frozen=True, slots=True)
class UpdateLimits:
    """When a speed channel is updated slowly."""

    #: Shortest time between updates [s].
    slow: float = 0.1
    #: Quantile of the times between changes that is one update.
    quantile: float = 0.1
    #: Largest departure from whole periods, and share of such departures.
    irregular: float = 0.1
    #: Smallest number of changes.
    min_updates: int = 10


UPDATES = UpdateLimits()


@dataclass(frozen=True, eq=False, slots=True)
class SegmentSpectra:
    """Spectra of segments in the coordinates of a layout.

    Parameters
    ----------
    frequencies
        Frequencies [Hz], shape (frequencies,).
    values
        Spectra of which the mean of values values^H is the one-sided spectral matrix in squared units of the
        coordinates per Hz, shape (segments, frequencies, coordinates).
    speeds, spreads
        Mean speed [m/s] and its coefficient of variation, shape (segments,); NaN and 0 without a speed.
    segment_length
        Length of a segment [s].
    n_rejected
        Number of segments left out: too slow, or of changing speed.
    """

    frequencies: Real
    values: Complex
    speeds: Real
    spreads: Real
    segment_length: float
    n_rejected: int

    def __post_init__(self) -> None:
        freeze(self, frequencies=1, speeds=1, spreads=1)
        freeze(self, values=3, dtype=np.complex128)


@dataclass(frozen=True, eq=False, slots=True)
class ClassSpectra:
    """Mean spectral matrices of segments of similar speed, whose size does not grow with the length of the record.

    Parameters
    ----------
    frequencies
        Frequencies [Hz], shape (frequencies,).
    counts
        Number of segments in each class, shape (classes,).
    speeds, spreads
        Mean speed of each class [m/s] and relative spread of the speeds about it, which blurs the delays, shape
        (classes,).
    matrices
        Mean spectral matrices, Hermitian, shape (classes, frequencies, coordinates, coordinates).
    segment_length
        Length of a segment [s].
    weights
        Number of segments that each class and frequency counts for in the likelihood, shape (classes, frequencies): the
        counts times the tempering, 0 where a line is masked.
    members
        Speeds of the segments of each class and their own spreads, shape (2, segments) each; empty: not known.

    Notes
    -----
    The spectra of segments are taken as independent complex Gaussian vectors; their mean spectral matrices and numbers
    are then sufficient for the likelihood (complex Wishart distribution).

    References
    ----------
    N. R. Goodman, Statistical analysis based on a certain multivariate complex Gaussian distribution, Annals of
    Mathematical Statistics 34 (1963), 152-177.
    """

    frequencies: Real
    counts: Real
    speeds: Real
    spreads: Real
    matrices: Complex
    segment_length: float
    weights: Real
    members: tuple[Real, ...] = ()

    def __post_init__(self) -> None:
        freeze(self, weights=2)
        freeze(self, frequencies=1, counts=1, speeds=1, spreads=1)
        freeze(self, matrices=4, dtype=np.complex128)

    @property
    def grid(self) -> Real:
        """Frequencies with one more at each end, for the main lobe of the window (see `through_window`)."""
        step = 1 / self.segment_length
        return np.concatenate([[self.frequencies[0] - step], self.frequencies, [self.frequencies[-1] + step]])

    @property
    def n_segments(self) -> int:
        """Number of segments in all classes."""
        return int(self.counts.sum())


def segment_spectra(
    recordings: Iterable[Recording],
    layout: RigidLayout,
    *,
    speed: str | None,
    band: tuple[float, float],
    segment_length: float = SEGMENT,
) -> SegmentSpectra:
    """Return the spectra of half-overlapping Hann-windowed segments of nearly constant speed.

    Parameters
    ----------
    recordings
        Recordings with the channels of the layout in SI units and no missing values; no segment spans a gap.
    layout
        Combinations of the channels.
    speed
        Name of the speed channel [m/s]; None: speeds are NaN, and every segment is taken.
    band
        Lowest and highest frequency [Hz].
    segment_length
        Length of a segment [s].

    Returns
    -------
    SegmentSpectra
        Segments that are fast and steady enough, in the order of time.

    Raises
    ------
    ParameterError
        If the length of a segment is not above 0.
    DataError
        If no stretch is as long as a segment, or no segment is fast and steady enough.

    References
    ----------
    P. D. Welch, The use of fast Fourier transform for the estimation of power spectra, IEEE Transactions on Audio and
    Electroacoustics AU-15 (1967), 70-73.

    Examples
    --------
    All accelerometers in phase at 5 Hz are bounce alone, of the mean square 1/2:

    >>> import numpy as np
    >>> from sprung.likelihood import rigid_layout
    >>> from sprung.recording import Channel, Recording
    >>> from sprung.vehicles import read_vehicle, structure
    >>> layout = rigid_layout(structure(read_vehicle("zafira")))
    >>> tone = np.tile(np.sin(2 * np.pi * 5 * np.arange(2000) / 100), (4, 1))
    >>> run = Recording(tone, 100.0, tuple(Channel(name, "acceleration") for name in layout.names))
    >>> spectra = segment_spectra([run], layout, speed=None, band=(1.0, 20.0), segment_length=4.0)
    >>> power = (np.abs(spectra.values) ** 2).mean(axis=0) / spectra.segment_length
    >>> layout.coordinates, (power.sum(axis=0) + 0).round(6).tolist()
    (('bounce', 'pitch', 'roll'), [0.5, 0.0, 0.0])
    >>> float(spectra.frequencies[power[:, 0].argmax()])
    5.0
    """
    check_number("segment_length", segment_length, above=0)
    records = list(recordings)
    parts = [
        (recording.sampling_rate, _stretch_spectra(recording, stretch, layout, segment_length))
        for recording, stretch in _stretches(records, segment_length)
    ]
    if not parts:
        raise DataError(
            f"no stretch without a gap is as long as a segment of {segment_length:.3g} s: give longer records"
        )
    n_per_segment = round(segment_length * parts[0][0])
    frequencies = np.asarray(np.arange(n_per_segment // 2 + 1) * parts[0][0] / n_per_segment, dtype=np.float64)
    in_band = (frequencies >= band[0]) & (frequencies <= band[1])
    values = np.concatenate([spectra for _, spectra in parts])[:, in_band]
    frequencies = frequencies[in_band]
    segments = SegmentSpectra(
        frequencies=frequencies,
        values=(values * layout.differentiator(frequencies, parts[0][0])) @ layout.reduction.T,
        speeds=np.full(len(values), np.nan),
        spreads=np.zeros(len(values)),
        segment_length=segment_length,
        n_rejected=0,
    )
    return segments if speed is None else steady_segments(segments, *segment_speeds(records, speed, segment_length))


def segment_speeds(
    recordings: Iterable[Recording], speed: str, segment_length: float, *, delay: float = 0.0
) -> tuple[Real, Real]:
    """Return the mean speeds of half-overlapping segments and their coefficients of variation.

    Parameters
    ----------
    recordings
        Recordings as for `segment_spectra`.
    speed
        Name of the speed channel [m/s]; values held between slow updates are interpolated (`between_updates`).
    segment_length
        Length of a segment [s].
    delay
        Time by which the speed channel is late [s].

    Returns
    -------
    ndarray, ndarray
        Shape (segments,) each, in the order of `segment_spectra` without a speed.

    Notes
    -----
    Means over the squared window, as in the spectra.

    References
    ----------
    P. D. Welch, The use of fast Fourier transform for the estimation of power spectra, IEEE Transactions on Audio and
    Electroacoustics AU-15 (1967), 70-73.
    """
    means, spreads = delayed_speeds(recordings, speed, segment_length, np.array([delay]))
    return means[0], spreads[0]


def delayed_speeds(
    recordings: Iterable[Recording], speed: str, segment_length: float, delays: Real
) -> tuple[Real, Real]:
    """Return mean speeds and coefficients of variation as `segment_speeds`, for each of several delays.

    Parameters
    ----------
    recordings, speed, segment_length
        As for `segment_speeds`.
    delays
        Times by which the speed channel may be late [s], shape (delays,).

    Returns
    -------
    ndarray, ndarray
        Shape (delays, segments) each.

    References
    ----------
    As for `segment_speeds`.
    """
    means, spreads = [], []
    for recording, stretch in _stretches(recordings, segment_length):
        rate = recording.sampling_rate
        values = between_updates(recording.samples[recording.index(speed), stretch], rate)
        n_samples = round(segment_length * rate)
        weights = _hann(n_samples) ** 2
        weights /= weights.sum()
        earlier = (_windows(_earlier(values, delay * rate), n_samples) for delay in delays)
        moments = np.array([(segments @ weights, segments**2 @ weights) for segments in map(np.copy, earlier)])
        mean = moments[:, 0]
        variance = np.maximum(moments[:, 1] - mean**2, 0.0)
        means.append(mean)
        spreads.append(np.sqrt(variance) / np.maximum(np.abs(mean), 1e-9))
    return np.concatenate(means, axis=1), np.concatenate(spreads, axis=1)


def _earlier(values: Real, shift: float) -> Real:
    """Return samples at times later by `shift` samples, on straight lines; the first and the last go on."""
    whole = int(np.floor(shift))
    first, last = max(-whole, 0), max(whole + 1, 0)
    held = np.pad(values, (first, last), mode="edge")[first + whole :][: values.size + 1]
    return np.asarray(held[:-1] + (shift - whole) * np.diff(held) if shift > whole else held[:-1])


def between_updates(values: Real, sampling_rate: float) -> Real:
    """Return a speed that is updated slowly and held in between, interpolated linearly; any other one unchanged.

    Parameters
    ----------
    values
        Speed [m/s], shape (samples,).
    sampling_rate
        Sampling rate [Hz].

    Notes
    -----
    Updates are slow and regular if nearly all times between changes are multiples of a tenth of a second or more. A
    speed in whole km/h changes at irregular times.

    References
    ----------
    A. V. Oppenheim and R. W. Schafer, Discrete-Time Signal Processing, 3rd edition, Pearson, 2010, section 4.8
    (zero-order hold).
    """
    changes = 1 + np.flatnonzero(np.diff(values))
    if changes.size < UPDATES.min_updates:
        return values
    gaps = np.diff(changes)
    period = float(np.quantile(gaps, UPDATES.quantile))
    counts = np.maximum(np.rint(gaps / period), 1)
    is_irregular = np.mean(np.abs(gaps / period - counts) > UPDATES.irregular) > UPDATES.irregular
    if is_irregular or period < UPDATES.slow * sampling_rate:
        return values
    period = float(gaps.sum() / counts.sum())
    between = (start + period * np.arange(count) for start, count in zip(changes, [*counts, 1], strict=True))
    updates = np.concatenate([[max(changes[0] - period, 0)], *between])
    held = values[np.minimum(np.rint(updates).astype(np.intp), values.size - 1)]
    return np.interp(np.arange(values.size), updates, held)


def steady_segments(segments: SegmentSpectra, speeds: Real, spreads: Real) -> SegmentSpectra:
    """Return the segments that are fast and steady enough, with their speeds.

    Parameters
    ----------
    segments
        All segments of recordings, without speeds.
    speeds, spreads
        Mean speed of each [m/s] and its coefficient of variation, shape (segments,).

    Raises
    ------
    DataError
        If no segment is fast and steady enough.
    """
    is_good = (speeds > SLOWEST) & (spreads < _bound(spreads[speeds > SLOWEST]))
    if not is_good.any():
        raise DataError(
            f"none of {is_good.size} segments of {segments.segment_length:g} s is faster than {SLOWEST:g} m/s at a "
            f"speed within {100 * UNSTEADIEST:g} %: give a drive at steadier speed"
        )
    return replace(
        segments,
        values=segments.values[is_good],
        speeds=speeds[is_good],
        spreads=spreads[is_good],
        n_rejected=int(np.count_nonzero(~is_good)),
    )


def _bound(spreads: Real) -> float:
    """Spread of the speed up to which a segment is used."""
    enough = float(np.sort(spreads)[min(_ENOUGH, spreads.size) - 1]) if spreads.size else STEADY
    return min(max(STEADY, 1.001 * enough), UNSTEADIEST)


def class_spectra(segments: SegmentSpectra, *, width: float = CLASS_WIDTH) -> ClassSpectra:
    """Return the mean spectral matrices of segments of similar speed.

    Parameters
    ----------
    segments
        Segments of one condition.
    width
        Ratio of the largest and smallest speed of a class, less 1.

    Notes
    -----
    S^ = mean of y y^H over the segments of a class. The spread of a class has variance mean of the segments' own
    squared spreads + variance of their mean speeds over the squared speed of the class.

    References
    ----------
    P. D. Welch, The use of fast Fourier transform for the estimation of power spectra, IEEE Transactions on Audio and
    Electroacoustics AU-15 (1967), 70-73.

    Examples
    --------
    Segments at 10.0 and 10.2 m/s are one class, that at 20 m/s is another:

    >>> import numpy as np
    >>> from sprung.likelihood import SegmentSpectra
    >>> values, speeds = np.array([1.0, 3.0, 2.0]).reshape(3, 1, 1), np.array([10.0, 10.2, 20.0])
    >>> segments = SegmentSpectra(np.array([5.0]), values, speeds, np.zeros(3), segment_length=4.0, n_rejected=0)
    >>> classes = class_spectra(segments)
    >>> classes.speeds.round(2).tolist(), classes.counts.tolist(), classes.matrices.ravel().real.round(2).tolist()
    ([10.1, 20.0], [2.0, 1.0], [5.0, 4.0])
    """
    numbers = speed_classes(segments.speeds, width=width)
    counts, speeds, spreads, matrices, each = [], [], [], [], []
    for number in range(numbers.max() + 1):
        members = np.flatnonzero(numbers == number)
        each.append(np.array([segments.speeds[members], segments.spreads[members]]))
        values = segments.values[members]
        counts.append(members.size)
        speeds.append(segments.speeds[members].mean())
        within, between = (
            np.mean(segments.spreads[members] ** 2),
            np.var(segments.speeds[members] / speeds[-1]),
        )
        spreads.append(np.sqrt(within + between))
        matrices.append(np.einsum("sfi,sfj->fij", values, values.conj()) / members.size)
    return ClassSpectra(
        frequencies=segments.frequencies,
        counts=np.array(counts, dtype=np.float64),
        speeds=np.array(speeds),
        spreads=np.array(spreads),
        matrices=np.array(matrices),
        segment_length=segments.segment_length,
        weights=np.repeat(np.array(counts, dtype=np.float64)[:, None], segments.frequencies.size, axis=1),
        members=tuple(each),
    )


def through_window(matrices: Matrices, *, every: int = 1) -> Matrices:
    """Return the expected spectral matrices of Hann-windowed segments for true ones on a grid, (..., grid, m, m).

    Parameters
    ----------
    matrices
        True spectral matrices S, shape (..., grid, m, m), or their real coordinates as columns, (..., grid, m^2, 1).
    every
        Step between the lines that are returned, from the middle of the first step on.

    Returns
    -------
    ndarray
        Of the same shape but for the grid, whose ends are lost: (..., grid - 2, m, m), or some of these lines.

    Notes
    -----
    E S^(f_k) = 2/3 S(f_k) + 1/6 (S(f_k-1) + S(f_k+1)): the spectral window at the lines of the segment, squared weights
    of 1/2, 1 and 1/2 over their sum. A good approximation where correlations decay within half a segment; it blurs
    resonances and the fringes of the delay as the data do.

    References
    ----------
    F. J. Harris, On the use of windows for harmonic analysis with the discrete Fourier transform, Proceedings of the
    IEEE 66 (1978), 51-83 (Hann window).
    """
    before, at, after = (matrices[..., every // 2 + k : matrices.shape[-3] - 2 + k : every, :, :] for k in range(3))
    return at * (2 / 3) + (after + before) / 6


def onto_grid(weights: Complex) -> Complex:
    """Return the adjoint of `through_window`: weights on the grid for weights at the lines of the segment.

    Parameters
    ----------
    weights
        Shape (..., frequencies, m, m).

    Returns
    -------
    ndarray
        Shape (..., frequencies + 2, m, m), of three rows in Fortran order.

    Notes
    -----
    sum tr(weights through_window(S)) = sum tr(onto_grid(weights) S) for every S.

    References
    ----------
    F. J. Harris, On the use of windows for harmonic analysis with the discrete Fourier transform, Proceedings of the
    IEEE 66 (1978), 51-83 (Hann window).
    """
    shape = (*weights.shape[:-3], weights.shape[-3] + 2, *weights.shape[-2:])
    on_grid = np.zeros(shape, dtype=weights.dtype, order="F" if weights.shape[-1] == 3 else "C")
    on_grid[..., 1:-1, :, :] = weights * (2 / 3)
    on_grid[..., 2:, :, :] += weights / 6
    on_grid[..., :-2, :, :] += weights / 6
    return on_grid


def speed_classes(speeds: Real, *, width: float = CLASS_WIDTH) -> Indices:
    """Return the number of each segment's class, from 0 in the order of speed; unknown speeds are one class."""
    numbers = np.zeros(speeds.size, dtype=np.intp)
    known = np.isfinite(speeds)
    numbers[known] = np.floor(np.log(speeds[known]) / np.log1p(width)).astype(np.intp)
    return np.unique(numbers, return_inverse=True)[1]


def _stretches(recordings: Iterable[Recording], segment_length: float) -> Iterator[tuple[Recording, slice]]:
    """Yield the stretches without a gap that hold a segment."""
    for recording in recordings:
        for stretch in recording.stretches():
            if stretch.stop - stretch.start >= round(segment_length * recording.sampling_rate):
                yield recording, stretch


def _windows(samples: Real, n_per_segment: int) -> Real:
    """Half-overlapping segments of samples, shape (..., segments, samples)."""
    step = max(1, round(n_per_segment * (1 - OVERLAP)))
    return np.lib.stride_tricks.sliding_window_view(samples, n_per_segment, axis=-1)[..., ::step, :]


def _hann(n_samples: int) -> Real:
    """Periodic Hann window."""
    return np.asarray(0.5 - 0.5 * np.cos(2 * np.pi * np.arange(n_samples) / n_samples), dtype=np.float64)


def _stretch_spectra(recording: Recording, stretch: slice, layout: RigidLayout, segment_length: float) -> Complex:
    """Return the spectra of differenced channels in each segment of a stretch, (segments, frequencies, channels)."""
    rows = [recording.index(name) for name in layout.names]
    samples = layout.differenced(recording.samples[rows, stretch], recording.sampling_rate)
    windows = _windows(samples, round(segment_length * recording.sampling_rate))
    window = _hann(windows.shape[-1])
    scale = np.sqrt(2 / (recording.sampling_rate * np.sum(window**2)))
    spectra = np.fft.rfft((windows - windows.mean(axis=-1, keepdims=True)) * window, axis=-1) * scale
    return np.asarray(spectra.transpose(1, 2, 0), dtype=np.complex128)
