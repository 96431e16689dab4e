"""Sensors of a vehicle file placed on a recording, those that it lacks, and the part of it that fits may use."""

import re
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sprung._checks import nearest_name
from sprung._display import counted
from sprung.channel_names import rule_of
from sprung.errors import DataError, ParameterError
from sprung.recording import PLACES, Channel, Recording
from sprung.signals.conditioning import advanced, while_moving, without_missing
from sprung.signals.data_faults import CONDITIONS, ROUNDING, constant_value, moving_samples
from sprung.vehicles.description import Chain, Description, Quarter, Vehicle
from sprung.vehicles.sections import Sensor


def with_layout(recording: Recording, sensors: Sequence[Sensor], *, allow_missing: bool = False) -> Recording:
    """Give the channels the quantity, position and direction that a vehicle file states, in SI units and without delay.

    Parameters
    ----------
    recording
        Recording with channels named as in the vehicle file; others stay as they are.
    sensors
        Sensors of the file.
    allow_missing
        Whether the recording may lack sensors of motion.

    Returns
    -------
    Recording
        Recording in SI units. A channel of unknown unit is multiplied by the sensor's factor; one of known unit is in
        SI already, so that only the sensor's `scale` is applied. A late channel is advanced by its `delay`, and values
        are missing where it was not recorded yet.

    Raises
    ------
    ParameterError
        As raised by `check_present`; also if a channel has another quantity than its sensor.
    """
    stated = {sensor.channel: sensor for sensor in sensors}
    placed = _placed_channels(recording, stated, allow_missing=allow_missing)
    samples = recording.samples * np.array([factor for _, factor in placed])[:, None]
    breaks = [gap.index for gap in recording.gaps]
    for row, channel in enumerate(recording.channels):
        delay = stated[channel.name].delay if channel.name in stated else 0.0
        if delay != 0:
            samples[row] = advanced(samples[row], delay * recording.sampling_rate, breaks=breaks)
    n_placed = len(stated.keys() & set(recording.names))
    return recording.changed(
        f"sensor layout of {counted(n_placed, 'channel')}",
        samples=samples,
        channels=tuple(channel for channel, _ in placed),
    )


def quantities_of(recording: Recording, sensors: Sequence[Sensor], *, allow_missing: bool = False) -> dict[str, str]:
    """Return the quantity of each channel: its own, or if that is unknown the one of the vehicle file.

    Parameters
    ----------
    recording, sensors, allow_missing
        As for `with_layout`.

    Raises
    ------
    ParameterError
        As raised by `with_layout`.
    """
    _placed_channels(recording, {sensor.channel: sensor for sensor in sensors}, allow_missing=allow_missing)
    stated = {sensor.channel: sensor.as_channel().quantity for sensor in sensors}
    return {
        channel.name: channel.quantity if channel.quantity != "unknown" else stated.get(channel.name, "unknown")
        for channel in recording.channels
    }


def check_present(
    names: Sequence[str], sensors: Sequence[Sensor], *, allow_missing: bool = False, is_choice: bool = False
) -> None:
    """Reject a recording that lacks sensors of the vehicle file.

    Parameters
    ----------
    names
        Names of the channels of the recording.
    sensors
        Sensors of the vehicle file.
    allow_missing
        Whether the recording may lack sensors of motion, but not all of them.
    is_choice
        Whether the channels were chosen by name: then a sensor is missing only if one of them looks like it.

    Raises
    ------
    ParameterError
        If the recording has none of the sensors, or lacks sensors of motion and `allow_missing` is False.
    """
    if sensors and not {sensor.channel for sensor in sensors} & set(names):
        stated = _with_nearest([sensor.channel for sensor in sensors], names)
        raise ParameterError(
            f"none of the vehicle file's sensors {stated} is among the channels {', '.join(names)}: rename the"
            " channels, or state under [[sensor]] in the vehicle file what they measure and where they are"
        )
    others = _left_over(names, sensors)
    # Speed, temperature and pressure may be absent: results state which are.
    missing = [sensor.channel for sensor in sensors if not sensor.is_condition and sensor.channel not in names]
    if is_choice:
        missing = [name for name in missing if nearest_name(name, others)]
    if missing and not allow_missing:
        unused = f" (channels that no sensor names: {', '.join(others)})" if others else ""
        raise ParameterError(
            f"the recording lacks {len(missing)} of the vehicle file's {len(sensors)} sensors:"
            f" {_with_nearest(missing, others)}{unused}: make the names agree, or continue without them with"
            " --allow-missing (in Python allow_missing=True)"
        )


