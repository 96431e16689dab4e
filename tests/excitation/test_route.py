"""Curves, slopes and accelerations of a route against their closed forms."""

import numpy as np
import pytest
from scipy.integrate import quad

from sprung.excitation import (
    GRAVITY,
    BodyAccelerations,
    CrossSlope,
    Route,
    SmoothSteps,
    SpeedChanges,
    SpeedProfile,
    constant_speed,
    random_speed,
)

RATE = 100.0


def steps(knots, jumps, widths):
    return SmoothSteps(np.array(knots), np.array(jumps), np.array(widths))


def test_a_step_is_an_integrated_hann_window():
    step = steps([2.0], [3.0], [0.8])
    x = np.linspace(0, 4, 4001)
    assert step([1.6, 2.0, 2.4]) == pytest.approx([0.0, 1.5, 3.0])
    window = np.where(np.abs(x - 2) < 0.4, (1 + np.cos(2 * np.pi * (x - 2) / 0.8)) / 0.8, 0.0)
    assert np.gradient(step(x), x) == pytest.approx(3 * window, abs=1e-3)


def test_steps_add_up_where_they_overlap():
    x = np.linspace(-1, 3, 500)
    both = steps([0.0, 0.3], [1.0, -2.0], [1.0, 0.5])(x)
    assert both == pytest.approx(steps([0.0], [1.0], [1.0])(x) + steps([0.3], [-2.0], [0.5])(x))


@pytest.mark.slow
def test_the_integral_of_the_acceleration_is_the_speed():
    speed = random_speed(300.0, low=5.0, high=20.0, n_stops=2, generator=np.random.default_rng(1))
    time = np.arange(0, 300, 1e-3)
    acceleration = Route(speed, has_longitudinal=True).longitudinal(time)
    integral = speed.speed(0) + np.cumsum(acceleration) * 1e-3
    far = np.min(np.abs(time - speed.times[:, None]), axis=0) > 0.3
    assert integral[far] == pytest.approx(speed.speed(time)[far], abs=2e-3)
    assert Route(speed).longitudinal(time) == pytest.approx(0)


def test_a_steady_curve_has_the_centripetal_acceleration():
    route = Route(constant_speed(10.0), steps([20.0], [1 / 50], [10.0]))
    assert route.lateral([0.0, 5.0]) == pytest.approx([0.0, 10.0**2 / 50])
    assert route.yaw_rate([0.0, 5.0]) == pytest.approx([0.0, 10.0 / 50])


def test_slopes_raise_the_wheels_of_one_side():
    route = Route(constant_speed(10.0), cross_slope=steps([50.0], [0.03], [20.0]))
    motion = CrossSlope(route, (1.0, -2.0), (0.7, 0.6))
    heights = motion.samples(3000, sampling_rate=RATE, generator=np.random.default_rng(0))
    assert heights[:, -1] == pytest.approx([0.021, -0.021, 0.018, -0.018])
    assert heights[2, 400:] / 0.6 == pytest.approx(np.roll(heights[0], 30)[400:] / 0.7)  # 3 m behind are 0.3 s
    accelerations = BodyAccelerations(route).samples(3000, sampling_rate=RATE, generator=np.random.default_rng(0))
    assert accelerations[:, -1] == pytest.approx([0.0, 0.03 * GRAVITY])


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


def test_changes_stay_within_their_ranges() -> None:
    changes = SpeedChanges(accelerating=(1.0, 2.0), braking=(2.5, 4.0), steady=(5.0, 6.0))
    profile = random_speed(600.0, low=5.0, high=20.0, n_stops=2, generator=np.random.default_rng(1), changes=changes)
    rates = np.diff(profile.speeds) / np.diff(profile.times)
    long_enough = np.diff(profile.times) > 0.1001  # a change takes at least 0.1 s
    rising, falling = rates[(rates > 0) & long_enough], rates[(rates < 0) & long_enough]
    assert 1.0 <= rising.min() < rising.max() <= 2.0
    assert -4.0 <= falling.min() < falling.max() <= -2.5
