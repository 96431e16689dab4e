"""Style common to all figures: colours, number formats, panels, frequency axes, labels that do not overlap."""

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
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import isotonic_regression

from sprung._arrays import Booleans, Real
from sprung._display import listed
from sprung.identification import METHOD_NAMES, Identification
from sprung.modal import INTERVAL_95, Modes
from sprung.signals.harmonics import Harmonic
from sprung.vehicles import Component

#: Colours of the modes by rising frequency, the same in all figures (after Okabe and Ito: distinguishable for
#: colour-blind readers).
MODE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#C0609A", "#3FA0DC", "#7F4909", "#5B2C8A", "#8A8A00")
#: Colours of harmonics, of text and frames, of curves in the background, and of secondary elements.
HARMONIC_COLOUR, INK, BACKGROUND_CURVE, FAINT = "#C08A00", "#222222", "#9FB4C7", "#8C8C8C"
SMALL, NORMAL, LARGE = 8.0, 9.5, 12.0
#: Kinds of components in panels of their own.
KINDS = ("spring", "damper", "tyre")
NO_MODE = "No mode was identified."
#: Half width of a 95 % interval in standard deviations.
HALF_WIDTH_95 = INTERVAL_95


@dataclass(frozen=True, slots=True)
class Style:
    """Numbers of the figures: lengths in inches where nothing else is said."""

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
AnyFigure = TypeVar("AnyFigure", bound=FigureBase)


def mode_colour(index: int) -> str:
    """Return the colour of the mode at `index`, counted by rising frequency from 0."""
    return MODE_COLOURS[index % len(MODE_COLOURS)]


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
    return "white" if linear @ (0.2126, 0.7152, 0.0722) < STYLE.dark else INK


def origin(identification: Identification) -> str:
    """Return the origin of the modes in words: method, channels, sampling rate."""
    names = listed([channel.name for channel in identification.channels])
    method = METHOD_NAMES.get(identification.method, identification.method)
    remark = "" if len(identification.modes) else f". {NO_MODE}"
    return f"{method} of {names} at {identification.sampling_rate:.4g} Hz{remark}"


class _Shown(Figure):
    """Figure that notebooks show by itself, as no window manager knows it."""

    def _repr_png_(self) -> bytes:
        buffer = BytesIO()
        self.savefig(buffer, format="png", dpi=STYLE.screen)
        return buffer.getvalue()


def new_figure(what: str, where: str, *, width: float, height: float, source: str = "") -> Figure:
    """Return an empty figure of a size [in] with a heading and the origin of its data below."""
    figure = _Shown(figsize=(width, height), layout="constrained", facecolor="white")
    n_characters = int(width / (STYLE.character * LARGE / 72))
    lines = [
        line for part in (f"{what}: {source}" if source else what, where) for line in textwrap.wrap(part, n_characters)
    ]
    figure.suptitle("\n".join(lines), x=0.012, ha="left", fontsize=LARGE, color=INK, linespacing=1.4)
    return figure


def write_sentence(figure: AnyFigure, sentence: str) -> AnyFigure:
    """Write a sentence in place of the panels of a figure."""
    axes = figure.add_subplot()
    axes.set_axis_off()
    axes.text(0.5, 0.5, sentence, ha="center", va="center", fontsize=LARGE, color=INK, transform=axes.transAxes)
    return figure


