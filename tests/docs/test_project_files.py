"""Files for people who join or cite: the version of the citation, and forms of issues that can be shown."""

from pathlib import Path

import pytest
import yaml

import sprung

REPOSITORY = Path(__file__).parents[2]
FORMS = sorted(path for path in (REPOSITORY / ".github" / "ISSUE_TEMPLATE").glob("*.yml") if path.stem != "config")


def test_citation_has_the_version() -> None:
    citation = yaml.safe_load((REPOSITORY / "CITATION.cff").read_text(encoding="utf-8"))
    assert citation["version"] == sprung.__version__
    assert citation["license"] == "BSD-3-Clause"


def test_there_are_forms() -> None:
    assert len(FORMS) == 4


@pytest.mark.parametrize("path", FORMS, ids=lambda path: path.stem)
def test_forms_can_be_shown(path) -> None:
    form = yaml.safe_load(path.read_text(encoding="utf-8"))
    assert {"name", "description", "body"} <= form.keys()
    for field in form["body"]:
        assert field["type"] in {"textarea", "input", "dropdown", "markdown"}
        assert field["attributes"]["label"]
