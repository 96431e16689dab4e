"""Documents of fits and calibrations."""

import json

import numpy as np
import pytest

import sprung
from sprung.calibration import CalibratedNumber, Calibration
from sprung.results import tables
from sprung.results.documents import (
    calibration_document,
    corners_document,
    document_text,
    read_document,
)
from sprung.results.figures import learnt_figure, misfit_figure
from sprung.vehicles import Component, read_vehicle


@pytest.fixture(scope="module")
def fit(drive):
    return sprung.fit_corners(drive.recording, sprung.read_vehicle("zafira"))


def test_corners_are_read_as_they_were_written(fit, plain, tmp_path) -> None:
    sprung.write_corners(fit, tmp_path / "corners.json")
    document = sprung.read_corners(tmp_path / "corners.json")
    written = plain(corners_document(fit))
    assert plain(document) == written
    spring = document.corners["front_left"]["spring"]
    assert spring.value == fit.values[fit.components.index(Component("front_left", "spring"))]
    assert "from_modes" not in written["corners"]["front_left"]["spring"]
    assert np.diag(document.fit.correlation).tolist() == [1.0] * len(fit.components)


@pytest.fixture
def calibration() -> Calibration:
    """Three numbers of the shipped car, of which the file lacked one and the drives did not determine one."""
    f = np.linspace(1, 20, 39)
    numbers = (
        CalibratedNumber("acc_fl.x", "sensors", "m", 1.22, 1.3, 0.01, 0.1, True),
        CalibratedNumber("mounted_mass_1.frequency", "mounted_masses", "Hz", None, 11.0, 0.05, 3.0, True),
        CalibratedNumber("body.pitch_inertia", "body", "kg m2", 2200.0, 2190.0, 200.0, 220.0, False),
    )
    misfit = np.sin(f) * np.ones((3, 1))
    return Calibration(
        vehicle=read_vehicle("zafira"),
        learnt=numbers,
        coordinates=("bounce", "pitch", "roll"),
        frequencies=f,
        misfit_before=misfit,
        misfit_after=misfit / 5,
        model_errors_before=(0.3, 0.2),
        model_errors_after=(0.04, 0.05),
        evidence_gain=120.0,
        n_segments=(200, 180),
        notes=("a mass of 150 kg",),
    )


def test_the_document_has_all_numbers(calibration, tmp_path) -> None:
    text = document_text(calibration_document(calibration))
    fields = json.loads(text)
    assert fields["schema"] == "sprung.calibration/1"
    assert fields["learnt"][1]["nominal_value"] is None
    assert fields["learnt"][0]["value"] == 1.3
    assert np.shape(fields["misfit_after"]) == (3, 39)
    path = tmp_path / "calibration.json"
    path.write_text(text)
    assert document_text(read_document(path)) == text


def test_the_table_says_what_the_drives_told(calibration) -> None:
    rows = tables.calibration_table(calibration).rows
    assert rows[0] == ("acc_fl.x [m]", "1.22", "1.300 ± 0.010", "+0.08", "yes")
    assert rows[1][1] == "–"
    assert rows[2][3:] == ("-0.5 %", "no")
    assert tables.calibration_in_words(calibration)[0] == "model error of the windows: 30, 20 % before, 4, 5 % after"


def test_figures_show_both_misfits_and_the_numbers_that_were_told(calibration) -> None:
    axes = misfit_figure(calibration, source="drives").axes
    assert [panel.get_ylabel().split("\n")[0] for panel in axes] == ["bounce", "pitch", "roll"]
    before, after = (np.asarray(line.get_ydata(), dtype=np.float64) for line in axes[0].lines[:2])
    assert before == pytest.approx(5 * after)
    labels = [label.get_text() for label in learnt_figure(calibration).axes[0].get_yticklabels()]
    assert labels == ["acc_fl.x"]
