"""Spectra of whole records for the likelihood of modes, accumulated over narrow bins of frequency."""

from dataclasses import dataclass, replace
from functools import reduce
from itertools import pairwise
from operator import add

import numpy as np

from sprung._arrays import Booleans, Complex, Indices, Real
from sprung._checks import check_number, freeze
from sprung.errors import ParameterError
from sprung.recording import Recording

#: Share of a stretch over which the taper rises and falls, both ends together.
_TAPERED = 0.1
#: Variance of means over many lines of a tapered stretch, relative to independent lines: mean w^4 / (mean w^2)^2.
OVERCOUNT = (1 - 93 * _TAPERED / 128) / (1 - 5 * _TAPERED / 8) ** 2
#: Variance of the taper's spectral kernel, times the squared duration, as it acts on peaks some lines wide.
_KERNEL_VARIANCE = 0.9
#: Width of the narrowest bins over their frequency: a twelfth of the half-power bandwidth at 0.3 % damping.
_RELATIVE_WIDTH = 5e-4


@dataclass(frozen=True, eq=False, slots=True)
class LineSpectra:
    """Spectral matrices averaged over narrow bins of frequency.

    Parameters
    ----------
    frequencies
        Mean frequency of the lines of each bin [Hz], rising, shape (bins,).
    spreads
        Standard deviation of the spectral kernel of each bin [Hz]: taper and averaging; shape (bins,).
    counts
        Number of independent spectral estimates averaged in each bin, shape (bins,).
    matrices
        Mean spectral matrix of each bin, density, shape (bins, channels, channels).

    Raises
    ------
    ParameterError
        If the shapes are inconsistent.
    """

    frequencies: Real
    spreads: Real
    counts: Real
    matrices: Complex

    def __post_init__(self) -> None:
        freeze(self, frequencies=1, spreads=1, counts=1)
        freeze(self, matrices=3, dtype=np.complex128)
        if not len(self.frequencies) == len(self.spreads) == len(self.counts) == len(self.matrices):
            raise ParameterError(
                f"{len(self.frequencies)} frequencies, {len(self.spreads)} spreads, {len(self.counts)} counts and"
                f" {len(self.matrices)} matrices must be equally many"
            )

    def take(self, chosen: Indices | Booleans) -> "LineSpectra":
        """Return the chosen bins."""
        return LineSpectra(self.frequencies[chosen], self.spreads[chosen], self.counts[chosen], self.matrices[chosen])

    @property
    def middle(self) -> float:
        """Geometric mean of the frequencies [Hz]."""
        return float(np.exp(np.mean(np.log(self.frequencies))))

    def tilted(self, exponents: Real, *, middle: float | None = None) -> "LineSpectra":
        """Return the spectra of channels multiplied by (f / middle)^exponents, shape (channels,)."""
        factors = (self.frequencies[:, None] / (middle or self.middle)) ** exponents
        return replace(self, matrices=self.matrices * factors[:, :, None] * factors[:, None, :])

    def joined(self, groups: Indices) -> "LineSpectra":
        """Return the spectra of wider bins.

        Parameters
        ----------
        groups
            Number of the wider bin of each bin, from 0 without omissions, shape (bins,).
        """
        starts = np.flatnonzero(np.diff(groups, prepend=-1))
        counts = np.add.reduceat(self.counts, starts)
        frequencies = np.add.reduceat(self.counts * self.frequencies, starts) / counts
        offsets = self.frequencies - frequencies[groups]
        variances = np.add.reduceat(self.counts * (self.spreads**2 + offsets**2), starts) / counts
        sums = np.add.reduceat(self.counts[:, None, None] * self.matrices, starts)
        matrices = np.asarray(sums / counts[:, None, None], dtype=np.complex128)
        return LineSpectra(frequencies, np.sqrt(variances), counts, matrices)


def line_edges(low: float, high: float, *, duration: float, relative_width: float = _RELATIVE_WIDTH) -> Real:
    """Return the edges of bins that hold about one line of a stretch, or are far narrower than light modes' peaks.

    Parameters
    ----------
    low, high
        Lowest and highest frequency [Hz], 0 < low < high.
    duration
        Duration of the stretches [s].
    relative_width
        Width of the bins over their frequency, above 0.

    Returns
    -------
    ndarray
        Edges [Hz]: the width is 1 / duration, or `relative_width` of the frequency where that is more.

    Raises
    ------
    ParameterError
        If `low` or `duration` is not above 0, or `high` is not above `low`.
    """
    check_number("low", low, above=0)
    check_number("high", high, above=low)
    check_number("duration", duration, above=0)
    turn = 1 / (duration * relative_width)
    narrow = np.arange(low, min(turn, high), 1 / duration)
    first = max(turn, low)
    n_wide = max(int(np.log(high / first) / relative_width), 0)
    return np.concatenate([narrow, first * np.exp(relative_width * np.arange(n_wide + 1))])


