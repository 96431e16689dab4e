"""Cov-SSI, ACS-Cov-SSI and CoSS-SSI: from recordings of one condition to modes."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from sprung._arrays import Indices, Real
from sprung._checks import check_one_of, check_type
from sprung.errors import ParameterError
from sprung.identification.contribution import complete_shapes
from sprung.identification.correlation import Correlations, average
from sprung.identification.fdd import find_bells, modes_of_bells
from sprung.identification.levels import LevelSet, level_sets
from sprung.identification.merging import MergedModes, merge_modes, merged_deviations
from sprung.identification.planning import disjoint_splits
from sprung.identification.preparation import as_measured, without_lifter
from sprung.identification.records import CorrelatedRecords, Progress, RunningRecords, correlate_records
from sprung.identification.refinement import Refinement, refine
from sprung.identification.results import CorrelationSummary, Identification, SubsetModes, source_of
from sprung.identification.road_modes import CombinedModes, combined_modes, has_road, kept_records
from sprung.identification.roving import group_by_setup, note_on_moved_sensors
from sprung.identification.settings import IdentificationSettings
from sprung.identification.setups import identify_setups
from sprung.identification.stabilisation import (
    StabilisationDiagram,
    StabilityCriteria,
    select_modes,
    significant,
    stabilise,
    with_honest_deviations,
    with_known_deviations,
    with_status,
)
from sprung.identification.subsets import subsets_of_equal_width
from sprung.identification.trends import N_LEVELS, LevelTrends, level_trends, trends_in_words
from sprung.modal import Modes, PoleStatus, join_modes, unit_shapes
from sprung.recording import Recording, each_recording
from sprung.signals.cepstrum import Lifter, ShortPass
from sprung.signals.harmonics import Harmonic, near_harmonic
from sprung.vehicles import Chain, Quarter, Vehicle
from sprung.vehicles.labels import labelled
from sprung.vehicles.usable import AnyVehicle

#: Largest relative change of the damping ratio between polynomial orders.
_DAMPING_OF_POLYNOMIALS = 0.4
#: Fewest segments from which the modes of a range of levels are identified.
_SEGMENTS_OF_A_SUBSET = 8
#: Most families of lines in a note.
_MOST_LINES = 6
#: Usual duration of a record times the half-width of its lowest mode, and that below which a note says so.
_USUAL_BANDWIDTHS, _FEWEST_BANDWIDTHS = 10.0, 2.0


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
        at a time. Choices from the data are made from the first usable record. Records in a sequence whose channels
        differ in names, positions or directions are set-ups of roving sensors (`setups.identify_setups`).
    settings
        Settings; default: everything is chosen from the data.
    vehicle
        Vehicle description, for the sensor layout, the name of the speed channel, the band of interest and the labels.
    on_progress
        Function called with the current step in words and the share that is done, 0 to 1.

    Returns
    -------
    Identification

    Raises
    ------
    DataError
        If no record is usable: a channel is dead, or the records are too short. One bad record of several is left out,
        with a note.
    ParameterError
        If a setting does not suit the records, or the records differ in channels or sampling rate.

    References
    ----------
    F. Liu (2020), chapters 3 and 4. B. Peeters and G. De Roeck (1999), Reference-based stochastic subspace
    identification for output-only modal analysis, Mechanical Systems and Signal Processing 13, 855-878.

    Examples
    --------
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> run = simulate(three_masses, usual_excitation(three_masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> cov_ssi(run).modes.natural_frequency.round(1)
    array([ 7. , 19.7, 28.5])
    """
    return _identify("cov", recordings, settings, vehicle, on_progress)


def acs_ssi(
    recordings: Recording | Iterable[Recording],
    *,
    settings: IdentificationSettings | None = None,
    vehicle: AnyVehicle | None = None,
    on_progress: Progress | None = None,
) -> Identification:
    """Identify modes from the average of the segments' correlations (ACS-Cov-SSI); parameters as `cov_ssi`.

    References
    ----------
    F. Liu (2020), section 4.2.

    Examples
    --------
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> run = simulate(three_masses, usual_excitation(three_masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> found, exact = acs_ssi(run).modes.natural_frequency, three_masses.modes().natural_frequency
    >>> np.allclose(found, exact, rtol=0.01)
    True
    """
    return _identify("acs", recordings, settings, vehicle, on_progress)


