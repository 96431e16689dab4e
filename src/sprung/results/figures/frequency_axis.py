"""Frequency axes, and the modes and harmonics marked on them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from sprung._arrays import Booleans, Real
from sprung.identification import Identification
from sprung.modal import Modes
from sprung.results.figures import draw
from sprung.results.figures.draw import STYLE, in_hertz, mode_colour, mode_name, mode_values, text_width
from sprung.signals.harmonics import Harmonic


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
        handles.append(Line2D([], [], color=STYLE.harmonic, linestyle=STYLE.dashes, linewidth=1.2, label=label))
    swept = [line for line in harmonics if line.kind == "speed"]
    if swept:
        label = f"proportional to speed{_families(swept, 'per metre')}"
        handles.append(Patch(facecolor=STYLE.harmonic, alpha=0.3, label=label))
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
    longest = max((text_width(harmonic_label(line), STYLE.small) for line in harmonics), default=0.0)
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
            axes.axvspan(*line.band, color=STYLE.harmonic, gid="harmonic band", **shade)
        else:
            style: dict[str, Any] = {
                "alpha": alpha * strength,
                "linestyle": STYLE.dashes,
                "linewidth": 0.9,
                "zorder": 0.6,
            }
            axes.axvline(line.frequency, color=STYLE.harmonic, gid="harmonic", **style)
    if has_labels:
        _label_harmonics(axes, seen, STYLE.label_distance * STYLE.small / 72 / width)


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
            fontsize=STYLE.small,
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
    distance = max((text_width(text, STYLE.normal) for text in texts), default=0.0) * STYLE.bold / width
    is_upright = distance * len(seen) > 1
    if is_upright:
        texts = [text.replace("\n", "  ") for text in texts]
        distance = 1.4 * STYLE.normal / 72 / width
    for k, text, at, place in zip(seen, texts, wanted, draw.spread(wanted, distance), strict=True):
        axes.annotate(
            text,
            xy=(at, 1.0),
            xytext=(place, 1 + STYLE.leader / height),
            xycoords="axes fraction",
            textcoords="axes fraction",
            rotation=90 if is_upright else 0,
            ha="center",
            va="bottom",
            fontsize=STYLE.normal,
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
