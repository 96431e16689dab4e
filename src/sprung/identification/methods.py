"""Cov-SSI, ACS-Cov-SSI and CoSS-SSI: from recordings of one condition to modes."""

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, replace
from functools import reduce
from operator import add

import numpy as np

from sprung._arrays import Booleans, Indices, Real
from sprung._checks import check_one_of, freeze
from sprung.errors import DataError
from sprung.identification.contribution import complete_shapes
from sprung.identification.correlation import (
    Correlations,
    SegmentCorrelations,
    average,
    correlate_segments,
    join_segments,
    with_limited_power,
)
from sprung.identification.planning import disjoint_splits, make_plan, sized
from sprung.identification.preparation import Prepared, prepare
from sprung.identification.settings import IdentificationSettings, Plan
from sprung.identification.stabilisation import (
    StabilisationDiagram,
    merge_modes,
    select_modes,
    significant,
    stabilise,
    with_status,
)
from sprung.identification.subsets import subsets_of_equal_count, subsets_of_equal_width
from sprung.identification.subspace import block_row_ladder, poles_of_orders, realise
from sprung.modal import Modes, Poles, PoleStatus, unit_shapes
from sprung.recording import Channel, Recording
from sprung.signals.cepstrum import Exponential, Lifter, ShortPass, subtract_lifter_damping
from sprung.signals.harmonics import Harmonic, near_harmonic
from sprung.signals.spectrum import SpectralMatrix
from sprung.vehicles.labels import labelled
from sprung.vehicles.usable import AnyVehicle, usable


@dataclass(frozen=True, eq=False, slots=True)
class SubsetModes:
    """The modes of one subset of segments.

    Parameters
    ----------
    level
        Range of the segments' levels (relative to the mean power of the record); None where not sorted.
    n_segments
        Number of segments averaged.
    modes
        Identified from their average.
    diagrams
        Stabilisation diagrams behind the modes, one for each split of outputs and references.
    alignments
        The alignment behind each mode in each diagram, -1 for none; shape (modes, diagrams).
    """

    level: tuple[float, float] | None
    n_segments: int
    modes: Modes
    diagrams: tuple[StabilisationDiagram, ...]
    alignments: Indices


@dataclass(frozen=True, eq=False, slots=True)
class Identification:
    """Modes of one condition, with everything that led to them.

    Parameters
    ----------
    method
        "cov", "acs" or "coss".
    channels
        Outputs, in the order of the mode shapes.
    sampling_rate
        At which the correlations were taken [Hz].
    modes
        By rising frequency, merged over the subsets.
    subsets
        What each subset gave.
    members
        For each mode and subset the index of the subset's mode, -1 where it has none; shape (modes, subsets).
    band
        In which motion is expected [Hz]: as given, around the vehicle's own modes, or where the channels move together.
    harmonics
        Lines of the excitation, which are no modes.
    spectra, edited_spectra
        Before and after cepstrum editing (None without).
    settings
        With block rows, orders, segments and sampling rate filled in where they were chosen from the data.
    notes
        What a reader should know, one sentence each.
    """

    method: str
    channels: tuple[Channel, ...]
    sampling_rate: float
    modes: Modes
    subsets: tuple[SubsetModes, ...]
    members: Indices
    band: tuple[float, float]
    harmonics: tuple[Harmonic, ...]
    spectra: SpectralMatrix
    edited_spectra: SpectralMatrix | None
    settings: IdentificationSettings
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        freeze(self, members=2, dtype=np.intp)

    def __str__(self) -> str:
        """Return the modes as a table: values with their standard deviations, share of stable rungs, label."""
        modes = self.modes
        lines = [f"{'frequency [Hz]':>21} {'damping [%]':>19} {'stable':>7}  label"]
        for k, label in enumerate(modes.labels):
            frequency = f"{modes.natural_frequency[k]:10.4g} ± {modes.natural_frequency_std[k]:<8.2g}"
            damping = f"{100 * modes.damping_ratio[k]:8.3g} ± {100 * modes.damping_ratio_std[k]:<8.2g}"
            lines.append(f"{frequency} {damping} {modes.stable_rate[k]:7.2f}  {label or ''}".rstrip())
        return "\n".join(lines)


Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False, slots=True)
class CorrelationSummary:
    """What modes are identified from: far smaller than the samples, and nearly sufficient.

    Parameters
    ----------
    method
        "cov", "acs" or "coss".
    plan
        What was chosen from the data.
    channels
        Outputs.
    subsets
        Range of level (None where not sorted) and correlations of each.
    average
        Of all segments.
    harmonics
        Lines that are no modes.
    """

    method: str
    plan: Plan
    channels: tuple[Channel, ...]
    subsets: tuple[tuple[tuple[float, float] | None, Correlations], ...]
    average: Correlations
    harmonics: tuple[Harmonic, ...]


