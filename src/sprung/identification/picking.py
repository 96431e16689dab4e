"""Modes picked by hand from the stabilisation diagram or the singular values of an identification."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sprung._arrays import Indices
from sprung._checks import check_number, check_type
from sprung.errors import ParameterError
from sprung.identification.fdd import bells_at, modes_of_bells
from sprung.identification.planning import as_measured
from sprung.identification.results import Identification, SubsetModes
from sprung.identification.stabilisation import (
    StabilisationDiagram,
    merge_modes,
    select_modes,
    with_status,
    with_total_deviations,
)
from sprung.modal import Modes, PoleStatus, join_modes
from sprung.vehicles.labels import labelled
from sprung.vehicles.sensor_layout import AnyVehicle

#: Largest distance of stable poles from a picked frequency: this share of it, or their half-power half-bandwidth, or
#: this multiple of their standard deviation.
_SHARE, _DEVIATIONS = 0.02, 2.0
#: Number of alignments that a message names.
_NAMED = 3


def pick_modes(
    identification: Identification, frequencies: Sequence[float], *, vehicle: AnyVehicle | None = None
) -> Identification:
    """Return the modes at given frequencies, regardless of the automatic selection.

    Parameters
    ----------
    identification
        Result of any method, from one set-up.
    frequencies
        Natural frequencies [Hz], above 0; at least one. The nearest stable poles within 2 % (or their half-bandwidth,
        or twice their standard deviation) are the mode; by FDD, the nearest maximum of the first singular value.
    vehicle
        Vehicle of the identification, for the labels.

    Returns
    -------
    Identification
        The identification with the picked modes only, by rising frequency; its notes state what the automatic selection
        made of each. A mode that it selected from the same stable poles keeps its refinement and its trend with the
        level; others have the values of their poles.

    Raises
    ------
    ParameterError
        If no frequency is given, one is not above 0 or has no stable poles nearby, or outputs and references are
        disjoint, whose shapes are completed from correlations that are gone; or if set-ups are merged.

    Examples
    --------
    >>> from sprung.identification import cov_ssi
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> run = simulate(three_masses, usual_excitation(three_masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> pick_modes(cov_ssi(run), [19.5, 7.1]).modes.natural_frequency.round(1)
    array([ 7. , 19.7])
    """
    check_type("identification", identification, Identification)
    wanted = sorted(check_number("a picked frequency", frequency, above=0) for frequency in frequencies)
    if not wanted:
        raise ParameterError("no frequency is given to pick a mode at: give at least one")
    if identification.settings.has_disjoint_references:
        raise ParameterError("modes of disjoint outputs and references cannot be picked: identify them without")
    if identification.setups is not None:
        raise ParameterError("modes of merged set-ups cannot be picked: pick them in each set-up by itself")
    pick = _picked_bells if identification.method == "fdd" else _picked_poles
    picked, reasons = pick(identification, wanted)
    notes = [f"{frequency:.4g} Hz picked by hand ({reason})" for frequency, reason in reasons.items()]
    return replace(
        picked,
        modes=labelled(picked.modes, identification.channels, vehicle=vehicle),
        sources=(),  # by the method itself: the hand decides, also where a vehicle on its road would have
        notes=(*(note for note in identification.notes if not note.startswith("no mode found")), *notes),
    )


def _picked_bells(identification: Identification, wanted: Sequence[float]) -> tuple[Identification, dict[float, str]]:
    """Return the modes at the maxima of the first singular value that are nearest."""
    bells = bells_at(identification.spectra, wanted)
    modes = modes_of_bells(bells, identification.spectra, channels=identification.channels)
    before = identification.modes.natural_frequency
    reasons = {}
    for frequency in modes.natural_frequency.tolist():
        is_selected = np.any(np.abs(before - frequency) <= _SHARE * frequency)
        reasons[frequency] = "selected automatically too" if is_selected else "not selected automatically"
    nothing = np.zeros((len(modes), 0), dtype=np.intp)
    subset = replace(identification.subsets[0], modes=modes, alignments=nothing)
    return replace(identification, modes=modes, subsets=(subset,), members=np.arange(len(modes))[:, None]), reasons


def _picked_poles(identification: Identification, wanted: Sequence[float]) -> tuple[Identification, dict[float, str]]:
    """Return the modes of the alignments of stable poles that are nearest, merged over the subsets."""
    diagrams = [subset.diagrams[0] for subset in identification.subsets]
    chosen = np.array([[_nearest_alignment(diagram, frequency) for diagram in diagrams] for frequency in wanted])
    for frequency, alignments in zip(wanted, chosen, strict=True):
        if np.all(alignments < 0):
            raise ParameterError(_sentence(diagrams, frequency))
    chosen = np.unique(chosen, axis=0)
    subsets = [
        _subset_of(subset, column, identification)
        for subset, column in zip(identification.subsets, chosen.T, strict=True)
    ]
    members = np.array(
        [
            [
                int(np.flatnonzero(subset.alignments[:, 0] == alignment)[0]) if alignment >= 0 else -1
                for subset, alignment in zip(subsets, row, strict=True)
            ]
            for row in chosen
        ]
    )
    weights = [float(subset.n_segments) for subset in subsets]
    has_mean_shapes = not identification.settings.has_own_levels
    merged = [_merged([s.modes for s in subsets], weights, row, has_mean_shapes=has_mean_shapes) for row in members]
    origins = np.array([_origin(identification, alignments) for alignments in chosen])
    before = identification.modes
    places = np.where(origins >= 0, origins, len(before) + np.arange(len(origins)))
    modes = join_modes([before, *merged]).take(places)
    order = np.argsort(modes.natural_frequency)
    modes, origins = modes.take(order), origins[order]
    reasons = {float(modes.natural_frequency[k]): _reason(diagrams, chosen[row]) for k, row in enumerate(order)}
    refinement, trends = identification.refinement, identification.level_trends
    return (
        replace(
            identification,
            modes=modes,
            subsets=tuple(subsets),
            members=members[order],
            refinement=None if refinement is None else refinement.of(modes, origins, instead="it was picked by hand"),
            level_trends=None if trends is None else trends.of(origins),
        ),
        reasons,
    )


def _origin(identification: Identification, alignments: Indices) -> int:
    """Return the index of the automatically selected mode of the same stable poles, -1 for none."""
    for k, (source, members) in enumerate(zip(identification.sources, identification.members, strict=True)):
        behind = [
            int(subset.alignments[member, 0])
            for subset, member in zip(identification.subsets, members, strict=True)
            if member >= 0
        ]
        if source != "road_likelihood" and behind and behind == alignments[members >= 0].tolist():
            return k
    return -1


def _nearest_alignment(diagram: StabilisationDiagram, frequency: float) -> int:
    """Return the number of the nearest alignment, -1 if none is near enough."""
    places = _places(diagram)
    nearest, smallest = -1, np.inf
    for alignment, place in enumerate(places):
        members = diagram.alignments == alignment
        spread = np.nan_to_num(np.median(diagram.poles.natural_frequency_std[members]))
        width = np.median(diagram.poles.damping_ratio[members]) * frequency
        distance = abs(place - frequency)
        if distance <= max(_SHARE * frequency, width, _DEVIATIONS * spread) and distance < smallest:
            nearest, smallest = alignment, distance
    return nearest


def _places(diagram: StabilisationDiagram) -> list[float]:
    """Return the median frequency of each alignment."""
    frequency, n_alignments = diagram.poles.natural_frequency, diagram.alignments.max(initial=-1) + 1
    return [float(np.median(frequency[diagram.alignments == number])) for number in range(n_alignments)]


def _sentence(diagrams: Sequence[StabilisationDiagram], frequency: float) -> str:
    """Return the sentence for a frequency without stable poles."""
    places = [place for diagram in diagrams for place in _places(diagram)]
    if not places:
        return f"no stable poles near {frequency:.4g} Hz, nor anywhere else: use a higher order, or record longer"
    nearest = sorted(sorted(places, key=lambda place: abs(place - frequency))[:_NAMED])
    named = ", ".join(f"{place:.4g}" for place in nearest)
    return f"no stable poles near {frequency:.4g} Hz: the nearest are at {named} Hz, pick one of those"


def _subset_of(subset: SubsetModes, alignments: Indices, identification: Identification) -> SubsetModes:
    """Return a subset with the modes of the given alignments only (-1: none)."""
    diagram = subset.diagrams[0]
    kept = np.unique(alignments[alignments >= 0])
    selected = np.unique(diagram.alignments[diagram.status == PoleStatus.SELECTED])
    changed = with_status(diagram, np.setdiff1d(selected, kept), PoleStatus.NOT_PICKED)
    changed = with_status(changed, kept, PoleStatus.SELECTED)
    picked = select_modes(changed)
    modes = with_total_deviations(picked.modes, picked.deviations)
    return replace(
        subset,
        modes=as_measured(modes, identification.plan.preparation, identification.settings.lifter),
        diagrams=(changed,),
        alignments=picked.alignments[:, None],
    )


def _merged(parts: Sequence[Modes], weights: Sequence[float], row: Indices, *, has_mean_shapes: bool) -> Modes:
    """Return one mode from the subsets that have it."""
    present = np.flatnonzero(row >= 0).tolist()
    modes = [parts[k].take(row[[k]]) for k in present]
    merged = merge_modes(modes, weights=[weights[k] for k in present], has_mean_shapes=has_mean_shapes).modes
    return merged if len(merged) == 1 else modes[int(np.argmax([weights[k] for k in present]))]


def _reason(diagrams: Sequence[StabilisationDiagram], alignments: Indices) -> str:
    """Return in words what the automatic selection made of picked alignments: the best verdict of the subsets."""
    verdicts = [
        int(diagram.status[diagram.alignments == alignment].min())
        for diagram, alignment in zip(diagrams, alignments, strict=True)
        if alignment >= 0
    ]
    best = PoleStatus(min(verdicts))
    return "selected automatically too" if best == PoleStatus.SELECTED else f"not selected: {best.sentence}"
