"""A body that twists and bends, a skewed body, and travels of the suspension, against closed forms."""

import numpy as np
import pytest
from tests.vehicles import cars

from sprung.vehicles import (
    Component,
    FlexibleMode,
    Vehicle,
    body_row,
    corner_names,
    frequency_response,
    modal_mass,
    parse_vehicle,
    structure,
)

UP, A, B, MASS = (0.0, 0.0, 1.0), 1.3, 0.7, 1400.0
TORSION, BENDING = (
    {"shape": "torsion", "frequency": 22.0, "damping_ratio": 0.03},
    {"shape": "bending", "frequency": 27.0, "damping_ratio": 0.02},
)


def car(*modes, sensors=(), **body) -> Vehicle:
    """A car of even weight whose body is four masses above the wheels."""
    even = {"mass": MASS, "pitch_inertia": MASS * A**2, "roll_inertia": MASS * B**2, **body}
    vehicle = parse_vehicle(cars.car(body=even, flexible_mode=list(modes), sensor=list(sensors)))
    assert isinstance(vehicle, Vehicle)
    return vehicle


def without_suspension(vehicle):
    """The structure with its body free in the air."""
    nominal = structure(vehicle)
    return nominal.changed(
        {component: 0.0 for component in nominal.components() if component.kind in {"spring", "damper"}}
    )


def test_a_body_without_torsional_stiffness_is_four_quarter_cars() -> None:
    """Four masses at the corners that nothing joins: each bounces on its own wheel."""
    quarter = {"name": "q", "kind": "quarter", "body": {"mass": MASS / 4}, "corner": cars.CORNER}
    alone = structure(parse_vehicle(quarter)).modes()
    loose = structure(car({**TORSION, "frequency": 1e-6}))
    assert loose.mass[-1, -1] == pytest.approx(MASS)  # sum of m (x y / a b)^2
    assert np.sort_complex(loose.modes().poles) == pytest.approx(np.repeat(np.sort_complex(alone.poles), 4), rel=1e-6)


@pytest.mark.parametrize("mode", [TORSION, BENDING], ids=["torsion", "bending"])
def test_a_free_body_has_the_mode_of_the_file(mode) -> None:
    modes = without_suspension(car(mode)).modes()
    (row,) = [row for row, label in enumerate(modes.labels) if label == mode["shape"]]
    assert modes.natural_frequency[row] == pytest.approx(mode["frequency"], rel=1e-9)
    assert modes.damping_ratio[row] == pytest.approx(mode["damping_ratio"], rel=1e-9)


def test_torsion_with_everything_else_held_still() -> None:
    """sqrt((m w^2 + 4 k) / m): each of the four springs is stretched by 1."""
    system = structure(car({**TORSION, "mass": 500.0})).system
    stiffness, damping = system.stiffness[-1, -1], system.damping[-1, -1]
    assert stiffness == pytest.approx(500 * (2 * np.pi * 22) ** 2 + 4 * 30e3, rel=1e-12)
    assert damping == pytest.approx(2 * 0.03 * 2 * np.pi * 22 * 500 + 4 * 1500, rel=1e-12)
    assert system.mass[-1, -1] == 500.0
    np.testing.assert_array_equal(system.stiffness, system.stiffness.T)


def test_bending_is_orthogonal_to_bounce_and_pitch_of_an_even_beam() -> None:
    """Integrals of the shape over a beam whose radius of gyration is that of the body; the modal mass is 0.8 m."""
    vehicle = car(BENDING)
    (shape,) = structure(vehicle).shapes
    places, weights = np.polynomial.legendre.leggauss(5)
    length = 2 * np.sqrt(3) * A
    values = np.array([shape.deflection(x * length / 2, 0.0) for x in places])
    assert weights @ values == pytest.approx(0.0, abs=1e-12)
    assert weights @ (values * places) == pytest.approx(0.0, abs=1e-12)
    assert MASS * weights @ values**2 / 2 == pytest.approx(modal_mass(vehicle, vehicle.flexible_mode[0]))
    assert shape.deflection(0.0, 0.5) == 1.0


def test_a_stiff_body_is_a_rigid_one() -> None:
    stiff = car({**TORSION, "frequency": 2000.0}, {**BENDING, "frequency": 2000.0}, sensors=corner_sensors())
    frequencies = [0.5, 2.0, 12.0, 20.0]
    rigid = frequency_response(structure(car(sensors=corner_sensors())), frequencies)
    np.testing.assert_allclose(
        frequency_response(structure(stiff), frequencies), rigid, atol=2e-3 * np.abs(rigid).max()
    )


