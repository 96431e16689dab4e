"""JSON text of documents, and files that hold something else."""

import json

import numpy as np
import pytest

from sprung.errors import FormatError
from sprung.results.documents import (
    document_text,
)
from sprung.results.documents.document import Estimate, checked, read_fields, write_document
from sprung.results.documents.monitoring import AlertsDocument


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
