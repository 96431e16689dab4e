"""Style common to all figures: colours, number formats, layout of panels, labels that do not overlap."""

import math
import textwrap
from io import BytesIO
from typing import TypeVar

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, FigureBase
from matplotlib.image import AxesImage
from numpy.typing import ArrayLike
from scipy.optimize import isotonic_regression

from sprung._arrays import Real
from sprung._display import listed
from sprung.identification import METHOD_NAMES, Identification
from sprung.modal import INTERVAL_95, Modes

#: Colours of the modes by rising frequency, the same in all figures (after Okabe and Ito: distinguishable for
#: colour-blind readers).
MODE_COLOURS = ("#0072B2", "#D55E00", "#009E73", "#C0609A", "#3FA0DC", "#7F4909", "#5B2C8A", "#8A8A00")
#: Colours of harmonics, of text and frames, of curves in the background, and of secondary elements.
HARMONIC_COLOUR, INK, BACKGROUND_CURVE, FAINT = "#C08A00", "#222222", "#9FB4C7", "#8C8C8C"
SMALL, NORMAL, LARGE = 8.0, 9.5, 12.0
NO_MODE = "No mode was identified."
#: Half width of a 95 % interval in standard deviations.
HALF_WIDTH_95 = INTERVAL_95
AnyFigure = TypeVar("AnyFigure", bound=FigureBase)
#: Relative luminance below which text on a colour is white.
_DARK = 0.18
#: Resolution in notebooks [dots per inch].
_NOTEBOOK = 80
#: Width of a character over the size of the font.
_CHARACTER = 0.6


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
    return "white" if linear @ (0.2126, 0.7152, 0.0722) < _DARK else INK


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
        self.savefig(buffer, format="png", dpi=_NOTEBOOK)
        return buffer.getvalue()


def new_figure(what: str, where: str, *, width: float, height: float) -> Figure:
    """Return an empty figure of a size [in] with a heading and the origin of its data below."""
    figure = _Shown(figsize=(width, height), layout="constrained", facecolor="white")
    n_characters = int(width / (_CHARACTER * LARGE / 72))
    lines = [line for part in (what, where) for line in textwrap.wrap(part, n_characters)]
    figure.suptitle("\n".join(lines), x=0.012, ha="left", fontsize=LARGE, color=INK, linespacing=1.4)
    return figure


def write_sentence(figure: AnyFigure, sentence: str) -> AnyFigure:
    """Write a sentence in place of the panels of a figure."""
    axes = figure.add_subplot()
    axes.set_axis_off()
    axes.text(0.5, 0.5, sentence, ha="center", va="center", fontsize=LARGE, color=INK, transform=axes.transAxes)
    return figure


def panel_grid(n_panels: int, *, most_columns: int) -> tuple[int, int]:
    """Return rows and columns for a number of panels: as few rows as possible, filled evenly."""
    n_rows = math.ceil(n_panels / most_columns)
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
    return max(len(line) for line in text.split("\n")) * _CHARACTER * size / 72
