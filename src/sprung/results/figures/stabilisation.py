"""Stabilisation diagrams over the spectrum; modes of subsets against their level, MAC of the shapes, stable rates."""

from collections.abc import Sequence
from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure, SubFigure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch
from matplotlib.ticker import MaxNLocator, ScalarFormatter

from sprung._arrays import Indices, Real
from sprung._display import counted
from sprung.identification import BlockRowLadder, Identification, OrderLadder, SubsetModes
from sprung.identification.fdd import find_bells
from sprung.identification.ladders import PolynomialLadder
from sprung.identification.stabilisation import StabilisationDiagram
from sprung.modal import INTERVAL_95, Modes, PoleStatus, join_modes, mac
from sprung.results.figures import draw
from sprung.results.figures.draw import STYLE, in_hertz, mode_colour, mode_name, mode_values, origin
from sprung.results.figures.frequency_axis import (
    FrequencyRange,
    curve_limits,
    frequency_range,
    harmonic_handles,
    head_room,
    mark_harmonics,
    mark_modes,
)
from sprung.signals.spectrum import SpectralMatrix, singular_values

#: Colour of the second and further singular values, mark of peaks, and lines beside a peak that are below it.
_LOWER_CURVE = "#D5DEE8"
_PEAK: MappingProxyType[str, Any] = MappingProxyType(
    {"linestyle": "none", "marker": 7, "markersize": 6, "color": "#5A738A", "markeredgecolor": "white"}
)
_NEAR = 2

#: Status of a pole in few words, and its marker; filled, large and dark markers are closer to a mode.
_WORDS_AND_MARKERS: MappingProxyType[PoleStatus, tuple[str, dict[str, Any]]] = MappingProxyType(
    {
        PoleStatus.SELECTED: ("selected: part of a mode", {"marker": "o", "markersize": 5.5}),
        PoleStatus.UNCONFIRMED: ("stable, but not confirmed", {"marker": "v", "markersize": 4.5}),
        PoleStatus.NOT_PICKED: ("selected, but not picked", {"marker": "p", "markersize": 5}),
        PoleStatus.RARE: ("stable, but at too few orders", {"marker": "^", "markersize": 4.5}),
        PoleStatus.INSIGNIFICANT: ("stable, but not significant", {"marker": "s", "markersize": 4}),
        PoleStatus.UNCERTAIN: ("stable, but too uncertain", {"marker": "D", "markersize": 4}),
        PoleStatus.HARMONIC: ("at a harmonic", {"marker": "x", "markersize": 4.5}),
        PoleStatus.SHAPE_CHANGED: ("shape changes", {"marker": "+", "markersize": 4.5}),
        PoleStatus.DAMPING_CHANGED: ("damping changes", {"marker": "1", "markersize": 5}),
        PoleStatus.FREQUENCY_CHANGED: ("frequency changes", {"marker": ".", "markersize": 2.5}),
        PoleStatus.INCOHERENT_SHAPE: ("arbitrary phases", {"marker": "2", "markersize": 5}),
        PoleStatus.OUT_OF_BAND: ("out of the band", {"marker": "3", "markersize": 5}),
        PoleStatus.UNPHYSICAL_DAMPING: ("unphysical damping", {"marker": "_", "markersize": 3.5}),
    }
)
#: What a rung of each kind of ladder is.
_RUNGS: MappingProxyType[type, str] = MappingProxyType(
    {
        OrderLadder: "Model order",
        BlockRowLadder: "Number of block rows",
        PolynomialLadder: "Order of the polynomials",
    }
)
_STABLE = (
    PoleStatus.NOT_PICKED,
    PoleStatus.INSIGNIFICANT,
    PoleStatus.UNCONFIRMED,
    PoleStatus.RARE,
    PoleStatus.UNCERTAIN,
)


