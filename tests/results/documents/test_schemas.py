"""The JSON Schemas that come with the package."""

import json
import re
from pathlib import Path

import pytest

import sprung
from sprung.errors import FormatError, ParameterError
from sprung.results.documents import DOCUMENTS, json_schema, read_document, write_json_schemas

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
