"""Animated mode shapes: a GIF of all modes, or one HTML page on which they can be turned and chosen."""

from collections.abc import Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.animation import FuncAnimation, PillowWriter
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.figure import Figure
from matplotlib.patheffects import withStroke

from sprung._arrays import Complex, Indices, Real
from sprung._checks import check_one_of, freeze
from sprung._display import listed
from sprung.errors import ParameterError
from sprung.formats.nodes import nodes_of
from sprung.modal import Modes
from sprung.recording import Channel
from sprung.results.figures import draw
from sprung.results.figures.draw import STYLE, in_hertz, in_percent, mode_colour, mode_name
from sprung.results.figures.shapes import body_shapes, projected

ENDINGS = (".gif", ".html")


@dataclass(frozen=True, eq=False, slots=True)
class Scene:
    """What moves in an animation.

    Parameters
    ----------
    positions
        Positions at rest [m], shape (points, 3).
    motions
        Motion of the points in each mode, of any scale, shape (modes, points, 3), complex.
    lines
        Pairs of points with a line between them, shape (lines, 2).
    face
        Points of a surface in their order; empty for none.
    names
        Channels at each point; empty for a corner of the body without a sensor.
    remark
        What is drawn, in words.
    has_metres
        Whether positions are in metres; otherwise channels stand side by side.
    """

    positions: Real
    motions: Complex
    lines: Indices
    face: tuple[int, ...]
    names: tuple[str, ...]
    remark: str
    has_metres: bool

    def __post_init__(self) -> None:
        freeze(self, positions=2)
        freeze(self, motions=3, dtype=np.complex128)
        freeze(self, lines=2, dtype=np.intp)

    @property
    def size(self) -> float:
        """Largest distance between two sides of the box around the points [m], at least one thousandth."""
        return max(float(np.ptp(self.positions, axis=0).max()), 1e-3)

    def flat(self, points: Real) -> Real:
        """Return points as the picture shows them: from the right and above, or from the side, shape (points, 2)."""
        return projected(points) if self.has_metres else points[:, [0, 2]]

    def limits(self) -> tuple[Real, Real]:
        """Return the lower left and the upper right corner of a picture that holds all motion and the axes."""
        rest, reach = self.flat(self.positions), 1.25 * STYLE.animated * self.size
        low, high = rest.min(axis=0) - reach, rest.max(axis=0) + reach
        return low - np.array([0.0, 0.12 * self.size]), high

    def scaled_motions(self) -> Complex:
        """Return the motions in metres of the picture: each mode's largest one is a fixed share of the size."""
        largest = np.abs(self.motions).max(axis=(1, 2), initial=0.0)
        return self.motions * (STYLE.animated * self.size / np.where(largest == 0, 1.0, largest))[:, None, None]


def scene_of(modes: Modes, channels: Sequence[Channel]) -> Scene:
    """Return what moves: the plate of a rigid body with its sensors, or the nodes of a structure and lines between.

    Parameters
    ----------
    modes
        Modes of `channels`.
    channels
        Channels in the order of the mode shapes.
    """
    nodes = nodes_of(modes, channels)
    body = body_shapes(modes, channels)
    if body is not None:
        up = np.array([0.0, 0.0, 1.0])
        corners = body.corner_motions[..., None] * up
        outline = "The outline is nominal." if body.is_nominal else "The outline is that of the sensors."
        return Scene(
            positions=np.concatenate([body.corners, nodes.positions]) if nodes.is_placed else body.corners,
            motions=np.concatenate([corners, nodes.motions], axis=1) if nodes.is_placed else corners,
            lines=np.array([(0, 1), (1, 2), (2, 3), (3, 0)]),
            face=(0, 1, 2, 3),
            names=("",) * 4 + (tuple(map(listed, nodes.channels)) if nodes.is_placed else ()),
            remark=f"Plate: rigid-body motion. Points: sensors. {outline} x points forward.",
            has_metres=True,
        )
    remark = "Points move along the directions of their channels; lines join neighbours."
    if not nodes.is_placed:
        remark = "Positions are unknown: channels stand side by side."
    if nodes.left_out:
        remark += f" Not drawn: {listed(nodes.left_out)}."
    names = tuple(map(listed, nodes.channels))
    return Scene(nodes.positions, nodes.motions, nodes.lines, (), names, remark, nodes.is_placed)


