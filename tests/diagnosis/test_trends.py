"""Trends: the slope of a growing change, and when it reaches its limit."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis import Candidate, Hypothesis, Size, diagnose, trend
from sprung.diagnosis.trends import phase_shift


def test_growing_change_has_a_trend_and_a_forecast(window, faulty, baseline) -> None:
    generator = np.random.default_rng(4)
    growing = [window(generator, 600.0 * k, {"front_left.spring": -0.01 * k}) for k in range(16)]
    (finding,) = diagnose(growing, baseline).findings
    assert finding.trend is not None
    assert finding.trend.interval[0] < finding.trend.interval[1] < 0
    assert finding.trend.per_hour == pytest.approx(-0.065, abs=0.02)
    assert finding.trend.hours_to_limit is not None
    earliest, latest = finding.trend.hours_to_limit
    assert 0 < earliest < 2.5 < latest  # another 15 windows at -1 % each make 30 %
    (steady,) = diagnose(faulty(3, {"front_left.spring": -0.2}), baseline).findings
    assert steady.trend is None or steady.trend.hours_to_limit is None


def test_a_limit_that_is_passed_is_due_now(window, baseline) -> None:
    generator = np.random.default_rng(4)
    growing = [window(generator, 600.0 * k, {"front_left.spring": -0.03 * k}) for k in range(16)]
    (finding,) = diagnose(growing, baseline).findings
    assert finding.trend is not None
    assert finding.trend.hours_to_limit is not None
    assert finding.trend.hours_to_limit[0] == 0


def test_a_growing_change_has_one_size_in_findings_and_hypotheses(window, baseline) -> None:
    generator = np.random.default_rng(4)
    grown = [window(generator, 600.0 * k, {"front_left.spring": -0.03 * k}) for k in range(16)]
    diagnosis = diagnose(grown, baseline)
    (finding,) = diagnosis.findings
    assert diagnosis.detection is not None
    named = next(one for one in diagnosis.detection.candidates if one.hypothesis.name == finding.hypothesis)
    assert (named.change, named.interval, named.score) == (finding.change, finding.interval, finding.score)
    assert finding.interval is not None
    assert finding.interval[0] < -0.45 < finding.interval[1]  # after the last window, not the mean since the onset


def test_windows_of_one_time_have_a_size_and_no_trend(faulty, baseline) -> None:
    """As windows observed one by one without stating their times have."""
    phases = {"rear_left": (30.0, 2.0)}
    windows = [replace(one, time=0.0, phase_shifts=phases) for one in faulty(3, {"rear_left.damper": -0.4}, before=0)]
    (finding,) = diagnose(windows, baseline).findings
    assert finding.hypothesis == "rear_left.damper"
    assert finding.trend is None
    assert finding.phase_shift is not None
    assert finding.phase_shift.degrees == 30.0


def candidate(corner: str, component: str) -> Candidate:
    scope = "else" if component == "unmodelled" else "single"
    sizes = () if scope == "else" else (Size(-0.1, (-0.12, -0.08), 10.0),)
    return Candidate(Hypothesis(scope, corner, component), 50.0, 100.0, sizes, 0.0, (0.0, 0.0))


def growing(baseline, healthy, *, per_hour):
    """Windows every ten minutes without scatter whose first spring changes at a steady rate [ln per hour]."""
    (one,) = healthy(1)
    still = baseline.mean + baseline.slopes @ baseline.units(one)
    first = np.eye(12)[0]
    return [replace(one, time=600.0 * k, log_ratios=still + per_hour * k / 6 * first) for k in range(7)]


def test_a_line_without_scatter_has_its_own_slope(baseline, healthy) -> None:
    """ln falls by 0.12 per hour; the limit -30 % is ln 0.7, from ln -0.12 after the last of six steps."""
    windows = growing(baseline, healthy, per_hour=-0.12)
    course = trend(candidate("front_left", "spring"), windows, baseline, since=0.0)
    assert course is not None
    assert course.per_hour == pytest.approx(np.expm1(-0.12), rel=1e-9)
    assert course.interval[0] < course.per_hour < course.interval[1] < 0
    assert course.hours_to_limit is not None
    assert course.hours_to_limit[0] < (np.log(0.7) + 0.12) / -0.12 < course.hours_to_limit[1]


def test_a_change_back_towards_normal_has_no_limit(baseline, healthy) -> None:
    """Sizes from ln -0.24 up to -0.12: the slope is positive, the change still negative."""
    windows = growing(baseline, healthy, per_hour=0.12)
    shifted = [replace(one, log_ratios=one.log_ratios - 0.24 * np.eye(12)[0]) for one in windows]
    course = trend(candidate("front_left", "spring"), shifted, baseline, since=0.0)
    assert course is not None
    assert course.per_hour == pytest.approx(np.expm1(0.12), rel=1e-9)
    assert course.hours_to_limit is None


def test_three_windows_or_an_unmodelled_change_have_no_trend(baseline, healthy) -> None:
    windows = growing(baseline, healthy, per_hour=-0.12)
    assert trend(candidate("front_left", "spring"), windows, baseline, since=2400.0) is None
    assert trend(candidate("vehicle", "unmodelled"), windows, baseline, since=0.0) is None


def phases(window, *degrees: float, std: float = 2.0):
    """Windows of ten minutes with the phase shift of the rear-left corner."""
    generator = np.random.default_rng(4)
    return [
        window(generator, 600.0 * k, phase_shifts={"rear_left": (value, std), "rear_right": (54.0, 2.0)})
        for k, value in enumerate(degrees)
    ]


def test_a_steady_phase_shift_is_the_mean_with_the_uncertainty_that_all_windows_share(window) -> None:
    found = phase_shift(["rear_left", "rear_right"], phases(window, 39.0, 41.0, 40.0, 41.0, 39.0), since=0.0)
    assert found is not None
    assert found.degrees == pytest.approx(40.0)
    assert found.interval == pytest.approx((40 - 1.96 * 2, 40 + 1.96 * 2))
    assert found.hours_to_limit is None


def test_a_falling_phase_shift_reaches_the_limit_when_its_line_does(window) -> None:
    falling = 50 - 6 * np.arange(7) / 6 + 1e-6 * np.random.default_rng(1).standard_normal(7)
    found = phase_shift(["rear_left"], phases(window, *falling, std=1e-9), since=0.0)
    assert found is not None
    assert found.degrees == pytest.approx(44.0, abs=1e-5)
    assert found.hours_to_limit == pytest.approx((1.5, 1.5), abs=1e-4)  # 9 degrees at 6 an hour
    due = phase_shift(["rear_left"], phases(window, *(falling - 20), std=1e-9), since=0.0)
    assert due is not None
    assert due.hours_to_limit == (0.0, 0.0)


def test_a_phase_shift_that_falls_from_far_above_the_limit_is_forecast(window) -> None:
    """The first windows after the onset state none, as the corner was far above the limit."""
    above = [window(np.random.default_rng(1), 600.0 * k) for k in range(4)]
    near = [replace(one, time=one.time + 2400.0) for one in phases(window, 50.0, 49.0, 48.0, 47.0, 46.0, std=1e-9)]
    found = phase_shift(["rear_left"], [*above, *near], since=0.0)
    assert found is not None
    assert found.degrees == pytest.approx(46.0)
    assert found.hours_to_limit == pytest.approx((11 / 6, 11 / 6))  # 11 degrees at 6 an hour


def test_a_corner_far_above_the_limit_has_no_phase_shift(window) -> None:
    windows = [*phases(window, 54.0, 54.0), window(np.random.default_rng(1), 1200.0)]
    assert phase_shift(["rear_left"], windows, since=0.0) is None
    assert phase_shift(["front_left"], windows[:2], since=0.0) is None
    assert phase_shift(["rear_left"], [], since=0.0) is None


@pytest.mark.parametrize(
    ("degrees", "severity"), [(50.0, "medium"), (34.0, "medium"), (30.9, "high"), (36.0, "medium")]
)
def test_a_damper_that_fails_the_suspension_test_is_severe_however_little_it_has_changed(
    window, faulty, baseline, degrees, severity
) -> None:
    changed = [
        replace(one, phase_shifts={"rear_left": (degrees, 2.0)})
        for one in faulty(3, {"rear_left.damper": -0.19}, before=0, after=8)
    ]
    (finding,) = diagnose(changed, baseline).findings
    assert (finding.hypothesis, finding.severity) == ("rear_left.damper", severity)
    assert f"phase shift at inspection {degrees:.0f} degrees" in finding.sentence
    (stiffer,) = diagnose(
        [replace(one, phase_shifts={"rear_left": (30.0, 2.0)}) for one in faulty(3, {"rear_left.damper": 0.3})],
        baseline,
    ).findings
    assert stiffer.phase_shift is None
