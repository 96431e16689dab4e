"""Elements of a structure, and what sensors on its body read."""

from dataclasses import replace

import numpy as np
import pytest

from sprung._arrays import Complex
from sprung.errors import ParameterError
from sprung.recording import Channel
from sprung.vehicles import (
    Element,
    frequency_response,
    parse_vehicle,
    sensor_outputs,
    structure,
)


@pytest.mark.parametrize(
    ("quantity", "direction", "expected"),
    [
        ("acceleration", (0, 0, 1), (1.0, -1.2, 0.7)),
        ("acceleration", (1, 0, 0), (0.0, 0.3, 0.0)),
        ("acceleration", (0, 1, 0), (0.0, 0.0, -0.3)),
        ("displacement", (0, 0, -1), (-1.0, 1.2, -0.7)),
        ("angular_velocity", (0, 1, 0), (0.0, 1.0, 0.0)),
        ("angular_velocity", (1, 0, 0), (0.0, 0.0, 1.0)),
        ("angular_velocity", (0, 0, 1), (0.0, 0.0, 0.0)),
        ("angle", (0, -1, 0), (0.0, -1.0, 0.0)),
    ],
)
def test_sensors_read_the_motion_of_a_rigid_body(quantity, direction, expected) -> None:
    sensor = Channel("s", quantity, (1.2, 0.7, 0.3), direction)
    outputs = sensor_outputs(("bounce", "pitch", "roll"), sensors=[sensor], carriers=["body"])
    rows = {"acceleration": outputs.acceleration, "angular_velocity": outputs.velocity}
    assert rows.get(quantity, outputs.displacement)[0] == pytest.approx(expected)


def test_sensor_motion_agrees_with_a_rotated_body() -> None:
    """The rows are the derivative of R r + z, with R the rotation by roll about x and pitch about y."""
    r, step = np.array([1.2, 0.7, 0.3]), 1e-6
    for pitch, roll, column in ((step, 0.0, 1), (0.0, step, 2)):
        about_y = np.array([[np.cos(pitch), 0, np.sin(pitch)], [0, 1, 0], [-np.sin(pitch), 0, np.cos(pitch)]])
        about_x = np.array([[1, 0, 0], [0, np.cos(roll), -np.sin(roll)], [0, np.sin(roll), np.cos(roll)]])
        moved = (about_y @ about_x @ r - r) / step
        for axis in range(3):
            sensor = Channel("s", "displacement", tuple(r), tuple(np.eye(3)[axis]))
            outputs = sensor_outputs(("bounce", "pitch", "roll"), sensors=[sensor], carriers=["body"])
            assert outputs.displacement[0, column] == pytest.approx(moved[axis], abs=1e-5)


def test_element_on_the_base_has_no_damper() -> None:
    with pytest.raises(ParameterError, match="damping=3 of front_left tyre must be 0"):
        Element("front_left", "tyre", np.ones(1), 10.0, 3.0, foot="road_front_left")


def test_oscillator_with_a_bushing_has_the_roots_of_its_cubic() -> None:
    m, k, c, b = 2.0, 800.0, 12.0, 500.0
    chain = structure(
        parse_vehicle({"name": "one", "kind": "chain", "mass": [{"mass": m, "stiffness": k, "damping": c}]})
    )
    bushed = replace(chain, elements=(replace(chain.elements[0], series_stiffness=b),))
    # (m s^2 + k)(c s + b) + b c s = 0
    expected = np.roots([m * c, m * b, (k + b) * c, k * b])
    assert np.sort_complex(np.linalg.eigvals(bushed.system.state_matrix())) == pytest.approx(np.sort_complex(expected))


@pytest.mark.parametrize("bushing", [None, 60e3])
def test_derivatives_of_the_dynamic_stiffness_are_finite_differences(bushing) -> None:
    element = Element("front_left", "suspension", np.ones(1), 20e3, 1500.0, series_stiffness=bushing)
    s: Complex = np.array([-3.0 + 9j, 2j, -10.0 + 60j])
    up, down = (element.dynamic_stiffness(s, damper=np.exp(step)) for step in (1e-5, -1e-5))
    assert element.damping_derivative(s) == pytest.approx((up - down) / 2e-5, rel=1e-8)
    ahead, behind = (element.dynamic_stiffness(s * (1 + step)) for step in (1e-5, -1e-5))
    assert element.damping_derivative(s) / s == pytest.approx((ahead - behind) / (2e-5 * s), rel=1e-8)
    assert element.dynamic_stiffness(s, spring=2.0) - element.dynamic_stiffness(s) == pytest.approx(20e3)


def test_a_bushing_is_in_series_with_the_damper() -> None:
    rigid = Element("front_left", "suspension", np.ones(1), 0.0, 1500.0)
    soft = Element("front_left", "suspension", np.ones(1), 0.0, 1500.0, series_stiffness=60e3)
    s = np.array([1j, 40j])
    compliance = 1 / rigid.dynamic_stiffness(s) + 1 / 60e3
    assert soft.dynamic_stiffness(s) == pytest.approx(1 / compliance, rel=1e-12)
    assert soft.dynamic_stiffness(1e9j) == pytest.approx(60e3, rel=1e-3)


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


@pytest.mark.parametrize("bushing", [None, 80e3])
def test_quarter_car_is_the_closed_form(bushing) -> None:
    f = np.array([0.1, 0.5, 1.3, 4.0, 11.0, 40.0])
    s = 2j * np.pi * f
    arm = 20e3 + 1 / (1 / (1500 * s) + (0 if bushing is None else 1 / bushing))
    expected = 200e3 * arm / ((300 * s**2 + arm) * (40 * s**2 + arm + 200e3) - arm**2)
    fields = {"unsprung_mass": 40.0, "spring_stiffness": 20e3, "damping": 1500.0, "tyre_stiffness": 200e3}
    sensor = {"channel": "z", "quantity": "displacement", "unit": "m", "direction": (0.0, 0.0, 1.0)}
    corner = fields if bushing is None else fields | {"damper_bushing_stiffness": bushing}
    described = {"name": "q", "kind": "quarter", "body": {"mass": 300.0}, "corner": corner, "sensor": [sensor]}
    quarter = structure(parse_vehicle(described))
    assert np.allclose(frequency_response(quarter, f)[:, 0, 0], expected, rtol=1e-10)
    with pytest.raises(ParameterError, match="at least 0"):
        frequency_response(quarter, [-1.0])