def coss_ssi(
    recordings: Recording | Iterable[Recording],
    *,
    settings: IdentificationSettings | None = None,
    vehicle: AnyVehicle | None = None,
    on_progress: Progress | None = None,
) -> Identification:
    """Identify modes from products of similar level and merge them (CoSS-SSI); parameters as `cov_ssi`.

    Notes
    -----
    The modes of the subsets are kept in the result: for a suspension with friction and progressive springs, their
    change with the level is information. Products y(n + m) y_ref(n) are sorted by the level predicted at n from the
    past, which does not bias the subsets of a linear system (`levels.correlate_by_level`); whether frequency and
    damping depend on the level is tested (`Identification.level_trends`). A merged mode is the mean over the subsets,
    or that of the average over all levels where too few subsets show it. The thesis sorts segments by the level of the
    correlations that are averaged (`settings.as_in_thesis`): even for a linear system, that biases damping, high in the
    subset of low level and low in that of high level.

    References
    ----------
    F. Liu (2020), section 4.2.

    Examples
    --------
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> run = simulate(three_masses, usual_excitation(three_masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> result = coss_ssi(run)
    >>> np.allclose(result.modes.natural_frequency, three_masses.modes().natural_frequency, rtol=0.01)
    True
    >>> len(result.subsets)
    3
    """
    return _identify("coss", recordings, settings, vehicle, on_progress)


def poly_lscf(
    recordings: Recording | Iterable[Recording],
    *,
    settings: IdentificationSettings | None = None,
    vehicle: AnyVehicle | None = None,
    on_progress: Progress | None = None,
) -> Identification:
    """Identify modes from half spectra by a common denominator (pLSCF, "PolyMAX"); parameters as `cov_ssi`.

    Notes
    -----
    A second opinion from the correlations of `cov_ssi`, with the same tests of stability, harmonics and significance.
    The ladder is over the orders of polynomials (`plscf.PolynomialLadder`), `max_order` is the largest of them. Damping
    scatters more from order to order than that of realisations, while surplus poles are recognised by their growth: the
    damping ratio of a stable pole may change by 40 %, unless the criteria state a share other than the default.

    References
    ----------
    B. Peeters, H. Van der Auweraer, P. Guillaume and J. Leuridan (2004), The PolyMAX frequency-domain method: a new
    standard for modal parameter estimation?, Shock and Vibration 11, 395-409.

    Examples
    --------
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> run = simulate(three_masses, usual_excitation(three_masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> found, exact = poly_lscf(run).modes.natural_frequency, three_masses.modes().natural_frequency
    >>> np.allclose(found, exact, rtol=0.01)
    True
    """
    return _identify("plscf", recordings, settings, vehicle, on_progress)


def enhanced_fdd(
    recordings: Recording | Iterable[Recording],
    *,
    settings: IdentificationSettings | None = None,
    vehicle: AnyVehicle | None = None,
    on_progress: Progress | None = None,
) -> Identification:
    """Identify modes from peaks of the singular values of the spectra (EFDD); parameters as `cov_ssi`.

    Raises
    ------
    DataError
        As `cov_ssi`.
    ParameterError
        As `cov_ssi`, and if the settings have a ladder or disjoint references.

    Notes
    -----
    A second opinion from the spectra, whose segments are longer than for the other methods. A peak counts if it is
    higher than chance explains and no harmonic, and if the mode is as certain and contributes as much to the
    correlations between channels as the other methods require. There is no stabilisation diagram and no stable rate
    (NaN), and settings on block rows, orders and references have no effect. Modes that are closer than the spectra
    resolve, or that lie on the bell of a stronger one, are not separated.

    References
    ----------
    R. Brincker, L. Zhang and P. Andersen (2001), Modal identification of output-only systems using frequency domain
    decomposition, Smart Materials and Structures 10, 441-445.

    Examples
    --------
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> run = simulate(three_masses, usual_excitation(three_masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> found, exact = enhanced_fdd(run).modes.natural_frequency, three_masses.modes().natural_frequency
    >>> np.allclose(found, exact, rtol=0.01)
    True
    """
    report, settings = on_progress or _no_report, settings or IdentificationSettings()
    recordings = _checked(recordings, vehicle)
    if settings.ladder is not None or settings.has_disjoint_references:
        raise ParameterError("FDD uses neither a ladder (--thesis) nor references: leave them out")
    records = correlate_records(recordings, method="fdd", settings=settings, vehicle=vehicle, report=report)
    report("fitting the peaks of the spectra", 0.5)
    modes = _modes_of_spectra(records, settings)
    report("done", 1.0)
    nothing, growth = np.zeros((len(modes), 0), dtype=np.intp), np.ones((2, len(modes)))
    subset = SubsetModes(None, records.segments.n_segments, modes, (), nothing, growth)
    return Identification(
        method="fdd",
        channels=records.channels,
        sampling_rate=records.segments.sampling_rate,
        modes=labelled(modes, records.channels, vehicle=vehicle),
        subsets=(subset,),
        members=np.arange(len(modes))[:, None],
        harmonics=records.harmonics,
        spectra=records.spectra,
        edited_spectra=records.edited_spectra,
        settings=settings,
        plan=records.plan,
        notes=(*records.plan.preparation.notes, *records.notes, *_notes_on_modes(modes, settings.lifter)),
    )


