"""Modes over time: frequency and damping of every track with deviations, gaps, births, deaths and jumps."""

from typing import Any

import numpy as np
from matplotlib import dates
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, ScalarFormatter
from numpy.typing import NDArray

from sprung._arrays import Indices, Real
from sprung.identification.tracking import Track, TrackedModes
from sprung.results.figures.style import (
    FAINT,
    HALF_WIDTH_95,
    INK,
    NORMAL,
    SMALL,
    in_hertz,
    mode_colour,
    new_figure,
    plain,
    write_sentence,
)

#: Height of the overview and of the panel of a track [in], and most panels.
_OVERVIEW, _PANEL, _MOST_PANELS = 3.2, 1.35, 12
#: Smallest ranges shown, relative to the mean: of frequencies and damping ratios.
_LEAST_RANGE = (0.01, 0.3)
#: Windows above which a stated deviation is drawn as a band, and distances of windows that are a gap.
_MANY, _GAP = 60, 1.5
_UNITS = ((120.0, 1.0, "s"), (7200.0, 60.0, "min"), (np.inf, 3600.0, "h"))
#: Colours of modes of no track, and of windows without modes.
_STRAY, _EMPTY = "#8C8C8C", "#E4E4E4"

#: Untyped part of matplotlib.
_DATES: Any = dates


def tracks_figure(
    tracked: TrackedModes, *, start: int | None = None, has_times: bool = True, source: str = ""
) -> Figure:
    """Draw all modes over time, and frequency and damping of each track with its 95 % intervals.

    Parameters
    ----------
    tracked
        Result of `track_modes`.
    start
        Time of the first window, UTC in nanoseconds since 1970; None where unknown.
    has_times
        Whether times are seconds, not numbers of windows.
    source
        Names of the recordings, for the heading.

    Notes
    -----
    Windows without a mode interrupt its line. Triangles mark the first and last window of a track that begins later,
    or ends earlier, than the windows do. Identified modes of no track are grey dots.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.identification.tracking import track_modes
    >>> from sprung.modal import Modes
    >>> some = np.full(2, 0.01)
    >>> poles = 2 * np.pi * np.array([2.0, 5.0]) * (1j - 0.01)
    >>> modes = Modes(poles, np.eye(2, dtype=complex), ("a", "b"), some, some, np.ones(2), (None, None))
    >>> figure = tracks_figure(track_modes([modes] * 6, times=3600.0 * np.arange(6)))
    >>> [axes.get_title(loc="left") for axes in figure.axes if axes.get_ylabel() == "f [Hz]"]
    ['1: 2.00 Hz', '2: 5.00 Hz']
    """
    what = f"Modes over time: {source}" if source else "Modes over time"
    numbers = sorted(range(len(tracked.tracks)), key=lambda number: -len(tracked.tracks[number]))
    tracks = [(number, tracked.tracks[number]) for number in sorted(numbers[:_MOST_PANELS])]
    n_omitted = len(numbers) - len(tracks)
    where = f"In separate panels: the {len(tracks)} modes found in the most windows" if n_omitted else ""
    if not tracks:
        return write_sentence(new_figure(what, "", width=9.5, height=3), "No mode was found in enough windows.")
    axis, label, is_date = _time_axis(tracked.times, start=start, has_times=has_times)
    height = 1.0 + _OVERVIEW + _PANEL * len(tracks)
    figure = new_figure(what, where, width=9.5, height=height)
    above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=[_OVERVIEW, _PANEL * len(tracks) + 0.6])[:, 0]
    overview = above.subplots()
    _draw_overview(overview, tracked, axis)
    panels = below.subplots(len(tracks), 2, sharex=True, squeeze=False)
    for row, (number, track) in zip(panels, tracks, strict=True):
        _draw_track(row, tracked, track, number, axis)
    for axes in (overview, *panels[-1]):
        axes.set_xlabel(label, fontsize=SMALL)
        if is_date:
            locator = _DATES.AutoDateLocator(maxticks=9 if axes is overview else 6)
            axes.xaxis.set_major_locator(locator)
            axes.xaxis.set_major_formatter(_DATES.ConciseDateFormatter(locator))
    room = 0.02 * float(np.ptp(axis)) or 0.5
    for axes in (overview, panels[0, 0]):
        axes.set_xlim(float(axis[0]) - room, float(axis[-1]) + room)
    figure.legend(handles=_legend(tracked), loc="outside lower center", ncols=5, fontsize=SMALL, frameon=False)
    return figure


def _time_axis(times: Real, *, start: int | None, has_times: bool) -> tuple[Real, str, bool]:
    """Return places of all windows, the label of the axis, and whether the places are dates."""
    if not has_times:
        return times + 1, "window", False
    if start is not None:
        instants: NDArray[Any] = np.datetime64(start, "ns") + np.round(1e9 * times).astype("timedelta64[ns]")
        return np.asarray(_DATES.date2num(instants), dtype=np.float64), "time (UTC)", True
    factor, unit = next((factor, unit) for limit, factor, unit in _UNITS if np.ptp(times) < limit)
    return times / factor, f"time since the first window [{unit}]", False


