"""Free responses: exact poles from exact motion, derivatives, and what random forces and several records change."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood.free_poles import FreePoles
from sprung.likelihood.free_response import FreeResponse, free_lines, poles_of, realised_poles
from sprung.likelihood.modal import ModalParameters
from sprung.likelihood.search import scored
from sprung.modal import unit_shapes
from sprung.recording import Channel, Recording

FREQUENCY, DAMPING = np.array([1.2, 1.7, 4.0]), np.array([0.18, 0.05, 0.3])
SHAPES = np.array([[1, 0.5, 0.3], [-0.4 + 0.2j, 1, 0.1], [0.3, -0.6 - 0.1j, 1]])
POLES = 2 * np.pi * FREQUENCY * (1j * np.sqrt(1 - DAMPING**2) - DAMPING)
CHANNELS = tuple(Channel(f"acc_{k}", "acceleration") for k in range(3))


def decay(amplitudes, *, n_samples=400, rate=100.0, level=0.0, seed=0) -> Recording:
    """Return sampled free motion with an offset and white noise."""
    time = np.arange(n_samples) / rate
    motion = (SHAPES.T @ (np.asarray(amplitudes)[:, None] * np.exp(POLES[:, None] * time))).real
    noise = level * np.random.default_rng(seed).standard_normal(motion.shape)
    return Recording(motion + noise + np.array([[9.81], [0.0], [-3.0]]), rate, CHANNELS)


def begin(frequency=FREQUENCY, damping=DAMPING, noise=1e-4, force=0.0) -> ModalParameters:
    n = len(frequency)
    return ModalParameters(
        frequency, damping, np.zeros(1), np.zeros(n), SHAPES, force * np.eye(n, dtype=complex),
        np.full(3, noise), np.zeros(3),
    )  # fmt: skip


RUNS = [decay([1.0, 0.7j, 0.4 - 0.3j]), decay([0.2j, -0.9, 0.5], n_samples=333)]


@pytest.mark.parametrize("band", [(0.0, 50.0), (0.5, 8.0)])
@pytest.mark.parametrize("runs", [RUNS[:1], RUNS])
def test_exact_motion_gives_exact_poles(runs, band) -> None:
    """Two records of different lengths and states have one system, in any band and with any offset."""
    ((poles, shapes),) = realised_poles(free_lines(runs, band=band), n_states=[6], block_rows=6)
    order = np.argsort(np.abs(poles))
    np.testing.assert_allclose(poles[order], POLES, rtol=1e-9)
    largest = np.argmax(np.abs(SHAPES), axis=1)
    np.testing.assert_allclose(shapes[order] / shapes[order, largest][:, None], SHAPES, atol=1e-8)


def test_amplitudes_are_the_initial_states_less_the_final_ones() -> None:
    model = FreeResponse(free_lines(RUNS, band=(0.0, 50.0)), begin())
    fit = model.fitted(model.start)
    expected = np.array([[1.0, 0.7j, 0.4 - 0.3j], [0.2j, -0.9, 0.5]]) / 2
    lost = np.exp(POLES * np.array([[4.0], [3.33]]))
    np.testing.assert_allclose(fit.amplitudes, expected * (1 - lost), atol=1e-10)
    assert np.abs(fit.whitened).max() < 1e-9


@pytest.mark.slow
def test_exact_motion_is_found_from_a_start_nearby() -> None:
    model = FreeResponse(free_lines(RUNS, band=(0.3, 20.0)), begin(FREQUENCY * 1.02, DAMPING * 0.9))
    found = model.start
    for _ in range(8):
        model = model.with_noise(found)
        found, _ = scored(model, model.start)
    np.testing.assert_allclose(poles_of(model.modal.unpacked(found)), POLES, rtol=1e-9)


def test_a_search_begins_again_where_it_ended_if_a_shape_became_larger_elsewhere() -> None:
    """The largest channel is 1: another one that a search made larger is 1 next, and the first one smaller."""
    model = FreeResponse(free_lines(RUNS, band=(0.3, 20.0)), begin())
    shapes = SHAPES.copy()
    shapes[1, 2] = -1.5 - 0.2j
    ended = replace(model.begin, mode_shapes=shapes)
    again = model.with_noise(model.modal.packed(ended))
    np.testing.assert_allclose(again.modal.unpacked(again.start).mode_shapes, unit_shapes(shapes), atol=1e-12)


@pytest.mark.parametrize("has_forces", [False, True])
def test_gradient_and_information(has_forces) -> None:
    """Against finite differences, and against the mean curvature over draws of the noise."""
    noisy = [decay([1.0, 0.7j, 0.4], level=0.05), decay([0.2j, -0.9, 0.5], n_samples=333, level=0.05, seed=1)]
    model = FreeResponse(free_lines(noisy, band=(0.4, 15.0)), begin(force=1e-3 * has_forces), has_forces=has_forces)
    at = model.start + 0.01 * np.random.default_rng(2).standard_normal(model.start.size)
    _, gradient = model.objective(at)
    for k in range(at.size):
        step = np.zeros(at.size)
        step[k] = 1e-6
        slope = (model.objective(at + step)[0] - model.objective(at - step)[0]) / 2e-6
        assert slope == pytest.approx(gradient[k], rel=1e-4, abs=1e-3)
    lines = free_lines(RUNS, band=(0.4, 15.0))
    exact = replace(model, data=lines)
    of_mean = exact.information(exact.start)[np.ix_(range(3), range(3))]
    slopes = []
    for k in range(3):
        step = np.zeros(at.size)
        step[k] = 1e-5
        slopes.append((exact.objective(exact.start + step)[1] - exact.objective(exact.start - step)[1])[:3] / 2e-5)
    if not has_forces:
        np.testing.assert_allclose(np.array(slopes), of_mean, rtol=1e-3, atol=1e-3 * np.abs(of_mean).max())


def test_leverages_add_up_to_the_parameters_of_the_mean() -> None:
    """Trace of a projection: shapes, frequencies, damping, states of two records; shares are of two numbers."""
    noisy = [decay([1.0, 0.7j, 0.4], level=0.05), decay([0.2j, -0.9, 0.5], n_samples=333, level=0.05, seed=1)]
    model = FreeResponse(free_lines(noisy, band=(0.4, 15.0)), begin())
    shares = model.leverages(model.start)
    assert 2 * shares.sum() == pytest.approx(2 * 3 + 2 * 3 * 2 + 2 * 3 * 2)
    assert np.all(shares >= 0)
    assert np.all(shares < 1)


def test_a_further_pole_is_sought_where_the_others_have_left_the_band() -> None:
    data = free_lines(RUNS, band=(0.4, 15.0))
    found = FreePoles(data, POLES[:1] / 1000).with_another(nearer=0.5)
    assert len(found.poles) == 2
    assert np.abs(found.poles[1]) > np.abs(POLES[0]) / 10
