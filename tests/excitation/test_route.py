"""Curves, slopes and accelerations of a route against their closed forms."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.excitation import (
    GRAVITY,
    BodyAccelerations,
    CrossSlope,
    Route,
    SmoothSteps,
    SpeedProfile,
    constant_speed,
    random_cross_slope,
    random_curvature,
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


def test_random_curves_stay_below_the_largest_acceleration():
    generator = np.random.default_rng(3)
    speed = random_speed(1200.0, low=6.0, high=15.0, generator=generator)
    curvature = random_curvature(speed, duration=1200.0, largest=3.0, generator=generator)
    lateral = Route(speed, curvature).lateral(np.arange(0, 1200, 0.05))
    middles = np.abs(curvature.jumps[::2]) * 12.0**2
    assert middles.size > 30
    assert 2.0 < np.abs(lateral).max() < 3.0 * (15 / 6) ** 2  # the speed may change within a curve
    assert np.percentile(np.abs(lateral), 99) < 3.0
    assert lateral.min() < -1.5 < 1.5 < lateral.max()
    assert curvature([1e6]) == pytest.approx(0, abs=1e-12)


def test_slopes_raise_the_wheels_of_one_side():
    route = Route(constant_speed(10.0), cross_slope=steps([50.0], [0.03], [20.0]))
    motion = CrossSlope(route, (1.0, -2.0), (0.7, 0.6))
    heights = motion.samples(3000, sampling_rate=RATE, generator=np.random.default_rng(0))
    assert heights[:, -1] == pytest.approx([0.021, -0.021, 0.018, -0.018])
    assert heights[2, 400:] / 0.6 == pytest.approx(np.roll(heights[0], 30)[400:] / 0.7)  # 3 m behind are 0.3 s
    accelerations = BodyAccelerations(route).samples(3000, sampling_rate=RATE, generator=np.random.default_rng(0))
    assert accelerations[:, -1] == pytest.approx([0.0, 0.03 * GRAVITY])


def test_random_slopes_stay_below_the_largest():
    slope = random_cross_slope(10e3, largest=0.03, generator=np.random.default_rng(1))
    values = slope(np.arange(0, 10e3, 0.5))
    assert 0.02 < np.abs(values).max() <= 0.03
    assert values[0] == 0


def test_a_route_continues():
    speed = SpeedProfile(np.array([0.0, 5.0, 10.0]), np.array([4.0, 12.0, 6.0]))
    route = Route(speed, steps([30.0], [0.01], [5.0]), steps([40.0], [0.02], [9.0]), has_longitudinal=True)
    for motion in (BodyAccelerations(route), CrossSlope(route, (1.0, -1.0), (0.7, 0.7))):
        assert motion.is_smooth
        whole = motion.samples(1000, sampling_rate=RATE, generator=np.random.default_rng(0))
        later = motion.samples(400, sampling_rate=RATE, generator=np.random.default_rng(1), start=6.0)
        assert whole.shape == (motion.n_inputs, 1000)
        assert later == pytest.approx(whole[:, 600:])


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: steps([0.0], [1.0, 2.0], [1.0]), "1 knots need as many jumps and widths above 0, not 2 and 1"),
        (lambda: steps([0.0], [1.0], [0.0]), "widths above 0"),
        (lambda: random_cross_slope(1.0, largest=0.0, generator=np.random.default_rng(0)), "largest cross slope=0"),
    ],
)
def test_impossible_routes_are_refused(call, message):
    with pytest.raises(ParameterError, match=message):
        call()
