"""Documents of baselines."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest

import sprung
from sprung.diagnosis import TypeBaseline, learn_type, rank_fleet
from sprung.errors import FormatError
from sprung.results.documents import (
    baseline_document,
    baseline_from_document,
    fleet_document,
    read_document,
    read_type_baseline,
    type_baseline_document,
    type_baseline_from_document,
    write_type_baseline,
)
from sprung.results.documents.diagnosis import BaselineDocument, TypeBaselineDocument
from sprung.vehicles import Component

#: Fields of a baseline that its document lists by condition.
BY_CONDITION = {"slopes", "centre", "ranges"}


def test_a_baseline_is_read_as_it_was_written(baseline, check_document, tmp_path, same) -> None:
    sprung.write_baseline(baseline, tmp_path / "baseline.json")
    assert same(sprung.read_baseline(tmp_path / "baseline.json"), baseline)
    check_document(json.loads((tmp_path / "baseline.json").read_text()))


def test_a_residual_reference_is_read_as_it_was_written(baseline, plain, same) -> None:
    from dataclasses import replace

    generator = np.random.default_rng(2)
    reference = sprung.diagnosis.ResidualReference(
        ("a", "b"), 25.0, 2.0, generator.standard_normal((4, 2)), generator.standard_normal((3, 4)), 0.1, 0.2, 5
    )
    parts = tuple(Component(corner, "spring") for corner in ("front_left", "front_right"))
    covariance = np.array([[1e-4, 2e-5], [2e-5, 3e-4]])
    stiffening = sprung.Observation(600.0, parts, np.array([0.2, 0.01]), covariance, {"speed": 12.0}, {}, ())
    baseline = replace(baseline, residuals=reference, stiffenings=(stiffening,))
    assert same(baseline_from_document(plain(baseline_document(baseline))), baseline)


def test_every_field_of_a_baseline_is_in_its_document(baseline) -> None:
    names = {field.name for field in fields(baseline)}
    assert names - {"slopes", "centre", "ranges"} == set(BaselineDocument.model_fields) - {
        "schema_name",
        "conditions",
        "detectable",
    }


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": "sprung.baseline/9"}, "has the schema 'sprung.baseline/9', but must have 'sprung.baseline/1'"),
        ({"mean": "much"}, "mean is not valid"),
        ({"mean": [0.0]}, "mean of a baseline must be"),
        ({"components": ["wheel"]}, r"components\[0\].* is not valid"),
        ({"conditions": {}}, "lacks the condition"),
        ({"n_windows": None}, "n_windows is not valid"),
        ({"information": None}, r"information has \d dimensions"),
    ],
)
def test_other_documents_are_not_a_baseline(baseline, change, message) -> None:
    document = baseline_document(baseline).as_json()
    with pytest.raises(FormatError, match=message):
        baseline_from_document({**document, **change})


@pytest.fixture(scope="module")
def vehicles(observations):
    """Six vehicles with two windows each; the last one has a softer spring."""
    healthy = observations[:8]
    generator = np.random.default_rng(3)
    fleet = {}
    for number in range(6):
        own = 0.01 * generator.standard_normal(12)
        own[0] -= 0.4 * (number == 5)
        windows = healthy[number : number + 2]
        fleet[f"car-{number}"] = [replace(window, log_ratios=window.log_ratios + own) for window in windows]
    return fleet


@pytest.fixture(scope="module")
def of_type(vehicles) -> TypeBaseline:
    return learn_type(vehicles)


def test_a_type_is_read_as_it_was_written(of_type, check_document, tmp_path, same) -> None:
    write_type_baseline(of_type, tmp_path / "type.json")
    assert same(read_type_baseline(tmp_path / "type.json"), of_type)
    check_document(json.loads((tmp_path / "type.json").read_text()))
    assert isinstance(read_document(tmp_path / "type.json"), TypeBaselineDocument)


def test_every_field_of_a_type_is_in_its_document(of_type) -> None:
    names = {field.name for field in fields(of_type)}
    assert names - BY_CONDITION == set(TypeBaselineDocument.model_fields) - {
        "schema_name",
        "conditions",
    }


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": "sprung.baseline/1"}, "has the schema 'sprung.baseline/1', but must have 'sprung.type_baseline/1'"),
        ({"between": [[1.0]]}, "between of a type's baseline must be"),
        ({"n_vehicles": -1}, "n_vehicles is not valid"),
        ({"conditions": {}}, "lacks the condition"),
    ],
)
def test_other_documents_are_not_a_type(of_type, change, message) -> None:
    document = type_baseline_document(of_type).as_json()
    with pytest.raises(FormatError, match=message):
        type_baseline_from_document({**document, **change})


def test_a_ranking_names_vehicle_part_and_size(vehicles, check_document) -> None:
    document = fleet_document([("car", rank_fleet(vehicles))], rate=0.05, notes=("a note",)).as_json()
    check_document(document)
    (ranking,) = document["types"]
    first, second = ranking["vehicles"][:2]
    assert (first["vehicle"], first["part"], first["deviates"], first["windows"]) == (
        "car-5",
        "front_left.spring",
        True,
        2,
    )
    assert first["interval"][0] < np.expm1(-0.4) < first["interval"][1]
    assert first["p_value"] < 0.01 < second["p_value"]
    assert not second["deviates"]
