"""Completion of a vehicle file from the windows of healthy drives, and its result."""

from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from typing import Literal

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number, freeze, settings_of
from sprung._display import Drawable, Savable, Tabular, counted, in_short
from sprung.calibration.draft import (
    COMPONENT_FIELDS,
    Draft,
    VehicleNumber,
    added_numbers,
    component_numbers,
    explicit,
    file_numbers,
    is_in_one_range,
    moved,
    sensor_numbers,
    with_widths,
)
from sprung.calibration.fitting import (
    FreeVehicle,
    JointFit,
    evaluated,
    expected_steps,
    extended_fit,
    joint_fit,
    likely_mount,
    misfit_in,
    reweighted,
    with_mode,
    with_mount,
)
from sprung.calibration.joint import DELAY, WindowSpectra, window_spectra
from sprung.errors import DataError, ParameterError
from sprung.likelihood import CornerSettings
from sprung.likelihood.spectra import OVERCOUNT
from sprung.recording import Recording, each_recording, naming
from sprung.vehicles import Component, Vehicle, check_on_axles, corner_names
from sprung.vehicles.sections import FlexibleMode, LearntNumber
from sprung.vehicles.sensor_checks import refuse_wrong_sensors
from sprung.vehicles.window import Window, window_of

#: Largest number of windows of a calibration that a baseline asks for.
CALIBRATION_WINDOWS = 3


@dataclass(frozen=True, slots=True)
class CompletionRules:
    """What counts as learnt, as wrong, and as a part that a vehicle file lacks."""

    #: Gain in ln evidence that counts as an improvement: far more than chance, as models are never perfect.
    convincing: float = 10.0
    #: Model error with a mass on mounts or bending over that without it, above which the drives do not show it: an
    #: engine of 150 kg leaves a fifth, a mass that stands for side forces and friction leaves all.
    explained: float = 0.8
    #: Share of the prior's standard deviation to which the drives reduce that of a number that they determine.
    identifiable: float = 0.5
    #: Median model error of windows above which a vehicle file is imperfect.
    imperfect: float = 0.1
    #: Share of a combination of channels, each of unit power, below which it is a rounding error.
    rounding: float = 1e-9
    #: Error of the place of a sensor that matters [m].
    wrong_place: float = 0.04
    #: Error of a gain that matters (ln), and of a direction cosine.
    wrong_gain: float = 0.03
    #: Error of a delay that matters [s].
    wrong_delay: float = 1.5e-3
    #: Frequencies between which a mass is on mounts [Hz]: below it is part of the body, above it is fixed to it.
    mounts: tuple[float, float] = (4.0, 30.0)
    #: Frequencies of the flexible modes that are tried [Hz].
    mode_frequencies: tuple[float, ...] = (14.0, 17.0, 20.0, 24.0, 29.0, 35.0)
    #: Stiffness of the rubber that carries a damper over that of a spring, with which its search starts.
    rubber: float = 20.0
    #: Damping ratio of these modes.
    mode_damping: float = 0.06


RULES = CompletionRules()


@dataclass(frozen=True, slots=True)
class CalibratedNumber:
    """A number of the vehicle after calibration.

    Parameters
    ----------
    name
        Place of the number in the file, such as "front.tyre_stiffness", "acc_fl.x" or "speed_scale".
    group
        Kind of number: "components", "sides", "body", "wheels", "sensors", "mounted_masses", "modes", "speed".
    unit
        Unit of the values.
    nominal_value
        Value of the file; None if the file lacks it.
    value, std
        Learnt value and its standard deviation.
    prior_std
        Standard deviation before any data.
    is_identifiable
        Whether the drives determine it: the data halve its standard deviation at least. The others stay near the given
        value.
    """

    name: str
    group: str
    unit: str
    nominal_value: float | None
    value: float
    std: float
    prior_std: float
    is_identifiable: bool


