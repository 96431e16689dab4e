"""A vehicle from above with what changed at its corners, and the changes with their intervals."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.markers import CARETLEFT, CARETRIGHT
from matplotlib.patches import FancyBboxPatch

from sprung._arrays import Real
from sprung.results.figures.style import FAINT, INK, MODE_COLOURS, NORMAL, SMALL, new_figure, plain
from sprung.vehicles import Component

#: Sign and colour of each step of severity, from note to critical; light colours carry dark text.
_STEPS = (("○", "#D9D9D9"), ("△", "#F0E442"), ("◇", "#E69F00"), ("■", "#D55E00"), ("✖", "#B2182B"))
#: Steps from which on text on their colour is white.
_DARK_FROM = 3
#: Room beyond the largest change on the axis, and least end of the axis [%].
_ROOM, _LEAST_REACH = 1.15, 10.0


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
    corners = list(dict.fromkeys(component.corner for component in components))
    n_axles = max(1, len(corners) // 2)
    figure = new_figure(*heading, width=9.5, height=max(1.3 + 1.5 * n_axles, 1.3 + 0.24 * len(components)))
    left, right = figure.subplots(1, 2, width_ratios=(5, 6))
    _draw_plan(left, components, corners, 100 * changes, steps)
    _draw_changes(right, components, 100 * changes, 100 * intervals.T, steps, detectable)
    return figure


def _draw_plan(
    axes: Axes, components: Sequence[Component], corners: Sequence[str], change: Real, steps: Mapping[str, int]
) -> None:
    """Draw the body, the direction of travel, and a box with three lines at every corner."""
    n_axles = max(1, len(corners) // 2)
    axes.set_axis_off()
    axes.set_xlim(-2.1, 2.1)
    axes.set_ylim(-n_axles - 0.1, 0.6)
    style: dict[str, Any] = {"boxstyle": "round,pad=0,rounding_size=0.25", "facecolor": "#F4F4F4", "edgecolor": FAINT}
    axes.add_patch(FancyBboxPatch((-0.55, -n_axles), 1.1, n_axles + 0.5, **style))
    axes.annotate("", (0, 0.35), xytext=(0, -0.35), arrowprops={"arrowstyle": "-|>", "color": INK, "linewidth": 1.5})
    axes.text(0, -0.45, "forward", ha="center", va="top", fontsize=SMALL, color=INK)
    for number, corner in enumerate(corners):
        row, side = divmod(number, 2)
        x = (-2.05, 0.65)[side]
        y = 0.32 - row
        axes.text(x, y, corner.replace("_", " "), fontsize=SMALL, color=INK, va="bottom", weight="bold")
        of_corner = [k for k, component in enumerate(components) if component.corner == corner]
        for line, k in enumerate(of_corner):
            _draw_cell(axes, (x, y - 0.05 - 0.24 * line), components[k], float(change[k]), steps)


def _draw_cell(
    axes: Axes, place: tuple[float, float], component: Component, change: float, steps: Mapping[str, int]
) -> None:
    """Draw kind, sign and change of a component, on the colour of its step."""
    x, y = place
    step = steps.get(str(component))
    sign, colour = ("", "#FFFFFF") if step is None else _STEPS[step]
    ink = "white" if step is not None and step >= _DARK_FROM else INK
    style: dict[str, Any] = {"boxstyle": "round,pad=0,rounding_size=0.04", "facecolor": colour, "edgecolor": "#BBBBBB"}
    axes.add_patch(FancyBboxPatch((x, y - 0.21), 1.4, 0.2, linewidth=0.7, **style))
    text: dict[str, Any] = {"fontsize": SMALL, "color": ink, "va": "center"}
    axes.text(x + 0.06, y - 0.115, component.kind, **text)
    axes.text(x + 1.34, y - 0.115, f"{sign} {change:+.1f} %".replace("-", "−").strip(), ha="right", **text)


def _draw_changes(
    axes: Axes,
    components: Sequence[Component],
    change: Real,
    interval: Real,
    steps: Mapping[str, int],
    detectable: Mapping[str, float],
) -> None:
    """Draw change and interval of every component [%], one below the other.

    An interval that goes beyond the axis ends in an arrow.
    """
    plain(axes)
    reach = max(_LEAST_REACH, _ROOM * float(np.abs(change).max(initial=0.0)), _ROOM * float(np.median(np.abs(interval))))
    axes.axvline(0, color=INK, linewidth=1)
    for place, component in enumerate(components):
        limit = 100 * detectable.get(str(component), 0.0)
        if limit:
            axes.plot([-limit, -limit], [place - 0.3, place + 0.3], color=FAINT, linewidth=1.5)
        colour, marker = (MODE_COLOURS[1], "D") if str(component) in steps else (MODE_COLOURS[0], "o")
        axes.hlines(place, *interval[:, place], color=colour, linewidth=3)
        axes.plot(change[place], place, marker, color=colour, markersize=5)
        for is_beyond, end, arrow in (
            (interval[0, place] < -reach, -reach, CARETLEFT),
            (interval[1, place] > reach, reach, CARETRIGHT),
        ):
            if is_beyond:
                axes.plot(end, place, marker=arrow, color=colour, markersize=6, clip_on=False)
    names = [f"{component.corner.replace('_', ' ')} {component.kind}" for component in components]
    axes.set_yticks(range(len(components)), names, fontsize=SMALL)
    axes.set_ylim(len(components) - 0.4, -0.6)
    axes.set_xlim(-reach, reach)
    axes.set_xlabel("change against the baseline [%]", fontsize=NORMAL)
