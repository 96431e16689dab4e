"""Narrow lines in averaged periodograms: their height, their regularity and their multiples."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy import fft, special

from sprung._arrays import Complex, Indices, Real
from sprung._checks import check_complete
from sprung.recording import Recording


@dataclass(frozen=True, slots=True)
class LineSearch:
    """Settings of the search for narrow lines."""

    main_lobe: int = 2  # bins of the Hann window's main lobe on each side
    neighbourhood: int = 12  # last bin of the neighbourhood that a line must exceed
    noise_bandwidth: float = 1.5  # resolution of a Hann window [bins]
    block: int = 6  # segments whose powers are compared at a time
    min_segments: int = 5  # segments for any conclusion
    max_segments: int = 192  # segments of a recording that are searched: runs of consecutive blocks, spread over it
    min_length: int = 64  # samples of a segment
    n_octaves: int = 8  # segment lengths, each half of the one before
    # loss of energy at a finer resolution up to which the band of a line reaches no further [dB]
    max_loss_of_band: float = 1.0
    max_loss: float = 2.0  # loss of energy at a finer resolution up to which a line is steady [dB]
    drifting: float = 5.0  # smallest resolution of a line that drifts over the finest one of the recording
    bins_of_one: float = 1.944  # correlated bins that say as much as one independent bin, 1 + 2 (4/9 + 1/36)
    window_points: int = 32  # points of a Hann window in the covariance of a mode's spectra
    frequencies_in_bin: int = 4  # frequencies that are distinguished in a bin of the whole recording
    # distance of segments in time constants of the narrowest mode, whose powers are then independent
    independence: float = 0.75
    narrowest: float = 0.6  # bandwidth that a peak is compared with, over that of the narrowest mode
    # smallest damping ratio of a mode of a long recording, times its duration [s], and at any duration
    damping_in_time: float = 1.0
    least_damping: float = 3e-4
    bandwidth_in_time: float = 8.0  # or else its half-power bandwidth times the duration
    min_steady: float = 0.7  # share of the energy of the segments in one steady phase that may be a line
    max_steady: int = 30  # segments for that: longer segments show a steady line better


SEARCH = LineSearch()
#: Bins on either side of a band that are computed with it: a neighbourhood and a main lobe of a peak at its edge.
_BESIDE = SEARCH.neighbourhood + 2 * SEARCH.main_lobe + 2


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
class Searched:
    """Samples of a recording as they are searched: of unit variance, in single precision.

    Parameters
    ----------
    samples
        Samples, shape (channels, samples).
    stretches
        Parts without a gap.
    sampling_rate
        Sampling rate, in the recording's unit of frequency.
    """

    samples: NDArray[np.float32]
    stretches: tuple[slice, ...]
    sampling_rate: float


@dataclass(frozen=True, eq=False, slots=True)
class Densities:
    """Averaged periodograms, shape (channels, bins), and the distance of bins in the recording's unit of frequency."""

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
    n_samples = [int(longest * recording.sampling_rate / 2**octave) for octave in range(SEARCH.n_octaves)]
    return [fft.prev_fast_len(n, real=True) / recording.sampling_rate for n in n_samples if n >= SEARCH.min_length]


def searched(recording: Recording) -> Searched:
    """Return the samples of a recording for the search; `DataError` if a channel has missing values."""
    check_complete(recording.names, recording.samples)
    samples = recording.samples - recording.samples.mean(axis=1, keepdims=True)
    deviations = samples.std(axis=1, keepdims=True)
    samples /= np.where(deviations > 0, deviations, 1.0)
    return Searched(samples.astype(np.float32), tuple(recording.stretches()), recording.sampling_rate)


