"""Diagrams of a window from its archived samples: those of the samples themselves."""

import json
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest

from sprung.identification import METHODS
from sprung.likelihood.fitting import fit_windows
from sprung.link.archive import ArchiveError, write_archive
from sprung.modal import PoleStatus
from sprung.online.monitor.diagrams import answer, archived_recording
from sprung.online.monitor.engine import IDENTIFICATION
from sprung.recording import Gap
from sprung.results.documents import mode_documents
from sprung.results.figures.diagnosis import mean_spectra
from sprung.vehicles import vehicle_text
from sprung.vehicles.sensor_layout import quantities_of
from sprung.vehicles.window import window_of


def archived(folder, recording):
    return write_archive(
        folder,
        "car-1",
        1,
        0,
        recording.start,
        samples=recording.samples,
        channels=recording.names,
        sampling_rate=recording.sampling_rate,
        gaps=[(gap.index, gap.duration) for gap in recording.gaps],
    )


def request(samples, run, car):
    return {
        "samples": str(samples),
        "quantities": quantities_of(run, car.sensor),
        "description": vehicle_text(car),
        "method": "cov",
        "source": "car-1",
    }


def test_archived_samples_are_those_of_the_window(tmp_path, car, drive) -> None:
    run = replace(drive(0), gaps=(Gap(500, 2.5),))
    kept = archived_recording(archived(tmp_path, run), quantities_of(run, car.sensor))
    np.testing.assert_array_equal(kept.samples, run.samples.astype(np.float32))
    assert (kept.names, kept.sampling_rate, kept.start, kept.gaps) == (
        run.names,
        run.sampling_rate,
        run.start,
        run.gaps,
    )
    assert [channel.quantity for channel in kept.channels] == list(quantities_of(run, car.sensor).values())


def test_samples_that_are_gone_or_damaged(tmp_path) -> None:
    with pytest.raises(ArchiveError, match=r"the samples in 1-0.parquet cannot be read"):
        archived_recording(tmp_path / "1-0.parquet", {})
    (tmp_path / "1-0.parquet").write_bytes(b"PAR1 and nothing else")
    with pytest.raises(ArchiveError, match=r"the samples in 1-0.parquet cannot be read"):
        archived_recording(tmp_path / "1-0.parquet", {})


@pytest.mark.slow
def test_a_process_of_its_own_answers_with_what_the_same_samples_give(tmp_path, car, drive) -> None:
    """As the functions of the monitor and the command line give it on the samples before they were archived."""
    run = drive(0)
    command = [sys.executable, "-P", "-m", "sprung.online.monitor.diagrams"]
    asked = json.dumps(request(archived(tmp_path, run), run, car))
    done = subprocess.run(command, input=asked, capture_output=True, text=True, check=True)
    answered = json.loads(done.stdout)
    assert answered["pictures"].keys() == {"spectra", "stabilisation", "fit", "levels"}
    for picture in answered["pictures"].values():
        assert picture.startswith("<?xml")
        assert "<script" not in picture
    values = answered["values"]
    assert values["notes"] == []
    direct = METHODS["cov"](run, settings=IDENTIFICATION, vehicle=car)
    for own, other in zip(values["identification"]["modes"], mode_documents(direct.modes), strict=True):
        assert own["label"] == other["label"]
        assert own["natural_frequency"] == pytest.approx(other["natural_frequency"], rel=1e-5)
        assert own["damping_ratio"] == pytest.approx(other["damping_ratio"], rel=1e-4)
    assert values["stabilisation"]["rung"] == "model order"
    (poles,) = values["stabilisation"]["poles"]
    (diagram,) = direct.subsets[0].diagrams
    assert len(poles["rung"]) == len(poles["status"]) == len(diagram.status)
    selected = np.array(poles["status"]) == "selected"
    np.testing.assert_allclose(
        np.array(poles["natural_frequency"])[selected],
        diagram.poles.natural_frequency[diagram.status == PoleStatus.SELECTED],
        rtol=1e-4,
    )
    fit = fit_windows([window_of(run, car)])
    assert values["fit"]["model_error"] == pytest.approx(fit.model_error, rel=1e-3)
    for own, expected in zip(values["fit"]["coordinates"], mean_spectra(fit)[1], strict=True):
        np.testing.assert_allclose(own["fitted"], expected, rtol=1e-3)


def test_why_there_are_no_diagrams_is_said(tmp_path, car, drive) -> None:
    run = replace(drive(0), samples=np.zeros_like(drive(0).samples))
    assert set(answer(request(archived(tmp_path, run), run, car))) == {"error"}
    assert "cannot be read" in answer(request("/nowhere/1-0.parquet", run, car))["error"]
