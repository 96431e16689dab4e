"""The page of conformance is rendered from what tests compared, and every comparison is still one of a test."""

import os
import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def conformance() -> Any:
    sys.path.insert(0, str(ROOT))
    try:
        return import_module("benchmarks.conformance")
    finally:
        sys.path.remove(str(ROOT))


def test_the_page_is_rendered_from_the_claims(conformance: Any) -> None:
    assert (ROOT / "docs" / "conformance.md").read_text(encoding="utf-8") == conformance.page(conformance.read_claims())


def test_no_deviation_exceeds_its_tolerance(conformance: Any) -> None:
    assert [claim for claim in conformance.read_claims() if claim["deviation"] > claim["tolerance"]] == []


def test_every_claim_is_that_of_a_test(conformance: Any) -> None:
    for name in {claim["test"].partition("[")[0] for claim in conformance.read_claims()}:
        path, _, function = name.partition("::")
        assert f"def {function}(" in (ROOT / path).read_text(encoding="utf-8"), name


@pytest.mark.skipif("SPRUNG_CONFORMANCE" in os.environ, reason="claims are written anew")
def test_a_comparison_that_the_page_does_not_have_or_that_is_off_fails(conforms: Any) -> None:
    for found, words in ((1.05, "has 0 claims"), (1.2, "off by 0.2")):
        with pytest.raises(AssertionError, match=words):
            conforms("A standard", "1", "a value", found, 1.0, rel=0.1)
