"""What a window of ten minutes says: conditions, corners, modes, sensor faults; or why it says nothing."""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sprung._arrays import Real
from sprung._checks import freeze
from sprung.diagnosis.sensors import SensorFault, check_sensors
from sprung.diagnosis.speed_check import speed_fault
from sprung.errors import DataError, ParameterError
from sprung.likelihood import CornerFit, CornerSettings, fit_corners, nominal_misfit
from sprung.recording import Recording
from sprung.vehicles import Component, Vehicle
from sprung.vehicles.labels import MOTIONS
from sprung.vehicles.sensor_layout import with_layout
from sprung.vehicles.usable import speed_channel

#: Length of a window [s], shortest one that is used, and fewest segments in it.
WINDOW, SHORTEST, FEWEST_SEGMENTS = 600.0, 120.0, 40
#: Vehicles slower than this [m/s] stand.
_STANDS = 1.0
#: Cosine of the angle within which a gyro turns about the vertical.
_UPRIGHT = 0.9
#: Misfit from which on a window cannot tell.
_WORST = 1.0
#: Misfit that makes an exchange of diagonal sensors worth a try, and to which share of it it must fall.
_SUSPECT, _CURED = 0.3, 0.8


@dataclass(frozen=True, eq=False, slots=True)
class Observation:
    """A window's estimates and the conditions they were made in.

    Parameters
    ----------
    time
        Of its begin, s since the first window.
    components
        The fitted springs, dampers and tyres.
    log_ratios
        ln(value / nominal value) of each component; empty where the window cannot tell.
    covariance
        Of these.
    conditions
        As far as known. Of every window: "speed" [m/s] and "temperature" [°C] (means), "standing" (share of time),
        "turning" (RMS of the yaw rate [rad/s]: near 0 on a straight). Of windows that can tell: "level" of the road
        [m^3], "payload" [kg], "model_error", "segments".
    modes
        Natural frequency [Hz] and damping ratio of bounce, pitch and roll where the fit has them.
    sensor_faults
        Found in the window.
    reason
        Why the window cannot tell; empty where it can.
    """

    time: float
    components: tuple[Component, ...]
    log_ratios: Real
    covariance: Real
    conditions: dict[str, float]
    modes: dict[str, tuple[float, float]]
    sensor_faults: tuple[SensorFault, ...]
    reason: str = ""

    def __post_init__(self) -> None:
        freeze(self, log_ratios=1, covariance=2)

    @property
    def is_conclusive(self) -> bool:
        """Whether the window says something about corners."""
        return not self.reason

    def to_dict(self) -> dict[str, Any]:
        """Return the observation as plain values for JSON."""
        return {
            "time": self.time,
            "components": list(map(str, self.components)),
            "log_ratios": self.log_ratios.tolist(),
            "covariance": self.covariance.tolist(),
            "conditions": self.conditions,
            "modes": {name: list(values) for name, values in self.modes.items()},
            "sensor_faults": [
                {"channel": fault.channel, "kind": fault.kind, "detail": fault.detail} for fault in self.sensor_faults
            ],
            "reason": self.reason,
        }


def observation_from_dict(document: dict[str, Any]) -> Observation:
    """Return the observation of plain values."""
    size = len(document["log_ratios"])
    return Observation(
        time=float(document["time"]),
        components=tuple(map(Component.parse, document["components"])),
        log_ratios=np.array(document["log_ratios"], dtype=np.float64),
        covariance=np.array(document["covariance"], dtype=np.float64).reshape(size, size),
        conditions=dict(document["conditions"]),
        modes={name: (values[0], values[1]) for name, values in document["modes"].items()},
        sensor_faults=tuple(SensorFault(**fault) for fault in document["sensor_faults"]),
        reason=document["reason"],
    )


