"""Motions of a vehicle that its sensors observe."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood import RigidLayout, rigid_layout, segment_spectra
from sprung.recording import Channel, Recording
from sprung.vehicles import Sensor, structure

UP, AHEAD, LEFT = (0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (0.0, 1.0, 0.0)


def test_four_accelerometers_give_bounce_pitch_and_roll(car) -> None:
    """Their readings of a rigid motion of the body, and its coordinates back; wheels are not seen."""
    layout = rigid_layout(structure(car))
    assert layout.coordinates == ("bounce", "pitch", "roll")
    assert layout.rows == pytest.approx(np.eye(3, 7), abs=1e-12)
    bounce, pitch, roll = 0.5, 0.2, -0.1
    readings = [bounce - x * pitch + y * roll for x, y, _ in (sensor.position for sensor in car.sensor)]
    assert layout.reduction @ readings == pytest.approx([bounce, pitch, roll])


def test_an_inertial_unit_reads_its_acceleration_and_angular_velocities(car) -> None:
    """An accelerometer at (0.3, 0.1) reads z'' - 0.3 p'' + 0.1 r''; the one ahead reads braking and is left out."""
    unit = (
        Sensor(channel="az", quantity="acceleration", unit="g", position=(0.3, 0.1, 0.2), direction=UP),
        Sensor(channel="ax", quantity="acceleration", unit="g", position=(0.3, 0.1, 0.2), direction=AHEAD),
        Sensor(channel="wx", quantity="angular_velocity", unit="rad/s", direction=AHEAD),
        Sensor(channel="wy", quantity="angular_velocity", unit="rad/s", direction=LEFT),
    )
    layout = rigid_layout(structure(car.model_copy(update={"sensor": unit})))
    assert layout.names == ("az", "wx", "wy")
    assert layout.orders.tolist() == [2, 1, 1]
    assert layout.motion[:, :3] == pytest.approx(np.array([[1.0, -0.3, 0.1], [0.0, 0.0, 1.0], [0.0, 1.0, 0.0]]))
    assert layout.rows == pytest.approx(np.eye(3, 7), abs=1e-12)
    turning = np.exp(4j * np.pi * np.arange(3) / 100)
    each = layout.differenced(np.tile(turning.real, (3, 1)), 100.0) + 1j * layout.differenced(
        np.tile(turning.imag, (3, 1)), 100.0
    )
    of_first = layout.differentiator(np.array([2.0]), 100.0)[0] * each[:, 0]
    assert of_first == pytest.approx(np.array([1, 4j * np.pi, 4j * np.pi]))


@pytest.mark.slow
def test_spectra_of_one_motion_are_the_same_whatever_derivative_is_recorded() -> None:
    """Sines between the lines of the segments, as displacement, velocity and acceleration."""
    layout = RigidLayout(("d", "v", "a"), ("1", "2", "3"), np.arange(3), np.eye(3), np.eye(3), np.zeros((3, 3, 3)))
    generator, time = np.random.default_rng(1), np.arange(20_000) / 100
    f = 2 * np.pi * generator.uniform(0.3, 20, 300)
    waves = np.exp(1j * (f[:, None] * time + generator.uniform(0, 2 * np.pi, (300, 1))))
    samples = [np.sum(waves / (1j * f[:, None]) ** k, axis=0).real for k in (2, 1, 0)]
    recording = Recording(np.array(samples), 100.0, tuple(Channel(name) for name in layout.names))
    values = segment_spectra([recording], layout, speed=None, band=(0.8, 20.0), segment_length=5.0).values
    of_displacement, of_velocity, of_acceleration = np.moveaxis(values, 2, 0)
    power = np.mean(np.abs(of_acceleration) ** 2, axis=0)
    for other in (of_displacement, of_velocity):
        assert np.max(np.mean(np.abs(other - of_acceleration) ** 2, axis=0) / power) < 5e-4


def test_two_sensors_of_one_axle_give_two_combinations(car) -> None:
    """Bounce and pitch cannot be separated there: the coordinates are numbered, and independent."""
    front = car.model_copy(update={"sensor": car.sensor[:2]})
    layout = rigid_layout(structure(front))
    assert layout.coordinates == ("1", "2")
    assert np.linalg.matrix_rank(layout.rows) == 2


def test_sensors_that_observe_no_motion_of_the_body_are_refused(car) -> None:
    braking = Sensor(channel="ax", quantity="acceleration", unit="g", position=(0.0, 0.0, 0.0), direction=AHEAD)
    with pytest.raises(ParameterError, match="no sensor observes a motion of the vehicle"):
        rigid_layout(structure(car.model_copy(update={"sensor": (braking,)})))
