"""Learning: which windows are left out, how many are needed, and what the mean and the slopes are."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis import SensorFault, learn
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
    assert baseline.middle["payload"] == 120.0
    assert baseline.ranges["payload"] == (0.0, 240.0)


def test_windows_of_several_vehicles_are_refused(healthy) -> None:
    mixed = [replace(one, vehicle=name) for one in healthy(6) for name in ("zafira", "other")]
    with pytest.raises(ParameterError, match="of the vehicles other, zafira: give those of one"):
        learn(mixed)
    assert learn([replace(one, vehicle="zafira") for one in healthy(6)]).vehicle == "zafira"