def draw_matrix(
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
    axes.set_xticks(range(len(columns)), columns, fontsize=SMALL, rotation=rotation)
    axes.set_yticks(range(len(rows)), rows, fontsize=SMALL)
    axes.tick_params(length=0)
    style: dict[str, Any] = {"ha": "center", "va": "center", "fontsize": SMALL, "gid": "value"}
    if max(values.shape) <= max_printed:
        for (row, column), value in np.ndenumerate(values):
            if words := text(value):
                axes.text(column, row, words, color=ink_on(drawn, value), **style)
    return drawn


def component_panels(figure: Figure, components: Sequence[Component]) -> tuple[NDArray[Any], list[tuple[Axes, int]]]:
    """Return panels of springs, dampers and tyres by corner, and those of the components with their rows."""
    corners = list(dict.fromkeys(component.corner for component in components))
    panels = figure.subplots(len(KINDS), len(corners), sharex=True, sharey="row", squeeze=False)
    rows = {component: row for row, component in enumerate(components)}
    shown = []
    for (k, column), axes in np.ndenumerate(panels):
        plain(axes)
        if k == 0:
            axes.set_title(corners[column].replace("_", " "), fontsize=NORMAL, loc="left", color=INK)
        if column == 0:
            axes.set_ylabel(f"{KINDS[k]} [%]", fontsize=NORMAL)
        if Component(corners[column], KINDS[k]) in rows:
            shown.append((axes, rows[Component(corners[column], KINDS[k])]))
    return panels, shown


def percent(log_ratio: ArrayLike) -> Real:
    """Return the relative change [%] of ln values."""
    return 100 * np.expm1(log_ratio)


def panel_grid(n_panels: int, *, max_columns: int) -> tuple[int, int]:
    """Return rows and columns for a number of panels: as few rows as possible, filled evenly."""
    n_rows = math.ceil(n_panels / max_columns)
    return n_rows, math.ceil(n_panels / n_rows)


def plain(axes: Axes) -> None:
    """Give axes a light grid, small tick labels and no frame at the top."""
    axes.tick_params(labelsize=SMALL)
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


def text_width(text: str, size: float) -> float:
    """Return the approximate width of the longest line of a text [in]."""
    return max(len(line) for line in text.split("\n")) * STYLE.character * size / 72


@dataclass(frozen=True, slots=True)
class FrequencyRange:
    """The range of a frequency axis.

    Parameters
    ----------
    low, high
        Ends of the range [Hz].
    passed
        Frequency up to which anti-aliasing filters pass everything [Hz]; levels beyond are meaningless.
    is_logarithmic
        Whether the axis is logarithmic.
    """

    low: float
    high: float
    passed: float
    is_logarithmic: bool

    def holds(self, frequencies: Real) -> Booleans:
        """Return which frequencies lie in the range and below the roll-off of anti-aliasing filters."""
        return (frequencies > 0) & (frequencies >= self.low) & (frequencies <= min(self.high, self.passed))

    def put_on(self, axes: Axes) -> None:
        """Give the axes this range."""
        if self.is_logarithmic:
            axes.set_xscale("log")
            axes.xaxis.set_major_locator(LogLocator(subs=(1.0, 2.0, 5.0)))
            axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
            axes.xaxis.set_minor_formatter(NullFormatter())
        axes.set_xlim(self.low, self.high)


def frequency_range(identification: Identification) -> FrequencyRange:
    """Return the range to show: the band of the settings, otherwise everything up to half the sampling rate.

    Notes
    -----
    Logarithmic if modes would otherwise be crowded into the lowest twelfth.
    """
    highest = float(identification.spectra.frequencies[-1])
    band = identification.settings.band
    low, high = (0.0, highest) if band is None else (band[0] / STYLE.margin, min(STYLE.margin * band[1], highest))
    lowest_mode = float(identification.modes.natural_frequency.min(initial=np.inf))
    is_logarithmic = high > STYLE.logarithmic_from * lowest_mode
    low = max(low, STYLE.below_lowest * lowest_mode) if is_logarithmic else low
    return FrequencyRange(low, high, STYLE.passed * highest, is_logarithmic)


def harmonic_label(harmonic: Harmonic) -> str:
    """Return the label of a harmonic: its frequency, or its number of periods per metre.

    Examples
    --------
    >>> harmonic_label(Harmonic(7.3, "constant", (7.2, 7.4), 0.1, 20.0, ("a",), fundamental=3.65, order=2))
    '7.30 Hz'
    >>> harmonic_label(Harmonic(0.516, "speed", (2.5, 10.0), 0.01, 20.0, ("a",)))
    '0.516 per m'
    >>> harmonic_label(Harmonic(1.032, "speed", (5.0, 20.0), 0.01, 20.0, ("a",), fundamental=0.516, order=2))
    '2 × 0.516 per m'
    """
    if harmonic.kind != "speed":
        return in_hertz(harmonic.frequency)
    if harmonic.fundamental is None:
        return f"{harmonic.frequency:.3g} per m"
    times = f"{harmonic.order} × " if harmonic.order > 1 else ""
    return f"{times}{harmonic.fundamental:.3g} per m"


def harmonic_handles(harmonics: Sequence[Harmonic]) -> list[Line2D | Patch]:
    """Return legend entries for lines and bands of harmonics, with their families of multiples."""
    handles: list[Line2D | Patch] = []
    over_time = [line for line in harmonics if line.kind != "speed"]
    if over_time:
        label = f"harmonics{_families(over_time, 'Hz')}"
        handles.append(Line2D([], [], color=HARMONIC_COLOUR, linestyle=STYLE.dashes, linewidth=1.2, label=label))
    swept = [line for line in harmonics if line.kind == "speed"]
    if swept:
        label = f"proportional to speed{_families(swept, 'per metre')}"
        handles.append(Patch(facecolor=HARMONIC_COLOUR, alpha=0.3, label=label))
    return handles


def _families(harmonics: Sequence[Harmonic], unit: str) -> str:
    """Return the fundamentals of harmonics and their multiples in words."""
    orders: dict[str, list[int]] = {}
    for line in harmonics:
        if line.fundamental is not None:
            orders.setdefault(f"{line.fundamental:.3g} {unit}", []).append(line.order)
    largest = sorted(orders, key=lambda fundamental: -len(orders[fundamental]))[:2]
    words = [f"{min(orders[name])} to {max(orders[name])} × {name}" for name in largest]
    return f" ({', '.join(words)})" if words else ""


def curve_limits(values: Real, *, dynamic_range: float, room: float) -> tuple[float, float]:
    """Return the limits of a level axis [dB].

    Parameters
    ----------
    values
        Levels of the curves to show [dB].
    dynamic_range
        Values further below the highest one are cut off [dB].
    room
        Share of the axis kept free above them.

    Notes
    -----
    At least 20 dB are shown, so that a flat spectrum looks flat.
    """
    finite = values[np.isfinite(values)]
    high = float(finite.max(initial=-np.inf)) if finite.size else 0.0
    low = max(float(finite.min(initial=high)), high - dynamic_range)
    half = max(high - low, STYLE.min_level_span) / 2 * 1.1
    middle = (high + low) / 2
    return middle - half, middle + half + room / (1 - room) * 2 * half


def head_room(harmonics: Sequence[Harmonic], height: float) -> float:
    """Return the share of an axes of a height [in] that the labels of harmonics need above the data."""
    longest = max((text_width(harmonic_label(line), SMALL) for line in harmonics), default=0.0)
    return float(np.clip(longest / height + 0.03, 0.04, 0.5))


def mark_harmonics(
    axes: Axes, harmonics: Sequence[Harmonic], *, width: float, channel: str | None = None, has_labels: bool = True
) -> None:
    """Draw a line at each harmonic, or shade the band that one proportional to speed sweeps, and label them.

    Parameters
    ----------
    axes
        Axes with the frequency range set.
    harmonics
        Values to mark; those outside the range are omitted.
    width
        Approximate width of the axes [in]: of labels that would overlap, the most prominent are kept.
    channel
        Channel of the axes: harmonics that it does not show are drawn fainter. None: all equally.
    has_labels
        Whether to label the harmonics.
    """
    low, high = axes.get_xlim()
    seen = [line for line in harmonics if low <= _place(line) <= high]
    fading = _fading([axes_fraction(axes, _place(line)) for line in seen])
    for line, alpha in zip(seen, fading, strict=True):
        strength = 1.0 if channel is None or channel in line.channels else 0.3
        if line.kind == "speed":
            shade: dict[str, Any] = {"alpha": 0.18 * strength, "linewidth": 0, "zorder": 0.5}
            axes.axvspan(*line.band, color=HARMONIC_COLOUR, gid="harmonic band", **shade)
        else:
            style: dict[str, Any] = {
                "alpha": alpha * strength,
                "linestyle": STYLE.dashes,
                "linewidth": 0.9,
                "zorder": 0.6,
            }
            axes.axvline(line.frequency, color=HARMONIC_COLOUR, gid="harmonic", **style)
    if has_labels:
        _label_harmonics(axes, seen, STYLE.label_distance * SMALL / 72 / width)


def _fading(places: Sequence[float]) -> Real:
    """Return the opacity of each line: lower if its neighbours on the axis are near."""
    order = np.argsort(places)
    gaps = np.diff(np.asarray(places)[order], prepend=-1.0, append=2.0)
    nearest = np.empty(len(places))
    nearest[order] = np.minimum(gaps[:-1], gaps[1:]) if len(places) else 0.0
    return np.clip(nearest / STYLE.clear, 0.15, 0.9)


def _place(harmonic: Harmonic) -> float:
    """Return the frequency at which the label of a harmonic is written [Hz]."""
    return sum(harmonic.band) / 2 if harmonic.kind == "speed" else harmonic.frequency


def _label_harmonics(axes: Axes, harmonics: Sequence[Harmonic], distance: float) -> None:
    """Write vertical labels below the upper edge, fundamentals and prominent lines first, without overlap."""
    taken: list[float] = [-distance / 4, 1 + distance / 4]
    for line in sorted(harmonics, key=lambda line: (line.order != 1, -line.prominence)):
        place = axes_fraction(axes, _place(line))
        if min(abs(place - other) for other in taken) < distance:
            continue
        taken.append(place)
        axes.text(
            place,
            0.985,
            harmonic_label(line),
            transform=axes.transAxes,
            rotation=90,
            ha="center",
            va="top",
            fontsize=SMALL,
            color="#7A5800",
            gid="harmonic label",
            bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.6},
        )


