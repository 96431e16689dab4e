"""What all figures are drawn with: headings, panels, legends, intervals, matrices, labels that do not overlap."""

import math
import textwrap
from collections.abc import Callable, Sequence
from io import BytesIO
from typing import Any, TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.image import AxesImage
from matplotlib.lines import Line2D
from matplotlib.markers import CARETDOWN, CARETLEFT, CARETRIGHT, CARETUP
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import isotonic_regression

from sprung._arrays import Real
from sprung.results.figures.style import STYLE
from sprung.vehicles import Component

AnyFigure = TypeVar("AnyFigure", bound=FigureBase)


class _Shown(Figure):
    """Figure that notebooks show by itself, as no window manager knows it."""

    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        self.savefig(buffer, format="png", dpi=STYLE.screen)
        return buffer.getvalue()


def new_figure(what: str, where: str = "", *, height: float, width: float = 9.5, source: str = "") -> Figure:
    """Return an empty figure of a size [in] with a heading and the origin of its data below."""
    figure = _Shown(figsize=(width, height), layout="constrained", facecolor="white")
    n_characters = int(width / (STYLE.character * STYLE.large / 72))
    lines = [
        line for part in (f"{what}: {source}" if source else what, where) for line in textwrap.wrap(part, n_characters)
    ]
    figure.suptitle("\n".join(lines), x=0.012, ha="left", fontsize=STYLE.large, color=STYLE.ink, linespacing=1.4)
    return figure


def sentence(figure: AnyFigure, sentence: str) -> AnyFigure:
    """Write a sentence in place of the panels of a figure."""
    write_in(figure.add_subplot(), sentence)
    return figure


def write_in(axes: Axes, sentence: str, *, size: float = STYLE.large) -> None:
    """Write a sentence in an otherwise empty panel."""
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": size, "color": STYLE.ink}
    axes.set_axis_off()
    axes.text(0.5, 0.5, sentence, transform=axes.transAxes, **style)


def panels(
    figure: FigureBase,
    n_rows: int = 1,
    n_columns: int = 1,
    *,
    n_used: int | None = None,
    size: float = STYLE.normal,
    **grid: Any,
) -> NDArray[Any]:
    """Return a grid of plain axes whose labels have a size; those beyond the number used are hidden."""
    every = figure.subplots(n_rows, n_columns, squeeze=False, **grid)
    for number, axes in enumerate(every.flat):
        plain(axes)
        axes.xaxis.label.set_size(size)
        axes.yaxis.label.set_size(size)
        if n_used is not None and number >= n_used:
            axes.set_axis_off()
    return every


def title(axes: Axes, title: str, *, colour: str = STYLE.ink, size: float = STYLE.normal, **style: Any) -> None:
    """Write the title of a panel."""
    axes.set_title(title, **{"fontsize": size, "color": colour, "loc": "left", **style})


def note(
    axes: Axes, text: str, place: tuple[float, float], *, offset: tuple[float, float] = (0, 0), **style: Any
) -> None:
    """Write a small text at a place of the data, moved by an offset in points."""
    style = {"fontsize": STYLE.small, "color": STYLE.ink, **style}
    axes.annotate(text, place, xytext=offset, textcoords="offset points", **style)


def legend(where: Axes | FigureBase, handles: Sequence[Any] | None = None, *, n_columns: int = 1, **style: Any) -> None:
    """Draw a legend without a frame: in a panel, or below all of them."""
    style = {"ncols": n_columns, "fontsize": STYLE.small, "frameon": False, **style}
    if isinstance(where, FigureBase):
        style = {"loc": "outside lower center", **style}
    if handles is not None:
        style["handles"] = handles
    where.legend(**style)


def entry(label: str, **style: Any) -> Line2D:
    """Return the entry of a legend for a line or a marker."""
    return Line2D([], [], label=label, **style)


def mark_frequencies(axes: Axes, marked: Sequence[tuple[str, float]], *, height: float) -> None:
    """Draw dotted lines at frequencies, with their names upright from the top (1) or the bottom (0) of the axes."""
    text: dict[str, Any] = {"rotation": 90, "ha": "right", "va": "top" if height > 0.5 else "bottom"}
    for name, frequency in marked:
        axes.axvline(frequency, color="#888888", linewidth=0.8, linestyle=":")
        if name:
            style = {"fontsize": STYLE.small, "color": "#555555", "transform": axes.get_xaxis_transform(), **text}
            axes.text(frequency, height, name, **style)


def intervals(
    axes: Axes,
    places: ArrayLike,
    values: Any,
    *,
    colour: str,
    marker: str = "o",
    size: float = 3.0,
    width: float = 1.0,
    opacity: float = 1.0,
    is_flat: bool = False,
    reach: float = math.inf,
    label: str | None = None,
) -> None:
    """Draw values with their intervals.

    Parameters
    ----------
    axes
        Axes to draw on.
    places
        Places on the other axis, shape (values,).
    values
        Values and the low and high ends of their intervals, shape (3, values).
    colour, marker, size, width, opacity
        Colour, marker and its size, width and opacity of the intervals.
    is_flat
        Whether values are along the horizontal axis.
    reach
        End of the axis: an interval beyond it gets an arrow there.
    label
        Entry in the legend.
    """
    middle, low, high = np.asarray(values, dtype=np.float64)
    spans, flip = (axes.hlines, -1) if is_flat else (axes.vlines, 1)
    spans(places, low, high, color=colour, linewidth=width, alpha=opacity)
    axes.plot(*(places, middle)[::flip], marker, color=colour, markersize=size, label=label)
    mark_beyond(axes, places, low, high, reach=reach, colour=colour, is_flat=is_flat)