def _draw_overview(axes: Axes, tracked: TrackedModes, axis: Real) -> None:
    """Draw the frequencies of all modes, those of tracks in their colours."""
    plain(axes)
    for track in tracked.untracked_modes:
        axes.plot(axis[track.windows], track.modes.natural_frequency, ".", color=_STRAY, markersize=4)
    for number, track in enumerate(tracked.tracks):
        colour = mode_colour(number)
        style: dict[str, Any] = {"color": colour, "markersize": 3, "linewidth": 0.6}
        for part in _unbroken(axis[track.windows], _step(axis)):
            places = axis[track.windows][part]
            axes.plot(places, track.modes.natural_frequency[part], marker=".", alpha=0.8, **style)
        place = (float(axis[track.windows[-1]]), float(track.modes.natural_frequency[-1]))
        text: dict[str, Any] = {"textcoords": "offset points", "fontsize": SMALL, "color": colour, "va": "center"}
        axes.annotate(str(number + 1), place, xytext=(5, 0), **text)
    for empty in axis[~tracked.has_result]:
        axes.axvline(float(empty), color=_EMPTY, linewidth=2.5, zorder=0)
    top = max(float(np.percentile(track.modes.natural_frequency, 99)) for track in tracked.tracks)
    axes.set_ylim(0, 1.12 * top)
    axes.set_ylabel("Natural frequency [Hz]", fontsize=SMALL)


def _draw_track(row: NDArray[Any], tracked: TrackedModes, track: Track, number: int, axis: Real) -> None:
    """Draw frequency and damping of a track."""
    modes, colour = track.modes, mode_colour(number)
    for axes, factor, values, deviations, summary, least in (
        (row[0], 1.0, modes.natural_frequency, modes.natural_frequency_std, track.natural_frequency, _LEAST_RANGE[0]),
        (row[1], 100.0, modes.damping_ratio, modes.damping_ratio_std, track.damping_ratio, _LEAST_RANGE[1]),
    ):
        plain(axes)
        places = axis[track.windows]
        halves = factor * HALF_WIDTH_95 * np.nan_to_num(deviations)
        _draw_values(axes, places, factor * values, halves, step=_step(axis), colour=colour)
        _draw_ends(axes, tracked, track, axis, colour)
        for jump in track.jumps:
            axes.axvline(float(axis[jump.window]), color=INK, linewidth=0.9, linestyle=(0, (2, 2)))
        low, high = (factor * end for end in (summary.low, summary.high))
        room = max(0.25 * (high - low), factor * least * summary.mean / 2)
        room = max(room, min(1.1 * float(np.median(halves)), high - low))
        axes.set_ylim(max(low - room, 0.0), high + room)
        axes.yaxis.set_major_locator(MaxNLocator(4))
        axes.yaxis.set_major_formatter(ScalarFormatter(useOffset=False))
    name = f"{number + 1} {track.label.replace('_', ' ')}" if track.label else f"{number + 1}"
    row[0].set_title(f"{name}: {in_hertz(track.natural_frequency.mean)}", fontsize=NORMAL, color=colour, loc="left")
    row[0].set_ylabel("f [Hz]", fontsize=SMALL)
    row[1].set_ylabel("damping [%]", fontsize=SMALL)


def _draw_values(axes: Axes, places: Real, values: Real, halves: Real, *, step: float, colour: str) -> None:
    """Draw values with 95 % intervals, and a line where no window lies between."""
    for part in _unbroken(places, step):
        axes.plot(places[part], values[part], color=colour, linewidth=0.7, alpha=0.6)
    is_many = len(places) > _MANY
    style: dict[str, Any] = {"linewidth": 0.5, "alpha": 0.35} if is_many else {"linewidth": 1.0, "capsize": 2}
    axes.errorbar(places, values, halves, fmt="none", ecolor=colour, elinewidth=style.pop("linewidth"), **style)
    axes.plot(places, values, "o", color=colour, markersize=2.2 if is_many else 3.5)


def _unbroken(places: Real, step: float) -> list[Indices]:
    """Return the indices of places between which no window lies."""
    return np.split(np.arange(len(places)), np.flatnonzero(np.diff(places) > _GAP * step) + 1)


def _draw_ends(axes: Axes, tracked: TrackedModes, track: Track, axis: Real, colour: str) -> None:
    """Mark the begin and the end of a track within the windows that have modes."""
    present = np.flatnonzero(tracked.has_result)
    for end, limit, marker in ((track.windows[0], present[0], ">"), (track.windows[-1], present[-1], "<")):
        if end != limit:
            style: dict[str, Any] = {"color": colour, "markersize": 6, "clip_on": False}
            axes.plot([axis[end]], [0], marker, transform=axes.get_xaxis_transform(), **style)


def _step(axis: Real) -> float:
    """Return the usual distance of windows."""
    return float(np.median(np.diff(axis))) if len(axis) > 1 else 1.0


def _legend(tracked: TrackedModes) -> list[Line2D]:
    """Return legend entries for what the figure shows."""
    grey: dict[str, Any] = {"color": FAINT, "linestyle": "none"}
    present = np.flatnonzero(tracked.has_result)
    ends = {int(present[0]), int(present[-1])}
    handles = [Line2D([], [], color=FAINT, marker="o", markersize=4, linewidth=1, label="window, with 95 % interval")]
    if any(not {int(track.windows[0]), int(track.windows[-1])} <= ends for track in tracked.tracks):
        handles.append(Line2D([], [], **grey, marker=">", markersize=5, label="first window of a mode"))
        handles.append(Line2D([], [], **grey, marker="<", markersize=5, label="last window"))
    if any(track.jumps for track in tracked.tracks):
        handles.append(Line2D([], [], color=INK, linewidth=0.9, linestyle=(0, (2, 2)), label="jump"))
    if tracked.untracked_modes:
        handles.append(Line2D([], [], color=_STRAY, linestyle="none", marker=".", label="identified, in no track"))
    if not tracked.has_result.all():
        handles.append(Line2D([], [], color=_EMPTY, linewidth=4, label="window without modes"))
    return handles


def plain_tracks_figure(tracked: TrackedModes) -> Figure:
    """Return tracked modes over their own times."""
    return tracks_figure(tracked, has_times=tracked.has_times)
