"""The page of results says what the results say."""

import sys
from importlib import import_module
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def validation() -> Any:
    sys.path.insert(0, str(ROOT))
    try:
        return import_module("benchmarks.validation")
    finally:
        sys.path.remove(str(ROOT))


def test_the_page_is_rendered_from_the_results(validation: Any) -> None:
    assert (ROOT / "docs" / "validation.md").read_text(encoding="utf-8") == validation.page()


def test_intervals_of_shares_are_exact(validation: Any) -> None:
    """Clopper and Pearson: 0 of 10 is at most 1 - 0.025^(1/10) = 30.8 %; 5 of 10 is 18.7 to 81.3 %."""
    assert validation.share(0, 10) == "0 of 10 (0 to 31 %)"
    assert validation.share(5, 10) == "5 of 10 (19 to 81 %)"


def test_the_interval_of_a_root_mean_square_is_that_of_chi_square(validation: Any) -> None:
    """20 errors of size 2: 2 sqrt(20 / 34.17) to 2 sqrt(20 / 9.591)."""
    assert validation.rms([2.0, -2.0] * 10) == "2 (1.53 to 2.89)"


def test_scores_are_counted_by_record_and_package(validation: Any) -> None:
    score = {"record": "a", "n_certified": 3, "n_found": 2, "n_spurious": 1, "n_within": 1, "corner_errors": [1.0, 4.0]}
    document = {
        "command": "the command",
        "versions": {"sprung": "1", "other": "2"},
        "scores": [
            score | {"package": "sprung", "errors": [1.0, -1.0]},
            score | {"package": "other", "errors": [], "n_within": 0, "corner_errors": []},
        ],
    }
    text = validation.certified(document)
    assert "| a | 1 of 3 (1 to 91 %) | 0 of 3 (0 to 71 %) |" in text
    assert "| a | 3 | 2 | 1 | 1 (0.521 to 6.28) | 2 | 1 | - |" in text
    assert "1 of 2 (1 to 99 %) within three bounds" in text
