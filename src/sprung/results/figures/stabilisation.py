"""Stabilisation diagram over the spectrum."""

from types import MappingProxyType
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from sprung._arrays import Indices, Real
from sprung._display import counted
from sprung.identification import BlockRowLadder, Identification, OrderLadder, SubsetModes
from sprung.identification.fdd import find_bells
from sprung.identification.ladders import PolynomialLadder
from sprung.identification.stabilisation import StabilisationDiagram
from sprung.modal import PoleStatus
from sprung.results.figures import draw
from sprung.results.figures.draw import STYLE, mode_colour, origin
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

#: Colour of the second and further singular values, and mark of the peaks of the first.
_LOWER_CURVE = "#D5DEE8"
_PEAK: MappingProxyType[str, Any] = MappingProxyType(
    {"linestyle": "none", "marker": 7, "markersize": 6, "color": "#5A738A", "markeredgecolor": "white"}
)

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
            _mark_peaks(behind, identification, used, level)
    behind.set_ylim(curve_limits(np.concatenate(seen), dynamic_range=STYLE.diagram_span, room=room))
    behind.set_ylabel("Singular values of the spectra,\nchannels of variance 1 [dB re 1/Hz]", fontsize=STYLE.small)
    behind.yaxis.label.set_color("#5A738A")
    behind.tick_params(labelsize=STYLE.small, colors="#5A738A")
    behind.spines["top"].set_visible(False)


def _mark_peaks(axes: Axes, identification: Identification, spectra: SpectralMatrix, level: Real) -> None:
    """Mark the peaks of the first singular value; for FDD, draw its half-power bells in the modes' colours."""
    peaks = find_bells(spectra, band=identification.plan.mode_band).peaks
    axes.plot(spectra.frequencies[peaks], level[peaks], gid="peak", **_PEAK)
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