def search_segments(
    searched: Searched,
    segment_length: float,
    *,
    prominence: float,
    false_alarm_rate: float,
    is_geometric: bool = False,
    min_damping: float | None = None,
    finer: Densities | None = None,
    max_segments: int | None = None,
    band: tuple[float, float] = (0.0, math.inf),
) -> tuple[list[Line], Densities]:
    """Find the peaks of the averaged periodograms of half-overlapping Hann-windowed segments.

    Parameters
    ----------
    searched
        Samples.
    segment_length
        Length of a segment [s].
    prominence
        Smallest height over the median of bins 3 to 12 on either side [dB].
    false_alarm_rate
        Probability of any peak in noise with a smooth spectrum, which raises the smallest height where few segments are
        averaged.
    is_geometric
        Whether the logarithms of the powers are averaged, so that no single segment makes a line.
    min_damping
        Smallest damping ratio of a mode, less in long recordings (`narrowest_bandwidth`): a peak may also be a line
        because it is narrower than any mode (`chance_of_narrowness`); None: only because it is regular
        (`chance_of_regularity`).
    band
        Lowest and highest frequency of interest, in the recording's unit; further lines need not be found.
    finer
        Densities of longer segments. Where the powers of the narrowest mode are not independent from segment to
        segment, a peak may be regular or narrow only if it is wider than their resolution (`has_own_width`).
    max_segments
        Largest number of segments, a multiple of 6; None: all.

    Returns
    -------
    tuple
        Lines of each channel, and the averaged periodograms, 0 far from the band.
    """
    length = round(segment_length * searched.sampling_rate)
    starts = _starts(searched.stretches, length, max_segments)
    window = (0.5 - 0.5 * np.cos(2 * np.pi * np.arange(length) / length)).astype(np.float32)
    window *= np.sqrt(2 / (searched.sampling_rate * np.sum(window**2)))
    bin_width = searched.sampling_rate / length
    n_bins = length // 2 + 1
    n_channels, n_samples = searched.samples.shape
    duration = n_samples / searched.sampling_rate
    may_be_line = starts.size >= (SEARCH.min_segments if min_damping is None else 1)
    random = _random_height(starts.size, false_alarm_rate / (n_channels * n_bins), is_geometric)
    lines: list[Line] = []
    densities = np.zeros((n_channels, n_bins))
    first = min(max(0, int(band[0] / bin_width) - _BESIDE), n_bins)
    last = int(min(n_bins, band[1] / bin_width + _BESIDE))
    for row, samples in enumerate(searched.samples):
        segments = np.lib.stride_tricks.sliding_window_view(samples, length)[starts]
        segments *= window
        spectra = fft.rfft(segments, axis=1, overwrite_x=True)
        powers = spectra.real[:, first:last] ** 2 + spectra.imag[:, first:last] ** 2
        densities[row, first:last] = powers.mean(axis=0)
        density = densities[row]
        if is_geometric:
            density = np.zeros(n_bins)
            logarithms = np.log(np.maximum(powers.astype(np.float64), np.finfo(np.float64).tiny))
            density[first:last] = np.exp(np.mean(logarithms, axis=0))
        bins, heights = _peaks(density[first:last], max(prominence, random) if may_be_line else math.inf)
        for k, height in zip((bins + first).tolist(), heights.tolist(), strict=True):
            offset, level = _vertex(density[k - 1 : k + 2])
            line = Line(
                frequency=(k + offset) * bin_width,
                tolerance=bin_width / 2,
                resolution=SEARCH.noise_bandwidth * bin_width,
                prominence=height,
                rows=frozenset([row]),
                level=level,
            )
            if min_damping is None:
                chance = chance_of_regularity(powers[:, k - first].astype(np.float64))
            else:
                places = starts / length
                bandwidth = narrowest_bandwidth(line.frequency, min_damping, duration) / bin_width
                decay = np.pi * SEARCH.narrowest * bandwidth
                chance = chance_of_steadiness(spectra[:, k] * np.exp(-2j * np.pi * k * places), places, decay)
                if np.pi * bandwidth >= 2 * SEARCH.independence or (finer is not None and has_own_width(line, finer)):
                    narrowness = chance_of_narrowness(density, k, SEARCH.narrowest * bandwidth, starts.size)
                    narrowness *= n_channels * n_bins
                    chance = min(chance, chance_of_regularity(powers[:, k - first].astype(np.float64)), narrowness)
            lines.append(replace(line, chance=chance))
    return lines, Densities(densities, bin_width)


def narrowest_bandwidth(frequency: float, min_damping: float, duration: float) -> float:
    """Return the half-power bandwidth of the narrowest mode that a recording can distinguish from a line.

    Parameters
    ----------
    frequency, duration
        Frequency of the mode and duration of the recording, in reciprocal units.
    min_damping
        Smallest damping ratio of a mode in a short recording.
    """
    least = 2 * max(SEARCH.damping_in_time / duration, SEARCH.least_damping) * frequency
    return min(2 * min_damping * frequency, max(least, SEARCH.bandwidth_in_time / duration))