@dataclass(frozen=True, eq=False, slots=True)
class Calibration(Tabular, Savable, Drawable):
    """A vehicle file completed from drives.

    Parameters
    ----------
    vehicle
        Completed vehicle.
    learnt
        Numbers that were free, identifiable or not.
    coordinates
        Coordinates of the misfit, before and after: what the vehicle of the given file explains.
    frequencies
        Frequencies of the misfit [Hz], shape (frequencies,).
    misfit_before, misfit_after
        Measured over fitted power less 1 in joint fits of the windows, averaged over them: with springs, dampers and
        tyres free and all else as given, and as completed; shape (coordinates, frequencies).
    model_errors_before, model_errors_after
        Model error of each window in these fits.
    evidence_gain
        Gain in ln evidence of the completed file over the given one, in all channels of all windows.
    n_segments
        Number of segments of each window.
    notes
        Remarks, one sentence each.
    """

    vehicle: Vehicle
    learnt: tuple[CalibratedNumber, ...]
    coordinates: tuple[str, ...]
    frequencies: Real
    misfit_before: Real
    misfit_after: Real
    model_errors_before: tuple[float, ...]
    model_errors_after: tuple[float, ...]
    evidence_gain: float
    n_segments: tuple[int, ...]
    notes: tuple[str, ...]

    def __post_init__(self) -> None:
        freeze(self, frequencies=1, misfit_before=2, misfit_after=2)

    def __repr__(self) -> str:
        """Return the numbers learnt, the gain in evidence and the first note."""
        learnt = sum(number.is_identifiable for number in self.learnt)
        numbers = f"{learnt} of {counted(len(self.learnt), 'number')} determined by {counted(self.n_windows, 'window')}"
        gain = f"gain in ln evidence over the given file: {self.evidence_gain:.0f}"
        return in_short(f"Calibration of {self.vehicle.name!r}: {numbers}", gain, *self.notes[:1])

    @property
    def n_windows(self) -> int:
        """Number of windows."""
        return len(self.n_segments)

    @property
    def is_better(self) -> bool:
        """Whether the completed file explains the windows better than the given one, far beyond chance."""
        return self.evidence_gain > RULES.convincing

    def number(self, name: str) -> CalibratedNumber:
        """Return a learnt number by its name; KeyError if it was not free."""
        return {number.name: number for number in self.learnt}[name]


@dataclass(frozen=True, slots=True)
class CalibrationSettings:
    """Choices of a calibration.

    Parameters
    ----------
    corners
        Choices of the fits, as for `sprung.likelihood.fit_corners`.
    most_mounts
        Largest number of masses on mounts that are added to the file.
    has_modes
        Whether torsion and bending of the body are added where the drives show them.

    Raises
    ------
    ParameterError
        If a number is below 0.
    """

    corners: CornerSettings = field(default_factory=CornerSettings)
    most_mounts: int = 3
    has_modes: bool = True

    def __post_init__(self) -> None:
        check_number("most_mounts", self.most_mounts, at_least=0)


