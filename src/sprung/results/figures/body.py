"""Mode shapes on the body: a plate through the sensors with the rigid-body motion."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.patheffects import withStroke

from sprung._arrays import Complex, Real
from sprung.modal import Modes
from sprung.results.figures.style import FAINT, INK, SMALL, mode_colour
from sprung.recording import Channel
from sprung.vehicles import sensor_outputs
from sprung.vehicles.labels import MOTIONS, rigid_body_participation

#: Azimuth and elevation of the view: from the right and slightly ahead, above the body [degrees].
_AZIMUTH, _ELEVATION = -62.0, 24.0
#: Largest displacement over the mean of the plate's length and width.
_AMPLITUDE = 0.28
#: Shortest arrow drawn, and height of two lines of text, over the same mean.
_SHORTEST, _TEXT_HEIGHT = 0.05, 0.15
#: Half length and half width of a plate whose sensors do not span one [m].
NOMINAL_EXTENT = (1.3, 0.75)
_MOST_TEXTS = 6


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
    azimuth, elevation = np.radians(_AZIMUTH), np.radians(_ELEVATION)
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
    scale = _AMPLITUDE * size / max(np.abs(motion).max(), np.nanmax(np.abs(sensed), initial=0.0), 1e-12)
    _draw_plate(axes, rest, scale * motion, mode_colour(index))
    _draw_front(axes, rest)
    at_sensor = _with_room(channels, sensed)
    for k in (int(row) for row in np.flatnonzero(np.isfinite(sensed))):
        text = f"{channels[k].name}\n{amplitude_and_phase(values[k])}" if k in at_sensor else ""
        _draw_sensor(axes, channels[k], scale * float(sensed[k]), text, _SHORTEST * size)
    listed_below = [
        f"{channel.name} {amplitude_and_phase(values[k])}" for k, channel in enumerate(channels) if k not in at_sensor
    ]
    rows = ["    ".join(listed_below[first : first + 3]) for first in range(0, len(listed_below), 3)]
    axes.text(0.5, 0.0, "\n".join(rows), transform=axes.transAxes, ha="center", va="bottom", fontsize=SMALL, color=INK)
    flat = projected(rest)
    low, high = flat.min(axis=0), flat.max(axis=0)
    reach = _AMPLITUDE * size * np.cos(np.radians(_ELEVATION)) + _TEXT_HEIGHT * size
    axes.set_xlim(low[0] - _TEXT_HEIGHT * size, high[0] + _TEXT_HEIGHT * size)
    axes.set_ylim(low[1] - reach - len(rows) * _TEXT_HEIGHT / 2 * size, high[1] + reach)


def _draw_plate(axes: Axes, rest: Real, motion: Real, colour: str) -> None:
    """Draw the plate at rest in grey and displaced in colour."""
    flat = projected(rest)
    raised = projected(rest + np.column_stack([np.zeros((4, 2)), motion]))
    axes.fill(*flat.T, facecolor="#F0F0F0", edgecolor=FAINT, linewidth=1.0, gid="rest", zorder=1)
    for ends in np.stack([flat, raised], axis=1):
        axes.plot(*ends.T, color=colour, linewidth=0.7, linestyle=":", zorder=1.5)
    axes.fill(*raised.T, facecolor=colour, alpha=0.28, linewidth=0, zorder=2)
    axes.fill(*raised.T, facecolor="none", edgecolor=colour, linewidth=1.8, gid="moved", zorder=2.1)


def _draw_front(axes: Axes, rest: Real) -> None:
    """Draw an arrow to the front of the body."""
    front, rear = rest[:2].mean(axis=0), rest[2:].mean(axis=0)
    tail, tip = projected(np.array([0.75 * front + 0.25 * rear, 0.96 * front + 0.04 * rear]))
    arrow = {"arrowstyle": "->", "color": FAINT, "linewidth": 1.2, "shrinkA": 1, "shrinkB": 0}
    axes.annotate(
        "front",
        xy=tuple(tip),
        xytext=tuple(tail),
        ha="right",
        va="center",
        fontsize=SMALL,
        color="#6B6B6B",
        arrowprops=arrow,
        zorder=2.5,
    )


def _with_room(channels: Sequence[Channel], sensed: Real) -> set[int]:
    """Return the channels whose values fit next to their sensors: few, and no two at one position."""
    placed = [int(k) for k in np.flatnonzero(np.isfinite(sensed))]
    places = {channels[k].position for k in placed}
    return set(placed) if len(places) == len(placed) <= _MOST_TEXTS else set()


def _draw_sensor(axes: Axes, channel: Channel, length: float, text: str, shortest: float) -> None:
    """Draw an arrow along a sensor's direction, with a text at its tip."""
    foot = np.array(channel.position)
    start, end = projected(foot), projected(foot + length * np.array(channel.direction))
    axes.plot(*start, marker="o", markersize=3, color=INK, zorder=3)
    if np.hypot(*(end - start)) > shortest:
        arrow = {"arrowstyle": "-|>", "color": INK, "linewidth": 1.3, "shrinkA": 0, "shrinkB": 0, "mutation_scale": 8}
        axes.annotate("", xy=tuple(end), xytext=tuple(start), arrowprops=arrow, gid="sensor", zorder=4)
    is_up = end[1] >= start[1]
    axes.annotate(
        text,
        xy=tuple(end),
        xytext=(0, 3 if is_up else -3),
        textcoords="offset points",
        ha="center",
        va="bottom" if is_up else "top",
        fontsize=SMALL,
        color=INK,
        zorder=5,
        path_effects=[withStroke(linewidth=2.5, foreground="white")],
    )


def amplitude_and_phase(value: complex) -> str:
    """Return amplitude and phase of a complex number as text, such as "0.82, −12°".

    Examples
    --------
    >>> amplitude_and_phase(-0.5), amplitude_and_phase(1j)
    ('0.50, 180°', '1.00, 90°')
    """
    phase = round(float(np.degrees(np.angle(value))))
    return f"{abs(value):.2f}, {180 if phase == -180 else phase}°".replace("-", "−")
