"""Every page has the tables and figures it is to have; theory meets the printed digits; main claims hold."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pytest
from tests.conftest import once

from sprung.reproduce import chapter, chapter_4, chapter_5, chapter_6, chapter_7, chapter_8, comparison, reproduce
from sprung.reproduce.chapter import over_seeds
from sprung.reproduce.thesis import BODY_MODES, published, theoretical
from sprung.vehicles import read_description, read_vehicle, structure


def figures(first, last, chapter):
    return [f"Figure {chapter}-{number}" for number in range(first, last + 1)]


WANTED = {
    "4": ["Table 4-1", "Table 4-2", "Table 4-3", "Table 4-4", *figures(4, 14, 4)],
    "5": figures(4, 16, 5),
    "6": ["Table 6-2", "Figure 6-7", *figures(13, 15, 6), *figures(18, 20, 6), *figures(24, 29, 6)],
    "7": ["Figure 7-7", *figures(9, 17, 7)],
    "8": ["Figure 8-3", *figures(9, 15, 8)],
    "comparison": ["Case: white", "Case: in-band", "Case: level", "Case: nonlinear"],
}


#: Records of a set in place of 3 to 20: pages have the same contents, and the claims hold as well.
FEWER = {chapter_4: 6, chapter_5: 3, chapter_6: 1, chapter_7: 1, chapter_8: 4}


@pytest.fixture
def _less_to_compute(monkeypatch: pytest.MonkeyPatch) -> None:
    """Fewer records, and those that the figures show are also those of the experiment."""
    for module, n_records in FEWER.items():
        for name in {"SETUP", "FAST", "PLATE", "CAR"} & vars(module).keys():
            monkeypatch.setattr(module, name, replace(getattr(module, name), n_records=n_records))
        for name in {"records", "plate_records", "car_records", "acs_ssi", "coss_ssi"} & vars(module).keys():
            monkeypatch.setattr(module, name, once(getattr(module, name)))
        if hasattr(module, "SUBSPACE_METHODS"):
            methods = {name: once(method) for name, method in module.SUBSPACE_METHODS.items()}
            monkeypatch.setattr(module, "SUBSPACE_METHODS", methods)


@cache
def result(experiment):
    """What an experiment gives for the set of records of the figures, which its page and the claims below share."""
    return experiment(0)


def noise_in_the_band_hides_what_white_noise_does_not() -> None:
    """Thesis' settings, SNR 0.5: Cov-SSI finds all modes in white noise and loses some with noise in their band."""
    found = np.isfinite(result(chapter_4.experiment)[1, :, 0, 0, 0])
    assert found[0].all()
    assert not found[1].all()


def editing_brings_the_lost_mode_back() -> None:
    found = result(chapter_5.experiment)[:, 0]
    assert np.isnan(found[3, 0])
    assert found[5] == pytest.approx([13.21, 56.35], rel=0.03)


def raw_rig_signals_show_no_mode_and_edited_ones_do() -> None:
    raw, edited = result(chapter_8.experiment)[:, 0]
    assert np.isnan(raw).all()
    assert np.isfinite(edited).sum() >= 1


def rubber_softens_with_the_level_and_nothing_else_does() -> None:
    """The frequency of mode 1 falls from the lowest to the highest subset with rubber, by default settings."""
    results = result(comparison.experiment)
    change = results[:, 1, 2, 5, 0] / results[:, 1, 2, 4, 0] - 1
    assert change[3] < -0.01
    assert np.abs(change[:3]).max() < 0.005


#: Main claim of a chapter, about the experiment that its page shows.
CLAIMS = {
    "4": noise_in_the_band_hides_what_white_noise_does_not,
    "5": editing_brings_the_lost_mode_back,
    "8": raw_rig_signals_show_no_mode_and_edited_ones_do,
    "comparison": rubber_softens_with_the_level_and_nothing_else_does,
}


@pytest.mark.slow
@pytest.mark.usefixtures("_less_to_compute")
@pytest.mark.parametrize("name", WANTED)
def test_page_has_every_table_and_figure_and_its_claim_holds(tmp_path, monkeypatch: pytest.MonkeyPatch, name) -> None:
    said = []
    monkeypatch.setattr(
        chapter,
        "over_seeds",
        lambda experiment, *seeds, **how: over_seeds(lambda seed: result(experiment), *seeds, **how),
    )
    (path,) = reproduce([name], directory=tmp_path, n_seeds=2, n_processes=1, on_progress=lambda *x: said.append(x))
    page = path.read_text(encoding="utf-8")
    missing = [title for title in WANTED[name] if not re.search(rf"{re.escape(title)}\b", page)]
    assert not missing
    assert "http:" not in page
    assert "https:" not in page
    assert "nan" not in re.sub(r"base64,[^\"]*", "", page).lower().replace("resonance", "").split()
    images = re.findall(r"base64,([^\"]*)", page)
    assert min(map(len, images), default=0) > 5000
    assert said[-1][1] == 1.0
    CLAIMS.get(name, lambda: None)()


@pytest.mark.parametrize(
    ("name", "vehicle", "frequency", "damping"),
    [
        ("4", lambda: theoretical(structure(read_description("chain3"))), {"absolute": 0.005}, {"absolute": 0.005}),
        (
            "6",
            lambda: theoretical(structure(read_vehicle("zafira")), labels=BODY_MODES),
            {"rel": 0.015},
            {"rel": 0.015},
        ),
        ("7", lambda: theoretical(chapter_7.bogie("normal"), labels=BODY_MODES), {"rel": 0.005}, {"rel": 0.006}),
    ],
)
def test_theory_meets_the_printed_numbers(name, vehicle, frequency, damping, conforms) -> None:
    printed = published(name)["theory"]
    modes = vehicle()
    compared = (
        ("natural frequencies", modes.natural_frequency, printed["frequency"], frequency, "Hz"),
        ("damping ratios", 100 * modes.damping_ratio, printed["damping"], damping, "%"),
    )
    for what, found, expected, tolerance, unit in compared:
        conforms("F. Liu (2020)", f"chapter {name}", f"theoretical {what}", found, expected, unit=unit, **tolerance)
