"""Frequency and damping of each mode against the level of the subsets."""

from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from sprung._arrays import Real
from sprung.identification import Identification
from sprung.results.figures.style import (
    FAINT,
    HALF_WIDTH_95,
    INK,
    NO_MODE,
    NORMAL,
    SMALL,
    mode_colour,
    mode_name,
    mode_values,
    new_figure,
    origin,
    panel_grid,
    plain,
    write_sentence,
)

#: Width of a mode's panels and height of both [in].
_COLUMN, _BAND, _MOST_COLUMNS = 2.7, 4.2, 5
#: Smallest range shown around a value, relative to it: smaller changes of frequency and damping should look small.
_LEAST_RANGE = (0.02, 0.2)


def subsets_figure(identification: Identification, *, source: str = "") -> Figure:
    """Draw frequency and damping of each mode against the level of the subset they are identified in.

    Parameters
    ----------
    identification
        Identification by CoSS-SSI.
    source
        Name of the recording, for the heading.

    Returns
    -------
    matplotlib.figure.Figure
        Figure with two panels for each mode, and below them the number of segments in each subset.

    Examples
    --------
    >>> from sprung.identification import IdentificationSettings, coss_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=120.0, sampling_rate=200.0, seed=1)
    >>> identification = coss_ssi(run, settings=IdentificationSettings(n_subsets=2))
    >>> above, below = subsets_figure(identification).subfigs
    >>> [axes.get_title()[0] for axes in above.axes if axes.get_title()], below.axes[0].get_ylabel()
    (['1', '2', '3'], 'Segments [-]')
    """
    what = "Modes against the level of the subsets"
    what = f"{what}: {source}" if source else what
    modes = identification.modes
    if any(subset.level is None for subset in identification.subsets):
        return write_sentence(
            new_figure(what, origin(identification), width=8, height=3), "Segments were not sorted by level."
        )
    n_bands, n_columns = panel_grid(max(len(modes), 1), most_columns=_MOST_COLUMNS)
    width = max(_COLUMN * n_columns + 0.8, 8.5)
    figure = new_figure(what, origin(identification), width=width, height=2.9 + _BAND * n_bands)
    above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=[_BAND * n_bands, 1.7])[:, 0]
    if len(modes):
        _draw_modes(above, identification, n_bands, n_columns)
        figure.legend(handles=_legend(), loc="outside lower center", ncols=2, fontsize=SMALL, frameon=False)
    else:
        write_sentence(above, NO_MODE)
    _draw_counts(below.subplots(), identification)
    return figure


def _draw_modes(figure: SubFigure, identification: Identification, n_bands: int, n_columns: int) -> None:
    """Draw two panels for each mode, in rows one below another."""
    panels = figure.subplots(2 * n_bands, n_columns, squeeze=False)
    for k in range(n_bands * n_columns):
        band, column = divmod(k, n_columns)
        upper, lower = panels[2 * band : 2 * band + 2, column]
        if k >= len(identification.modes):
            upper.set_axis_off()
            lower.set_axis_off()
            continue
        _draw_mode(upper, lower, identification, k)
        if column == 0:
            upper.set_ylabel("Natural frequency [Hz]", fontsize=SMALL)
            lower.set_ylabel("Damping ratio [%]", fontsize=SMALL)


def _legend() -> list[Line2D]:
    """Return legend entries for values, merged values and missing ones."""
    value: dict[str, Any] = {"color": FAINT, "marker": "o", "linewidth": 1.2}
    cross: dict[str, Any] = {"color": FAINT, "marker": "X", "linestyle": "none"}
    return [
        Line2D([], [], **value, label="in one subset; vertical: 95 % interval, horizontal: range of levels"),
        Line2D([], [], color=FAINT, linestyle=(0, (5, 3)), label="merged over the subsets"),
        Line2D([], [], color=INK, linewidth=1.2, label="dependence on the level, where detected"),
        Line2D([], [], **cross, label="on the axis: not found in that subset"),
    ]


