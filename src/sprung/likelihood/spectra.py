"""Statistics of the recordings that the likelihood needs: mean spectral matrices of segments of similar speed."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy import signal

from sprung._arrays import Complex, Indices, Real
from sprung._checks import check_number, freeze
from sprung.errors import DataError
from sprung.likelihood.coordinates import RigidLayout
from sprung.recording import Recording

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
    """
    check_number("segment_length", segment_length, above=0)
    parts = [
        part
        for recording in recordings
        for stretch in recording.stretches()
        for part in _stretch(recording, stretch, layout, speed, segment_length)
    ]
    if not parts:
        raise DataError(
            f"no stretch without a gap is as long as a segment of {segment_length:g} s: give longer records"
        )
    step, n_per_segment = parts[0][3], parts[0][4]
    frequencies = np.asarray(np.arange(n_per_segment // 2 + 1) * step, dtype=np.float64)
    in_band = (frequencies >= band[0]) & (frequencies <= band[1])
    values = np.concatenate([part[0] for part in parts])[:, in_band]
    speeds, spreads = np.concatenate([part[1] for part in parts]), np.concatenate([part[2] for part in parts])
    is_good = np.isnan(speeds) | ((speeds > SLOWEST) & (spreads < _bound(spreads[speeds > SLOWEST])))
    if not is_good.any():
        raise DataError(
            f"none of {is_good.size} segments of {segment_length:g} s is faster than {SLOWEST:g} m/s at a speed within "
            f"{100 * UNSTEADIEST:g} %: give a drive at steadier speed"
        )
    frequencies = frequencies[in_band]
    values = values * layout.differentiator(frequencies)
    return SegmentSpectra(
        frequencies=frequencies,
        values=values[is_good] @ layout.reduction.T,
        speeds=speeds[is_good],
        spreads=spreads[is_good],
        segment_length=segment_length,
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
    """
    numbers = speed_classes(segments.speeds, width=width)
    counts, speeds, spreads, matrices = [], [], [], []
    for number in range(numbers.max() + 1):
        members = np.flatnonzero(numbers == number)
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
    )


def through_window(matrices: Complex) -> Complex:
    """Return the expected spectral matrices of Hann-windowed segments for true ones on a grid, (..., grid, m, m).

    Parameters
    ----------
    matrices
        True spectral matrices S, shape (..., grid, m, m).

    Returns
    -------
    ndarray
        Shape (..., grid - 2, m, m): the ends of the grid are lost.

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
    return matrices[..., 1:-1, :, :] * (2 / 3) + (matrices[..., 2:, :, :] + matrices[..., :-2, :, :]) / 6


def onto_grid(weights: Complex) -> Complex:
    """Return the adjoint of `through_window`: weights on the grid for weights at the lines of the segment.

    Parameters
    ----------
    weights
        Shape (..., frequencies, m, m).

    Returns
    -------
    ndarray
        Shape (..., frequencies + 2, m, m).

    Notes
    -----
    sum tr(weights through_window(S)) = sum tr(onto_grid(weights) S) for every S.

    References
    ----------
    F. J. Harris, On the use of windows for harmonic analysis with the discrete Fourier transform, Proceedings of the
    IEEE 66 (1978), 51-83 (Hann window).
    """
    on_grid = np.zeros((*weights.shape[:-3], weights.shape[-3] + 2, *weights.shape[-2:]), dtype=weights.dtype)
    on_grid[..., 1:-1, :, :] = weights * (2 / 3)
    on_grid[..., 2:, :, :] += weights / 6
    on_grid[..., :-2, :, :] += weights / 6
    return on_grid


def speed_classes(speeds: Real, *, width: float = CLASS_WIDTH) -> Indices:
    """Return the number of each segment's class, from 0 in the order of speed; unknown speeds are one class."""
    return np.unique(_class_numbers(speeds, width), return_inverse=True)[1]


def _class_numbers(speeds: Real, width: float) -> Indices:
    """Number of each segment's class on a fixed scale of speeds."""
    numbers = np.zeros(speeds.size, dtype=np.intp)
    known = np.isfinite(speeds)
    numbers[known] = np.floor(np.log(speeds[known]) / np.log1p(width)).astype(np.intp)
    return numbers


def _stretch(
    recording: Recording, stretch: slice, layout: RigidLayout, speed: str | None, segment_length: float
) -> Iterable[tuple[Complex, Real, Real, float, int]]:
    """Yield spectra of the channels (segments, frequencies, channels), speeds, spreads, frequency step, length."""
    rate = recording.sampling_rate
    n_per_segment = round(segment_length * rate)
    if stretch.stop - stretch.start < n_per_segment:
        return
    step = max(1, round(n_per_segment * (1 - OVERLAP)))
    rows = [recording.index(name) for name in layout.names]
    windows = np.lib.stride_tricks.sliding_window_view(recording.samples[rows, stretch], n_per_segment, axis=1)[
        :, ::step
    ]
    window = signal.get_window("hann", n_per_segment)
    scale = np.sqrt(2 / (rate * np.sum(window**2)))
    spectra = np.fft.rfft((windows - windows.mean(axis=-1, keepdims=True)) * window, axis=-1) * scale
    if speed is None:
        speeds, spreads = np.full(windows.shape[1], np.nan), np.zeros(windows.shape[1])
    else:
        moving = np.lib.stride_tricks.sliding_window_view(
            recording.samples[recording.index(speed), stretch], n_per_segment
        )
        weights = window**2 / np.sum(window**2)
        speeds = moving[::step] @ weights
        variances = np.maximum(moving[::step] ** 2 @ weights - speeds**2, 0.0)
        spreads = np.sqrt(variances) / np.maximum(np.abs(speeds), 1e-9)
    yield spectra.transpose(1, 2, 0), speeds, spreads, rate / n_per_segment, n_per_segment
