from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis import Observation, SensorFault, diagnose, learn
from sprung.errors import ParameterError
from sprung.results.figures import corner_changes_figure, evidence_figure, trends_figure
from sprung.vehicles import Component

CORNERS = ("front_left", "front_right", "rear_left", "rear_right")
COMPONENTS = tuple(Component(corner, kind) for corner in CORNERS for kind in ("spring", "damper", "tyre"))
COVARIANCE = 0.012**2 * (np.eye(12) + 0.3)
SPRING = COMPONENTS.index(Component("front_left", "spring"))
SLOPE = -0.03


def window(generator, time, change=0.0):
    values = generator.multivariate_normal(np.zeros(12), COVARIANCE, method="cholesky")
    values[SPRING] += change
    return Observation(time, COMPONENTS, values, COVARIANCE, {}, {"roll": (2.0 + change, 0.2)}, ())


def softened_spring():
    """A baseline; four healthy windows, one with a failing sensor, then a spring that goes on softening."""
    generator = np.random.default_rng(0)
    baseline = learn([window(generator, 600.0 * k) for k in range(12)])
    generator = np.random.default_rng(1)
    every = [window(generator, 600.0 * k, -0.15 + SLOPE * (k - 4) if k > 4 else 0.0) for k in range(14)]
    every[4] = replace(window(generator, 2400.0, 2.0), sensor_faults=(SensorFault("acc_fl", "drifting", ""),))
    return baseline, diagnose(every, baseline)


@pytest.fixture(scope="module")
def baseline():
    return softened_spring()[0]


@pytest.fixture(scope="module")
def softening():
    return softened_spring()[1]


def test_components_are_drawn_with_limits_onset_and_trend(softening, baseline) -> None:
    figure = trends_figure(softening, baseline)
    panels = [figure.axes[:4], figure.axes[4:8], figure.axes[8:]]
    assert [axes.get_title(loc="left") for axes in panels[0]] == [
        "front left",
        "front right",
        "rear left",
        "rear right",
    ]
    assert [axes.get_ylabel() for axes, *_ in panels] == ["spring [%]", "damper [%]", "tyre [%]"]
    axes = panels[0][0]
    (bars,) = axes.containers
    assert len(bars[0].get_xdata()) == 13  # not the window whose sensor fails
    half = 1.96 * np.sqrt((baseline.covariance + baseline.nuisance)[SPRING, SPRING])
    band = axes.patches[0].get_extents().transformed(axes.transData.inverted())
    expected = 100 * np.expm1(baseline.mean[SPRING] + half * np.array([-1, 1]))
    np.testing.assert_allclose([band.y0, band.y1], expected)
    lines = {line.get_label(): line for line in axes.get_lines()}
    (finding,) = softening.findings
    assert np.asarray(lines["onset, with 95 % interval"].get_xdata())[0] == finding.since / 60
    trend = lines[f"{100 * finding.trend.per_hour:+.1f} % per hour"]
    minutes, values = np.array(trend.get_xdata()), np.log1p(np.array(trend.get_ydata()) / 100)
    slope = np.ptp(values) / np.ptp(minutes) * 60
    assert slope == pytest.approx(-np.log1p(finding.trend.per_hour))
    assert slope == pytest.approx(-6 * SLOPE, rel=0.25)
    # Nothing is said of the others.
    assert not any(other.get_legend() for other in figure.axes[1:])


def test_without_a_baseline_the_limits_are_about_the_vehicle_file(softening) -> None:
    figure = trends_figure(diagnose(softening.observations))
    assert "by the vehicle file" in figure.get_suptitle()
    middle = figure.axes[0].get_lines()[0]
    assert np.asarray(middle.get_ydata())[0] == 0


def lines_of(figure):
    """Ends of the intervals in the panel of the front-left corner, thin and thick."""
    thin, thick = (
        [
            [part[:, 1] for part in lines.get_segments()]
            for lines in figure.axes[0].collections
            if lines.get_lw()[0] == lw
        ]
        for lw in (1.3, 4)
    )
    return np.vstack(thin), np.vstack(thick)


def test_payload_does_not_look_like_a_change(baseline) -> None:
    """All springs 8 % stiffer together are within the thin lines, though not within chance."""
    generator = np.random.default_rng(2)
    every = [window(generator, 600.0 * k) for k in range(8)]
    springs = 0.08 * np.array([component.kind == "spring" for component in COMPONENTS])
    loaded = [replace(one, log_ratios=one.log_ratios + springs) for one in every]
    found = diagnose(loaded, baseline)
    assert found.findings == ()
    thin, thick = lines_of(corner_changes_figure(found, baseline))
    assert thin[0, 0] < 0 < thin[0, 1]
    assert thick[0, 0] > 0


def test_corners_leave_out_windows_whose_sensors_fail(softening, baseline) -> None:
    generator = np.random.default_rng(3)
    fails = replace(window(generator, 9000.0, 2.0), sensor_faults=(SensorFault("acc_fl", "drifting", ""),))
    more = diagnose([*softening.observations, fails], baseline)
    for one, other in zip(
        lines_of(corner_changes_figure(softening, baseline)),
        lines_of(corner_changes_figure(more, baseline)),
        strict=True,
    ):
        np.testing.assert_allclose(one, other)


def test_diagnosis_without_conclusive_window_is_refused(softening) -> None:
    mute = diagnose([Observation(0.0, (), np.zeros(0), np.zeros((0, 0)), {}, {}, (), "too short")])
    for draw in (evidence_figure, trends_figure, corner_changes_figure):
        with pytest.raises(ParameterError, match="has no conclusive window"):
            draw(mute)
    evidence_figure(softening).draw_without_rendering()


def test_a_single_window_has_an_axis_of_minutes(baseline) -> None:
    found = diagnose([window(np.random.default_rng(4), 0.0)], baseline)
    for figure in (evidence_figure(found), trends_figure(found, baseline)):
        assert figure.axes[0].get_xlim() == (-1.0, 1.0)


def test_an_anti_roll_bar_is_drawn_at_the_left_corner_of_its_axle() -> None:
    parts, generator = (*COMPONENTS, Component("front_axle", "anti_roll")), np.random.default_rng(0)
    values = 0.02 * generator.standard_normal((12, 13))
    every = [Observation(600.0 * k, parts, x, 0.02**2 * np.eye(13), {}, {}, ()) for k, x in enumerate(values)]
    baseline = learn(every[:8])
    diagnosis = diagnose(every[8:], baseline)
    trends, corners = trends_figure(diagnosis, baseline), corner_changes_figure(diagnosis, baseline)
    assert len(trends.axes) == 16
    assert trends.axes[12].get_ylabel() == "anti-roll [%]"
    assert len(trends.axes[12].containers) == 1
    assert not trends.axes[13].containers
    assert [label.get_text() for label in corners.axes[0].get_xticklabels()] == [
        "spring",
        "damper",
        "tyre",
        "anti-roll",
    ]
