"""`sprung report` and `sprung vehicles export`."""

import importlib.util
import json
from typing import Any

import pytest
from tests.online.monitor.history_store import VEHICLE, fill

from sprung.online.store import open_store

pandas: Any = pytest.importorskip("pandas")


@pytest.fixture(scope="module")
def store(tmp_path_factory):
    url = f"sqlite:///{tmp_path_factory.mktemp('store')}/store.sqlite"
    with open_store(url) as opened:
        fill(opened)
    return url


@pytest.mark.slow
def test_a_report_and_its_document(sprung, store, tmp_path) -> None:
    path = tmp_path / "r.html"
    outcome = sprung("report", VEHICLE, "--store", store, "--until", "2026-10-10", "--out", path)
    assert outcome.code == 0
    assert "No change detected" in " ".join(outcome.out.split())
    assert path.read_text(encoding="utf-8").startswith("<!doctype html>")
    document = sprung("report", VEHICLE, "--store", store, "--json", "-").document()
    assert document["sentence"].startswith("Front-left spring 25 %")


@pytest.mark.slow
@pytest.mark.skipif(importlib.util.find_spec("weasyprint") is None, reason="needs weasyprint")
def test_a_report_as_pdf(sprung, store, tmp_path) -> None:
    path = tmp_path / "r.pdf"
    assert sprung("report", VEHICLE, "--store", store, "--out", path).code == 0
    assert path.read_bytes().startswith(b"%PDF-")


@pytest.mark.skipif(importlib.util.find_spec("weasyprint") is not None, reason="weasyprint is installed")
def test_a_pdf_needs_its_package(sprung, store, tmp_path) -> None:
    outcome = sprung("report", VEHICLE, "--store", store, "--out", tmp_path / "r.pdf")
    assert outcome.code == 2
    assert "a report as PDF needs the package weasyprint: install it with pip install 'sprung[pdf]'" in outcome.err
    assert not (tmp_path / "r.pdf").exists()


def test_an_export(sprung, store, tmp_path) -> None:
    path = tmp_path / "w.parquet"
    outcome = sprung("vehicles", "export", VEHICLE, "--store", store, "--out", path)
    assert outcome.code == 0, outcome.err
    assert f"wrote{path}" in "".join(outcome.out.split())
    shown = sprung("vehicles", "export", VEHICLE, "--what", "windows", "--store", store, "--json", "-").document()
    assert len(pandas.read_parquet(path)) == len(shown["rows"])
    assert sprung("vehicles", "export", VEHICLE, "--store", store, "--out", tmp_path / "w.json").code == 0
    assert json.loads((tmp_path / "w.json").read_text()) == shown


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["report", VEHICLE], "give --out FILE.html or --json PATH"),
        (["report", VEHICLE, "--out", "r.docx"], "name it r.html"),
        (["report", "none", "--json", "-"], "unknown vehicle 'none'"),
        (["report", VEHICLE, "--since", "soon", "--json", "-"], "since='soon' must be a date or time"),
        (["vehicles", "export", VEHICLE], "give --out FILE or --json PATH"),
        (["vehicles", "export", VEHICLE, "--out", "w.xls"], "must end in .csv, .parquet, .json"),
        (["vehicles", "export", "none", "--out", "w.csv"], "unknown vehicle 'none'"),
    ],
)
def test_bad_usage_is_named_in_one_line(sprung, store, words, message, tmp_path) -> None:
    words = [tmp_path / word if "." in word else word for word in words]
    outcome = sprung(*words, "--store", store)
    assert outcome.code == 2
    assert message in outcome.err
    assert outcome.err.count("\n") == 1
    assert list(tmp_path.iterdir()) == []
