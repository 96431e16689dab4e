"""Tables of modes followed over time."""

import math
from collections.abc import Sequence

from sprung._display import counted
from sprung.identification.methods import WindowModes
from sprung.identification.tracking import Track, TrackedModes, TrackedValue
from sprung.results.tables.table import Table, in_words, time_in_words, with_deviation

#: Largest number of jumps in a cell, and of windows without a result in the sentences.
_MOST = 3
#: Fewest windows for a ratio of deviations.
_FOR_RATIO = 8
_CAPTION = (
    "frequency and damping: mean ± scatter of the windows, without trend and jumps; change: of the frequency, by a"
    " straight line through the whole track; scatter / stated: that scatter over the standard deviation stated by the"
    " identifications, 1 where the mode is steady and the stated ones are right"
)


def tracks_table(tracked: TrackedModes, *, start: int | None = None, has_times: bool = True) -> Table:
    """Return the table of tracked modes, one line for each.

    Parameters
    ----------
    tracked
        Result of `track_modes`.
    start
        Time of the first window, UTC in nanoseconds since 1970; None if unknown.
    has_times
        Whether times are seconds, not numbers of windows.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.identification.tracking import track_modes
    >>> from sprung.modal import Modes
    >>> some = np.full(2, 0.01)
    >>> poles = 2 * np.pi * np.array([2.0, 5.0]) * (1j - 0.01)
    >>> modes = Modes(poles, np.eye(2, dtype=complex), ("a", "b"), some, some, np.ones(2), (None, None))
    >>> tracked = track_modes([modes] * 6, times=3600.0 * np.arange(6))
    >>> table = tracks_table(tracked)
    >>> [row[:2] for row in table.rows], table.columns[:2]
    ([('1', '2'), ('2', '5')], ('mode', 'frequency [Hz]'))
    """
    columns = (
        "mode",
        "frequency [Hz]",
        "change [%]",
        "damping [%]",
        "scatter / stated",
        "windows",
        "first\nlast",
        "jumps",
    )
    rows = tuple(
        (
            f"{number} {in_words(track.label or '')}".strip(),
            with_deviation(track.natural_frequency.mean, track.natural_frequency.scatter),
            change_in_words(track.natural_frequency),
            with_deviation(100 * track.damping_ratio.mean, 100 * track.damping_ratio.scatter),
            _ratio(track.natural_frequency, len(track)),
            f"{len(track)} ({100 * track.presence:.0f} %)",
            "\n".join(
                moment_in_words(float(time), start=start, has_times=has_times)
                for time in (track.times[0], track.times[-1])
            ),
            "\n".join(jumps_in_words(tracked, track, start=start, has_times=has_times)),
        )
        for number, track in enumerate(tracked.tracks, start=1)
    )
    return Table("", columns, rows, caption=_CAPTION)


def tracks_in_words(tracked: TrackedModes) -> str:
    """Return the number of modes and windows in a line.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.identification.tracking import track_modes
    >>> from sprung.modal import Modes
    >>> some = np.full(2, 0.01)
    >>> poles = 2 * np.pi * np.array([2.0, 5.0]) * (1j - 0.01)
    >>> modes = Modes(poles, np.eye(2, dtype=complex), ("a", "b"), some, some, np.ones(2), (None, None))
    >>> tracked = track_modes([modes] * 6, times=3600.0 * np.arange(6))
    >>> tracks_in_words(tracked)
    '2 modes followed over 6 windows with modes, of 6'
    """
    count = counted(int(tracked.has_result.sum()), "window")
    return f"{counted(len(tracked.tracks), 'mode')} followed over {count} with modes, of {len(tracked.times)}"


def tracks_notes(tracked: TrackedModes, windows: Sequence[WindowModes]) -> list[str]:
    """Return sentences on the layout of the sensors, on windows without modes, and on modes that belong to no track.

    Examples
    --------
    >>> from sprung.identification.methods import WindowModes
    >>> import numpy as np
    >>> from sprung.identification.tracking import track_modes
    >>> from sprung.modal import Modes
    >>> some = np.full(2, 0.01)
    >>> poles = 2 * np.pi * np.array([2.0, 5.0]) * (1j - 0.01)
    >>> modes = Modes(poles, np.eye(2, dtype=complex), ("a", "b"), some, some, np.ones(2), (None, None))
    >>> tracked = track_modes([*[modes] * 6, None])
    >>> windows = [*(WindowModes(k, "run.csv", modes) for k in range(6)), WindowModes(6, "run.csv", None, "too short")]
    >>> tracks_notes(tracked, windows)
    ['window 7 (run.csv): too short']
    """
    notes = list(dict.fromkeys(note for window in windows for note in window.notes))
    empty = [(number, window) for number, window in enumerate(windows, start=1) if window.reason]
    notes += [f"window {number} ({window.source}): {window.reason}" for number, window in empty[:_MOST]]
    if len(empty) > _MOST:
        notes.append(f"{counted(len(empty) - _MOST, 'further window')} without modes")
    n_untracked = sum(len(track) for track in tracked.untracked_modes)
    if n_untracked:
        settings = tracked.settings
        total = n_untracked + sum(len(track) for track in tracked.tracks)
        notes.append(
            f"{n_untracked} of {counted(total, 'identified mode')} belong to no track: not seen"
            f" {settings.min_count} times in {settings.out_of} windows, or second estimates of one mode"
        )
    return notes


def jumps_in_words(tracked: TrackedModes, track: Track, *, start: int | None, has_times: bool) -> list[str]:
    """Return the sudden changes of a track's frequency, the first few of many."""
    words = [
        f"{100 * (jump.after / jump.before - 1):+.2g} % at "
        + moment_in_words(float(tracked.times[jump.window]), start=start, has_times=has_times)
        for jump in track.jumps
    ]
    return [*words[:_MOST], "..."] if len(words) > _MOST else words


def change_in_words(value: TrackedValue) -> str:
    """Return the relative change over a track [%] with its standard deviation; empty for a short one."""
    trend = value.trend
    if trend is None:
        return ""
    return with_deviation(100 * trend.change / value.mean, 100 * trend.change_std / value.mean)


def moment_in_words(time: float, *, start: int | None, has_times: bool) -> str:
    """Return the time of a window: date and minute, time since the first window, or number of the window."""
    if not has_times:
        return str(round(time) + 1)
    if start is not None:
        return time_in_words(start + round(1e9 * time))
    return f"{time:.4g} s" if time < 120 else f"{time / 60:.4g} min" if time < 7200 else f"{time / 3600:.4g} h"


def _ratio(value: TrackedValue, n_windows: int) -> str:
    """Return scatter over stated deviation; empty if one is unknown or rests on few windows."""
    ratio = value.scatter / value.stated if value.stated > 0 and n_windows >= _FOR_RATIO else math.nan
    return f"{ratio:.2g}" if math.isfinite(ratio) else ""