def calibrate(
    recordings: Recording | Iterable[Recording],
    vehicle: Vehicle,
    *,
    settings: CalibrationSettings | None = None,
    allow_missing: bool = False,
) -> Calibration:
    """Complete a vehicle file with what is learnt from healthy drives.

    Parameters
    ----------
    recordings
        Windows of healthy drives as read, with the same channels, at least one; drives with different
        loads, on different roads and at different speeds determine more. About ten minutes each.
    vehicle
        Vehicle as its file describes it.
    settings
        Choices.
    allow_missing
        Whether the recordings may lack sensors of the vehicle file; a note then says which.

    Returns
    -------
    Calibration

    Raises
    ------
    ParameterError
        If there is no recording, one lacks a sensor of the vehicle file, or the recordings have other channels than the
        first one.
    DataError
        If the speed is missing, no segment of a window is long, fast and steady enough, the windows are not consistent
        with the vehicle file (a sensor is inverted, or two are swapped), or channels are exact combinations of others.

    Notes
    -----
    The parameters of maximum posterior probability of all windows together. A number of the file is shared by the
    windows, and its prior counts once; payload, road and noise are each window's own. Of a vehicle with rigid axles,
    each window counts in one range of speed, as side forces damp less at higher ones. A mass on mounts is added where
    the misfit asks for one (`likely_mount`) and the evidence for it is large.

    References
    ----------
    J. L. Beck and L. S. Katafygiotis, Updating models and their uncertainties. I: Bayesian statistical framework,
    Journal of Engineering Mechanics 124 (1998), 455-461.
    D. J. C. MacKay, Bayesian interpolation, Neural Computation 4 (1992), 415-447 (evidence of models).

    Examples
    --------
    Sensors that are where the file says stay there, and their places become known more precisely:

    >>> from sprung.calibration import CalibrationSettings
    >>> from sprung.likelihood import CornerSettings
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=60.0, sampling_rate=60.0, snr=50.0), seed=1).recording
    >>> corners = CornerSettings(band=(0.7, 10.0))
    >>> settings = CalibrationSettings(corners, most_mounts=0, has_modes=False)
    >>> calibration = calibrate(drive, vehicle, settings=settings)
    >>> place = calibration.number("acc_fl.x")
    >>> abs(place.value - place.nominal_value) < 2 * place.std, place.std < place.prior_std, calibration.is_better
    (True, True, False)
    """
    settings = settings_of(CalibrationSettings, settings)
    check_on_axles(vehicle, "a calibration")
    windows = [window_of(recording, vehicle, allow_missing=allow_missing) for recording in each_recording(recordings)]
    _check_alike(windows)
    faults = refuse_wrong_sensors(windows)
    spectra = tuple(window_spectra(window, settings.corners) for window in windows)
    calibration = calibrated(spectra, vehicle, settings=settings)
    return replace(calibration, notes=(*windows[0].notes, *calibration.notes, *faults))


def calibrated(
    windows: tuple[WindowSpectra, ...], vehicle: Vehicle, *, settings: CalibrationSettings | None = None
) -> Calibration:
    """Complete a vehicle file with what is learnt from the spectra of healthy drives, as `calibrate`.

    Parameters
    ----------
    windows
        Spectra of windows with the same channels, at least one.
    vehicle, settings
        As for `calibrate`.

    Returns
    -------
    Calibration
        Completed vehicle file, learnt numbers with deviations, and the misfit before and after.

    Raises
    ------
    DataError
        If the windows are not consistent with the vehicle file, or channels are exact combinations of others.

    References
    ----------
    As for `calibrate`.

    Examples
    --------
    A drive of the vehicle of the file gives no reason to change the file:

    >>> from sprung.calibration import CalibrationSettings, usable_spectra
    >>> from sprung.likelihood import CornerSettings
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=60.0, sampling_rate=60.0, snr=50.0), seed=1).recording
    >>> settings = CalibrationSettings(CornerSettings(band=(0.7, 10.0)), most_mounts=0, has_modes=False)
    >>> calibration = calibrated(usable_spectra([drive], vehicle), vehicle, settings=settings)
    >>> calibration.n_windows, calibration.is_better
    (1, False)
    """
    settings = settings_of(CalibrationSettings, settings)
    with _refusal(windows):
        return _completion(as_given(windows, vehicle, settings.corners), vehicle, settings)


@contextmanager
def _refusal(windows: Sequence[WindowSpectra]) -> Iterator[None]:
    """Refuse windows whose matrices become singular in a fit."""
    try:
        yield
    except np.linalg.LinAlgError:
        pass
    else:
        return
    for window in windows:
        values = window.segments.values.reshape(-1, window.segments.values.shape[-1])
        spread = np.linalg.svd(values / np.linalg.norm(values, axis=0), compute_uv=False)
        if spread[-1] < RULES.rounding:
            raise DataError(
                "calibration needs channels with noise of their own, but some of these are exact combinations of "
                "others: give measured drives, or simulate drives with noise (`--snr 10000`)"
            )
    raise DataError(
        "the windows are not consistent with the vehicle file: check signs, places and units of the sensors"
    )


def as_given(windows: tuple[WindowSpectra, ...], vehicle: Vehicle, corners: CornerSettings) -> JointFit:
    """Fit springs, dampers and tyres alone, with all else as the file states: the reference of a calibration.

    Parameters
    ----------
    windows
        Spectra of windows.
    vehicle
        Vehicle as its file describes it.
    corners
        Choices of the fit.
    """
    draft = explicit(vehicle)
    return joint_fit(FreeVehicle(windows, draft, _components(draft, corners), corners))


