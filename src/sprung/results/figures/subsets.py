"""Modes of the subsets of an identification: values against the level, MAC of the shapes, rates of stable points."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from sprung._arrays import Indices, Real
from sprung._display import counted
from sprung.identification import Identification, SubsetModes
from sprung.modal import INTERVAL_95, Modes, join_modes, mac
from sprung.results.figures import draw
from sprung.results.figures.draw import STYLE, in_hertz, mode_colour, mode_name, mode_values, origin
from sprung.results.figures.frequency_axis import frequency_range


def mac_figure(identification: Identification, *, source: str = "") -> Figure:
    """Draw the modal assurance criterion between all modes and, with several subsets, between those of the subsets.

    Parameters
    ----------
    identification
        Identification with any number of modes.
    source
        Name of the recording, for the heading.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> (image,) = mac_figure(identification).axes[0].get_images()
    >>> image.get_array().shape, bool(np.allclose(np.diag(image.get_array()), 1))
    ((3, 3), True)
    """
    modes = identification.modes
    what, where = "MAC of the mode shapes", origin(identification)
    if not len(modes):
        return draw.sentence(draw.new_figure(what, where, width=8, height=3, source=source), STYLE.no_mode)
    parts = [subset.modes for subset in identification.subsets]
    counts = (len(modes), sum(len(part) for part in parts))[: 1 + (len(parts) > 1)]
    sides = [min(max(STYLE.cell * n, 1.5), 9.0) for n in counts]
    width = max(sum(sides) + 2.2 * len(sides) + 0.8, 7.5)
    figure = draw.new_figure(what, where, width=width, height=max(sides) + 2.6, source=source)
    panels = figure.subplots(1, len(sides), squeeze=False, width_ratios=sides)[0]
    for axes in panels:
        axes.set_anchor("N")
    names = _names(modes)
    image = draw.matrix(panels[0], mac(modes.mode_shapes, modes.mode_shapes), names, names, gid="mac")
    panels[0].set_title("between the modes", fontsize=STYLE.normal)
    _colour_ticks(panels[0], list(range(len(modes))))
    if len(parts) > 1:
        _draw_subsets(panels[1], parts, identification.members)
    bar = figure.colorbar(image, ax=list(panels), shrink=0.7, pad=0.02, panchor=False)
    bar.set_label("MAC [-]", fontsize=STYLE.normal)
    return figure


def _names(modes: Modes) -> list[str]:
    return [f"{mode_name(modes, k)}\n{in_hertz(modes.natural_frequency[k])}" for k in range(len(modes))]


def _draw_subsets(axes: Axes, parts: Sequence[Modes], members: Indices) -> None:
    """Draw the MAC between the modes of all subsets, with lines between the subsets."""
    together = join_modes(parts)
    names, merged = [], []
    for k, part in enumerate(parts):
        for index, frequency in enumerate(part.natural_frequency):
            names.append(f"S{k + 1}  {in_hertz(frequency)}")
            matches = np.flatnonzero(members[:, k] == index)
            merged.append(int(matches[0]) if matches.size else None)
    draw.matrix(axes, mac(together.mode_shapes, together.mode_shapes), names, names, gid="mac")
    for edge in np.cumsum([len(part) for part in parts])[:-1] - 0.5:
        axes.axhline(edge, color=STYLE.ink, linewidth=1.5)
        axes.axvline(edge, color=STYLE.ink, linewidth=1.5)
    axes.set_title("between the subsets (S1: lowest level; grey: not kept in merging)", fontsize=STYLE.normal)
    _colour_ticks(axes, merged)


def _colour_ticks(axes: Axes, modes: Sequence[int | None]) -> None:
    """Write the names in the modes' colours, grey for those in too few subsets to be a mode."""
    for labels in (axes.get_xticklabels(), axes.get_yticklabels()):
        for label, mode in zip(labels, modes, strict=True):
            label.set_color("#777777" if mode is None else mode_colour(mode))
            label.set_fontweight("bold")


