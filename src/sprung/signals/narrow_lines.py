"""Narrow lines in averaged periodograms: their height, their regularity and their multiples."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import fft, special

from sprung._arrays import Indices, Real
from sprung.recording import Recording
from sprung.signals.spectrum import short_time_spectra

#: Bins of the Hann window's main lobe on each side, and last bin of the neighbourhood that a line must exceed.
MAIN_LOBE, NEIGHBOURHOOD = 2, 12
#: Resolution of a Hann window (its noise bandwidth) in bins.
NOISE_BANDWIDTH = 1.5
#: Number of segments whose powers are compared at a time, and smallest number for any conclusion.
BLOCK, FEWEST_SEGMENTS = 6, 5
#: Smallest number of samples of a segment, and number of segment lengths.
SHORTEST_SEGMENT, N_OCTAVES = 64, 8
#: Loss of energy [dB] at a finer resolution up to which a line is steady, and up to which its band reaches no further.
MOST, NEARLY_ALL = 2.0, 1.0
#: Smallest resolution of a line that drifts over the finest resolution of the recording.
DRIFTING = 5.0
#: Number of correlated bins of a Hann window that say as much as one independent bin, 1 + 2 (4/9 + 1/36).
_BINS_OF_ONE = 1.944


@dataclass(frozen=True, slots=True)
class Line:
    """Peak no wider than the window.

    Parameters
    ----------
    frequency, tolerance, resolution
        Frequency, its uncertainty and the noise bandwidth of the window, in the recording's unit of frequency.
    prominence
        Height over the higher neighbourhood [dB].
    rows
        Rows of the channels that show the line.
    chance
        Probability that the powers of random vibration are as regular (see `chance_of_regularity`), or that a mode
        is as narrow (see `chance_of_narrowness`).
    level
        Power density at the peak [dB].
    """

    frequency: float
    tolerance: float
    resolution: float
    prominence: float
    rows: frozenset[int]
    chance: float = 1.0
    level: float = 0.0


@dataclass(frozen=True, eq=False, slots=True)
class Periodograms:
    """Periodograms of consecutive segments.

    Parameters
    ----------
    powers
        Periodogram of each channel and segment, shape (channels, segments, bins).
    densities
        Their means over the segments, shape (channels, bins).
    bin_width
        Distance of bins, in the recording's unit of frequency.
    """

    powers: Real
    densities: Real
    bin_width: float


@dataclass(frozen=True, slots=True)
class Family:
    """Lines at multiples of a fundamental: `members` pairs the index of a line with its order."""

    fundamental: float
    tolerance: float
    members: tuple[tuple[int, int], ...]


def octaves(longest: float, recording: Recording) -> list[float]:
    """Return segment lengths up to `longest`, each half of the one before, rounded down to good FFT lengths."""
    n_samples = [int(longest * recording.sampling_rate / 2**octave) for octave in range(N_OCTAVES)]
    return [fft.prev_fast_len(n, real=True) / recording.sampling_rate for n in n_samples if n >= SHORTEST_SEGMENT]


def narrow_lines(
    recording: Recording,
    *,
    segment_length: float,
    prominence: float,
    false_alarm_rate: float,
    is_geometric: bool = False,
    least_damping: float | None = None,
) -> list[Line]:
    """Find the peaks of each channel's averaged periodogram that are as narrow as the window.

    Parameters
    ----------
    recording
        Recording without missing values.
    segment_length
        Length of the averaged segments [s].
    prominence
        Smallest height over the median of bins 3 to 12 on either side [dB].
    false_alarm_rate
        Probability of any peak in noise with a smooth spectrum, which raises the smallest height where few segments are
        averaged.
    is_geometric
        Whether the logarithms of the powers are averaged, so that no single segment makes a line.
    least_damping
        Smallest damping ratio of a mode: a peak may also be a line because it is narrower than any mode
        (`chance_of_narrowness`); None: only because it is regular (`chance_of_regularity`).

    Returns
    -------
    list of Line
        Lines of each channel; a line in several channels occurs in each.
    """
    level = periodograms(recording, segment_length)
    return lines_of(
        level,
        prominence=prominence,
        false_alarm_rate=false_alarm_rate,
        is_geometric=is_geometric,
        least_damping=least_damping,
    )


def periodograms(recording: Recording, segment_length: float) -> Periodograms:
    """Return the periodograms of half-overlapping segments [s] of each channel."""
    spectra = short_time_spectra(recording, segment_length=segment_length)
    powers = np.concatenate([block.real**2 + block.imag**2 for block in spectra], axis=1)
    bin_width = float(recording.sampling_rate / round(segment_length * recording.sampling_rate))
    return Periodograms(powers, powers.mean(axis=1), bin_width)


def lines_of(
    periodograms: Periodograms,
    *,
    prominence: float,
    false_alarm_rate: float,
    is_geometric: bool = False,
    least_damping: float | None = None,
) -> list[Line]:
    """Find the peaks of averaged periodograms; parameters as for `narrow_lines`."""
    powers, bin_width = periodograms.powers, periodograms.bin_width
    n_channels, n_segments, n_bins = powers.shape
    if n_segments < (FEWEST_SEGMENTS if least_damping is None else 1):
        return []
    random = _random_height(n_segments, false_alarm_rate / (n_channels * n_bins), is_geometric)
    densities = _geometric_mean(powers) if is_geometric else periodograms.densities
    lines = []
    for row, density in enumerate(densities):
        bins, heights = _peaks(density)
        is_high = heights >= max(prominence, random)
        for k, height in zip(bins[is_high].tolist(), heights[is_high].tolist(), strict=True):
            offset, level = _vertex(density[k - 1 : k + 2])
            frequency = (k + offset) * bin_width
            chance = chance_of_regularity(powers[row, :, k])
            if least_damping is not None:
                ratio = 2 * least_damping * frequency / bin_width
                narrowness = n_channels * n_bins * chance_of_narrowness(density, k, ratio, n_segments)
                chance = min(chance, narrowness)
            lines.append(
                Line(
                    frequency=frequency,
                    tolerance=bin_width / 2,
                    resolution=NOISE_BANDWIDTH * bin_width,
                    prominence=height,
                    rows=frozenset([row]),
                    chance=chance,
                    level=level,
                )
            )
    return lines


def chance_of_regularity(powers: Real) -> float:
    """Return the probability that the powers of random vibration differ as little from segment to segment.

    Parameters
    ----------
    powers
        Squared amplitudes of consecutive segments in one bin, shape (segments,).

    Returns
    -------
    float
        Upper bound of the probability; 1 for fewer than 5 segments.

    Notes
    -----
    The powers of a Gaussian signal in m independent segments are exponentially distributed, so that the shares
    P / sum P are uniform on a simplex at any level. A spectral kurtosis k = m sum P^2 / (sum P)^2 (2 for long
    random signals, 1 for a tone) means that they lie within the radius sqrt((k - 1) / m) of its centre, which has
    the probability V(m - 1) ((k - 1) / m)^((m - 1)/2) (m - 1)! / sqrt(m) with V(n) the volume of the unit ball in n
    dimensions: exact up to k = 1 + 1/(m - 1), an upper bound beyond.

    Blocks of 6 segments (or a few more) are judged separately because lines come and go: the smallest probability
    that any number of blocks are as regular as these, times the number of blocks (Berk and Jones' statistic with
    Bonferroni's bound).

    References
    ----------
    R. H. Berk and D. H. Jones (1979), Goodness-of-fit test statistics that dominate the Kolmogorov statistics,
    Zeitschrift für Wahrscheinlichkeitstheorie und verwandte Gebiete 47, 47-59.

    Examples
    --------
    >>> import numpy as np
    >>> chance_of_regularity(np.array([1.0, 1.1, 1.0, 0.9, 1.0, 1.0])) < 1e-4
    True
    """
    if powers.size < FEWEST_SEGMENTS or not powers.all():
        return 1.0
    n_blocks = max(1, powers.size // BLOCK)
    m = powers.size // n_blocks
    blocks = powers[: m * n_blocks].reshape(n_blocks, m)
    excess = m * np.sum(blocks**2, axis=1) / np.sum(blocks, axis=1) ** 2 - 1
    log_ball = (m - 1) / 2 * math.log(math.pi) - special.gammaln((m + 1) / 2)
    log_simplex = math.log(m) / 2 - special.gammaln(m)
    log_chance = log_ball - log_simplex + (m - 1) / 2 * np.log(np.maximum(excess, 1e-12) / m)
    chances = np.sort(np.exp(np.minimum(log_chance, 0.0)))
    return float(min(1.0, n_blocks * np.min(special.bdtrc(np.arange(n_blocks), n_blocks, chances))))


def chance_of_narrowness(density: Real, peak: int, bandwidth: float, n_segments: int) -> float:
    """Return the probability that a mode or smooth noise rises as much above its neighbourhood.

    Parameters
    ----------
    density
        Averaged periodogram of Hann-windowed segments, shape (bins,).
    peak
        Bin of the peak.
    bandwidth
        Half-power bandwidth of the narrowest possible mode at the peak [bins].
    n_segments
        Number of half-overlapping segments averaged.

    Returns
    -------
    float
        Upper bound of the probability.

    Notes
    -----
    The spectrum of a mode of half-power bandwidth b falls off as 1 / (1 + (2 d / b)^2) at the distance d, so the
    density at the peak is compared with the mean of its neighbours (bins 3 to 12 on either side) times
    1 + (2 d / b)^2. Of random vibration the ratio follows Fisher's distribution if the peak is the narrowest mode, and
    is smaller for wider modes and smooth noise. Where the segments do not resolve b the weights are so large that
    nothing is called a line.

    References
    ----------
    D. J. Thomson (1982), Spectrum estimation and harmonic analysis, Proceedings of the IEEE 70, 1055-1096 (F test of
    lines, section XIII).
    """
    distance = np.arange(MAIN_LOBE + 1, NEIGHBOURHOOD + 1)
    bins = np.concatenate([peak - distance[distance < peak], peak + distance[peak + distance < density.size - 1]])
    weights = 1 + (2 * (bins - peak) / max(bandwidth, 1e-9)) ** 2
    floor = max(float(np.mean(weights * density[bins])), float(np.finfo(np.float64).tiny))
    n_independent = n_segments / (1 + (n_segments - 1) / n_segments / 18)
    freedom = 2 * n_independent
    return float(special.fdtrc(freedom, freedom * bins.size / _BINS_OF_ONE, density[peak] / floor))


def merge_peaks(peaks: Iterable[Line], *, known: Sequence[Line] = ()) -> list[Line]:
    """Merge peaks of all channels and resolutions that are one line, the finest first; omit those of `known` lines."""
    lines: list[Line] = []
    for peak in sorted(peaks, key=lambda peak: (peak.resolution, peak.chance, -peak.prominence)):
        if any(_is_same(peak, line) for line in known):
            continue
        same = next((i for i, line in enumerate(lines) if _is_same(peak, line)), None)
        if same is None:
            lines.append(peak)
        else:
            line = lines[same]
            lines[same] = replace(
                line,
                prominence=max(peak.prominence, line.prominence),
                chance=min(peak.chance, line.chance),
                rows=line.rows | peak.rows,
            )
    return sorted(lines, key=lambda line: line.frequency)


def whole_lines(regular: Iterable[Line], peaks: Sequence[Line]) -> list[Line]:
    """Return regular lines at the finest resolution that holds most of their energy, without their parts.

    Parameters
    ----------
    regular
        Lines of all channels and resolutions.
    peaks
        All peaks, regular or not.

    Returns
    -------
    list of Line
        Lines of each channel.

    Notes
    -----
    The density at the peak of a sine grows with the length of the segments. That of a line whose frequency drifts does
    not: a finer resolution shows narrow parts of it, none of which is the line.
    """
    finest = min((peak.resolution for peak in peaks), default=0.0)
    lines: list[Line] = []
    drifting: list[Line] = []
    for line in sorted(regular, key=lambda line: -line.resolution):
        if any(_is_same(line, other) and _is_part(line, other, MOST) for other in drifting):
            continue
        sharp = _sharpest(line, peaks, MOST)
        if sharp.resolution > finest * DRIFTING:
            drifting.append(line)
            sharp = _sharpest(line, peaks, NEARLY_ALL)
        lines.append(sharp)
    return lines


def _is_part(line: Line, whole: Line, loss: float) -> bool:
    """Return whether a peak holds less of the energy of a line than the loss allows, or is in another channel."""
    gain = 10 * math.log10(whole.resolution / line.resolution)
    return line.rows != whole.rows or line.level < whole.level + gain - loss


def _sharpest(line: Line, peaks: Iterable[Line], loss: float) -> Line:
    """Return a line at the finest resolution that holds its energy but for a loss [dB]."""
    best = line
    for peak in peaks:
        is_finer = peak.resolution < best.resolution * (1 - 1e-9) and peak.rows == line.rows
        if is_finer and _is_same(peak, line) and not _is_part(peak, line, loss):
            best = peak
    return replace(best, chance=line.chance)


def has_own_width(line: Line, finer: Periodograms) -> bool:
    """Return whether a peak is wider than a finer resolution: its density then does not grow as that of a sine."""
    (row,) = line.rows
    reach = round(line.resolution / NOISE_BANDWIDTH * MAIN_LOBE / finer.bin_width)
    k = round(line.frequency / finer.bin_width)
    peak = finer.densities[row, max(k - reach, 0) : k + reach + 1].max(initial=0.0)
    gain = line.resolution / (NOISE_BANDWIDTH * finer.bin_width)
    return bool(peak < math.sqrt(gain) * 10 ** (line.level / 10))


def multiples(fundamental: float, tolerance: float, lines: Sequence[Line]) -> Family:
    """Find the lines at multiples of a frequency.

    Parameters
    ----------
    fundamental, tolerance
        Frequency and its uncertainty. Each multiple refines it for the next; the search ends where an order is no
        longer certain (an eighth of the fundamental).
    lines
        Lines by rising frequency.

    Returns
    -------
    Family
        Family whose fundamental is the median of the members' frequency / order.
    """
    followed = fundamental
    members: list[tuple[int, int]] = []
    for i, line in enumerate(lines):
        order = round(line.frequency / followed)
        allowed = line.tolerance + order * tolerance
        if allowed > fundamental / 8:
            break
        if order >= 1 and abs(line.frequency - order * followed) <= allowed:
            members.append((i, order))
            if line.tolerance / order < tolerance:
                followed, tolerance = line.frequency / order, line.tolerance / order
    ratios = [lines[i].frequency / order for i, order in members] or [fundamental]
    return Family(float(np.median(ratios)), tolerance, tuple(members))


def largest_family(lines: Sequence[Line]) -> Family | None:
    """Return the largest family: multiples of a line, or of its half or third if most of those exist."""
    best: Family | None = None
    for most, line, divisor in _most_multiples(lines):
        if best is not None and most <= len(best.members):
            break
        family = multiples(line.frequency / divisor, line.tolerance / divisor, lines)
        orders = [order for _, order in family.members]
        is_family = len(orders) >= 2 and (divisor == 1 or len(orders) > max(2, orders[-1] / 2))
        if is_family and (best is None or len(orders) > len(best.members)):
            best = family
    return best


def _most_multiples(lines: Sequence[Line]) -> list[tuple[int, Line, int]]:
    """Return the largest possible number of multiples for each line and divisor, largest first."""
    frequencies = np.array([line.frequency for line in lines])
    tolerances = np.array([line.tolerance for line in lines])
    bounds = []
    for divisor in (1, 2, 3):
        for line in lines:
            fundamental, tolerance = line.frequency / divisor, line.tolerance / divisor
            orders = np.round(frequencies / fundamental)
            reach = np.minimum(tolerances + 2 * (orders + 1) * tolerance, fundamental / 4)
            is_multiple = (orders >= 1) & (np.abs(frequencies - orders * fundamental) <= reach)
            bounds.append((int(np.count_nonzero(is_multiple)), line, divisor))
    return sorted(bounds, key=lambda bound: -bound[0])


def _random_height(n_segments: int, rate: float, is_geometric: bool) -> float:
    """Return the height that one bin of an averaged periodogram exceeds by chance at this rate [dB]."""
    if is_geometric:
        return float(10 / math.log(10) * -special.ndtri(rate) * math.pi / math.sqrt(6 * n_segments))
    return 10 * math.log10(special.chdtri(2 * n_segments, rate) / (2 * n_segments))


def _geometric_mean(powers: Real) -> Real:
    """Return the geometric mean over the segments."""
    return np.exp(np.mean(np.log(np.maximum(powers, np.finfo(np.float64).tiny)), axis=1))


def _peaks(density: Real) -> tuple[Indices, Real]:
    """Return the highest bins of main lobes and their height over the median of the higher neighbourhood [dB]."""
    margin = 2 * MAIN_LOBE + 1
    lobes = np.lib.stride_tricks.sliding_window_view(density, 2 * MAIN_LOBE + 1).max(axis=-1)
    centres = np.arange(MAIN_LOBE, density.size - MAIN_LOBE)
    bins = centres[(density[centres] == lobes) & (density[centres] > 0)]
    bins = bins[(bins >= margin) & (bins < density.size - margin)]
    sides = np.arange(MAIN_LOBE + 1, NEIGHBOURHOOD + 1)
    medians = [
        np.median(density[np.clip(bins[:, None] + side, MAIN_LOBE, density.size - 2)], axis=1)
        for side in (sides, -sides)
    ]
    floor = np.maximum(np.maximum(*medians), np.finfo(np.float64).tiny)
    return bins, 10 * np.log10(density[bins] / floor)


def _vertex(three: Real) -> tuple[float, float]:
    """Return place [bins] and level [dB] of the vertex of the parabola through the logarithms of a peak."""
    below, at, above = (math.log(max(value, np.finfo(np.float64).tiny)) for value in three.tolist())
    offset = (below - above) / (2 * (below - 2 * at + above)) if at > max(below, above) else 0.0
    return offset, 10 / math.log(10) * (at - (below - above) * offset / 4)


def _is_same(first: Line, second: Line) -> bool:
    """Return whether two peaks lie within a main lobe."""
    lobe = MAIN_LOBE / NOISE_BANDWIDTH * max(first.resolution, second.resolution)
    return abs(first.frequency - second.frequency) <= lobe
