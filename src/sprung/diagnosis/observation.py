"""Observations of windows of ten minutes: conditions, corners, modes, sensor faults; or a reason for their absence."""

from collections.abc import Collection, Iterable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_type, freeze
from sprung._display import Tabular, counted, in_short, listed
from sprung._threads import one_thread
from sprung.diagnosis.residuals import RESIDUALS, ResidualStatistics, residual_statistics
from sprung.diagnosis.sensors import exchanged_opposites, valid_part
from sprung.errors import DataError, IdentificationError, ParameterError
from sprung.likelihood import CornerFit, CornerSettings, run_out
from sprung.likelihood.bump_stops import Stiffening, stiffening
from sprung.likelihood.elements import log_of_bars
from sprung.likelihood.fitting import fit_windows
from sprung.likelihood.lateral import LateralFit, fit_lateral_under
from sprung.likelihood.plate_test import low_phase_shifts
from sprung.modal import Modes
from sprung.recording import Recording, each_recording
from sprung.ride import response_of
from sprung.signals.conditioning import decimate
from sprung.vehicles import Component, Vehicle
from sprung.vehicles.channel_faults import MISSING, SensorFault
from sprung.vehicles.labels import MOTIONS
from sprung.vehicles.lateral import lateral_parts
from sprung.vehicles.sensor_checks import CONTRADICTIONS, describe_contradictions, refuse_wrong_sensors
from sprung.vehicles.window import Window, window_of

#: Length of a window [s].
WINDOW = 600.0
#: Conditions that the fit of the parts accounts for but the correlations of the channels depend on, and one unit of
#: each: the payload's moments [kg m] and product of inertia [kg m2], amplitude of the right track over the left one.
LAYOUT_CONDITIONS = {
    "payload_x_moment": 100.0,
    "payload_y_moment": 50.0,
    "payload_product": 50.0,
    "right_over_left": 0.2,
}
#: Units of conditions; the others have none.
CONDITION_UNITS = {
    "speed": "m/s",
    "temperature": "°C",
    "turning": "rad/s",
    "roughness": "m^3",
    "payload": "kg",
    "payload_x_moment": "kg m",
    "payload_y_moment": "kg m",
    "payload_product": "kg m^2",
    "mileage": "km",
    "ride": "m/s^2",
}


@dataclass(frozen=True, slots=True)
class WindowLimits:
    """Limits of conclusive windows."""

    #: Smallest number of segments.
    min_segments: int = 40
    #: Largest model error.
    model_error: float = 1.0
    #: Share of the spectra left out for lines above which the fit may have chosen what it explains.
    many_lines: float = 0.25
    #: Largest model error of such a window.
    model_error_between_lines: float = 0.25


LIMITS = WindowLimits()