def cov_ssi(
    recordings: Recording | Iterable[Recording],
    *,
    settings: IdentificationSettings | None = None,
    vehicle: AnyVehicle | None = None,
    on_progress: Progress | None = None,
) -> Identification:
    """Identify modes from the correlations of whole records (Cov-SSI).

    Parameters
    ----------
    recordings
        One record, or several of one condition, whose correlations are averaged. An iterator is read once, one record
        at a time; what is chosen from the data is then chosen from the first.
    settings
        Default: everything chosen from the data.
    vehicle
        Gives the sensor layout, the name of the speed channel, the band of interest and the labels.
    on_progress
        Called with what is being done and how far it is (0 to 1).

    Returns
    -------
    Identification

    Raises
    ------
    DataError
        If a channel is dead or the records are too short.
    ParameterError
        If a setting cannot be used.

    References
    ----------
    F. Liu (2020), chapters 3 and 4. B. Peeters and G. De Roeck (1999), Reference-based stochastic subspace
    identification for output-only modal analysis.

    Examples
    --------
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> run = simulate(three_masses, usual_excitation(three_masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> cov_ssi(run).modes.natural_frequency.round(1)
    array([ 7. , 19.7, 28.4])
    """
    return _identify("cov", recordings, settings, vehicle, on_progress)


def acs_ssi(
    recordings: Recording | Iterable[Recording],
    *,
    settings: IdentificationSettings | None = None,
    vehicle: AnyVehicle | None = None,
    on_progress: Progress | None = None,
) -> Identification:
    """Identify modes from the average of the segments' correlations (ACS-Cov-SSI); parameters as `cov_ssi`."""
    return _identify("acs", recordings, settings, vehicle, on_progress)


def coss_ssi(
    recordings: Recording | Iterable[Recording],
    *,
    settings: IdentificationSettings | None = None,
    vehicle: AnyVehicle | None = None,
    on_progress: Progress | None = None,
) -> Identification:
    """Identify modes from subsets of segments of similar level and merge them (CoSS-SSI); parameters as `cov_ssi`.

    Notes
    -----
    The subsets' own modes stay in the result: for a suspension with friction and progressive springs their change with
    the level is information. For a linear system, sorting short segments by level biases damping (low subset high, high
    subset low); longer segments reduce it.
    """
    return _identify("coss", recordings, settings, vehicle, on_progress)


#: The methods by the name they have in results and on the command line.
METHODS = {"cov": cov_ssi, "acs": acs_ssi, "coss": coss_ssi}


@dataclass(frozen=True, slots=True)
class _Gathered:
    """What is kept of one record."""

    channels: tuple[Channel, ...]
    segments: SegmentCorrelations
    spectra: SpectralMatrix
    edited_spectra: SpectralMatrix | None
    harmonics: tuple[Harmonic, ...]