def _modes_of_spectra(records: CorrelatedRecords, settings: IdentificationSettings) -> Modes:
    """Return the significant modes of the spectra."""
    spectra, criteria = records.edited_spectra or records.spectra, settings.criteria
    modes = modes_of_bells(find_bells(spectra, band=records.plan.mode_band), spectra, channels=records.channels)
    is_harmonic = near_harmonic(
        modes.natural_frequency, modes.damping_ratio, records.harmonics, resolution=1.5 * float(spectra.frequencies[1])
    )
    is_certain = modes.natural_frequency_std <= criteria.uncertainty * modes.natural_frequency * modes.damping_ratio
    is_physical = modes.damping_ratio <= criteria.max_damping
    modes = modes.take(np.flatnonzero(~is_harmonic & is_certain & is_physical))
    preparation = records.plan.preparation
    factors = np.array([preparation.factors[name] for name in preparation.channels])
    scaled = replace(modes, mode_shapes=modes.mode_shapes * factors)
    modes = modes.take(np.flatnonzero(significant(scaled, average(records.segments), least=criteria.contribution)))
    return replace(modes, poles=without_lifter(modes.poles, settings.lifter))


#: Methods of the thesis by their names in results and on the command line, and all methods.
SUBSPACE_METHODS = {"cov": cov_ssi, "acs": acs_ssi, "coss": coss_ssi}
METHODS = {**SUBSPACE_METHODS, "plscf": poly_lscf, "fdd": enhanced_fdd}
#: What people call them.
METHOD_NAMES = MappingProxyType(
    {"cov": "Cov-SSI", "acs": "ACS-Cov-SSI", "coss": "CoSS-SSI", "plscf": "pLSCF", "fdd": "Enhanced FDD"}
)


def summarise(
    method: str,
    recordings: Recording | Iterable[Recording],
    *,
    settings: IdentificationSettings | None = None,
    vehicle: AnyVehicle | None = None,
) -> CorrelationSummary:
    """Return the correlations from which a method identifies modes.

    Parameters
    ----------
    method
        "cov", "acs", "coss" or "plscf".
    recordings, settings, vehicle
        As for `cov_ssi`.

    Returns
    -------
    CorrelationSummary

    Raises
    ------
    DataError, ParameterError
        As raised by `cov_ssi`; also if `method` is none of these.

    Examples
    --------
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> run = simulate(three_masses, usual_excitation(three_masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> modes_of_summary(summarise("cov", run)).natural_frequency.round(1)
    array([ 7. , 19.7, 28.4])
    """
    check_one_of("method", method, [name for name in METHODS if name != "fdd"])
    settings = _suitable(method, settings or IdentificationSettings())
    given = _checked(recordings, vehicle)
    records = correlate_records(given, method=method, settings=settings, vehicle=vehicle, report=_no_report)
    return _summary(method, settings, records, _subset_levels(settings, records))[0]


