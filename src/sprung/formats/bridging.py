"""Short gaps bridged by interpolation."""

from dataclasses import replace

import numpy as np

from sprung._arrays import Real
from sprung.formats.timing import interpolate
from sprung.recording import Gap, Recording

#: Samples on either side from which those in a gap are interpolated, and fewest of them.
_REACH, _FEWEST = 16, 4
#: Largest difference of a gap from whole sample intervals.
_FRACTION = 0.25


def bridged(recording: Recording, longest: float) -> Recording:
    """Return the recording with its short gaps filled by cubic splines through the samples on either side.

    Parameters
    ----------
    recording
        Recording with gaps.
    longest
        Longest gap that is filled [s]. A gap stays if it is not a whole number of sample intervals long, or fewer than
        four samples lie between it and the next one or an end of the recording: nothing is extrapolated.

    Returns
    -------
    Recording
        Recording with the samples in the gaps, and a line in its history.
    """
    edges = [0, *(gap.index for gap in recording.gaps), recording.n_samples]
    parts: list[Real] = []
    kept: list[Gap] = []
    added, duration, count = 0, 0.0, 0
    for number, stretch in enumerate(recording.stretches()):
        gap = recording.gaps[number - 1] if number else None
        wanted = gap.duration * recording.sampling_rate if gap else 0.0
        n_missing = round(wanted)
        sizes = (edges[number] - edges[number - 1], stretch.stop - stretch.start) if gap else (0, 0)
        if gap is None:
            pass
        elif n_missing and gap.duration <= longest and abs(wanted - n_missing) < _FRACTION and min(sizes) >= _FEWEST:
            before, after = (min(_REACH, size) for size in sizes)
            samples = recording.samples[:, gap.index - before : gap.index + after]
            times = np.concatenate([np.arange(-before, 0), n_missing + np.arange(after)]).astype(np.float64)
            parts.append(interpolate(samples, times, np.arange(n_missing, dtype=np.float64)))
            added, duration, count = added + n_missing, duration + gap.duration, count + 1
        else:
            kept.append(replace(gap, index=gap.index + added))
        parts.append(recording.samples[:, stretch])
    if not count:
        return recording
    return recording.changed(said(count, duration), samples=np.concatenate(parts, axis=1), gaps=tuple(kept))


def said(count: int, duration: float) -> str:
    """Return the line of the history on bridged gaps.

    Parameters
    ----------
    count, duration
        Number of gaps and their total length [s].
    """
    return f"{count} gap{'s' * (count > 1)} of {duration:.4g} s in all bridged by cubic interpolation"
