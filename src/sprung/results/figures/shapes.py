"""Mode shapes: on the body if the sensors' positions are known, otherwise as bars; and their complexity."""

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.projections.polar import PolarAxes

from sprung._arrays import Complex, Indices
from sprung.modal import Modes
from sprung.results.figures.body import BodyShapes, body_shapes, draw_body
from sprung.results.figures.style import (
    FAINT,
    INK,
    NO_MODE,
    NORMAL,
    SMALL,
    mode_colour,
    mode_name,
    mode_values,
    new_figure,
    panel_grid,
    plain,
    pretty_unit,
    spread,
    write_sentence,
)
from sprung.recording import Channel

#: With more channels than this, panels are wide, and channels carry no markers of their own.
_MANY_CHANNELS, _MARKERS = 12, "os^DvP*X"
_MOST_TICKS = 40
#: Largest channels of a compass of many that are named, distance of the names from its centre, and their distance over
#: its diameter.
_MOST_NAMED, _NAMED_AT, _LINE = 6, 0.55, 0.075
#: Upper end of an axis with the scales of several quantities, and their mention.
_WITH_SCALES, _OF_QUANTITY = 1.75, " of the same quantity"
_COLUMN = 3.4


def shapes_figure(modes: Modes, channels: Sequence[Channel], *, source: str = "") -> Figure:
    """Draw the mode shapes.

    Parameters
    ----------
    modes
        Modes to draw, in any number.
    channels
        Channels of `modes`, in their order. If their quantities, positions and directions determine bounce, pitch and
        roll, the body is drawn; otherwise real and imaginary parts of each channel, of several quantities (such as
        accelerations and rates of rotation) each relative to its own largest channel, which is stated.
    source
        Name of the recording, for the heading.

    Notes
    -----
    Shapes are 1 at their largest channel, and the body is drawn at the instant at which that channel peaks: the plate
    shows the rigid-body motion fitted by least squares, the arrows the signals of the sensors.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> figure = shapes_figure(identification.modes, identification.channels)
    >>> [axes.get_title().partition(":")[0] for axes in figure.axes], figure.axes[0].get_title().endswith("MPC 1.00")
    (['1', '2', '3'], True)
    """
    what = f"Mode shapes: {source}" if source else "Mode shapes"
    if not len(modes):
        return write_sentence(new_figure(what, "", width=8, height=3), NO_MODE)
    shapes = body_shapes(modes, channels)
    return _bars(modes, channels, what) if shapes is None else _bodies(modes, channels, shapes, what)


def _bodies(modes: Modes, channels: Sequence[Channel], shapes: BodyShapes, what: str) -> Figure:
    """Draw the body in each mode."""
    n_rows, n_columns = panel_grid(len(modes), most_columns=3)
    where = "Grey: at rest. Plate: rigid-body motion. Arrows: sensor signals (amplitude, phase)."
    if shapes.is_nominal:
        where += " The outline is nominal."
    width = max(1.28 * _COLUMN * n_columns, 8.5)
    figure = new_figure(what, where, width=width, height=1.2 + 3.1 * n_rows)
    for k, axes in enumerate(_panels(figure, n_rows, n_columns, len(modes))):
        draw_body(axes, shapes, k, channels, modes.mode_shapes[k])
        _name(axes, modes, k, f"rigid body explains {100 * shapes.explained[k]:.0f} %, MPC {modes.mpc[k]:.2f}")
    return figure