class RunningSummary:
    """Correlations of records that come one after another, each of which is prepared and correlated once.

    Parameters
    ----------
    method
        "cov", "acs", "coss" or "plscf".
    settings, vehicle
        As for `cov_ssi`.
    duration
        Duration of all records together [s], as far as it is known.

    Raises
    ------
    ParameterError
        If `method` is none of these.

    Notes
    -----
    After all records it equals what `summarise` returns for the list of them, if `duration` is their total duration.
    """

    def __init__(
        self,
        method: str,
        *,
        settings: IdentificationSettings | None = None,
        vehicle: AnyVehicle | None = None,
        duration: float | None = None,
    ) -> None:
        check_one_of("method", method, [name for name in METHODS if name != "fdd"])
        self._method, self._settings = method, _suitable(method, settings or IdentificationSettings())
        self._records = RunningRecords(method=method, settings=self._settings, vehicle=vehicle, total_duration=duration)

    @property
    def n_records(self) -> int:
        """Number of records so far, including those that were left out."""
        return self._records.n_records

    @property
    def summary(self) -> CorrelationSummary:
        """Correlations of all usable records so far.

        Raises
        ------
        DataError
            If no record is usable, with the reason of the first.
        """
        records = self._records.correlated
        return _summary(self._method, self._settings, records, _subset_levels(self._settings, records))[0]

    def update(self, record: Recording) -> None:
        """Add a record, as `RunningRecords.update`."""
        self._records.update(record)


def modes_of_summary(summary: CorrelationSummary, *, vehicle: AnyVehicle | None = None) -> Modes:
    """Return the modes of a summary: those that SSI identifies from its recordings, before any refinement.

    Parameters
    ----------
    summary
        Correlations from `summarise`.
    vehicle
        As for `cov_ssi`; here for the labels.

    Returns
    -------
    Modes
        Modes by SSI by rising frequency, merged over the subsets.

    Examples
    --------
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> run = simulate(three_masses, usual_excitation(three_masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> modes = modes_of_summary(summarise("acs", run))
    >>> np.allclose(modes.natural_frequency, three_masses.modes().natural_frequency, rtol=0.01)
    True
    """
    merged = _merge(summary, _modes_of_subsets(summary, _no_report))[1]
    return labelled(merged.modes, summary.channels, vehicle=vehicle)


def _suitable(method: str, settings: IdentificationSettings) -> IdentificationSettings:
    """Return the settings, for pLSCF with its own criterion of damping in place of the default."""
    if method != "plscf":
        return settings
    if settings.ladder is not None:
        raise ParameterError("pLSCF cannot use a ladder over block rows: leave it (--thesis) out")
    criteria = settings.criteria
    if criteria.damping != StabilityCriteria().damping:
        return settings
    return replace(settings, criteria=replace(criteria, damping=_DAMPING_OF_POLYNOMIALS))


def _checked(
    recordings: Recording | Iterable[Recording], vehicle: AnyVehicle | None
) -> Recording | Iterable[Recording]:
    """Return the recordings if these are recordings, and the vehicle is a vehicle."""
    if vehicle is not None:
        check_type("vehicle", vehicle, Vehicle, Quarter, Chain)
    return recordings if isinstance(recordings, Recording) else each_recording(recordings)


def _no_report(doing: str, share: float) -> None:
    """Report nothing."""


def _identify(
    method: str,
    recordings: Recording | Iterable[Recording],
    settings: IdentificationSettings | None,
    vehicle: AnyVehicle | None,
    on_progress: Progress | None,
) -> Identification:
    """Correlate, sort, realise, select, merge and label."""
    recordings = _checked(recordings, vehicle)
    report, settings = on_progress or _no_report, _suitable(method, settings or IdentificationSettings())
    if isinstance(recordings, Sequence) and len(setups := group_by_setup(recordings, vehicle=vehicle)) > 1:
        each, names = replace(settings, references=None), settings.references
        return identify_setups(
            METHODS[method], setups, references=names, settings=each, vehicle=vehicle, on_progress=on_progress
        )
    given, kept = kept_records(recordings) if has_road(vehicle, settings) else (recordings, [])
    records = correlate_records(given, method=method, settings=settings, vehicle=vehicle, report=report)
    sets = _subset_levels(settings, records)
    summary, notes_on_subsets = _summary(method, settings, records, sets)
    several = recordings if isinstance(recordings, Sequence) else ()
    subsets, merged = _merge(summary, _modes_of_subsets(summary, report))
    trends = _level_trends(merged.modes, summary, _level_sets(N_LEVELS, records) if settings.n_subsets > 1 else ())
    refined, refinement = _refine(merged.modes, records)
    modes = labelled(refined, summary.channels, vehicle=vehicle)
    combined, note_on_road = combined_modes(modes, kept, records, vehicle=vehicle, band=settings.band, report=report)
    trends = None if trends is None else trends.of(combined.replaced)
    refinement, notes_on_refinement = _of_combined(refinement, combined, settings)
    report("done", 1.0)
    return Identification(
        method=method,
        channels=summary.channels,
        sampling_rate=summary.average.sampling_rate,
        modes=combined.modes,
        subsets=tuple(subsets),
        members=np.vstack([merged.members, np.full((1, len(subsets)), -1)])[combined.replaced],
        harmonics=summary.harmonics,
        spectra=records.spectra,
        edited_spectra=records.edited_spectra,
        settings=settings,
        plan=records.plan,
        notes=(
            *records.plan.preparation.notes,
            *records.notes,
            *note_on_moved_sensors(several, records.segments, records.counts, vehicle=vehicle),
            *notes_on_subsets,
            *_notes_on_lines(summary.harmonics, settings),
            *note_on_road,
            *_notes_on_modes(combined.modes, settings.lifter),
            *_notes_on_duration(combined.modes, summary),
            *([] if trends is None else trends_in_words(combined.modes, trends)),
            *notes_on_refinement,
            *_notes_on_deviations(combined.modes, summary),
        ),
        sources=tuple(source_of(method) if source == "ssi" else source for source in combined.sources),
        refinement=refinement,
        level_trends=trends,
    )