def corner_sensors(quantity="acceleration"):
    """A sensor above every wheel."""
    places = [(x, y, 0.0) for x in (A, -A) for y in (B, -B)]
    return [
        {"channel": name, "quantity": quantity, "unit": {"displacement": "m"}.get(quantity, "m/s^2")}
        | {"position": place, "direction": UP}
        for name, place in zip(corner_names(2), places, strict=True)
    ]


def test_sensors_see_the_slope_of_the_body() -> None:
    """Rotations are derivatives of the displacement, which also move a sensor above or below the body's middle."""
    x, y, h, step = 0.6, -0.4, 0.3, 1e-6
    at = {
        "z": {"quantity": "displacement", "unit": "m", "position": (x, y, 0.0), "direction": UP},
        "z_ahead": {"quantity": "displacement", "unit": "m", "position": (x + step, y, 0.0), "direction": UP},
        "z_left": {"quantity": "displacement", "unit": "m", "position": (x, y + step, 0.0), "direction": UP},
        "pitch": {"quantity": "angle", "unit": "rad", "position": (x, y, 0.0), "direction": (0.0, 1.0, 0.0)},
        "roll": {"quantity": "angle", "unit": "rad", "position": (x, y, 0.0), "direction": (1.0, 0.0, 0.0)},
        "ahead": {"quantity": "displacement", "unit": "m", "position": (x, y, h), "direction": (1.0, 0.0, 0.0)},
        "left": {"quantity": "displacement", "unit": "m", "position": (x, y, h), "direction": (0.0, 1.0, 0.0)},
    }
    vehicle = car(TORSION, BENDING, sensors=[{"channel": name, **fields} for name, fields in at.items()])
    rows = dict(zip(at, structure(vehicle).outputs.displacement, strict=True))
    assert rows["pitch"] == pytest.approx(-(rows["z_ahead"] - rows["z"]) / step, abs=1e-5)
    assert rows["roll"] == pytest.approx((rows["z_left"] - rows["z"]) / step, abs=1e-5)
    assert rows["ahead"] == pytest.approx(h * rows["pitch"])
    assert rows["left"] == pytest.approx(-h * rows["roll"])


def test_four_travels_are_body_less_wheel() -> None:
    wheels = [
        {"channel": f"wheel_{name}", "quantity": "displacement", "unit": "m", "on": f"wheel_{name}"}
        for name in corner_names(2)
    ]
    travels = [
        {"channel": f"level_{name}", "quantity": "travel", "unit": "mm", "between": name} for name in corner_names(2)
    ]
    vehicle = car(TORSION, BENDING, sensors=[*corner_sensors("displacement"), *wheels, *travels])
    body, wheel, travel = np.split(frequency_response(structure(vehicle), [0.7, 2.0, 11.0, 23.0]), 3, axis=1)
    np.testing.assert_allclose(travel, body - wheel, atol=1e-12)


def test_a_skewed_body_is_that_of_its_masses() -> None:
    """Two pairs of masses, heavier front left and rear right: M = sum of m r r^T with r = [1, -x, y]."""
    heavy, light = 400.0, 300.0
    masses = {(A, B): heavy, (-A, -B): heavy, (A, -B): light, (-A, B): light}
    rows = np.array([[1.0, -x, y] for x, y in masses])
    expected = (rows.T * list(masses.values())) @ rows
    skewed = structure(car(product_of_inertia=-(heavy - light) * 2 * A * B))
    np.testing.assert_allclose(skewed.mass[:3, :3], expected, atol=1e-9)
    even = structure(car(mass=4 * light, pitch_inertia=4 * light * A**2, roll_inertia=4 * light * B**2))
    loaded = even.with_payload(heavy - light, x=A, y=B).with_payload(heavy - light, x=-A, y=-B)
    np.testing.assert_allclose(loaded.mass, skewed.mass, atol=1e-9)


def test_a_load_moves_with_the_shape_of_the_body() -> None:
    """It takes part in the torsion by its place: m (x y / a b)^2."""
    nominal = structure(car(TORSION))
    loaded = nominal.with_payload(80.0, x=-0.9, y=-0.4)
    assert loaded.mass[-1, -1] - nominal.mass[-1, -1] == pytest.approx(80 * (0.9 * 0.4 / (A * B)) ** 2)
    row = body_row(nominal.coordinates, x=-0.9, y=-0.4, shapes=nominal.shapes)
    np.testing.assert_allclose(loaded.mass - nominal.mass, 80 * np.outer(row, row))


def test_the_stiffness_of_the_body_is_a_component() -> None:
    components = structure(car({**TORSION, "mass": 500.0})).components()
    assert components[Component("body", "torsion")] == pytest.approx(500 * (2 * np.pi * 22) ** 2)
    assert components[Component("body", "torsion_damping")] == pytest.approx(2 * 0.03 * 2 * np.pi * 22 * 500)
    assert FlexibleMode(shape="torsion", frequency=22.0, damping_ratio=0.03).mass is None
