"""Figures of a corner fit."""

from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from matplotlib.collections import LineCollection
from matplotlib.patches import Rectangle
from matplotlib.text import Annotation

from sprung.likelihood import fit_corners
from sprung.results.figures.corners import corner_bars, corners_figure, correlation_figure, fitted_spectra_figure
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


def test_bars_are_changes_in_percent_with_their_intervals() -> None:
    log_ratios, deviations = np.full(12, np.log(1.1)), np.full(12, 0.05)
    log_ratios[4] = np.log(0.8)  # the damper at the front right
    is_identifiable = np.arange(12) != 2
    figure = corner_bars(
        COMPONENTS, log_ratios, deviations, is_identifiable=is_identifiable, heading=("Corners", "simulated")
    )
    panels = figure.axes
    assert [axes.get_title(loc="left") for axes in panels] == ["front left", "front right", "rear left", "rear right"]
    assert [tick.get_text() for tick in panels[0].get_xticklabels()] == ["spring", "damper", "tyre"]
    assert [bar.get_height() for bar in bars(panels[0])] == pytest.approx([10.0, 10.0, 10.0])
    assert [bar.get_height() for bar in bars(panels[1])] == pytest.approx([10.0, -20.0, 10.0])
    low, high = intervals(panels[1])[1]
    assert (np.log1p(high / 100) - np.log1p(low / 100)) / 0.05 == pytest.approx(2 * 1.96, rel=1e-3)
    assert [text.get_text() for text in panels[1].texts] == ["+10.0 %", "-20.0 %", "+10.0 %"]


def test_what_is_not_identifiable_is_grey_and_has_no_figure() -> None:
    is_identifiable = np.arange(12) != 2
    figure = corner_bars(
        COMPONENTS, np.full(12, 0.1), np.full(12, 0.05), is_identifiable=is_identifiable, heading=("Corners", "")
    )
    spring, damper, tyre = (bar.get_facecolor()[:3] for bar in bars(figure.axes[0]))
    assert len(set(tyre)) == 1
    assert len({spring, damper, tyre}) == 3
    assert len(figure.axes[0].texts) == 2


def test_the_part_of_chance_lies_within_the_interval() -> None:
    figure = corner_bars(
        COMPONENTS,
        np.zeros(12),
        np.full(12, 0.1),
        is_identifiable=np.ones(12, dtype=bool),
        heading=("Corners", ""),
        by_chance=np.full(12, 0.05),
    )
    thin, thick = intervals(figure.axes[3])[:3], intervals(figure.axes[3])[3:]
    np.testing.assert_allclose(np.log1p(thin / 100), 2 * np.log1p(thick / 100))


@pytest.fixture(scope="module")
def fit():
    pytest.importorskip("numba")
    car = read_vehicle("zafira")
    return fit_corners(simulate_drive(car, RoadDrive(duration=240.0, snr=50.0), seed=1).recording, car)


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


def test_correlations_of_the_estimates(fit) -> None:
    (image,) = correlation_figure(fit).axes[0].get_images()
    values = np.asarray(image.get_array())
    assert values.shape == (12, 12)
    np.testing.assert_allclose(np.diag(values), 1)
    np.testing.assert_allclose(values, values.T)
    assert np.abs(values).max() <= 1 + 1e-12


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
