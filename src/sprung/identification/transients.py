"""Pushes, drops and releases in a recording, and from where on their motion is free."""

from collections.abc import Iterable
from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_type
from sprung._threads import one_thread
from sprung.identification.free_response import unexplained
from sprung.recording import Recording


@dataclass(frozen=True, slots=True)
class _TransientRules:
    """What counts as motion that dies away."""

    #: Bounds of the frequency of the swings [Hz] that sets the windows of the level.
    swings: tuple[float, float] = (0.4, 30.0)
    #: Samples at either end through whose means a line is subtracted: a step between the ends is no swing.
    ends: int = 8
    #: Power over its median from which a line is motion: one line of noise in a million is.
    beyond_median: float = 20.0
    #: Level at which a motion begins and ends, over the largest level, and over that of the quiet parts.
    edge: float = 0.06
    edge_over_quiet: float = 3.0
    #: Smallest peak of a motion over the largest.
    min_peak: float = 0.4
    #: Smallest fall of the level from the peak to the end.
    min_fall: float = 3.0
    #: The same where the end is at the edge.
    min_fall_to_edge: float = 2.0
    #: Shortest free motion, in windows of the level.
    min_windows: float = 1.2
    #: Rise of the level over its minimum since the peak before from which another motion begins.
    rise: float = 3.0
    #: Level below which a record is quiet, over its peak, and least share of such samples of a record of free motion.
    quiet: float = 0.08
    min_quiet: float = 0.4
    #: Level below which it is as quiet as its sensors, over that of its quietest tenth.
    over_floor: float = 1.25
    #: Windows on either side of the quietest sample in which that tenth is of sensors, and largest power density there
    #: at the frequencies of the swings over the median of those above.
    at_rest: float = 2.0
    white: float = 20.0
    #: Least share of a record of free motion that is free: one pothole of a drive is no push.
    min_share: float = 0.02
    #: Fall of the level, from the first sixth to the last, of a record that is one decay.
    fall_of_record: float = 5.0
    #: Lower quartile of the amplitudes of a line in parts of a record, over their median and that of the whole record,
    #: from which it is hum; most parts, and least periods in each.
    steady: float = 0.8
    parts: int = 24
    periods: float = 2.0
    #: Least power of hum over the mean on either side of it, and number of values of the spectrum in each mean.
    over_sides: float = 30.0
    beside: int = 8
    #: Most motions in a record of free motion, and most windows of each that are fitted.
    max_motions: int = 20
    max_windows: float = 60.0
    #: Windows of rest that are fitted after the end of a motion.
    rest: int = 1
    #: Starts of free motion that are tried, from a window before the peak of the level to two after it.
    n_starts: int = 10
    #: Windows on either side of the quietest sample, from which the noise is taken: one alone is quiet by chance.
    around_quietest: int = 1
    #: Frequencies that are fitted, over that of the windows, and most modes.
    reach: float = 8.0
    max_modes: int = 4
    #: RMS of the residuals of the first free motion over the smallest of later starts.
    beyond_least: float = 1.2
    #: The same, in shares of the motion's own RMS, for motion with friction or progressive springs.
    beyond_motion: float = 0.004


_EVENTS = _TransientRules()


@dataclass(frozen=True, slots=True)
class Transient:
    """Motion after a push, drop or release that dies away.

    Parameters
    ----------
    onset
        Time at which the motion begins [s] after the first sample of the recording.
    begin, end
        Times between which it is free [s].
    window
        Length of the windows of the level [s], about one period.
    unexplained
        RMS of what free modes leave of it from a quarter of a window after its peak, over that of the motion.
    noise
        RMS in the band that is fitted, where the recording is quietest, over that of the motion.
    """

    onset: float
    begin: float
    end: float
    window: float
    unexplained: float
    noise: float


