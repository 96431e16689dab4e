"""Months of a vehicle: components, body modes, sizes of findings and evidence over dates."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib import dates
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from numpy.typing import NDArray

from sprung._arrays import Indices, Real
from sprung.results.figures.style import FAINT, HALF_WIDTH_95, INK, MODE_COLOURS, NORMAL, SMALL, new_figure, plain
from sprung.vehicles import Component

_KINDS = ("spring", "damper", "tyre")
#: Colours of the range of usual windows, and of the time of an alert.
_USUAL, _ALERT = "#E6E6E6", "#F3D9C9"
#: Windows above which they are drawn in groups, most groups, and lengths that groups may have [h].
_MANY, _MOST_GROUPS = 200, 60
_LENGTHS = (1, 2, 3, 6, 12, 24, 48, 72, 168, 336, 720)

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
    corners = list(dict.fromkeys(component.corner for component in components))
    groups, length = _grouped(times)
    points = f"medians of {length} h, with 95 % of their windows" if length else "single windows with 95 % intervals"
    where = f"Points: {points}. Grey: usual windows. Shaded: alert."
    figure = new_figure("Components against the baseline", where, width=max(9.5, 2.4 * len(corners)), height=6.6)
    panels = figure.subplots(len(_KINDS), len(corners), sharex=True, sharey="row", squeeze=False)
    spans, learnt = list(alerts), list(baselines)
    for kind, line in zip(_KINDS, panels, strict=True):
        line[0].set_ylabel(f"{kind} [%]", fontsize=NORMAL)
        for corner, axes in zip(corners, line, strict=True):
            plain(axes)
            component = Component(corner, kind)
            if component not in components:
                continue
            row = list(components).index(component)
            band = HALF_WIDTH_95 * float(usual[row])
            axes.axhspan(*_percent(np.array([-band, band])), color=_USUAL, zorder=0)
            axes.axhline(0, color=INK, linewidth=0.8)
            _shade(axes, [span for span in spans if span.cause == str(component)])
            half = HALF_WIDTH_95 * deviations[:, row]
            values = np.array([_percent(log_ratios[:, row] + sign * half) for sign in (0, -1, 1)])
            _draw_points(axes, _places(times), values, groups, colour=MODE_COLOURS[0])
            _draw_lines(axes, learnt)
    for axes, corner in zip(panels[0], corners, strict=True):
        axes.set_title(corner.replace("_", " "), fontsize=NORMAL, loc="left", color=INK)
    for axes in panels[-1]:
        _set_dates(axes, times, n_ticks=4)
    handles: list[Any] = [
        Line2D(
            [],
            [],
            color=MODE_COLOURS[0],
            marker="o",
            markersize=3,
            linewidth=1,
            label="median, 95 % of the windows" if length else "window, 95 % interval",
        ),
        Patch(color=_USUAL, label="95 % of usual windows"),
    ]
    handles += [Patch(color=_ALERT, label="alert active")] if spans else []
    handles += [Line2D([], [], color=INK, linestyle=":", label="new baseline")] if learnt else []
    figure.legend(handles=handles, loc="outside lower center", ncols=4, fontsize=SMALL, frameon=False)
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
    figure = new_figure("Body modes over time", where, width=9.5, height=1.2 + 1.5 * len(modes))
    panels = figure.subplots(len(modes), 2, sharex=True, squeeze=False)
    for number, (label, (times, frequencies, ratios)) in enumerate(modes.items()):
        colour = MODE_COLOURS[number % len(MODE_COLOURS)]
        left, right = panels[number]
        groups = _grouped(times, length=length)[0]
        for axes, values, unit in ((left, frequencies, "frequency [Hz]"), (right, 100 * ratios, "damping [%]")):
            plain(axes)
            _draw_points(axes, _places(times), np.array([values, values, values]), groups, colour=colour)
            axes.set_ylabel(unit, fontsize=SMALL)
        left.set_title(label.replace("_", " "), fontsize=NORMAL, loc="left", color=colour)
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
    figure = new_figure("Sizes of the findings", where, width=9.5, height=3.2)
    axes = figure.subplots()
    plain(axes)
    axes.axhline(0, color=INK, linewidth=0.8)
    markers = "osD^v"
    for number, (name, (times, values)) in enumerate(findings.items()):
        middle, low, high = (100 * values).T
        colour, marker = MODE_COLOURS[number % len(MODE_COLOURS)], markers[number % len(markers)]
        axes.vlines(_places(times), low, high, color=colour, linewidth=1, alpha=0.5)
        words = name.replace("_", " ").replace(".", " ")
        axes.plot(_places(times), middle, marker, color=colour, markersize=3.5, label=words)
    axes.set_ylabel("change [%]", fontsize=NORMAL)
    _set_dates(axes, np.concatenate([times for times, _ in findings.values()]), n_ticks=9)
    axes.legend(fontsize=SMALL, frameon=False)
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
    figure = new_figure("Evidence of a change", where, width=9.5, height=3.0)
    axes = figure.subplots()
    plain(axes)
    axes.plot(_places(times), evidence, "o", color=MODE_COLOURS[0], markersize=3)
    axes.axhline(threshold, color=MODE_COLOURS[1], linewidth=1.2, label=f"threshold {threshold:.1f}")
    axes.set_ylabel("ln evidence [-]", fontsize=NORMAL)
    _set_dates(axes, times, n_ticks=9)
    axes.legend(fontsize=SMALL, frameon=False)
    return figure


def _places(times: Times) -> Real:
    """Return times on an axis of dates."""
    return np.asarray(_DATES.date2num(np.asarray(times, dtype="datetime64[ns]")), dtype=np.float64)


def _set_dates(axes: Axes, times: Times, *, n_ticks: int) -> None:
    """Make an axis one of dates, with room on both sides."""
    places = _places(times)
    room = 0.02 * float(np.ptp(places)) or 0.05
    axes.set_xlim(float(places.min()) - room, float(places.max()) + room)
    locator = _DATES.AutoDateLocator(minticks=2, maxticks=n_ticks)
    axes.xaxis.set_major_locator(locator)
    axes.xaxis.set_major_formatter(_DATES.ConciseDateFormatter(locator))
    axes.set_xlabel("time (UTC)", fontsize=SMALL)


def _grouped(times: Times, *, length: int | None = None) -> tuple[list[Indices], int]:
    """Return the indices of windows in groups of a length [h], and that length; 0: each window is a group.

    Groups begin at multiples of their length since 1970, which are midnights from a day on.
    """
    if length is None:
        hours = float(np.ptp(times)) / 3600e9 if len(times) > _MANY else 0.0
        length = next((each for each in _LENGTHS if hours <= _MOST_GROUPS * each), _LENGTHS[-1]) if hours else 0
    if not length:
        return [np.array([k]) for k in range(len(times))], 0
    groups = times // (length * 3600 * 10**9)
    return [np.flatnonzero(groups == group) for group in np.unique(groups)], length


def _draw_points(axes: Axes, places: Real, values: Real, groups: list[Indices], *, colour: str) -> None:
    """Draw single windows with the ends of their intervals, shape (3, windows), or medians of groups of windows."""
    if len(groups) < len(places):
        values = np.array([np.quantile(values[0, group], (0.5, 0.025, 0.975)) for group in groups]).T
        places = np.array([places[group].mean() for group in groups])
    axes.vlines(places, values[1], values[2], color=colour, linewidth=1, alpha=0.4)
    axes.plot(places, values[0], "o", color=colour, markersize=2.5)


def _shade(axes: Axes, spans: Sequence[Stretch]) -> None:
    """Shade stretches of time."""
    for span in spans:
        begin, end = _places(np.array([span.begin, span.end], dtype=np.int64))
        axes.axvspan(begin, end, color=_ALERT, zorder=0.5)
        axes.plot([begin], [0.97], "v", color=FAINT, markersize=5, transform=axes.get_xaxis_transform())


def _draw_lines(axes: Axes, times: Sequence[int]) -> None:
    """Draw a dotted line at each of some times."""
    for place in _places(np.array(times, dtype=np.int64)):
        axes.axvline(float(place), color=INK, linewidth=0.9, linestyle=":")


def _percent(log_ratio: Real) -> Real:
    """Return the relative change [%] of ln values."""
    return 100 * np.expm1(log_ratio)
