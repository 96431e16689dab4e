"""Swings with friction: exact turns, exact motion in, deviations that hold, and no friction where there is none."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from sprung.identification.friction import beyond_one_swing, fit_friction, swing_with_friction

TIME = np.arange(400) / 100


@pytest.mark.parametrize("order", [0, 1, 2])
def test_the_swing_solves_the_equation_of_motion(order) -> None:
    """Against a numerical integration between turns, up to the third."""
    omega, xi, friction = 2 * np.pi * 1.3, 0.08, 0.06
    state, begin, times, values = np.array([1.0, 0.0]), 0.0, [], []
    for sign in (-1.0, 1.0, -1.0):

        def slope(_, x, sign=sign):
            return [x[1], -2 * xi * omega * x[1] - omega**2 * (x[0] + friction * sign)]

        half = np.pi / (omega * np.sqrt(1 - xi**2))
        dense = np.linspace(0, half, 60)
        solved = solve_ivp(slope, (0, half), state, t_eval=dense, rtol=1e-10, atol=1e-12)
        times.append(begin + dense[1:-1])
        derivatives = [solved.y[0], solved.y[1], np.array([slope(0, x)[1] for x in solved.y.T])]
        values.append(derivatives[order][1:-1])
        state, begin = solved.y[:, -1], begin + half
    exact = swing_with_friction(
        np.concatenate(times), natural_frequency=1.3, damping_ratio=xi, friction=friction, order=order
    )
    np.testing.assert_allclose(exact, np.concatenate(values), atol=1e-6 * omega**order)


@pytest.mark.parametrize(("xi", "friction"), [(0.1, 0.05), (0.05, 0.1), (0.2, 0.02)])
def test_exact_motion_gives_exact_friction(xi, friction) -> None:
    swing = swing_with_friction(TIME, natural_frequency=1.5, damping_ratio=xi, friction=friction)
    fit = fit_friction(np.stack([0.02 * swing + 3.0, -0.01 * swing]), 100.0, frequency=1.4)
    assert fit.natural_frequency == pytest.approx(1.5, rel=1e-9)
    assert fit.damping_ratio == pytest.approx(xi, rel=1e-8)
    np.testing.assert_allclose(fit.sticking, friction * np.array([0.02, 0.01]), rtol=1e-8)
    np.testing.assert_allclose(fit.motion(TIME)[0], 0.02 * swing + 3.0, atol=1e-10)
    assert fit.is_significant


@pytest.mark.slow
def test_deviations_are_those_of_the_errors() -> None:
    swing = swing_with_friction(TIME, natural_frequency=1.5, damping_ratio=0.1, friction=0.05)
    errors = []
    for seed in range(25):
        noisy = swing + 0.01 * np.random.default_rng(seed).standard_normal(400)
        fit = fit_friction(noisy[None], 100.0, frequency=1.4)
        errors.append((fit.damping_ratio - 0.1) / fit.damping_ratio_std)
        errors.append((fit.friction - 0.05) / fit.friction_std)
    assert np.sqrt(np.mean(np.square(errors))) == pytest.approx(1.0, abs=0.3)


def test_a_linear_swing_has_no_friction() -> None:
    swing = swing_with_friction(TIME, natural_frequency=1.5, damping_ratio=0.15, friction=0.0)
    fits = [
        fit_friction((swing + 0.01 * np.random.default_rng(seed).standard_normal(400))[None], 100.0, frequency=1.4)
        for seed in range(10)
    ]
    assert not any(fit.is_significant for fit in fits)
    np.testing.assert_allclose(fits[0].equivalent[0], [1.5, 0.15], rtol=0.03)


def test_two_motions_are_beyond_one_swing() -> None:
    """Two orthogonal motions of equal power in two channels: one of them explains half of the power."""
    time = np.arange(200) / 100
    both = np.stack([np.sin(2 * np.pi * time), np.cos(2 * np.pi * time)])
    assert beyond_one_swing(both) == pytest.approx(np.sqrt(0.5), rel=1e-12)
    assert beyond_one_swing(np.outer([1.0, -3.0], both[0])) < 1e-12
