"""The sensors of a vehicle file placed on a recording."""

from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from sprung.errors import ParameterError
from sprung.recording import Channel, Recording
from sprung.signals.delays import advanced
from sprung.vehicles import Sensor


def with_layout(recording: Recording, sensors: Sequence[Sensor]) -> Recording:
    """Give the channels the quantity, position and direction that a vehicle file states, in SI units and without delay.

    Parameters
    ----------
    recording
        Recording with channels named as in the vehicle file; others stay as they are.
    sensors
        Sensors of the file.

    Returns
    -------
    Recording
        Recording in SI units. A channel of unknown unit is multiplied by the sensor's factor; one of known unit is in
        SI already, so that only the sensor's `scale` is applied. A late channel is advanced by its `delay`, and values
        are missing where it was not recorded yet.

    Raises
    ------
    ParameterError
        If the recording has none of the sensors, or one with another quantity.
    """
    stated = {sensor.channel: sensor for sensor in sensors}
    placed = _placed_channels(recording, stated)
    samples = recording.samples * np.array([factor for _, factor in placed])[:, None]
    breaks = [gap.index for gap in recording.gaps]
    for row, channel in enumerate(recording.channels):
        delay = stated[channel.name].delay if channel.name in stated else 0.0
        if delay != 0:
            samples[row] = advanced(samples[row], delay * recording.sampling_rate, breaks=breaks)
    return recording.changed(
        f"sensor layout of {len(stated)} channels", samples=samples, channels=tuple(channel for channel, _ in placed)
    )


def quantities_of(recording: Recording, sensors: Sequence[Sensor]) -> dict[str, str]:
    """Return the quantity of each channel: its own, or if that is unknown the one of the vehicle file.

    Parameters
    ----------
    recording, sensors
        As for `with_layout`.

    Raises
    ------
    ParameterError
        As raised by `with_layout`.
    """
    _placed_channels(recording, {sensor.channel: sensor for sensor in sensors})
    stated = {sensor.channel: sensor.as_channel().quantity for sensor in sensors}
    return {
        channel.name: channel.quantity if channel.quantity != "unknown" else stated.get(channel.name, "unknown")
        for channel in recording.channels
    }


def _placed_channels(recording: Recording, stated: Mapping[str, Sensor]) -> list[tuple[Channel, float]]:
    """Return each channel as its sensor states it, and the factor of its samples."""
    if stated and not stated.keys() & set(recording.names):
        raise ParameterError(
            f"none of the vehicle file's sensors {', '.join(stated)} is among the channels"
            f" {', '.join(recording.names)}: make the names agree"
        )
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
