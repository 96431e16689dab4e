"""Documents of types and fleets: every field is read again."""

import json
from dataclasses import fields, replace

import numpy as np
import pytest

from sprung.diagnosis import TypeBaseline, learn_type, rank_fleet
from sprung.errors import FormatError
from sprung.results.documents import (
    fleet_document,
    read_document,
    read_type_baseline,
    type_baseline_document,
    type_baseline_from_document,
    write_type_baseline,
)
from sprung.results.documents.baseline import BY_CONDITION, TypeBaselineDocument


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
    assert names - set(BY_CONDITION) == set(TypeBaselineDocument.model_fields) - {"schema_name", "conditions"}


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