@dataclass(frozen=True, eq=False, slots=True)
class LineSums:
    """Sums over the lines of stretches in each bin; `+` adds stretches and records.

    Parameters
    ----------
    edges
        Edges of the bins [Hz], shape (bins + 1,).
    moments
        Numbers of lines, sums of their frequencies, and of the squared frequency plus the variance of the taper's
        kernel; shape (3, bins).
    matrices
        Sums of the lines' spectral matrices, shape (bins, channels, channels).
    longest
        Duration of the longest stretch [s].
    """

    edges: Real
    moments: Real
    matrices: Complex
    longest: float

    def __post_init__(self) -> None:
        freeze(self, edges=1, moments=2)
        freeze(self, matrices=3, dtype=np.complex128)

    def __add__(self, other: "LineSums") -> "LineSums":
        """Add the lines of other stretches of the same channels in the same bins."""
        moments, matrices = self.moments + other.moments, self.matrices + other.matrices
        return LineSums(self.edges, moments, matrices, max(self.longest, other.longest))

    def scaled(self, factors: Real) -> "LineSums":
        """Return the sums for channels multiplied by factors, shape (channels,)."""
        return replace(self, matrices=self.matrices * np.outer(factors, factors))

    def spectra(self) -> LineSpectra:
        """Return the mean spectra of the bins that hold lines."""
        used = np.flatnonzero(self.moments[0])
        n_lines, first, second = self.moments[:, used]
        mean = first / n_lines
        spreads = np.sqrt(np.maximum(second / n_lines - mean**2, 0.0))
        return LineSpectra(mean, spreads, n_lines / OVERCOUNT, self.matrices[used] / n_lines[:, None, None])


def line_sums(recording: Recording, edges: Real) -> LineSums:
    """Sum the lines of all stretches of a recording, each tapered and transformed as a whole.

    Parameters
    ----------
    recording
        Recording without missing values.
    edges
        Edges of the bins [Hz], rising from above 0, shape (bins + 1,).

    Returns
    -------
    LineSums
        Sums of one-sided densities.
    """
    sums = [_stretch_sums(recording.samples[:, part], recording.sampling_rate, edges) for part in recording.stretches()]
    return reduce(add, sums)


def block_sums(recording: Recording, edges: Real, *, duration: float) -> list[LineSums]:
    """Sum the lines of consecutive blocks of about the same duration [s], each in the same bins; parameters as above.

    Returns
    -------
    list of LineSums
        Sums of each block; stretches shorter than half a block are left out.
    """
    rate, blocks = recording.sampling_rate, []
    for stretch in recording.stretches():
        length = stretch.stop - stretch.start
        n_blocks = round(length / (duration * rate))
        bounds = np.linspace(stretch.start, stretch.stop, n_blocks + 1).round().astype(int)
        if n_blocks:
            blocks += [_stretch_sums(recording.samples[:, a:b], rate, edges) for a, b in pairwise(bounds)]
    return blocks


def _stretch_sums(samples: Real, sampling_rate: float, edges: Real) -> LineSums:
    """Return the sums of one stretch."""
    n_channels, n_samples = samples.shape
    duration, taper = n_samples / sampling_rate, _taper(n_samples)
    moments = np.zeros((3, len(edges) - 1))
    matrices = np.zeros((len(edges) - 1, n_channels, n_channels), dtype=np.complex128)
    lines = np.fft.rfft((samples - samples.mean(axis=1, keepdims=True)) * taper, axis=1)
    frequencies = np.arange(lines.shape[1]) / duration
    first, last = np.searchsorted(frequencies, [edges[0], edges[-1]])
    if first == last:
        return LineSums(edges, moments, matrices, duration)
    used = np.ascontiguousarray(lines[:, first:last].T) * np.sqrt(2 / (sampling_rate * np.sum(taper**2)))
    frequencies = frequencies[first:last]
    bins = np.searchsorted(edges, frequencies, side="right") - 1
    starts = np.flatnonzero(np.diff(bins, prepend=-1))
    rows = bins[starts]
    moments[0, rows] = np.diff(np.append(starts, len(bins)))
    moments[1, rows] = np.add.reduceat(frequencies, starts)
    moments[2, rows] = np.add.reduceat(frequencies**2 + _KERNEL_VARIANCE / duration**2, starts)
    for row in range(n_channels):
        matrices[rows, row] = np.add.reduceat(used[:, row, None] * used.conj(), starts)
    return LineSums(edges, moments, matrices, duration)


def _taper(n_samples: int) -> Real:
    """Return the window that rises and falls as a cosine over the first and the last twentieth of the samples."""
    times = (np.arange(n_samples) + 0.5) / n_samples
    ends = np.minimum(np.minimum(times, 1 - times) / (_TAPERED / 2), 1.0)
    return np.asarray(0.5 - 0.5 * np.cos(np.pi * ends))
