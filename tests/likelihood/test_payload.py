"""Payload as parameters of the mass matrix."""

import numpy as np
import pytest

from sprung.likelihood.payload import payload
from sprung.vehicles import structure


@pytest.mark.parametrize("place", [{"x": -1.0}, {"y": 0.4}, {}, {"x": -1.3, "y": -0.35}])
def test_a_point_mass_is_mass_moments_inertias_and_product(car, place) -> None:
    """m, m x, m y, m x^2, m y^2 and m x y in their units: the mass matrix of the structure with that payload."""
    nominal = structure(car)
    block = payload(nominal)
    x, y, mass = place.get("x", 0.0), place.get("y", 0.0), 120.0
    wanted = np.array([mass, -mass * x, mass * y, mass * x**2, mass * y**2, -mass * x * y])
    parameters = wanted / [part.unit for part in block.parts]
    expected = nominal.with_payload(mass, **place).mass
    np.testing.assert_allclose(block.fitted(parameters, nominal).mass, expected, rtol=1e-9, atol=1e-9)
    assert block.values(parameters) == pytest.approx(dict(zip(block.names, wanted, strict=True)))


def test_the_prior_is_a_fifth_of_the_body(car) -> None:
    block = payload(structure(car))
    sizes = block.values(block.prior_std)
    assert sizes["payload_mass"] == pytest.approx(0.2 * car.body.mass)
    assert sizes["payload_roll_inertia"] == pytest.approx(0.2 * car.body.roll_inertia)
    between = np.sqrt(car.body.pitch_inertia * car.body.roll_inertia)
    assert sizes["payload_product"] == pytest.approx(0.1 * between)
    assert sizes["payload_x_moment"] == pytest.approx(0.1 * np.sqrt(car.body.mass * car.body.pitch_inertia))