def _subset_levels(settings: IdentificationSettings, records: CorrelatedRecords) -> tuple[LevelSet, ...]:
    """Return the averages whose modes are identified; none where products are not sorted by the expected level."""
    if records.levels is None:
        return ()
    return level_sets(records.levels, settings.n_subsets, min_segments=_SEGMENTS_OF_A_SUBSET)


def _level_sets(n_subsets: int, records: CorrelatedRecords) -> tuple[LevelSet, ...]:
    """Return the averages by the expected level; none where products are not sorted by it."""
    return () if records.levels is None else level_sets(records.levels, n_subsets)


def _level_trends(modes: Modes, summary: CorrelationSummary, sets: Sequence[LevelSet]) -> LevelTrends | None:
    """Return the dependence of measured modes on the level; None for a single level."""
    if len(sets) < 2:
        return None
    preparation = summary.plan.preparation
    factors = np.array([preparation.factors[name] for name in preparation.channels])
    return level_trends(replace(modes, mode_shapes=modes.mode_shapes * factors), summary.average, sets)


def _refine(modes: Modes, records: CorrelatedRecords) -> tuple[Modes, Refinement | None]:
    """Return the modes refined by the spectra of the records, where there are such."""
    if records.lines is None:
        return modes, None
    factors = np.array([records.plan.preparation.factors[channel.name] for channel in records.channels])
    spectra = replace(records.lines, lines=records.lines.lines.scaled(1 / factors))
    spectra = replace(spectra, blocks=tuple(block.scaled(1 / factors) for block in spectra.blocks))
    refined, refinement = refine(modes, spectra, records.channels, harmonics=records.harmonics)
    return with_known_deviations(refined, average(records.segments)), refinement


def _of_combined(
    refinement: Refinement | None, combined: CombinedModes, settings: IdentificationSettings
) -> tuple[Refinement | None, tuple[str, ...]]:
    """Return the refinement of the combined modes; notes on modes that keep their values, and on edited records."""
    if refinement is not None:
        is_own = np.array([source == "ssi" for source in combined.sources], dtype=np.bool_)
        origins, own = np.where(is_own, combined.replaced, -1), np.flatnonzero(is_own)
        notes = refinement.of(combined.modes.take(own), origins[own]).notes
        return refinement.of(combined.modes, origins, instead="it is that of the vehicle fitted to its road"), notes
    if settings.refine and settings.lifter is not None:
        return None, ("modes not refined: cepstrum editing smooths the spectra that the likelihood takes as random",)
    return None, ()


def _summary(
    method: str, settings: IdentificationSettings, records: CorrelatedRecords, sets: Sequence[LevelSet]
) -> tuple[CorrelationSummary, tuple[str, ...]]:
    """Average the segments, for CoSS-SSI by level; also return the notes on the subsets."""
    segments, is_biased = records.segments, records.plan.ladder.is_biased
    overall = average(segments)
    subsets: tuple[tuple[tuple[float, float] | None, Correlations], ...]
    notes: tuple[str, ...] = ()
    if sets:
        subsets = tuple((part.level, part.correlations) for part in sets)
        if len(sets) < settings.n_subsets:
            notes = (f"too little data or change of level for {settings.n_subsets} subsets: {len(sets)} used",)
    elif method == "coss":
        by_level = subsets_of_equal_width(segments, settings.n_subsets)
        subsets = tuple(
            (subset.level, average(segments.take(subset.segments), is_biased=is_biased)) for subset in by_level.subsets
        )
        notes = by_level.notes
    else:
        subsets = ((None, average(segments, is_biased=True) if is_biased else overall),)
    return CorrelationSummary(
        method=method,
        settings=settings,
        plan=records.plan,
        channels=records.channels,
        subsets=subsets,
        average=overall,
        harmonics=records.harmonics,
    ), notes


