"""The part of a recording that identification and fits may use."""

from collections.abc import Sequence

import numpy as np

from sprung.errors import DataError
from sprung.recording import Recording
from sprung.signals.conditioning import while_moving, without_missing
from sprung.signals.data_faults import CONDITIONS, ROUNDING, constant_value
from sprung.vehicles.description import Chain, Quarter, Vehicle
from sprung.vehicles.sensor_layout import with_layout

#: Speed below which a vehicle's motion carries no information on its modes [m/s].
_SLOWEST = 3.0

AnyVehicle = Vehicle | Quarter | Chain


def usable(recording: Recording, *, vehicle: AnyVehicle | None = None) -> Recording:
    """Return the outputs (and the speed) of a recording in SI units, while the vehicle moves and no value is missing.

    Parameters
    ----------
    recording
        Recording as read.
    vehicle
        Vehicle whose sensors, if its file states any, are the outputs; otherwise every channel of motion is one.

    Raises
    ------
    DataError
        If an output is dead, or nothing is left.
    ParameterError
        If the recording has none of the vehicle file's sensors, or one with another quantity.
    """
    speed = speed_channel(recording, vehicle)
    if vehicle is not None and vehicle.sensor:
        recording = with_layout(recording, vehicle.sensor)
    return usable_motion(recording, output_channels(recording, vehicle), speed)


def output_channels(recording: Recording, vehicle: AnyVehicle | None = None) -> tuple[str, ...]:
    """Return the names of the channels of motion: the vehicle file's sensors, or all such channels if it has none.

    Parameters
    ----------
    recording
        Recording with the vehicle file's sensors placed on it.
    vehicle
        Vehicle with its sensors; None: unknown.
    """
    if vehicle is not None and vehicle.sensor:
        stated = [sensor.channel for sensor in vehicle.sensor if not sensor.is_condition]
        return tuple(name for name in stated if name in recording.names)
    speed = speed_channel(recording, vehicle)
    return tuple(c.name for c in recording.channels if c.quantity not in CONDITIONS and c.name != speed)


def usable_motion(recording: Recording, outputs: Sequence[str], speed: str | None) -> Recording:
    """Return the outputs (and the speed) while the vehicle moves and no value is missing; the rest becomes gaps.

    Parameters
    ----------
    recording
        Recording in SI units.
    outputs
        Names of the channels of motion.
    speed
        Name of the channel with the speed [m/s]; None: unknown, all of the recording counts.

    Raises
    ------
    DataError
        If an output is dead, or nothing is left.
    """
    recording = recording.select([*outputs, speed] if speed and speed not in outputs else list(outputs))
    _check_alive(recording, outputs)
    recording = without_missing(recording)
    return while_moving(recording, speed, minimum_speed=_SLOWEST) if speed else recording


def speed_channel(recording: Recording, vehicle: AnyVehicle | None = None) -> str | None:
    """Return the name of the channel with the vehicle's speed, ignoring case; None if there is none."""
    name = "speed" if vehicle is None else vehicle.speed_channel
    if name in recording.names:
        return name
    alike = [other for other in recording.names if other.casefold() == name.casefold()]
    return alike[0] if len(alike) == 1 else None


def _check_alive(recording: Recording, outputs: Sequence[str]) -> None:
    """Refuse dead outputs."""
    if not outputs:
        raise DataError("the recording has no channel of motion: give accelerations or angular velocities")
    if recording.n_samples < 2:
        raise DataError(f"the recording has {recording.n_samples} sample(s): record at least a minute")
    dead: dict[str, str] = {}
    for name in outputs:
        samples = recording.samples[recording.index(name)]
        value = constant_value(samples, tolerance=ROUNDING)
        if np.count_nonzero(np.isfinite(samples)) < 2:
            dead[name] = "has no values"
        elif value is not None:
            dead[name] = f"is constant at {value:g}"
    if dead:
        name, why = next(iter(dead.items()))
        alive = [other for other in outputs if other not in dead]
        advice = f"leave it out with --channels {','.join(alive)}" if alive else "check the sensors and their wiring"
        raise DataError(f"channel {name!r} {why}: {advice}")
