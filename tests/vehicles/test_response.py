import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.vehicles import frequency_response, parse_vehicle, read_vehicle, structure


def quarter(**corner):
    fields = {"unsprung_mass": 40.0, "spring_stiffness": 20e3, "damping": 1500.0, "tyre_stiffness": 200e3, **corner}
    sensor = {
        "channel": "z",
        "quantity": "displacement",
        "unit": "m",
        "on": "body",
        "position": (0.0, 0.0, 0.0),
        "direction": (0.0, 0.0, 1.0),
    }
    return structure(
        parse_vehicle({"name": "q", "kind": "quarter", "body": {"mass": 300.0}, "corner": fields, "sensor": [sensor]})
    )


def test_quarter_car_is_the_closed_form() -> None:
    f = np.array([0.0, 0.5, 1.3, 4.0, 11.0, 40.0])
    s = 2j * np.pi * f
    arm = 20e3 + 1500 * s
    expected = 200e3 * arm / ((300 * s**2 + arm) * (40 * s**2 + arm + 200e3) - arm**2)
    assert np.allclose(frequency_response(quarter(), f)[:, 0, 0], expected, rtol=1e-10)


def test_quarter_car_with_bushing_is_the_closed_form() -> None:
    f = np.array([0.1, 1.3, 4.0, 11.0, 40.0])
    s = 2j * np.pi * f
    arm = 20e3 + 1 / (1 / (1500 * s) + 1 / 80e3)
    expected = 200e3 * arm / ((300 * s**2 + arm) * (40 * s**2 + arm + 200e3) - arm**2)
    found = frequency_response(quarter(damper_bushing_stiffness=80e3), f)[:, 0, 0]
    assert np.allclose(found, expected, rtol=1e-10)


def test_body_follows_a_slow_road() -> None:
    car = structure(read_vehicle("zafira"))
    slow = frequency_response(car, [1e-3])[0] / -((2e-3 * np.pi) ** 2)
    assert np.allclose(slow.sum(axis=1), 1, atol=1e-4)  # all wheels lifted by 1 m lift every corner by 1 m


def test_impossible_frequencies_are_refused() -> None:
    with pytest.raises(ParameterError, match="at least 0"):
        frequency_response(quarter(), [-1.0])
