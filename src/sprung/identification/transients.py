"""Pushes, drops and releases in a recording: where motion dies away, and from where on it is free."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_type
from sprung.identification.free_response import unexplained
from sprung.recording import Recording


@dataclass(frozen=True, slots=True)
class TransientRules:
    """What counts as motion that dies away."""

    #: Bounds of the frequency of the swings [Hz] that sets the windows of the level.
    swings: tuple[float, float] = (0.4, 30.0)
    #: Level at which a motion begins and ends, over the largest level, and over that of the quiet parts.
    edge: float = 0.06
    edge_over_quiet: float = 3.0
    #: Smallest peak of a motion over the largest.
    min_peak: float = 0.4
    #: Smallest fall of the level from the peak to the end.
    min_fall: float = 3.0
    #: Shortest free motion, in windows of the level.
    min_windows: float = 1.2
    #: Rise of the level over its minimum since the peak before from which another motion begins.
    rise: float = 3.0
    #: Level below which a record is quiet, over its peak, and least share of such samples of a record of free motion.
    quiet: float = 0.08
    min_quiet: float = 0.4
    #: Fall of the level, from the first sixth to the last, of a record that is one decay.
    fall_of_record: float = 5.0
    #: Most motions in a record of free motion, and most windows of each that are fitted.
    max_motions: int = 20
    max_windows: float = 60.0
    #: Windows of rest that are fitted after the end of a motion.
    rest: int = 1
    #: Starts of free motion that are tried, from a window before the peak of the level to two after it.
    n_starts: int = 10
    #: Frequencies that are fitted, over that of the windows, and most modes.
    reach: float = 8.0
    max_modes: int = 4
    #: RMS of the residuals of the first free motion over the smallest of later starts.
    beyond_least: float = 1.2
    #: The same, in shares of the motion's own RMS, for motion with friction or progressive springs.
    beyond_motion: float = 0.004


RULES = TransientRules()


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
        RMS of what free modes leave of it from half a window after its peak, over that of the motion.
    noise
        RMS of the recording where it is quietest, over that of the motion.
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
        Standard deviation within a window of about one period around each sample, root mean square over the channels,
        each over its own largest; shape (samples,).
    """
    from scipy.ndimage import uniform_filter1d

    samples, rate = np.nan_to_num(recording.samples), recording.sampling_rate
    slopes = np.abs(np.fft.rfft(np.diff(samples, axis=1), axis=1)) ** 2
    frequencies = np.fft.rfftfreq(samples.shape[1] - 1, 1 / rate)
    used = (frequencies >= RULES.swings[0]) & (frequencies <= min(RULES.swings[1], 0.4 * rate))
    spectrum = np.mean(slopes[:, used] / np.maximum(slopes[:, used].sum(axis=1, keepdims=True), 1e-300), axis=0)
    centre = float(np.sum(spectrum * frequencies[used]) / max(spectrum.sum(), 1e-300)) or RULES.swings[0]
    n = int(np.clip(rate / centre, 8, max(8, samples.shape[1] // 4)))
    centred = samples - np.median(samples, axis=1, keepdims=True)
    means, squares = (uniform_filter1d(values, n, axis=1, mode="nearest") for values in (centred, centred**2))
    deviations = np.sqrt(np.maximum(squares - means**2, 0.0))
    level = np.sqrt(np.mean((deviations / np.maximum(deviations.max(axis=1, keepdims=True), 1e-300)) ** 2, axis=0))
    return np.asarray(level / max(level.max(), 1e-300)), n / rate


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
    edge = max(RULES.edge, min(RULES.edge_over_quiet * float(np.quantile(level, 0.1)), 1 / RULES.min_fall))
    scale = np.maximum(np.std(recording.samples, axis=1, keepdims=True), 1e-300)
    quietest = int(np.argmin(level))
    noise = np.std(recording.samples[:, max(quietest - width // 2, 0) : quietest + width // 2 + 1], axis=1)
    at_rest = np.sqrt(np.mean((noise / scale[:, 0]) ** 2))
    events = _events(level, edge, width)
    found = []
    for first, last in events:
        part = level[first : last + 1]
        if part.max() < RULES.min_peak or part[-1] > part.max() / RULES.min_fall:
            continue
        peak = first + int(np.flatnonzero(part > 0.7 * part.max())[-1])
        end = min([last + RULES.rest * width, level.size, *(each[0] for each in events if each[0] > last)])
        starts = np.linspace(peak - width, peak + 2 * width, RULES.n_starts).astype(int)
        starts = np.unique(np.clip(starts, 0, max(end - int(RULES.min_windows * width), 0)))
        left = [_unexplained(recording, begin, end, scale, window) for begin in starts]
        if not np.isfinite(left).any():
            continue
        motion = float(np.sqrt(np.mean((np.std(recording.samples[:, starts[0] : end], axis=1) / scale[:, 0]) ** 2)))
        allowed = RULES.beyond_least * min(left) + RULES.beyond_motion * motion
        number = int(np.flatnonzero(np.array(left) <= allowed)[0])
        begin = int(starts[number])
        judged = int(np.clip(np.searchsorted(starts, peak + width // 2), 0, len(starts) - 1))
        own = np.sqrt(np.mean((np.std(recording.samples[:, starts[judged] : end], axis=1) / scale[:, 0]) ** 2))
        relative, quiet = (float(each / max(own, 1e-300)) for each in (left[judged], at_rest))
        found.append(Transient(float(first / rate), begin / rate, float(end / rate), window, relative, quiet))
    return tuple(found)


def _events(level: Real, edge: float, width: int) -> list[tuple[int, int]]:
    """Return first and last sample of each motion above the edge; one that rises again is another one."""
    events: list[tuple[int, int]] = []
    first, lowest, highest = -1, 0, 0.0
    for k in range(0, level.size, max(1, width // 8)):
        value = level[k]
        if first < 0:
            first, lowest, highest = (k, k, value) if value > edge else (first, lowest, highest)
            continue
        highest = max(highest, value)
        lowest = k if value < level[lowest] or value == highest else lowest
        is_again = (
            value > RULES.rise * level[lowest] and value > RULES.min_peak and highest > RULES.rise * level[lowest]
        )
        is_over = level[k : k + width].max() <= edge
        if is_over or is_again:
            events.append((first, int(lowest if is_again else k)))
            first, lowest, highest = (lowest, k, value) if is_again else (-1, 0, 0.0)
    return [*events, (first, level.size - 1)] if first >= 0 else events


def free_parts(recordings: Sequence[Recording], *, is_certain: bool = False) -> list[Recording]:
    """Return the parts of records in which motion is free; none where they are records of random motion.

    Parameters
    ----------
    recordings
        Channels of motion, without missing values or gaps.
    is_certain
        Whether the records are known to be of free motion; otherwise most of each must be quiet, or its level must fall
        from the beginning to the end.
    """
    parts = []
    for recording in recordings:
        level, window = motion_level(recording)
        blocks = np.array([np.mean(block) for block in np.array_split(level, 6)])
        falls = bool(np.all(np.diff(blocks) < 0)) and blocks[0] > RULES.fall_of_record * blocks[-1]
        if not is_certain and np.mean(level < RULES.quiet) < RULES.min_quiet and not falls:
            return []
        found = find_transients(recording)
        if not 0 < len(found) <= RULES.max_motions:
            return []
        rate = recording.sampling_rate
        longest = RULES.max_windows * window
        for each in found:
            until = min(each.end, each.begin + longest) if not falls else recording.duration
            begin = 0.0 if each.onset == 0 else each.begin  # the record begins with free motion
            parts.append(recording.part(round(begin * rate), round(until * rate)))
    return parts


def _unexplained(recording: Recording, begin: int, end: int, scale: Real, window: float) -> float:
    """Return what free modes leave of a part, over the scale of each channel."""
    part = Recording(recording.samples[:, begin:end] / scale, recording.sampling_rate, recording.channels)
    top = min(RULES.reach / window, 0.45 * recording.sampling_rate)
    return unexplained(part, band=(0.0, top), max_modes=RULES.max_modes)