def reference_mac_figure(parts: Sequence[tuple[str, Modes]], reference: Modes, *, title: str) -> Figure:
    """Draw the modal assurance criterion between identified and reference modes, a panel for each part.

    Parameters
    ----------
    parts
        Identified modes with the name of their origin, such as a subset.
    reference
        Reference modes of the same channels.
    title
        Heading of the figure.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> figure = reference_mac_figure([("run 1", identification.modes)], identification.modes, title="With itself")
    >>> (image,) = figure.axes[0].get_images()
    >>> bool(np.allclose(np.diag(image.get_array()), 1))
    True
    """
    width = max(7.5, 1.0 + sum(max(STYLE.cell * len(modes), 1.2) + 1.2 for _, modes in parts))
    figure = draw.new_figure(title, width=min(width, 12.0), height=1.9 + STYLE.cell * len(reference))
    panels = figure.subplots(1, len(parts), squeeze=False)[0]
    for axes, (name, modes) in zip(panels, parts, strict=True):
        axes.set_title(name, fontsize=STYLE.normal)
        if len(modes):
            values = mac(reference.mode_shapes, modes.mode_shapes)
            found = [in_hertz(frequency) for frequency in modes.natural_frequency]
            draw.matrix(axes, values, _names(reference), found, rotation=30, aspect="auto")
        else:
            draw.write_in(axes, STYLE.no_mode, size=STYLE.small)
    return figure


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
    what, where = "Modes against the level of the subsets", origin(identification)
    modes = identification.modes
    if any(subset.level is None for subset in identification.subsets):
        figure = draw.new_figure(what, where, width=8, height=3, source=source)
        return draw.sentence(figure, "Segments were not sorted by level.")
    n_bands, n_columns = draw.panel_grid(max(len(modes), 1), max_columns=5)
    width = max(2.7 * n_columns + 0.8, 8.5)
    figure = draw.new_figure(what, where, width=width, height=2.9 + 4.2 * n_bands, source=source)
    above, below = figure.subfigures(2, 1, squeeze=False, height_ratios=[4.2 * n_bands, 1.7])[:, 0]
    if len(modes):
        _draw_modes(above, identification, n_bands, n_columns)
        draw.legend(figure, _legend(), n_columns=2)
    else:
        draw.sentence(above, STYLE.no_mode)
    _draw_counts(draw.panels(below, size=STYLE.small)[0, 0], identification)
    return figure


def _draw_modes(figure: SubFigure, identification: Identification, n_bands: int, n_columns: int) -> None:
    """Draw two panels for each mode, in rows one below another."""
    panels = draw.panels(figure, 2 * n_bands, n_columns, size=STYLE.small)
    for k in range(n_bands * n_columns):
        band, column = divmod(k, n_columns)
        upper, lower = panels[2 * band : 2 * band + 2, column]
        if k >= len(identification.modes):
            upper.set_axis_off()
            lower.set_axis_off()
            continue
        _draw_mode(upper, lower, identification, k)
        if column == 0:
            upper.set_ylabel("Natural frequency [Hz]")
            lower.set_ylabel("Damping ratio [%]")


def _legend() -> list[Line2D]:
    """Return legend entries for values, merged values and missing ones."""
    return [
        draw.entry(
            "in one subset; vertical: 95 % interval, horizontal: range of levels",
            color=STYLE.faint,
            marker="o",
            linewidth=1.2,
        ),
        draw.entry("merged over the subsets", color=STYLE.faint, linestyle=(0, (5, 3))),
        draw.entry("dependence on the level, where detected", color=STYLE.ink, linewidth=1.2),
        draw.entry("on the axis: not found in that subset", color=STYLE.faint, marker="X", linestyle="none"),
    ]


def _draw_mode(upper: Axes, lower: Axes, identification: Identification, index: int) -> None:
    """Draw frequency above, damping below."""
    modes, colour = identification.modes, mode_colour(index)
    rows = [
        (subset.modes, int(member))
        for subset, member in zip(identification.subsets, identification.members[index], strict=True)
    ]
    kinds = ("natural_frequency", 1.0), ("damping_ratio", 100.0)
    for axes, (name, factor), least in zip((upper, lower), kinds, STYLE.level_ranges, strict=True):
        whole = factor * getattr(modes, name)[index]
        values = [factor * getattr(part, name)[m] if m >= 0 else np.nan for part, m in rows]
        spreads = [factor * getattr(part, f"{name}_std")[m] if m >= 0 else np.nan for part, m in rows]
        axes.axhline(whole, color=colour, linestyle=(0, (5, 3)), linewidth=1.0, gid="merged")
        _draw_trend(axes, identification, index, name, factor)
        _draw_values(axes, _levels(identification), np.array(values), INTERVAL_95 * np.array(spreads), colour)
        low, high = axes.get_ylim()
        axes.set_ylim(min(low, whole - least * whole), max(high, whole + least * whole))
        axes.yaxis.set_major_locator(MaxNLocator(5))
        axes.yaxis.set_major_formatter(ScalarFormatter(useOffset=False))
    upper.tick_params(labelbottom=False)
    lower.xaxis.set_major_locator(MaxNLocator(4))
    lower.set_xlabel("Level [-]")
    title = f"{mode_name(modes, index)}\n{mode_values(modes, index)}"
    draw.title(upper, title, colour=colour, loc="center", fontweight="bold")


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
    axes.plot(x, factor * (value + slope * np.log2(x / middle)), color=STYLE.ink, linewidth=1.2, gid="trend")


def _levels(identification: Identification) -> Real:
    """Return the ranges of the subsets' levels, shape (subsets, 2)."""
    return np.array([subset.level for subset in identification.subsets], dtype=np.float64).reshape(-1, 2)