def save_animation(modes: Modes, channels: Sequence[Channel], path: str | PathLike[str], *, source: str = "") -> None:
    """Write animated mode shapes.

    Parameters
    ----------
    modes
        Modes of `channels`, at least one.
    channels
        Channels with positions and directions; without any, they stand side by side.
    path
        Path of the file: .gif for a picture of all modes, .html for a page that needs nothing else. An existing one is
        replaced.
    source
        Name of the recording, for the heading.

    Raises
    ------
    ParameterError
        If the ending is another one, there is no mode, or no channel can be drawn.

    Notes
    -----
    A point moves by Re(shape exp(i phase)); all modes take the same time for a cycle. Complex shapes travel.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "modes.html")
    ...     save_animation(identification.modes, identification.channels, path)
    ...     "<canvas" in path.read_text(encoding="utf-8")
    True
    """
    path = Path(path)
    check_one_of("ending", path.suffix.lower(), ENDINGS, advice="animations are .gif or .html")
    if not len(modes):
        raise ParameterError("there is no mode to animate")
    scene = scene_of(modes, channels)
    if not scene.positions.size:
        raise ParameterError("no channel can be drawn: animated shapes need a channel of translation")
    if path.suffix.lower() == ".html":
        path.write_text(animation_page(modes, scene, source=source), encoding="utf-8")
        return
    figure, update = animated_figure(modes, scene, source=source)
    movie = FuncAnimation(figure, update, frames=STYLE.frames, blit=False)
    movie.save(path, writer=PillowWriter(fps=STYLE.frame_rate), dpi=STYLE.screen)


def animated_figure(modes: Modes, scene: Scene, *, source: str = "") -> tuple[Figure, Any]:
    """Return the figure of all modes, and the function that moves it to a frame, from 0 to 23."""
    n_rows, n_columns = draw.panel_grid(len(modes), max_columns=3)
    width = max(3.6 * n_columns, 6.0)
    where = f"{scene.remark} Grey: at rest. Every mode takes two seconds for a cycle."
    low, high = scene.limits()
    picture = float(np.clip(width / n_columns * (high - low)[1] / (high - low)[0], 1.2, 4.5))
    figure = draw.new_figure("Mode shapes", where, width=width, height=(picture + 0.6) * n_rows + 1.0, source=source)
    motions = scene.scaled_motions()
    panels = figure.subplots(n_rows, n_columns, squeeze=False).ravel()
    for axes in panels:
        axes.set_axis_off()
    moves = [_draw(axes, modes, scene, motions[k], k) for k, axes in enumerate(panels[: len(modes)])]

    def update(frame: int) -> list[Any]:
        return [artist for move in moves for artist in move(frame)]

    update(0)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")  # the layout is that of rest: to find it for each frame takes most of the time
    return figure, update


