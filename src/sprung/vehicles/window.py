"""A stretch of driving, interpreted by its vehicle file: sensors, speed, structure, conditions."""

from collections.abc import Collection
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sprung.recording import Recording
from sprung.signals.delays import advanced_linearly
from sprung.vehicles.description import Vehicle
from sprung.vehicles.models import structure
from sprung.vehicles.sensor_layout import with_layout
from sprung.vehicles.structure import Structure
from sprung.vehicles.usable import output_channels, speed_channel, usable_motion

#: Speed below which a vehicle stands [m/s].
_STANDING = 1.0
#: Cosine of the angle to the vertical within which a gyroscope measures the yaw rate.
_UPRIGHT = 0.9


@dataclass(frozen=True, eq=False)
class Window:
    """A recording of a vehicle, its sensors placed as the vehicle file states.

    Sensor checks, speed check and fit of the corners all take one of these; see `window_of`.

    Parameters
    ----------
    recording
        Samples in SI units, channels with quantity, position and direction.
    vehicle
        Vehicle as its file describes it.
    structure
        Nominal structure of the vehicle, with all sensors of the file.
    speed
        Name of the channel with the speed [m/s]; None: not recorded, or left out.
    conditions
        Means of "speed" [m/s] and "temperature" [°C], "standing" (share of time), "turning" (RMS of the yaw rate
        [rad/s]), as far as channels measure them.
    """

    recording: Recording
    vehicle: Vehicle
    structure: Structure
    speed: str | None
    conditions: dict[str, float]

    @property
    def outputs(self) -> tuple[str, ...]:
        """Names of the channels of motion, in the order of the vehicle file."""
        return output_channels(self.recording, self.vehicle)

    @cached_property
    def motion(self) -> Recording:
        """Outputs (and speed) while the vehicle moves and no value is missing.

        Raises
        ------
        DataError
            If an output is dead, or nothing is left.
        """
        return usable_motion(self.recording, self.outputs, self.speed)

    def without(self, names: Collection[str]) -> "Window":
        """Return the window without the channels in `names`, and without conditions from the speed if it is one."""
        if not names:
            return self
        left = [name for name in self.recording.names if name not in names]
        window = replace(self, recording=self.recording.select(left))
        if self.speed not in names:
            return window
        conditions = {name: value for name, value in self.conditions.items() if name not in {"speed", "standing"}}
        return replace(window, speed=None, conditions=conditions)

    def exchanged(self, first: str, second: str) -> "Window":
        """Return the window with the positions of two sensors exchanged."""
        order = np.arange(len(self.recording.names))
        rows = [self.recording.index(first), self.recording.index(second)]
        order[rows] = rows[::-1]
        return replace(self, recording=replace(self.recording, samples=self.recording.samples[order]))

    def part(self, first: int, last: int) -> "Window":
        """Return the samples from `first` to before `last`; the conditions stay those of the whole window."""
        return replace(self, recording=self.recording.part(first, last))


def window_of(recording: Recording, vehicle: Vehicle) -> Window:
    """Return a recording as a window of its vehicle.

    Parameters
    ----------
    recording
        Recording as read.
    vehicle
        Vehicle with its sensors.

    Raises
    ------
    ParameterError
        If the recording has none of the vehicle file's sensors, or one with another quantity.
    """
    placed = with_speed_corrected(with_layout(recording, vehicle.sensor), vehicle)
    speed = speed_channel(placed, vehicle)
    return Window(placed, vehicle, structure(vehicle), speed, _conditions(placed, vehicle, speed))


def with_speed_corrected(recording: Recording, vehicle: Vehicle) -> Recording:
    """Return a recording with its speed channel scaled and advanced as the vehicle file states.

    Parameters
    ----------
    recording
        Recording in SI units.
    vehicle
        Vehicle with the scale and the delay of its speed channel.
    """
    speed = speed_channel(recording, vehicle)
    if speed is None or (vehicle.speed_scale == 1 and vehicle.speed_delay == 0):
        return recording
    samples, row = recording.samples.copy(), recording.index(speed)
    shift, breaks = vehicle.speed_delay * recording.sampling_rate, [gap.index for gap in recording.gaps]
    samples[row] = vehicle.speed_scale * advanced_linearly(samples[row], shift, breaks=breaks)
    step = f"speed times {vehicle.speed_scale:g}, advanced by {vehicle.speed_delay:g} s"
    return recording.changed(step, samples=samples)


def _conditions(placed: Recording, vehicle: Vehicle, speed: str | None) -> dict[str, float]:
    """Return the conditions that single channels measure."""
    conditions: dict[str, float] = {}
    if speed is not None:
        values = placed.samples[placed.index(speed)]
        conditions["speed"] = float(np.nanmean(values))
        conditions["standing"] = float(np.nanmean(values < _STANDING))
    for channel, values in zip(placed.channels, placed.samples, strict=True):
        if channel.quantity == "temperature":
            conditions["temperature"] = float(np.nanmean(values))
    for sensor in vehicle.sensor:
        is_upright = sensor.direction is not None and abs(sensor.direction[2]) > _UPRIGHT
        if is_upright and sensor.quantity == "angular_velocity" and sensor.channel in placed.names:
            values = placed.samples[placed.index(sensor.channel)]
            conditions["turning"] = float(np.sqrt(np.nanmean(values**2)))
    return conditions
