"""Fleets from the command line: documents of several vehicles in, a ranking and the baseline of their type out."""

import numpy as np
import pytest

from sprung.diagnosis import Observation, diagnose
from sprung.results.documents import read_type_baseline, write_diagnosis
from sprung.vehicles import Component

COMPONENTS = tuple(
    Component(corner, kind)
    for corner in ("front_left", "front_right", "rear_left", "rear_right")
    for kind in ("spring", "damper", "tyre")
)


def write_car(path, seed, *, fault=0.0, name="van"):
    """Write the diagnosis of three windows of a vehicle without baseline."""
    generator = np.random.default_rng(seed)
    own = 0.01 * generator.standard_normal(12)
    own[3] += fault
    windows = [
        Observation(
            600.0 * number,
            COMPONENTS,
            own + 0.012 * generator.standard_normal(12),
            0.012**2 * np.eye(12),
            {"temperature": 20.0, "speed": float(generator.uniform(8, 18))},
            {},
            (),
            vehicle=name,
        )
        for number in range(3)
    ]
    path.parent.mkdir(exist_ok=True)
    write_diagnosis(diagnose(windows), path)
    return path


@pytest.fixture
def cars(tmp_path):
    return [write_car(tmp_path / f"car-{seed}.json", seed, fault=-0.25 * (seed == 4)) for seed in range(8)]


@pytest.mark.slow
def test_a_fleet_is_ranked_and_its_type_is_learnt(sprung, cars, tmp_path, monkeypatch) -> None:
    monkeypatch.setenv("COLUMNS", "160")
    outcome = sprung("fleet", "rank", *cars, "--out", tmp_path / "van.type.json")
    assert outcome.code == 0, outcome.err
    first, second = [line for line in outcome.out.splitlines() if line.startswith("car-")][:2]
    assert first.startswith("car-4")
    assert "deviates: front right spring" in first
    assert "no deviation detected" in second
    assert "learnt from 24 windows of 8 vehicles" in outcome.out
    of_type = read_type_baseline(tmp_path / "van.type.json")
    assert (of_type.name, of_type.n_vehicles) == ("van", 8)


@pytest.mark.slow
def test_the_ranking_is_a_document(sprung, cars) -> None:
    (ranking,) = sprung("fleet", "rank", *cars, "--json", "-").document()["types"]
    assert ranking["name"] == "van"
    assert [entry["vehicle"] for entry in ranking["vehicles"] if entry["deviates"]] == ["car-4"]


@pytest.mark.slow
def test_files_of_one_name_are_of_one_vehicle(sprung, cars, tmp_path) -> None:
    again = write_car(tmp_path / "tuesday" / "car-0.json", 0)
    (ranking,) = sprung("fleet", "rank", *cars, again, "--json", "-").document()["types"]
    assert {entry["vehicle"]: entry["windows"] for entry in ranking["vehicles"]}["car-0"] == 6


def test_four_vehicles_have_a_type_and_no_ranking(sprung, cars, tmp_path) -> None:
    outcome = sprung("fleet", "rank", *cars[:4], "--out", tmp_path / "van.type.json", "--json", "-")
    document = outcome.document()
    assert document["types"] == []
    assert "not ranked: 4 vehicles have usable windows, and 5 are needed" in document["notes"][0]
    assert read_type_baseline(tmp_path / "van.type.json").n_vehicles == 4
    refused = sprung("fleet", "rank", *cars[:4])
    assert refused.code == 3
    assert "5 are needed" in refused.err


def test_vehicles_of_two_types_are_refused(sprung, cars, tmp_path) -> None:
    other = write_car(tmp_path / "bus.json", 9, name="bus")
    outcome = sprung("fleet", "rank", *cars, other)
    assert outcome.code == 2
    assert "the types 'van'" in outcome.err


@pytest.mark.slow
def test_a_type_goes_with_its_vehicle_file_only(sprung, cars, tmp_path) -> None:
    path = tmp_path / "van.type.json"
    sprung("fleet", "rank", *cars, "--out", path)
    recording = tmp_path / "drive.csv"
    for command in (("baseline", "--out", tmp_path / "b.json"), ("diagnose",)):
        outcome = sprung(command[0], recording, *command[1:], "--vehicle", "zafira", "--type", path)
        assert outcome.code == 2
        assert "is the baseline of the type 'van', but the vehicle file describes 'zafira'" in outcome.err
    outcome = sprung("diagnose", recording, "--vehicle", "zafira", "--type", path, "--baseline", path)
    assert "not both" in outcome.err
    words = ("--vehicle", "zafira", "--type", path, "--calibrate", "--out", tmp_path / "b.json")
    assert "omit one" in sprung("baseline", recording, *words).err
