"""Channels of a drive that record conditions: speeds, temperatures and pressures."""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from sprung._arrays import Real
from sprung.excitation import Route
from sprung.recording import Channel, Recording
from sprung.simulation.conditions import SuspensionConditions
from sprung.simulation.force_laws import TYRE_PRESSURE, pressure_of
from sprung.vehicles import Component, Sensor, Vehicle, corner_names
from sprung.vehicles.sections import SENSOR_QUANTITIES


def with_conditions(
    recording: Recording,
    vehicle: Vehicle,
    *,
    route: Route,
    suspension: SuspensionConditions,
    tyre_factors: Mapping[Component, float],
) -> Recording:
    """Return the recording with the speed channel and the channels of conditions that the vehicle file lists.

    Parameters
    ----------
    recording
        Signals of the motion sensors.
    vehicle
        Vehicle with its sensors.
    route
        Speed and curves of the drive.
    suspension
        Temperatures of dampers and tyres.
    tyre_factors
        True over nominal stiffness of each tyre, from which its pressure follows; tyres that are left out are nominal.

    Notes
    -----
    A wheel at y [m] runs at the speed less y times the yaw rate. A temperature without a place is that of the dampers.
    """
    time = np.arange(recording.n_samples) / recording.sampling_rate
    speed, yaw_rate = route.speed.speed(time), route.yaw_rate(time)
    rows, channels = [speed], [Channel(vehicle.speed_channel, "speed")]
    for sensor in vehicle.sensor:
        if not sensor.is_condition or sensor.channel == vehicle.speed_channel:
            continue
        if SENSOR_QUANTITIES[sensor.quantity] in {"speed", "angular_velocity"}:
            values = _wheel_speed(sensor, vehicle, speed, yaw_rate)
        elif sensor.quantity == "temperature":
            is_tyre = sensor.between is None and sensor.on != "body"
            values = np.full(time.size, suspension.tyre_temperature if is_tyre else suspension.temperature)
        else:
            factor = tyre_factors.get(Component(sensor.on.removeprefix("wheel_"), "tyre"), 1.0)
            values = np.full(time.size, TYRE_PRESSURE if sensor.on == "body" else pressure_of(factor))
        rows.append(values)
        channels.append(Channel(sensor.channel, SENSOR_QUANTITIES[sensor.quantity]))
    samples = np.vstack([recording.samples, *rows])
    return replace(recording, samples=samples, channels=(*recording.channels, *channels))


def _wheel_speed(sensor: Sensor, vehicle: Vehicle, speed: Real, yaw_rate: Real) -> Real:
    """Return the circumferential speed [m/s] or the angular velocity [rad/s] of a wheel, or the speed of the body."""
    corners = corner_names(len(vehicle.axle))
    corner = sensor.on.removeprefix("wheel_")
    if corner not in corners:
        return speed
    number = corners.index(corner)
    axle, side = vehicle.axle[number // 2], 1 - 2 * (number % 2)
    circumferential = speed - side * axle.half_track * yaw_rate
    if sensor.quantity == "speed" or axle.rolling_radius is None:
        return circumferential
    return circumferential / axle.rolling_radius
