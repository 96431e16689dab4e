import numpy as np
import pytest
from scipy.integrate import quad

from sprung.errors import ParameterError
from sprung.excitation import SpeedChanges, SpeedProfile, constant_speed, random_speed


def test_distance_is_the_integral_of_the_speed() -> None:
    profile = random_speed(120.0, low=5.0, high=20.0, n_stops=2, generator=np.random.default_rng(3))
    for end in (0.3, 17.0, 60.0, 119.0):
        knots = [t for t in profile.times if 0 < t < end]
        integral = quad(lambda time: float(profile.speed(time)), 0, end, points=knots, limit=500)[0]
        assert profile.distance(end) == pytest.approx(integral, rel=1e-9)


def test_before_the_start_the_first_speed_goes_on() -> None:
    profile = SpeedProfile(np.array([0.0, 10.0]), np.array([5.0, 15.0]))
    assert profile.distance([-2.0, 0.0]).tolist() == [-10.0, 0.0]


def test_random_speed_stays_in_range_and_stops() -> None:
    profile = random_speed(600.0, low=5.0, high=11.0, n_stops=3, generator=np.random.default_rng(1))
    time = np.arange(0, 600, 0.1)
    speed = profile.speed(time)
    stops = np.flatnonzero(np.diff((speed == 0).astype(int)) == 1).size
    assert stops == 3
    assert speed.max() <= 11
    assert np.abs(np.diff(speed) / 0.1).max() < 2.0  # m/s^2
    held = profile.speeds[profile.speeds > 0]
    assert held.min() >= 5


def test_random_speed_is_reproducible() -> None:
    first, second = (random_speed(60.0, low=5.0, high=9.0, generator=np.random.default_rng(4)) for _ in range(2))
    assert np.array_equal(first.speeds, second.speeds)


@pytest.mark.parametrize(("times", "speeds"), [([0, 0], [1, 1]), ([0, 1], [1, -1]), ([], []), ([0], [np.nan])])
def test_impossible_profiles_are_refused(times, speeds) -> None:
    with pytest.raises(ParameterError):
        SpeedProfile(times, speeds)


def test_standing_still() -> None:
    assert constant_speed(0.0).distance([0.0, 100.0]).tolist() == [0.0, 0.0]


def test_changes_stay_within_their_ranges() -> None:
    changes = SpeedChanges(accelerating=(1.0, 2.0), braking=(2.5, 4.0), steady=(5.0, 6.0))
    profile = random_speed(600.0, low=5.0, high=20.0, n_stops=2, generator=np.random.default_rng(1), changes=changes)
    rates = np.diff(profile.speeds) / np.diff(profile.times)
    long_enough = np.diff(profile.times) > 0.1001  # a change takes at least 0.1 s
    rising, falling = rates[(rates > 0) & long_enough], rates[(rates < 0) & long_enough]
    assert 1.0 <= rising.min() < rising.max() <= 2.0
    assert -4.0 <= falling.min() < falling.max() <= -2.5
    with pytest.raises(ParameterError, match=r"largest braking=1 must be at least 2"):
        SpeedChanges(braking=(2.0, 1.0))