@dataclass(frozen=True, eq=False, slots=True)
class Observation(Tabular):
    """Estimates from one window, and its conditions.

    Parameters
    ----------
    time
        Time of the window's first sample [s].
    components
        Fitted springs, dampers and tyres, and anti-roll bars of the vehicle file where the sensors see the body roll.
        Of a rail vehicle with lateral tables, lateral sensors and the speed also "bogie1.lateral_damper" ... and
        "wheelsets.conicity", see `sprung.likelihood.fit_lateral`.
    log_ratios
        ln(value / nominal value) of each component, shape (components,); empty if the window is inconclusive. Of an
        anti-roll bar or a lateral part that has lost more than half, ln(1/2) and twice what it has lost beyond.
    covariance
        Covariance of `log_ratios`, shape (components, components).
    conditions
        Known conditions. Of every window: "speed" [m/s] and "temperature" [°C] (means), "standing" (share of time),
        "turning" (RMS of the yaw rate [rad/s]: near 0 on a straight), "mileage" (odometer at its end [km]). Of
        conclusive windows: "roughness" of the road G(n0) [m^3], "payload" [kg], "payload_x_moment" and
        "payload_y_moment" [kg m], "payload_product" [kg m^2], "right_over_left" (amplitude of the tracks),
        "model_error", "segments".
    modes
        Natural frequency [Hz] and damping ratio of bounce, pitch and roll, as far as the fitted vehicle has them.
    sensor_faults
        Faults of sensors in the window.
    reason
        Reason why the window is inconclusive; empty if it is conclusive.
    vehicle
        Name of the vehicle; empty if unknown.
    residuals
        Statistics for the residual test; None if the window is inconclusive or a sensor fails.
    missing
        Sensors of motion of the vehicle file that the recording lacks.
    notes
        Unusual motion of the vehicle file, sensors that the recording lacks, and channels that the file does not name,
        in words.
    phase_shifts
        Phase shift of the suspension test [degrees] and its standard deviation, of the corners below 55 degrees, see
        `sprung.likelihood.plate_tests`.
    stiffening
        How much stiffer the springs of corners become inwards, see `sprung.likelihood.bump_stops`; None where it is
        unknown or a sensor fails.
    run_outs
        Run-out of each wheel of a rail vehicle and its standard deviation [m], see `sprung.likelihood.run_out`; empty
        where no line of its turns stands out.
    """

    time: float
    components: tuple[Component, ...]
    log_ratios: Real
    covariance: Real
    conditions: dict[str, float]
    modes: dict[str, tuple[float, float]]
    sensor_faults: tuple[SensorFault, ...]
    reason: str = ""
    vehicle: str = ""
    residuals: ResidualStatistics | None = None
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    phase_shifts: dict[str, tuple[float, float]] = field(default_factory=dict)
    stiffening: Stiffening | None = None
    run_outs: dict[str, tuple[float, float]] = field(default_factory=dict)

    def __post_init__(self) -> None:
        # Row by row, as when it is read from a document: the order in memory shows in the last digit of sums.
        object.__setattr__(self, "covariance", np.ascontiguousarray(self.covariance))
        freeze(self, log_ratios=1, covariance=2)

    def __repr__(self) -> str:
        """Return time, conditions, modes and sensor faults, or why the window is inconclusive."""
        of_vehicle = f" of {self.vehicle!r}" if self.vehicle else ""
        state = self.reason and f"inconclusive: {self.reason}"
        modes = listed(f"{label} {f:.4g} Hz {100 * ratio:.3g} %" for label, (f, ratio) in self.modes.items())
        faults = listed(f"{fault.channel} {fault.kind.replace('_', ' ')}" for fault in self.sensor_faults)
        head = f"Observation at {self.time:.6g} s{of_vehicle}: "
        head += state or f"{counted(len(self.components), 'component')}; {modes}"
        conditions = listed(f"{name} {value:.4g}" for name, value in self.conditions.items())
        return in_short(head, conditions, f"sensor faults: {faults}" if faults else "")

    @property
    def is_conclusive(self) -> bool:
        """Whether the window has estimates."""
        return not self.reason

    @property
    def is_valid(self) -> bool:
        """Whether the window has estimates, and no sensor fails."""
        return self.is_conclusive and not self.sensor_faults

    def of_stiffening(self) -> "Observation | None":
        """Return the stiffening of the springs in place of their log ratios, with speed and road; None: unknown.

        The fitted load is left out: a corner that stands on its bump stop changes it.
        """
        if self.stiffening is None:
            return None
        parts = tuple(Component(corner, "spring") for corner in self.stiffening.corners)
        road = {name: value for name, value in self.conditions.items() if name in {"speed", "roughness"}}
        values, covariance = self.stiffening.values, self.stiffening.covariance
        return Observation(self.time, parts, values, covariance, road, {}, (), vehicle=self.vehicle)

    def without_segments(self) -> "Observation":
        """Return the observation with residual statistics reduced to what a comparison needs."""
        return self if self.residuals is None else replace(self, residuals=self.residuals.without_segments())


