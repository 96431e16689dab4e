"""All documents: their schemas and files."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import sprung
from sprung.errors import FormatError, ParameterError
from sprung.results.documents import DOCUMENTS, document_text, json_schema, read_document, write_json_schemas
from sprung.results.documents.document import Estimate, checked, read_fields, write_document
from sprung.results.documents.monitoring import AlertsDocument

SHIPPED = Path(sprung.__file__).parent / "results" / "documents" / "json_schemas"
REFERENCE = (Path(__file__).parents[3] / "docs" / "json.md").read_text(encoding="utf-8")


def test_shipped_schemas_are_those_of_the_models(tmp_path) -> None:
    write_json_schemas(tmp_path)
    assert {path.name for path in SHIPPED.iterdir()} == {path.name for path in tmp_path.iterdir()}
    for path in tmp_path.iterdir():
        assert path.read_text() == (SHIPPED / path.name).read_text(), (
            f"{path.name}: write it again with sprung.results.documents.write_json_schemas({str(SHIPPED)!r})"
        )


@pytest.mark.parametrize("name", DOCUMENTS)
def test_every_schema_names_its_document(name) -> None:
    schema = json_schema(name)
    assert schema["$id"] == schema["properties"]["schema"]["const"] == name
    assert "schema" in schema["required"]


def keys(schema):
    """Yield the keys of all objects in a JSON Schema."""
    for part in (schema, *schema.get("$defs", {}).values()):
        yield from part.get("properties", {})


@pytest.mark.parametrize("name", sorted(set(DOCUMENTS) - {"sprung.reproduction/1"}))
def test_every_key_is_in_the_reference(name) -> None:
    words = set(re.findall(r"[a-z_0-9]+", " ".join(re.findall(r"`[^`]+`|```json.*?```", REFERENCE, flags=re.DOTALL))))
    missing = set(keys(json_schema(name))) - words
    assert not missing


def test_unknown_schemas_are_refused(tmp_path) -> None:
    with pytest.raises(ParameterError, match=r"schema 'sprung.modes/1' is not one of sprung.accounts/1, "):
        json_schema("sprung.modes/1")
    path = tmp_path / "document.json"
    for text, message in (
        ('{"schema": "sprung.modes/1"}', "has the schema 'sprung.modes/1', which is not one of"),
        ('{"schema": ["a"]}', r"has the schema \['a'\]"),
        ("[1]", "does not hold a JSON object"),
        ("x", "is not valid JSON"),
        ("[" * 100_000, "is not valid JSON"),
        (json.dumps({"schema": "sprung.alerts/1"}), r"alerts is not valid \(Field required\)"),
        (json.dumps({"schema": "sprung.alerts/1", "alerts": [{"number": "x"}]}), r"alerts\[0\].number is not valid"),
    ):
        path.write_text(text)
        with pytest.raises(FormatError, match=message):
            read_document(path)
    with pytest.raises(ParameterError, match="No such file"):
        read_document(tmp_path / "missing.json")


def test_a_checker_that_passes_everything_would_be_noticed(check_document) -> None:
    alert = {"number": 1, "history": [], "schema": "sprung.alert-history/1"}
    check_document(alert)
    changes: list[dict[str, object]] = [
        {"number": "1"},
        {"number": None},
        {"history": {}},
        {"further": 1},
        {"history": [{}]},
    ]
    for change in changes:
        with pytest.raises(AssertionError):
            check_document({**alert, **change})


def test_what_is_not_finite_is_null() -> None:
    values = {"a": np.nan, "b": [np.inf, np.float64(1.5)], "c": np.array([[1.0, np.nan]]), "d": (np.int64(3), None)}
    assert json.loads(document_text(values)) == {"a": None, "b": [None, 1.5], "c": [[1.0, None]], "d": [3, None]}
    assert json.loads(document_text({"a": np.bool_(True)})) == {"a": True}


def test_a_written_document_is_read_with_its_keys_in_their_order(tmp_path) -> None:
    fields = {"schema": "sprung.x/1", "b": 1.5, "a": [None, "é"], "c": {"d": True}}
    path = tmp_path / "x.json"
    write_document(fields, path)
    assert read_fields(path) == fields
    assert list(read_fields(path)) == list(fields)
    write_document({"schema": "sprung.x/1"}, path)
    assert read_fields(path) == {"schema": "sprung.x/1"}


def test_null_stands_for_a_number_that_is_unknown() -> None:
    estimate = Estimate.model_validate({"value": 2.0, "std": None})
    assert np.isnan(estimate.std)
    assert estimate.as_json() == {"value": 2.0, "std": None}


def test_keys_that_are_not_known_are_ignored() -> None:
    """A document of the same schema may gain keys."""
    fields = {"schema": "sprung.alerts/1", "alerts": []}
    assert checked(AlertsDocument, {**fields, "further": 3}, source="the alerts").as_json() == fields
    with pytest.raises(FormatError, match=r"the alerts has the schema 'sprung\.alerts/2', but must have"):
        checked(AlertsDocument, {**fields, "schema": "sprung.alerts/2"}, source="the alerts")
