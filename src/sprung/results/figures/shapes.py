"""Mode shapes: on the body if the sensors' positions are known, otherwise as bars; and their complexity."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch
from matplotlib.patheffects import withStroke
from matplotlib.projections.polar import PolarAxes

from sprung._arrays import Complex, Indices, Real
from sprung.modal import Modes
from sprung.recording import Channel
from sprung.results.figures import draw
from sprung.results.figures.draw import STYLE, mode_colour, mode_name, mode_values, pretty_unit
from sprung.vehicles import sensor_outputs
from sprung.vehicles.labels import MOTIONS, rigid_body_participation

#: Half length and half width of a plate whose sensors do not span one [m].
NOMINAL_EXTENT = (1.3, 0.75)


@dataclass(frozen=True, eq=False, slots=True)
class BodyShapes:
    """Mode shapes as motions of the body.

    Parameters
    ----------
    corners
        Corners of the plate [m], shape (4, 3): front left, front right, rear right, rear left.
    corner_motions
        Vertical acceleration of the corners in the rigid-body motion of each mode, relative to the channel of modulus
        1, shape (modes, 4), complex.
    sensor_motions
        Acceleration of each sensor along its direction, shape (modes, channels), complex; NaN for a sensor of
        rotations.
    explained
        Share of each shape's sum of squares that the rigid body explains, shape (modes,).
    is_nominal
        Whether the outline of the plate is nominal, since the sensors do not span it.
    """

    corners: Real
    corner_motions: Complex
    sensor_motions: Complex
    explained: Real
    is_nominal: bool


def body_shapes(modes: Modes, channels: Sequence[Channel]) -> BodyShapes | None:
    """Return the motion of the body's corners and sensors in each mode.

    Parameters
    ----------
    modes
        Modes of `channels`.
    channels
        Channels with quantity, position and direction.

    Returns
    -------
    BodyShapes or None
        Motions; None if the channels do not determine bounce, pitch and roll.

    Notes
    -----
    Each shape is fitted by least squares with the signals that bounce z, pitch p and roll r cause in the sensors at
    its pole; the point (x, y) then moves by z - x p + y r. Velocities, displacements and angles are converted to
    accelerations with powers of the pole, so that one figure shows all of them.
    """
    shares, explained = rigid_body_participation(modes, channels)
    if not len(modes) or np.isnan(shares).any():
        return None
    outputs = sensor_outputs(MOTIONS, sensors=channels, carriers=["body"] * len(channels))
    corners, is_nominal = _plate(channels)
    lever = np.column_stack([np.ones(4), -corners[:, 0], corners[:, 1]])
    corner_motions, sensor_motions = [], []
    for pole, shape in zip(modes.poles, modes.mode_shapes, strict=True):
        read = outputs.acceleration * pole**2 + outputs.velocity * pole + outputs.displacement
        corner_motions.append(lever @ np.linalg.lstsq(read, shape, rcond=None)[0] * pole**2)
        factors = {"acceleration": 1.0, "velocity": pole, "displacement": pole**2}
        sensor_motions.append([factors.get(c.quantity, np.nan) * v for c, v in zip(channels, shape, strict=True)])
    return BodyShapes(corners, np.array(corner_motions), np.array(sensor_motions), explained, is_nominal)


def _plate(channels: Sequence[Channel]) -> tuple[Real, bool]:
    """Return the corners of the rectangle around the sensors, and whether it had to be a nominal one."""
    places = np.array([channel.position for channel in channels if channel.position is not None] or [(0.0, 0.0, 0.0)])
    (low_x, low_y, _), (high_x, high_y, _) = places.min(axis=0), places.max(axis=0)
    is_nominal = bool(min(high_x - low_x, high_y - low_y) < 1e-3 * max(NOMINAL_EXTENT))
    if is_nominal:
        (high_x, high_y), (low_x, low_y) = NOMINAL_EXTENT, (-NOMINAL_EXTENT[0], -NOMINAL_EXTENT[1])
    z = float(places[:, 2].mean())
    return np.array([[high_x, high_y, z], [high_x, low_y, z], [low_x, low_y, z], [low_x, high_y, z]]), is_nominal


def projected(points: Real) -> Real:
    """Return points, shape (..., 3), as seen from the right and above (parallel projection), shape (..., 2)."""
    azimuth, elevation = np.radians(STYLE.azimuth), np.radians(STYLE.elevation)
    right = np.array([-np.sin(azimuth), np.cos(azimuth), 0.0])
    up = np.array(
        [-np.sin(elevation) * np.cos(azimuth), -np.sin(elevation) * np.sin(azimuth), np.cos(elevation)],
    )
    return np.stack([points @ right, points @ up], axis=-1)


def draw_body(axes: Axes, shapes: BodyShapes, index: int, channels: Sequence[Channel], values: Complex) -> None:
    """Draw one mode at the instant at which its largest channel peaks.

    Parameters
    ----------
    axes
        Empty axes.
    shapes, index
        Shapes of all modes, and index of the one to draw.
    channels
        Channels of the shapes.
    values
        Mode shape, shape (channels,), whose amplitudes and phases are written at the sensors.
    """
    axes.set_axis_off()
    axes.set_aspect("equal")
    rest, motion = shapes.corners, shapes.corner_motions[index].real
    sensed = shapes.sensor_motions[index].real
    size = (np.ptp(rest[:, 0]) + np.ptp(rest[:, 1])) / 2
    scale = STYLE.displacement * size / max(np.abs(motion).max(), np.nanmax(np.abs(sensed), initial=0.0), 1e-12)
    _draw_plate(axes, rest, scale * motion, mode_colour(index))
    at_sensor = _with_room(channels, sensed)
    texts = [f"{channel.name} {amplitude_and_phase(values[k])}" for k, channel in enumerate(channels)]
    for k in (int(row) for row in np.flatnonzero(np.isfinite(sensed))):
        text = "\n".join(texts[k].split(" ", 1)) if k in at_sensor else ""
        _draw_sensor(axes, channels[k], scale * float(sensed[k]), text, STYLE.shortest_arrow * size)
    below = [text for k, text in enumerate(texts) if k not in at_sensor]
    rows = ["    ".join(below[first : first + 3]) for first in range(0, len(below), 3)]
    style: dict[str, Any] = {"ha": "center", "va": "bottom", "fontsize": STYLE.small, "color": STYLE.ink}
    axes.text(0.5, 0.0, "\n".join(rows), transform=axes.transAxes, **style)
    flat = projected(rest)
    low, high = flat.min(axis=0), flat.max(axis=0)
    reach = STYLE.displacement * size * np.cos(np.radians(STYLE.elevation)) + STYLE.two_lines * size
    axes.set_xlim(low[0] - STYLE.two_lines * size, high[0] + STYLE.two_lines * size)
    axes.set_ylim(low[1] - reach - len(rows) * STYLE.two_lines / 2 * size, high[1] + reach)


def _draw_plate(axes: Axes, rest: Real, motion: Real, colour: str) -> None:
    """Draw the plate at rest in grey and displaced in colour, and an arrow to the front of the body."""
    flat = projected(rest)
    raised = projected(rest + np.column_stack([np.zeros((4, 2)), motion]))
    axes.fill(*flat.T, facecolor="#F0F0F0", edgecolor=STYLE.faint, linewidth=1.0, gid="rest", zorder=1)
    for ends in np.stack([flat, raised], axis=1):
        axes.plot(*ends.T, color=colour, linewidth=0.7, linestyle=":", zorder=1.5)
    axes.fill(*raised.T, facecolor=colour, alpha=0.28, linewidth=0, zorder=2)
    axes.fill(*raised.T, facecolor="none", edgecolor=colour, linewidth=1.8, gid="moved", zorder=2.1)
    front, rear = rest[:2].mean(axis=0), rest[2:].mean(axis=0)
    tail, tip = projected(np.array([0.75 * front + 0.25 * rear, 0.96 * front + 0.04 * rear]))
    arrow = {"arrowstyle": "->", "color": STYLE.faint, "linewidth": 1.2, "shrinkA": 1, "shrinkB": 0}
    text: dict[str, Any] = {"ha": "right", "va": "center", "fontsize": STYLE.small, "color": "#6B6B6B"}
    axes.annotate("front", xy=tuple(tip), xytext=tuple(tail), arrowprops=arrow, zorder=2.5, **text)


def _with_room(channels: Sequence[Channel], sensed: Real) -> set[int]:
    """Return the channels whose values fit next to their sensors: few, and no two at one position."""
    placed = [int(k) for k in np.flatnonzero(np.isfinite(sensed))]
    places = {channels[k].position for k in placed}
    return set(placed) if len(places) == len(placed) <= STYLE.max_texts else set()


def _draw_sensor(axes: Axes, channel: Channel, length: float, text: str, shortest: float) -> None:
    """Draw an arrow along a sensor's direction, with a text at its tip."""
    foot = np.array(channel.position)
    start, end = projected(foot), projected(foot + length * np.array(channel.direction))
    axes.plot(*start, marker="o", markersize=3, color=STYLE.ink, zorder=3)
    if np.hypot(*(end - start)) > shortest:
        head = {"arrowstyle": "-|>", "color": STYLE.ink, "linewidth": 1.3, "mutation_scale": 8}
        arrow = {**head, "shrinkA": 0, "shrinkB": 0}
        axes.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops=arrow, gid="sensor", zorder=4)
    side, place = (3, "bottom") if end[1] >= start[1] else (-3, "top")
    outline = [withStroke(linewidth=2.5, foreground="white")]
    draw.note(axes, text, tuple(end), offset=(0, side), ha="center", va=place, zorder=5, path_effects=outline)