def _starts(stretches: Sequence[slice], length: int, most: int | None) -> Indices:
    """Return the first samples of half-overlapping segments, or of runs of them if there are more than the most."""
    step = max(1, round(length / 2))
    starts = np.concatenate([np.arange(part.start, part.stop - length + 1, step) for part in stretches])
    if most is None or starts.size <= most:
        return starts
    runs = np.linspace(0, starts.size - SEARCH.block, most // SEARCH.block).astype(np.intp)
    return np.asarray(starts[np.add.outer(runs, np.arange(SEARCH.block)).ravel()])


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
    if powers.size < SEARCH.min_segments or not powers.all():
        return 1.0
    n_blocks = max(1, powers.size // SEARCH.block)
    m = powers.size // n_blocks
    blocks = powers[: m * n_blocks].reshape(n_blocks, m)
    excess = m * np.sum(blocks**2, axis=1) / np.sum(blocks, axis=1) ** 2 - 1
    log_ball = (m - 1) / 2 * math.log(math.pi) - special.gammaln((m + 1) / 2)
    log_simplex = math.log(m) / 2 - special.gammaln(m)
    log_chance = log_ball - log_simplex + (m - 1) / 2 * np.log(np.maximum(excess, 1e-12) / m)
    chances = np.sort(np.exp(np.minimum(log_chance, 0.0)))
    return float(min(1.0, n_blocks * np.min(special.bdtrc(np.arange(n_blocks), n_blocks, chances))))


def chance_of_steadiness(spectra: Complex, starts: Real, decay: float) -> float:
    """Return the probability that a mode keeps its phase and amplitude as steadily.

    Parameters
    ----------
    spectra
        Spectra of segments in the bin of a peak, their phases those at a common time, shape (segments,).
    starts
        Times at which the segments start, over their length, shape (segments,).
    decay
        Decay constant xi omega of the narrowest possible mode, times the length of a segment.

    Returns
    -------
    float
        Upper bound of the probability; 1 for fewer than 5 segments or more than 30.

    Notes
    -----
    With u a unit vector of the phases of a steady sine, the share of the energy in it, |u* z|^2 / |z|^2, is 1 - r. The
    spectra z of a mode at that frequency are complex Gaussian with the covariance C of exp(-decay |t|) seen through
    Hann windows. The share is as large if z* ((1 - r) I - u u*) z <= 0. Of the eigenvalues of this form times C one is
    negative, -a, and the probability is the product of a / (a + b) over the others, b: exact, and r^(n - 1) for n
    independent segments. It is multiplied by the number of frequencies that are distinguished within the bin. Of modes
    with more damping, and of noise, the segments are less dependent.

    References
    ----------
    J. P. Imhof (1961), Computing the distribution of quadratic forms in normal variables, Biometrika 48, 419-426.

    Examples
    --------
    >>> import numpy as np
    >>> chance_of_steadiness(np.ones(6) + 0.1j * np.arange(6), np.arange(6.0), 100.0) < 1e-6
    True
    """
    n_segments, energy = spectra.size, float(np.sum(spectra.real**2 + spectra.imag**2))
    if not SEARCH.min_segments <= n_segments <= SEARCH.max_steady or energy <= 0:
        return 1.0
    span = float(starts[-1] - starts[0]) + 1
    n_frequencies = 2 * math.ceil(SEARCH.frequencies_in_bin * span) + 1
    phases = np.exp(-2j * np.pi * np.outer(np.linspace(-1, 1, n_frequencies), starts - starts[0]))
    share = float(np.max(np.abs(phases @ spectra) ** 2)) / (n_segments * energy)
    if share < SEARCH.min_steady:
        return 1.0
    rest = max(1 - share, 1e-9)
    u = np.full(n_segments, 1 / math.sqrt(n_segments))
    root = np.linalg.cholesky(_covariance_of_mode(starts, decay))
    form = root.T @ ((1 - rest) * np.eye(n_segments) - np.outer(u, u)) @ root
    eigenvalues = np.linalg.eigvalsh(form)
    negative, positive = -eigenvalues[0], eigenvalues[1:]
    log_chance = -float(np.sum(np.log1p(np.maximum(positive, 0) / max(negative, 1e-12))))
    return min(1.0, 2 * span * math.exp(log_chance))


def _covariance_of_mode(starts: Real, decay: float) -> Real:
    """Return the covariance of the spectra of segments of a mode, over that of one segment."""
    points = (np.arange(SEARCH.window_points) + 0.5) / SEARCH.window_points
    window = np.sin(np.pi * points) ** 2
    weights = np.convolve(window, window)
    shifts = np.arange(1 - SEARCH.window_points, SEARCH.window_points) / SEARCH.window_points
    lags, places = np.unique(np.round(np.abs(np.subtract.outer(starts, starts)), 6), return_inverse=True)
    values = np.exp(-decay * np.abs(np.add.outer(lags, shifts))) @ weights
    covariance = (values / values[0])[places].reshape(starts.size, starts.size)
    return np.asarray(covariance + 1e-9 * np.eye(starts.size))


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
    distance = np.arange(SEARCH.main_lobe + 1, SEARCH.neighbourhood + 1)
    bins = np.concatenate([peak - distance[distance < peak], peak + distance[peak + distance < density.size - 1]])
    weights = 1 + (2 * (bins - peak) / max(bandwidth, 1e-9)) ** 2
    floor = max(float(np.mean(weights * density[bins])), float(np.finfo(np.float64).tiny))
    n_independent = n_segments / (1 + (n_segments - 1) / n_segments / 18)
    freedom = 2 * n_independent
    return float(special.fdtrc(freedom, freedom * bins.size / SEARCH.bins_of_one, density[peak] / floor))


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
        if any(_is_same(line, other) and _is_part(line, other, SEARCH.max_loss) for other in drifting):
            continue
        sharp = _sharpest(line, peaks, SEARCH.max_loss)
        if sharp.resolution > finest * SEARCH.drifting:
            drifting.append(line)
            sharp = _sharpest(line, peaks, SEARCH.max_loss_of_band)
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


def has_own_width(line: Line, finer: Densities) -> bool:
    """Return whether a peak is wider than a finer resolution: its density then does not grow as that of a sine."""
    (row,) = line.rows
    reach = round(line.resolution / SEARCH.noise_bandwidth * SEARCH.main_lobe / finer.bin_width)
    k = round(line.frequency / finer.bin_width)
    peak = finer.densities[row, max(k - reach, 0) : k + reach + 1].max(initial=0.0)
    gain = line.resolution / (SEARCH.noise_bandwidth * finer.bin_width)
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
    for most, line, divisor in _max_multiples(lines):
        if best is not None and most <= len(best.members):
            break
        family = multiples(line.frequency / divisor, line.tolerance / divisor, lines)
        orders = [order for _, order in family.members]
        is_family = len(orders) >= 2 and (divisor == 1 or _has_parts(orders, divisor))
        if is_family and (best is None or len(orders) > len(best.members)):
            best = family
    return best


def _has_parts(orders: list[int], divisor: int) -> bool:
    """Return whether most multiples exist, and half of those that are not multiples of the undivided line, too."""
    n_parts = orders[-1] - orders[-1] // divisor
    return len(orders) > max(2, orders[-1] / 2) and 2 * sum(order % divisor > 0 for order in orders) >= n_parts


def _max_multiples(lines: Sequence[Line]) -> list[tuple[int, Line, int]]:
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


def _peaks(density: Real, least: float) -> tuple[Indices, Real]:
    """Return the highest bins of main lobes, and their height over the median of the higher neighbourhood [dB]."""
    margin = 2 * SEARCH.main_lobe + 1
    if density.size <= 2 * margin:
        return np.zeros(0, dtype=np.intp), np.zeros(0)
    at = density[margin:-margin]
    is_highest = at > 0
    for shift in range(1, SEARCH.main_lobe + 1):
        is_highest &= at >= density[margin - shift : density.size - margin - shift]
        is_highest &= at >= density[margin + shift : density.size - margin + shift]
    bins = np.flatnonzero(is_highest) + margin
    factor = 10 ** (least / 10)
    sides = np.arange(SEARCH.main_lobe + 1, SEARCH.neighbourhood + 1)
    floor = np.full(bins.size, np.finfo(np.float64).tiny)
    for sign in (1, -1):
        neighbours = density[np.clip(bins[:, None] + sign * sides, SEARCH.main_lobe, density.size - 2)]
        neighbours.partition((sides.size // 2 - 1, sides.size // 2), axis=1)
        floor = np.maximum(floor, neighbours[:, sides.size // 2 - 1 : sides.size // 2 + 1].mean(axis=1))
        is_high = density[bins] >= factor * floor
        bins, floor = bins[is_high], floor[is_high]
    return bins, 10 * np.log10(density[bins] / floor)


def _vertex(three: Real) -> tuple[float, float]:
    """Return place [bins] and level [dB] of the vertex of the parabola through the logarithms of a peak."""
    below, at, above = (math.log(max(value, np.finfo(np.float64).tiny)) for value in three.tolist())
    offset = (below - above) / (2 * (below - 2 * at + above)) if at > max(below, above) else 0.0
    return offset, 10 / math.log(10) * (at - (below - above) * offset / 4)


def _is_same(first: Line, second: Line) -> bool:
    """Return whether two peaks lie within a main lobe."""
    lobe = SEARCH.main_lobe / SEARCH.noise_bandwidth * max(first.resolution, second.resolution)
    return abs(first.frequency - second.frequency) <= lobe
