"""Harmonics, of constant frequency or proportional to speed: their search, and their subtraction from recordings."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from itertools import pairwise
from typing import Any, Literal

import numpy as np
from numpy.typing import ArrayLike
from scipy import fft, special

from sprung._arrays import Booleans, Complex, Real
from sprung._checks import check_number
from sprung.errors import DataError, ParameterError
from sprung.recording import Recording
from sprung.signals.conditioning import SLOWEST, moving_parts, over_distance, while_moving
from sprung.signals.narrow_lines import (
    SEARCH,
    Densities,
    Line,
    Searched,
    largest_family,
    merge_peaks,
    multiples,
    octaves,
    search_segments,
    searched,
    whole_lines,
)

#: Amplitudes for each length over which the amplitude of a line may change at the fastest.
_PER_LENGTH = 8
#: Zero padding for the exact frequency of a line.
_PADDING = 8
#: Shortest length over which the amplitude of a line is averaged where it comes or goes [s].
_SHORTEST = 2.0
#: Multiple of the median change of an amplitude from length to length that is no chance.
_CONTRADICTION = 5.0


@dataclass(frozen=True, slots=True)
class HarmonicSearch:
    """Settings of the search for harmonics."""

    max_segment: float = 256.0  # longest segment for lines of constant frequency [s]
    cycles: float = 150.0  # cycles of a speed-proportional line in a segment: 1 to 0.5 %, the accuracy of the speed
    # relative deviation of a speed-proportional line from a constant multiple of the measured speed
    slip: float = 0.004
    prominence: float = 6.0  # height of a line over the higher of the two neighbourhoods [dB]
    min_prominence: float = 4.0  # height of a multiple of a speed-proportional line [dB]
    # spread of speed (middle half over median) that separates lines proportional to it from constant ones
    min_spread: float = 0.03
    # largest distance of side lines and residues from a line that was subtracted, over its resolution
    residue: float = 5.0
    divisors: tuple[int, ...] = (1, 2, 3, 4)  # parts of a line's frequency that are tried as fundamental
    max_bases: int = 40  # lines tried as fundamental that are not regular themselves
    # further multiples that make a family of a line that is not regular: two light modes may be in any proportion
    min_doubtful: int = 3
    # lines of a family of constant frequency whose other multiples are subtracted too, seen or not
    large_family: int = 4
    max_damping: float = 0.05  # damping ratio of the pole of a line; poles with more belong to modes, even near a line


_HARMONICS = HarmonicSearch()


@dataclass(frozen=True, slots=True)
class Harmonic:
    """Line of the excitation, which is not a mode.

    Parameters
    ----------
    frequency
        Frequency [Hz], or spatial frequency [cycles/m] of a line proportional to speed.
    kind
        "constant", "drifting" (of constant frequency within a resolution that is far coarser than that of the
        recording, such as a line of an engine whose speed wanders) or "speed" (proportional to it).
    band
        Lowest and highest frequency of the line [Hz]: within its resolution, and over 5 to 95 % of the speeds.
    resolution
        Width within which `frequency` is known, in its unit.
    prominence
        Height over the neighbourhood in the channel where the line is most prominent [dB].
    channels
        Names of the channels that show the line.
    fundamental, order
        Fundamental (in the unit of `frequency`) and order of the multiple that the line is; None and 1 for a single
        line.
    """

    frequency: float
    kind: Literal["constant", "drifting", "speed"]
    band: tuple[float, float]
    resolution: float
    prominence: float
    channels: tuple[str, ...]
    fundamental: float | None = None
    order: int = 1


def harmonic_from_dict(document: Mapping[str, Any]) -> Harmonic:
    """Return the line from plain values, as `dataclasses.asdict` gives them and JSON or CBOR stores them."""
    return Harmonic(**{**document, "band": tuple(document["band"]), "channels": tuple(document["channels"])})


def find_harmonics(
    recording: Recording,
    *,
    speed: str | None = None,
    false_alarm_rate: float = 1e-3,
    min_damping: float = 0.005,
) -> tuple[Harmonic, ...]:
    """Find lines that are too narrow and too regular for modes.

    Parameters
    ----------
    recording
        Recording without missing values; channels of quantity "speed" are not searched.
    speed
        Name of the channel with the speed [m/s], for lines proportional to it; None: only lines of constant frequency.
    false_alarm_rate
        Probability of reporting any harmonic in a recording of random vibration, above 0 and at most 0.5.
    min_damping
        Smallest damping ratio of a mode, above 0 and at most 1; longer recordings separate smaller ones (see Notes).

    Returns
    -------
    tuple of Harmonic
        Lines of constant frequency, then lines proportional to speed, each by rising frequency.

    Raises
    ------
    DataError
        If a channel has missing values, or there is no channel to search.
    ParameterError
        If an option is out of range, or the speed channel does not exist.

    Notes
    -----
    *Constant frequency.* Averaged periodograms with segments of 2/7 of the recording (at most 256 s) and shorter ones
    in octaves. A line must (a) exceed the bins 3 to 12 on each side of it at the resolution of the segments, and (b) be
    regular: its power is nearly equal in consecutive segments (`sprung.signals.narrow_lines.chance_of_regularity`), or
    narrower than any mode at the resolution of the whole recording
    (`sprung.signals.narrow_lines.chance_of_narrowness`), or it keeps its phase and amplitude more steadily than any
    mode (`sprung.signals.narrow_lines.chance_of_steadiness`). Of more than 192 segments, runs of six spread over the
    recording stand for all. The probability of any line in a recording of random vibration is at most
    `false_alarm_rate` (Holm's method over all peaks).
    The narrowest mode is one of `min_damping`; the longer the recording of T seconds, the narrower: of a damping ratio
    of 1 / T (but 0.03 % or more), or of a half-power bandwidth of 8 / T, if that is more. Such a mode differs from a
    line by many independent values of its amplitude and phase. Its segments are independent only if they lie about a
    time constant 1 / (xi omega) apart, which sets the lowest frequency at which the power alone separates a tone from a
    mode: 2.8 Hz for 60 s and 0.5 %; below it a line has to be steady, or wider than the resolution of longer
    segments, as that of an engine whose speed wanders: then it is regular though its own width makes the powers of
    random vibration independent. Narrow peaks that are not regular count if more of them lie at multiples of a
    line, or of a half, third or fourth of one, than chance explains.

    A line is *constant* at the finest resolution that holds most of its energy, and *drifting* if that is far coarser
    than the recording's, or if half of its family or the highest order of it drifts.

    *Proportional to speed.* The same search over distance with segments of 150 to 300 cycles, by the geometric mean
    of the segments. Such lines change level with speed, so (b) is replaced: in no channel that shows it may a line
    over time, at the frequencies of the middle half of the speeds, be more prominent. If that half spreads over
    less than 3 % of the median speed the two cannot be separated, and no line is called proportional to speed.
    Multiples of such a line need only 4 dB.

    References
    ----------
    J. Antoni (2006), The spectral kurtosis: a useful tool for characterising non-stationary signals, Mechanical Systems
    and Signal Processing 20, 282-307.

    S. Holm (1979), A simple sequentially rejective multiple test procedure, Scandinavian Journal of Statistics 6,
    65-70.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> t = np.arange(12_000) / 200
    >>> noise = np.random.default_rng(1).standard_normal(t.size)
    >>> recording = Recording((noise + np.sin(2 * np.pi * 17 * t))[None], 200.0, (Channel("a"),))
    >>> [round(line.frequency, 1) for line in find_harmonics(recording)]
    [17.0]
    """
    check_number("false_alarm_rate", false_alarm_rate, above=0, at_most=0.5)
    check_number("min_damping", min_damping, above=0, at_most=1)
    names = [channel.name for channel in recording.channels if channel.quantity != "speed" and channel.name != speed]
    if not names:
        raise DataError("the recording has no channel besides the speed: there is nothing to search")
    lines = _constant_lines(recording.select(names), false_alarm_rate, min_damping)
    finest = SEARCH.noise_bandwidth / min(_longest_stretch(recording), _HARMONICS.max_segment)
    constant = _as_harmonics(lines, names, "constant", (1.0, 1.0))
    constant = _drifting_together(
        [replace(line, kind="drifting") if line.resolution > SEARCH.drifting * finest else line for line in constant]
    )
    speeds = _speeds(recording, speed)
    if speed is None or speeds is None:
        return constant
    slow, low, middle, high, fast = speeds
    if high - low < _HARMONICS.min_spread * middle:
        return constant
    moving = while_moving(recording, speed)
    along = over_distance(moving, speed, interval=middle / recording.sampling_rate, channels=names)
    lines = _speed_lines(along, moving.select(names), (low, middle, high), false_alarm_rate)
    following = _as_harmonics(lines, names, "speed", (slow, fast))

    def is_swept(line: Harmonic) -> bool:
        return line.kind == "drifting" and any(
            other.band[0] - line.resolution <= line.frequency <= other.band[1] + line.resolution for other in following
        )

    return tuple(line for line in constant if not is_swept(line)) + following


def with_present_bands(lines: Sequence[Harmonic], recording: Recording, *, speed: str | None) -> tuple[Harmonic, ...]:
    """Return known lines with those proportional to speed in the bands that they sweep in a recording.

    Parameters
    ----------
    lines
        Lines, such as those of an earlier recording of the vehicle.
    recording
        Recording with the speed.
    speed
        Name of the channel with the speed [m/s]; None, or a recording at rest: bands stay as they are.

    Raises
    ------
    ParameterError
        If the speed channel does not exist.
    """
    speeds = _speeds(recording, speed)
    if speeds is None:
        return tuple(lines)
    slow, *_, fast = speeds
    return tuple(replace(line, band=_band(line, (slow, fast))) if line.kind == "speed" else line for line in lines)


def _speeds(recording: Recording, speed: str | None) -> tuple[float, ...] | None:
    """Return quantiles of the speed while the vehicle moves (5, 25, 50, 75, 95 %); None without speed or at rest."""
    parts = [] if speed is None else moving_parts(recording, speed, minimum_speed=SLOWEST)
    if speed is None or not parts:
        return None
    v = recording.samples[recording.index(speed)]
    return tuple(map(float, np.quantile(np.concatenate([v[part] for part in parts]), (0.05, 0.25, 0.5, 0.75, 0.95))))


def _band(line: Line | Harmonic, speeds: tuple[float, float]) -> tuple[float, float]:
    """Return the frequencies [Hz] that a line sweeps between two speeds."""
    half = line.resolution / 2
    return (line.frequency - half) * speeds[0], (line.frequency + half) * speeds[1]


def near_harmonic(
    natural_frequency: ArrayLike,
    damping_ratio: ArrayLike,
    harmonics: Sequence[Harmonic],
    *,
    resolution: float,
    is_subtracted: bool = False,
) -> Booleans:
    """Return which poles are harmonics rather than modes.

    Parameters
    ----------
    natural_frequency, damping_ratio
        Natural frequencies [Hz] and damping ratios of the poles, any shape.
    harmonics
        Harmonics from `find_harmonics`.
    resolution
        Frequency resolution of the identification [Hz], above 0, such as half the reciprocal of its longest lag: the
        largest deviation and the largest half-power bandwidth of the pole of a line.
    is_subtracted
        Whether lines of constant frequency were subtracted before the identification. Their own resolution then stands
        for `resolution`: only a residue is left of them, and the poles next to them are those of modes.

    Returns
    -------
    ndarray of bool
        True for a pole within `resolution` of a line's band whose damping ratio is at most 5 % and, for a line of
        constant frequency, whose half-power bandwidth 2 xi f is at most `resolution` (of a drifting one: or the
        line's own resolution, if that is larger). The pole of a heavily damped mode near a line, or in the band swept
        by a line proportional to speed, is wider, and False.

    Raises
    ------
    ParameterError
        If frequencies and damping ratios differ in shape, or `resolution` is not above 0.
    """
    check_number("resolution", resolution, above=0)
    f, xi = np.asarray(natural_frequency, dtype=np.float64), np.asarray(damping_ratio, dtype=np.float64)
    if f.shape != xi.shape:
        raise ParameterError(f"{f.shape} natural frequencies need as many damping ratios, but there are {xi.shape}")
    is_near = np.zeros(f.shape, dtype=np.bool_)
    for harmonic in (*harmonics, *missing_multiples(harmonics)):
        is_left = harmonic.kind != "constant" or not is_subtracted
        reach = resolution if is_left else harmonic.resolution
        width = max(reach, harmonic.resolution) if harmonic.kind == "drifting" else reach
        is_narrow = (harmonic.kind == "speed") | (2 * xi * f <= width)
        low, high = harmonic.band
        # Frequencies of the residue of a line scatter more than the line: where it starts and stops it has many.
        reach = reach if is_left else _HARMONICS.residue * reach
        is_near |= is_narrow & (low - reach <= f) & (f <= high + reach)
    return is_near & (xi <= _HARMONICS.max_damping)


def at_part_of_line(natural_frequency: Real, reach: Real, harmonics: Sequence[Harmonic]) -> Booleans:
    """Return which frequencies are within reach (both in Hz) of a half or third of a line.

    The fundamental of an engine may be weaker than its multiples, of which alone the search then finds a family.
    """
    lines = [line.fundamental or line.frequency for line in harmonics if line.kind != "speed"]
    parts = np.array([line / part for line in lines for part in (2, 3)])
    return np.any(np.abs(parts[:, None] - natural_frequency) < reach, axis=0)


def missing_multiples(harmonics: Sequence[Harmonic]) -> tuple[Harmonic, ...]:
    """Return the multiples of families that the search did not find, up to the highest that it found.

    Parameters
    ----------
    harmonics
        Harmonics from `find_harmonics`.

    Returns
    -------
    tuple of Harmonic
        Lines of prominence 0 at all other orders of drifting families and of families with four or more constant lines.

    Notes
    -----
    Where a fundamental is known, its next multiple may hide in the neighbourhood of a mode. Subtracting a sine that is
    absent hardly affects a mode.
    """
    missing = []
    for family in _families(harmonics):
        first = max(family, key=lambda line: line.resolution / line.order)
        if first.fundamental is None or (first.kind == "constant" and len(family) < _HARMONICS.large_family):
            continue
        orders = {line.order for line in family}
        for order in set(range(1, max(orders))) - orders:
            frequency = order * first.fundamental
            resolution = first.resolution * (order / first.order if first.kind == "drifting" else 1.0)
            band = (frequency - resolution / 2, frequency + resolution / 2)
            missing.append(
                replace(first, frequency=frequency, band=band, resolution=resolution, prominence=0.0, order=order)
            )
    return tuple(missing)


def in_families(harmonics: Sequence[Harmonic]) -> tuple[Harmonic, ...]:
    """Return lines from several recordings with the fundamentals and orders that they have together.

    Parameters
    ----------
    harmonics
        Lines of any kinds, each kind by rising frequency; lines in families of several recordings differ in the last
        digits of their fundamentals.

    Returns
    -------
    tuple of Harmonic
        The same lines.
    """
    together = list(harmonics)
    for is_speed in (False, True):
        rows = [row for row, line in enumerate(harmonics) if (line.kind == "speed") == is_speed]
        rows.sort(key=lambda row: harmonics[row].frequency)
        families = _family_of_each([_as_line(harmonics[row]) for row in rows])
        for i, row in enumerate(rows):
            fundamental, order = families.get(i, (None, 1))
            together[row] = replace(harmonics[row], fundamental=fundamental, order=order)
    return tuple(together)


def without_side_lines(harmonics: Sequence[Harmonic]) -> tuple[Harmonic, ...]:
    """Return lines without the weaker ones next to a multiple of a large family of constant frequency.

    Parameters
    ----------
    harmonics
        Lines.

    Notes
    -----
    Pulses that fall on the nearest sample come too early and too late in turn, which modulates the phase of their
    multiples: each has side lines, at the distance of the beat of pulses and samples, that grow with the order.
    """
    large = [line for family in _families(harmonics) if len(family) >= _HARMONICS.large_family for line in family]
    carriers = [line for line in large if line.kind == "constant"]

    def is_side_line(line: Harmonic) -> bool:
        return line.kind == "constant" and any(
            line.fundamental != carrier.fundamental
            and line.prominence < carrier.prominence
            and abs(line.frequency - carrier.frequency) <= _HARMONICS.residue * carrier.resolution
            for carrier in carriers
        )

    return tuple(line for line in harmonics if not is_side_line(line))


def _as_line(harmonic: Harmonic) -> Line:
    """Return a harmonic as a line, for its family."""
    slip = _HARMONICS.slip * harmonic.frequency if harmonic.kind == "speed" else 0.0
    tolerance = max(harmonic.resolution / (2 * SEARCH.noise_bandwidth), slip)
    return Line(harmonic.frequency, tolerance, harmonic.resolution, harmonic.prominence, frozenset())


def _families(harmonics: Sequence[Harmonic]) -> list[list[Harmonic]]:
    """Return the lines over time in their families; single lines are left out."""
    families: dict[float, list[Harmonic]] = {}
    for line in harmonics:
        if line.fundamental is not None and line.kind != "speed":
            families.setdefault(line.fundamental, []).append(line)
    return list(families.values())


def _drifting_together(harmonics: Sequence[Harmonic]) -> tuple[Harmonic, ...]:
    """Let all lines of a family drift in proportion to their orders if half of them or the highest do."""
    drifting: dict[float, float] = {}
    for family in _families(harmonics):
        widths = [line.resolution / line.order for line in family if line.kind == "drifting"]
        is_highest = max(family, key=lambda line: line.order).kind == "drifting"
        if family[0].fundamental is not None and (is_highest or 2 * len(widths) >= len(family)):
            drifting[family[0].fundamental] = min(widths)
    lines = []
    for line in harmonics:
        if line.fundamental in drifting:
            half = max(line.resolution, line.order * drifting[line.fundamental]) / 2
            band = (line.frequency - half, line.frequency + half)
            lines.append(replace(line, kind="drifting", band=band, resolution=2 * half))
        else:
            lines.append(line)
    return tuple(lines)


def _longest_stretch(recording: Recording) -> float:
    """Return the length of the longest stretch without a gap, in the reciprocal unit of the sampling rate."""
    return float(max(stretch.stop - stretch.start for stretch in recording.stretches()) / recording.sampling_rate)


def _constant_lines(recording: Recording, false_alarm_rate: float, min_damping: float) -> list[Line]:
    """Return regular lines, and narrow lines at their multiples."""
    longest = _longest_stretch(recording)
    peaks: list[Line] = []
    whole = octaves(min(longest, _HARMONICS.max_segment), recording)[:1]
    levels: list[Densities] = []
    samples = searched(recording)
    for segment_length in whole + octaves(min(recording.duration / 3.5, longest, _HARMONICS.max_segment), recording):
        narrow, densities = search_segments(
            samples,
            segment_length,
            prominence=_HARMONICS.prominence,
            false_alarm_rate=false_alarm_rate,
            min_damping=min_damping,
            finer=levels[-2] if len(levels) > 2 else None,
            max_segments=SEARCH.max_segments,
        )
        levels.append(densities)
        peaks += narrow
    if not peaks:
        return []
    peaks.sort(key=lambda peak: peak.chance)
    # Holm's method: the k-th smallest of M chances may be as large as the rate / (M - k).
    tests = (peak.chance * (len(peaks) - k) > false_alarm_rate for k, peak in enumerate(peaks))
    n_regular = next((k for k, fails in enumerate(tests) if fails), len(peaks))
    regular = merge_peaks(whole_lines(peaks[:n_regular], peaks))
    doubtful = merge_peaks(peaks[n_regular:], known=regular)
    return _with_multiples(regular, doubtful, false_alarm_rate)


def _with_multiples(regular: list[Line], doubtful: list[Line], false_alarm_rate: float) -> list[Line]:
    """Add doubtful lines at multiples of a line, or of a part of one, if there are more than chance explains."""
    lines, left = list(regular), list(doubtful)
    finest = min((line.resolution for line in [*regular, *doubtful]), default=0.0)
    bases = [
        (base, divisor) for base in [*regular, *doubtful[: _HARMONICS.max_bases]] for divisor in _HARMONICS.divisors
    ]
    for base, divisor in bases:
        family = multiples(base.frequency / divisor, base.tolerance / divisor, left)
        widest = max(base.resolution, SEARCH.drifting * finest)
        if base.resolution > SEARCH.drifting * finest:
            widest *= max(order for _, order in family.members) if family.members else 1
        members = [(i, order) for i, order in family.members if left[i] is not base and left[i].resolution <= widest]
        is_known = divisor == 1 and base in regular
        if len(members) < (1 if base in regular else _HARMONICS.min_doubtful):
            continue
        width = 2 * max(left[i].tolerance + order * family.tolerance for i, order in members)
        coincidence = special.bdtrc(len(members) - 1, len(left), min(1.0, width * divisor / base.frequency))
        if base in regular:
            coincidence *= min(left[i].chance for i, _ in members)
        if coincidence * (1 if is_known else len(bases)) < false_alarm_rate:
            taken = {i for i, _ in members} | {i for i, line in enumerate(left) if line is base}
            lines += [left[i] for i in taken]
            left = [line for i, line in enumerate(left) if i not in taken]
    return sorted(lines, key=lambda line: line.frequency)


def _speed_lines(
    along: Recording, moving: Recording, speeds: tuple[float, float, float], false_alarm_rate: float
) -> list[Line]:
    """Return lines over distance that exceed every line over time at the frequencies of these quartiles of speed."""
    peaks: list[Line] = []
    longest = _longest_stretch(along)
    samples, over_time = searched(along), searched(moving)
    for metres in octaves(min(along.duration / 3.5, longest), along):
        narrow, _ = search_segments(
            samples,
            segment_length=metres,
            prominence=_HARMONICS.min_prominence,
            false_alarm_rate=false_alarm_rate,
            is_geometric=True,
            band=(_HARMONICS.cycles / metres, 2 * _HARMONICS.cycles / metres),
        )
        in_range = [peak for peak in narrow if _HARMONICS.cycles <= peak.frequency * metres < 2 * _HARMONICS.cycles]
        peaks += _unexplained(in_range, over_time, metres / speeds[1], speeds) if in_range else []
    lines = merge_peaks(peak for peak in peaks if peak.prominence >= _HARMONICS.prominence)
    faint = merge_peaks((peak for peak in peaks if peak.prominence < _HARMONICS.prominence), known=lines)
    families = [multiples(line.frequency, line.tolerance, faint) for line in lines]
    added = {i for family in families for i, order in family.members if order > 1}
    return sorted([*lines, *(faint[i] for i in added)], key=lambda line: line.frequency)


def _unexplained(
    peaks: list[Line], over_time: Searched, segment_length: float, speeds: tuple[float, float, float]
) -> list[Line]:
    """Return the peaks over distance that no line over time in the same channels explains."""
    longest = max(part.stop - part.start for part in over_time.stretches) / over_time.sampling_rate
    segment_length = min(segment_length, longest)
    reach = (SEARCH.noise_bandwidth + 1) / segment_length
    slow, fast = min(peak.frequency for peak in peaks) * speeds[0], max(peak.frequency for peak in peaks) * speeds[2]
    rivals, _ = search_segments(
        over_time,
        segment_length=segment_length,
        prominence=min(peak.prominence for peak in peaks),
        false_alarm_rate=1.0 / 2,
        is_geometric=True,
        band=(slow - reach, fast + reach),
    )

    def is_explained(peak: Line) -> bool:
        """Whether a line over time is as prominent, at a frequency of that peak."""
        low, high = peak.frequency * speeds[0], peak.frequency * speeds[2]
        return any(
            peak.rows == rival.rows
            and rival.prominence >= peak.prominence
            and low - rival.resolution <= rival.frequency <= high + rival.resolution
            for rival in rivals
        )

    return [
        replace(peak, tolerance=max(peak.tolerance, _HARMONICS.slip * peak.frequency))
        for peak in peaks
        if not is_explained(peak)
    ]


def _as_harmonics(
    lines: list[Line], names: Sequence[str], kind: Literal["constant", "speed"], speeds: tuple[float, float]
) -> tuple[Harmonic, ...]:
    families = _family_of_each(lines)
    harmonics = []
    for i, line in enumerate(lines):
        fundamental, order = families.get(i, (None, 1))
        band = _band(line, speeds)
        shown = tuple(names[row] for row in sorted(line.rows))
        harmonics.append(
            Harmonic(line.frequency, kind, band, line.resolution, line.prominence, shown, fundamental, order)
        )
    return tuple(harmonics)


def _family_of_each(lines: Sequence[Line]) -> dict[int, tuple[float, int]]:
    """Return fundamental and order of the lines that belong to a family, by their index."""
    families: dict[int, tuple[float, int]] = {}
    left = list(range(len(lines)))
    while family := largest_family([lines[i] for i in left]):
        families |= {left[i]: (family.fundamental, order) for i, order in family.members}
        left = [i for i in left if i not in families]
    return families


def subtract_lines(recording: Recording, harmonics: Sequence[Harmonic], *, is_steady: bool = False) -> Recording:
    """Subtract lines of constant frequency: a sine of slowly varying amplitude and phase in each channel.

    Parameters
    ----------
    recording
        Recording without missing values, at any sampling rate.
    harmonics
        Lines; those that drift or are proportional to speed, and those above half the sampling rate, are left in. Of
        large families all multiples are subtracted (`harmonics.missing_multiples`).
    is_steady
        Whether the amplitudes are constant: each is the median over 8 s, which motion that dies away hardly changes.

    Returns
    -------
    Recording
        Recording without the lines.

    Notes
    -----
    In every stretch the line is the local mean of 2 y(t) exp(-2 pi i f t) over a length D (weighted with a Hann
    window), at the frequency f at which the channels together have most power within the resolution of the line. D is
    at each time the longest of the whole stretch, a half, a quarter ... of it down to 2 s that no shorter length
    contradicts by more than chance (Lepski's method): a steady sine is fitted over the whole stretch, one that starts
    in it over what there is of it. What is removed with the line is the motion within about 1 / D: of the energy of a
    mode at the line's frequency the share 2 / (pi D b) with b its half-power bandwidth, of one that lies away from the
    line by several b next to nothing.

    References
    ----------
    O. V. Lepski (1991), On a problem of adaptive estimation in Gaussian white noise, Theory of Probability and its
    Applications 35, 454-466.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> sine = Recording(np.sin(2 * np.pi * 17.003 * np.arange(12_000) / 200)[None], 200.0, (Channel("a"),))
    >>> line = Harmonic(17.0, "constant", (16.98, 17.02), 0.04, 20.0, ("a",))
    >>> bool(subtract_lines(sine, [line]).samples.std() < 0.01)
    True
    """
    rate = recording.sampling_rate
    every = (*harmonics, *missing_multiples(harmonics))
    lines = [line for line in every if line.kind == "constant" and line.frequency < rate / 2]
    if not lines:
        return recording
    samples = np.array(recording.samples)
    for stretch in recording.stretches():
        motion = samples[:, stretch]
        # The strongest line first: its side lobes reach furthest.
        for line in sorted(lines, key=lambda line: -line.prominence):
            motion -= _sine(motion, line.frequency / rate, line.resolution / rate, _SHORTEST * rate, is_steady)
    listed = ", ".join(f"{line.frequency:.4g}" for line in lines[:10]) + (", ..." if len(lines) > 10 else "")
    return recording.changed(f"lines at {listed} Hz subtracted", samples=samples)


def _sine(motion: Real, frequency: float, resolution: float, shortest: float, is_steady: bool) -> Real:
    """Return the line of a frequency [1/sample] in samples, shape (channels, samples)."""
    n_samples = motion.shape[1]
    step = max(1, int(min(shortest, n_samples) / _PER_LENGTH))
    n_blocks = n_samples // step
    if n_blocks < 2:
        return np.zeros_like(motion)
    times = np.arange(n_samples)
    envelope = _block_means(motion * _phasor(-frequency, n_samples), step, n_blocks)
    offset = _offset(envelope, resolution * step)
    envelope *= np.exp(-2j * np.pi * offset * np.arange(n_blocks))
    frequency += offset / step
    amplitudes = _medians(envelope) if is_steady else _smooth(envelope, shortest / step)
    centres = (np.arange(n_blocks) + 0.5) * step - 0.5
    carrier = 2 * np.exp(-2j * np.pi * offset / step * centres[0]) * _phasor(frequency, n_samples)
    following = np.array([np.interp(times, centres, row) for row in amplitudes])
    return np.real(following * carrier)


def _phasor(frequency: float, n_samples: int) -> Complex:
    """Return exp(2 pi i f k) of a frequency [1/sample] at samples 0, 1 ..., from that of far fewer angles."""
    side = math.ceil(math.sqrt(n_samples))
    turns = 2j * np.pi * frequency * np.arange(side)
    return np.asarray(np.outer(np.exp(side * turns), np.exp(turns)).ravel()[:n_samples])


def _block_means(samples: Complex, step: int, n_blocks: int) -> Complex:
    """Return means of consecutive blocks, the last of which takes in the rest."""
    starts = np.arange(n_blocks) * step
    sizes = np.append(np.full(n_blocks - 1, step), samples.shape[1] - starts[-1])
    return np.add.reduceat(samples, starts, axis=1) / sizes


def _offset(envelope: Complex, reach: float) -> float:
    """Return the frequency of most power in all channels within `reach` of 0 [1/block]."""
    n_fft = int(fft.next_fast_len(_PADDING * envelope.shape[1]))
    window = np.sin(np.pi * (np.arange(envelope.shape[1]) + 0.5) / envelope.shape[1]) ** 2
    power = np.sum(np.abs(fft.fft(envelope * window, n_fft)) ** 2, axis=0)
    frequencies = fft.fftfreq(n_fft)
    power = np.where(np.abs(frequencies) <= max(reach, 1.5 / envelope.shape[1]), power, 0)
    k = int(np.argmax(power))
    below, at, above = np.log(np.maximum(power[[k - 1, k, (k + 1) % n_fft]], np.finfo(float).tiny))
    curvature = below - 2 * at + above
    vertex = (below - above) / (2 * curvature) if curvature < 0 else 0.0
    return float(frequencies[k] + np.clip(vertex, -0.5, 0.5) / n_fft)


def _medians(envelope: Complex) -> Complex:
    """Return medians over four of the shortest lengths, one for each of these lengths."""
    n_blocks = envelope.shape[1]
    length = min(4 * _PER_LENGTH, n_blocks)
    first = np.clip(np.arange(0, n_blocks, _PER_LENGTH) + (_PER_LENGTH - length) // 2, 0, n_blocks - length)
    around = envelope[:, first[:, None] + np.arange(length)]
    medians = np.median(around.real, axis=2) + 1j * np.median(around.imag, axis=2)
    return np.repeat(medians, _PER_LENGTH, axis=1)[:, :n_blocks]


def _smooth(envelope: Complex, shortest: float) -> Complex:
    """Return at each time the mean over the longest length that no shorter one contradicts."""
    n_blocks = envelope.shape[1]
    means = [np.broadcast_to(envelope.mean(axis=1, keepdims=True), envelope.shape)]
    length = n_blocks / 2
    while length >= max(shortest, 2.0):
        transformed, sums = _hann(n_blocks, int(length))
        means.append(_convolved(envelope, transformed, int(length)) / sums)
        length /= 2
    chosen = means[-1].copy()
    is_valid = np.ones(n_blocks, dtype=np.bool_)
    # Half of the time or more the line is taken to be steady, so that the median change between lengths is noise.
    noise = [np.median(np.abs(b - a), axis=1, keepdims=True) for a, b in pairwise(means)]
    for k in range(len(means) - 2, -1, -1):
        for j in range(k + 1, len(means)):
            is_valid &= np.all(np.abs(means[k] - means[j]) <= _CONTRADICTION * noise[j - 1], axis=0)
        chosen[:, is_valid] = means[k][:, is_valid]
    return chosen


@lru_cache(maxsize=32)
def _hann(n_blocks: int, half: int) -> tuple[Complex, Real]:
    """Return the transform of a Hann window of 2 `half` blocks, and its sums over what there is of `n_blocks`."""
    window = np.sin(np.pi * np.arange(1, 2 * half) / (2 * half)) ** 2
    transformed = fft.fft(window, int(fft.next_fast_len(n_blocks + window.size - 1)))
    return transformed, _convolved(np.ones((1, n_blocks)), transformed, half).real


def _convolved(rows: Complex | Real, transformed: Complex, half: int) -> Complex:
    """Return the convolution of rows with a window of 2 `half` - 1 values, as long as the rows."""
    full = fft.ifft(fft.fft(rows, transformed.size) * transformed)
    return full[:, half - 1 : half - 1 + rows.shape[1]]
