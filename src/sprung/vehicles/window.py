"""A stretch of driving, interpreted by its vehicle file: sensors, speed, structure, conditions."""

from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from sprung._arrays import Real
from sprung._display import counted
from sprung.channel_names import corner_of, rule_of
from sprung.errors import ParameterError
from sprung.recording import Channel, Recording, naming
from sprung.signals.conditioning import FILLING, advanced_linearly, with_short_gaps_filled
from sprung.signals.data_faults import DEAD_SHARE, missing_share
from sprung.vehicles.description import Vehicle
from sprung.vehicles.labels import plausibility_notes
from sprung.vehicles.models import structure
from sprung.vehicles.sensor_layout import layout_notes, output_channels, speed_channel, usable_motion, with_layout
from sprung.vehicles.structure import Structure
from sprung.vehicles.system import Outputs

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
    outputs
        Names of the channels of motion, in the order of the vehicle file.
    speed
        Name of the channel with the speed [m/s]; None: not recorded, or left out.
    conditions
        Means of "speed" [m/s], "temperature" [°C] (of the dampers where these are measured, otherwise ambient),
        "tyre_temperature" [°C] and "tyre_pressure" [Pa], "standing" (share of time), "turning" (RMS of the yaw rate
        [rad/s]), as far as channels measure them.
    missing
        Sensors of motion that the recording lacks.
    notes
        Unusual motion of the vehicle file, sensors that the recording lacks, and channels that the file does not name,
        in words.
    """

    recording: Recording
    vehicle: Vehicle
    structure: Structure
    outputs: tuple[str, ...]
    speed: str | None
    conditions: dict[str, float]
    missing: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()

    @cached_property
    def filled(self) -> Recording:
        """The recording with short gaps of single outputs filled, and longer ones by what others imply."""
        filled = with_short_gaps_filled(self.recording, self.outputs)
        return with_implied_values(filled, self.structure.outputs)

    @cached_property
    def motion(self) -> Recording:
        """Outputs (and speed) while the vehicle moves and no value is missing after gaps of single outputs are filled.

        Raises
        ------
        DataError
            If an output is dead, or nothing is left.
        """
        return self.motion_of(self.outputs)

    def motion_of(self, names: Sequence[str]) -> Recording:
        """Return some outputs (and the speed) as `motion` does, whatever the others lack."""
        with naming(self.recording):
            return usable_motion(self.filled, names, self.speed)

    def without(self, names: Collection[str]) -> "Window":
        """Return the window without the channels in `names`, and without conditions from the speed if it is one."""
        if not names:
            return self
        left = self.recording.select([name for name in self.recording.names if name not in names])
        outputs = tuple(name for name in self.outputs if name not in names)
        window = replace(self, recording=left, outputs=outputs)
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


def window_of(recording: Recording, vehicle: Vehicle, *, allow_missing: bool = False) -> Window:
    """Return a recording as a window of its vehicle.

    Parameters
    ----------
    recording
        Recording as read.
    vehicle
        Vehicle with its sensors.
    allow_missing
        Whether the recording may lack sensors of motion, which is then noted.

    Raises
    ------
    ParameterError
        If the recording lacks a sensor of the vehicle file, or has one with another quantity.
    """
    with naming(recording):
        placed = with_layout(recording, vehicle.sensor, allow_missing=allow_missing)
        speed = speed_channel(placed, vehicle)
        outputs = output_channels(placed, vehicle)
        if speed is None:
            placed, speed = _with_speed_of_wheels(placed, vehicle)
        unit_notes = () if speed is None else _check_speed(placed, placed.index(speed))
        if speed is not None and vehicle.kind == "road":
            unit_notes += _check_accelerations(recording, placed, speed)
    if speed is not None and (vehicle.speed_scale != 1 or vehicle.speed_delay != 0):
        placed = _with_speed_corrected(placed, vehicle, placed.index(speed))
    notes = (*plausibility_notes(vehicle), *layout_notes(recording, vehicle), *unit_notes)
    motion = [sensor.channel for sensor in vehicle.sensor if not sensor.is_condition]
    return Window(
        recording=replace(placed, history=(*placed.history, *notes)),
        vehicle=vehicle,
        structure=structure(vehicle, speed=None if speed is None else _mean_speed(placed.samples[placed.index(speed)])),
        outputs=outputs,
        speed=speed,
        conditions=_conditions(placed, vehicle, speed),
        missing=tuple(name for name in motion if name not in outputs),
        notes=notes,
    )


def with_implied_values(recording: Recording, outputs: Outputs) -> Recording:
    """Return a recording with values where channels miss them and others on rigid bodies imply them.

    Parameters
    ----------
    recording
        Recording in SI units.
    outputs
        Output matrices of a structure; channels that it lacks stay as they are, and so do those of which more than half
        is missing, and accelerometers that are not upright.

    Notes
    -----
    Readings of one kind are y = T q'' with q the motions of the bodies, more sensors than motions a redundancy: a
    missing reading is w^T y of the others, T_missing = w^T T, of least norm, plus its mean distance from that. Four
    accelerometers on a rigid body imply each other one by one. What they miss of a channel where it is known (noise,
    torsion), times the share that is missing, may be 1 % of its power, as of short gaps (`with_short_gaps_filled`).

    References
    ----------
    E. Y. Chow, A. S. Willsky, Analytical redundancy and the design of robust failure detection systems, IEEE
    Transactions on Automatic Control 29 (1984) 603-614 (parity relations).
    """
    samples = recording.samples.copy()
    n_known = int(np.count_nonzero(np.isfinite(samples)))
    if n_known == samples.size:
        return recording
    for matrix in (outputs.displacement, outputs.velocity, outputs.acceleration):
        readings = {
            channel.name: reading
            for channel, reading in zip(outputs.channels, matrix, strict=True)
            if reading.any() and (channel.quantity != "acceleration" or is_upright(channel))
        }
        usable = [row for row, values in enumerate(samples) if missing_share(values) <= DEAD_SHARE]
        rows = [row for row in usable if recording.names[row] in readings]
        if rows:
            samples[rows] = _implied(samples[rows], np.array([readings[recording.names[row]] for row in rows]))
    n_filled = int(np.count_nonzero(np.isfinite(samples))) - n_known
    return recording.changed(f"{counted(n_filled, 'value')} of channels implied by others", samples=samples)


def _implied(samples: Real, readings: Real) -> Real:
    """Return samples whose missing ones are those that `readings` for unit motions imply, shape (channels, motions)."""
    is_known = np.isfinite(samples)
    samples = np.where(is_known, samples, np.nan)
    filled = samples.copy()
    for known in np.unique(is_known[:, ~is_known.all(axis=0)], axis=1).T:
        weights = readings @ np.linalg.pinv(readings * known[:, None])
        is_implied = np.isclose(weights @ readings, readings).all(axis=1)
        at = (is_known == known[:, None]).all(axis=0)
        for row in np.flatnonzero(~known & is_implied):
            by_others = weights[row, known] @ samples[known]
            away = (samples[row] - by_others)[is_known[row] & is_known[known].all(axis=0)]
            error = np.var(away) * missing_share(samples[row]) if away.size else np.inf
            if error <= FILLING.share * np.var(samples[row, is_known[row]]):
                filled[row, at] = by_others[at] + away.mean()
    return filled


def is_upright(channel: Channel) -> bool:
    """Return whether a sensor measures upwards more than sideways, where the wheels and gravity move it, too."""
    return channel.direction is None or abs(channel.direction[2]) >= max(map(abs, channel.direction))


def _check_speed(recording: Recording, row: int, *, fast: float = 35.0) -> tuple[str, ...]:
    """Refuse a channel of another quantity as the speed, and note one without unit that is too fast for m/s."""
    channel, mean = recording.channels[row], _mean_speed(recording.samples[row]) or 0.0
    if channel.quantity not in {"speed", "velocity", "unknown"}:
        raise ParameterError(
            f"channel {channel.name!r} is {channel.quantity} in the recording, not a speed: correct its unit, or state "
            "the channel of the speed as speed_channel in the vehicle file"
        )
    if channel.quantity != "unknown" or mean < fast:
        return ()
    return (
        f"channel {channel.name!r} states no unit and is taken in m/s, {3.6 * mean:.0f} km/h on average: if it is in "
        "km/h, state that in the recording",
    )


def _check_accelerations(
    recording: Recording, placed: Recording, speed: str, *, calm: float = 0.1, wild: float = 20.0
) -> tuple[str, ...]:
    """Note accelerations without unit that are hardly in m/s^2: too small or large for a car, or 1 by gravity."""
    unstated = {channel.name for channel in recording.channels if channel.quantity == "unknown"}
    rows = [k for k, each in enumerate(placed.channels) if each.quantity == "acceleration" and each.name in unstated]
    moving = placed.samples[rows][:, placed[speed] > _STANDING]
    if not np.isfinite(moving).any(axis=0).any():
        return ()
    level, gravity = float(np.sqrt(np.nanvar(moving))), float(np.abs(np.nanmean(moving)))
    if not 0 < level < calm and level < wild and not (abs(gravity - 1) < calm and level < 1):
        return ()
    names = ", ".join(placed.names[row] for row in rows)
    return (
        f"{names}: no unit is stated, and {level:.2g} about a mean of {gravity:.2g} m/s² is hardly that of a car on a "
        "road: state the unit in the recording or the vehicle file",
    )


def _mean_speed(speeds: Real) -> float | None:
    """Return the mean speed while the vehicle moves; None if it does not."""
    moving = speeds[speeds > _STANDING]
    return float(moving.mean()) if moving.size else None


def _with_speed_of_wheels(recording: Recording, vehicle: Vehicle) -> tuple[Recording, str | None]:
    """Return a recording with the median of the wheels' speeds as the vehicle's, and its name; None without any.

    The speeds are those of sensors of the wheels' circumferential speed, or of their rotation and their rolling radius;
    or of channels that name them, such as "Vehicle.Chassis.Axle.Row1.Wheel.Left.Speed" (`channel_names`). The median of
    four wheels is the mean of the two in between: that of the vehicle's middle in a bend, also if one sensor fails or
    one wheel slips.
    """
    radii = {f"wheel_{wheel.corner}": wheel.rolling_radius or np.nan for wheel in vehicle.wheels}
    wheels = {sensor.channel: 1.0 for sensor in vehicle.sensor if sensor.quantity == "speed" and sensor.on in radii}
    wheels |= {sensor.channel: radii[sensor.on] for sensor in vehicle.sensor if sensor.quantity == "wheel_speed"}
    speeds_of = {channel.name: corner_of(channel.name) for channel in recording.channels if channel.quantity == "speed"}
    wheels |= {name: 1.0 for name, corner in speeds_of.items() if corner in vehicle.suspensions}
    rows = {recording.index(name): factor for name, factor in wheels.items() if name in recording.names}
    if not rows:
        return recording, None
    speeds = np.array([factor * recording.samples[row] for row, factor in rows.items()])
    missing = np.isnan(speeds).all(axis=0)
    speed = np.full(recording.n_samples, np.nan)
    speed[~missing] = np.abs(np.nanmedian(speeds[:, ~missing], axis=0))
    channels = (*recording.channels, Channel(vehicle.speed_channel, "speed"))
    samples = np.vstack([recording.samples, speed])
    return recording.changed(f"speed of {len(rows)} wheels", samples=samples, channels=channels), vehicle.speed_channel


def _with_speed_corrected(recording: Recording, vehicle: Vehicle, row: int) -> Recording:
    """Return a recording with its speed channel scaled and advanced as the vehicle file states."""
    samples = recording.samples.copy()
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
    conditions |= _temperatures_and_pressure(placed, vehicle)
    stated = {sensor.channel for sensor in vehicle.sensor if sensor.quantity == "distance"}
    for channel, values in zip(placed.channels, placed.samples, strict=True):
        rule = rule_of(channel.name)
        is_odometer = channel.name in stated or (rule is not None and rule.quantity == "distance")
        if is_odometer and channel.quantity == "distance" and np.isfinite(values).any():
            conditions["mileage"] = float(np.nanmax(values)) / 1000
    for sensor in vehicle.sensor:
        is_upright = sensor.direction is not None and abs(sensor.direction[2]) > _UPRIGHT
        if is_upright and sensor.quantity == "angular_velocity" and sensor.channel in placed.names:
            values = placed.samples[placed.index(sensor.channel)]
            conditions["turning"] = float(np.sqrt(np.nanmean(values**2)))
    return conditions


def _temperatures_and_pressure(placed: Recording, vehicle: Vehicle) -> dict[str, float]:
    """Return the mean temperature of the dampers or of the surroundings, and temperature and pressure of the tyres."""
    sensors = {sensor.channel: sensor for sensor in vehicle.sensor}
    means: dict[str, list[float]] = {"temperature": [], "ambient": [], "tyre_temperature": [], "tyre_pressure": []}
    for channel, values in zip(placed.channels, placed.samples, strict=True):
        sensor = sensors.get(channel.name)
        is_on_wheel = corner_of(channel.name) is not None if sensor is None else sensor.on.startswith("wheel")
        if np.isnan(values).all():
            continue
        mean = float(np.nanmean(values))
        if channel.quantity == "pressure" and is_on_wheel:
            means["tyre_pressure"].append(mean)
        elif channel.quantity == "temperature":
            is_damper = sensor is not None and sensor.between is not None
            means["tyre_temperature" if is_on_wheel else "temperature" if is_damper else "ambient"].append(mean)
    means["temperature"] = means["temperature"] or means["ambient"]
    return {name: float(np.mean(values)) for name, values in means.items() if values and name != "ambient"}