def _identify(
    method: str,
    recordings: Recording | Iterable[Recording],
    settings: IdentificationSettings | None,
    vehicle: AnyVehicle | None,
    on_progress: Progress | None,
) -> Identification:
    """Prepare, correlate, sort, realise, select, merge and label."""
    report = on_progress or (lambda doing, share: None)
    records = [recordings] if isinstance(recordings, Recording) else recordings
    plan, gathered, notes = _gathered(method, records, settings or IdentificationSettings(), vehicle, report)
    summary, merged_subsets = _summary(method, plan, gathered)
    subsets, merged, members = _modes(summary, report)
    edited = [part.edited_spectra for part in gathered if part.edited_spectra is not None]
    report("done", 1.0)
    return Identification(
        method=method,
        channels=summary.channels,
        sampling_rate=summary.average.sampling_rate,
        modes=labelled(merged, summary.channels, vehicle=vehicle),
        subsets=tuple(subsets),
        members=members,
        band=plan.band,
        harmonics=summary.harmonics,
        spectra=reduce(add, [part.spectra for part in gathered]),
        edited_spectra=reduce(add, edited) if edited else None,
        settings=plan.settings,
        notes=(*plan.notes, *notes, *merged_subsets, *_notes_on_modes(merged, plan.settings.lifter)),
    )


def summarise(
    method: str,
    recordings: Recording | Iterable[Recording],
    *,
    settings: IdentificationSettings | None = None,
    vehicle: AnyVehicle | None = None,
) -> CorrelationSummary:
    """Return what modes are identified from; `method` is one of `METHODS`, the rest as for `cov_ssi`."""
    check_one_of("method", method, METHODS)
    records = [recordings] if isinstance(recordings, Recording) else recordings
    plan, gathered, _ = _gathered(method, records, settings or IdentificationSettings(), vehicle, lambda *_: None)
    return _summary(method, plan, gathered)[0]


def modes_of_summary(summary: CorrelationSummary, *, vehicle: AnyVehicle | None = None) -> Modes:
    """Return the modes that a summary holds: those of the identification of its recordings."""
    return labelled(_modes(summary, lambda *_: None)[1], summary.channels, vehicle=vehicle)


def _summary(method: str, plan: Plan, gathered: Sequence[_Gathered]) -> tuple[CorrelationSummary, tuple[str, ...]]:
    """Average the segments of records, and tell which subsets were merged."""
    segments = with_limited_power(join_segments([part.segments for part in gathered]))
    harmonics = _common_harmonics([part.harmonics for part in gathered])
    subsets, notes = _subsets(method, segments, plan.settings)
    return CorrelationSummary(method, plan, gathered[0].channels, tuple(subsets), average(segments), harmonics), notes


def _modes(summary: CorrelationSummary, report: Progress) -> tuple[list[SubsetModes], Modes, Indices]:
    """Return the subsets with their modes, the merged modes, and which of the subsets' modes each is."""
    plan, found = summary.plan, []
    for k, (level, correlations) in enumerate(summary.subsets):
        report(
            f"realising all orders of subset {k + 1} of {len(summary.subsets)}", 0.5 + 0.5 * k / len(summary.subsets)
        )
        found.append(_subset_modes(level, correlations, summary.harmonics, plan))
    merged, members = merge_modes([s.modes for s in found], weights=[s.n_segments for s in found])
    is_kept = significant(merged, summary.average, least=plan.settings.criteria.contribution)
    factors = np.array(list(plan.factors.values()))
    found = [_without(subset, members[~is_kept, k], members[:, k]) for k, subset in enumerate(found)]
    lifter = plan.settings.lifter
    found = [replace(subset, modes=_as_measured(subset.modes, factors, lifter)) for subset in found]
    return found, _as_measured(merged.take(np.flatnonzero(is_kept)), factors, lifter), members[is_kept]