def amplitude_and_phase(value: complex) -> str:
    """Return amplitude and phase of a complex number as text, such as "0.82, −12°".

    Examples
    --------
    >>> amplitude_and_phase(-0.5), amplitude_and_phase(1j)
    ('0.50, 180°', '1.00, 90°')
    """
    phase = round(float(np.degrees(np.angle(value))))
    return f"{abs(value):.2f}, {180 if phase == -180 else phase}°".replace("-", "−")


_MARKERS = "os^DvP*X"
_OF_QUANTITY = " of the same quantity"


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
    if not len(modes):
        return draw.sentence(draw.new_figure("Mode shapes", width=8, height=3, source=source), STYLE.no_mode)
    shapes = body_shapes(modes, channels)
    return _bars(modes, channels, source) if shapes is None else _bodies(modes, channels, shapes, source)


def _bodies(modes: Modes, channels: Sequence[Channel], shapes: BodyShapes, source: str) -> Figure:
    n_rows, n_columns = draw.panel_grid(len(modes), max_columns=3)
    where = "Grey: at rest. Plate: rigid-body motion. Arrows: sensor signals (amplitude, phase)."
    where += " The outline is nominal." if shapes.is_nominal else ""
    width = max(1.28 * 3.4 * n_columns, 8.5)
    figure = draw.new_figure("Mode shapes", where, width=width, height=1.2 + 3.1 * n_rows, source=source)
    for k, axes in enumerate(draw.panels(figure, n_rows, n_columns, n_used=len(modes)).flat[: len(modes)]):
        draw_body(axes, shapes, k, channels, modes.mode_shapes[k])
        _name(axes, modes, k, f"rigid body explains {100 * shapes.explained[k]:.0f} %, MPC {modes.mpc[k]:.2f}")
    return figure


