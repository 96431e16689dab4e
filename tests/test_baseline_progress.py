"""Progress of a baseline: shares of the information of ordinary windows, and the drive that brings the rest."""

import numpy as np
import pytest

from sprung.baseline_progress import learning_progress
from sprung.diagnosis import Observation, SensorFault, observe_window
from sprung.errors import ParameterError
from sprung.likelihood.expected import ExpectedDrive, expected_fit
from sprung.simulation import RoadConditions, RoadDrive, simulate_drive
from sprung.vehicles import read_vehicle

CAR = read_vehicle("zafira")


def window(drive: ExpectedDrive, *, faults: tuple[SensorFault, ...] = ()) -> Observation:
    """Return a window that is as precise as expected."""
    fit = expected_fit(CAR, drive)
    conditions = {"speed": float(np.mean(drive.speed)), "roughness": drive.roads[0][0]}
    return Observation(0.0, fit.components, np.zeros(len(fit.components)), fit.covariance, conditions, {}, faults)


@pytest.mark.parametrize("n_windows", [0, 3, 6, 12, 20])
def test_ordinary_windows_bring_their_share(n_windows: int) -> None:
    progress = learning_progress([window(ExpectedDrive())] * n_windows, CAR)
    np.testing.assert_allclose(list(progress.shares.values()), min(n_windows / 12, 1.0), rtol=1e-9)
    assert bool(progress.advice) is (n_windows < 12)


def test_windows_with_failing_sensors_bring_nothing() -> None:
    failing = window(ExpectedDrive(), faults=(SensorFault("acc_fl", "dead", "it is constant"),))
    assert set(learning_progress([failing] * 12, CAR).shares.values()) == {0.0}


def test_slow_drives_ask_for_faster_ones() -> None:
    slow = [window(ExpectedDrive(speed=(4.0, 7.0)))] * 12
    progress = learning_progress(slow, CAR)
    first, share = next(iter(progress.shares.items()))
    assert share < 0.9
    assert first in str(progress)
    assert progress.advice.startswith("drive faster")
    mixed = learning_progress([*slow, *[window(ExpectedDrive(speed=(10.0, 25.0)))] * 6], CAR)
    assert mixed.shares[first] > share


def test_ordinary_roads_need_more_of_the_same() -> None:
    assert learning_progress([window(ExpectedDrive(speed=(14.0, 26.0)))] * 6, CAR).advice == "drive on as before"


def test_a_rail_vehicle_is_compared_with_ordinary_tracks() -> None:
    """Most of what it has no sides of left aside: a track of ERRI B176 low is enough, and the sentence names few."""
    metro, ordinary = read_vehicle("metro"), ExpectedDrive(speed=(15.0, 30.0), roughness=5e-6)
    fit = expected_fit(metro, ordinary)
    conditions = {"speed": 22.0, "roughness": 5e-6}
    whole = Observation(0.0, fit.components, np.zeros(len(fit.components)), fit.covariance, conditions, {}, ())
    assert str(learning_progress([whole], metro, n_needed=1)) == (
        "the drives determine all parts as well as 1 ordinary window"
    )
    weak = Observation(0.0, fit.components, whole.log_ratios, 0.02**2 * np.eye(len(fit.components)), conditions, {}, ())
    sentence = str(learning_progress([weak], metro, n_needed=2))
    assert sentence.count(":") == 3
    assert " and 9 others up to " in sentence
    assert "road" not in sentence


@pytest.mark.slow
def test_the_advice_holds_in_a_simulated_drive() -> None:
    """A window of the advised speed brings more by at least the factor from which it is advised."""
    shares = []
    for speed in ((3.5, 6.5), (7.0, 13.0)):
        drive = RoadDrive(duration=300.0, sampling_rate=60.0, speed=speed, road=RoadConditions("B"), snr=50.0)
        observed = observe_window(simulate_drive(CAR, drive, seed=3).recording, CAR)
        progress = learning_progress([observed], CAR)
        shares.append(np.exp(np.mean(np.log(list(progress.shares.values())))))
    assert shares[1] > 1.3 * shares[0]


def test_a_number_of_windows_below_one_is_refused() -> None:
    with pytest.raises(ParameterError, match="n_needed"):
        learning_progress([], CAR, n_needed=0)
