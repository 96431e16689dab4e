"""Contributions of modes to the correlations, and shapes completed to all channels."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import signal

from sprung.identification.contribution import complete_shapes, contributions
from sprung.identification.correlation import average, correlate_segments, exact_correlations
from sprung.identification.subspace import poles_of_orders, realise
from sprung.modal import mac
from sprung.simulation import simulate, usual_excitation

BLOCK_ROWS = 20


def test_contributions_are_large_for_true_modes_and_about_1_for_poles_that_are_not_there(vehicle, measured) -> None:
    exact, generator = vehicle("chain3").modes(), np.random.default_rng(0)
    ghosts = 2 * np.pi * np.array([12.0, 24.0, 40.0]) * (-0.02 + 1j)
    poles = np.concatenate([exact.poles, ghosts])
    found = []
    for seed in range(30):
        shapes = generator.normal(size=(3, 3)) + 1j * generator.normal(size=(3, 3))
        correlations = measured(seed)
        found.append(contributions(poles, np.concatenate([exact.mode_shapes, shapes]), correlations)[0])
    assert np.min(found, axis=0)[:3].min() > 15
    np.testing.assert_allclose(np.mean(found, axis=0)[3:], 1, atol=0.35)


def test_what_a_sensor_has_alone_contributes_nothing(vehicle) -> None:
    """A resonance in the electronics of one sensor, twice as strong as its signal, at 13 Hz."""
    exact, generator = vehicle("chain3").modes(), np.random.default_rng(0)
    own = 2 * np.pi * 13.0 * (-0.01 + 1j * np.sqrt(1 - 0.01**2))
    root = np.exp(own / 125.0)
    found = []
    for seed in range(30):
        chain = vehicle("chain3")
        run = simulate(chain, usual_excitation(chain), duration=60.0, sampling_rate=125.0, snr=10.0, seed=seed)
        ringing = signal.lfilter([1], np.poly([root, root.conj()]).real, generator.normal(size=run.n_samples + 2000))
        ringing = ringing[2000:] / ringing.std()
        samples = run.samples.copy()
        samples[0] += 2 * samples[0].std() * ringing
        correlations = average(
            correlate_segments(run.changed("", samples=samples), n_lags=40, segment=2.0, is_continued=True)
        )
        realised = poles_of_orders(realise(correlations, block_rows=BLOCK_ROWS, max_order=8), [8])
        nearest = np.argmin(np.abs(realised.poles - own))
        assert np.abs(realised.poles[nearest] - own) < 0.05 * np.abs(own)
        poles = np.append(exact.poles, realised.poles[nearest])
        shapes = np.concatenate([exact.mode_shapes, realised.mode_shapes[nearest : nearest + 1]])
        found.append(contributions(poles, shapes, correlations)[0])
    assert np.median(found, axis=0)[3] < 2
    assert np.median(found, axis=0)[:3].min() > 10


def test_auto_correlations_do_not_count_where_there_are_others(vehicle, measured) -> None:
    exact, correlations = vehicle("chain3").modes(), measured(1)
    own = np.eye(3)[:, :, None] * np.random.default_rng(0).normal(size=40)
    own_blocks = np.arange(len(correlations.blocks))[:, None, None, None] * own
    changed = replace(correlations, values=correlations.values + 5 * own, blocks=correlations.blocks + own_blocks)
    wanted = contributions(exact.poles, exact.mode_shapes, correlations)[0]
    np.testing.assert_allclose(contributions(exact.poles, exact.mode_shapes, changed)[0], wanted, rtol=1e-9)


def test_a_single_channel_is_judged_by_its_auto_correlation(vehicle, measured) -> None:
    exact, correlations = vehicle("chain3").modes(), measured(1).select(["acc_3"], ["acc_3"])
    ghost = 2 * np.pi * 12.0 * (-0.02 + 1j)
    found = contributions(np.append(exact.poles, ghost), np.ones((4, 1), dtype=complex), correlations)[0]
    assert found[:3].min() > 30
    assert found[3] < 5


def test_contributions_do_not_depend_on_the_scale_of_shapes_or_units(vehicle, measured) -> None:
    exact, correlations = vehicle("chain3").modes(), measured(2)
    in_other_units = replace(correlations, values=correlations.values * 1e6, blocks=correlations.blocks * 1e6)
    wanted = contributions(exact.poles, exact.mode_shapes, correlations)[0]
    np.testing.assert_allclose(contributions(exact.poles, 3j * exact.mode_shapes, in_other_units)[0], wanted, rtol=1e-9)


def test_exact_correlations_leave_no_room_for_chance(known) -> None:
    correlations, poles, shapes = known("chain3", 125.0)
    assert np.isinf(contributions(poles, shapes, correlations)[0]).all()


@pytest.mark.parametrize(
    ("name", "rate", "outputs"),
    [("chain3", 125.0, "2"), ("chain3", 125.0, "13"), ("zafira", 100.0, "14"), ("zafira", 100.0, "231")],
)
def test_shapes_on_some_channels_are_completed_to_all(known, name, rate, outputs) -> None:
    correlations, poles, shapes = known(name, rate)
    rows = [int(channel) - 1 for channel in outputs]
    completed = complete_shapes(poles, (2 - 1j) * shapes[:, rows], correlations, tuple(outputs))
    assert completed.shape == shapes.shape
    assert 1 - np.diag(mac(completed, shapes)).min() < 1e-9
    np.testing.assert_allclose(completed[:, rows], (2 - 1j) * shapes[:, rows], atol=1e-6)


def test_completion_does_not_look_at_auto_correlations(known) -> None:
    correlations, poles, shapes = known("chain3", 125.0)
    values = correlations.values + np.eye(3)[:, :, None] * np.cos(np.arange(correlations.n_lags))
    noisy = exact_correlations(values, sampling_rate=125.0)
    completed = complete_shapes(poles, shapes[:, [0, 2]], noisy, ("1", "3"))
    assert 1 - np.diag(mac(completed, shapes)).min() < 1e-9