def _bars(modes: Modes, channels: Sequence[Channel], source: str) -> Figure:
    """Draw real and imaginary part of each channel in each mode, channels of one quantity side by side."""
    groups = _quantities(channels)
    order = np.concatenate(groups)
    names = [modes.channels[row] for row in order]
    is_wide = len(names) > STYLE.many_channels
    n_rows, n_columns = draw.panel_grid(len(modes), max_columns=2 if is_wide else 4 if len(groups) == 1 else 3)
    width = max((1.9 if is_wide else 1.0) * 3.4 * n_columns, 7.0)
    where = f"Relative to the largest channel{_OF_QUANTITY if len(groups) > 1 else ''}"
    height = 1.6 + 2.4 * n_rows + 0.07 * max(map(len, names))
    figure = draw.new_figure("Mode shapes", where, width=width, height=height, source=source)
    for k, axes in enumerate(draw.panels(figure, n_rows, n_columns, n_used=len(modes)).flat[: len(modes)]):
        _draw_bars(axes, _relative(modes.mode_shapes[k], groups)[order], mode_colour(k))
        is_lowest = k + n_columns >= len(modes)
        _label_channels(axes, names if is_lowest else [""] * len(names), 0.75 * width / n_columns)
        axes.set_ylim(-1.15, 1.15 if len(groups) == 1 else STYLE.with_scales)
        _name(axes, modes, k, f"MPC {modes.mpc[k]:.2f}")
        if len(groups) > 1:
            _draw_scales(axes, modes.mode_shapes[k], channels, groups)
        if k % n_columns == 0:
            axes.set_ylabel("Amplitude [-]")
    diamond: dict[str, Any] = {"marker": "D", "markerfacecolor": "white", "linestyle": "none"}
    real = Patch(facecolor=STYLE.faint, label="real part (mode's colour)")
    draw.legend(figure, [real, draw.entry("imaginary part", color=STYLE.ink, **diamond)], n_columns=2)
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
        axes.axvline(edge, color=STYLE.ink, linewidth=0.8, linestyle=(0, (3, 2)))
    axes.set_yticks([-1, -0.5, 0, 0.5, 1])
    for rows, left, right in zip(groups, edges, edges[1:], strict=False):
        quantity = channels[rows[0]].quantity.replace("unknown", "as recorded").replace("_", " ")
        size = f"{np.abs(shape[rows]).max():.2g} {pretty_unit(channels[rows[0]].unit)}".rstrip()
        style: dict[str, Any] = {
            "ha": "center",
            "va": "top",
            "fontsize": STYLE.small - 1,
            "color": STYLE.ink,
            "gid": "scale",
        }
        axes.text((left + right) / 2, STYLE.with_scales - 0.05, f"{quantity}\n1 = {size}", **style)