def layout_notes(recording: Recording, vehicle: Description) -> tuple[str, ...]:
    """Return notes on the sensors that a recording lacks, and on its channels that the vehicle file does not name.

    Parameters
    ----------
    recording
        Recording as read.
    vehicle
        Vehicle with its sensors; without any, every channel of motion is used and there is no note.
    """
    if not vehicle.sensor:
        return ()
    others = _left_over(recording.names, vehicle.sensor)
    conditions = {channel.name for channel in recording.channels if _is_known_condition(channel)}
    speed = vehicle.speed_channel.casefold()
    known = conditions | {name for name in others if any(name.casefold() in alike for alike in PLACES)}
    left_over = [name for name in others if name not in known and name.casefold() != speed]
    absent = [sensor.channel for sensor in vehicle.sensor if sensor.channel not in recording.names]
    notes = []
    if absent:
        notes.append(f"missing sensors, which the vehicle file names: {_with_nearest(absent, left_over)}")
    if left_over:
        notes.append(f"left-over channels, which the vehicle file does not name: {', '.join(left_over)}")
    return tuple(notes)


def _is_known_condition(channel: Channel) -> bool:
    """Return whether a channel is a condition without a sensor in the file: any temperature, and others by name."""
    return channel.quantity == "temperature" or (channel.quantity in CONDITIONS and rule_of(channel.name) is not None)


def _left_over(names: Sequence[str], sensors: Sequence[Sensor]) -> list[str]:
    """Return the names that no sensor has."""
    stated = {sensor.channel for sensor in sensors}
    return [name for name in names if name not in stated]


def _with_nearest(missing: Sequence[str], others: Sequence[str]) -> str:
    """Return missing names, each with the one that may have been meant; no two with the same."""
    nearest: dict[str, str | None] = {}
    free = list(others)
    for name in missing:
        near = nearest_name(name, free)
        nearest[name] = near
        free = [other for other in free if other != near]
    return ", ".join(f"{name} (did you mean {near!r}?)" if near else name for name, near in nearest.items())


def _placed_channels(
    recording: Recording, stated: Mapping[str, Sensor], *, allow_missing: bool
) -> list[tuple[Channel, float]]:
    """Return each channel as its sensor states it, and the factor of its samples."""
    check_present(recording.names, tuple(stated.values()), allow_missing=allow_missing)
    return [_placed(channel, stated.get(channel.name)) for channel in recording.channels]


def _placed(channel: Channel, sensor: Sensor | None) -> tuple[Channel, float]:
    """Return the channel as the sensor states it, and the factor of its samples."""
    if sensor is None:
        return channel, 1.0
    if channel.quantity == "unknown":
        return sensor.as_channel(), sensor.factor
    placed = replace(sensor.as_channel(), name=channel.name)
    if placed.unit != channel.unit:
        raise ParameterError(
            f"channel {channel.name!r} is {channel.quantity} [{channel.unit}] in the recording, but {sensor.quantity}"
            f" [{sensor.unit}] in the vehicle file: correct one of them"
        )
    return placed, sensor.scale


#: Speed below which a vehicle's motion carries no information on its modes [m/s].
_SLOWEST = 3.0
#: Share of a record in which the vehicle moves, above which it is a drive.
_DRIVING = 0.2
#: Change of latitude or longitude of a drive [deg], about 100 m.
_TRAVELLED = 1e-3
_LATITUDE_LONGITUDE = re.compile(r"(?:^|[^a-z])(?:lat|lon|lng)(?:itude|gitude)?(?![a-z])", re.IGNORECASE)
#: Words in names of channels that state where a vehicle is or how well that is known ...
_STATES = re.compile(
    "latitude|lat|longitude|lon|lng|altitude|alt|elevation|heading|course|azimuth|bearing|yaw|pitch|roll|euler|[hvptg]?dop"
    "|quaternion|accuracy|satellites|sats|fix|flags?|valid|status|odometer|distance"
)
#: ... unless one of these says that they are motion.
_MOTIONS = re.compile("rate|acc|accel|acceleration|gyro|velocity|angular")
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

    Notes
    -----
    Of several channels those that are no motion take no part (`channels_without_motion`).
    """
    if vehicle is not None and vehicle.sensor:
        stated = [sensor.channel for sensor in vehicle.sensor if not sensor.is_condition]
        return tuple(name for name in stated if name in recording.names)
    speed = speed_channel(recording, vehicle)
    motion = [c for c in recording.channels if c.quantity not in CONDITIONS and c.name != speed]
    left_out = channels_without_motion(recording)
    return tuple(c.name for c in motion if c.name not in left_out) or tuple(c.name for c in motion)


def channels_without_motion(recording: Recording) -> tuple[str, ...]:
    """Return the names of Euler angles, positions, dilution of precision and flags, and of unknown constants."""
    return tuple(
        channel.name
        for channel, values in zip(recording.channels, recording.samples, strict=True)
        if channel.quantity in ("unknown", "angle", "displacement")
        and (
            _is_named_as_state(channel.name)
            or (channel.quantity == "unknown" and constant_value(values, tolerance=ROUNDING) is not None)
        )
    )


def _is_named_as_state(name: str) -> bool:
    words = re.findall("[a-z]+", re.sub("(?<=[a-z])(?=[A-Z])", " ", name).casefold())
    return any(map(_STATES.fullmatch, words)) and not any(map(_MOTIONS.fullmatch, words))


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