def _completion(given: JointFit, vehicle: Vehicle, settings: CalibrationSettings) -> Calibration:
    """Return the calibration that continues from the fit of the vehicle as given."""
    free = given.free
    fit = extended_fit(given, _free(free.windows, free.draft, settings.corners, vehicle))
    fit, notes = _with_additions(fit, vehicle, settings)
    learnt = learnt_numbers(fit)
    before, after = ([misfit_in(one, k, window.rigid) for k, window in enumerate(free.windows)] for one in (given, fit))
    frequencies = [window.segments.frequencies for window in free.windows]
    n_segments = [window.segments.speeds.size for window in free.windows]
    return Calibration(
        vehicle=_with_sources(completed(fit), learnt, len(free.windows)),
        learnt=learnt,
        coordinates=free.windows[0].rigid.coordinates,
        frequencies=frequencies[0],
        misfit_before=_mean_misfit([misfit for misfit, _ in before], frequencies, n_segments),
        misfit_after=_mean_misfit([misfit for misfit, _ in after], frequencies, n_segments),
        model_errors_before=tuple(error for _, error in before),
        model_errors_after=tuple(error for _, error in after),
        evidence_gain=_evidence_gain(fit, given),
        n_segments=tuple(n_segments),
        notes=(*notes, *_notes(learnt), *_note_on_speeds(free.windows, vehicle)),
    )


def is_imperfect(model_errors: Sequence[float]) -> bool:
    """Return whether a vehicle file explains windows so poorly that it should be calibrated first.

    Parameters
    ----------
    model_errors
        Model error of each window (`CornerFit.model_error`); infinite for a window that could not be fitted.

    Examples
    --------
    The median decides, so that one poor window does not:

    >>> is_imperfect([0.02, 0.03, 0.4]), is_imperfect([0.02, 0.3, 0.4])
    (False, True)
    """
    return bool(model_errors) and float(np.median(model_errors)) > RULES.imperfect


def has_misplaced_sensors(given: JointFit) -> bool:
    """Return whether other places, gains, directions or delays of the sensors would explain windows far better.

    Parameters
    ----------
    given
        Fit of the vehicle as given (`as_given`).

    Notes
    -----
    A misplaced sensor hardly raises the error of a fit of the corners: other springs and dampers, and the noise, take
    it up. One Newton step of all numbers of the sensors (`expected_steps`) shows it: its gain is large, and it moves a
    sensor farther than the nonlinearity of suspensions does.
    """
    draft, corners = given.free.draft, given.free.settings
    sensors = sensor_numbers(draft, given.free.windows[0].layout.names)
    numbers = with_widths((*given.free.numbers, *sensors), draft)
    steps, gain = expected_steps(FreeVehicle(given.free.windows, draft, numbers, corners), given)
    wrong = {"x": RULES.wrong_place, "y": RULES.wrong_place, "delay": RULES.wrong_delay}
    errors = [abs(steps[number.name]) / wrong.get(number.field, RULES.wrong_gain) for number in sensors]
    return gain > RULES.convincing and max(errors, default=0.0) > 1


def chosen_windows(n_windows: int) -> frozenset[int]:
    """Return the numbers of the windows to calibrate on: at most three, evenly spread over the drives.

    Examples
    --------
    >>> sorted(chosen_windows(31)), sorted(chosen_windows(2))
    ([0, 15, 30], [0, 1])
    """
    return frozenset(np.linspace(0, n_windows - 1, min(n_windows, CALIBRATION_WINDOWS)).round().astype(int).tolist())