def axes_fraction(axes: Axes, frequency: float) -> float:
    """Return the position of a frequency on the axis, from 0 to 1."""
    return float((axes.transScale + axes.transLimits).transform((frequency, axes.get_ylim()[1]))[0])


def mark_modes(
    axes: Axes, modes: Modes, *, width: float, height: float, has_labels: bool = True, is_short: bool = False
) -> None:
    """Draw a line at each mode, and above the axes a label with number, name, frequency and damping.

    Parameters
    ----------
    axes
        Axes with the frequency range set.
    modes
        Values to mark; those outside the range are omitted.
    width, height
        Approximate size of the axes [in].
    has_labels
        Whether to label the modes.
    is_short
        Whether labels hold number and frequency only.

    Notes
    -----
    The labels stand side by side in one row, or upright if there are too many for that.
    """
    low, high = axes.get_xlim()
    frequencies = modes.natural_frequency
    seen = [k for k in range(len(modes)) if low <= frequencies[k] <= high]
    for k in seen:
        axes.axvline(frequencies[k], color=mode_colour(k), linewidth=1.0, alpha=0.7, zorder=0.7, gid="mode")
    if not has_labels:
        return
    if is_short:
        texts = [f"{k + 1}\n{in_hertz(frequencies[k])}" for k in seen]
    else:
        texts = [mode_name(modes, k) + "\n" + mode_values(modes, k).replace(", ", "\n") for k in seen]
    wanted = [axes_fraction(axes, frequencies[k]) for k in seen]
    distance = max((text_width(text, NORMAL) for text in texts), default=0.0) * STYLE.bold / width
    is_upright = distance * len(seen) > 1
    if is_upright:
        texts = [text.replace("\n", "  ") for text in texts]
        distance = 1.4 * NORMAL / 72 / width
    for k, text, at, place in zip(seen, texts, wanted, spread(wanted, distance), strict=True):
        axes.annotate(
            text,
            xy=(at, 1.0),
            xytext=(place, 1 + STYLE.leader / height),
            xycoords="axes fraction",
            textcoords="axes fraction",
            rotation=90 if is_upright else 0,
            ha="center",
            va="bottom",
            fontsize=NORMAL,
            color=mode_colour(k),
            fontweight="bold",
            gid="mode label",
            arrowprops={
                "arrowstyle": "-",
                "color": mode_colour(k),
                "linewidth": 0.9,
                "shrinkA": 0,
                "shrinkB": 0,
                "relpos": (0.5, 0.0),
            },
        )
