"""Body and sensors under braking, in curves and on slopes, against statics."""

from typing import Any

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.excitation import GRAVITY, Route, SmoothSteps, SpeedProfile
from sprung.recording import Channel, Recording
from sprung.simulation import (
    ForceLaw,
    simulate,
    simulate_nonlinear,
    with_body_accelerations,
    with_driving_readings,
    with_gravity,
)
from sprung.vehicles import Sensor, chain, structure


class Held:
    """A constant acceleration on a flat road."""

    is_smooth = True

    def __init__(self, n_inputs, longitudinal=0.0, lateral=0.0):
        self.n_inputs, self.values = n_inputs, [longitudinal, lateral]

    def samples(self, n_samples, *, sampling_rate, generator, start=0.0):
        inputs = np.zeros((self.n_inputs, n_samples))
        inputs[-2:] = np.array(self.values)[:, None]
        return inputs


def with_angles(car):
    """Return the car with sensors of its pitch and roll alone."""
    axes = {"pitch": (0.0, 1.0, 0.0), "roll": (1.0, 0.0, 0.0)}
    sensors = [Sensor(channel=name, quantity="angle", unit="rad", direction=axis) for name, axis in axes.items()]
    return car.model_copy(update={"sensor": tuple(sensors)})


def stiffness(vehicle, name):
    """Return the static stiffness of a rotation of the body, springs and tyres in series."""
    row = vehicle.coordinates.index(name)
    return 1 / np.linalg.inv(vehicle.system.stiffness)[row, row]


@pytest.mark.parametrize("simulator", ["linear", "nonlinear"])
def test_static_angles_under_braking_and_in_curves(other_car, simulator):
    car = structure(with_angles(other_car))
    height, mass = 0.6, other_car.body.mass
    driven = with_body_accelerations(car, height=height)
    options: Any = {"duration": 0.5, "sampling_rate": 200.0, "lead_in": 10.0}
    angles = []
    for held in (Held(6, longitudinal=-3.0), Held(6, lateral=2.0)):
        if simulator == "linear":
            angles.append(simulate(driven, held, **options).samples[:, -1])
        else:
            law = {"suspension": ForceLaw()}
            angles.append(simulate_nonlinear(driven, held, force_laws=law, **options).samples[:, -1])
    assert angles[0][0] == pytest.approx(mass * 3.0 * height / stiffness(car, "pitch"), rel=1e-3)  # nose down
    assert angles[0][1] == pytest.approx(0, abs=1e-9)
    assert angles[1][1] == pytest.approx(mass * 2.0 * height / stiffness(car, "roll"), rel=1e-3)  # left side up
    assert angles[1][0] == pytest.approx(0, abs=1e-9)


def test_mounted_masses_and_payload_brake_too(hatchback):
    loaded = structure(hatchback).with_payload(100.0)
    forces = with_body_accelerations(loaded, height=0.5).forces
    assert forces[1:3, -2:] == pytest.approx(np.diag([-980 * 0.5, 980 * 0.5]))


def test_an_accelerometer_reads_gravity_and_driving(hatchback):
    """At rest in a steady curve, pitch and roll tilt the axes; ISO 8855 signs."""
    axes = {"acc_x": (1.0, 0.0, 0.0), "acc_y": (0.0, 1.0, 0.0), "acc_z": (0.0, 0.0, 1.0)}
    sensors = tuple(
        Sensor(channel=name, quantity="acceleration", unit="m/s^2", position=(0.3, 0.1, 0.2), direction=axis)
        for name, axis in axes.items()
    )
    car = hatchback.model_copy(update={"sensor": sensors})
    driven = with_body_accelerations(with_gravity(structure(car), car), height=0.5)
    held = Held(6, longitudinal=-3.0, lateral=2.0)
    still = simulate(driven, held, duration=0.5, sampling_rate=200.0, lead_in=10.0)
    pitch = 880 * 0.5 * 3.0 / stiffness(structure(car), "pitch")
    roll = 880 * 0.5 * 2.0 / stiffness(structure(car), "roll")
    assert still.samples[:, -1] == pytest.approx([-GRAVITY * pitch, GRAVITY * roll, 0.0], rel=1e-3, abs=1e-9)
    speed = SpeedProfile(np.array([0.0, 10.0]), np.array([30.0, 0.0]))
    readings = with_driving_readings(still, Route(speed, has_longitudinal=True))
    middle = still.n_samples - 1
    assert readings.samples[0, middle] == pytest.approx(-3.0 - GRAVITY * pitch, rel=1e-3)


def test_driving_is_in_the_readings_by_axis():
    route = Route(
        SpeedProfile(np.array([-5.0, 5.0]), np.array([5.0, 15.0])),
        SmoothSteps(np.array([-500.0]), np.array([0.02]), np.array([1.0])),
        has_longitudinal=True,
    )
    tilted = (0.1, -0.2, float(np.sqrt(1 - 0.05)))
    channels = (
        Channel("tilted", "acceleration", (0.0, 0.0, 0.0), tilted),
        Channel("yaw_rate", "angular_velocity", None, (0.0, 0.0, 1.0)),
        Channel("travel", "displacement"),
    )
    run = with_driving_readings(Recording(np.zeros((3, 300)), 100.0, channels), route)
    v = 10 + np.arange(300) / 100
    assert run.samples[0] == pytest.approx(0.1 * 1.0 - 0.2 * 0.02 * v**2)
    assert run.samples[1] == pytest.approx(0.02 * v)
    assert run.samples[2] == pytest.approx(0)


def test_a_chain_cannot_brake():
    with pytest.raises(ParameterError, match="only a body on axles can brake and corner"):
        with_body_accelerations(chain(), height=0.5)