def mark_beyond(
    axes: Axes, at: ArrayLike, low: Real, high: Real, *, reach: float, colour: str = STYLE.ink, is_flat: bool = False
) -> None:
    """Draw an arrow at the end of the axis for each interval that goes beyond it."""
    downs, ups = (CARETLEFT, CARETRIGHT) if is_flat else (CARETDOWN, CARETUP)
    style: dict[str, Any] = {"linestyle": "none", "color": colour, "markersize": 6, "clip_on": False}
    for is_beyond, end, marker in ((low < -reach, -reach, downs), (high > reach, reach, ups)):
        for place in np.asarray(at)[is_beyond]:
            x, y = (end, place) if is_flat else (place, end)
            axes.plot(x, y, marker=marker, gid="cut off", **style)


def ink_on(image: AxesImage, value: float) -> str:
    """Return the colour of text on a cell of an image: white on dark ones, otherwise nearly black.

    Notes
    -----
    By the relative luminance 0.2126 R + 0.7152 G + 0.0722 B of the linear components of sRGB; text of both colours
    has the same contrast at 0.18.

    References
    ----------
    W3C, Web Content Accessibility Guidelines 2.1 (2018), definitions of relative luminance and contrast ratio.
    """
    colour = np.asarray(image.to_rgba(np.array(value)), dtype=np.float64)[:3]
    linear = np.where(colour <= 0.04045, colour / 12.92, ((colour + 0.055) / 1.055) ** 2.4)
    return "white" if linear @ (0.2126, 0.7152, 0.0722) < STYLE.dark else STYLE.ink


def matrix(
    axes: Axes,
    values: Real,
    rows: Sequence[str],
    columns: Sequence[str],
    *,
    text: Callable[[float], str] = "{:.2f}".format,
    rotation: float = 90.0,
    max_printed: int = STYLE.max_printed,
    **image: Any,
) -> AxesImage:
    """Draw a matrix of numbers up to 1 with the names of its rows and columns, and a text for each number."""
    drawn = axes.imshow(values, **{"cmap": "Blues", "vmin": 0, **image}, vmax=1)
    axes.set_xticks(range(len(columns)), columns, fontsize=STYLE.small, rotation=rotation)
    axes.set_yticks(range(len(rows)), rows, fontsize=STYLE.small)
    axes.tick_params(length=0)
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": STYLE.small, "gid": "value"}
    if max(values.shape) <= max_printed:
        for (row, column), value in np.ndenumerate(values):
            if words := text(value):
                axes.text(column, row, words, color=ink_on(drawn, value), **style)
    return drawn


def corner_of(component: Component) -> str:
    """Return the corner at which a component is drawn: the left one of its axle for an anti-roll bar."""
    is_bar = component.kind == "anti_roll"
    return f"{component.corner.removesuffix('_axle')}_left" if is_bar else component.corner


def component_panels(figure: Figure, components: Sequence[Component]) -> tuple[NDArray[Any], list[tuple[Axes, int]]]:
    """Return panels of springs, dampers and tyres by corner, and those of the components with their rows.

    Anti-roll bars are below the left corner of their axle; a vehicle on bogies has panels of both stages.
    """
    rows = {(corner_of(component), component.kind): row for row, component in enumerate(components)}
    corners = list(dict.fromkeys(corner for corner, _ in rows))
    stages = [kind for _, kind in rows if kind.startswith(("primary_", "secondary_"))]
    bars = [kind for _, kind in rows if kind == "anti_roll"]
    kinds = list(dict.fromkeys([*(stages or STYLE.kinds), *bars]))
    grid = panels(figure, len(kinds), len(corners), sharex=True, sharey="row")
    shown = []
    for (k, column), axes in np.ndenumerate(grid):
        if k == 0:
            title(axes, corners[column].replace("_", " "))
        if column == 0:
            axes.set_ylabel(f"{kinds[k].replace('_', '-')} [%]")
        if (corners[column], kinds[k]) in rows:
            shown.append((axes, rows[corners[column], kinds[k]]))
    return grid, shown


def panel_grid(n_panels: int, *, max_columns: int) -> tuple[int, int]:
    """Return rows and columns for a number of panels: as few rows as possible, filled evenly."""
    n_rows = math.ceil(n_panels / max_columns)
    return n_rows, math.ceil(n_panels / n_rows)


def plain(axes: Axes) -> None:
    """Give axes a light grid, small tick labels and no frame at the top."""
    axes.tick_params(labelsize=STYLE.small)
    axes.grid(visible=True, color="#E6E6E6", linewidth=0.6)
    axes.set_axisbelow(True)
    axes.spines["top"].set_visible(False)


def spread(wanted: ArrayLike, distance: float) -> Real:
    """Return positions in 0 to 1 at least `distance` apart, as close as possible to the desired ones.

    Parameters
    ----------
    wanted
        Desired positions, rising, shape (labels,).
    distance
        Smallest distance; one above 1 / labels is reduced to that.

    Notes
    -----
    Least squares: x_k - k distance must not fall, which isotonic regression solves; the bounds only clip it.

    Examples
    --------
    >>> spread([0.5, 0.5], 0.2).round(3).tolist()
    [0.4, 0.6]
    """
    places = np.asarray(wanted, dtype=np.float64)
    if not places.size:
        return places
    distance = min(distance, 1 / len(places))
    steps = distance * np.arange(len(places))
    free = isotonic_regression(places - steps).x
    return np.clip(free, distance / 2, 1 - distance / 2 - steps[-1]) + steps