def calibrated_if_imperfect(
    windows: tuple[WindowSpectra, ...], vehicle: Vehicle, *, model_errors: Sequence[float]
) -> Calibration | None:
    """Calibrate a vehicle file if it explains the windows of a baseline poorly, or misplaces sensors.

    Parameters
    ----------
    windows
        Spectra of windows of healthy drives with the same channels; about three.
    vehicle
        Vehicle as its file describes it.
    model_errors
        Model error of each window of the baseline, as for `is_imperfect`.

    Returns
    -------
    Calibration or None
        None if the file is good enough, or the completed file explains the windows no better.

    Raises
    ------
    DataError
        If the windows are not consistent with the vehicle file.

    Examples
    --------
    A file that explains its windows well is left as it is:

    >>> from sprung.calibration import usable_spectra
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=60.0, sampling_rate=60.0, snr=50.0), seed=1).recording
    >>> calibrated_if_imperfect(usable_spectra([drive], vehicle), vehicle, model_errors=[0.02]) is None
    True
    """
    if not windows:
        return None
    settings = CalibrationSettings()
    with _refusal(windows):
        given = as_given(windows, vehicle, settings.corners)
        if not (is_imperfect(model_errors) or has_misplaced_sensors(given)):
            return None
        calibration = _completion(given, vehicle, settings)
        return calibration if calibration.is_better else None


def usable_spectra(recordings: Iterable[Recording], vehicle: Vehicle) -> tuple[WindowSpectra, ...]:
    """Return the spectra of those windows that a calibration can use, with the channels of the first of them.

    Of a vehicle on bogies there are none: its file cannot be calibrated.

    Parameters
    ----------
    recordings
        Windows as read, which may lack sensors of the vehicle file.
    vehicle
        Vehicle as its file describes it.

    Examples
    --------
    A window without the speed cannot be used:

    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=60.0, sampling_rate=60.0), seed=1).recording
    >>> without_speed = drive.select(["acc_fl", "acc_fr", "acc_rl", "acc_rr"])
    >>> [window.layout.names for window in usable_spectra([drive, without_speed], vehicle)]
    [('acc_fl', 'acc_fr', 'acc_rl', 'acc_rr')]
    """
    usable: list[WindowSpectra] = []
    for recording in () if vehicle.bogie else recordings:
        try:
            spectra = window_spectra(window_of(recording, vehicle, allow_missing=True), CornerSettings())
        except (DataError, ParameterError):
            continue
        if not usable or spectra.layout.names == usable[0].layout.names:
            usable.append(spectra)
    return tuple(usable)


def _components(draft: Draft, corners: CornerSettings) -> tuple[VehicleNumber, ...]:
    """Return springs, dampers and tyres, as wide as the file states."""
    return with_widths(component_numbers(draft, std=corners.prior_std), draft)


def _free(spectra: tuple[WindowSpectra, ...], draft: Draft, corners: CornerSettings, given: Vehicle) -> FreeVehicle:
    """Return windows with all that is free of a vehicle."""
    others = *added_numbers(draft, given=given), *file_numbers(draft, spectra[0].layout.names)
    return FreeVehicle(spectra, draft, with_widths((*_components(draft, corners), *others), draft), corners)


def _with_additions(fit: JointFit, given: Vehicle, settings: CalibrationSettings) -> tuple[JointFit, list[str]]:
    """Return the fit with the parts that the file lacks and the drives show, and a sentence on each.

    Torsion comes first: without it a mass on mounts would do part of its work, but not the other way round.
    """
    notes: list[str] = []
    if settings.has_modes:
        fit = _with_mode(fit, "torsion", given, notes)
    fit = _with_rubber(fit, given, notes)
    for _ in range(settings.most_mounts):
        mount, promise = likely_mount(fit)
        richer, gain = _richer(fit, None if mount is None else with_mount(fit.free.draft, mount), promise, given)
        if richer is fit:
            break
        added = completed(richer).mounted_mass[-1]
        if not (RULES.mounts[0] < added.frequency < RULES.mounts[1] and _is_shown(richer, fit)):
            break
        fit = richer
        notes.append(
            f"a mass of {added.mass:.0f} kg on mounts of {added.frequency:.3g} Hz at x = {added.x:.2f} m explains what "
            f"the vehicle file does not (ln evidence {gain:.0f})"
        )
    return (_with_mode(fit, "bending", given, notes) if settings.has_modes else fit), notes