def _bars(modes: Modes, channels: Sequence[Channel], what: str) -> Figure:
    """Draw real and imaginary part of each channel in each mode, channels of one quantity side by side."""
    groups = _quantities(channels)
    order = np.concatenate(groups)
    names = [modes.channels[row] for row in order]
    is_wide = len(names) > _MANY_CHANNELS
    n_rows, n_columns = panel_grid(len(modes), most_columns=2 if is_wide else 4 if len(groups) == 1 else 3)
    width = max((1.9 if is_wide else 1.0) * _COLUMN * n_columns, 7.0)
    longest = max(map(len, names))
    where = f"Relative to the largest channel{_OF_QUANTITY if len(groups) > 1 else ''}"
    figure = new_figure(what, where, width=width, height=1.6 + 2.4 * n_rows + 0.07 * longest)
    for k, axes in enumerate(_panels(figure, n_rows, n_columns, len(modes))):
        plain(axes)
        _draw_bars(axes, _relative(modes.mode_shapes[k], groups)[order], mode_colour(k))
        is_lowest = k + n_columns >= len(modes)
        _label_channels(axes, names if is_lowest else [""] * len(names), 0.75 * width / n_columns)
        axes.set_ylim(-1.15, 1.15 if len(groups) == 1 else _WITH_SCALES)
        _name(axes, modes, k, f"MPC {modes.mpc[k]:.2f}")
        if len(groups) > 1:
            _draw_scales(axes, modes.mode_shapes[k], channels, groups)
        if k % n_columns == 0:
            axes.set_ylabel("Amplitude [-]", fontsize=NORMAL)
    handles: list[Patch | Line2D] = [
        Patch(facecolor=FAINT, label="real part (mode's colour)"),
        Line2D([], [], color=INK, marker="D", markerfacecolor="white", linestyle="none", label="imaginary part"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=SMALL, frameon=False)
    return figure


def _quantities(channels: Sequence[Channel]) -> list[Indices]:
    """Return the channels of each quantity, in the order of the first of each."""
    quantities = [channel.quantity for channel in channels]
    return [np.flatnonzero([own == quantity for own in quantities]) for quantity in dict.fromkeys(quantities)]


def _relative(shape: Complex, groups: Sequence[Indices]) -> Complex:
    """Return a shape with the channels of each quantity relative to the largest of them, in modulus."""
    relative = shape.copy()
    for rows in groups:
        relative[rows] /= np.abs(shape[rows]).max() or 1.0
    return relative


def _draw_scales(axes: Axes, shape: Complex, channels: Sequence[Channel], groups: Sequence[Indices]) -> None:
    """Write what 1 is for each quantity, where 1 is one unit of the largest channel, with lines between them."""
    edges = np.cumsum([0, *map(len, groups)]) - 0.5
    for edge in edges[1:-1]:
        axes.axvline(edge, color=INK, linewidth=0.8, linestyle=(0, (3, 2)))
    axes.set_yticks([-1, -0.5, 0, 0.5, 1])
    for rows, left, right in zip(groups, edges, edges[1:], strict=False):
        quantity = channels[rows[0]].quantity.replace("unknown", "as recorded").replace("_", " ")
        size = f"{np.abs(shape[rows]).max():.2g} {pretty_unit(channels[rows[0]].unit)}".rstrip()
        style: dict[str, Any] = {"ha": "center", "va": "top", "fontsize": SMALL - 1, "color": INK, "gid": "scale"}
        axes.text((left + right) / 2, _WITH_SCALES - 0.05, f"{quantity}\n1 = {size}", **style)


def _draw_bars(axes: Axes, shape: Complex, colour: str) -> None:
    """Draw real parts as bars and imaginary parts as diamonds."""
    places = np.arange(len(shape))
    axes.bar(places, shape.real, width=0.7, color=colour, alpha=0.85)
    size = 5 if len(shape) <= _MANY_CHANNELS else 3
    style: dict[str, Any] = {"marker": "D", "markersize": size, "markerfacecolor": "white", "linestyle": "none"}
    axes.plot(places, shape.imag, color=INK, markeredgewidth=0.9, gid="imaginary part", **style)
    axes.axhline(0, color=INK, linewidth=0.8)


def _label_channels(axes: Axes, names: Sequence[str], width: float) -> None:
    """Write the names of the channels below the axis, vertically if they are long, and every n-th of very many."""
    step = -(-len(names) // _MOST_TICKS)
    longest = max(len(name) for name in names)
    is_upright = longest * len(names) * 0.6 * SMALL / 72 > width
    axes.set_xticks(range(0, len(names), step), names[::step], rotation=90 if is_upright else 0, fontsize=SMALL)
    axes.grid(visible=False, axis="x")


def complexity_figure(modes: Modes, channels: Sequence[Channel] = (), *, source: str = "") -> Figure:
    """Draw each mode shape as arrows in the complex plane ("compass").

    Parameters
    ----------
    modes
        Modes to draw, in any number. Arrows on one line mean that all channels move in phase or in antiphase (MPC 1).
    channels
        Channels of `modes`, in their order: those of several quantities are each relative to their own largest channel.
        Empty: all of one quantity.
    source
        Name of the recording, for the heading.

    Notes
    -----
    Up to eight channels have markers of their own; of more, the largest ones of each mode are named.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> figure = complexity_figure(identification.modes, identification.channels)
    >>> [axes.get_title().partition(":")[0] for axes in figure.axes], figure.axes[0].get_title().endswith("MPC 1.00")
    (['1', '2', '3'], True)
    """
    what = f"Complexity of the mode shapes: {source}" if source else "Complexity of the mode shapes"
    if not len(modes):
        return write_sentence(new_figure(what, "", width=8, height=3), NO_MODE)
    groups = _quantities(channels) if channels else [np.arange(len(modes.channels))]
    has_markers = len(modes.channels) <= len(_MARKERS)
    n_rows, n_columns = panel_grid(len(modes), most_columns=4 if has_markers else 3)
    where = "Radius: amplitude relative to the largest channel. Angle: phase relative to it."
    if len(groups) > 1:
        where = where.replace("channel.", f"channel{_OF_QUANTITY}.").replace("to it", "to the largest of all")
    if not has_markers:
        where += f" Named: the {_MOST_NAMED} largest."
    panel = 2.9 if has_markers else 4.2
    figure = new_figure(what, where, width=max(panel * n_columns, 7.5), height=1.4 + 2.9 * n_rows)
    for k in range(len(modes)):
        axes = cast(PolarAxes, figure.add_subplot(n_rows, n_columns, k + 1, projection="polar"))
        shape = _relative(modes.mode_shapes[k], groups)
        _draw_compass(axes, shape, mode_colour(k))
        if not has_markers:
            _name_largest(axes, modes.channels, shape)
        _name(axes, modes, k, f"MPC {modes.mpc[k]:.2f}")
    if has_markers:
        handles = [
            Line2D([], [], color=FAINT, marker=marker, markerfacecolor="white", label=name)
            for marker, name in zip(_MARKERS, modes.channels, strict=False)
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=8, fontsize=SMALL, frameon=False)
    return figure


def _draw_compass(axes: PolarAxes, shape: Complex, colour: str) -> None:
    """Draw an arrow from the centre for each channel, with a dot at its tip where there are many."""
    has_markers = len(shape) <= len(_MARKERS)
    for k, value in enumerate(shape):
        marker = {"marker": _MARKERS[k], "markersize": 6} if has_markers else {"marker": "o", "markersize": 3}
        style: dict[str, Any] = {"linewidth": 1.5 if has_markers else 0.9, "markevery": [1], **marker}
        line = axes.plot([0, np.angle(value)], [0, abs(value)], color=colour, gid="channel", **style)
        line[0].set(markerfacecolor="white", markeredgewidth=1.2, clip_on=False)
    axes.set_rlim(0, 1.0)
    axes.set_rticks([0.5, 1.0], labels=[])
    labels = ["0°", "90°", "180°", "−90°"] if has_markers else ["", "90°", "", "−90°"]
    axes.set_thetagrids(range(0, 360, 90), labels, fontsize=SMALL)


def _name_largest(axes: Axes, names: Sequence[str], shape: Complex) -> None:
    """Write the names of the largest channels to the left and right of a compass, with lines to their arrows."""
    largest = np.argsort(-np.abs(shape), kind="stable")[:_MOST_NAMED]
    for side, rows in ((1, largest[shape[largest].real >= 0]), (-1, largest[shape[largest].real < 0])):
        rising = rows[np.argsort(shape[rows].imag, kind="stable")]
        heights = spread((1 + shape[rising].imag) / 2, _LINE)
        for row, height in zip(rising, heights, strict=True):
            axes.annotate(
                names[row],
                xy=((1 + float(shape[row].real)) / 2, (1 + float(shape[row].imag)) / 2),
                xytext=(0.5 + side * _NAMED_AT, float(height)),
                xycoords="axes fraction",
                textcoords="axes fraction",
                ha="left" if side > 0 else "right",
                va="center",
                fontsize=SMALL,
                color=INK,
                gid="name",
                arrowprops={"arrowstyle": "-", "color": FAINT, "linewidth": 0.6, "shrinkA": 1, "shrinkB": 2},
            )


def _panels(figure: Figure, n_rows: int, n_columns: int, n_used: int) -> list[Axes]:
    """Return the first axes of a grid and hide the rest."""
    panels = list(figure.subplots(n_rows, n_columns, squeeze=False).flat)
    for axes in panels[n_used:]:
        axes.set_axis_off()
    return panels[:n_used]


def _name(axes: Axes, modes: Modes, index: int, remark: str) -> None:
    """Write number, name, frequency and damping of a mode above its panel, and a remark below them."""
    axes.set_title(
        f"{mode_name(modes, index)}: {mode_values(modes, index)}\n{remark}",
        fontsize=NORMAL,
        color=mode_colour(index),
        fontweight="bold",
    )


def plain_shapes_figure(modes: Modes) -> Figure:
    """Return mode shapes of channels whose places are not known."""
    return shapes_figure(modes, [Channel(name) for name in modes.channels])