def stabilisation_figure(identification: Identification, *, source: str = "") -> Figure:
    """Draw the poles of all rungs over the spectrum, with their status, harmonics and modes.

    Parameters
    ----------
    identification
        Result of any method.
    source
        Name of the recording, for the heading.

    Returns
    -------
    matplotlib.figure.Figure
        A panel for each subset of segments. Diagrams of several splits of outputs and references lie on top of each
        other. The curves behind are the singular values of the spectral matrix, each channel scaled to a variance of 1,
        with marks at the peaks that exceed chance; after cepstrum editing the first one before it is drawn too,
        dashed. FDD has no poles: the bells of its modes are drawn in their colours.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> masses = chain()
    >>> run = simulate(masses, usual_excitation(masses), duration=60.0, sampling_rate=200.0, seed=1)
    >>> identification = cov_ssi(run)
    >>> figure = stabilisation_figure(identification)
    >>> figure.axes[0].get_ylabel(), [text.get_text() for text in figure.legends[0].get_texts()][-3:]
    ('Model order', ['first singular value', 'further singular values', 'peak above chance'])
    """
    subsets = identification.subsets
    height = 4.6 if len(subsets) == 1 else 3.45
    title = "Stabilisation diagram" if subsets[0].diagrams else "Singular values of the spectra"
    size: dict[str, float] = {"width": STYLE.wide, "height": 1.9 + height * len(subsets)}
    figure = draw.new_figure(title, origin(identification), source=source, **size)
    panels = draw.panels(figure, len(subsets), sharex=True)[:, 0]
    shown = frequency_range(identification)
    for k, (axes, subset) in enumerate(zip(panels, subsets, strict=True)):
        shown.put_on(axes)
        _draw_poles(axes, subset, identification.members[:, k])
        room = head_room(identification.harmonics, 0.9 * height)
        rungs = subset.diagrams[0].poles.ladder[-1] + 1 if subset.diagrams else 1
        axes.set_ylim(0, rungs / (1 - room))
        if not subset.diagrams:
            axes.set_yticks([])
        mark_harmonics(axes, identification.harmonics, width=0.83 * STYLE.wide)
        mark_modes(axes, identification.modes, width=0.83 * STYLE.wide, height=height, has_labels=k == 0)
        _draw_spectra(axes, identification, shown, room)
        axes.set_ylabel(_rung_label(identification, k))
    panels[-1].set_xlabel("Frequency [Hz]")
    draw.legend(figure, _legend(identification), n_columns=4)
    return figure


def _rung_label(identification: Identification, index: int) -> str:
    """Return the label of the order axis of a subset."""
    subset = identification.subsets[index]
    if not subset.diagrams:
        return ""
    rung = _RUNGS[type(identification.plan.ladder)]
    if subset.level is None:
        return rung
    level = f"level {subset.level[0]:.3g} to {subset.level[1]:.3g}"
    return f"subset {index + 1}, {counted(subset.n_segments, 'segment')}\n{level}\n{rung}"


def _draw_poles(axes: Axes, subset: SubsetModes, members: Indices) -> None:
    """Draw the poles of one subset, those of modes in the modes' colours."""
    for diagram, alignments in zip(subset.diagrams, subset.alignments.T, strict=True):
        rungs = np.array(diagram.poles.ladder, dtype=float)[diagram.poles.rungs]
        frequency = diagram.poles.natural_frequency
        for status in reversed(PoleStatus):
            chosen = diagram.status == status
            if status != PoleStatus.SELECTED and chosen.any():
                axes.plot(frequency[chosen], rungs[chosen], gid=status.name, **_marker(status))
        numbers = _mode_numbers(diagram, alignments, members)
        for mode in np.unique(numbers[diagram.status == PoleStatus.SELECTED]):
            chosen = (diagram.status == PoleStatus.SELECTED) & (numbers == mode)
            marker = _marker(PoleStatus.SELECTED, mode_colour(mode))
            axes.plot(frequency[chosen], rungs[chosen], gid="SELECTED", **marker)


def _mode_numbers(diagram: StabilisationDiagram, alignments: Indices, members: Indices) -> Indices:
    """Return for each pole the index of the merged mode that its alignment belongs to, -1 for none.

    `alignments` are those of the subset's modes in this diagram, `members` the subset's modes in the merged ones.
    """
    numbers = np.full(len(diagram.status), -1)
    for mode, member in enumerate(members):
        if member >= 0 and alignments[member] >= 0:
            numbers[diagram.alignments == alignments[member]] = mode
    return numbers


def _marker(status: PoleStatus, colour: str = STYLE.ink) -> dict[str, Any]:
    """Return the marker of a pole of this status; `colour` is that of a selected pole."""
    style = {"linestyle": "none", "zorder": 2.0, "markeredgewidth": 0.8, **_WORDS_AND_MARKERS[status][1]}
    if status == PoleStatus.SELECTED:
        return style | {"color": colour, "markeredgecolor": "white", "markeredgewidth": 0.5, "zorder": 4.0}
    if status in _STABLE:
        return style | {"markerfacecolor": "none", "markeredgecolor": "#444444", "zorder": 3.0}
    if status == PoleStatus.HARMONIC:
        return style | {"markeredgecolor": STYLE.harmonic, "markeredgewidth": 1.2, "zorder": 3.0}
    return style | {"color": STYLE.faint}