def windows(recordings: Iterable[Recording], *, length: float = WINDOW) -> Iterator[tuple[float, Recording]]:
    """Yield windows of recordings and the time at which they begin [s since the first sample of all].

    Recordings without a time of their own follow each other. What is left over at the end joins the last window where
    it is shorter than half of one.
    """
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
    recording: Recording, vehicle: Vehicle, *, time: float = 0.0, settings: CornerSettings | None = None
) -> Observation:
    """Return what a window says.

    Parameters
    ----------
    recording
        As read.
    vehicle
        With its sensors.
    time
        Of the window's begin [s].
    settings
        Of the fit.

    Notes
    -----
    Channels that fail are left out and the fit goes on with the rest, without a wrong speed by the delay between the
    axles; a window that cannot tell says why. One whose sensors contradict each other cannot.
    """
    checked = check_sensors(recording, vehicle)
    faults, conditions = checked.faults, _conditions(recording, vehicle)
    bad = {fault.channel for fault in faults}
    wrong_speed = speed_fault(
        recording.select([n for n in recording.names if n not in bad]), vehicle, settings=settings
    )
    if wrong_speed is not None:
        faults, bad = (*faults, wrong_speed), {*bad, wrong_speed.channel}
        conditions = {name: value for name, value in conditions.items() if name not in {"speed", "standing"}}
    # With one layout only for the rest of a vehicle's life, exchanged channels leave nothing to go on with.
    names = [name for name in recording.names if name not in bad]
    try:
        fit = fit_corners(recording.select(names), vehicle, settings=settings)
    except (DataError, ParameterError) as error:
        return _nothing(time, conditions, faults, str(error))
    if checked.disagreement:
        apart = f"sensors disagree by {100 * checked.disagreement:.0f} % and no single one explains it"
        return _nothing(time, conditions, faults, f"{apart}: check signs, gains, places and delays")
    if not faults and fit.model_error > _SUSPECT:
        faults = _exchanged(recording, vehicle, settings, fit)
        if faults:
            return _nothing(time, conditions, faults, "sensors are exchanged")
    if fit.n_segments < FEWEST_SEGMENTS:
        return _nothing(time, conditions, faults, f"{fit.n_segments} segments of steady speed are too few")
    if fit.model_error > _WORST:
        off = f"off by {100 * fit.model_error:.0f} %"
        return _nothing(time, conditions, faults, f"the vehicle file explains the window badly: {off}")
    return _told(time, fit, conditions, faults)


def _conditions(recording: Recording, vehicle: Vehicle) -> dict[str, float]:
    """Return the conditions that channels tell by themselves."""
    found = {}
    name = speed_channel(recording, vehicle)
    if name is not None:
        speed = recording.samples[recording.index(name)]
        found["speed"] = float(np.nanmean(speed))
        found["standing"] = float(np.nanmean(speed < _STANDS))
    for channel, values in zip(recording.channels, recording.samples, strict=True):
        if channel.quantity == "temperature":
            found["temperature"] = float(np.nanmean(values))
    for sensor in vehicle.sensor:
        upright = sensor.direction is not None and abs(sensor.direction[2]) > _UPRIGHT
        if upright and sensor.quantity == "angular_velocity" and sensor.channel in recording.names:
            placed = with_layout(recording, vehicle.sensor)
            found["turning"] = float(np.sqrt(np.nanmean(placed.samples[placed.index(sensor.channel)] ** 2)))
    return found


def _told(time: float, fit: CornerFit, conditions: dict[str, float], faults: tuple[SensorFault, ...]) -> Observation:
    """Return the observation that a fit makes."""
    count = len(fit.components)
    conditions = {**conditions, "model_error": fit.model_error, "segments": float(fit.n_segments)}
    if "roughness" in fit.inputs:
        conditions["level"] = fit.inputs["roughness"]
    if "payload_mass" in fit.payload:
        conditions["payload"] = fit.payload["payload_mass"]["value"]
    modes = fit.modes()
    found = {
        label: (float(modes.natural_frequency[k]), float(modes.damping_ratio[k]))
        for k, label in enumerate(modes.labels)
        if label in MOTIONS
    }
    return Observation(
        time=time,
        components=fit.components,
        log_ratios=fit.log_ratios,
        covariance=fit.covariance[:count, :count],
        conditions=conditions,
        modes=found,
        sensor_faults=faults,
    )


def _nothing(time: float, conditions: dict[str, float], faults: tuple[SensorFault, ...], reason: str) -> Observation:
    """Return an observation that cannot tell."""
    return Observation(time, (), np.zeros(0), np.zeros((0, 0)), conditions, {}, faults, reason)


def _exchanged(
    recording: Recording, vehicle: Vehicle, settings: CornerSettings | None, fit: CornerFit
) -> tuple[SensorFault, ...]:
    """Find sensors at opposite corners that are exchanged: bounce is as it was, pitch and roll are turned about.

    Only an exchange that makes the vehicle as its file says more likely is worth a fit.
    """
    places = {s.channel: s.position for s in vehicle.sensor if s.quantity == "acceleration" and s.position is not None}
    names = [name for name in places if name in recording.names]
    best: tuple[float, tuple[str, str]] | None = None
    as_read = nominal_misfit(recording, vehicle, settings=settings)
    for row, first in enumerate(names):
        for second in names[row + 1 :]:
            apart = np.array(places[first])[:2] * np.array(places[second])[:2]
            if not np.all(apart < 0):
                continue
            order = list(range(len(recording.names)))
            one, other = recording.index(first), recording.index(second)
            order[one], order[other] = other, one
            exchanged = replace(recording, samples=recording.samples[order])
            if nominal_misfit(exchanged, vehicle, settings=settings) >= as_read:
                continue
            turned = fit_corners(exchanged, vehicle, settings=settings)
            if best is None or turned.model_error < best[0]:
                best = turned.model_error, (first, second)
    if best is None or best[0] > _CURED * fit.model_error:
        return ()
    words = f"{best[1][0]} with {best[1][1]}, or the other two corners with each other"
    return tuple(SensorFault(name, "swapped", words) for name in names)
