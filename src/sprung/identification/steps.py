"""Steps of an identification: each takes a draft and returns it with what the step finds and notes."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sprung._arrays import Booleans, Indices, Real
from sprung.channel_names import is_imu
from sprung.errors import IdentificationError
from sprung.identification import levels, stabilisation
from sprung.identification.correlation import Correlations, average
from sprung.identification.fdd import find_bells, modes_of_bells
from sprung.identification.free_response import FreeFit
from sprung.identification.planning import as_measured, disjoint_splits, without_lifter
from sprung.identification.records import CorrelatedRecords, Progress, RunningRecords
from sprung.identification.refinement import Refinement, refined_by_spectra
from sprung.identification.results import CorrelationSummary, Identification, SubsetModes
from sprung.identification.road_modes import combined_modes, has_road, kept_records
from sprung.identification.roving import note_on_moved_sensors
from sprung.identification.settings import KINDS, IdentificationSettings, Method, Plan
from sprung.identification.stabilisation import complete_shapes, significant
from sprung.modal import Modes, PoleStatus, join_modes, mpc, unit_shapes
from sprung.recording import Channel, Recording, each_recording
from sprung.signals.harmonics import Harmonic, at_part_of_line, near_harmonic
from sprung.signals.spectrum import Lifter, ShortPass
from sprung.vehicles.labels import labelled
from sprung.vehicles.sensor_layout import AnyVehicle

#: Fewest segments from which the modes of a range of levels are identified.
_SEGMENTS_OF_A_SUBSET = 8
#: Damping ratio and modal phase collinearity of a pole of a drive below both of which it is a line.
_NARROW_ON_DRIVES = 0.02
_SHAPELESS = 0.5
#: Modal phase collinearity below which a shape is hardly that of one motion.
_MIXED = 0.3
#: Bounds of the natural frequencies of bodies on their suspensions [Hz].
_OF_BODIES = (0.5, 4.0)
#: Most families of lines in a note.
_MAX_LINES = 6
#: Usual duration of a record times the half-width of its lowest mode.
_USUAL_BANDWIDTHS = 10.0
#: Duration in the same unit below which a note says that the record is short.
_MIN_BANDWIDTHS = 2.0


def no_report(doing: str, share: float) -> None:
    """Report nothing."""


def _no_modes() -> Modes:
    nothing = np.zeros(0)
    return Modes(nothing.astype(complex), np.zeros((0, 0), dtype=complex), (), nothing, nothing, nothing, ())


@dataclass(frozen=True, eq=False, slots=True)
class Draft:
    """Identification in the making.

    Parameters
    ----------
    summary
        Correlations from which modes are identified.
    records
        Correlated records; None for a summary alone, which has modes by realisation but no result.
    recordings
        Recordings as given, as far as they are still at hand.
    vehicle
        Vehicle of the recordings.
    report
        Function called before long steps.
    diagrams
        Stabilisation diagrams of each subset, one for each split of outputs and references.
    subsets, deviations
        Modes of each subset, and their standard deviations with slow variation, shape (2, modes).
    modes
        Modes so far.
    members
        Index of the subset's mode for each mode and subset, -1 for none; shape (modes, subsets).
    sources
        Source of each mode; none: all by the method itself.
    level_trends, refinement
        As in `Identification`.
    notes
        Notes so far.
    """

    summary: CorrelationSummary
    records: CorrelatedRecords | None = None
    recordings: Sequence[Recording] = ()
    vehicle: AnyVehicle | None = None
    report: Progress = no_report
    diagrams: tuple[tuple[stabilisation.StabilisationDiagram, ...], ...] = ()
    subsets: tuple[SubsetModes, ...] = ()
    deviations: tuple[Real, ...] = ()
    modes: Modes = field(default_factory=_no_modes)
    members: Indices = field(default_factory=lambda: np.zeros((0, 0), dtype=np.intp))
    sources: tuple[str, ...] = ()
    level_trends: levels.LevelTrends | None = None
    refinement: Refinement | None = None
    notes: tuple[str, ...] = ()

    @property
    def settings(self) -> IdentificationSettings:
        """Settings as given."""
        return self.summary.settings

    @property
    def method(self) -> Method:
        """Method of the identification."""
        return KINDS[self.summary.method]

    @property
    def measured(self) -> CorrelatedRecords:
        """Correlated records.

        Raises
        ------
        IdentificationError
            If the draft is that of a summary alone.
        """
        if self.records is None:
            raise IdentificationError("a summary has no spectra: identify from the recordings")
        return self.records

    def noted(self, *notes: str) -> "Draft":
        """Return the draft with further notes."""
        return replace(self, notes=(*self.notes, *notes))


def correlate(
    method: Method,
    recordings: Iterable[Recording],
    *,
    settings: IdentificationSettings,
    vehicle: AnyVehicle | None,
    report: Progress,
) -> Draft:
    """Prepare and correlate the records, and average all their segments."""
    given, kept = kept_records(recordings, is_keeping=has_road(vehicle, settings))
    running = RunningRecords(method, settings=settings, vehicle=vehicle, total_duration=total_duration(given))
    n_records = len(given) if isinstance(given, Sequence) else 0
    for number, record in enumerate(given, start=1):
        report(f"correlating record {number}", 0.5 * (number - 1) / n_records if n_records else 0.0)
        running.update(record)
    records = running.correlated
    draft = Draft(averaged(method, settings, records), records, kept, vehicle, report)
    return draft.noted(*records.plan.preparation.notes, *records.notes)


def total_duration(recordings: Recording | Iterable[Recording]) -> float | None:
    """Return the duration of all records [s], None where they can be read only once."""
    if not isinstance(recordings, Recording | Sequence):
        return None
    return sum(record.duration for record in each_recording(recordings))


def averaged(method: Method, settings: IdentificationSettings, records: CorrelatedRecords) -> CorrelationSummary:
    """Return the average over all segments, as the only subset."""
    overall = average(records.segments)
    is_biased = records.plan.ladder.is_biased
    own = average(records.segments, is_biased=True) if is_biased else overall
    return CorrelationSummary(
        method.name, settings, records.plan, records.channels, ((None, own),), overall, records.harmonics
    )


def check_sensors(draft: Draft) -> Draft:
    """Note sensors that seem to have been moved between the records."""
    records = draft.measured
    note = note_on_moved_sensors(draft.recordings, records.segments, records.counts, vehicle=draft.vehicle)
    return draft.noted(*note)


def sort_by_level(draft: Draft) -> Draft:
    """Average the products by the level predicted from the past; in the form of the thesis segments by their own."""
    if not draft.method.is_sorted:
        return draft
    records, n_subsets = draft.measured, draft.settings.n_subsets
    notes: tuple[str, ...] = ()
    subsets: Iterable[tuple[tuple[float, float], Correlations]]
    if records.levels is not None:
        sets = levels.level_sets(records.levels, n_subsets, min_segments=_SEGMENTS_OF_A_SUBSET)
        subsets = ((part.level, part.correlations) for part in sets)
        if len(sets) < n_subsets:
            notes = (f"too little data or change of level for {n_subsets} subsets: {len(sets)} used",)
    else:
        by_level, is_biased = levels.subsets_of_equal_width(records.segments, n_subsets), records.plan.ladder.is_biased
        averages = (average(records.segments.take(own.segments), is_biased=is_biased) for own in by_level.subsets)
        subsets = zip((own.level for own in by_level.subsets), averages, strict=True)
        notes = by_level.notes
    return replace(draft, summary=replace(draft.summary, subsets=tuple(subsets))).noted(*notes)


def note_lines(draft: Draft) -> Draft:
    """Note the lines that were subtracted, and those that were left in."""
    lines = draft.summary.harmonics
    drifting = [line for line in lines if line.kind == "drifting"]
    steady = [line for line in lines if line.kind == "constant" and draft.settings.ladder is None]
    if steady:
        draft = draft.noted(f"lines of constant frequency were subtracted before correlation: {_in_words(steady)}")
    if drifting:
        draft = draft.noted(
            f"drifting lines were left in; narrow poles in their bands are not modes: {_in_words(drifting)}"
        )
    return draft


def _in_words(harmonics: Sequence[Harmonic]) -> str:
    """Return lines in words, families by fundamental, the most prominent first."""
    families: dict[float, list[Harmonic]] = {}
    for line in sorted(harmonics, key=lambda line: -line.prominence):
        families.setdefault(line.fundamental or line.frequency, []).append(line)
    words = [
        f"{len(lines)} multiples of {fundamental:.4g} Hz up to {max(line.order for line in lines)} times"
        if len(lines) > 1
        else f"{lines[0].frequency:.4g} Hz"
        for fundamental, lines in families.items()
    ]
    n_omitted = max(len(words) - _MAX_LINES, 0)
    return ", ".join(words[:_MAX_LINES]) + (f" and {n_omitted} more" if n_omitted else "")


def realise(draft: Draft) -> Draft:
    """Draw the stabilisation diagrams of each subset."""
    subsets, diagrams = draft.summary.subsets, []
    for k, (_, correlations) in enumerate(subsets):
        draft.report(f"realising all orders of subset {k + 1} of {len(subsets)}", 0.5 + 0.5 * k / len(subsets))
        diagrams.append(_diagrams(correlations, draft.summary))
    return replace(draft, diagrams=tuple(diagrams))


def _diagrams(
    correlations: Correlations, summary: CorrelationSummary
) -> tuple[stabilisation.StabilisationDiagram, ...]:
    """Return the stabilisation diagrams of one average, one for each split of outputs and references."""
    if not summary.settings.has_disjoint_references:
        return (_diagram(correlations, summary),)
    splits = disjoint_splits(correlations.channels)
    return tuple(_diagram(correlations.select(*split), summary) for split in splits)


def _diagram(correlations: Correlations, summary: CorrelationSummary) -> stabilisation.StabilisationDiagram:
    plan, criteria, is_subtracted = summary.plan, summary.settings.criteria, summary.settings.ladder is None
    poles = stabilisation.with_known_deviations(plan.ladder.poles(correlations), summary.average)
    resolution = correlations.sampling_rate / (2 * plan.ladder.n_lags)
    values = poles.natural_frequency, poles.damping_ratio
    is_line = near_harmonic(*values, summary.harmonics, resolution=resolution, is_subtracted=is_subtracted)
    duration = correlations.n_segments * plan.segment
    return stabilisation.stabilise(
        poles, criteria=criteria, band=plan.mode_band, is_harmonic=is_line, duration=duration
    )


def select(draft: Draft) -> Draft:
    """Select the modes of each subset from its diagrams."""
    selected = [
        _selected(level, correlations, diagrams)
        for (level, correlations), diagrams in zip(draft.summary.subsets, draft.diagrams, strict=True)
    ]
    return replace(draft, subsets=tuple(subset for subset, _ in selected), deviations=tuple(std for _, std in selected))


def _selected(
    level: tuple[float, float] | None,
    correlations: Correlations,
    diagrams: tuple[stabilisation.StabilisationDiagram, ...],
) -> tuple[SubsetModes, Real]:
    """Return the modes of one average, merged over its diagrams, and their standard deviations with slow variation."""
    parts = [stabilisation.select_modes(diagram, correlations.records) for diagram in diagrams]
    modes = [_on_all_channels(part.modes, correlations) for part in parts]
    merged = stabilisation.merge_modes(modes, weights=[1.0] * len(modes))
    deviations = stabilisation.merged_deviations([part.deviations for part in parts], merged)
    behind = [np.append(part.alignments, -1)[members] for part, members in zip(parts, merged.members.T, strict=True)]
    subset = SubsetModes(level, correlations.n_segments, merged.modes, diagrams, np.stack(behind, axis=1))
    return subset, deviations


def _on_all_channels(modes: Modes, correlations: Correlations) -> Modes:
    """Return modes with shapes on all channels, those on other channels than the outputs by the correlations."""
    names = correlations.channels
    if modes.channels == names:
        return modes
    shapes = unit_shapes(complete_shapes(modes.poles, modes.mode_shapes, correlations, modes.channels))
    return replace(modes, mode_shapes=shapes, channels=names, mode_shape_std=np.full_like(shapes, np.nan))


def merge(draft: Draft) -> Draft:
    """Merge the modes of the subsets and drop those that contribute no more than chance."""
    has_mean_shapes = not draft.settings.has_own_levels
    weights = [subset.n_segments for subset in draft.subsets]
    modes = [subset.modes for subset in draft.subsets]
    merged = stabilisation.merge_modes(modes, weights=weights, has_mean_shapes=has_mean_shapes)
    deviations = stabilisation.merged_deviations(draft.deviations, merged)
    if draft.method.is_sorted and has_mean_shapes and len(modes) > 1:
        merged, deviations = _with_modes_of_all_levels(merged, deviations, draft.summary)
    members = merged.members
    is_kept = significant(merged.modes, draft.summary.average, least=draft.settings.criteria.contribution)
    is_line = _is_line_of_drive(merged.modes, deviations[1], draft)
    is_kept &= ~is_line
    subsets = [
        _with_verdicts(subset, members[~is_kept, k], members[:, k], _as_measured(subset.modes, own, draft.summary))
        for k, (subset, own) in enumerate(zip(draft.subsets, draft.deviations, strict=True))
    ]
    kept = _as_measured(merged.modes, deviations, draft.summary).take(np.flatnonzero(is_kept))
    draft = replace(draft, subsets=tuple(subsets), modes=kept, members=members[is_kept])
    lines = ", ".join(f"{frequency:.4g}" for frequency in merged.modes.natural_frequency[is_line])
    note = f"narrow poles without a shape, as of wheels and engines, are no modes: {lines} Hz"
    return draft.noted(note) if lines else draft


def _is_line_of_drive(modes: Modes, damping_std: Real, draft: Draft) -> Booleans:
    """Return which modes of a drive, or of an IMU, may be narrower than motion on springs, without a shape."""
    lowest = modes.damping_ratio - np.nan_to_num(damping_std)
    is_driven = draft.summary.plan.preparation.is_drive or is_imu(draft.summary.channels)
    return (lowest < _NARROW_ON_DRIVES) & (mpc(modes.mode_shapes) < _SHAPELESS) & is_driven


def _as_measured(modes: Modes, deviations: Real, summary: CorrelationSummary) -> Modes:
    """Return modes of prepared records as those of the records, with other standard deviations."""
    return as_measured(
        stabilisation.with_total_deviations(modes, deviations), summary.plan.preparation, summary.settings.lifter
    )


def _with_modes_of_all_levels(
    merged: stabilisation.MergedModes, deviations: Real, summary: CorrelationSummary
) -> tuple[stabilisation.MergedModes, Real]:
    """Add the modes of the average over all levels that too few ranges of level show, and their deviations."""
    whole, own = _selected(None, summary.average, _diagrams(summary.average, summary))
    of_ranges, of_all = stabilisation.merge_modes([merged.modes, whole.modes], weights=[1.0, 1.0]).members.T
    chosen = np.where(of_ranges >= 0, of_ranges, len(merged.modes) + of_all)
    none = np.zeros((1, merged.members.shape[1]))
    modes = join_modes([merged.modes, whole.modes]).take(chosen)
    members = np.vstack([merged.members, none.astype(np.intp) - 1])[of_ranges]
    shares = np.vstack([merged.shares, none])[of_ranges]
    return stabilisation.MergedModes(modes, members, shares), np.concatenate([deviations, own], axis=1)[:, chosen]


def _with_verdicts(subset: SubsetModes, insignificant: Indices, merged: Indices, modes: Modes) -> SubsetModes:
    """Return the subset with the poles of insignificant and of unmerged modes marked as such (-1: no mode)."""
    diagrams = []
    for diagram, alignments in zip(subset.diagrams, subset.alignments.T, strict=True):
        unconfirmed = np.setdiff1d(diagram.alignments, alignments[merged[merged >= 0]])
        selected = np.unique(diagram.alignments[diagram.status == PoleStatus.SELECTED])
        changed = stabilisation.with_status(diagram, np.intersect1d(unconfirmed, selected), PoleStatus.UNCONFIRMED)
        dropped = alignments[insignificant[insignificant >= 0]]
        diagrams.append(stabilisation.with_status(changed, dropped[dropped >= 0], PoleStatus.INSIGNIFICANT))
    return replace(subset, modes=modes, diagrams=tuple(diagrams))


def compare_levels(draft: Draft) -> Draft:
    """Test whether frequency and damping depend on the level, where products are sorted by it."""
    by_level = draft.measured.levels
    if by_level is None or draft.settings.n_subsets < 2:
        return draft
    sets = levels.level_sets(by_level, levels.RULES.n_levels)
    if len(sets) < 2:
        return draft
    scaled = replace(draft.modes, mode_shapes=draft.modes.mode_shapes * draft.summary.plan.preparation.scales)
    return replace(draft, level_trends=levels.level_trends(scaled, draft.summary.average, sets))


def refine(draft: Draft) -> Draft:
    """Refine the modes by the likelihood of the spectra, where there are such."""
    records = draft.measured
    if records.lines is None:
        return draft
    spectra = records.lines.scaled(1 / records.plan.preparation.scales)
    refined, refinement = refined_by_spectra(draft.modes, spectra, records.channels, harmonics=records.harmonics)
    return replace(
        draft, modes=stabilisation.with_known_deviations(refined, draft.summary.average), refinement=refinement
    )


def fit_free_motion(draft: Draft, fit: FreeFit, notes: Sequence[str]) -> Draft:
    """Take the modes of free motion in place of those of random motion."""
    draft = draft.noted(
        "the records are free motion after pushes, drops or releases: modes are those of the free response"
        " (--kind random for modes of random motion)",
        *notes,
    )
    modes = fit.modes.take(np.flatnonzero(fit.modes.damping_ratio <= draft.settings.criteria.max_damping))
    draft = _with_modes_alone(draft, modes)
    return replace(draft, sources=("free_response",) * len(modes)).noted(*_notes_on_modes(draft.modes, None))


def _with_modes_alone(draft: Draft, modes: Modes) -> Draft:
    """Return the draft with modes that no diagram stands behind."""
    nothing = np.zeros((len(modes), 0), dtype=np.intp)
    subset = SubsetModes(None, draft.measured.segments.n_segments, modes, (), nothing)
    labels = labelled(modes, draft.measured.channels, vehicle=draft.vehicle)
    return replace(draft, modes=labels, subsets=(subset,), members=np.arange(len(modes))[:, None])


def fit_peaks(draft: Draft) -> Draft:
    """Fit the peaks of the singular values of the spectra, and keep the significant modes."""
    draft.report("fitting the peaks of the spectra", 0.5)
    records, criteria, lifter = draft.measured, draft.settings.criteria, draft.settings.lifter
    spectra = records.edited_spectra or records.spectra
    modes = modes_of_bells(find_bells(spectra, band=records.plan.mode_band), spectra, channels=records.channels)
    is_harmonic = near_harmonic(
        modes.natural_frequency, modes.damping_ratio, records.harmonics, resolution=1.5 * float(spectra.frequencies[1])
    )
    duration = records.segments.n_segments * records.plan.segment
    is_certain = stabilisation.uncertainty(modes, criteria, duration) <= 1
    is_physical = modes.damping_ratio <= criteria.max_damping
    modes = modes.take(np.flatnonzero(~is_harmonic & is_certain & is_physical))
    scaled = replace(modes, mode_shapes=modes.mode_shapes * records.plan.preparation.scales)
    is_kept = significant(scaled, draft.summary.average, least=criteria.contribution)
    modes = modes.take(np.flatnonzero(is_kept))
    modes = replace(modes, poles=without_lifter(modes.poles, lifter))
    return _with_modes_alone(draft, modes).noted(*_notes_on_modes(modes, lifter))


def combine(draft: Draft) -> Draft:
    """Put the modes of the vehicle on its road in place of those by the method, label all and note what they lack."""
    records, vehicle, settings = draft.measured, draft.vehicle, draft.settings
    modes = labelled(draft.modes, records.channels, vehicle=vehicle)
    kept = draft.recordings if has_road(vehicle, settings) else ()
    combined, notes = combined_modes(modes, kept, records, vehicle=vehicle, band=settings.band, report=draft.report)
    own, modes = draft.method.source, combined.modes
    draft = replace(
        draft,
        modes=modes,
        members=np.vstack([draft.members, np.full((1, len(draft.subsets)), -1)])[combined.replaced],
        sources=tuple(own if source == "ssi" else source for source in combined.sources),
        level_trends=None if draft.level_trends is None else draft.level_trends.of(combined.replaced),
    )
    draft = draft.noted(*notes, *_notes_on_modes(modes, settings.lifter), *_notes_on_duration(modes, draft.summary))
    if draft.level_trends is not None:
        draft = draft.noted(*levels.trends_in_words(modes, draft.level_trends))
    if vehicle is None:
        draft = draft.noted(*_notes_on_orders(modes, records.harmonics), *_notes_on_shapes(modes))
    if vehicle is None and settings.band is None:
        draft = draft.noted(*_note_on_body(modes, draft.summary.plan, records.channels))
    refinement = draft.refinement
    if refinement is not None:
        is_own = np.array([source == "ssi" for source in combined.sources], dtype=np.bool_)
        origins, rows = np.where(is_own, combined.replaced, -1), np.flatnonzero(is_own)
        draft = draft.noted(*refinement.of(modes.take(rows), origins[rows]).notes)
        refinement = refinement.of(modes, origins, instead="it is that of the vehicle fitted to its road")
        draft = replace(draft, refinement=refinement)
    elif settings.refine and settings.lifter is not None:
        draft = draft.noted(
            "modes not refined: cepstrum editing smooths the spectra that the likelihood takes as random"
        )
    return draft.noted(*_notes_on_deviations(modes, draft.summary))


def _note_on_body(modes: Modes, plan: Plan, channels: Sequence[Channel]) -> list[str]:
    """Return a note on a drive, or on what may be one by its IMU, that shows no mode of the body."""
    frequencies, (low, high) = modes.natural_frequency, _OF_BODIES
    if np.any((low <= frequencies) & (frequencies <= high)):
        return []
    if not plan.preparation.is_drive:
        if plan.mode_band[0] <= low or not is_imu(channels):
            return []
        return [
            f"no mode is sought below {plan.mode_band[0]:.3g} Hz: if this IMU is on a vehicle, whose body moves there,"
            " record the speed with it, or pass --band 0.4 20"
        ]
    return [
        f"no mode of the body at {low:g} to {high:g} Hz, where vehicles bounce, pitch and roll: its damping is too"
        " heavy or the drive too short; describe the vehicle (sprung describe) and pass --vehicle"
    ]


def _notes_on_orders(modes: Modes, harmonics: Sequence[Harmonic]) -> list[str]:
    """Return a note on modes as narrow as lines, at a half or third of one."""
    is_order = (modes.damping_ratio < _NARROW_ON_DRIVES) & at_part_of_line(
        modes.natural_frequency, 2 * modes.natural_frequency_std, harmonics
    )
    where = ", ".join(f"{frequency:.4g}" for frequency in modes.natural_frequency[is_order])
    text = f"narrow and at a half or third of a line, so maybe orders of the same engine, not modes: {where} Hz"
    return [text] * bool(where)


def _notes_on_shapes(modes: Modes) -> list[str]:
    """Return a note on modes whose sensors move at all phases."""
    mixed = ", ".join(f"{frequency:.4g}" for frequency in modes.natural_frequency[modes.mpc < _MIXED])
    if not mixed:
        return []
    return [
        f"at {mixed} Hz the sensors move at all phases (MPC below {_MIXED:g}), as in motions that are not separated or"
        " with gravity in tilting sensors: do not rely on the shape"
    ]


def _notes_on_duration(modes: Modes, summary: CorrelationSummary) -> list[str]:
    """Return a note on records that are far shorter than usual for their lowest mode."""
    duration = summary.average.n_segments * (summary.plan.segment or 0.0)
    bandwidth = modes.damping_ratio * modes.natural_frequency
    if not len(modes) or duration == 0 or duration * bandwidth[0] >= _MIN_BANDWIDTHS:
        return []
    return [
        f"{duration:.3g} s is short for the mode at {modes.natural_frequency[0]:.4g} Hz: modes may be missing, and"
        f" damping is uncertain; {_USUAL_BANDWIDTHS / bandwidth[0]:.2g} s is usual"
        f" ({_USUAL_BANDWIDTHS:.0f} / (damping ratio x frequency))"
    ]


def _notes_on_deviations(modes: Modes, summary: CorrelationSummary) -> list[str]:
    """Return what the standard deviations hold."""
    n_records = len(set(summary.average.records)) or 1
    if len(summary.average.blocks) < 2 or not len(modes):
        return []
    if not np.isfinite(modes.natural_frequency_std).any():
        return ["standard deviations are unknown: too few segments"]
    if n_records > 1:
        return [f"standard deviations: from the scatter between parts of the records and between {n_records} records"]
    return ["standard deviations: from the scatter within the record; slower changes are not included"]


def _notes_on_modes(modes: Modes, lifter: Lifter | None) -> list[str]:
    """Return notes on a lack of modes, and on modes whose ring-down a short-pass lifter cuts off."""
    if not len(modes):
        return ["no mode found: record longer, widen the band, or look at the reasons in the stabilisation diagram"]
    if not isinstance(lifter, ShortPass):
        return []
    # The lifter itself shortens a ring-down to about its own length, so a margin of two is needed to notice that.
    return [
        f"the lifter of {lifter.length:g} s is hardly longer than the ring-down of the mode at {frequency:.3g} Hz"
        f" ({-1 / pole.real:.2g} s): its damping ratio may be far too high, use a longer lifter"
        for frequency, pole in zip(modes.natural_frequency, modes.poles, strict=True)
        if -1 / pole.real > lifter.length / 2
    ]


def finished(draft: Draft) -> Identification:
    """Return the result."""
    draft.report("done", 1.0)
    records, summary = draft.measured, draft.summary
    return Identification(
        method=summary.method,
        channels=summary.channels,
        sampling_rate=summary.average.sampling_rate,
        modes=draft.modes,
        subsets=draft.subsets,
        members=draft.members,
        harmonics=summary.harmonics,
        spectra=records.spectra,
        edited_spectra=records.edited_spectra,
        settings=draft.settings,
        plan=records.plan,
        notes=draft.notes,
        refinement=draft.refinement,
        sources=draft.sources,
        level_trends=draft.level_trends,
    )