def _gathered(
    method: str,
    records: Iterable[Recording],
    settings: IdentificationSettings,
    vehicle: AnyVehicle | None,
    report: Progress,
) -> tuple[Plan, list[_Gathered], list[str]]:
    """Prepare and correlate record by record; the plan comes from the first."""
    n_records = len(records) if isinstance(records, Sequence) else 0
    total = sum(record.duration for record in records) if isinstance(records, Sequence) else None
    plan: Plan | None = None
    gathered: list[_Gathered] = []
    notes: list[str] = []
    first_error: DataError | None = None
    for k, record in enumerate(records):
        report(f"correlating record {k + 1}", 0.5 * k / n_records if n_records else 0.0)
        try:
            moving = usable(record, vehicle=vehicle)
            if plan is None:
                first = make_plan(moving, settings=settings, vehicle=vehicle)
                prepared = prepare(moving, first)
                plan = sized(first, prepared, method=method, total_duration=total or moving.duration)
            else:
                prepared = prepare(moving, plan)
            gathered.append(_gather(method, prepared, plan))
        except DataError as error:
            first_error = first_error or error
            notes.append(f"record {k + 1} left out: {error}")
    if plan is None or not gathered:
        raise first_error or DataError("there is no recording to identify modes from: give at least one")
    return plan, gathered, notes


def _gather(method: str, prepared: Prepared, plan: Plan) -> _Gathered:
    """Correlate one record."""
    settings = plan.settings
    segments = correlate_segments(
        prepared.motion,
        n_lags=plan.n_lags,
        segment=settings.segment,
        references=None if settings.has_disjoint_references else settings.references,
        is_continued=method == "cov",
    )
    return _Gathered(prepared.motion.channels, segments, prepared.spectra, prepared.edited_spectra, prepared.harmonics)


def _notes_on_modes(modes: Modes, lifter: Lifter | None) -> list[str]:
    """Tell where there are no modes, or a short-pass lifter is too short for the ring-down of one."""
    if not len(modes):
        return ["no mode found: record longer, widen the band, or look at the reasons in the stabilisation diagram"]
    if not isinstance(lifter, ShortPass):
        return []
    # The lifter itself shortens a ring-down to about its own length, so a margin of two is needed to see that.
    return [
        f"the lifter of {lifter.length:g} s is hardly longer than the ring-down of the mode at {frequency:.3g} Hz"
        f" ({-1 / pole.real:.2g} s): its damping ratio may be far too high, use a longer lifter"
        for frequency, pole in zip(modes.natural_frequency, modes.poles, strict=True)
        if -1 / pole.real > lifter.length / 2
    ]


def _common_harmonics(found: Sequence[Sequence[Harmonic]]) -> tuple[Harmonic, ...]:
    """Return the lines that at least half of the records show, each as its most prominent record has it."""
    lines = sorted((line for lines in found for line in lines), key=lambda line: -line.prominence)
    n_records = sum(_same(lines, others).any(axis=1) for others in found) if lines else np.zeros(0)
    common = [
        line for line, n in zip(lines, np.broadcast_to(n_records, len(lines)), strict=True) if 2 * n >= len(found)
    ]
    is_same = _same(common, common)
    kept: list[int] = []
    for row in range(len(common)):
        if not is_same[row, kept].any():
            kept.append(row)
    return tuple(sorted((common[row] for row in kept), key=lambda line: (line.kind, line.frequency)))


def _same(lines: Sequence[Harmonic], others: Sequence[Harmonic]) -> Booleans:
    """Tell which lines are the same, shape (lines, others): of one kind, within the coarser resolution."""
    width = np.maximum.outer([line.resolution for line in lines], [other.resolution for other in others])
    apart = np.abs(np.subtract.outer([line.frequency for line in lines], [other.frequency for other in others]))
    is_one_kind = np.equal.outer([line.kind == "speed" for line in lines], [other.kind == "speed" for other in others])
    return np.asarray(is_one_kind & (apart <= width), dtype=np.bool_)


def _subsets(
    method: str, segments: SegmentCorrelations, settings: IdentificationSettings
) -> tuple[list[tuple[tuple[float, float] | None, Correlations]], tuple[str, ...]]:
    """Average the segments, for CoSS-SSI by their level."""
    if method != "coss":
        return [(None, average(segments, is_biased=settings.is_biased))], ()
    sort = subsets_of_equal_count if settings.has_equal_counts else subsets_of_equal_width
    sorted_segments = sort(segments, settings.n_subsets, is_biased=settings.is_biased)
    return [(subset.level, subset.correlations) for subset in sorted_segments.subsets], sorted_segments.notes


