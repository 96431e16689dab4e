"""Reports of results: everything is on the page, nothing on it is interpreted, and it needs no network."""

import json
import re
from html import unescape

import numpy as np
import pytest

from sprung import read, write
from sprung.recording import Channel

HOSTILE = "<img src=x onerror=alert(1)>$\\frac{&amp;'\""


def document_of(page):
    """Return the JSON document embedded in a page, and check that the page is complete in itself."""
    assert page.startswith("<!doctype html>")
    assert page.rstrip().endswith("</html>")
    assert not re.search(r"https?:|<link|src=\"(?!data:)|@import|url\(", page)
    (text,) = re.findall(r'<script type="application/json" id="result">(.*?)</script>', page, flags=re.DOTALL)
    return json.loads(text)


@pytest.mark.slow
def test_report_of_an_identification(sprung, chain, tmp_path) -> None:
    path = tmp_path / "modes.html"
    outcome = sprung("identify", chain, "--report", path, "--json", tmp_path / "m.json")
    assert outcome.code == 0
    assert f"wrote{path}" in "".join(outcome.out.split())
    assert f"wrote{tmp_path / 'm.json'}" in "".join(outcome.out.split())
    page = path.read_text(encoding="utf-8")
    assert outcome.check_document(document_of(page)) == json.loads((tmp_path / "m.json").read_text())
    assert "Modes of run.csv" in page
    assert re.search(r"3 modes found: (6.9|7.0)\d* Hz \(", page)
    assert page.count("data:image/png;base64") == 5
    for text in (
        "No channel shows a fault",
        "acc_1",
        "m/s^2",
        "block rows",
        "24000 samples at 200 Hz",
        "sprung 0.",
        "What this",
    ):
        assert text in page


@pytest.mark.slow
def test_hostile_names_stay_text_and_faults_are_named(sprung, chain, tmp_path) -> None:
    run = read(chain)
    names = (HOSTILE, "</script><script>alert(2)</script>", "c")
    samples = run.samples.copy()
    samples[2] = np.clip(samples[2], -1.0, 1.0)
    channels = tuple(Channel(name, "acceleration") for name in names)
    hostile = run.changed("renamed and clipped", channels=channels, samples=samples)
    path = tmp_path / "a&b $x_{1}$ <b>.npz"
    write(hostile, path)
    outcome = sprung("identify", path, "--report", tmp_path / "r.html")
    assert outcome.code == 0, outcome.err
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert document_of(page)["channels"] == list(names)
    assert page.count("<script") == 1
    assert "<img src=x" not in page
    assert "<b>" not in page
    assert HOSTILE in unescape(page)
    assert re.search(r"<li>c: clipped [\d.]+ %</li>", page)
    assert "No channel shows a fault" not in page


def test_report_must_be_a_file_of_its_own(sprung, chain, tmp_path) -> None:
    for path, message in (
        (chain, "--report"),
        (tmp_path, "is a folder"),
        (tmp_path / "none" / "r.html", "does not exist: create it"),
    ):
        outcome = sprung("identify", chain, "--report", path)
        assert outcome.code == 2
        assert message in outcome.err


@pytest.mark.parametrize("name", ["r.pdf", "r", "r.docx"])
def test_a_report_that_is_no_html_file_is_refused(sprung, chain, tmp_path, name) -> None:
    outcome = sprung("identify", chain, "--report", tmp_path / name)
    assert outcome.code == 2
    assert outcome.err == f"sprung: --report {tmp_path / name} must be an HTML file: name it r.html\n"
    assert not (tmp_path / name).exists()
