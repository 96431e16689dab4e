"""Values over dates: modes that are followed, months of a vehicle, and planned windows."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import dates
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import FancyBboxPatch, Patch
from matplotlib.ticker import MaxNLocator, ScalarFormatter
from numpy.typing import NDArray

from sprung._arrays import Indices, Real
from sprung.identification.tracking import Track, TrackedModes
from sprung.modal import INTERVAL_95
from sprung.results.figures import draw
from sprung.results.figures.draw import STYLE, in_hertz, mode_colour, percent
from sprung.vehicles import Component

#: Untyped part of matplotlib.
_DATES: Any = dates

Times = NDArray[np.int64]


@dataclass(frozen=True, slots=True)
class Stretch:
    """A stretch of time that is marked.

    Parameters
    ----------
    cause
        Name of the component, or another cause.
    begin, end
        Its ends, UTC ns.
    """

    cause: str
    begin: int
    end: int


def components_history_figure(
    times: Times,
    log_ratios: Real,
    deviations: Real,
    *,
    components: Sequence[Component],
    usual: Real,
    alerts: Iterable[Stretch] = (),
    baselines: Iterable[int] = (),
) -> Figure:
    """Draw the change of every component against the baseline over dates.

    Parameters
    ----------
    times
        Start of each window, UTC ns, shape (windows,).
    log_ratios, deviations
        ln(value / baseline) under the conditions of each window, and its standard deviation, shape (windows,
        components).
    components
        Springs, dampers and tyres.
    usual
        Standard deviation of usual single windows, shape (components,).
    alerts
        Times when alerts were active, by component.
    baselines
        Times from which on another baseline counts, UTC ns.

    Notes
    -----
    More than 200 windows are drawn in groups of equal length: their median, and 95 % of them.

    Examples
    --------
    A front-left spring that is 20 % softer from the sixth day on:

    >>> import numpy as np
    >>> days = 1_790_000_000_000_000_000 + 86_400_000_000_000 * np.arange(10)
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> ratios, std = np.zeros((10, 12)), np.full((10, 12), 0.02)
    >>> ratios[5:, 0] = np.log(0.8)
    >>> figure = components_history_figure(days, ratios, std, components=parts, usual=np.full(12, 0.03))
    >>> points = next(line for line in figure.axes[0].lines if line.get_marker() == "o")
    >>> points.get_ydata().round().tolist()
    [0.0, 0.0, 0.0, 0.0, 0.0, -20.0, -20.0, -20.0, -20.0, -20.0]
    """
    n_corners = len({draw.corner_of(component) for component in components})
    groups, length = _grouped(times)
    points = f"medians of {length} h, with 95 % of their windows" if length else "single windows with 95 % intervals"
    where = f"Points: {points}. Grey: usual windows. Shaded: alert."
    figure = draw.new_figure("Components against the baseline", where, width=max(9.5, 2.4 * n_corners), height=6.6)
    panels, shown = draw.component_panels(figure, components)
    spans, learnt = list(alerts), list(baselines)
    for axes, row in shown:
        band = INTERVAL_95 * float(usual[row])
        axes.axhspan(*percent([-band, band]), color=STYLE.usual, zorder=0)
        axes.axhline(0, color=STYLE.ink, linewidth=0.8)
        for span in spans:
            if span.cause == str(components[row]):
                begin, end = _places(np.array([span.begin, span.end]))
                axes.axvspan(begin, end, color=STYLE.attention, zorder=0.5)
                axes.plot([begin], [0.97], "v", color=STYLE.faint, markersize=5, transform=axes.get_xaxis_transform())
        half = INTERVAL_95 * deviations[:, row]
        values = np.array([percent(log_ratios[:, row] + sign * half) for sign in (0, -1, 1)])
        _draw_points(axes, _places(times), values, groups, colour=STYLE.colours[0])
        for place in _places(np.array(learnt, dtype=np.int64)):
            axes.axvline(float(place), color=STYLE.ink, linewidth=0.9, linestyle=":")
    for axes in panels[-1]:
        _set_dates(axes, times, n_ticks=4)
    label = "median, 95 % of the windows" if length else "window, 95 % interval"
    handles: list[Any] = [
        draw.entry(label, color=STYLE.colours[0], marker="o", markersize=3, linewidth=1),
        Patch(color=STYLE.usual, label="95 % of usual windows"),
    ]
    handles += [Patch(color=STYLE.attention, label="alert active")] if spans else []
    handles += [draw.entry("new baseline", color=STYLE.ink, linestyle=":")] if learnt else []
    draw.legend(figure, handles, n_columns=4)
    return figure


def modes_history_figure(modes: Mapping[str, tuple[Times, Real, Real]]) -> Figure:
    """Draw natural frequency and damping of the body's modes over dates.

    Parameters
    ----------
    modes
        For each mode its times [UTC ns], natural frequencies [Hz] and damping ratios, each of shape (windows,); at
        least one mode.

    Examples
    --------
    >>> import numpy as np
    >>> days = 1_790_000_000_000_000_000 + 86_400_000_000_000 * np.arange(10)
    >>> figure = modes_history_figure({"bounce": (days, np.full(10, 1.3), np.full(10, 0.25))})
    >>> [float(axes.lines[0].get_ydata()[0]) for axes in figure.axes]
    [1.3, 25.0]
    """
    every = np.concatenate([times for times, _, _ in modes.values()])
    _, length = _grouped(every)
    points = f"medians of {length} h, with 95 % of their windows" if length else "single windows"
    where = f"Points: {points}; where there are none, nothing was identified."
    figure = draw.new_figure("Body modes over time", where, height=1.2 + 1.5 * len(modes))
    panels = draw.panels(figure, len(modes), 2, size=STYLE.small, sharex=True)
    for number, (label, (times, frequencies, ratios)) in enumerate(modes.items()):
        colour = mode_colour(number)
        groups = _grouped(times, length=length)[0]
        kinds = (frequencies, "frequency [Hz]"), (100 * ratios, "damping [%]")
        for axes, (values, unit) in zip(panels[number], kinds, strict=True):
            _draw_points(axes, _places(times), np.array([values, values, values]), groups, colour=colour)
            axes.set_ylabel(unit)
        draw.title(panels[number, 0], label.replace("_", " "), colour=colour)
    for axes in panels[-1]:
        _set_dates(axes, every, n_ticks=6)
    return figure


def findings_history_figure(findings: Mapping[str, tuple[Times, Real]]) -> Figure:
    """Draw the sizes of findings over dates.

    Parameters
    ----------
    findings
        For each hypothesis the times of its windows [UTC ns], shape (windows,), and relative change with low and high
        end of its 95 % interval, shape (windows, 3); at least one.

    Examples
    --------
    >>> import numpy as np
    >>> days = 1_790_000_000_000_000_000 + 86_400_000_000_000 * np.arange(10)
    >>> sizes = np.tile([-0.20, -0.22, -0.18], (10, 1))
    >>> figure = findings_history_figure({"front_left.spring": (days, sizes)})
    >>> figure.axes[0].lines[-1].get_ydata().round().tolist()
    [-20.0, -20.0, -20.0, -20.0, -20.0, -20.0, -20.0, -20.0, -20.0, -20.0]
    """
    where = "Estimated after each window from all windows since the onset, with 95 % intervals."
    figure = draw.new_figure("Sizes of the findings", where, height=3.2)
    axes = draw.panels(figure)[0, 0]
    axes.axhline(0, color=STYLE.ink, linewidth=0.8)
    markers = "osD^v"
    for number, (name, (times, values)) in enumerate(findings.items()):
        colour, marker = mode_colour(number), markers[number % len(markers)]
        style: dict[str, Any] = {"colour": colour, "marker": marker, "size": 3.5, "opacity": 0.5}
        draw.intervals(axes, _places(times), 100 * values.T, label=name.replace("_", " ").replace(".", " "), **style)
    axes.set_ylabel("change [%]")
    _set_dates(axes, np.concatenate([times for times, _ in findings.values()]), n_ticks=9)
    draw.legend(axes)
    return figure


def evidence_history_figure(times: Times, evidence: Real, *, threshold: float) -> Figure:
    """Draw the evidence of a change after each window over dates, and the threshold of an alert.

    Parameters
    ----------
    times
        Start of each window, UTC ns, shape (windows,).
    evidence
        ln evidence of any change, shape (windows,).
    threshold
        ln evidence above which a change is reported.

    Examples
    --------
    >>> import numpy as np
    >>> days = 1_790_000_000_000_000_000 + 86_400_000_000_000 * np.arange(10)
    >>> figure = evidence_history_figure(days, np.arange(10.0), threshold=10.8)
    >>> [float(line.get_ydata()[-1]) for line in figure.axes[0].lines]
    [9.0, 10.8]
    """
    where = "ln evidence after each window of the present change test; above the threshold a change is reported."
    figure = draw.new_figure("Evidence of a change", where, height=3.0)
    axes = draw.panels(figure)[0, 0]
    axes.plot(_places(times), evidence, "o", color=STYLE.colours[0], markersize=3)
    axes.axhline(threshold, color=STYLE.colours[1], linewidth=1.2, label=f"threshold {threshold:.1f}")
    axes.set_ylabel("ln evidence [-]")
    _set_dates(axes, times, n_ticks=9)
    draw.legend(axes)
    return figure


def _places(times: Times) -> Real:
    """Return times on an axis of dates."""
    return np.asarray(_DATES.date2num(np.asarray(times, dtype="datetime64[ns]")), dtype=np.float64)


def _set_dates(axes: Axes, times: Times, *, n_ticks: int) -> None:
    """Make an axis one of dates, with room on both sides."""
    places = _places(times)
    room = 0.02 * float(np.ptp(places)) or 0.05
    axes.set_xlim(float(places.min()) - room, float(places.max()) + room)
    _tick_dates(axes, minticks=2, maxticks=n_ticks)
    axes.set_xlabel("time (UTC)", fontsize=STYLE.small)


def _tick_dates(axes: Axes, **limits: int) -> None:
    locator = _DATES.AutoDateLocator(**limits)
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(_DATES.ConciseDateFormatter(locator))


def _grouped(times: Times, *, length: int | None = None) -> tuple[list[Indices], int]:
    """Return the indices of windows in groups of a length [h], and that length; 0: each window is a group.

    Groups begin at multiples of their length since 1970, which are midnights from a day on.
    """
    if length is None:
        hours = float(np.ptp(times)) / 3600e9 if len(times) > STYLE.many_windows else 0.0
        enough = (each for each in STYLE.group_hours if hours <= STYLE.max_groups * each)
        length = next(enough, STYLE.group_hours[-1]) if hours else 0
    if not length:
        return [np.array([k]) for k in range(len(times))], 0
    groups = times // (length * 3600 * 10**9)
    return [np.flatnonzero(groups == group) for group in np.unique(groups)], length


def _draw_points(axes: Axes, places: Real, values: Real, groups: list[Indices], *, colour: str) -> None:
    """Draw single windows with the ends of their intervals, shape (3, windows), or medians of groups of windows."""
    if len(groups) < len(places):
        values = np.array([np.quantile(values[0, group], (0.5, 0.025, 0.975)) for group in groups]).T
        places = np.array([places[group].mean() for group in groups])
    draw.intervals(axes, places, values, colour=colour, size=2.5, opacity=0.4)


#: Colours of modes of no track, and of windows without modes.
_STRAY, _EMPTY = "#8C8C8C", "#E4E4E4"


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
    what = "Modes over time"
    numbers = sorted(range(len(tracked.tracks)), key=lambda number: -len(tracked.tracks[number]))
    tracks = [(number, tracked.tracks[number]) for number in sorted(numbers[: STYLE.max_tracks])]
    where = f"In separate panels: the {len(tracks)} modes found in the most windows" * (len(numbers) > len(tracks))
    if not tracks:
        return draw.sentence(draw.new_figure(what, height=3, source=source), "No mode was found in enough windows.")
    axis, label, is_date = _time_axis(tracked.times, start=start, has_times=has_times)
    heights = [STYLE.overview, STYLE.track * len(tracks) + 0.6]
    figure = draw.new_figure(what, where, height=0.4 + sum(heights), source=source)
    above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=heights)[:, 0]
    overview = draw.panels(above, size=STYLE.small)[0, 0]
    _draw_overview(overview, tracked, axis)
    panels = draw.panels(below, len(tracks), 2, size=STYLE.small, sharex=True)
    for row, (number, track) in zip(panels, tracks, strict=True):
        _draw_track(row, tracked, track, number, axis)
    for axes in (overview, *panels[-1]):
        axes.set_xlabel(label)
        if is_date:
            _tick_dates(axes, maxticks=9 if axes is overview else 6)
    room = 0.02 * float(np.ptp(axis)) or 0.5
    for axes in (overview, panels[0, 0]):
        axes.set_xlim(float(axis[0]) - room, float(axis[-1]) + room)
    draw.legend(figure, _legend(tracked), n_columns=5)
    return figure


def _time_axis(times: Real, *, start: int | None, has_times: bool) -> tuple[Real, str, bool]:
    """Return places of all windows, the label of the axis, and whether the places are dates."""
    if not has_times:
        return times + 1, "window", False
    if start is not None:
        instants: NDArray[Any] = np.datetime64(start, "ns") + np.round(1e9 * times).astype("timedelta64[ns]")
        return np.asarray(_DATES.date2num(instants), dtype=np.float64), "time (UTC)", True
    length = np.ptp(times)
    factor, unit = (1.0, "s") if length < 120 else (60.0, "min") if length < 7200 else (3600.0, "h")
    return times / factor, f"time since the first window [{unit}]", False


def _draw_overview(axes: Axes, tracked: TrackedModes, axis: Real) -> None:
    """Draw the frequencies of all modes, those of tracks in their colours."""
    for track in tracked.untracked_modes:
        axes.plot(axis[track.windows], track.modes.natural_frequency, ".", color=_STRAY, markersize=4)
    for number, track in enumerate(tracked.tracks):
        style: dict[str, Any] = {"color": mode_colour(number), "marker": ".", "markersize": 3, "linewidth": 0.6}
        places, values = axis[track.windows], track.modes.natural_frequency
        for part in _unbroken(places, _step(axis)):
            axes.plot(places[part], values[part], alpha=0.8, **style)
        draw.note(
            axes, str(number + 1), (places[-1], values[-1]), offset=(5, 0), color=mode_colour(number), va="center"
        )
    for empty in axis[~tracked.has_result]:
        axes.axvline(float(empty), color=_EMPTY, linewidth=2.5, zorder=0)
    top = max(float(np.percentile(track.modes.natural_frequency, 99)) for track in tracked.tracks)
    axes.set(ylim=(0, 1.12 * top), ylabel="Natural frequency [Hz]")


def _draw_track(row: NDArray[Any], tracked: TrackedModes, track: Track, number: int, axis: Real) -> None:
    """Draw frequency and damping of a track."""
    modes, colour, places = track.modes, mode_colour(number), axis[track.windows]
    names = ("natural_frequency", "damping_ratio")
    for axes, name, factor, least in zip(row, names, (1.0, 100.0), STYLE.time_ranges, strict=True):
        summary, values = getattr(track, name), factor * getattr(modes, name)
        halves = factor * INTERVAL_95 * np.nan_to_num(getattr(modes, f"{name}_std"))
        _draw_values(axes, places, values, halves, step=_step(axis), colour=colour)
        _draw_ends(axes, tracked, track, axis, colour)
        for jump in track.jumps:
            axes.axvline(float(axis[jump.window]), **_JUMP)
        low, high = (factor * end for end in (summary.low, summary.high))
        room = max(0.25 * (high - low), factor * least * summary.mean / 2)
        room = max(room, min(1.1 * float(np.median(halves)), high - low))
        axes.set_ylim(max(low - room, 0.0), high + room)
        axes.yaxis.set_major_locator(MaxNLocator(4))
        axes.yaxis.set_major_formatter(ScalarFormatter(useOffset=False))
    name = f"{number + 1} {track.label.replace('_', ' ')}" if track.label else f"{number + 1}"
    draw.title(row[0], f"{name}: {in_hertz(track.natural_frequency.mean)}", colour=colour)
    row[0].set_ylabel("f [Hz]")
    row[1].set_ylabel("damping [%]")


#: Line at a jump of frequency.
_JUMP: dict[str, Any] = {"color": STYLE.ink, "linewidth": 0.9, "linestyle": (0, (2, 2))}


def _draw_values(axes: Axes, places: Real, values: Real, halves: Real, *, step: float, colour: str) -> None:
    """Draw values with 95 % intervals, and a line where no window lies between."""
    for part in _unbroken(places, step):
        axes.plot(places[part], values[part], color=colour, linewidth=0.7, alpha=0.6)
    is_many = len(places) > STYLE.many_intervals
    style: dict[str, Any] = {"linewidth": 0.5, "alpha": 0.35} if is_many else {"linewidth": 1.0, "capsize": 2}
    axes.errorbar(places, values, halves, fmt="none", ecolor=colour, elinewidth=style.pop("linewidth"), **style)
    axes.plot(places, values, "o", color=colour, markersize=2.2 if is_many else 3.5)


def _unbroken(places: Real, step: float) -> list[Indices]:
    """Return the indices of places between which no window lies."""
    return np.split(np.arange(len(places)), np.flatnonzero(np.diff(places) > STYLE.gap * step) + 1)


def _draw_ends(axes: Axes, tracked: TrackedModes, track: Track, axis: Real, colour: str) -> None:
    """Mark the begin and the end of a track within the windows that have modes."""
    present = np.flatnonzero(tracked.has_result)
    style: dict[str, Any] = {"color": colour, "markersize": 6, "clip_on": False}
    for end, limit, marker in ((track.windows[0], present[0], ">"), (track.windows[-1], present[-1], "<")):
        if end != limit:
            axes.plot([axis[end]], [0], marker, transform=axes.get_xaxis_transform(), **style)


def _step(axis: Real) -> float:
    """Return the usual distance of windows."""
    return float(np.median(np.diff(axis))) if len(axis) > 1 else 1.0


def _legend(tracked: TrackedModes) -> list[Line2D]:
    """Return legend entries for what the figure shows."""
    grey: dict[str, Any] = {"color": STYLE.faint, "linestyle": "none", "markersize": 5}
    present = np.flatnonzero(tracked.has_result)
    ends = {int(present[0]), int(present[-1])}
    begins_late = any(not {int(track.windows[0]), int(track.windows[-1])} <= ends for track in tracked.tracks)
    return [
        draw.entry("window, with 95 % interval", color=STYLE.faint, marker="o", markersize=4, linewidth=1),
        *([draw.entry("first window of a mode", marker=">", **grey)] if begins_late else []),
        *([draw.entry("last window", marker="<", **grey)] if begins_late else []),
        *([draw.entry("jump", **_JUMP)] if any(track.jumps for track in tracked.tracks) else []),
        *(
            [draw.entry("identified, in no track", color=_STRAY, linestyle="none", marker=".")]
            if tracked.untracked_modes
            else []
        ),
        *([draw.entry("window without modes", color=_EMPTY, linewidth=4)] if not tracked.has_result.all() else []),
    ]


def plain_tracks_figure(tracked: TrackedModes) -> Figure:
    """Return tracked modes over their own times."""
    return tracks_figure(tracked, has_times=tracked.has_times)


#: Sign and colour of each step of severity, from note to critical; light colours carry dark text.
_STEPS = (("○", "#D9D9D9"), ("△", "#F0E442"), ("◇", "#E69F00"), ("■", "#D55E00"), ("✖", "#B2182B"))


def plan_figure(
    components: Sequence[Component],
    changes: Real,
    intervals: Real,
    *,
    steps: Mapping[str, int],
    detectable: Mapping[str, float],
    heading: tuple[str, str],
) -> Figure:
    """Draw the vehicle from above with the change of every component, and next to it the changes with intervals.

    Parameters
    ----------
    components
        Springs, dampers and tyres of the corners.
    changes, intervals
        Relative change of each component, shape (components,), and the ends of its interval, shape (components, 2).
    steps
        Step of severity, 0 (note) to 4 (critical), by the name of each component with an alert.
    detectable
        Smallest relative loss that would have been found, by the name of the component, where known.
    heading
        Heading of the figure, and the line below it.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> changes = np.zeros(12)
    >>> changes[0] = -0.3
    >>> intervals = changes[:, None] + [-0.02, 0.02]
    >>> found = {"steps": {"front_left.spring": 3}, "detectable": {"front_left.spring": 0.07}}
    >>> figure = plan_figure(parts, changes, intervals, heading=("Today", "car-1"), **found)
    >>> [text.get_text() for axes in figure.axes for text in axes.texts if "30" in text.get_text()]
    ['■ −30.0 %']
    """
    corners = list(dict.fromkeys(draw.corner_of(component) for component in components))
    n_axles = max(1, len(corners) // 2)
    figure = draw.new_figure(*heading, height=max(1.3 + 1.5 * n_axles, 1.3 + 0.24 * len(components)))
    left, right = figure.subplots(1, 2, width_ratios=(5, 6))
    _draw_plan(left, components, corners, 100 * changes, steps)
    _draw_changes(right, components, 100 * changes, 100 * intervals.T, steps=steps, detectable=detectable)
    return figure


def _draw_plan(
    axes: Axes, components: Sequence[Component], corners: Sequence[str], change: Real, steps: Mapping[str, int]
) -> None:
    """Draw the body, the direction of travel, and a box with three lines at every corner."""
    n_axles = max(1, len(corners) // 2)
    axes.set_axis_off()
    axes.set_xlim(-2.1, 2.1)
    axes.set_ylim(-n_axles - 0.1, 0.6)
    style: dict[str, Any] = {
        "boxstyle": "round,pad=0,rounding_size=0.25",
        "facecolor": "#F4F4F4",
        "edgecolor": STYLE.faint,
    }
    axes.add_patch(FancyBboxPatch((-0.55, -n_axles), 1.1, n_axles + 0.5, **style))
    axes.annotate(
        "", (0, 0.35), xytext=(0, -0.35), arrowprops={"arrowstyle": "-|>", "color": STYLE.ink, "linewidth": 1.5}
    )
    axes.text(0, -0.45, "forward", ha="center", va="top", fontsize=STYLE.small, color=STYLE.ink)
    for number, corner in enumerate(corners):
        row, side = divmod(number, 2)
        x = (-2.05, 0.65)[side]
        y = 0.32 - row
        axes.text(x, y, corner.replace("_", " "), fontsize=STYLE.small, color=STYLE.ink, va="bottom", weight="bold")
        of_corner = [k for k, component in enumerate(components) if draw.corner_of(component) == corner]
        for line, k in enumerate(of_corner):
            _draw_cell(axes, (x, y - 0.05 - 0.24 * line), components[k], float(change[k]), steps)


def _draw_cell(
    axes: Axes, place: tuple[float, float], component: Component, change: float, steps: Mapping[str, int]
) -> None:
    """Draw kind, sign and change of a component, on the colour of its step."""
    x, y = place
    step = steps.get(str(component))
    sign, colour = ("", "#FFFFFF") if step is None else _STEPS[step]
    ink = "white" if step is not None and step >= 3 else STYLE.ink
    style: dict[str, Any] = {"boxstyle": "round,pad=0,rounding_size=0.04", "facecolor": colour, "edgecolor": "#BBBBBB"}
    axes.add_patch(FancyBboxPatch((x, y - 0.21), 1.4, 0.2, linewidth=0.7, **style))
    text: dict[str, Any] = {"fontsize": STYLE.small, "color": ink, "va": "center"}
    axes.text(x + 0.06, y - 0.115, component.kind.replace("_", "-"), **text)
    axes.text(x + 1.34, y - 0.115, f"{sign} {change:+z.1f} %".replace("-", "−").strip(), ha="right", **text)


def _draw_changes(
    axes: Axes,
    components: Sequence[Component],
    change: Real,
    interval: Real,
    *,
    steps: Mapping[str, int],
    detectable: Mapping[str, float],
) -> None:
    """Draw change and interval of every component [%], one below the other.

    An interval that goes beyond the axis ends in an arrow.
    """
    draw.plain(axes)
    reach = max(10.0, 1.15 * np.abs(change).max(initial=0.0), 1.15 * float(np.median(np.abs(interval))))
    axes.axvline(0, color=STYLE.ink, linewidth=1)
    for place, component in enumerate(components):
        limit = 100 * detectable.get(str(component), 0.0)
        if limit:
            axes.plot([-limit, -limit], [place - 0.3, place + 0.3], color=STYLE.faint, linewidth=1.5)
        colour, marker = (STYLE.colours[1], "D") if str(component) in steps else (STYLE.colours[0], "o")
        values = np.array([[change[place]], *interval[:, [place]]])
        style: dict[str, Any] = {"marker": marker, "size": 5, "width": 3, "reach": reach}
        draw.intervals(axes, [place], values, colour=colour, is_flat=True, **style)
    names = [f"{component.corner.replace('_', ' ')} {component.kind}" for component in components]
    axes.set_yticks(range(len(components)), names, fontsize=STYLE.small)
    axes.set(ylim=(len(components) - 0.4, -0.6), xlim=(-reach, reach))
    axes.set_xlabel("change against the baseline [%]", fontsize=STYLE.normal)
