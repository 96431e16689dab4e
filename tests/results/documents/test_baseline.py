"""Documents of baselines: every field and array is read again."""

import json
from dataclasses import fields

import numpy as np
import pytest

import sprung
from sprung.errors import FormatError
from sprung.results.documents import (
    baseline_document,
    baseline_from_document,
)
from sprung.results.documents.baseline import BY_CONDITION, BaselineDocument


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
    baseline = replace(baseline, residuals=reference)
    assert same(baseline_from_document(plain(baseline_document(baseline))), baseline)


def test_every_field_of_a_baseline_is_in_its_document(baseline) -> None:
    names = {field.name for field in fields(baseline)}
    assert names - set(BY_CONDITION) == set(BaselineDocument.model_fields) - {"schema_name", "conditions", "detectable"}


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"schema": "sprung.baseline/9"}, "has the schema 'sprung.baseline/9', but must have 'sprung.baseline/1'"),
        ({"mean": "much"}, "mean is not valid"),
        ({"mean": [0.0]}, "mean of a baseline must be"),
        ({"components": ["wheel"]}, r"components\[0\].* is not valid"),
        ({"conditions": {}}, "lacks the condition"),
        ({"n_windows": None}, "n_windows is not valid"),
        ({"information": None}, "information has 0 dimensions"),
    ],
)
def test_other_documents_are_not_a_baseline(baseline, change, message) -> None:
    document = baseline_document(baseline).as_json()
    with pytest.raises(FormatError, match=message):
        baseline_from_document({**document, **change})