def motion_level(recording: Recording) -> tuple[Real, float]:
    """Return the level of the motion over time, 1 at its largest, and the length of its windows [s].

    Returns
    -------
    ndarray, float
        Standard deviation within a window of about one period around each sample, root mean square over the channels
        that move beyond their noise, each over its own largest; shape (samples,).

    Notes
    -----
    The period is that of the mean frequency of the slopes, in which steps of travel count little, by the lines whose
    power stands above the noise: the slopes of the noise alone would halve it.
    """
    samples, rate = np.nan_to_num(recording.samples), recording.sampling_rate
    begin, end = (part.mean(axis=1) for part in (samples[:, : _EVENTS.ends], samples[:, -_EVENTS.ends :]))
    powers = np.abs(np.fft.rfft(samples - np.linspace(begin, end, samples.shape[1], axis=1), axis=1)) ** 2
    frequencies = np.fft.rfftfreq(samples.shape[1], 1 / rate)
    used = (frequencies >= _EVENTS.swings[0]) & (frequencies <= min(_EVENTS.swings[1], 0.4 * rate))
    used = used if used.any() else frequencies > 0  # a clock that is wrong
    powers, frequencies = powers[:, used], frequencies[used]
    slopes = powers * np.sin(np.pi * frequencies / rate) ** 2
    slopes = slopes * (powers > _EVENTS.beyond_median * np.median(powers, axis=1, keepdims=True))
    spectrum = np.mean(slopes / np.maximum(slopes.sum(axis=1, keepdims=True), 1e-300), axis=0)
    centre = float(np.sum(spectrum * frequencies) / max(spectrum.sum(), 1e-300)) or _EVENTS.swings[0]
    n = int(np.clip(rate / centre, 8, max(8, samples.shape[1] // 4)))
    centred = samples - np.median(samples, axis=1, keepdims=True)
    means, squares = (_running_mean(values, n) for values in (centred, centred**2))
    deviations = np.sqrt(np.maximum(squares - means**2, 0.0))
    largest = np.maximum(deviations.max(axis=1, keepdims=True), 1e-300)
    moves = largest[:, 0] > _EVENTS.min_fall * np.quantile(deviations, 0.1, axis=1)
    level = np.sqrt(np.mean((deviations / largest)[moves if moves.any() else slice(None)] ** 2, axis=0))
    return np.asarray(level / max(level.max(), 1e-300)), n / rate


def _running_mean(values: Real, n: int) -> Real:
    """Return the mean of n values around each one; the first and the last are continued, shape of the values."""
    around = np.pad(values, ((0, 0), (n // 2 + 1, n - 1 - n // 2)), mode="edge")
    sums = np.cumsum(around, axis=1)
    return np.asarray((sums[:, n:] - sums[:, :-n]) / n)


@one_thread
def find_transients(recording: Recording) -> tuple[Transient, ...]:
    """Return the motions of a recording that begin suddenly and die away, with the parts in which they are free.

    Parameters
    ----------
    recording
        Channels of motion, without missing values or gaps.

    Returns
    -------
    tuple of Transient
        By time; none where the motion never falls to a fraction of its peak.

    Notes
    -----
    A motion is a part above the edge of the level whose peak is not far below the largest one. It is free from the
    first start on from which modes leave hardly more than they leave of a later one (`unexplained`).
    """
    check_type("recording", recording, Recording)
    level, window = motion_level(recording)
    rate, width = recording.sampling_rate, round(window * recording.sampling_rate)
    edge = _edge(level)
    scale = np.maximum(np.std(recording.samples, axis=1, keepdims=True), 1e-300)
    quietest = int(np.argmin(level))
    reach = _EVENTS.around_quietest * width
    resting = recording.samples[:, max(quietest - reach, 0) : quietest + reach + 1] / scale
    at_rest = _rms_up_to(resting, _top(rate, window) / rate)
    events = _events(level, edge, width)
    found = []
    for first, last in events:
        part = level[first : last + 1]
        fallen = max(part.max() / _EVENTS.min_fall, min(edge, part.max() / _EVENTS.min_fall_to_edge))
        if part.max() < _EVENTS.min_peak or part[-1] > fallen:
            continue
        peak = first + int(np.flatnonzero(part > 0.7 * part.max())[-1])
        end = min([last + _EVENTS.rest * width, level.size, *(each[0] for each in events if each[0] > last)])
        starts = np.linspace(peak - width, peak + 2 * width, _EVENTS.n_starts).astype(int)
        starts = np.unique(np.clip(starts, 0, max(end - int(_EVENTS.min_windows * width), 0)))
        left = [_left_over(recording, begin, end, scale, window) for begin in starts]
        fitted = np.flatnonzero(np.isfinite(left))
        if not fitted.size:
            continue
        motion = float(np.sqrt(np.mean((np.std(recording.samples[:, starts[0] : end], axis=1) / scale[:, 0]) ** 2)))
        allowed = _EVENTS.beyond_least * min(left) + _EVENTS.beyond_motion * motion
        begin = int(starts[np.flatnonzero(np.array(left) <= allowed)[0]])
        judged = int(fitted[np.clip(np.sum(starts[fitted] < peak + width // 4), 0, fitted.size - 1)])
        own = np.sqrt(np.mean((np.std(recording.samples[:, starts[judged] : end], axis=1) / scale[:, 0]) ** 2))
        relative, quiet = (float(each / max(own, 1e-300)) for each in (left[judged], at_rest))
        found.append(Transient(float(first / rate), begin / rate, float(end / rate), window, relative, quiet))
    return tuple(found)


def without_hum(recording: Recording) -> Recording:
    """Return a recording without its lines of constant frequency and amplitude, such as hum; itself if it has none.

    Parameters
    ----------
    recording
        Channels of motion, without missing values or gaps.

    Notes
    -----
    The power of a line is far above that on either side of it in the spectrum of the whole recording. So is that of a
    swing that rings long, or of pushes at even intervals, whose amplitude falls: that of hum is the same in most parts.
    """
    steady = [frequency for frequency in _narrow_lines(recording) if _is_steady(recording, frequency)]
    if not steady:
        return recording
    from sprung.signals.harmonics import Harmonic, subtract_lines

    width = 1 / recording.duration
    lines = [Harmonic(f, "constant", (f - width, f + width), width, 0.0, recording.names) for f in steady]
    return subtract_lines(recording, lines, is_steady=True)


def _narrow_lines(recording: Recording) -> list[float]:
    """Return the frequencies at which the power is far above that on either side, the strongest first [Hz]."""
    reach = _EVENTS.beside
    powers = np.abs(np.fft.rfft(recording.samples - recording.samples.mean(axis=1, keepdims=True), axis=1)) ** 2
    around = _running_mean(powers, reach)
    sides = np.maximum(around[:, : -2 * reach], around[:, 2 * reach :])
    over = np.max(powers[:, reach:-reach] / np.maximum(sides, 1e-300), axis=0)
    peaks = 1 + np.flatnonzero((over[1:-1] > _EVENTS.over_sides) & (over[1:-1] >= over[:-2]) & (over[1:-1] > over[2:]))
    strongest = peaks[np.argsort(-over[peaks])]
    return list(((reach + strongest) / recording.duration).tolist())


def _is_steady(recording: Recording, frequency: float) -> bool:
    """Return whether the amplitude at a frequency [Hz] lasts, in the channel where it is largest.

    Notes
    -----
    The amplitude of parts is that of the whole for hum; lines of pushes at even intervals belong to the few parts with
    pushes. Parts hold two periods, so that neither slow motion nor what sensors read at rest leaks into them.
    """
    if frequency < _EVENTS.swings[0]:
        return False
    times = np.arange(recording.n_samples) / recording.sampling_rate
    centred = recording.samples - recording.samples.mean(axis=1, keepdims=True)
    turned = centred * np.exp(-2j * np.pi * frequency * times)
    n_parts = int(np.clip(recording.duration * frequency / _EVENTS.periods, 3, _EVENTS.parts))
    parts = np.array_split(turned, n_parts, axis=1)
    windows = {n: np.hanning(n) for n in {turned.shape[1], *(part.shape[1] for part in parts)}}
    sums = {n: window.sum() for n, window in windows.items()}
    amplitudes, whole = (
        np.abs([part @ windows[part.shape[1]] / sums[part.shape[1]] for part in each]) for each in (parts, [turned])
    )
    medians = np.median(amplitudes, axis=0)
    channel = int(np.argmax(medians))
    lasting = _EVENTS.steady * max(medians[channel], whole[0, channel])
    return bool(np.quantile(amplitudes[:, channel], 0.25) > lasting)


def _edge(level: Real) -> float:
    """Return the level at which a motion begins and ends."""
    return max(_EVENTS.edge, min(_EVENTS.edge_over_quiet * float(np.quantile(level, 0.1)), 1 / _EVENTS.min_fall))


def _events(level: Real, edge: float, width: int) -> list[tuple[int, int]]:
    """Return first and last sample of each motion above the edge; one that rises again is another one."""
    events: list[tuple[int, int]] = []
    step = max(1, width // 8)
    values = level[::step].tolist()
    first, lowest, highest = -1, 0, 0.0
    for k, value in zip(range(0, level.size, step), values, strict=True):
        if first < 0:
            first, lowest, highest = (k, k, value) if value > edge else (first, lowest, highest)
            continue
        highest = max(highest, value)
        least = values[lowest // step]
        if value < least or value == highest:
            lowest, least = k, value
        is_again = value > _EVENTS.rise * least and value > _EVENTS.min_peak and highest > _EVENTS.rise * least
        is_over = value <= edge and level[k : k + width].max() <= edge
        if is_over or is_again:
            events.append((first, lowest if is_again else k))
            first, lowest, highest = (lowest, k, value) if is_again else (-1, 0, 0.0)
    return [*events, (first, level.size - 1)] if first >= 0 else events


def free_motions(recordings: Iterable[Recording], *, is_certain: bool = False) -> list[tuple[Recording, Transient]]:
    """Return records and their motions that die away; none where they are records of random motion.

    Parameters
    ----------
    recordings
        Channels of motion, without missing values, gaps or hum; taken up to the first that is of random motion.
    is_certain
        Whether the records are known to be of free motion; otherwise most of each must be quiet, or its level must fall
        from the beginning to the end.
    """
    motions: list[tuple[Recording, Transient]] = []
    for recording in recordings:
        level, window = motion_level(recording)
        blocks = np.array([np.mean(block) for block in np.array_split(level, 6)])
        falls = bool(np.all(np.diff(blocks) < 0)) and blocks[0] > _EVENTS.fall_of_record * blocks[-1]
        if not is_certain and not falls and not _is_mostly_quiet(recording, level, window):
            return []
        found = find_transients(recording)
        if not 0 < len(found) <= _EVENTS.max_motions:
            return []
        longest = _EVENTS.max_windows * window
        free = sum(each.end - each.begin for each in found)
        if not is_certain and not falls and free < _EVENTS.min_share * recording.duration:
            return []
        for each in found:
            until = min(each.end, each.begin + longest) if not falls else recording.duration
            begin = 0.0 if each.onset == 0 else each.begin  # the record begins with free motion
            motions.append((recording, replace(each, begin=begin, end=until)))
    return motions


def _is_mostly_quiet(recording: Recording, level: Real, window: float) -> bool:
    """Return whether most of a record is motion that has died away, or noise of its sensors as large as that.

    Of a record that begins at rest, what is outside of its motions counts. The noise of sensors has as much power at
    the frequencies of the swings as above; motion of a drive has not.
    """
    is_quiet, outside = level < _EVENTS.quiet, np.ones(level.size, dtype=bool)
    if np.mean(is_quiet) >= _EVENTS.min_quiet:
        return True
    if is_quiet[0]:
        for first, last in _events(level, _edge(level), round(window * recording.sampling_rate)):
            outside[first : last + 1] = False
        if np.mean(is_quiet[outside]) >= _EVENTS.min_quiet:
            return True
    floor = float(np.quantile(level, 0.1))
    if floor > 1 / _EVENTS.min_fall or np.mean(level < _EVENTS.over_floor * floor) < _EVENTS.min_quiet:
        return False
    middle, reach = int(np.argmin(level)), round(_EVENTS.at_rest * window * recording.sampling_rate)
    resting = recording.samples[:, max(middle - reach, 0) : middle + reach + 1]
    tapered = (resting - resting.mean(axis=1, keepdims=True)) * np.hanning(resting.shape[1])
    powers = np.abs(np.fft.rfft(tapered, axis=1)) ** 2
    swings = np.fft.rfftfreq(resting.shape[1], 1 / recording.sampling_rate) < 2 / window
    above = np.median(powers[:, ~swings], axis=1) / np.log(2)
    return bool(np.all(powers[:, swings][:, 1:].mean(axis=1) < _EVENTS.white * above))


def _left_over(recording: Recording, begin: int, end: int, scale: Real, window: float) -> float:
    """Return what free modes leave of a part, over the scale of each channel."""
    part = Recording(recording.samples[:, begin:end] / scale, recording.sampling_rate, recording.channels)
    return unexplained(part, band=(0.0, _top(recording.sampling_rate, window)), max_modes=_EVENTS.max_modes)


def top_of_swings(recording: Recording, motion: Transient) -> float:
    """Return the highest frequency of the modes that a motion shows [Hz]."""
    return _top(recording.sampling_rate, motion.window)


def _top(sampling_rate: float, window: float) -> float:
    """Return the highest frequency that is fitted [Hz], for the length of the windows [s]."""
    return float(min(_EVENTS.reach / window, 0.45 * sampling_rate))


def _rms_up_to(samples: Real, top: float) -> float:
    """Return the RMS, root mean square over the channels, up to a frequency over the sampling rate."""
    n = samples.shape[1]
    lines = np.fft.rfft(samples, axis=1)[:, 1 : int(top * n) + 1] / n
    return float(np.sqrt(2 * np.mean(np.sum(np.abs(lines) ** 2, axis=1))))
