"""The change detector: one window after the other gives what all of them give."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis import Baseline, ChangeDetector, SensorFault, detect, learn, nominal_baseline
from sprung.errors import ParameterError


@pytest.fixture(scope="module")
def baseline(healthy):
    return learn(healthy(12))


@pytest.fixture(scope="module")
def softening(window):
    """Four healthy windows and six with a softer spring; one inconclusive, one with a failing sensor among them."""
    generator = np.random.default_rng(3)
    every = [window(generator, 600.0 * k, {"front_left.spring": -0.1} if k >= 4 else ()) for k in range(10)]
    every[2] = replace(every[2], reason="standing")
    every[6] = replace(every[6], sensor_faults=(SensorFault("acc_fl", "dead", ""),))
    return every


def fed(detector, observations):
    for observation in observations:
        detector.update(observation)
    return detector


def test_updates_give_the_evidence_of_every_beginning(baseline, softening):
    """The evidence after each window is that of the windows until then alone."""
    detector = ChangeDetector(baseline)
    for count, observation in enumerate(softening, start=1):
        detector.update(observation)
        alone = detect(baseline, softening[:count])
        assert (0 if alone is None else alone.evidence[-1]) == (detector.evidence[-1] if alone else 0)
    assert detector.detection.times.tolist() == [600.0 * k for k in (0, 1, 3, 4, 5, 7, 8, 9)]
    assert detector.evidence.tolist() == detector.detection.evidence.tolist()
    assert detector.is_alert
    assert detector.is_alert == detector.detection.is_alert
    assert detector.candidates[0].hypothesis.name == "front_left.spring"
    assert detector.threshold == pytest.approx(np.log(48 / 1e-3))


def test_without_a_window_to_compare_there_is_no_evidence(baseline, softening):
    detector = fed(ChangeDetector(baseline), [softening[2], softening[6]])
    assert (detector.detection, detector.candidates, detector.is_alert) == (None, (), False)
    assert len(detector.observations) == 2


@pytest.mark.parametrize("n_windows", [None, 4])
def test_it_goes_on_from_its_windows_and_evidence(baseline, softening, n_windows):
    through = ChangeDetector(baseline, n_windows=n_windows)
    stopped = ChangeDetector(baseline, n_windows=n_windows)
    for observation in softening:
        through.update(observation)
        stopped.update(observation)
        stopped = ChangeDetector.resumed(baseline, stopped.observations, stopped.evidence, n_windows=n_windows)
        assert stopped.evidence.tolist() == through.evidence.tolist()
        assert stopped.candidates == through.candidates
    without_evidence = ChangeDetector.resumed(baseline, through.observations, ())
    assert without_evidence.evidence[-1] == through.evidence[-1]


def test_windows_that_are_forgotten_leave_the_evidence_of_the_rest(baseline, softening):
    """The last evidence is that of the windows looked back on; earlier ones stay as they were."""
    detector = ChangeDetector(baseline, n_windows=5)
    seen = {}
    for observation in softening:
        detector.update(observation)
        seen[float(detector.detection.times[-1])] = detector.evidence[-1]
    assert detector.observations == tuple(softening[5:])
    times = detector.detection.times.tolist()
    assert times == [3000.0, 4200.0, 4800.0, 5400.0]
    assert detector.evidence[:-1].tolist() == [seen[time] for time in times[:-1]]
    assert detector.evidence[-1] == detect(baseline, softening[5:]).evidence[-1]


def test_an_update_looks_at_the_new_window_only(baseline, softening, monkeypatch):
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


def test_a_window_that_the_vehicle_file_explains_badly_is_not_compared_with_it(softening):
    nominal = nominal_baseline(softening[0].components, vehicle="car")
    bad = replace(softening[0], conditions={"model_error": 0.2})
    assert nominal.accepts(softening[0])
    assert not nominal.accepts(bad)


def test_impossible_settings_are_refused(baseline):
    for settings in ({"false_alarms": 0.0}, {"windows_per_day": 0.0}, {"n_windows": 0}):
        with pytest.raises(ParameterError, match=next(iter(settings))):
            ChangeDetector(baseline, **settings)