def _draw_bars(axes: Axes, shape: Complex, colour: str) -> None:
    """Draw real parts as bars and imaginary parts as diamonds."""
    places = np.arange(len(shape))
    axes.bar(places, shape.real, width=0.7, color=colour, alpha=0.85)
    size = 5 if len(shape) <= STYLE.many_channels else 3
    style: dict[str, Any] = {"marker": "D", "markersize": size, "markerfacecolor": "white", "linestyle": "none"}
    axes.plot(places, shape.imag, color=STYLE.ink, markeredgewidth=0.9, gid="imaginary part", **style)
    axes.axhline(0, color=STYLE.ink, linewidth=0.8)


def _label_channels(axes: Axes, names: Sequence[str], width: float) -> None:
    """Write the names of the channels below the axis, vertically if they are long, and every n-th of very many."""
    step = -(-len(names) // STYLE.max_ticks)
    longest = max(len(name) for name in names)
    is_upright = longest * len(names) * 0.6 * STYLE.small / 72 > width
    axes.set_xticks(range(0, len(names), step), names[::step], rotation=90 if is_upright else 0, fontsize=STYLE.small)
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
    what = "Complexity of the mode shapes"
    if not len(modes):
        return draw.sentence(draw.new_figure(what, width=8, height=3, source=source), STYLE.no_mode)
    groups = _quantities(channels) if channels else [np.arange(len(modes.channels))]
    has_markers = len(modes.channels) <= len(_MARKERS)
    n_rows, n_columns = draw.panel_grid(len(modes), max_columns=4 if has_markers else 3)
    where = "Radius: amplitude relative to the largest channel. Angle: phase relative to it."
    if len(groups) > 1:
        where = where.replace("channel.", f"channel{_OF_QUANTITY}.").replace("to it", "to the largest of all")
    where += "" if has_markers else f" Named: the {STYLE.max_named} largest."
    width = max((2.9 if has_markers else 4.2) * n_columns, 7.5)
    figure = draw.new_figure(what, where, width=width, height=1.4 + 2.9 * n_rows, source=source)
    for k in range(len(modes)):
        axes = cast(PolarAxes, figure.add_subplot(n_rows, n_columns, k + 1, projection="polar"))
        shape = _relative(modes.mode_shapes[k], groups)
        _draw_compass(axes, shape, mode_colour(k))
        if not has_markers:
            _name_largest(axes, modes.channels, shape)
        _name(axes, modes, k, f"MPC {modes.mpc[k]:.2f}")
    if has_markers:
        white: dict[str, Any] = {"color": STYLE.faint, "markerfacecolor": "white"}
        named = zip(_MARKERS, modes.channels, strict=False)
        draw.legend(figure, [draw.entry(name, marker=marker, **white) for marker, name in named], n_columns=8)
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
    axes.set_thetagrids(range(0, 360, 90), labels, fontsize=STYLE.small)


def _name_largest(axes: Axes, names: Sequence[str], shape: Complex) -> None:
    """Write the names of the largest channels to the left and right of a compass, with lines to their arrows."""
    largest = np.argsort(-np.abs(shape), kind="stable")[: STYLE.max_named]
    line = {"arrowstyle": "-", "color": STYLE.faint, "linewidth": 0.6, "shrinkA": 1, "shrinkB": 2}
    for side, place in ((1, "left"), (-1, "right")):
        rows = largest[(shape[largest].real >= 0) == (side > 0)]
        rising = rows[np.argsort(shape[rows].imag, kind="stable")]
        text: dict[str, Any] = {"ha": place, "va": "center", "fontsize": STYLE.small, "color": STYLE.ink, "gid": "name"}
        for row, height in zip(rising, draw.spread((1 + shape[rising].imag) / 2, 0.075), strict=True):
            ends: dict[str, Any] = {
                "xy": ((1 + float(shape[row].real)) / 2, (1 + float(shape[row].imag)) / 2),
                "xytext": (0.5 + side * 0.55, float(height)),
            }
            axes.annotate(
                names[row], **ends, xycoords="axes fraction", textcoords="axes fraction", arrowprops=line, **text
            )


def _name(axes: Axes, modes: Modes, index: int, remark: str) -> None:
    """Write number, name, frequency and damping of a mode above its panel, and a remark below them."""
    title = f"{mode_name(modes, index)}: {mode_values(modes, index)}\n{remark}"
    draw.title(axes, title, colour=mode_colour(index), fontweight="bold", loc="center")


def plain_shapes_figure(modes: Modes) -> Figure:
    """Return mode shapes of channels whose places are not known."""
    return shapes_figure(modes, [Channel(name) for name in modes.channels])
