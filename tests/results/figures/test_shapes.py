"""Mode shapes as bars and on the body."""

import itertools
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.patches import Polygon
from matplotlib.text import Annotation, Text
from numpy.typing import ArrayLike

from sprung._arrays import Real
from sprung.modal import Modes, unit_shapes
from sprung.recording import Channel
from sprung.results.figures import complexity_figure, shapes_figure
from sprung.results.figures.shapes import BodyShapes, body_shapes, projected
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


def displacements(axes: Axes) -> Real:
    """Vertical displacement of the drawn corners in the picture."""
    plates = {patch.get_gid(): patch.get_xy()[:4] for patch in axes.patches if isinstance(patch, Polygon)}
    rest, moved = plates["rest"], plates["moved"]
    np.testing.assert_allclose(moved[:, 0], rest[:, 0], atol=1e-12)
    return moved[:, 1] - rest[:, 1]


def test_twist_is_no_rigid_motion_but_its_arrows_are_drawn() -> None:
    modes = as_modes([[1, -1, -1, 1]], CORNERS)
    shapes = body_shapes(modes, CORNERS)
    assert shapes is not None
    assert shapes.explained[0] == pytest.approx(0, abs=1e-12)
    axes = shapes_figure(modes, CORNERS).axes[0]
    np.testing.assert_allclose(displacements(axes), 0, atol=1e-12)
    arrows = [text for text in axes.texts if isinstance(text, Annotation) and text.get_gid() == "sensor"]
    lengths = [arrow.xy[1] - arrow.xyann[1] for arrow in arrows]
    np.testing.assert_allclose(np.array(lengths) / lengths[0], [1, -1, -1, 1])


@pytest.mark.parametrize(
    "channels",
    [
        tuple(Channel(f"a{k}", "acceleration") for k in range(4)),
        CORNERS[:2],
        tuple(Channel(f"a{k}", "unknown", place, UP) for k, place in enumerate(PLACES)),
    ],
)
def test_without_places_or_with_too_few_there_is_no_body(channels) -> None:
    shape = np.array([1, 0.5 + 0.2j, -0.5, 0.25])[: len(channels)]
    modes = as_modes([shape], channels)
    assert body_shapes(modes, channels) is None
    axes = shapes_figure(modes, channels).axes[0]
    np.testing.assert_allclose([bar.get_height() for bar in axes.containers[0]], shape.real)
    (imaginary,) = [line for line in axes.get_lines() if line.get_gid() == "imaginary part"]
    np.testing.assert_allclose(np.asarray(imaginary.get_ydata()), shape.imag)
    assert [text.get_text() for text in axes.get_xticklabels()] == [channel.name for channel in channels]


@pytest.mark.slow
@pytest.mark.parametrize("n_channels", [1, 60])
def test_few_and_many_channels_are_drawn(n_channels) -> None:
    channels = tuple(Channel(f"accelerometer_{k}") for k in range(n_channels))
    shapes = unit_shapes(np.random.default_rng(1).standard_normal((2, n_channels)).astype(complex))
    modes = as_modes(shapes, channels)
    for figure in (shapes_figure(modes, channels), complexity_figure(modes)):
        figure.draw_without_rendering()
        assert len(figure.axes) == 2
    ticks = [tick.get_text() for tick in shapes_figure(modes, channels).axes[-1].get_xticklabels()]
    assert ticks[0] == "accelerometer_0"
    assert len(ticks) <= min(n_channels, 40)


def test_no_mode_is_said() -> None:
    none = as_modes(np.zeros((0, 4)), CORNERS)
    for figure in (shapes_figure(none, CORNERS), complexity_figure(none)):
        assert figure.axes[0].texts[0].get_text() == "No mode was identified."


MIXED = (
    *(Channel(f"acc_{axis}", "acceleration") for axis in "xy"),
    Channel("gyro_x", "angular_velocity"),
    Channel("acc_z", "acceleration"),
)


def test_quantities_are_drawn_apart_each_relative_to_its_largest_channel() -> None:
    modes = as_modes([np.array([1, -0.5, 0.04 + 0.03j, 0.25])], MIXED)
    axes = shapes_figure(modes, MIXED).axes[0]
    assert [text.get_text() for text in axes.get_xticklabels()] == ["acc_x", "acc_y", "acc_z", "gyro_x"]
    assert [bar.get_height() for bar in axes.containers[0]] == pytest.approx([1, -0.5, 0.25, 0.8])
    scales = [text.get_text() for text in axes.texts if text.get_gid() == "scale"]
    assert scales == ["acceleration\n1 = 1 m/s²", "angular velocity\n1 = 0.05 rad/s"]
    compass = complexity_figure(modes, MIXED)
    radii = [np.asarray(line.get_ydata())[1] for line in compass.axes[0].get_lines() if line.get_gid() == "channel"]
    assert radii == pytest.approx([1, 0.5, 1, 0.25])
    assert "of the same quantity" in compass.get_suptitle()


def test_the_largest_of_many_channels_are_named_without_overlap() -> None:
    generator = np.random.default_rng(1)
    channels = tuple(Channel(f"acc_{k:02d}") for k in range(17))
    shape = generator.standard_normal((2, 17)) * (1 + 0.1j * generator.standard_normal((2, 17)))
    modes = as_modes(unit_shapes(shape), channels)
    figure = complexity_figure(modes, channels)
    figure.draw_without_rendering()
    for axes, own in zip(figure.axes, modes.mode_shapes, strict=True):
        names = [text for text in axes.texts if text.get_gid() == "name"]
        largest = np.argsort(-np.abs(own))[:6]
        assert {text.get_text() for text in names} == {channels[k].name for k in largest}
        boxes = [Text.get_window_extent(text) for text in names]
        for one, other in itertools.combinations(boxes, 2):
            assert min(one.x1, other.x1) <= max(one.x0, other.x0) or min(one.y1, other.y1) <= max(one.y0, other.y0)
