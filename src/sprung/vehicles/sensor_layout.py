"""The sensors of a vehicle file placed on a recording; those that it lacks, and channels that the file lacks."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sprung._checks import nearest_name
from sprung.channel_names import rule_of
from sprung.errors import ParameterError
from sprung.recording import Channel, Recording
from sprung.signals.data_faults import CONDITIONS
from sprung.signals.delays import advanced
from sprung.vehicles.description import Description
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
        f"sensor layout of {n_placed} channels", samples=samples, channels=tuple(channel for channel, _ in placed)
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
            f"none of the vehicle file's sensors {stated} is among the channels {', '.join(names)}: make the names"
            " agree"
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
    left_over = [name for name in others if name not in conditions and name.casefold() != speed]
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
