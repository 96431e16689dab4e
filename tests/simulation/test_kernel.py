"""Tension of an element by hand, and one step of the integration against the exponential series."""

import math
from dataclasses import replace

import numpy as np
import pytest

from sprung.simulation import ForceLaw, integrate
from sprung.vehicles import chain

pytest.importorskip("numba")

from sprung.simulation import kernel


def tension(law: ForceLaw, *, elongation=0.0, rate=0.0, bushing=0.0, behind=0.0, rubber=0.0, load=0.0):
    """Return tension and rates of an element of 1000 N/m and 50 N s/m."""
    return kernel.forces.py_func(law, elongation, rate, behind, rubber, 1000.0, 50.0, bushing, load)


@pytest.mark.parametrize(
    ("law", "motion", "expected"),
    [
        (ForceLaw(), {"elongation": 0.1, "rate": 0.2}, 100.0 + 10.0),
        (ForceLaw(cubic=10.0), {"elongation": -0.1}, -100.0 - 10.0),
        (ForceLaw(gap=0.06, stop_stiffness=1e4), {"elongation": 0.1}, 100.0 + 400.0),
        (ForceLaw(gap=0.06, stop_stiffness=1e4), {"elongation": -0.1}, -100.0 - 400.0),
        (ForceLaw(gap=0.06, stop_stiffness=1e4), {"elongation": 0.05}, 50.0),
        (ForceLaw(knee=0.1, knee_slope=0.5), {"rate": 0.3}, 50.0 * 0.2),
        (ForceLaw(knee=0.1, knee_slope=0.5), {"rate": -0.3}, -50.0 * 0.2),
        (ForceLaw(asymmetry=0.4, asymmetry_velocity=1e-9), {"rate": 0.3}, 50.0 * 0.3 * 1.4),
        (ForceLaw(asymmetry=0.4, asymmetry_velocity=1e-9), {"rate": -0.3}, -50.0 * 0.3 * 0.6),
        (ForceLaw(friction=7.0, friction_velocity=0.3), {"rate": 0.4}, 50.0 * 0.4 + 7.0 * 0.8),
        (ForceLaw(load_friction=0.1, friction_velocity=0.3), {"rate": 0.4, "load": 90.0}, 50.0 * 0.4 + 9.0 * 0.8),
        (
            ForceLaw(load_friction=0.1, friction_velocity=0.3),
            {"rate": -0.4, "load": 90.0, "elongation": -0.01},
            -10.0 - 50.0 * 0.4 - 10.0 * 0.8,
        ),
        (ForceLaw(load_friction=0.1), {"rate": 0.4, "load": 90.0, "elongation": 0.1}, 100.0 + 50.0 * 0.4),
        (ForceLaw(), {"rate": 0.2, "rubber": 3.0}, 10.0 + 3.0),
        (ForceLaw(), {"elongation": 0.1, "rate": 9.0, "bushing": 2000.0, "behind": 0.04}, 100.0 + 120.0),
    ],
)
def test_tension_of_an_element(law, motion, expected) -> None:
    assert tension(law, **motion)[0] == pytest.approx(expected)


def test_a_damper_behind_a_bushing_moves_as_its_force_over_its_damping() -> None:
    _, z_rate, _ = tension(ForceLaw(), elongation=0.1, bushing=2000.0, behind=0.04)
    assert z_rate == pytest.approx(120.0 / 50.0)


def test_rubber_follows_dahls_law() -> None:
    law = ForceLaw(rubber_stiffness=2e4, rubber_force=40.0)
    assert tension(law, rate=0.1)[2] == pytest.approx(2e4 * 0.1)
    assert tension(law, rate=0.1, rubber=40.0)[2] == pytest.approx(0.0)
    assert tension(law, rate=-0.1, rubber=40.0)[2] == pytest.approx(-2e4 * 0.1 * 2)


def test_a_step_of_a_free_mass_on_a_spring_is_the_series_to_fourth_order() -> None:
    """x(h) = cos(w h) x0 to (w h)^4 / 24, the order of the Runge-Kutta method; the rest is (w h)^6 / 720."""
    vehicle, step = chain(1, mass=1.0, stiffness=1000.0, damping=0.0), 0.004
    motion = integrate(vehicle, np.zeros((1, 2)), rate=1 / step, coordinates=[0.01])
    angle = math.sqrt(1000.0) * step
    assert motion.coordinates[0, 1] == pytest.approx(0.01 * (1 - angle**2 / 2 + angle**4 / 24), rel=1e-14)


def test_what_a_law_adds_near_rest() -> None:
    """Friction F v / sqrt(v^2 + w^2) has the slope F / w at rest; rubber its stiffness."""
    law = ForceLaw(friction=30.0, friction_velocity=0.01, rubber_stiffness=2e4, rubber_force=50.0)
    step = 1e-7
    slope = law.friction * step / np.hypot(step, law.friction_velocity) / step
    assert replace(law, load_friction=0.1).steepest(300.0)[1] == pytest.approx(2 * slope)
    assert law.steepest(1e3) == (2e4, pytest.approx(slope))
    assert law.fastest == pytest.approx(400.0)
    assert ForceLaw().steepest(1e4) == (0.0, 0.0)