def _notes_on_lines(harmonics: Sequence[Harmonic], settings: IdentificationSettings) -> list[str]:
    """Return notes on the lines that were subtracted, and on those that were left in."""
    drifting = [line for line in harmonics if line.kind == "drifting"]
    steady = [line for line in harmonics if line.kind == "constant"]
    if settings.ladder is not None:
        steady = []
    notes = []
    if steady:
        notes.append(f"lines of constant frequency were subtracted before correlation: {_in_words(steady)}")
    if drifting:
        notes.append(f"drifting lines were left in; narrow poles in their bands are not modes: {_in_words(drifting)}")
    return notes


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
    n_omitted = max(len(words) - _MOST_LINES, 0)
    return ", ".join(words[:_MOST_LINES]) + (f" and {n_omitted} more" if n_omitted else "")


def _notes_on_duration(modes: Modes, summary: CorrelationSummary) -> list[str]:
    """Return a note on records that are far shorter than usual for their lowest mode."""
    duration = summary.average.n_segments * (summary.plan.segment or 0.0)
    bandwidth = modes.damping_ratio * modes.natural_frequency
    if not len(modes) or duration == 0 or duration * bandwidth[0] >= _FEWEST_BANDWIDTHS:
        return []
    return [
        f"{duration:.3g} s is short for the mode at {modes.natural_frequency[0]:.4g} Hz: modes may be missing, and"
        f" damping is uncertain; {_USUAL_BANDWIDTHS / bandwidth[0]:.2g} s is usual"
        f" ({_USUAL_BANDWIDTHS:.0f} / (damping ratio x frequency))"
    ]


def _notes_on_deviations(modes: Modes, summary: CorrelationSummary) -> list[str]:
    """Return what the standard deviations hold."""
    n_records = len(set(summary.average.records)) or 1
    if not len(summary.average.changes) or not len(modes):
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


def _modes_of_subsets(summary: CorrelationSummary, report: Progress) -> list[SubsetModes]:
    """Identify the modes of each subset."""
    n_subsets = len(summary.subsets)
    subsets = []
    for k, (level, correlations) in enumerate(summary.subsets):
        report(f"realising all orders of subset {k + 1} of {n_subsets}", 0.5 + 0.5 * k / n_subsets)
        subsets.append(_subset_modes(level, correlations, summary))
    return subsets


def _subset_modes(
    level: tuple[float, float] | None, correlations: Correlations, summary: CorrelationSummary
) -> SubsetModes:
    """Identify the modes of one average, in all splits of outputs and references."""
    names = correlations.channels
    splits = disjoint_splits(names) if summary.settings.has_disjoint_references else ()
    parts, diagrams, alignments, deviations = [], [], [], []
    for outputs, references in splits or [(names, correlations.references)]:
        diagram = _diagram(correlations.select(outputs, references) if splits else correlations, summary)
        selected = select_modes(diagram, correlations.records)
        modes = selected.modes
        deviations.append(selected.growth * [modes.natural_frequency_std, modes.damping_ratio_std])
        if splits:
            shapes = complete_shapes(modes.poles, modes.mode_shapes, correlations, outputs)
            shapes = unit_shapes(shapes)
            modes = replace(modes, mode_shapes=shapes, channels=names, mode_shape_std=np.full_like(shapes, np.nan))
        parts.append(modes)
        diagrams.append(diagram)
        alignments.append(selected.alignments)
    merged = merge_modes(parts, weights=[1.0] * len(parts))
    independent = np.array([merged.modes.natural_frequency_std, merged.modes.damping_ratio_std])
    growth = merged_deviations(deviations, merged) / independent
    behind = np.full(merged.members.shape, -1)
    for k, selected_alignments in enumerate(alignments):
        members = merged.members[:, k]
        behind[:, k] = np.where(members >= 0, np.append(selected_alignments, -1)[members], -1)
    return SubsetModes(level, correlations.n_segments, merged.modes, tuple(diagrams), behind, growth)


