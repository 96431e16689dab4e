"""The change detector: updates equal a batch, false alarms stay below their rate, intervals cover."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis import (
    Baseline,
    ChangeDetector,
    SensorFault,
    detect,
    diagnose,
    false_discoveries,
    learn,
)
from sprung.diagnosis.changes import PATIENCE_DAYS
from sprung.errors import ParameterError


@pytest.fixture(scope="module")
def softening(window):
    """Four healthy windows and six with a softer spring; one inconclusive, one with a failing sensor among them."""
    generator = np.random.default_rng(3)
    every = [window(generator, 600.0 * k, {"front_left.spring": -0.1} if k >= 4 else {}) for k in range(10)]
    every[2] = replace(every[2], reason="standing")
    every[6] = replace(every[6], sensor_faults=(SensorFault("acc_fl", "dead", ""),))
    return every


def fed(detector, observations):
    for observation in observations:
        detector.update(observation)
    return detector


def test_updates_give_the_evidence_of_every_beginning(baseline, softening) -> None:
    """The evidence after each window is that of the windows until then alone."""
    detector = ChangeDetector(baseline)
    for count, observation in enumerate(softening, start=1):
        detector.update(observation)
        alone = detect(baseline, softening[:count])
        assert (0 if alone is None else alone.evidence[-1]) == (detector.evidence[-1] if alone else 0)
    assert detector.detection is not None
    assert detector.detection.times.tolist() == [600.0 * k for k in (0, 1, 3, 4, 5, 7, 8, 9)]
    assert detector.evidence.tolist() == detector.detection.evidence.tolist()
    assert detector.is_alert
    assert detector.is_alert == detector.detection.is_alert
    assert detector.detection.candidates[0].hypothesis.name == "front_left.spring"
    assert detector.threshold == pytest.approx(np.log(48 / 1e-3))


def test_without_a_window_to_compare_there_is_no_evidence(baseline, softening) -> None:
    detector = fed(ChangeDetector(baseline), [softening[2], softening[6]])
    assert (detector.detection, detector.is_alert) == (None, False)
    assert len(detector.observations) == 2


@pytest.mark.slow
@pytest.mark.parametrize("n_windows", [None, 4])
def test_it_goes_on_from_its_windows_and_evidence(baseline, softening, n_windows) -> None:
    through = ChangeDetector(baseline, n_windows=n_windows)
    stopped = ChangeDetector(baseline, n_windows=n_windows)
    for observation in softening:
        through.update(observation)
        stopped.update(observation)
        stopped = ChangeDetector.resumed(baseline, stopped.observations, stopped.evidence, n_windows=n_windows)
        assert stopped.evidence.tolist() == through.evidence.tolist()
        assert stopped.detection is not None
        assert through.detection is not None
        assert stopped.detection.candidates == through.detection.candidates
    without_evidence = ChangeDetector.resumed(baseline, through.observations, ())
    assert without_evidence.evidence[-1] == through.evidence[-1]


def test_windows_that_are_forgotten_leave_the_evidence_of_the_rest(baseline, softening) -> None:
    """The last evidence is that of the windows looked back on; earlier ones stay as they were."""
    detector = ChangeDetector(baseline, n_windows=5)
    seen = {}
    for observation in softening:
        detector.update(observation)
        assert detector.detection is not None
        seen[float(detector.detection.times[-1])] = detector.evidence[-1]
    assert detector.observations == tuple(softening[5:])
    assert detector.detection is not None
    times = detector.detection.times.tolist()
    assert times == [3000.0, 4200.0, 4800.0, 5400.0]
    assert detector.evidence[:-1].tolist() == [seen[time] for time in times[:-1]]
    alone = detect(baseline, softening[5:])
    assert alone is not None
    assert detector.evidence[-1] == alone.evidence[-1]


def test_an_update_looks_at_the_new_window_only(baseline, softening, monkeypatch) -> None:
    """Residuals and covariances of earlier windows are not computed again."""
    detector = fed(ChangeDetector(baseline), softening[:-1])
    seen, compute = [], Baseline.residual

    def counted(self, observation):
        seen.append(observation)
        return compute(self, observation)

    monkeypatch.setattr(Baseline, "residual", counted)
    detector.update(softening[-1])
    _ = detector.detection
    assert seen == [softening[-1]]


def test_impossible_settings_are_refused(baseline) -> None:
    for settings in ({"false_alarms": 0.0}, {"windows_per_day": 0.0}, {"n_windows": 0}):
        with pytest.raises(ParameterError, match=next(iter(settings))):
            ChangeDetector(baseline, **settings)


@pytest.mark.slow
def test_false_alarms_stay_below_the_stated_rate(healthy) -> None:
    """200 vehicles with 24 windows each, at one false alarm in five vehicle-days: 20 expected at most."""
    alarms = 0
    for seed in range(200):
        every = healthy(30, seed=seed + 1000)
        detector = ChangeDetector.resumed(learn(every[:6]), every[6:], (), false_alarms=0.2)
        assert len(detector.evidence) == 24
        alarms += bool(np.any(detector.evidence >= detector.threshold))
    assert alarms <= 28  # 20 and 1.7 standard deviations


@pytest.mark.slow
def test_e_values_have_the_mean_one_at_most_without_a_change(healthy) -> None:
    values = []
    for seed in range(150):
        every = healthy(18, seed=seed + 9000)
        found = detect(learn(every[:12]), every[12:])
        assert found is not None
        values.append(np.exp(found.e_value) * 48 * PATIENCE_DAYS / 6)
    assert np.mean(values) <= 1.0
    assert false_discoveries(np.log(values)) == []


@pytest.mark.slow
def test_intervals_cover_the_size(faulty, baseline) -> None:
    inside = 0
    for seed in range(100):
        (finding,) = diagnose(faulty(seed + 50, {"front_left.spring": -0.15}), baseline).findings
        assert finding.interval is not None
        inside += finding.interval[0] <= -0.15 <= finding.interval[1]
    assert inside >= 88


@pytest.mark.slow
def test_sizes_are_not_drawn_towards_nothing(faulty, baseline) -> None:
    """However large, and from one window: the prior of sizes weighs evidence, and no more.

    Friction hides 3 % of the size of a spring on a road; without any, as here, sizes are as much too large.
    """
    errors = []
    for seed in range(40):
        (finding,) = diagnose(faulty(seed, {"front_left.spring": -0.75}, after=1), baseline).findings
        assert finding.change is not None
        errors.append(0.97 * np.log1p(finding.change) - np.log1p(-0.75))
    assert abs(np.mean(errors)) < 0.02


def test_false_discoveries_of_a_fleet() -> None:
    assert false_discoveries([0.0, 12.0, -1.0, 9.0], rate=0.05) == [1, 3]
    assert false_discoveries([0.0, 1.0, -1.0], rate=0.05) == []
    with pytest.raises(ParameterError, match="rate"):
        false_discoveries([0.0], rate=0.0)
