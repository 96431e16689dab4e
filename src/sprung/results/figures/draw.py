"""What all figures are drawn with: style, headings, panels, legends, intervals, matrices, labels that keep apart."""

import math
import textwrap
from collections.abc import Callable, Sequence
from dataclasses import dataclass
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
from sprung._display import listed
from sprung.identification import METHOD_NAMES, Identification
from sprung.modal import Modes
from sprung.vehicles import Component


@dataclass(frozen=True, slots=True)
class Style:
    """Numbers of the figures: lengths in inches where nothing else is said."""

    # colours of modes by rising frequency (after Okabe and Ito: distinguishable for colour-blind readers)
    colours: tuple[str, ...] = (
        *("#0072B2", "#D55E00", "#009E73", "#C0609A"),
        *("#3FA0DC", "#7F4909", "#5B2C8A", "#8A8A00"),
    )
    ink: str = "#222222"  # of text and frames
    faint: str = "#8C8C8C"  # of secondary elements
    background: str = "#9FB4C7"  # of curves in the background
    harmonic: str = "#C08A00"  # of harmonics
    usual: str = "#E6E6E6"  # of the range of usual windows, or of chance
    attention: str = "#F3D9C9"  # of the time of an alert or an onset
    small: float = 8.0  # size of text [points]
    normal: float = 9.5
    large: float = 12.0
    kinds: tuple[str, ...] = ("spring", "damper", "tyre")  # in panels of their own
    no_mode: str = "No mode was identified."
    screen: int = 80  # resolution in notebooks and animations [dots per inch]
    file: int = 150  # resolution of saved figures [dots per inch]
    character: float = 0.6  # width of a character over the size of the font
    bold: float = 1.25  # width of bold text with a gap over that of plain text
    dark: float = 0.18  # relative luminance below which text on a colour is white
    dashes: tuple[int, tuple[int, int]] = (0, (4, 2))  # of harmonics
    # frequency axes
    wide: float = 11.0  # width of spectra and diagrams
    logarithmic_from: float = 12.0  # ratio of the upper end to the lowest mode
    below_lowest: float = 0.33  # start of a logarithmic axis over the lowest mode
    margin: float = 1.15  # shown on both sides of a band of interest
    passed: float = 0.8  # share of half the sampling rate up to which decimation passes everything
    min_level_span: float = 20.0  # smallest range of a level axis [dB]
    spectrum_span: float = 90.0  # levels of spectra are shown this far below their maximum [dB]
    diagram_span: float = 80.0  # so are those behind a diagram [dB]
    label_distance: float = 1.6  # smallest distance of two harmonics' labels over the size of their font
    clear: float = 0.012  # lines nearer to each other than this share of the axis fade
    leader: float = 0.22  # height of the line between an axis and the label of a mode
    labelled: float = 0.4  # additional height of a first row with labels of harmonics, of a row
    max_channels: int = 24  # in a figure of spectra
    max_points: int = 4000  # of a curve over time
    max_columns: int = 600  # of a spectrogram
    min_spectrum: int = 64  # samples of a record with spectra
    # mode shapes
    azimuth: float = -62.0  # of the view: from the right and slightly ahead [degrees]
    elevation: float = 24.0  # of the view: above the body [degrees]
    displacement: float = 0.28  # largest one, over the mean of the plate's length and width
    shortest_arrow: float = 0.05  # over the same mean
    two_lines: float = 0.15  # height of two lines of text, over the same mean
    max_texts: int = 6  # at the sensors of a plate
    many_channels: int = 12  # from more on, panels are wide
    max_ticks: int = 40  # on an axis of channels
    max_named: int = 6  # channels of a compass of many
    with_scales: float = 1.75  # upper end of an axis with the scales of several quantities
    frames: int = 24  # of one cycle of an animation
    frame_rate: int = 12  # of an animation [1/s]: a cycle takes two seconds
    animated: float = 0.14  # largest motion over the size of the structure
    max_nodes: int = 8  # nodes whose channels are named in an animation
    # values with intervals
    cell: float = 0.52  # side of a cell of a matrix
    max_printed: int = 24  # modes up to which the values of a matrix are printed
    min_correlation: float = 0.3  # smallest one that is printed
    max_numbers: int = 40  # of a vehicle file
    max_hypotheses: int = 8  # in a figure of evidence
    level_ranges: tuple[float, float] = (0.02, 0.2)  # smallest ranges of frequency and damping over levels, relative
    time_ranges: tuple[float, float] = (0.01, 0.3)  # and over time
    max_tracks: int = 12  # in panels of their own
    overview: float = 3.2  # height of all tracks together
    track: float = 1.35  # height of the panel of a track
    many_intervals: int = 60  # windows above which intervals are faint
    gap: float = 1.5  # distance of windows that breaks a curve, over that of neighbours
    many_windows: int = 200  # above which they are drawn in groups
    max_groups: int = 60
    group_hours: tuple[int, ...] = (1, 2, 3, 6, 12, 24, 48, 72, 168, 336, 720)  # lengths that groups may have [h]


