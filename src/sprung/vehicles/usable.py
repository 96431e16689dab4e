"""The part of a recording that identification and fits may use."""

import re
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sprung.channel_names import rule_of
from sprung.errors import DataError
from sprung.recording import Channel, Recording
from sprung.signals.conditioning import while_moving, without_missing
from sprung.signals.data_faults import CONDITIONS, ROUNDING, constant_value, moving_samples
from sprung.vehicles.description import Chain, Quarter, Vehicle
from sprung.vehicles.sensor_layout import layout_notes, with_layout

#: Speed below which a vehicle's motion carries no information on its modes [m/s].
_SLOWEST = 3.0
#: Share of a record in which the vehicle moves, above which it is a drive.
_DRIVING = 0.2
#: Change of latitude or longitude of a drive [deg], about 100 m.
_TRAVELLED = 1e-3
_LATITUDE_LONGITUDE = re.compile(r"(?:^|[^a-z])(?:lat|lon|lng)(?:itude|gitude)?(?![a-z])", re.IGNORECASE)
#: Usual name of the channel with the speed.
_SPEED = "speed"

AnyVehicle = Vehicle | Quarter | Chain


def is_drive(recording: Recording) -> bool:
    """Return whether a recording is one of a vehicle that drives, by its speed, speeds of wheels, or its place.

    Parameters
    ----------
    recording
        Recording as read: speeds in m/s, latitude and longitude in degrees, or in rad as channels of angle.
    """
    moves = np.count_nonzero(moving_samples(recording)) > _DRIVING * recording.n_samples
    spans = (
        (np.nanmax(values, initial=-np.inf) - np.nanmin(values, initial=np.inf))
        / (np.pi / 180 if channel.quantity == "angle" else 1.0)
        for values, channel in zip(recording.samples, recording.channels, strict=True)
        if _LATITUDE_LONGITUDE.search(channel.name)
    )
    return bool(moves or any(span > _TRAVELLED for span in spans))


def usable(recording: Recording, *, vehicle: AnyVehicle | None = None, allow_missing: bool = False) -> Recording:
    """Return the outputs (and the speed) of a recording in SI units, while the vehicle moves and no value is missing.

    Parameters
    ----------
    recording
        Recording as read.
    vehicle
        Vehicle whose sensors, if its file states any, are the outputs; otherwise every channel of motion is one.
    allow_missing
        Whether the recording may lack sensors of the vehicle file; the history then says which.

    Raises
    ------
    DataError
        If an output is dead, or nothing is left.
    ParameterError
        If the recording lacks a sensor of the vehicle file, or has one with another quantity.
    """
    speed = speed_channel(recording, vehicle)
    if vehicle is not None and vehicle.sensor:
        notes = layout_notes(recording, vehicle)
        recording = with_layout(recording, vehicle.sensor, allow_missing=allow_missing)
        recording = replace(recording, history=(*recording.history, *notes))
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
    """Return the name of the channel with the vehicle's speed; None if there is none.

    Parameters
    ----------
    recording
        Recording.
    vehicle
        Vehicle with the name of its speed channel; None: "speed".

    Notes
    -----
    Case does not count. If there is no channel "speed", and the vehicle file names no other, it is the only channel
    whose name means the vehicle's speed (`channel_names`: "Vehicle.Speed") and whose unit is known.
    """
    name = _SPEED if vehicle is None else vehicle.speed_channel
    if name in recording.names:
        return name
    alike = [other for other in recording.names if other.casefold() == name.casefold()]
    if not alike and name == _SPEED:
        alike = [channel.name for channel in recording.channels if channel.quantity == "speed" and _is_speed(channel)]
    return alike[0] if len(alike) == 1 else None


def _is_speed(channel: Channel) -> bool:
    """Return whether the name of a channel means the speed of the vehicle, not of a wheel."""
    rule = rule_of(channel.name)
    return rule is not None and rule.quantity == "speed" and rule.corner is None


def _check_alive(recording: Recording, outputs: Sequence[str]) -> None:
    """Reject dead outputs."""
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
