"""Tyres that hold the body sideways: its motion against equations of motion written down on their own."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood import CornerSettings
from sprung.likelihood.vehicle import default_choices
from sprung.recording import Channel
from sprung.vehicles import Sensor, Vehicle, parse_vehicle, read_vehicle, sensor_outputs, structure
from sprung.vehicles.models import ROLLING
from sprung.vehicles.structure import Element

HEIGHT, SPEED = 0.55, 20.0
CENTRES = (0.06, 0.12)
CORNERING = (70e3, 60e3)
RELAXATION = (0.3, 0.5)
WHEEL = 40.5  # unsprung mass of the car of the file


def on_tyres(
    *,
    factor: float = 1.0,
    height: float = HEIGHT,
    centres: tuple[float, float] = CENTRES,
    lengths: tuple[float, float] = (0.35, 0.35),
) -> Vehicle:
    """Return a car whose tyres have a cornering stiffness."""
    car = read_vehicle("zafira")
    fields = zip(CORNERING, centres, lengths, strict=True)
    tyres = [
        {"cornering_stiffness": factor * stiffness, "roll_centre_height": centre, "relaxation_length": length}
        for stiffness, centre, length in fields
    ]
    axles = tuple(axle.model_copy(update=own) for axle, own in zip(car.axle, tyres, strict=True))
    body = car.body.model_copy(update={"height": height, "yaw_inertia": 2500.0})
    return car.model_copy(update={"axle": axles, "body": body})


def test_poles_are_those_of_the_equations_of_motion() -> None:
    """The side force F of an axle lags behind its slip: l F' / v + F = 2 C / v times the velocity of the patch.

    The lateral acceleration of the body is that along its own axes and v times its yaw velocity, wheels move sideways
    with it, and its weight leans on hubs that hold it upright.
    """
    car, plain = on_tyres(lengths=RELAXATION), structure(read_vehicle("zafira")).system
    n = 9  # of the plain car, then sway and yaw
    mass, damping, stiffness = (np.zeros((n, n)) for _ in range(3))
    for whole, part in ((mass, plain.mass), (damping, plain.damping), (stiffness, plain.stiffness)):
        whole[:7, :7] = part
    mass[7, 7], mass[8, 8] = car.body.mass, 2500.0
    for axle in car.axle:
        hubs = np.eye(n)[7] + axle.x * np.eye(n)[8] + (HEIGHT - ROLLING.radius) * np.eye(n)[2]
        mass += 2 * WHEEL * np.outer(hubs, hubs)
    damping[:, 8] = SPEED * mass[:, 7]
    stiffness[2, 2] -= 9.80665 * car.body.mass * (HEIGHT - ROLLING.radius)
    patches = np.zeros((2, n))
    for row, (axle, centre) in enumerate(zip(car.axle, CENTRES, strict=True)):
        patches[row, 2], patches[row, 7:] = HEIGHT - centre, (1.0, axle.x)
        patches[row, 3 + 2 * row : 5 + 2 * row] = np.array([1.0, -1.0]) * centre / (2 * axle.half_track)
    slip = 2 * np.array(CORNERING) / SPEED
    stiffness += patches.T @ np.diag(slip * SPEED / (ROLLING.speed * ROLLING.lane_keeping)) @ patches
    inverse, rates = np.linalg.inv(mass), SPEED / np.array(RELAXATION)
    state = np.block(
        [
            [np.zeros((n, n)), np.eye(n), np.zeros((n, 2))],
            [-inverse @ stiffness, -inverse @ damping, -inverse @ patches.T],
            [np.zeros((2, n)), np.diag(rates * slip) @ patches, -np.diag(rates)],
        ]
    )
    expected = np.linalg.eigvals(state)
    expected = np.sort_complex(expected[expected.imag > 1e-6])
    found = np.sort_complex(structure(car, speed=SPEED).modes().poles)
    assert found == pytest.approx(expected, rel=1e-9)


def test_a_patch_moves_with_a_vehicle_that_turns_as_one_body_wherever_the_roll_centre_is() -> None:
    """As a sensor of lateral displacement does that is fixed to the body at the height of the road."""
    places = [(axle.x, 0.0, -HEIGHT) for axle in on_tyres().axle]
    sensors = [Channel(f"d{x}", "displacement", (x, y, h), (0.0, 1.0, 0.0)) for x, y, h in places]
    for centres in (CENTRES, (0.0, 0.0), (0.3, -0.1)):
        car = structure(on_tyres(centres=centres))
        half = read_vehicle("zafira").axle[0].half_track
        at_sensors = sensor_outputs(car.coordinates, sensors=sensors, carriers=["body"] * 2).displacement
        patches = np.array([one.elongation for one in car.elements if one.part == "cornering"])
        roll = np.array([{"roll": 1.0}.get(name, 0.0) for name in car.coordinates])
        for column, name in enumerate(car.coordinates):
            if name.startswith("wheel_"):
                roll[column] = half if name.endswith("left") else -half
        for name, motion in (("roll", roll), ("sway", None), ("yaw", None)):
            unit = np.array([float(each == name) for each in car.coordinates]) if motion is None else motion
            assert patches @ unit == pytest.approx(at_sensors @ unit, abs=1e-12), name


@pytest.mark.parametrize("factor", [1e5, 1e-5])
def test_the_body_rolls_about_its_roll_centre_on_stiff_tyres_and_about_the_centre_of_gravity_on_weak_ones(
    factor,
) -> None:
    """By the parallel axis theorem, with wheels that move sideways at their hubs; the weight leans in any case."""
    car = on_tyres(factor=factor, centres=(0.1, 0.1))
    heavy = read_vehicle("zafira")
    wheels = 4 * WHEEL
    below = HEIGHT - ROLLING.radius  # the hubs
    arm = HEIGHT - 0.1 if factor > 1 else below * wheels / (heavy.body.mass + wheels)
    inertia = heavy.inertias[1] + heavy.body.mass * arm**2 + wheels * (below - arm) ** 2
    body = heavy.body.model_copy(update={"roll_inertia": inertia})
    axles = tuple(axle.model_copy(update={"tyre_stiffness": 1e9}) for axle in heavy.axle)  # whose axles do not tilt
    stiff = car.model_copy(update={"axle": tuple(axle.model_copy(update={"tyre_stiffness": 1e9}) for axle in car.axle)})
    upright = structure(heavy.model_copy(update={"body": body, "axle": axles}))
    roll = np.array([float(name == "roll") for name in upright.coordinates])
    weight = Element("body", "weight", roll, -9.80665 * heavy.body.mass * (HEIGHT - ROLLING.radius))
    found, expected = (
        dict(zip(modes.labels, modes.poles, strict=True))["roll"]
        for modes in (
            structure(stiff, speed=SPEED).modes(),
            replace(upright, elements=(*upright.elements, weight)).modes(),
        )
    )
    assert found == pytest.approx(expected, rel=1e-3)


def test_in_a_steady_turn_lateral_accelerometers_read_the_centripetal_acceleration() -> None:
    """v^2 over the radius, wherever they are; upright ones, and gyroscopes about other axes, read nothing."""
    axes = {"y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    sensors = [
        Sensor(channel=f"{name}{x}", quantity="acceleration", unit="m/s^2", position=(x, 0.4, 0.3), direction=axis)
        for name, axis in axes.items()
        for x in (1.2, -0.8)
    ]
    car = structure(on_tyres().model_copy(update={"sensor": tuple(sensors)}), speed=SPEED)
    radius = 80.0
    rates = np.array([{"yaw": SPEED / radius}.get(name, 0.0) for name in car.coordinates])
    np.testing.assert_allclose(car.outputs.velocity @ rates, [5.0, 5.0, 0.0, 0.0], atol=1e-12)
    assert car.outputs.orders.tolist() == [2] * 4
    np.testing.assert_array_equal(car.outputs.motion, car.outputs.acceleration)


def test_a_fit_has_the_band_of_upright_motion_where_the_body_turns_slowly() -> None:
    """A course that is kept within many seconds needs no segment that long."""
    car, slow = on_tyres(), structure(on_tyres(factor=0.05), speed=SPEED)
    assert slow.modes().natural_frequency.min() < 0.2
    band, segment = default_choices(car, slow, CornerSettings(), 200.0)
    assert band[0] > 0.4
    assert segment < 8.0


def test_roll_is_named_roll_where_it_moves_the_centre_of_gravity_more_than_it_turns() -> None:
    """A body with a high centre of gravity sways with more energy than it rolls with."""
    modes = structure(on_tyres(height=1.1), speed=SPEED).modes()
    named = dict(zip(modes.labels, modes.natural_frequency, strict=True))
    plain = structure(read_vehicle("zafira")).modes()
    assert named["roll"] < dict(zip(plain.labels, plain.natural_frequency, strict=True))["roll"] < named["sway"]


def test_slow_tyres_hold_the_body_more_firmly() -> None:
    slow, fast = (structure(on_tyres(), speed=speed).components() for speed in (5.0, 25.0))
    part = next(part for part in slow if str(part) == "front_tyres.cornering")
    assert slow[part] == pytest.approx(5 * fast[part])


def test_a_standing_tyre_is_a_spring() -> None:
    """Its lateral stiffness is the cornering stiffness over the relaxation length."""
    still = structure(on_tyres(), speed=0.0)
    springs = [
        replace(one, stiffness=one.stiffness + one.series_stiffness, damping=0.0, series_stiffness=None)
        if one.part == "cornering" and one.series_stiffness
        else one
        for one in still.elements
    ]
    expected = replace(still, elements=tuple(springs)).modes()
    roll = dict(zip(still.modes().labels, still.modes().poles, strict=True))["roll"]
    assert np.abs(expected.poles / roll - 1).min() < 1e-4


def fields(**changes) -> dict:
    car = on_tyres().model_dump(mode="json", exclude_defaults=True)
    return {**car, "kind": "road", "name": "car", **changes}


def test_files_with_half_of_it_are_refused() -> None:
    plain = fields()
    assert parse_vehicle(plain).coordinates == on_tyres().coordinates
    without_height = {key: value for key, value in plain["body"].items() if key != "height"}
    with pytest.raises(ParameterError, match=r"needs the height of the centre of gravity: add height to \[body\]"):
        parse_vehicle(fields(body=without_height))
    front, rear = plain["axle"]
    with pytest.raises(ParameterError, match="cornering_stiffness is given for some axles only"):
        parse_vehicle(fields(axle=[front, {key: rear[key] for key in rear if key != "cornering_stiffness"}]))
    with pytest.raises(ParameterError, match="leave one out"):
        parse_vehicle(fields(axle=[{**front, "lateral_stiffness": 1e5}, {**rear, "lateral_stiffness": 1e5}]))