class Observations(tuple[Observation, ...], Tabular):
    """Observations of several windows."""

    def __repr__(self) -> str:
        """Return the number of windows, and why some are inconclusive."""
        conclusive = [window for window in self if window.is_conclusive]
        vehicles = ", ".join(sorted({window.vehicle for window in self if window.vehicle}))
        reasons = listed(dict.fromkeys(window.reason for window in self if window.reason))
        count = f"{counted(len(self), 'window')}, {len(conclusive)} conclusive"
        return in_short(f"Observations{f' of {vehicles}' if vehicles else ''}: {count}", reasons)


def windows(
    recordings: Recording | Iterable[Recording], *, length: float = WINDOW
) -> Iterator[tuple[float, Recording]]:
    """Return an iterator over windows of recordings with their start times.

    Parameters
    ----------
    recordings
        Recordings in the order of time. Those without a start time follow each other.
    length
        Length of a window [s]. A remainder at the end of a recording that is shorter than half a window joins the last
        window.

    Returns
    -------
    iterator of tuple
        Time of the window's first sample since the start of the first recording [s], and its samples.

    Examples
    --------
    A quarter of an hour is a window of ten minutes, and one of five:

    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> run = Recording(np.zeros((1, 9000)), 10.0, (Channel("acc"),))
    >>> [(start, window.duration) for start, window in windows(run)]
    [(0.0, 600.0), (600.0, 300.0)]
    """
    return _windows(each_recording(recordings), length)


def _windows(recordings: Iterable[Recording], length: float) -> Iterator[tuple[float, Recording]]:
    clock = 0.0
    first: int | None = None
    for recording in recordings:
        if recording.start is not None:
            first = recording.start if first is None else first
            clock = (recording.start - first) / 1e9
        n_samples = recording.n_samples
        per_window = max(1, round(length * recording.sampling_rate))
        count = max(1, round(n_samples / per_window))
        for number in range(count):
            begin = number * per_window
            end = n_samples if number == count - 1 else begin + per_window
            yield clock + begin / recording.sampling_rate, recording.part(begin, end)
        clock += recording.duration


def observe(
    recordings: Recording | Iterable[Recording],
    vehicle: Vehicle,
    *,
    length: float = WINDOW,
    settings: CornerSettings | None = None,
    allow_missing: bool = False,
) -> Observations:
    """Return the observations of all windows of recordings.

    Parameters
    ----------
    recordings
        Recordings as read, in the order of time.
    vehicle
        Vehicle with its sensors.
    length
        Length of a window [s].
    settings
        Choices of the fit.
    allow_missing
        Whether the recordings may lack sensors of the vehicle file.

    Returns
    -------
    Observations
        Tuple of one observation for each window, see `observe_window`. Times are counted from the start of the first
        recording; recordings without a start time follow each other.

    Raises
    ------
    DataError, ParameterError
        As raised by `observe_window`.

    Examples
    --------
    Two minutes of a simulated drive are one window:

    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=120.0, sampling_rate=60.0, snr=50.0), seed=1)
    >>> (window,) = observe(drive.recording, vehicle)
    >>> window.is_conclusive, len(window.components), list(window.modes)
    (True, 12, ['bounce', 'pitch', 'roll'])
    """
    check_type("vehicle", vehicle, Vehicle)
    parts = windows(recordings, length=length)
    return Observations(
        observe_window(part, vehicle, time=time, settings=settings, allow_missing=allow_missing) for time, part in parts
    )