def _draw_spectra(axes: Axes, identification: Identification, shown: FrequencyRange, room: float) -> None:
    """Draw the singular values on a second axis behind the poles, with their peaks and the bells of FDD."""
    behind = axes.twinx()
    behind.set_zorder(axes.get_zorder() - 1)
    axes.patch.set_visible(False)
    edited = identification.edited_spectra
    used = identification.spectra if edited is None else edited
    curves: list[tuple[SpectralMatrix, Any, str]] = [(used, "-", "first singular value")]
    if edited is not None:
        curves.append((identification.spectra, (0, (2, 1.5)), "first singular value before editing"))
    seen = []
    for spectra, style, gid in curves:
        levels = singular_values_in_decibels(spectra, like=identification.spectra)
        level = levels[0]
        behind.plot(spectra.frequencies[1:], level[1:], color=STYLE.background, linestyle=style, linewidth=1.0, gid=gid)
        seen.append(level[shown.holds(spectra.frequencies)])
        if spectra is used:
            for lower in levels[1:]:
                behind.plot(spectra.frequencies[1:], lower[1:], color=_LOWER_CURVE, linewidth=0.7, gid="singular value")
            _mark_peaks(behind, identification, used, levels)
    behind.set_ylim(curve_limits(np.concatenate(seen), dynamic_range=STYLE.diagram_span, room=room))
    behind.set_ylabel("Singular values of the spectra,\nchannels of variance 1 [dB re 1/Hz]", fontsize=STYLE.small)
    behind.yaxis.label.set_color("#5A738A")
    behind.tick_params(labelsize=STYLE.small, colors="#5A738A")
    behind.spines["top"].set_visible(False)


def _mark_peaks(axes: Axes, identification: Identification, spectra: SpectralMatrix, levels: Real) -> None:
    """Mark the peaks on the curve that peaks; for FDD, draw half-power bells of the first in the modes' colours."""
    peaks, level = find_bells(spectra, band=identification.plan.mode_band).peaks, levels[0]
    beyond = [np.clip(peaks + side * _NEAR, 0, level.size - 1) for side in (-1, 1)]
    is_of_first = level[peaks] >= np.max(level[beyond], axis=0)
    heights = np.where(is_of_first, level[peaks], levels[min(1, len(levels) - 1)][peaks])
    axes.plot(spectra.frequencies[peaks], heights, gid="peak", **_PEAK)
    if identification.method != "fdd":
        return
    step = spectra.frequencies[1]
    for mode, (frequency, damping) in enumerate(
        zip(identification.modes.natural_frequency, identification.modes.damping_ratio, strict=True)
    ):
        width = max(2 * damping * frequency, 2 * step)
        bell = np.abs(spectra.frequencies - frequency) <= width
        axes.plot(spectra.frequencies[bell], level[bell], color=mode_colour(mode), linewidth=2.4, gid="bell")


def singular_values_in_decibels(spectra: SpectralMatrix, *, like: SpectralMatrix) -> Real:
    """Return the singular values at each frequency [dB re 1/Hz], channels scaled to variance 1 in `like`."""
    variance = like.densities[:, 1:].sum(axis=1) * (like.frequencies[1] - like.frequencies[0])
    scale = 1 / np.sqrt(np.maximum(variance, np.finfo(float).tiny))
    matrix = spectra.matrix * scale[:, None, None] * scale[:, None]
    scaled = SpectralMatrix(spectra.frequencies, matrix, spectra.names, spectra.segment_length, spectra.n_segments)
    return 10 * np.log10(np.maximum(singular_values(scaled), 1e-30))


def _legend(identification: Identification) -> list[Line2D | Patch]:
    """Return a legend entry with its count for each status that occurs, and for the lines."""
    statuses = [diagram.status for subset in identification.subsets for diagram in subset.diagrams]
    counts = np.bincount(np.concatenate([np.zeros(0, dtype=np.int8), *statuses]), minlength=len(PoleStatus))
    found = [status for status in PoleStatus if counts[status]]
    name, line = "first singular value", {"color": STYLE.background}
    before = []
    if identification.edited_spectra is not None:
        before = [draw.entry(f"{name} before editing", linestyle=(0, (2, 1.5)), **line)]
        name = f"{name} after cepstrum editing"
    return [
        *(draw.entry(f"{_WORDS_AND_MARKERS[status][0]} ({counts[status]})", **_marker(status)) for status in found),
        *harmonic_handles(identification.harmonics),
        *before,
        draw.entry(name, **line),
        draw.entry("further singular values", color=_LOWER_CURVE),
        draw.entry("peak above chance", **_PEAK),
    ]


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
        draw.legend(figure, _legend_of_levels(), n_columns=2)
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


def _legend_of_levels() -> list[Line2D]:
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
