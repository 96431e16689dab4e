"""Rigid-body motion that the sensors show."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import ArrayLike

from sprung.modal import Modes, unit_shapes
from sprung.results.figures.shapes import BodyShapes, body_shapes, projected
from sprung.recording import Channel
from sprung.vehicles import Sensor, Vehicle, read_vehicle, structure

UP = (0.0, 0.0, 1.0)
PLACES = ((1.2, 0.7, 0.0), (1.2, -0.7, 0.0), (-1.6, 0.7, 0.0), (-1.6, -0.7, 0.0))
CORNERS = tuple(Channel(f"acc_{k}", "acceleration", place, UP) for k, place in enumerate(PLACES))


def as_modes(shapes: ArrayLike, channels: Sequence[Channel], pole: complex = -1.0 + 10.0j) -> Modes:
    mode_shapes = np.array(shapes, dtype=complex)
    n = len(mode_shapes)
    some = np.full(n, 0.01)
    names = tuple(channel.name for channel in channels)
    return Modes(np.full(n, pole), mode_shapes, names, some, some, some, (None,) * n)


def rigid_body(modes: Modes, channels: Sequence[Channel]) -> BodyShapes:
    """Return the motion of the body, which these channels determine."""
    shapes = body_shapes(modes, channels)
    assert shapes is not None, "the channels determine no rigid-body motion"
    return shapes


def exact_modes(vehicle: Vehicle) -> Modes:
    exact = structure(vehicle).modes()
    modes = as_modes(unit_shapes(exact.mode_shapes), [Channel(name) for name in exact.channels])
    return replace(modes, poles=exact.poles)


def test_pitch_and_roll_move_the_right_corners() -> None:
    # Positive pitch is nose down, positive roll left side up; corners: front left and right, rear right and left.
    pitch = [-1.2 / 1.6, -1.2 / 1.6, 1.0, 1.0]
    roll = [1.0, -1.0, 1.0, -1.0]
    shapes = rigid_body(as_modes([pitch, roll], CORNERS), CORNERS)
    np.testing.assert_allclose(shapes.corner_motions[0], [-0.75, -0.75, 1, 1], atol=1e-12)
    np.testing.assert_allclose(shapes.corner_motions[1], [1, -1, -1, 1], atol=1e-12)
    np.testing.assert_allclose(shapes.explained, 1)
    assert not shapes.is_nominal


@pytest.mark.parametrize("quantity", ["velocity", "displacement"])
def test_other_quantities_show_the_same_motion(quantity) -> None:
    channels = tuple(replace(channel, quantity=quantity) for channel in CORNERS)
    shapes = rigid_body(as_modes([[1, 0.5, 0.25, -0.25]], channels), channels)
    motion = shapes.corner_motions[0]
    np.testing.assert_allclose(motion / motion[0], [1, 0.5, -0.25, 0.25], atol=1e-12)
    np.testing.assert_allclose(shapes.sensor_motions[0] / motion[0], [1, 0.5, 0.25, -0.25], atol=1e-12)


def test_an_inertial_unit_shows_the_motion_that_corner_sensors_show() -> None:
    car = read_vehicle("zafira")
    axes = {"az": ("acceleration", "m/s^2", UP), "wx": ("angular_velocity", "rad/s", (1.0, 0.0, 0.0))}
    axes["wy"] = ("angular_velocity", "rad/s", (0.0, 1.0, 0.0))
    sensors = tuple(
        Sensor(channel=name, quantity=quantity, unit=unit, position=(0.3, -0.2, 0.1), direction=direction)
        for name, (quantity, unit, direction) in axes.items()
    )
    unit = car.model_copy(update={"sensor": sensors})
    by_unit = rigid_body(exact_modes(unit), [sensor.as_channel() for sensor in sensors])
    by_corners = rigid_body(exact_modes(car), [sensor.as_channel() for sensor in car.sensor])
    assert by_unit.is_nominal
    assert np.isnan(by_unit.sensor_motions[:, 1:]).all()
    lever = np.column_stack([np.ones(4), by_unit.corners[:, :2]])
    for k in range(3):
        # A rigid body's vertical motion is linear over its plan: carry it from one plate's corners to the other's.
        plane = np.linalg.lstsq(
            np.column_stack([np.ones(4), by_corners.corners[:, :2]]), by_corners.corner_motions[k], rcond=None
        )[0]
        expected = lever @ plane
        ratio = by_unit.corner_motions[k] / expected
        np.testing.assert_allclose(ratio, ratio[0], rtol=1e-6)


def test_up_is_up_and_the_front_is_right_in_the_picture() -> None:
    origin, up, front = projected(np.array([[0, 0, 0], [0, 0, 1.0], [1.0, 0, 0]]))
    assert up[0] == origin[0]
    assert up[1] > origin[1]
    assert front[0] > origin[0]