@one_thread
def observe_window(
    recording: Recording,
    vehicle: Vehicle,
    *,
    time: float = 0.0,
    settings: CornerSettings | None = None,
    allow_missing: bool = False,
) -> Observation:
    """Return the observation of one window.

    Parameters
    ----------
    recording
        Window as read, of any length.
    vehicle
        Vehicle with its sensors.
    time
        Time of the window's first sample [s].
    settings
        Choices of the fit.
    allow_missing
        Whether the recording may lack sensors of the vehicle file; the observation then names them. It can be compared
        with a baseline that was learnt without the same ones.

    Raises
    ------
    DataError
        If the recording has no motion sensor of the vehicle file.
    ParameterError
        If the recording lacks a sensor of the vehicle file, or has one with another quantity.

    Notes
    -----
    Failing channels are left out and the others are fitted; a wrong speed is replaced by the one that the delay between
    the axles gives. An inconclusive window states its reason. A window whose sensors contradict each other is
    inconclusive: the baseline assumes one sensor layout, and exchanged channels leave no valid data. So is a window
    that the vehicle file explains poorly: with a model error above 1, or above 0.25 where more than a quarter of the
    spectra are left out for lines. Most of that is misfit, as of another vehicle than the file's; the fit to what is
    left has many optima, among which rounding decides.

    Examples
    --------
    A dead sensor is a fault, and the other channels are fitted without it:

    >>> from functools import partial
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.simulation.sensors import dead, with_imperfections
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=120.0, sampling_rate=60.0, snr=50.0), seed=1).recording
    >>> failing = with_imperfections(drive, [partial(dead, channel="acc_fl")])
    >>> window = observe_window(failing, vehicle)
    >>> [(fault.channel, fault.kind) for fault in window.sensor_faults], window.is_conclusive
    ([('acc_fl', 'dead')], True)
    """
    check_type("recording", recording, Recording)
    check_type("vehicle", vehicle, Vehicle)
    placed = window_of(recording, vehicle, allow_missing=allow_missing)
    window, check = valid_part(placed, settings=settings)
    wrong = [fault for fault in check.faults if fault.kind in CONTRADICTIONS]
    if wrong and not window.outputs:
        return _observation(time, window, check.faults, reason=describe_contradictions(wrong))
    try:
        fit = fit_windows([window], settings=settings)
    except (DataError, ParameterError) as error:
        return _observation(time, window, check.faults, reason=str(error))
    exchanged = () if check.faults or check.disagreement else exchanged_opposites(window, fit, settings)
    reason = "sensors are exchanged" if exchanged else _reason(fit, check.disagreement)
    if reason:
        return _observation(time, window, exchanged or check.faults, reason=reason)
    try:
        sideways = _lateral_fit(window, fit)
    except DataError as error:
        return _observation(time, window, check.faults, reason=f"lateral motion: {error}")
    modes = fit.modes()
    body = zip(modes.labels, modes.natural_frequency.tolist(), modes.damping_ratio.tolist(), strict=True)
    parts = _parts(fit)
    rows = list(parts.values())
    ratios, slopes = fit.parameters[rows], np.ones(len(rows))
    bars = np.array([part.kind == "anti_roll" for part in parts])
    ratios[bars], slopes[bars] = log_of_bars(ratios[bars])
    lateral, lateral_ratios, lateral_covariance = _lateral_parts(sideways)
    own = fit.covariance[np.ix_(rows, rows)] * np.outer(slopes, slopes)
    apart = np.zeros((len(own), len(lateral_covariance)))
    motion = None if check.faults else _slow_motion(window)
    return replace(
        _observation(time, window, check.faults),
        components=(*parts, *lateral),
        log_ratios=np.concatenate([ratios, lateral_ratios]),
        covariance=np.block([[own, apart], [apart.T, lateral_covariance]]),
        conditions=window.conditions | _fitted_conditions(fit) | _ride(window),
        modes={label: (frequency, damping) for label, frequency, damping in body if label in MOTIONS},
        residuals=None if motion is None else _residuals(motion),
        phase_shifts=low_phase_shifts(fit),
        stiffening=None if motion is None else stiffening(motion, fit.model.layout, window.structure),
        run_outs=_run_outs(fit) if window.vehicle.kind == "rail" else {},
    )


def _reason(fit: CornerFit, disagreement: float) -> str:
    """Return why a window is inconclusive although it could be fitted; empty if it is conclusive."""
    if disagreement:
        apart = f"sensors disagree by {100 * disagreement:.0f} % and no single one explains it"
        return f"{apart}: check signs, gains, places and delays"
    if fit.n_segments < LIMITS.min_segments:
        needed = f"{LIMITS.min_segments} are needed: give longer windows"
        return f"{fit.n_segments} segments of steady speed are too few, {needed}"
    has_many_lines = fit.share_of_lines > LIMITS.many_lines
    if fit.model_error > (LIMITS.model_error_between_lines if has_many_lines else LIMITS.model_error):
        badly = f"the vehicle file explains the window poorly: model error {100 * fit.model_error:.0f} %"
        lines = f" with {100 * fit.share_of_lines:.0f} % of the spectra left out for lines"
        return f"{badly}{lines if has_many_lines else ''}"
    return ""