def _draw_mode(upper: Axes, lower: Axes, identification: Identification, index: int) -> None:
    """Draw frequency above, damping below."""
    modes, colour = identification.modes, mode_colour(index)
    rows = [
        (subset.modes, int(member))
        for subset, member in zip(identification.subsets, identification.members[index], strict=True)
    ]
    merged = (modes.natural_frequency[index], 100 * modes.damping_ratio[index])
    for axes, name, factor, whole, least in zip(
        (upper, lower), ("natural_frequency", "damping_ratio"), (1, 100), merged, _LEAST_RANGE, strict=True
    ):
        plain(axes)
        values = [factor * getattr(part, name)[m] if m >= 0 else np.nan for part, m in rows]
        spreads = [factor * getattr(part, f"{name}_std")[m] if m >= 0 else np.nan for part, m in rows]
        axes.axhline(whole, color=colour, linestyle=(0, (5, 3)), linewidth=1.0, gid="merged")
        _draw_trend(axes, identification, index, name, factor)
        _draw_values(axes, _levels(identification), np.array(values), HALF_WIDTH_95 * np.array(spreads), colour)
        _widen(axes, whole, least * whole)
    upper.tick_params(labelbottom=False)
    lower.xaxis.set_major_locator(MaxNLocator(4))
    lower.set_xlabel("Level [-]", fontsize=SMALL)
    upper.set_title(
        f"{mode_name(modes, index)}\n{mode_values(modes, index)}",
        fontsize=NORMAL,
        color=colour,
        fontweight="bold",
    )


def _draw_trend(axes: Axes, identification: Identification, index: int, name: str, factor: float) -> None:
    """Draw the dependence of a value on the level, if the mode has one."""
    trends = identification.level_trends
    if trends is None or not trends.is_detected[index]:
        return
    levels = _levels(identification)
    centres = levels.mean(axis=1)
    counts = np.array([subset.n_segments for subset in identification.subsets], dtype=np.float64)
    middle = np.exp(np.sum(counts * np.log(centres)) / counts.sum())
    value, slope = getattr(identification.modes, name)[index], getattr(trends, name)[index]
    slope = slope * value if name == "natural_frequency" else slope
    x = np.geomspace(centres[0], centres[-1], 40)
    axes.plot(x, factor * (value + slope * np.log2(x / middle)), color=INK, linewidth=1.2, gid="trend")


def _levels(identification: Identification) -> Real:
    """Return the ranges of the subsets' levels, shape (subsets, 2)."""
    return np.array([subset.level for subset in identification.subsets], dtype=np.float64).reshape(-1, 2)


def _draw_values(
    axes: Axes,
    levels: Real,
    values: Real,
    intervals: Real,
    colour: str,
) -> None:
    """Draw values at the middle of their levels, and a cross on the axis for a missing one."""
    centres, half = levels.mean(axis=1), np.diff(levels, axis=1)[:, 0] / 2
    is_present = np.isfinite(values)
    axes.errorbar(
        centres[is_present],
        values[is_present],
        xerr=half[is_present],
        yerr=np.nan_to_num(intervals[is_present]),
        fmt="o",
        color=colour,
        markersize=5.5,
        capsize=3,
        linewidth=1.2,
    )
    for centre in centres[~is_present]:
        style: dict[str, Any] = {"marker": "X", "markersize": 6, "color": FAINT, "clip_on": False}
        axes.plot([centre], [0], transform=axes.get_xaxis_transform(), gid="not found", **style)
    low, high = levels.min(), levels.max()
    margin = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    axes.set_xlim(low - margin, high + margin)


def _widen(axes: Axes, centre: float, half: float) -> None:
    """Show at least `half` on either side of the merged value, in plain numbers."""
    low, high = axes.get_ylim()
    axes.set_ylim(min(low, centre - half), max(high, centre + half))
    axes.yaxis.set_major_locator(MaxNLocator(5))
    axes.yaxis.set_major_formatter(ScalarFormatter(useOffset=False))


def _draw_counts(axes: Axes, identification: Identification) -> None:
    """Draw the number of segments in each subset."""
    plain(axes)
    levels = _levels(identification)
    counts = [subset.n_segments for subset in identification.subsets]
    centres = levels.mean(axis=1)
    widths = np.maximum(np.diff(levels, axis=1)[:, 0] * 0.94, 1e-12)
    axes.bar(centres, counts, width=widths, color="#C9D3DC", edgecolor=FAINT)
    for k, (centre, count) in enumerate(zip(centres, counts, strict=True)):
        text = f"subset {k + 1}: {count}"
        axes.text(centre, count + 0.04 * max(counts), text, ha="center", va="bottom", fontsize=SMALL, color=INK)
    axes.set_ylim(0, max(1.35 * max(counts), 3))
    axes.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    axes.set_ylabel("Segments [-]", fontsize=SMALL)
    axes.set_xlabel(
        "Level: RMS of the channels over that of the first record; of the thesis: RMS of the correlations [-]",
        fontsize=SMALL,
    )