def _subset_modes(
    level: tuple[float, float] | None, correlations: Correlations, harmonics: Sequence[Harmonic], plan: Plan
) -> SubsetModes:
    """Identify the modes of one average, in all splits of outputs and references."""
    names = correlations.channels
    splits = disjoint_splits(names) if plan.settings.has_disjoint_references else ()
    parts, diagrams, alignments = [], [], []
    for outputs, references in splits or [(names, correlations.references)]:
        chosen = correlations.select(outputs, references) if splits else correlations
        diagram = _diagram(chosen, harmonics, plan)
        modes, kept = select_modes(diagram)
        if splits:
            shapes = complete_shapes(modes.poles, modes.mode_shapes, correlations, outputs)
            modes = replace(modes, mode_shapes=unit_shapes(shapes), channels=names)
        parts.append(modes)
        diagrams.append(diagram)
        alignments.append(kept)
    modes, members = merge_modes(parts, weights=[1.0] * len(parts))
    behind = np.full(members.shape, -1)
    for k, kept in enumerate(alignments):
        behind[:, k] = np.where(members[:, k] >= 0, np.append(kept, -1)[members[:, k]], -1)
    return SubsetModes(level, correlations.n_segments, modes, tuple(diagrams), behind)


def _without(subset: SubsetModes, insignificant: Indices, merged: Indices) -> SubsetModes:
    """Say of the poles behind the subset's modes which are insignificant, and which were not merged (-1: no mode)."""
    diagrams = []
    for diagram, alignments in zip(subset.diagrams, subset.alignments.T, strict=True):
        unconfirmed = np.setdiff1d(diagram.alignments, alignments[merged[merged >= 0]])
        selected = np.unique(diagram.alignments[diagram.status == PoleStatus.SELECTED])
        changed = with_status(diagram, np.intersect1d(unconfirmed, selected), PoleStatus.UNCONFIRMED)
        dropped = alignments[insignificant[insignificant >= 0]]
        diagrams.append(with_status(changed, dropped[dropped >= 0], PoleStatus.INSIGNIFICANT))
    return replace(subset, diagrams=tuple(diagrams))


def _as_measured(modes: Modes, factors: Real, lifter: Lifter | None) -> Modes:
    """Return the modes without what scaling the channels and an exponential lifter did to them."""
    poles = modes.poles
    if isinstance(lifter, Exponential):
        poles = subtract_lifter_damping(poles, lifter.time_constant)
    return replace(modes, poles=poles, mode_shapes=unit_shapes(modes.mode_shapes / factors))


def _diagram(correlations: Correlations, harmonics: Sequence[Harmonic], plan: Plan) -> StabilisationDiagram:
    """Return the stabilisation diagram of one block matrix."""
    settings = plan.settings
    poles = _ladder(correlations, settings)
    resolution = correlations.sampling_rate / (2 * plan.n_lags)
    is_harmonic = near_harmonic(poles.natural_frequency, poles.damping_ratio, harmonics, resolution=resolution)
    return stabilise(poles, criteria=settings.criteria, band=plan.mode_band, is_harmonic=is_harmonic)


def _ladder(correlations: Correlations, settings: IdentificationSettings) -> Poles:
    """Return the poles of the ladder over orders, or of the thesis' ladder over block rows."""
    if settings.row_ladder is not None:
        rows = range(settings.row_ladder[0], settings.row_ladder[1] + 1)
        return block_row_ladder(correlations, rows, is_weighted=settings.is_weighted, is_hankel=settings.is_hankel)
    realisation = realise(
        correlations,
        block_rows=settings.block_rows or 0,
        max_order=settings.max_order or 0,
        is_weighted=settings.is_weighted,
        is_hankel=settings.is_hankel,
    )
    return poles_of_orders(realisation, range(2, (settings.max_order or 0) + 1, 2))