def _with_rubber(fit: JointFit, given: Vehicle, notes: list[str]) -> JointFit:
    """Return the fit with dampers on rubber, such as top mounts, if an imperfect model becomes clearly better by it."""
    draft = fit.free.draft
    for index, axle in enumerate(given.axle):
        if axle.damper_bushing_stiffness is None and axle.damping:
            place = ("axle", index, "damper_bushing_stiffness")
            draft = draft.with_value(place, RULES.rubber * draft.value_at(("axle", index, "spring_stiffness")))
    errors = [misfit_in(fit, k, window.rigid)[1] for k, window in enumerate(fit.free.windows)]
    if draft is fit.free.draft or not is_imperfect(errors):
        return fit
    richer, gain = _richer(fit, draft, np.inf, given)
    if not _is_shown(richer, fit):
        return fit
    notes.append(f"rubber that carries the dampers explains what the vehicle file does not (ln evidence {gain:.0f})")
    return richer


def _with_mode(fit: JointFit, shape: Literal["torsion", "bending"], given: Vehicle, notes: list[str]) -> JointFit:
    """Return the fit with a flexible mode of the body if the drives show it; a sentence on it is added to the notes.

    The mode is the one that raises the likelihood of the fit most, all else unchanged.
    """
    if shape in {mode.shape for mode in given.flexible_mode}:
        return fit
    first = least = fit.joint.objective(fit.parameters)[0]
    best = None
    for frequency in RULES.mode_frequencies:
        mode = FlexibleMode(shape=shape, frequency=frequency, damping_ratio=RULES.mode_damping)
        draft = with_mode(fit.free.draft, mode)
        value = evaluated(_free(fit.free.windows, draft, fit.free.settings, given), fit)
        if value < least:
            best, least = draft, value
    richer, gain = _richer(fit, best, (first - least) / OVERCOUNT, given)
    if shape == "bending" and not _is_shown(richer, fit):
        return fit
    if richer is not fit:
        frequency = completed(richer).flexible_mode[-1].frequency
        notes.append(
            f"a {shape} mode of the body at {frequency:.3g} Hz explains what the vehicle file does not "
            f"(ln evidence {gain:.0f})"
        )
    return richer


def _richer(fit: JointFit, draft: Draft | None, promise: float, given: Vehicle) -> tuple[JointFit, float]:
    """Return the fit of a draft with one part more and its gain in ln evidence; the old fit if that is too little."""
    if draft is None or promise < RULES.convincing:
        return fit, 0.0
    richer = extended_fit(fit, _free(fit.free.windows, draft, fit.free.settings, given))
    gain = _evidence_gain(richer, fit)
    return (richer, gain) if gain >= RULES.convincing else (fit, 0.0)


def _evidence_gain(fit: JointFit, poorer: JointFit) -> float:
    """Return the gain in ln evidence of a fit over one with fewer parameters, under the weights of the former."""
    poorer = reweighted(poorer, fit.weighting)
    return fit.joint.log_evidence(fit.parameters) - poorer.joint.log_evidence(poorer.parameters)


def _is_shown(richer: JointFit, fit: JointFit) -> bool:
    """Return whether a part makes the median model error of the drives clearly smaller; torsion hardly enters it."""
    after, before = (
        np.median([misfit_in(one, k, window.rigid)[1] for k, window in enumerate(fit.free.windows)])
        for one in (richer, fit)
    )
    return bool(after < RULES.explained * before)


def _check_alike(windows: Sequence[Window]) -> None:
    """Raise unless the windows have the same channels."""
    if not windows:
        raise ParameterError("no window was given, but one is needed: give drives of the vehicle")
    first = windows[0]
    for window in windows[1:]:
        if window.outputs != first.outputs:
            with naming(window.recording):
                raise ParameterError(
                    f"a window has the channels {', '.join(window.outputs)}, the first one {', '.join(first.outputs)}: "
                    "give windows with the same channels"
                )


def _mean_misfit(misfits: Sequence[Real], frequencies: Sequence[Real], n_segments: Sequence[int]) -> Real:
    """Return the misfit of all windows, averaged by their numbers of segments, shape (coordinates, frequencies)."""
    alike = [
        [np.interp(frequencies[0], own, row) for row in misfit]
        for misfit, own in zip(misfits, frequencies, strict=True)
    ]
    return np.asarray(np.average(alike, axis=0, weights=n_segments), dtype=np.float64)


