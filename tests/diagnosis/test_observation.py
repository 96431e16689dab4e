"""Observations of simulated drives: times, conditions, and what learning and diagnosis need of the residual test."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis import compare_residuals, diagnose, learn, learn_residuals, observe, observe_window
from sprung.errors import ParameterError
from sprung.simulation import RoadConditions, RoadDrive, dead, simulate_drive
from sprung.vehicles import read_vehicle, window

#: 2026-11-21, UTC ns.
BEGUN = 1_795_219_200_000_000_000


@pytest.fixture(scope="module")
def car():
    return read_vehicle("zafira")


@pytest.fixture(scope="module")
def run(car):
    """Ten minutes, in windows of two."""
    recording = simulate_drive(car, RoadDrive(snr=50.0, road=RoadConditions("C")), seed=1).recording
    return replace(recording, start=BEGUN)


@pytest.fixture(scope="module")
def observations(car, run):
    later = replace(run, start=BEGUN + 3600 * 10**9).part(0, run.n_samples // 5)
    return observe([run, later], car, length=120.0)


def test_windows_of_recordings_in_the_order_of_time(car, run, observations):
    assert [one.time for one in observations] == [0.0, 120.0, 240.0, 360.0, 480.0, 3600.0]
    assert {one.vehicle for one in observations} == {"zafira"}
    assert all(one.is_conclusive for one in observations)
    (alone,) = observe(run.part(0, run.n_samples // 5), car, length=120.0)
    np.testing.assert_allclose(alone.log_ratios, observations[0].log_ratios, rtol=1e-9, atol=1e-12)


def test_conditions_of_a_conclusive_window(observations):
    conditions = observations[0].conditions
    assert {"roughness", "payload", "speed", "standing", "model_error", "segments"} <= conditions.keys()
    assert conditions["roughness"] == pytest.approx(256e-6, rel=0.15)  # G(n0) of class C, ISO 8608, geometric mean


def test_sensors_are_placed_once(car, run, monkeypatch):
    calls = []
    place = window.with_layout
    monkeypatch.setattr(window, "with_layout", lambda *given: calls.append(given) or place(*given))
    observe_window(dead(run.part(0, 24_000), channel="acc_rl"), car)
    assert len(calls) == 1


def test_the_residual_test_needs_no_samples(car, run, observations):
    """Learnt from and compared with what observations carry: as from the recordings themselves."""
    parts = [run.part(k, k + run.n_samples // 5) for k in range(0, run.n_samples, run.n_samples // 5)]
    outputs = [part.select(part.names[:4]) for part in parts]
    expected = learn_residuals(outputs, sampling_rate=25.0)
    baseline = learn(observations[:5], n_windows=5)
    assert baseline.residuals.n_windows == expected.n_windows
    np.testing.assert_allclose(baseline.residuals.center, expected.center, rtol=1e-9)
    last = run.part(0, run.n_samples // 5)
    tests = diagnose([one.without_segments() for one in observations], baseline).residual_tests
    assert tests.keys() == {one.time for one in observations}
    single = compare_residuals(expected, last.select(last.names[:4]))
    assert tests[3600.0].statistic == pytest.approx(single.statistic, rel=1e-9)
    assert tests[3600.0].p_value == pytest.approx(single.p_value, rel=1e-6)


def test_an_observation_without_segments_is_small(observations):
    """Four outputs at 11 lags: 1.4 kB."""
    residuals = observations[0].residuals
    assert residuals.mean.nbytes == 4 * 4 * 11 * 8
    assert residuals.segments.nbytes == residuals.n_segments * residuals.mean.nbytes
    compact = observations[0].without_segments()
    assert compact.residuals.segments is None
    assert compact.residuals.mean is residuals.mean or np.array_equal(compact.residuals.mean, residuals.mean)
    with pytest.raises(ParameterError, match="lacks the correlations of its segments"):
        learn_from_compact(observations)


def learn_from_compact(observations):
    from sprung.diagnosis import learn_reference

    return learn_reference([one.without_segments().residuals for one in observations])


def test_a_window_with_a_failing_sensor_has_no_residual_test(car, run):
    broken = observe_window(dead(run.part(0, 24_000), channel="acc_rl"), car)
    assert broken.sensor_faults
    assert broken.residuals is None


def test_a_second_opinion_that_disagrees_is_said(observations):
    baseline = learn(observations[:5], n_windows=5)
    agreed = diagnose(observations, baseline)
    (note,) = [note for note in agreed.notes if note.startswith("second opinion")]
    assert note.endswith("windows differ from those of the baseline (p < 0.001)")
    residuals = observations[0].residuals.without_segments()
    other = replace(residuals, mean=10 * residuals.mean[::-1])  # each channel moves as another one did, and much more
    strange = replace(observations[0], residuals=other, time=7200.0)
    tests = diagnose([strange], baseline)
    assert tests.residual_tests[7200.0].is_different
    assert any("it disagrees" in note for note in tests.notes)


def test_windows_of_several_vehicles_are_refused(observations):
    others = [replace(one, vehicle="other") for one in observations]
    with pytest.raises(ParameterError, match="of the vehicles other, zafira: give those of one"):
        learn([*observations, *others])
    baseline = learn(observations, n_windows=5)
    assert baseline.vehicle == "zafira"
    with pytest.raises(ParameterError, match="the baseline is of 'zafira'"):
        diagnose(others, baseline)
