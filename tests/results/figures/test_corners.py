"""Figures of a corner fit."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.patches import Rectangle
from matplotlib.text import Annotation

from sprung.likelihood import fit_corners
from sprung.results.figures.diagnosis import corner_bars, corners_figure, correlation_figure, fitted_spectra_figure
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import Component, read_vehicle

CORNERS = ("front_left", "front_right", "rear_left", "rear_right")
COMPONENTS = tuple(Component(corner, kind) for corner in CORNERS for kind in ("spring", "damper", "tyre"))


def bars(axes):
    return [patch for patch in axes.patches if isinstance(patch, Rectangle)]


def intervals(axes):
    """Return the ends of the vertical lines, shape (lines, 2)."""
    lines = [collection for collection in axes.collections if isinstance(collection, LineCollection)]
    return np.array([segment[:, 1] for collection in lines for segment in collection.get_segments()])


@pytest.fixture(scope="module")
def fit():
    pytest.importorskip("numba")
    car = read_vehicle("zafira")
    return fit_corners(simulate_drive(car, RoadDrive(duration=240.0, snr=50.0), seed=1).recording, car)


@pytest.mark.slow
def test_figures_of_a_fit(fit) -> None:
    figure = fitted_spectra_figure(fit, source="run.csv")
    assert "run.csv" in figure.get_suptitle()
    rows = len(fit.model.layout.coordinates)
    assert len(figure.axes) == 2 * rows
    for row in range(rows):
        measured, fitted = (np.asarray(line.get_ydata()) for line in figure.axes[2 * row].lines)
        misfit = np.asarray(figure.axes[2 * row + 1].lines[0].get_ydata())
        assert np.median(measured / fitted) == pytest.approx(1, abs=0.1)
        np.testing.assert_allclose(misfit, 100 * fit.misfit[row])
    heights = [bar.get_height() for axes in corners_figure(fit).axes for bar in bars(axes)]
    np.testing.assert_allclose(heights, 100 * np.expm1(fit.log_ratios))


def test_the_axis_is_scaled_to_the_changes_and_not_to_absurd_intervals() -> None:
    log_ratios, deviations = np.zeros(12), np.full(12, 0.6)
    log_ratios[0] = np.log(0.85)
    figure = corner_bars(
        COMPONENTS,
        log_ratios,
        deviations,
        is_identifiable=np.ones(12, dtype=bool),
        heading=("Corners", ""),
        by_chance=np.full(12, 0.03),
    )
    for axes in figure.axes:
        assert axes.get_ylim()[1] == pytest.approx(-axes.get_ylim()[0])
        assert 20.0 < axes.get_ylim()[1] < 35.0
        assert len([line for line in axes.get_lines() if line.get_gid() == "cut off"]) == 6
        assert all(isinstance(text, Annotation) and abs(text.xy[1]) < axes.get_ylim()[1] for text in axes.texts)


def test_narrow_intervals_are_shown_whole() -> None:
    figure = corner_bars(
        COMPONENTS, np.zeros(12), np.full(12, 0.03), is_identifiable=np.ones(12, dtype=bool), heading=("Corners", "")
    )
    axes = figure.axes[0]
    assert not [line for line in axes.get_lines() if line.get_gid() == "cut off"]
    assert axes.get_ylim()[0] < intervals(axes).min()
    assert intervals(axes).max() < axes.get_ylim()[1]


def test_correlations_are_readable_on_dark_and_light_cells() -> None:
    component_covariance = np.full((12, 12), 0.95) + 0.05 * np.eye(12)
    component_covariance[0, 1] = component_covariance[1, 0] = 0.35
    model = SimpleNamespace(components=COMPONENTS)
    fit: Any = SimpleNamespace(components=COMPONENTS, covariance=component_covariance, model=model)
    texts = {text.get_text(): text.get_color() for text in correlation_figure(fit).axes[0].texts}
    assert texts[".95"] == "white"
    assert texts[".35"] != "white"
