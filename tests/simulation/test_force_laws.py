"""Departures of springs and dampers from the linear law."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.simulation import REALISTIC_FORCE_LAWS, ForceLaw
from sprung.simulation.conditions import damping_factor


def test_damping_falls_by_half_a_percent_per_degree() -> None:
    assert damping_factor(20.0) == 1.0
    assert damping_factor(21.0) == pytest.approx(0.995, abs=2e-5)
    assert damping_factor(-20.0) * damping_factor(60.0) == pytest.approx(1.0)
    with pytest.raises(ParameterError, match="temperature=300 must be"):
        damping_factor(300.0)


def test_springs_of_the_realistic_suspension_harden_by_a_tenth_at_five_centimetres() -> None:
    law = REALISTIC_FORCE_LAWS["suspension"]
    elongation = 0.05
    assert (elongation + law.cubic * elongation**3) / elongation == pytest.approx(1.1)
    assert (1 + law.asymmetry) / (1 - law.asymmetry) == pytest.approx(1.35 / 0.65)


def test_what_a_law_adds_near_rest() -> None:
    """Friction F v / sqrt(v^2 + w^2) has the slope F / w at rest; rubber its stiffness."""
    law = ForceLaw(friction=30.0, friction_velocity=0.01, rubber_stiffness=2e4, rubber_force=50.0)
    step = 1e-7
    slope = law.friction * step / np.hypot(step, law.friction_velocity) / step
    assert law.steepest == (2e4, pytest.approx(slope))
    assert law.fastest == pytest.approx(400.0)
    assert ForceLaw().steepest == (0.0, 0.0)


@pytest.mark.parametrize(
    ("field", "value"),
    [("asymmetry", 1.5), ("friction", -1.0), ("friction_velocity", 0.0), ("rubber_force", 0.0), ("knee_slope", -0.1)],
)
def test_impossible_laws_are_refused(field, value) -> None:
    with pytest.raises(ParameterError, match=f"{field}={value:g} must be"):
        ForceLaw(**{field: value})