def _parts(fit: CornerFit) -> dict[Component, int]:
    """Return the parts whose change is sought, and the rows of their parameters."""
    known = {str(component): component for component in fit.components}
    if "roll" in fit.model.layout.coordinates:
        bars = (element for element in fit.model.structure.elements if element.part == "anti_roll")
        known |= {f"{element.owner}_stiffness": element.components[0] for element in bars}
    return {known[name]: row for row, name in enumerate(fit.model.names) if name in known}


def _run_outs(fit: CornerFit) -> dict[str, tuple[float, float]]:
    """Return run-out and standard deviation of each wheel; empty where no line of the wheels stands out."""
    found = run_out(fit)
    return (
        {}
        if found is None
        else dict(zip(found.wheels, zip(found.values.tolist(), found.stds.tolist(), strict=True), strict=True))
    )


def _lateral_fit(window: Window, fit: CornerFit) -> LateralFit | None:
    """Return the fit of lateral motion under the fitted load; None without the speed or all lateral sensors."""
    sideways = fit_lateral_under(fit, [window])
    if sideways is not None and sideways.model_error > LIMITS.model_error:
        raise DataError(f"the vehicle file explains it poorly: model error {100 * sideways.model_error:.0f} %")
    return sideways


def _lateral_parts(fit: LateralFit | None) -> tuple[tuple[Component, ...], Real, Real]:
    """Return the lateral parts whose change is sought, their log ratios and covariance; of lost ones as of bars."""
    if fit is None:
        return (), np.zeros(0), np.zeros((0, 0))
    parts = lateral_parts(fit.model.vehicle)
    rows = [fit.components.index(name) for name in parts.values()]
    ratios, slopes = log_of_bars(np.expm1(fit.parameters[rows]))
    slopes = slopes * np.exp(fit.parameters[rows])
    return tuple(parts), ratios, fit.covariance[np.ix_(rows, rows)] * np.outer(slopes, slopes)


def _fitted_conditions(fit: CornerFit) -> dict[str, float]:
    """Return the conditions that a fit estimates."""
    # Of a vehicle on bogies tons: a baseline counts in the payloads of a car, and the fit estimates it in any case.
    has_frames = any(element.part == "secondary" for element in fit.model.structure.elements)
    layout = {} if has_frames else {name: estimate["value"] for name, estimate in fit.payload.items()}
    for block, own in fit.model.by_block(fit.parameters):
        layout |= block.values(own) if block.group == "tracks" else {}
    fitted = {"model_error": fit.model_error, "segments": float(fit.n_segments)}
    if "roughness" in fit.inputs:
        fitted["roughness"] = fit.inputs["roughness"]
    if "payload_mass" in layout:
        fitted["payload"] = layout["payload_mass"]
    return fitted | {name: layout[name] for name in LAYOUT_CONDITIONS if name in layout}


def _ride(window: Window) -> dict[str, float]:
    """Return the RMS weighted by Wk (ISO 2631-1) at the vertical accelerometers on the body, by Parseval's theorem."""
    on_body = {sensor.channel for sensor in window.vehicle.sensor if sensor.on == "body"}
    motion = window.motion
    rows = [
        row
        for row, channel in enumerate(motion.channels)
        if channel.name in on_body
        and channel.quantity == "acceleration"
        and (channel.direction is None or np.argmax(np.abs(channel.direction)) == 2)
    ]
    power = 0.0
    for stretch in motion.stretches():
        values = motion.samples[rows, stretch]
        spectra = np.fft.rfft(values - values.mean(axis=1, keepdims=True), axis=1)
        frequencies = np.arange(spectra.shape[1]) * motion.sampling_rate / values.shape[1]
        power += 2 * float(np.sum(np.abs(spectra * response_of("Wk", frequencies)) ** 2)) / values.shape[1]
    return {"ride": float(np.sqrt(power / (len(rows) * motion.n_samples)))} if rows else {}


