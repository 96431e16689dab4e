"""Plans of kits of sensors."""

import re

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.kits import CHANGES, best_places, candidates, kit_of, plan
from sprung.likelihood.expected import ExpectedDrive, ExpectedFit, expected_fit
from sprung.vehicles import read_vehicle

CAR = read_vehicle("zafira")
SHORT = ExpectedDrive(minutes=5.0)


@pytest.fixture(scope="module")
def plans():
    return {name: plan(kit_of(CAR, name), drive=SHORT) for name in ("four", "two")}


def test_fewer_sensors_find_changes_later(plans) -> None:
    four, two = plans["four"], plans["two"]
    for more, fewer in zip(four.components, two.components, strict=True):
        assert more.contrast_std < fewer.contrast_std
        assert all(fewer.minutes[change] is None or more.minutes[change] <= fewer.minutes[change] for change in CHANGES)


def test_larger_changes_are_found_sooner(plans) -> None:
    for part in plans["two"].components:
        known = [part.minutes[change] for change in CHANGES if part.minutes[change] is not None]
        assert known == sorted(known, reverse=True)


def test_a_redundant_sensor_buys_no_precision(plans) -> None:
    assert all(0 <= sensor.gain < 0.05 for sensor in plans["four"].sensors)
    assert all(sensor.gain > 0.5 for sensor in plans["two"].sensors)


def test_noisier_accelerometers_are_less_precise(plans) -> None:
    noisy = plan(kit_of(CAR, "two"), drive=ExpectedDrive(minutes=5.0, accelerometer_noise=0.05))
    for noisier, usual in zip(noisy.components, plans["two"].components, strict=True):
        assert noisier.std > usual.std


def test_front_against_rear_is_the_ratio_of_the_means_of_axles() -> None:
    """Of independent values of one standard deviation s, the ratio of means of two has s; the covariance decides."""
    fit = expected_fit(kit_of(CAR, "four"), SHORT)
    alone = ExpectedFit(fit.components, 0.04 * np.eye(len(fit.components)), fit.prior_std)
    assert list(alone.axle_std.values()) == pytest.approx([0.2] * len(fit.components))
    assert fit.axle_std[fit.components[0]] < fit.std[fit.components[0]]


@pytest.mark.slow
def test_the_best_three_places_are_no_worse_than_the_kit() -> None:
    chosen = best_places(CAR, candidates(CAR), 3, drive=SHORT)
    best = plan(CAR.model_copy(update={"sensor": chosen}), drive=SHORT)
    kit = plan(kit_of(CAR, "three"), drive=SHORT)
    found, given = ([part.contrast_std or 0.0 for part in each.components] for each in (best, kit))
    assert sum(found) <= 1.001 * sum(given)


def test_an_unknown_kit_is_refused() -> None:
    with pytest.raises(ParameterError, match="imu"):
        kit_of(CAR, "five")


def test_a_part_that_one_sensor_hardly_sees_is_not_found_at_once() -> None:
    """Chance explains more of the first window than any change of the tyre of the far wheel."""
    one = CAR.model_copy(update={"sensor": kit_of(CAR, "four").sensor[:1]})
    conditions = ExpectedDrive(speed=(6.0, 20.0), roughness=256e-6, sampling_rate=100.0, driving=1e-5)
    parts = {str(part.component): part for part in plan(one, drive=conditions).components}
    assert not parts["front_right.tyre"].is_identifiable
    assert set(parts["front_right.tyre"].minutes.values()) == {None}


def test_a_plan_begins_with_when_a_loss_is_found_and_takes_the_rate_of_the_sensors(sprung) -> None:
    """A spring is as well known at 25 Hz; the wheel hops at 12 Hz, near the end of what that rate shows."""
    slow, fast = (sprung("plan", "zafira", "--kit", "imu", "--sampling-rate", str(rate)) for rate in (25, 200))
    for outcome in (slow, fast):
        first = next(line for line in outcome.out.splitlines() if line.startswith("- "))
        assert re.match(r"- a loss of 10 % of each part is found after \d+ min", first)
    of_tyre = [outcome.out.split("front left tyre")[1].split()[1] for outcome in (slow, fast)]
    assert float(of_tyre[0]) > 1.2 * float(of_tyre[1])


def test_one_sensor_is_planned_and_none_is_refused() -> None:
    one = plan(CAR.model_copy(update={"sensor": CAR.sensor[:1]}), drive=SHORT)
    assert [sensor.gain for sensor in one.sensors] == [1.0]
    with pytest.raises(ParameterError, match="no sensor of its motion"):
        plan(CAR.model_copy(update={"sensor": ()}), drive=SHORT)