STYLE = Style()


def mode_colour(index: int) -> str:
    """Return the colour of the mode at `index`, counted by rising frequency from 0."""
    return STYLE.colours[index % len(STYLE.colours)]


def mode_name(modes: Modes, index: int) -> str:
    """Return the number of a mode with its label, such as "1 bounce"."""
    label = modes.labels[index]
    return f"{index + 1} {label.replace('_', ' ')}" if label else f"{index + 1}"


def in_hertz(frequency: float) -> str:
    """Return a frequency with three or four digits, such as "7.01 Hz" or "19.65 Hz"."""
    n_decimals = 3 if frequency < 1 else 2 if frequency < 100 else 1 if frequency < 1000 else 0
    return f"{frequency:.{n_decimals}f} Hz"


def in_percent(ratio: float) -> str:
    """Return a ratio in percent, such as "1.12 %" or "22.9 %"."""
    return f"{100 * ratio:.2f} %" if abs(ratio) < 0.1 else f"{100 * ratio:.1f} %"


def mode_values(modes: Modes, index: int) -> str:
    """Return frequency and damping of a mode, such as "7.01 Hz, 1.12 %"."""
    return f"{in_hertz(modes.natural_frequency[index])}, {in_percent(modes.damping_ratio[index])}"


def pretty_unit(unit: str) -> str:
    """Return a unit with superscripts."""
    return unit.replace("^2", "²").replace("^3", "³")


def with_unit(what: str, unit: str) -> str:
    """Return the label of an axis: with the unit in brackets, or "as recorded" where it is unknown.

    Examples
    --------
    >>> with_unit("RMS", "m/s^2"), with_unit("RMS", "")
    ('RMS [m/s²]', 'RMS, as recorded')
    """
    return f"{what} [{pretty_unit(unit)}]" if unit else f"{what}, as recorded"


def origin(identification: Identification) -> str:
    """Return the origin of the modes in words: method, channels, sampling rate."""
    names = listed([channel.name for channel in identification.channels])
    method = METHOD_NAMES.get(identification.method, identification.method)
    remark = "" if len(identification.modes) else f". {STYLE.no_mode}"
    return f"{method} of {names} at {identification.sampling_rate:.4g} Hz{remark}"


def percent(log_ratio: ArrayLike) -> Real:
    """Return the relative change [%] of ln values."""
    return 100 * np.expm1(log_ratio)


def text_width(text: str, size: float) -> float:
    """Return the approximate width of the longest line of a text [in]."""
    return max(len(line) for line in text.split("\n")) * STYLE.character * size / 72


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
    """Return the corner at which a component is drawn: the left one of its axle or bogie, if it is of neither side."""
    if component.side is not None:
        return component.corner
    return f"{component.corner.removesuffix('_axle').replace('wheelsets', 'bogie1')}_left"


def component_panels(figure: Figure, components: Sequence[Component]) -> tuple[NDArray[Any], list[tuple[Axes, int]]]:
    """Return panels of springs, dampers and tyres by corner, and those of the components with their rows.

    Parts of neither side are below the left corner; a vehicle on bogies has panels of both stages.
    """
    rows = {(corner_of(component), component.kind): row for row, component in enumerate(components)}
    corners = list(dict.fromkeys(corner for corner, _ in rows))
    stages = [kind for _, kind in rows if kind.startswith(("primary_", "secondary_"))]
    others = [component.kind for component in components if component.side is None]
    kinds = list(dict.fromkeys([*(stages or STYLE.kinds), *others]))
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
