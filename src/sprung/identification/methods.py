"""Cov-SSI, ACS-Cov-SSI and CoSS-SSI: from recordings of one condition to modes."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

from sprung._checks import check_one_of, check_type, settings_of
from sprung._display import counted
from sprung._threads import one_thread
from sprung.errors import DataError, IdentificationError, ParameterError
from sprung.identification import steps
from sprung.identification.begins import fit_from_begins
from sprung.identification.free_response import FreeFit
from sprung.identification.records import Progress, RunningRecords
from sprung.identification.results import CorrelationSummary, Identification
from sprung.identification.roving import group_by_setup
from sprung.identification.settings import ACS, COSS, COV, FDD, KINDS, PLSCF, IdentificationSettings, Method
from sprung.identification.setups import identify_setups
from sprung.identification.stabilisation import StabilityCriteria
from sprung.identification.transients import Transient, free_motions, top_of_swings, without_hum
from sprung.modal import Modes
from sprung.recording import Recording, each_recording
from sprung.vehicles import Chain, Quarter, Vehicle
from sprung.vehicles.labels import labelled, plausibility_notes
from sprung.vehicles.sensor_layout import AnyVehicle, is_drive, layout_notes, output_channels, usable

#: Least share of the motion that free modes explain in records that are taken for free motion.
_FREE = 0.95
#: Largest relative change of the damping ratio between polynomial orders.
_DAMPING_OF_POLYNOMIALS = 0.4
#: Steps from correlated records to modes by stabilisation diagrams.
_STEPS = (
    steps.check_sensors,
    steps.sort_by_level,
    steps.note_lines,
    steps.realise,
    steps.select,
    steps.merge,
    steps.compare_levels,
    steps.refine,
    steps.combine,
)


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
    return _identified(COV, recordings, settings, vehicle, on_progress)


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
    >>> import numpy as np
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> run = simulate(three_masses, usual_excitation(three_masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> found, exact = acs_ssi(run).modes.natural_frequency, three_masses.modes().natural_frequency
    >>> np.allclose(found, exact, rtol=0.01)
    True
    """
    return _identified(ACS, recordings, settings, vehicle, on_progress)


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
    >>> import numpy as np
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
    return _identified(COSS, recordings, settings, vehicle, on_progress)


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
    >>> import numpy as np
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> run = simulate(three_masses, usual_excitation(three_masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> found, exact = poly_lscf(run).modes.natural_frequency, three_masses.modes().natural_frequency
    >>> np.allclose(found, exact, rtol=0.01)
    True
    """
    return _identified(PLSCF, recordings, settings, vehicle, on_progress)


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
    >>> import numpy as np
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> run = simulate(three_masses, usual_excitation(three_masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> found, exact = enhanced_fdd(run).modes.natural_frequency, three_masses.modes().natural_frequency
    >>> np.allclose(found, exact, rtol=0.01)
    True
    """
    return _identified(FDD, recordings, settings, vehicle, on_progress)


#: Methods of the thesis by their names in results and on the command line, and all methods.
SUBSPACE_METHODS = {"cov": cov_ssi, "acs": acs_ssi, "coss": coss_ssi}
METHODS = {**SUBSPACE_METHODS, "plscf": poly_lscf, "fdd": enhanced_fdd}
#: What people call them.
METHOD_NAMES = MappingProxyType({name: KINDS[name].title for name in METHODS})


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
    running = RunningSummary(method, settings=settings, vehicle=vehicle, duration=steps.total_duration(recordings))
    for record in _checked(recordings, vehicle):
        running.update(record)
    return running.summary


class RunningSummary(RunningRecords):
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
        kind = KINDS[method]
        super().__init__(kind, settings=_suitable(kind, settings), vehicle=vehicle, total_duration=duration)

    @property
    def summary(self) -> CorrelationSummary:
        """Correlations of all usable records so far.

        Raises
        ------
        DataError
            If no record is usable, with the reason of the first.
        """
        records = self.correlated
        return steps.sort_by_level(steps.Draft(steps.averaged(self._method, self._settings, records), records)).summary

    def _note(self, record: Recording) -> None:
        """A summary has no notes."""


@one_thread
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
    >>> import numpy as np
    >>> from sprung.simulation import simulate, usual_excitation
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> run = simulate(three_masses, usual_excitation(three_masses), duration=60.0, sampling_rate=500.0, seed=1)
    >>> modes = modes_of_summary(summarise("acs", run))
    >>> np.allclose(modes.natural_frequency, three_masses.modes().natural_frequency, rtol=0.01)
    True
    """
    draft = steps.merge(steps.select(steps.realise(steps.Draft(summary))))
    return labelled(draft.modes, summary.channels, vehicle=vehicle)


def _suitable(method: Method, settings: IdentificationSettings | None) -> IdentificationSettings:
    """Return the settings or the defaults; for polynomials with their own criterion of damping in place of them."""
    settings = settings_of(IdentificationSettings, settings)
    if method.has_long_spectra and (settings.ladder is not None or settings.has_disjoint_references):
        raise ParameterError("FDD uses neither a ladder (--thesis) nor references: leave them out")
    if not method.has_polynomials:
        return settings
    if settings.ladder is not None:
        raise ParameterError("pLSCF cannot use a ladder over block rows: leave it (--thesis) out")
    criteria = settings.criteria
    if criteria.damping != StabilityCriteria().damping:
        return settings
    return replace(settings, criteria=replace(criteria, damping=_DAMPING_OF_POLYNOMIALS))


def _checked(recordings: Recording | Iterable[Recording], vehicle: AnyVehicle | None) -> Iterable[Recording]:
    """Return the recordings if these are recordings, and the vehicle is a vehicle."""
    if vehicle is not None:
        check_type("vehicle", vehicle, Vehicle, Quarter, Chain)
    return each_recording(recordings)


@one_thread
def _identified(
    method: Method,
    recordings: Recording | Iterable[Recording],
    settings: IdentificationSettings | None,
    vehicle: AnyVehicle | None,
    on_progress: Progress | None,
) -> Identification:
    """Correlate the records and take the steps in turn; records of several set-ups are identified one by one."""
    wanted, given, report = _suitable(method, settings), _checked(recordings, vehicle), on_progress or steps.no_report
    if method.has_long_spectra:
        return steps.finished(
            steps.fit_peaks(steps.correlate(method, given, settings=wanted, vehicle=vehicle, report=report))
        )
    if isinstance(given, Sequence) and len(setups := group_by_setup(given, vehicle=vehicle)) > 1:
        own, references = replace(wanted, references=None), wanted.references
        return identify_setups(
            METHODS[method.name], setups, references=references, settings=own, vehicle=vehicle, on_progress=on_progress
        )
    fit, notes = free_fit(given, wanted, vehicle) or (None, ())
    draft = steps.correlate(method, given, settings=wanted, vehicle=vehicle, report=report)
    for step in _STEPS if fit is None else ():
        draft = step(draft)
    return steps.finished(draft.noted(*notes) if fit is None else steps.fit_free_motion(draft, fit, notes))


def free_fit(
    given: Iterable[Recording], settings: IdentificationSettings, vehicle: AnyVehicle | None
) -> tuple[FreeFit | None, tuple[str, ...]] | None:
    """Return the fit of records of free motion, and notes; None for random motion, or an iterator (read only once).

    The fit is None where motions die away and free modes do not explain them.
    """
    if settings.kind == "random" or not isinstance(given, Sequence):
        return None
    is_certain = settings.kind == "free"
    if not is_certain and any(is_drive(each) for each in given):
        return None
    motions: list[tuple[Recording, Transient]] = []
    fit = None
    try:
        whole = [usable(each, vehicle=vehicle, allow_missing=settings.allow_missing) for each in given]
        longest = [max(run.stretches(), key=lambda stretch: stretch.stop - stretch.start) for run in whole]
        runs = [
            run.select(output_channels(run, vehicle)).part(stretch.start, stretch.stop)
            for run, stretch in zip(whole, longest, strict=True)
        ]
        motions = free_motions(map(without_hum, runs), is_certain=is_certain)
        fit = _fit_of_motions(motions, settings.band, 0.0 if is_certain else _FREE) if motions else None
    except DataError:
        if is_certain:
            raise
    if fit is not None:
        return fit, (*dict.fromkeys(f"hum: {run.history[-1]}" for run, _ in motions if run not in runs), *fit.notes)
    if is_certain:
        raise DataError("no motion that dies away was found: --kind random, or see sprung bounce")
    if not motions:
        return None
    places = counted(len(motions), "place")
    return None, (f"motion dies away as after a push in {places}, which free modes do not explain: see sprung bounce",)


def _fit_of_motions(
    motions: Sequence[tuple[Recording, Transient]], band: tuple[float, float] | None, least: float
) -> FreeFit:
    """Return the fit, of the frequencies of the swings alone where noise above them hides the motion in all."""
    try:
        return fit_from_begins(motions, band=band, least_explained=least)
    except DataError:
        if band is not None or not least:
            raise
        return fit_from_begins(motions, band=(0.0, top_of_swings(*motions[0])), least_explained=least)


@dataclass(frozen=True, eq=False, slots=True)
class WindowModes:
    """Modes of a window.

    Parameters
    ----------
    time
        Time of its first sample since that of the first window [s], or its number.
    source
        Name of its file.
    modes
        Modes; None where the window could not be analysed.
    reason
        Why there are no modes; empty otherwise.
    notes
        Unusual motion of the vehicle file, sensors that the window lacks, and channels that the file does not name, in
        words.
    """

    time: float
    source: str
    modes: Modes | None
    reason: str = ""
    notes: tuple[str, ...] = ()


def identify_window(
    recording: Recording,
    *,
    time: float,
    source: str,
    method: str = "cov",
    settings: IdentificationSettings | None = None,
    vehicle: AnyVehicle | None = None,
) -> WindowModes:
    """Identify the modes of one window of many.

    Parameters
    ----------
    recording
        Window as read.
    time, source
        Time of the window and name of its file.
    method
        Name of a method, such as "cov".
    settings, vehicle
        As for `cov_ssi`.

    Raises
    ------
    ParameterError
        If a setting does not suit the recording, or it lacks a sensor of the vehicle file. A window that is too short
        or has dead channels is no error.
    """
    notes = () if vehicle is None else (*plausibility_notes(vehicle), *layout_notes(recording, vehicle))
    try:
        modes = METHODS[method](recording, settings=settings, vehicle=vehicle).modes
    except (DataError, IdentificationError) as error:
        return WindowModes(time, source, None, str(error), notes)
    return WindowModes(time, source, modes, "" if len(modes) else "no mode found", notes)