def _slow_motion(window: Window) -> Recording | None:
    """Return the outputs at the rate at which windows are compared; None if every stretch is too short."""
    motion = window.motion.select(window.outputs)
    try:
        return decimate(motion, min(motion.sampling_rate, RESIDUALS.vehicle_rate))
    except DataError:
        return None


def _residuals(motion: Recording) -> ResidualStatistics | None:
    """Return the statistics for the residual test; None if no stretch of motion is long enough."""
    try:
        return residual_statistics(motion, sampling_rate=RESIDUALS.vehicle_rate)
    except DataError:
        return None


def _observation(time: float, window: Window, faults: tuple[SensorFault, ...], *, reason: str = "") -> Observation:
    """Return the observation of a window without estimates of the corners."""
    return Observation(
        time=time,
        components=(),
        log_ratios=np.zeros(0),
        covariance=np.zeros((0, 0)),
        conditions=window.conditions,
        modes={},
        sensor_faults=faults,
        reason=reason,
        vehicle=window.vehicle.name,
        missing=window.missing,
        notes=window.notes,
    )


def with_missing_as_faults(observation: Observation, *, known: Collection[str] = ()) -> Observation:
    """Return a window whose missing sensors are faults, as a monitored vehicle should have them all.

    Parameters
    ----------
    observation
        Window, observed with `allow_missing`.
    known
        Sensors without which its baseline was learnt.

    Examples
    --------
    The baseline was learnt without the sensor `acc_rr`:

    >>> import numpy as np
    >>> from sprung.diagnosis import Observation
    >>> missing = ("acc_fl", "acc_rr")
    >>> window = Observation(0.0, (), np.zeros(0), np.zeros((0, 0)), {}, {}, (), reason="too short", missing=missing)
    >>> faults = with_missing_as_faults(window, known=("acc_rr",)).sensor_faults
    >>> [(fault.channel, fault.kind) for fault in faults]
    [('acc_fl', 'missing')]
    """
    faults = tuple(
        SensorFault(name, MISSING, "no channel has its name: repair it, or correct the vehicle file")
        for name in observation.missing
        if name not in known
    )
    return replace(observation, sensor_faults=(*observation.sensor_faults, *faults))


def fit_drive(
    recordings: Recording | Iterable[Recording],
    vehicle: Vehicle,
    *,
    settings: CornerSettings | None = None,
    allow_missing: bool = False,
) -> CornerFit:
    """Fit springs, dampers and tyres of every corner to a drive; where that is doubtful, from identified modes, too.

    Parameters
    ----------
    recordings
        Recordings of one condition, as for `sprung.likelihood.fit_corners`.
    vehicle
        Vehicle with its sensors.
    settings
        Choices of the fit; None: all from the vehicle.
    allow_missing
        Whether the recordings may lack sensors of the vehicle file; a note then says which.

    Returns
    -------
    CornerFit
        With the estimates by modes alone in `from_modes`, where the first fit is doubtful and there are modes.

    Raises
    ------
    DataError, ParameterError
        As from `sprung.likelihood.fit_corners`.
    """
    records = list(each_recording(recordings))
    windows = [window_of(record, vehicle, allow_missing=allow_missing) for record in records]
    notes = refuse_wrong_sensors(windows)

    def modes() -> Modes | None:
        from sprung.identification import IdentificationSettings, cov_ssi

        own = IdentificationSettings(has_road_modes=False, refine=False, allow_missing=allow_missing, kind="random")
        try:
            return cov_ssi(records, settings=own, vehicle=vehicle).modes
        except (DataError, IdentificationError):
            return None

    fit = fit_windows(windows, settings=settings, modes=modes)
    return replace(fit, notes=(*notes, *fit.notes))