def _draw(axes: Axes, modes: Modes, scene: Scene, motions: Complex, index: int) -> Any:
    """Draw one mode at rest, and return the function that moves it to a frame."""
    colour, rest = mode_colour(index), scene.flat(scene.positions)
    axes.set_aspect("equal")
    title = f"Mode {mode_name(modes, index)}\n{_values(modes, index)}"
    draw.title(axes, title, colour=colour, y=1.0, loc="center")
    axes.set(xticks=[], yticks=[])  # hidden ticks and a title without a fixed height would be laid out in every frame
    axes.add_collection(LineCollection(list(rest[scene.lines]), colors="#C8C8C8", linewidths=1.0, zorder=1))
    axes.plot(*rest.T, linestyle="none", marker="o", markersize=2.5, color="#C8C8C8", zorder=1)
    face = PolyCollection([rest[list(scene.face)]] if scene.face else [], facecolors=colour, alpha=0.25, zorder=2)
    lines = LineCollection(list(rest[scene.lines]), colors=colour, linewidths=1.8, zorder=3)
    axes.add_collection(face)
    axes.add_collection(lines)
    named = [k for k, name in enumerate(scene.names) if name]
    (points,) = axes.plot([], [], linestyle="none", marker="o", markersize=4, color=STYLE.ink, zorder=4)
    low, high = scene.limits()
    axes.set(xlim=(low[0], high[0]), ylim=(low[1], high[1]))
    text: dict[str, Any] = {"ha": "center", "va": "top", "color": "#6B6B6B", "zorder": 1.5}
    for k in named if len(named) <= STYLE.max_nodes else ():
        outline = [withStroke(linewidth=2.0, foreground="white")]
        draw.note(axes, scene.names[k], rest[k], offset=(0, -5), path_effects=outline, **text)
    if scene.has_metres and index == 0:
        _draw_axes(axes, scene, low)

    def move(frame: int) -> list[Any]:
        moved = scene.flat(scene.positions + (motions * np.exp(2j * np.pi * frame / STYLE.frames)).real)
        if scene.face:
            face.set_verts([moved[list(scene.face)]])
        lines.set_segments(list(moved[scene.lines]))
        points.set_data(*moved[list(named)].T)
        return [face, lines, points]

    return move


def _values(modes: Modes, index: int) -> str:
    """Return frequency and damping of a mode with their standard deviations, where these are known."""
    frequency, ratio = in_hertz(modes.natural_frequency[index]), in_percent(modes.damping_ratio[index])
    frequency_std, ratio_std = modes.natural_frequency_std[index], 100 * modes.damping_ratio_std[index]
    if np.isfinite(frequency_std):
        frequency = frequency.replace(" Hz", f" ± {frequency_std:.1g} Hz")
    if np.isfinite(ratio_std):
        ratio = ratio.replace(" %", f" ± {ratio_std:.1g} %")
    return f"{frequency}, damping {ratio}"


def _draw_axes(axes: Axes, scene: Scene, corner: Real) -> None:
    """Draw the directions x, y and z with a length in metres in the lower left corner."""
    length = float(f"{0.2 * scene.size:.1g}")
    ends = projected(length * np.eye(3))
    origin = corner + np.array([0.06 * scene.size, 0.02 * scene.size]) - np.minimum(ends.min(axis=0), 0)
    text: dict[str, Any] = {"fontsize": STYLE.small, "color": STYLE.faint, "va": "center"}
    for name, end in zip("xyz", ends, strict=True):
        axes.plot(*np.stack([origin, origin + end], axis=1), color=STYLE.faint, linewidth=1.2, zorder=5)
        x, y = (origin + 1.25 * end).tolist()
        axes.text(x, y, name, ha="center", zorder=5, **text)
    x = float(origin[0] + 0.12 * scene.size + max(ends[:, 0].max(), 0.0))
    axes.text(x, float(origin[1]) - 0.02 * scene.size, f"{length:g} m each", **text)


def animation_page(modes: Modes, scene: Scene, *, source: str = "") -> str:
    """Return the HTML page of animated modes: drawn on a canvas by a script of its own, without any other file."""
    from jinja2 import Environment

    motions = scene.scaled_motions()
    content = {
        "positions": scene.positions.round(9).tolist(),
        "lines": scene.lines.tolist(),
        "face": list(scene.face),
        "names": list(scene.names),
        "size": scene.size,
        "hasMetres": scene.has_metres,
        "modes": [
            {
                "name": mode_name(modes, k),
                "short": f"{mode_name(modes, k)}: {in_hertz(modes.natural_frequency[k])}",
                "values": _values(modes, k),
                "mpc": f"{modes.mpc[k]:.2f}",
                "colour": mode_colour(k),
                "real": motions[k].real.round(9).tolist(),
                "imag": motions[k].imag.round(9).tolist(),
            }
            for k in range(len(modes))
        ],
    }
    template = Path(__file__).with_name("templates") / "animation.html"
    page = Environment(autoescape=True).from_string(template.read_text(encoding="utf-8"))
    heading = f"Mode shapes: {source}" if source else "Mode shapes"
    return page.render(heading=heading, remark=scene.remark, content=content)