def _draw_values(axes: Axes, levels: Real, values: Real, intervals: Real, colour: str) -> None:
    """Draw values at the middle of their levels, and a cross on the axis for a missing one."""
    centres, half = levels.mean(axis=1), np.diff(levels, axis=1)[:, 0] / 2
    shown = np.isfinite(values)
    lengths: dict[str, Any] = {"xerr": half[shown], "yerr": np.nan_to_num(intervals[shown])}
    style: dict[str, Any] = {"fmt": "o", "color": colour, "markersize": 5.5, "capsize": 3, "linewidth": 1.2}
    axes.errorbar(centres[shown], values[shown], **lengths, **style)
    missing: dict[str, Any] = {"marker": "X", "markersize": 6, "color": STYLE.faint, "clip_on": False}
    for centre in centres[~shown]:
        axes.plot([centre], [0], transform=axes.get_xaxis_transform(), gid="not found", **missing)
    low, high = levels.min(), levels.max()
    margin = 0.06 * (high - low) or 0.1 * abs(high) or 1.0
    axes.set_xlim(low - margin, high + margin)


def _draw_counts(axes: Axes, identification: Identification) -> None:
    """Draw the number of segments in each subset."""
    levels = _levels(identification)
    counts = [subset.n_segments for subset in identification.subsets]
    centres = levels.mean(axis=1)
    widths = np.maximum(np.diff(levels, axis=1)[:, 0] * 0.94, 1e-12)
    axes.bar(centres, counts, width=widths, color="#C9D3DC", edgecolor=STYLE.faint)
    for k, (centre, count) in enumerate(zip(centres, counts, strict=True)):
        draw.note(axes, f"subset {k + 1}: {count}", (centre, count + 0.04 * max(counts)), ha="center", va="bottom")
    axes.set_ylim(0, max(1.35 * max(counts), 3))
    axes.yaxis.set_major_locator(MaxNLocator(4, integer=True))
    axes.set_ylabel("Segments [-]")
    axes.set_xlabel(
        "Level: RMS of the channels over that of the first record; of the thesis: RMS of the correlations [-]"
    )


def stable_rates_figure(identification: Identification, *, source: str = "", threshold: float | None = None) -> Figure:
    """Draw the rate of stable points of every alignment over its frequency, a panel for each subset.

    Parameters
    ----------
    identification
        Result of any method.
    source
        Name of the recording, for the heading.
    threshold
        Smallest rate of a mode; None: that of the settings.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> axes = stable_rates_figure(identification).axes[0]
    >>> axes.get_xlabel(), axes.get_ylabel()
    ('Frequency [Hz]; dashed: threshold', 'rate [-]')
    """
    wanted = identification.settings.criteria.stable_rate if threshold is None else threshold
    subsets = identification.subsets
    height = 1.5 + 1.7 * len(subsets)
    figure = draw.new_figure("Rate of stable points", origin(identification), height=height, source=source)
    panels = draw.panels(figure, len(subsets), sharex=True)[:, 0]
    shown = frequency_range(identification)
    for number, (axes, subset) in enumerate(zip(panels, subsets, strict=True)):
        shown.put_on(axes)
        frequency, rate = alignment_rates(subset)
        is_kept = rate >= wanted
        for chosen, colour in ((~is_kept, STYLE.faint), (is_kept, STYLE.colours[0])):
            axes.vlines(frequency[chosen], 0, rate[chosen], color=colour, linewidth=2.5)
        for place, height in zip(frequency[is_kept], rate[is_kept], strict=True):
            draw.note(axes, f"{place:.2f}", (place, height), ha="center", va="bottom")
        axes.axhline(wanted, color=STYLE.colours[1], linewidth=1, linestyle="--")
        name = "" if subset.level is None else f"subset {number + 1}\n{counted(subset.n_segments, 'segment')}\n"
        axes.set(ylim=(0, 1.15), ylabel=f"{name}rate [-]")
    panels[-1].set_xlabel("Frequency [Hz]; dashed: threshold")
    return figure


def alignment_rates(subset: SubsetModes) -> tuple[np.ndarray, np.ndarray]:
    """Return mean frequency [Hz] and rate of stable points of every alignment of a subset's first diagram.

    References
    ----------
    F. Liu (2020), eq. 3-57 (stable rate).

    Examples
    --------
    Each mode is an alignment that is stable at most model orders:

    >>> import numpy as np
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> frequency, rate = alignment_rates(identification.subsets[0])
    >>> nearest = [np.abs(frequency - mode).argmin() for mode in identification.modes.natural_frequency]
    >>> frequency[nearest].round().tolist(), bool(rate[nearest].min() > 0.5)
    ([7.0, 20.0, 28.0], True)
    """
    if not subset.diagrams:
        return np.zeros(0), np.zeros(0)
    diagram = subset.diagrams[0]
    numbers = np.unique(diagram.alignments[diagram.alignments >= 0])
    frequency, rate = np.empty(numbers.size), np.empty(numbers.size)
    for row, number in enumerate(numbers):
        members = diagram.alignments == number
        frequency[row] = diagram.poles.natural_frequency[members].mean()
        rate[row] = np.unique(diagram.poles.rungs[members]).size / len(diagram.poles.ladder)
    return frequency, rate
