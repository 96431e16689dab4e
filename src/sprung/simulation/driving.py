"""Accelerations of driving in the structure of a vehicle and in the readings of its sensors."""

from dataclasses import replace

import numpy as np

from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.excitation import GRAVITY, Route
from sprung.recording import Recording
from sprung.vehicles import Structure, Vehicle

#: Names of the inputs that `with_body_accelerations` adds.
INPUTS = ("longitudinal_acceleration", "lateral_acceleration")


def with_body_accelerations(vehicle: Structure, *, height: float) -> Structure:
    """Return the structure with the longitudinal and the lateral acceleration of the body as inputs.

    Parameters
    ----------
    vehicle
        Structure with a body on axles.
    height
        Height of the body's centre of gravity above the ground, where tyres push [m], above 0.

    Raises
    ------
    ParameterError
        If the height is not above 0, or the structure has no body on axles.

    Notes
    -----
    In ISO 8855 axes, with the mass m of the body and all that it carries: pitch moment -m h a_x (braking lowers the
    nose) and roll moment m h a_y (a curve to the left raises the left side). All of it passes through springs and
    dampers: the suspension has neither anti-dive nor a roll axis above the ground. The mass of wheels does not count.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle, structure
    >>> driven = with_body_accelerations(structure(read_vehicle("zafira")), height=0.5)
    >>> pitch = driven.coordinates.index("pitch")
    >>> driven.forces[pitch, -2:].tolist()  # N m per m/s^2 along and across; the body has 1480 kg
    [-740.0, 0.0]
    """
    check_number("height of the centre of gravity", height, above=0)
    if not {"bounce", "pitch", "roll"} <= set(vehicle.coordinates):
        raise ParameterError("the structure has no bounce, pitch and roll: only a body on axles can brake and corner")
    carried = [name for name in vehicle.coordinates if name == "bounce" or name.startswith("mounted_mass_")]
    mass = sum(vehicle.mass[row, row] for row in map(vehicle.coordinates.index, carried))
    forces = np.zeros((len(vehicle.coordinates), 2))
    forces[vehicle.coordinates.index("pitch"), 0] = -mass * height
    forces[vehicle.coordinates.index("roll"), 1] = mass * height
    return replace(vehicle, inputs=(*vehicle.inputs, *INPUTS), forces=np.hstack([vehicle.forces, forces]))


def with_gravity(vehicle: Structure, description: Vehicle) -> Structure:
    """Return the structure whose accelerometers on the body read gravity as they pitch and roll with it.

    Parameters
    ----------
    vehicle
        Structure of `description`, in any condition.
    description
        Vehicle with its sensors.

    Notes
    -----
    An accelerometer with the axis (d_x, d_y, d_z) reads the specific force, whose share of gravity changes by
    g (d_y roll - d_x pitch); what changes with the square of the angles is left out, and so is the constant g d_z.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle, structure
    >>> zafira = read_vehicle("zafira")
    >>> lateral = zafira.sensor[0].model_copy(update={"direction": (0.0, 1.0, 0.0)})
    >>> turned = zafira.model_copy(update={"sensor": (lateral,)})
    >>> car = with_gravity(structure(turned), turned)
    >>> round(float(car.outputs.displacement[0, car.coordinates.index("roll")]), 3)  # m/s^2 per rad
    9.81
    """
    on_body = {sensor.channel for sensor in description.sensor if sensor.on == "body"}
    displacement = vehicle.outputs.displacement.copy()
    for row, channel in enumerate(vehicle.outputs.channels):
        if channel.quantity == "acceleration" and channel.name in on_body and channel.direction is not None:
            displacement[row, vehicle.coordinates.index("pitch")] -= GRAVITY * channel.direction[0]
            displacement[row, vehicle.coordinates.index("roll")] += GRAVITY * channel.direction[1]
    return replace(vehicle, outputs=replace(vehicle.outputs, displacement=displacement))


def with_driving_readings(recording: Recording, route: Route) -> Recording:
    """Return the recording plus what its accelerometers and yaw-rate sensors read because of driving itself.

    Parameters
    ----------
    recording
        Signals of sensors with their true axes, without the horizontal motion of the vehicle.
    route
        Speed and curves.

    Notes
    -----
    d_x a_x + d_y a_y of accelerometers, on body and wheels, and d_z times the yaw rate of gyroscopes.

    Examples
    --------
    >>> from sprung.excitation import SpeedProfile
    >>> from sprung.recording import Channel
    >>> forward = Channel("acc_x", "acceleration", direction=(1.0, 0.0, 0.0))
    >>> braking = Route(SpeedProfile([0.0, 10.0], [20.0, 0.0]), has_longitudinal=True)
    >>> run = with_driving_readings(Recording(np.zeros((1, 1000)), 100.0, (forward,)), braking)
    >>> round(float(run.samples[0, 500]), 6)
    -2.0
    """
    time = np.arange(recording.n_samples) / recording.sampling_rate
    longitudinal, lateral, yaw_rate = route.longitudinal(time), route.lateral(time), route.yaw_rate(time)
    samples = recording.samples.copy()
    for row, channel in enumerate(recording.channels):
        if channel.direction is None:
            continue
        dx, dy, dz = channel.direction
        if channel.quantity == "acceleration":
            samples[row] += dx * longitudinal + dy * lateral
        elif channel.quantity == "angular_velocity":
            samples[row] += dz * yaw_rate
    return replace(recording, samples=samples)
