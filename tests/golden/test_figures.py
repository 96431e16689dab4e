"""Figures show what they did when it was frozen: headings, labels, legends, texts, curves, bars and colours."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from matplotlib.axes import Axes
from matplotlib.colors import to_hex
from matplotlib.figure import Figure
from tests.golden.freezing import check
from tests.results.figures.conftest import LINES, records
from tests.results.figures.test_diagnosis import softened_spring
from tests.results.figures.test_history import COMPONENTS, TIMES, followed

import sprung
from sprung.calibration import CalibratedNumber, Calibration
from sprung.diagnosis import mode_changes
from sprung.identification import METHODS, BlockRowLadder, IdentificationSettings, acs_ssi, coss_ssi, cov_ssi
from sprung.kits import kit_of, plan
from sprung.results import figures
from sprung.ride import Ride, RidePoint
from sprung.road import RoadEvent, RoadSurvey, Stretch, TrackRoughness
from sprung.signals.spectrum import ShortPass

#: Digits of what searches over many parameters find.
_DIGITS = 4


def described(figure: Figure) -> dict[str, Any]:
    """Return what a person sees of a figure."""
    figure.draw_without_rendering()
    legends = [text.get_text() for legend in figure.legends for text in legend.get_texts()]
    return {"heading": figure.get_suptitle(), "legend": legends, "panels": [_panel(axes) for axes in figure.axes]}


def _panel(axes: Axes) -> dict[str, Any]:
    legend = axes.get_legend()
    numbers = [np.asarray(collection.get_datalim(axes.transData).get_points()) for collection in axes.collections]
    return {
        "titles": f"{axes.get_title('left')} | {axes.get_title('center')}",
        "labels": f"{axes.get_xlabel()} | {axes.get_ylabel()}",
        "limits": [*axes.get_xlim(), *axes.get_ylim()],
        "ticks": "; ".join(label.get_text() for label in (*axes.get_xticklabels(), *axes.get_yticklabels())),
        "texts": "; ".join(f"{text.get_text()} {to_hex(text.get_color())}" for text in axes.texts),
        "legend": [text.get_text() for text in legend.get_texts()] if legend else [],
        "lines": "; ".join(f"{line.get_marker()} {line.get_linestyle()} {line.get_color()}" for line in axes.lines),
        "curves": [_ends(line.get_xydata()) for line in axes.lines],
        "colours": sorted({to_hex(patch.get_facecolor()) for patch in axes.patches}),
        "areas": [_ends(patch.get_path().vertices) for patch in axes.patches],
        "marks": [_ends(points) for points in numbers],
        "images": [np.asarray(image.get_array(), dtype=float).round(9).ravel().tolist() for image in axes.images],
    }


def _ends(points: Any) -> list[Any]:
    """Return the number of points, and mean, lowest and highest of those that are finite; rounding is below -150 dB."""
    known = np.maximum(np.asarray(points, dtype=float), -150.0)
    known = known[np.isfinite(np.asarray(points, dtype=float)).all(axis=1)]
    if not len(known):
        return [0]
    return [len(known), *known.mean(axis=0).tolist(), *known.min(axis=0).tolist(), *known.max(axis=0).tolist()]


def _calibrated() -> Calibration:
    """Three numbers of the shipped car, of which the file lacked one and the drives did not determine one."""
    f = np.linspace(1, 20, 39)
    numbers = (
        CalibratedNumber("acc_fl.x", "sensors", "m", 1.22, 1.3, 0.01, 0.1, True),
        CalibratedNumber("mounted_mass_1.frequency", "mounted_masses", "Hz", None, 11.0, 0.05, 3.0, True),
        CalibratedNumber("body.pitch_inertia", "body", "kg m2", 2200.0, 2190.0, 200.0, 220.0, False),
    )
    misfit = np.sin(f) * np.ones((3, 1))
    return Calibration(
        vehicle=sprung.read_vehicle("zafira"),
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


def _identified(name: str) -> Any:
    lifter = IdentificationSettings(lifter=ShortPass(0.25))
    match name:
        case "lines":
            return replace(cov_ssi(records(snr=0.5)), harmonics=LINES)
        case "edited":
            return cov_ssi(records(), settings=lifter)
        case "rows":
            return acs_ssi(records(), settings=IdentificationSettings(ladder=BlockRowLadder(12, 30)))
        case "bells":
            return METHODS["fdd"](records())
        case "levels":
            return coss_ssi(records(6, snr=2.0), settings=IdentificationSettings(has_disjoint_references=True))
        case _:
            runs = records(2, name="zafira", duration=300.0, sampling_rate=100.0)
            return cov_ssi(runs, vehicle=sprung.read_vehicle("zafira"))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lines", "edited", "rows", "bells", "levels", "car"])
def test_figures_of_an_identification(name) -> None:
    identification = _identified(name)
    drawn = {**figures.figures(identification, source="run.csv"), "rates": figures.stable_rates_figure(identification)}
    if name == "bells":
        del drawn["rates"]
    if name == "lines":
        modes = identification.modes
        drawn["reference"] = figures.reference_mac_figure([("all", modes), ("none", modes.take([]))], modes, title="t")
    check(f"figures-{name}", {key: described(figure) for key, figure in drawn.items()}, digits=_DIGITS)


@pytest.mark.slow
def test_figures_of_a_vehicle() -> None:
    car = sprung.read_vehicle("zafira")
    settings = sprung.RoadDrive(duration=120.0, sampling_rate=100.0, snr=50.0)
    drive = sprung.simulate_drive(car, settings, seed=1).recording
    fit = sprung.fit_corners(drive, car)
    completed = _calibrated()
    drawn = {
        "corners": figures.corners_figure(fit, source="run.csv"),
        "spectra": figures.fitted_spectra_figure(fit),
        "correlation": figures.correlation_figure(fit),
        "misfit": figures.misfit_figure(completed),
        "learnt": figures.learnt_figure(completed),
        "kit": figures.kit_figure(plan(kit_of(car, "two"))),
        "recording": drive.plot(),
        "levels": figures.levels_figure([("one", drive), ("two", drive)], title="Levels"),
        "densities": figures.densities_figure([("", drive)], title="Spectra", highest=30.0, marked=[("hop", 12.0)]),
    }
    check("figures-vehicle", {key: described(figure) for key, figure in drawn.items()}, digits=_DIGITS)


@pytest.mark.slow
def test_figures_over_time() -> None:
    baseline, softening = softened_spring()
    ratios = np.zeros((20, 12))
    ratios[10:, 0] = np.log(0.8)
    many = TIMES[0] + 1800 * 10**9 * np.arange(30 * 48)
    alerts = [figures.Stretch("front_left.spring", int(TIMES[10]), int(TIMES[-1]))]
    changes = mode_changes(sprung.read_vehicle("zafira"), softening.findings[0], baseline)
    drawn = {
        "evidence": figures.evidence_figure(softening),
        "trends": figures.trends_figure(softening, baseline),
        "corners": figures.corner_changes_figure(softening, baseline),
        "modes": figures.mode_changes_figure(changes, heading="softer"),
        "components": figures.components_history_figure(
            TIMES,
            ratios,
            np.full((20, 12), 0.05),
            components=COMPONENTS,
            usual=np.full(12, 0.1),
            alerts=alerts,
            baselines=[int(TIMES[5])],
        ),
        "months": figures.modes_history_figure(
            {"bounce": (many, np.linspace(1, 2, len(many)), np.full(len(many), 0.2))}
        ),
        "findings": figures.findings_history_figure({"a_b.spring": (TIMES[:2], np.tile([-0.2, -0.3, -0.1], (2, 1)))}),
        "history": figures.evidence_history_figure(TIMES, np.arange(20.0), threshold=10.8),
        "plan": figures.plan_figure(
            COMPONENTS,
            np.linspace(-0.3, 0.1, 12),
            np.linspace(-0.3, 0.1, 12)[:, None] + [-0.02, 0.5],
            steps={"front_left.spring": 3, "rear_left.damper": 0},
            detectable={"front_left.spring": 0.07},
            heading=("a", "b"),
        ),
        "tracks": figures.tracks_figure(followed(), source="run.csv"),
        "dates": figures.tracks_figure(followed(), start=int(TIMES[0])),
    }
    check("figures-time", {key: described(figure) for key, figure in drawn.items()}, digits=_DIGITS)


@pytest.mark.slow
def test_figures_of_roads_rides_and_curves() -> None:
    tracks = TrackRoughness(4.0, 0.1, 6e-5, 2.0, "B"), TrackRoughness(5.0, 0.2, 6e-5, 2.0, "C")
    places = ((52.0, 8.0), (52.001, 8.001), (52.002, 8.001))
    stretches = tuple(
        Stretch(100.0 * k, 100.0 * k + 100, 5.0 * k, 5.0 * k + 5, *tracks, 1, places[k], places[k + 1])
        for k in range(2)
    )
    event = RoadEvent(50.0, 2.5, "left", "pothole", 0.03, 0.6)
    point = RidePoint(*("seat_z", "z", "iso2631", "Wk", 0.5, 0.6, 1.0, 3.0, 0.5, "fairly"), continuous=(0.4, 0.6))
    frequencies, times = np.linspace(0.1, 20, 50), np.linspace(0, 1, 101)
    low_pass = np.asarray(1 / (1 + 1j * frequencies / 2), dtype=np.complex128)
    values = np.array([[1.4, 1.5, np.nan], [1.6, 1.5, 1.7]])
    spread = figures.Spread("f [Hz]", ("Cov", "CoSS"), values, 1.5, (1.5,))
    drawn = {
        "road": figures.road_figure(RoadSurvey(stretches, (event,)), source="a"),
        "ride": figures.ride_figure(Ride((point,), (), None, ())),
        "response": figures.response_figure(
            frequencies,
            [("a", low_pass), ("b", low_pass * 2)],
            title="R",
            unit="m",
            marked=[("f", 2.0)],
            has_phase=True,
        ),
        "cepstrum": figures.cepstrum_figure(times, np.cos(9 * times), np.exp(-times), title="C", pulse_period=0.4),
        "runs": figures.runs_figure([spread], title="Runs"),
    }
    check("figures-curves", {key: described(figure) for key, figure in drawn.items()}, digits=_DIGITS)
