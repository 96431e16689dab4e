"""What the likelihood needs of the recordings: mean spectral matrices of segments of similar speed."""

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from scipy import signal

from sprung._arrays import Complex, Indices, Real
from sprung._checks import check_number, freeze
from sprung.errors import DataError
from sprung.likelihood.coordinates import RigidLayout
from sprung.recording import Recording

#: Half-overlapping Hann windows count every sample about twice: variance over that of independent segments and
#: frequencies, the sum of the squared coherences of all overlapping pairs (19 / 9).
OVERCOUNT = 19 / 9
#: Length of a segment [s] and share that the next one repeats.
SEGMENT, OVERLAP = 5.12, 0.5
#: Slowest mean speed [m/s], and coefficient of variation of the speed in a segment: up to the first, or where too few
#: segments are so steady the steadiest ones up to the second.
SLOWEST, STEADY, UNSTEADIEST = 3.0, 0.02, 0.12
_ENOUGH = 60
#: Width of a speed class, relative to its speed.
CLASS_WIDTH = 0.05


@dataclass(frozen=True, eq=False, slots=True)
class SegmentSpectra:
    """Spectra of segments in the coordinates of a layout.

    Parameters
    ----------
    frequencies
        Shape (frequencies,) [Hz].
    values
        Shape (segments, frequencies, coordinates): the mean of values values^H is the spectral matrix, one-sided,
        in squared units of the coordinates per Hz.
    speeds, spreads
        Mean speed [m/s] and its coefficient of variation, shape (segments,); NaN and 0 without a speed.
    segment_length
        In s.
    n_rejected
        Segments left out: too slow, or of changing speed.
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
    """Mean spectral matrices of segments of similar speed: their size does not grow with the length of the record.

    Parameters
    ----------
    frequencies
        Shape (frequencies,) [Hz].
    counts
        Segments in each class, shape (classes,).
    speeds, spreads
        Mean speed of each class [m/s] and the relative spread of speeds about it that blurs the delays.
    matrices
        Shape (classes, frequencies, coordinates, coordinates), Hermitian.
    segment_length
        In s.
    weights
        How many segments each class and frequency counts for, shape (classes, frequencies): the counts, less where
        the model is not trusted, 0 where a line of wheels or engine sits.
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
        """The frequencies with one more at each end, for the window's main lobe (see `through_window`)."""
        step = 1 / self.segment_length
        return np.concatenate([[self.frequencies[0] - step], self.frequencies, [self.frequencies[-1] + step]])

    @property
    def n_segments(self) -> int:
        """Segments in all classes."""
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
        With the channels of the layout in SI units, no missing values; no segment spans a gap.
    layout
        Combines the channels into coordinates.
    speed
        Name of the speed channel [m/s]; None: speeds are NaN, and every segment is taken.
    band
        Lowest and highest frequency [Hz].
    segment_length
        In s.

    Raises
    ------
    DataError
        Where no segment is fast and steady enough.
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
    """Return up to which spread of its speed a segment is used."""
    enough = float(np.sort(spreads)[min(_ENOUGH, spreads.size) - 1]) if spreads.size else STEADY
    return min(max(STEADY, 1.001 * enough), UNSTEADIEST)


def class_spectra(segments: SegmentSpectra, *, width: float = CLASS_WIDTH) -> ClassSpectra:
    """Average segments of similar speed.

    Parameters
    ----------
    segments
        Of one condition.
    width
        Ratio of a class' largest and smallest speed, less 1.
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
    """Return the spectral matrices that Hann-windowed segments show of true ones on a grid, (..., grid, m, m).

    Notes
    -----
    E S^(f_k) = 2/3 S(f_k) + 1/6 (S(f_k-1) + S(f_k+1)): the window's spectrum at the lines of the segment. Exact where
    correlations have died out after half a segment; it blurs resonances and the fringes of the delay as the data do.
    The grid's ends are lost.
    """
    return matrices[..., 1:-1, :, :] * (2 / 3) + (matrices[..., 2:, :, :] + matrices[..., :-2, :, :]) / 6


def onto_grid(weights: Complex) -> Complex:
    """Return the adjoint of `through_window`: weights of the grid from weights of the lines."""
    found = np.zeros((*weights.shape[:-3], weights.shape[-3] + 2, *weights.shape[-2:]), dtype=weights.dtype)
    found[..., 1:-1, :, :] = weights * (2 / 3)
    found[..., 2:, :, :] += weights / 6
    found[..., :-2, :, :] += weights / 6
    return found


def speed_classes(speeds: Real, *, width: float = CLASS_WIDTH) -> Indices:
    """Return for each segment the number of its class, 0 upwards by rising speed; unknown speeds are one class."""
    return np.unique(_class_numbers(speeds, width), return_inverse=True)[1]


def _class_numbers(speeds: Real, width: float) -> Indices:
    """Return the number of each segment's class, whatever other classes there are."""
    found = np.zeros(speeds.size, dtype=np.intp)
    known = np.isfinite(speeds)
    found[known] = np.floor(np.log(speeds[known]) / np.log1p(width)).astype(np.intp)
    return found


def _stretch(
    recording: Recording, stretch: slice, layout: RigidLayout, speed: str | None, segment_length: float
) -> Iterable[tuple[Complex, Real, Real, float, int]]:
    """Yield spectra of the channels (segments, frequencies, channels), speeds, spreads, frequency step and length."""
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
