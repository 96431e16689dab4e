"""Learning: which windows are left out, how many are needed, and what the mean and the slopes are."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis import SensorFault, detect, learn
from sprung.diagnosis.baseline import prior_information, units_of
from sprung.errors import DataError, ParameterError


def test_suspect_windows_are_not_learnt_from(window, healthy, silent) -> None:
    good = healthy(10)
    generator = np.random.default_rng(9)
    bad = [window(generator, 0.0, {"front_left.spring": -0.4}), window(generator, 0.0, {"rear_left.tyre": 0.5})]
    faulty_sensor = replace(good[0], sensor_faults=(SensorFault("acc_fl", "noisy", ""),))
    found = learn([*good, *bad, faulty_sensor, silent("standing")])
    assert (found.n_windows, found.n_refused) == (10, 4)
    assert np.abs(found.mean[0]) < 0.1


def test_too_few_windows_are_refused_with_the_reason(healthy, silent) -> None:
    too_short = silent("12 segments are too few")
    with pytest.raises(
        DataError, match=r"3 of 5 windows can be learnt from, .* 6 are needed: .*\(12 segments are too few\)"
    ):
        learn([*healthy(3), too_short, too_short])


def test_the_next_learning_has_the_next_version(healthy) -> None:
    first = learn(healthy(12))
    later = learn(healthy(8), reason="new dampers", previous=first)
    assert (first.version, first.reason) == (1, "first learning")
    assert (later.version, later.reason) == (2, "new dampers")


def test_windows_without_scatter_give_their_mean_middle_and_ranges(healthy) -> None:
    """Identical windows but for the payload: mean their own, no slope, median and range of the payload."""
    (one,) = healthy(1)
    every = [replace(one, conditions={**one.conditions, "payload": 40.0 * k}) for k in range(7)]
    baseline = learn(every)
    np.testing.assert_allclose(baseline.mean, one.log_ratios, atol=1e-12)
    np.testing.assert_allclose(baseline.slopes, 0, atol=1e-12)
    assert baseline.centre["payload"] == 120.0
    assert baseline.ranges["payload"] == (0.0, 240.0)


def test_means_and_slopes_are_as_uncertain_as_the_windows_scatter(healthy) -> None:
    """The information is that of the covariance with which windows are compared: X^T X (x) V^-1 + P."""
    windows = healthy(12)
    baseline = learn(windows)
    assert baseline.n_windows == 12
    rows = np.array([np.concatenate([[1.0], units_of(one.conditions, baseline.centre)]) for one in windows])
    of_windows = np.kron(rows.T @ rows, np.linalg.inv(baseline.covariance + baseline.nuisance))
    prior = prior_information(baseline.components, np.zeros_like(baseline.covariance))
    np.testing.assert_allclose(baseline.information, of_windows + prior, rtol=1e-9, atol=1e-6)


def test_windows_of_several_vehicles_are_refused(healthy) -> None:
    mixed = [replace(one, vehicle=name) for one in healthy(6) for name in ("zafira", "other")]
    with pytest.raises(ParameterError, match="of the vehicles other, zafira: give those of one"):
        learn(mixed)
    assert learn([replace(one, vehicle="zafira") for one in healthy(6)]).vehicle == "zafira"


def is_alerted(baseline, observations) -> bool:
    found = detect(baseline, observations)
    assert found is not None
    return found.first_alert is not None


def warm(generator, healthy_window, *, per_kelvin, scatter, scale=1.0):
    """Return a window whose dampers lose some of their damping per kelvin, all together, and scatter by a factor."""
    temperature = float(generator.uniform(0, 40))
    dampers = np.array([component.kind == "damper" for component in healthy_window.components])
    own = np.sqrt(scale) * np.linalg.cholesky(healthy_window.covariance) @ generator.standard_normal(12)
    common = per_kelvin * (temperature - 20) + generator.normal(0, scatter)
    conditions = {**healthy_window.conditions, "temperature": temperature}
    return replace(healthy_window, log_ratios=own + dampers * common, conditions=conditions)


def test_windows_that_scatter_less_than_they_report_narrow_the_baseline(healthy) -> None:
    """A tenth of the reported standard deviation in 24 windows: the baseline's is within a third of it."""
    generator = np.random.default_rng(1)
    every = [warm(generator, one, per_kelvin=0.0, scatter=0.0, scale=0.01) for one in healthy(24)]
    learnt = learn(every)
    ratio = np.sqrt(np.diag(learnt.covariance) / np.diag(learnt.reported))
    assert np.all((ratio > 0.07) & (ratio < 0.2))
    np.testing.assert_allclose(learnt.covariance_of(every[0]), learnt.covariance + learnt.nuisance)
    wide = replace(every[0], covariance=4 * every[0].covariance)
    np.testing.assert_allclose(np.diag(learnt.covariance_of(wide) - learnt.nuisance), 4 * np.diag(learnt.covariance))


def test_dampers_that_weaken_together_are_found_where_the_temperature_is_known(healthy) -> None:
    """-0.9 % per kelvin is no change; -20 % of all dampers is, and a cold day that was never met is not."""
    generator = np.random.default_rng(2)
    every = [warm(generator, one, per_kelvin=-0.009, scatter=0.022) for one in healthy(30)]
    learnt = learn(every[:24])
    dampers = np.array([component.kind == "damper" for component in learnt.components])
    assert learnt.slopes[dampers, 3].mean() == pytest.approx(-0.09, abs=0.015)
    assert not is_alerted(learnt, every[24:])
    weak = [replace(one, log_ratios=one.log_ratios + np.log(0.8) * dampers) for one in every[24:]]
    found = detect(learnt, weak)
    assert found is not None
    assert found.is_alert
    assert found.candidates[0].hypothesis.name == "all.damper"
    cold = [
        replace(
            one,
            log_ratios=one.log_ratios - 0.009 * (-25 - one.conditions["temperature"]) * dampers,
            conditions={**one.conditions, "temperature": -25.0},
        )
        for one in every[24:]
    ]
    assert not is_alerted(learnt, cold)


def test_a_change_of_all_is_no_evidence_without_the_temperature(healthy) -> None:
    generator = np.random.default_rng(3)
    every = [warm(generator, one, per_kelvin=0.0, scatter=0.01) for one in healthy(18)]
    of_healthy = healthy(1)[0].conditions
    unknown = [replace(one, conditions={name: one.conditions[name] for name in of_healthy}) for one in every]
    dampers = np.array([component.kind == "damper" for component in every[0].components])
    weak = [replace(one, log_ratios=one.log_ratios + np.log(0.8) * dampers) for one in unknown[12:]]
    assert not is_alerted(learn(unknown[:12]), weak)
    assert not is_alerted(learn(every[:12]), weak)
