"""Truth of a simulated recording against published and closed-form modes."""

import json

import pytest

from sprung.simulation import truth
from sprung.vehicles import chain, read_description, structure


def test_truth_of_the_chain() -> None:
    found = json.loads(json.dumps(truth(chain(), seed=5)))
    assert found["schema"] == "sprung.truth/1"
    assert found["seed"] == 5
    assert [round(mode["natural_frequency"], 2) for mode in found["modes"]] == [7.01, 19.65, 28.39]
    assert [round(100 * mode["damping_ratio"], 2) for mode in found["modes"]] == [1.12, 3.15, 4.55]
    assert found["modes"][0]["mode_shape"]["real"][2] == pytest.approx(1.0)
    assert found["components"]["mass_2"] == {"spring": {"value": 9800.0}, "damper": {"value": 5.0}}
    assert found["faults"] == {}


def test_truth_of_the_quarter_vehicle() -> None:
    found = truth(structure(read_description("quarter")))
    assert [mode["label"] for mode in found["modes"]] == ["bounce", "wheel_hop"]
    expected = {"spring": {"value": 7557.1}, "damper": {"value": 26.557}, "tyre": {"value": 75846.0}}
    assert found["components"] == {"corner": expected}
