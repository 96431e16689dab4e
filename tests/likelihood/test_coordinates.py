"""Motions of a vehicle that its sensors observe."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood import rigid_layout
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
    frequency = np.array([2.0])
    assert layout.differentiator(frequency)[0] == pytest.approx(np.array([1, 4j * np.pi, 4j * np.pi]))


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