def _diagram(correlations: Correlations, summary: CorrelationSummary) -> StabilisationDiagram:
    """Return the stabilisation diagram of one ladder."""
    plan = summary.plan
    poles = with_honest_deviations(plan.ladder.poles(correlations), summary.average)
    is_harmonic = near_harmonic(
        poles.natural_frequency,
        poles.damping_ratio,
        summary.harmonics,
        resolution=correlations.sampling_rate / (2 * plan.ladder.n_lags),
        is_subtracted=summary.settings.ladder is None,
    )
    return stabilise(poles, criteria=summary.settings.criteria, band=plan.mode_band, is_harmonic=is_harmonic)


def _merge(summary: CorrelationSummary, subsets: Sequence[SubsetModes]) -> tuple[list[SubsetModes], MergedModes]:
    """Merge the modes of the subsets and drop the insignificant ones; return the subsets and the merged modes."""
    weights = [subset.n_segments for subset in subsets]
    has_mean_shapes = not summary.settings.has_own_levels
    merged = merge_modes([s.modes for s in subsets], weights=weights, has_mean_shapes=has_mean_shapes)
    deviations = merged_deviations([_deviations(subset) for subset in subsets], merged)
    if summary.method == "coss" and has_mean_shapes and len(subsets) > 1:
        merged, deviations = _with_modes_of_all_levels(merged, deviations, summary)
    members = merged.members
    is_kept = significant(merged.modes, summary.average, least=summary.settings.criteria.contribution)
    modes = _with_deviations(merged.modes, deviations)
    judged = [_with_verdicts(subset, members[~is_kept, k], members[:, k]) for k, subset in enumerate(subsets)]
    preparation = summary.plan.preparation
    lifter = summary.settings.lifter
    return (
        [
            replace(
                subset,
                modes=as_measured(_with_deviations(subset.modes, _deviations(subset)), preparation, lifter),
                growth=np.ones_like(subset.growth),
            )
            for subset in judged
        ],
        MergedModes(
            as_measured(modes.take(np.flatnonzero(is_kept)), preparation, lifter),
            members[is_kept],
            merged.shares[is_kept],
        ),
    )


def _with_modes_of_all_levels(
    merged: MergedModes, deviations: Real, summary: CorrelationSummary
) -> tuple[MergedModes, Real]:
    """Add the modes of the average over all levels that too few ranges of level show, and their deviations."""
    whole = _subset_modes(None, summary.average, summary)
    of_ranges, of_all = merge_modes([merged.modes, whole.modes], weights=[1.0, 1.0]).members.T
    chosen = np.where(of_ranges >= 0, of_ranges, len(merged.modes) + of_all)
    none = np.zeros((1, merged.members.shape[1]))
    modes = join_modes([merged.modes, whole.modes]).take(chosen)
    members = np.vstack([merged.members, none.astype(np.intp) - 1])[of_ranges]
    shares = np.vstack([merged.shares, none])[of_ranges]
    deviations = np.concatenate([deviations, _deviations(whole)], axis=1)[:, chosen]
    return MergedModes(modes, members, shares), deviations


def _deviations(subset: SubsetModes) -> Real:
    """Return the standard deviations of a subset's modes with slow variation, shape (2, modes)."""
    return subset.growth * [subset.modes.natural_frequency_std, subset.modes.damping_ratio_std]


def _with_deviations(modes: Modes, deviations: Real) -> Modes:
    """Return modes with other standard deviations of frequency and damping ratio."""
    return replace(modes, natural_frequency_std=deviations[0], damping_ratio_std=deviations[1])


def _with_verdicts(subset: SubsetModes, insignificant: Indices, merged: Indices) -> SubsetModes:
    """Return the subset with the poles of insignificant and of unmerged modes marked as such (-1: no mode)."""
    diagrams = []
    for diagram, alignments in zip(subset.diagrams, subset.alignments.T, strict=True):
        unconfirmed = np.setdiff1d(diagram.alignments, alignments[merged[merged >= 0]])
        selected = np.unique(diagram.alignments[diagram.status == PoleStatus.SELECTED])
        changed = with_status(diagram, np.intersect1d(unconfirmed, selected), PoleStatus.UNCONFIRMED)
        dropped = alignments[insignificant[insignificant >= 0]]
        diagrams.append(with_status(changed, dropped[dropped >= 0], PoleStatus.INSIGNIFICANT))
    return replace(subset, diagrams=tuple(diagrams))