def learnt_numbers(fit: JointFit) -> tuple[CalibratedNumber, ...]:
    """Return the numbers of a vehicle that were free in a fit, with their standard deviations.

    Raises
    ------
    numpy.linalg.LinAlgError
        If the information about them is singular.
    """
    joint, given = fit.joint, fit.free.draft
    variances = np.diag(joint.covariance(fit.parameters))
    if not np.all(variances > 0):
        raise np.linalg.LinAlgError("the covariance is not positive definite")
    stds, parameters = (
        dict(zip(joint.names, each.tolist(), strict=True)) for each in (np.sqrt(variances), fit.parameters)
    )
    learnt = []
    for number in fit.free.numbers:
        before, std = given.value_at(number.place), stds[number.name]
        value = number.value(before, parameters[number.name])
        learnt.append(
            CalibratedNumber(
                name=number.name,
                group=number.group,
                unit=number.unit,
                nominal_value=None if number.is_new else before,
                value=value,
                std=number.std_of_value(value, std),
                prior_std=number.std_of_value(before, number.std),
                is_identifiable=std < RULES.identifiable * number.std,
            )
        )
    if DELAY in parameters:
        before, std, prior = given.vehicle.speed_scale, stds[DELAY], float(joint.prior_std[joint.names.index(DELAY)])
        scale = before * float(np.exp(-parameters[DELAY]))
        is_identifiable = std < RULES.identifiable * prior
        learnt.append(CalibratedNumber("speed_scale", "speed", "", before, scale, scale * std, prior, is_identifiable))
    return tuple(learnt)


def completed(fit: JointFit) -> Vehicle:
    """Return the vehicle file of a fit: each axle has the geometric mean of its corners."""
    own = fit.joint.of_window(0, fit.parameters)[: len(fit.free.numbers)]
    draft = moved(fit.free.draft, fit.free.numbers, own)
    corners = corner_names(len(draft.vehicle.axle))
    for index, sides in enumerate(zip(corners[::2], corners[1::2], strict=True)):
        for name, (kind, _) in COMPONENT_FIELDS.items():
            factors = [draft.factors.get(Component(corner, kind), 1.0) for corner in sides]
            if getattr(draft.vehicle.axle[index], name):
                place = ("axle", index, name)
                draft = draft.with_value(place, draft.value_at(place) * float(np.sqrt(np.prod(factors))))
    scale = float(np.exp(-fit.values().get(DELAY, 0.0)))
    return draft.with_fields(speed_scale=draft.vehicle.speed_scale * scale).vehicle


def _with_sources(vehicle: Vehicle, learnt: Sequence[CalibratedNumber], n_windows: int) -> Vehicle:
    """Return the vehicle file with a table of where the numbers that the drives determine come from."""
    drives = "one drive" if n_windows == 1 else f"{n_windows} windows of drives"
    source = f"calibrated on {drives}"
    entries = [
        LearntNumber(name=one.name, value=one.value, std=one.std, given=one.nominal_value, source=source)
        for one in learnt
        if one.is_identifiable
    ]
    names = {entry.name for entry in entries}
    kept = [entry for entry in vehicle.learnt if entry.name not in names]
    return vehicle.model_copy(update={"learnt": (*kept, *entries)})


def _notes(learnt: Sequence[CalibratedNumber]) -> tuple[str, ...]:
    """Return remarks on numbers that the drives do not determine."""
    silent = [
        number.name for number in learnt if not number.is_identifiable and number.group not in {"sides", "sensors"}
    ]
    if not silent:
        return ()
    return (f"not determined by these drives, and left near the given values: {', '.join(silent)}",)


def _note_on_speeds(windows: Sequence[WindowSpectra], vehicle: Vehicle) -> tuple[str, ...]:
    """Return a remark on the range of speed of the drives that is used, where it is not all of them."""
    if not is_in_one_range(vehicle):
        return ()
    speeds = np.concatenate([window.segments.speeds for window in windows])
    return (
        f"segments of one range of speed of each drive are used, {speeds.min():.0f} to {speeds.max():.0f} m/s in all: "
        "side forces on rigid axles damp less at higher speeds",
    )
