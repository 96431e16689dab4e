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


def test_report_without_modes_says_why(sprung, tmp_path) -> None:
    generator = np.random.default_rng(1)
    run = tmp_path / "noise.csv"
    np.savetxt(run, generator.standard_normal((20000, 2)), delimiter=",", header="a,b", comments="")
    outcome = sprung("identify", run, "--sampling-rate", 100, "--report", tmp_path / "r.html")
    assert outcome.code == 3
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "No mode found" in page
    assert document_of(page)["modes"] == []


@pytest.mark.slow
def test_report_of_modes_over_time(sprung, chain, tmp_path) -> None:
    assert sprung("track", chain, "--window", 40, "--report", tmp_path / "t.html").code == 0
    page = (tmp_path / "t.html").read_text(encoding="utf-8")
    assert re.search(r"3 modes followed over 3 windows with modes, of 3: (6.9|7.0)\d* Hz, ", page)
    assert document_of(page)["schema"] == "sprung.track/1"
    assert sprung("identify", chain, "--json", tmp_path / "i.json").code == 0
    assert sprung("track", tmp_path / "i.json", "--report", tmp_path / "t.html").code == 0
    assert "Modes over time: i.json" in (tmp_path / "t.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def drive(tmp_path_factory):
    """Four minutes of a car with a soft spring."""
    from sprung.cli import main

    path = tmp_path_factory.mktemp("drive") / "d.parquet"
    words = ["simulate", "road", "--vehicle", "zafira", "--minutes", "4", "--fault", "front_left.spring=-0.4"]
    assert main([*words, "--seed", "1", "--out", str(path)]) == 0
    return path


@pytest.mark.slow
def test_reports_of_corners_and_diagnosis(sprung, drive, tmp_path) -> None:
    vehicle = f"{drive}.vehicle.toml"
    page = tmp_path / "p.html"
    assert sprung("corners", drive, "--vehicle", vehicle, "--report", page).code == 0
    text = page.read_text(encoding="utf-8")
    assert re.search(r"Different from the vehicle file: front left spring -[34]\d", text)
    assert text.count("data:image/png;base64") == 3
    assert "vehicle: " in text
    outcome = sprung("diagnose", drive, "--vehicle", vehicle, "--window", 2, "--report", page)
    assert outcome.code == 0
    text = page.read_text(encoding="utf-8")
    assert "Diagnosis of zafira" in text
    assert "Front-left spring" in text
    assert "2 of 2 windows were usable." in text
    assert "This vehicle has no baseline" in text
    assert outcome.check_document(document_of(text))["verdict"] == "change"


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
