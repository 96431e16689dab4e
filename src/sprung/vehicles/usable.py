"""The part of a recording that identification and fits may use."""

from collections.abc import Sequence

import numpy as np

from sprung.errors import DataError
from sprung.recording import Recording
from sprung.signals.conditioning import while_moving, without_missing
from sprung.vehicles.description import Chain, Quarter, Vehicle
from sprung.vehicles.sensor_layout import with_layout

#: Quantities that are conditions of the motion, not outputs.
_CONDITIONS = ("speed", "temperature")
_SLOWEST = 3.0

AnyVehicle = Vehicle | Quarter | Chain


def usable(recording: Recording, *, vehicle: AnyVehicle | None = None) -> Recording:
    """Return the outputs (and the speed) of a recording, in SI units, where the vehicle moves and nothing is missing.

    Parameters
    ----------
    recording
        As read.
    vehicle
        Its sensors, where it has any, are the outputs; otherwise every channel that is no condition.

    Raises
    ------
    DataError
        If an output is dead, or nothing is left.
    """
    speed = speed_channel(recording, vehicle)
    if vehicle is not None and vehicle.sensor:
        recording = with_layout(recording, vehicle.sensor)
        wanted = [sensor.channel for sensor in vehicle.sensor if sensor.quantity not in _CONDITIONS]
        outputs = [name for name in wanted if name in recording.names]
    else:
        outputs = [c.name for c in recording.channels if c.quantity not in _CONDITIONS and c.name != speed]
    recording = recording.select([*outputs, speed] if speed and speed not in outputs else outputs)
    _check_alive(recording, outputs)
    recording = without_missing(recording)
    return while_moving(recording, speed, minimum_speed=_SLOWEST) if speed else recording


def speed_channel(recording: Recording, vehicle: AnyVehicle | None = None) -> str | None:
    """Return the name of the channel with the vehicle's speed, in any case of letters; None where there is none."""
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
    dead = []
    for name in outputs:
        samples = recording.samples[recording.index(name)]
        finite = samples[np.isfinite(samples)]
        if finite.size < 2:
            dead.append((name, "has no values"))
        elif np.ptp(finite) <= 1e-12 * np.abs(finite).max():
            dead.append((name, f"is constant at {finite[0]:g}"))
    if dead:
        left = [name for name in outputs if name not in dict(dead)]
        advice = f"leave it out with --channels {','.join(left)}" if left else "check the sensors and their wiring"
        raise DataError(f"channel {dead[0][0]!r} {dead[0][1]}: {advice}")
