import math

import pytest

from sprung.errors import ParameterError
from sprung.recording import QUANTITIES
from sprung.units import UNITS, conversion


def test_every_unit_measures_a_known_quantity() -> None:
    assert {quantity for quantity, _ in UNITS.values()} <= set(QUANTITIES)


@pytest.mark.parametrize("quantity", [name for name in QUANTITIES if name != "unknown"])
def test_si_units_have_the_factor_one(quantity) -> None:
    unit = {"strain": "strain"}.get(quantity, QUANTITIES[quantity])
    measured, factor = conversion(unit)
    assert QUANTITIES[measured] == QUANTITIES[quantity]
    assert factor == 1.0


@pytest.mark.parametrize(
    ("unit", "quantity", "factor"),
    [
        ("g", "acceleration", 9.80665),
        ("mg", "acceleration", 9.80665e-3),
        ("m/s²", "acceleration", 1.0),
        ("mps2", "acceleration", 1.0),
        ("degps", "angular_velocity", math.pi / 180),
        ("radps", "angular_velocity", 1.0),
        ("mps", "speed", 1.0),
        (" [m/s2] ", "acceleration", 1.0),
        ("m/s**2", "acceleration", 1.0),
        ("mm/s^2", "acceleration", 1e-3),
        ("deg/s", "angular_velocity", math.pi / 180),
        ("°/s", "angular_velocity", math.pi / 180),
        ("deg", "angle", math.pi / 180),
        ("rpm", "angular_velocity", math.pi / 30),
        ("km/h", "speed", 1 / 3.6),
        ("mph", "speed", 1609.344 / 3600),
        ("mm/s", "velocity", 1e-3),
        ("mm", "displacement", 1e-3),
        ("µm", "displacement", 1e-6),
        ("kN", "force", 1e3),
        ("°C", "temperature", 1.0),
        ("µm/m", "strain", 1e-6),
        ("με", "strain", 1e-6),
    ],
)
def test_conversion(unit, quantity, factor) -> None:
    measured, value = conversion(unit)
    assert measured == quantity
    assert value == pytest.approx(factor, rel=1e-15)


@pytest.mark.parametrize("unit", ["", "furlong", "Mg", "G", "kg", "m/s^3"])
def test_unknown_units_are_refused_with_the_known_ones(unit) -> None:
    with pytest.raises(ParameterError, match=r"is unknown: convert the values to one of m/s\^2, mm/s\^2") as refusal:
        conversion(unit)
    assert "\n" not in str(refusal.value)
