"""Mode shapes: on the body if the sensors' positions are known, otherwise as bars; and their complexity."""

from collections.abc import Sequence
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.projections.polar import PolarAxes

from sprung._arrays import Complex
from sprung.modal import Modes
from sprung.plotting.body import BodyShapes, body_shapes, draw_body
from sprung.plotting.style import (
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
    write_sentence,
)
from sprung.recording import Channel

#: With more channels than this, panels are wide, and channels carry no markers of their own.
_MANY_CHANNELS, _MARKERS = 12, "os^DvP*X"
_MOST_TICKS = 40
_COLUMN = 3.4


def shapes_figure(modes: Modes, channels: Sequence[Channel], *, source: str = "") -> Figure:
    """Draw the mode shapes.

    Parameters
    ----------
    modes
        Modes to draw, in any number.
    channels
        Channels of `modes`, in their order. If their quantities, positions and directions determine bounce, pitch and
        roll, the body is drawn; otherwise real and imaginary parts of each channel.
    source
        Name of the recording, for the heading.

    Notes
    -----
    Shapes are 1 at their largest channel, and the body is drawn at the instant at which that channel peaks: the plate
    shows the rigid-body motion fitted by least squares, the arrows the signals of the sensors.
    """
    what = f"Mode shapes: {source}" if source else "Mode shapes"
    if not len(modes):
        return write_sentence(new_figure(what, "", width=8, height=3), NO_MODE)
    shapes = body_shapes(modes, channels)
    return _bars(modes, what) if shapes is None else _bodies(modes, channels, shapes, what)


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


def _bars(modes: Modes, what: str) -> Figure:
    """Draw real and imaginary part of each channel in each mode."""
    is_wide = len(modes.channels) > _MANY_CHANNELS
    n_rows, n_columns = panel_grid(len(modes), most_columns=2 if is_wide else 4)
    width = max((1.9 if is_wide else 1.0) * _COLUMN * n_columns, 7.0)
    longest = max(len(name) for name in modes.channels)
    figure = new_figure(
        what, "Relative to the largest channel", width=width, height=1.6 + 2.4 * n_rows + 0.07 * longest
    )
    for k, axes in enumerate(_panels(figure, n_rows, n_columns, len(modes))):
        plain(axes)
        _draw_bars(axes, modes.mode_shapes[k], mode_colour(k))
        is_lowest = k + n_columns >= len(modes)
        _label_channels(axes, modes.channels if is_lowest else [""] * len(modes.channels), 0.75 * width / n_columns)
        axes.set_ylim(-1.15, 1.15)
        _name(axes, modes, k, f"MPC {modes.mpc[k]:.2f}")
        if k % n_columns == 0:
            axes.set_ylabel("Amplitude [-]", fontsize=NORMAL)
    handles: list[Patch | Line2D] = [
        Patch(facecolor=FAINT, label="real part (mode's colour)"),
        Line2D([], [], color=INK, marker="D", markerfacecolor="white", linestyle="none", label="imaginary part"),
    ]
    figure.legend(handles=handles, loc="outside lower center", ncols=2, fontsize=SMALL, frameon=False)
    return figure


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


def complexity_figure(modes: Modes, *, source: str = "") -> Figure:
    """Draw each mode shape as arrows in the complex plane ("compass").

    Parameters
    ----------
    modes
        Modes to draw, in any number. Arrows on one line mean that all channels move in phase or in antiphase (MPC 1).
    source
        Name of the recording, for the heading.
    """
    what = f"Complexity of the mode shapes: {source}" if source else "Complexity of the mode shapes"
    if not len(modes):
        return write_sentence(new_figure(what, "", width=8, height=3), NO_MODE)
    n_rows, n_columns = panel_grid(len(modes), most_columns=4)
    where = "Radius: amplitude relative to the largest channel. Angle: phase relative to it."
    figure = new_figure(what, where, width=max(2.9 * n_columns, 7.5), height=1.4 + 2.9 * n_rows)
    for k in range(len(modes)):
        axes = figure.add_subplot(n_rows, n_columns, k + 1, projection="polar")
        _draw_compass(cast(PolarAxes, axes), modes.mode_shapes[k], mode_colour(k))
        _name(axes, modes, k, f"MPC {modes.mpc[k]:.2f}")
    if len(modes.channels) <= len(_MARKERS):
        handles = [
            Line2D([], [], color=FAINT, marker=marker, markerfacecolor="white", label=name)
            for marker, name in zip(_MARKERS, modes.channels, strict=False)
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=8, fontsize=SMALL, frameon=False)
    return figure


def _draw_compass(axes: PolarAxes, shape: Complex, colour: str) -> None:
    """Draw an arrow from the centre for each channel."""
    has_markers = len(shape) <= len(_MARKERS)
    for k, value in enumerate(shape):
        marker: dict[str, Any] = {"marker": _MARKERS[k], "markersize": 6, "markevery": [1]} if has_markers else {}
        line = axes.plot([0, np.angle(value)], [0, abs(value)], color=colour, linewidth=1.5, gid="channel", **marker)
        line[0].set(markerfacecolor="white", markeredgewidth=1.2, clip_on=False)
    axes.set_rlim(0, 1.0)
    axes.set_rticks([0.5, 1.0], labels=[])
    axes.set_thetagrids(range(0, 360, 90), ["0°", "90°", "180°", "−90°"], fontsize=SMALL)


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
