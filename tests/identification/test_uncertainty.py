"""First-order uncertainty of poles, contributions of modes, and shapes completed to all channels."""

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
FORMS = {
    "Toeplitz, weighted": {},
    "Toeplitz, unweighted": {"is_weighted": False},
    "Hankel": {"is_hankel": True},
}


# Uncertainty


def perturbed(correlations, change):
    """Correlations whose two blocks differ from exact ones by plus and minus a change."""
    blocks = np.stack([correlations.values + change, correlations.values - change])
    return replace(correlations, blocks=blocks, weights=np.array([0.5, 0.5]), n_segments=2)


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize(
    ("case", "step", "tolerance"),
    [
        (("chain3", 125.0, "123"), 7e-7, 2e-6),
        (("chain3", 125.0, "13"), 7e-7, 2e-6),
        (("quarter", 250.0, "12"), 3e-7, 2e-6),
        (("zafira", 100.0, "1234"), 1e-9, 5e-4),
    ],
)
def test_standard_deviations_equal_a_finite_difference_of_the_poles(known, case, step, tolerance, form):
    """Two blocks that differ from the average by +-dLambda have the standard error abs(d pole).

    The weakest of the car's 14 states hangs on a singular value of 1e-4 of the largest: rounding, not the formula,
    sets its tolerance.
    """
    name, rate, references = case
    correlations, poles, _ = known(name, rate)
    correlations = correlations.select(correlations.channels, tuple(references))
    change = step * np.random.default_rng(8).normal(size=correlations.values.shape)

    def realised(changed):
        n = 2 * len(poles)
        found = poles_of_orders(realise(changed, block_rows=BLOCK_ROWS, max_order=n, **FORMS[form]), [n])
        return found, np.argmin(np.abs(found.poles[:, None] - poles), axis=0)

    def frequency_and_damping(values):
        found, nearest = realised(exact_correlations(values, sampling_rate=rate, references=references))
        return found.natural_frequency[nearest], found.damping_ratio[nearest]

    upper = frequency_and_damping(correlations.values + change)
    lower = frequency_and_damping(correlations.values - change)
    reported, nearest = realised(perturbed(correlations, change))
    for high, low, std in zip(upper, lower, ("natural_frequency_std", "damping_ratio_std"), strict=True):
        np.testing.assert_allclose(getattr(reported, std)[nearest], np.abs(high - low) / 2, rtol=tolerance)


@pytest.mark.parametrize("snr", [10.0, 0.5])
@pytest.mark.parametrize("is_weighted", [True, False])
def test_standard_deviations_are_those_of_repeated_runs(vehicle, measured, snr, is_weighted):
    """Monte Carlo of 100 runs of 60 s; the spread of 100 values is itself known to 7 %."""
    exact = vehicle("chain3").modes()
    runs = []
    for seed in range(100):
        correlations = measured(seed, snr=snr)
        realised = realise(correlations, block_rows=BLOCK_ROWS, max_order=6, is_weighted=is_weighted)
        poles = poles_of_orders(realised, [6])
        nearest = np.argmin(np.abs(poles.poles[:, None] - exact.poles), axis=0)
        names = ("natural_frequency", "damping_ratio", "natural_frequency_std", "damping_ratio_std")
        runs.append([getattr(poles, name)[nearest] for name in names])
    values, deviations = np.split(np.array(runs), 2, axis=1)
    ratio = np.median(deviations, axis=0) / values.std(axis=0, ddof=1)
    assert np.all((ratio > 0.8) & (ratio < 1.25)), ratio
    covered = np.mean(np.abs(values - values.mean(axis=0)) < 1.96 * deviations, axis=0)
    assert np.all(covered >= 0.88), covered


def test_ten_times_the_length_has_a_third_of_the_deviation(measured):
    short, long = (
        poles_of_orders(realise(measured(1, duration=duration), block_rows=BLOCK_ROWS, max_order=6), [6])
        for duration in (60.0, 600.0)
    )
    ratio = np.median(short.natural_frequency_std) / np.median(long.natural_frequency_std)
    assert ratio == pytest.approx(np.sqrt(10), rel=0.35)


# Contributions


def test_contributions_are_large_for_true_modes_and_about_1_for_poles_that_are_not_there(vehicle, measured):
    exact, generator = vehicle("chain3").modes(), np.random.default_rng(0)
    ghosts = 2 * np.pi * np.array([12.0, 24.0, 40.0]) * (-0.02 + 1j)
    poles = np.concatenate([exact.poles, ghosts])
    found = []
    for seed in range(30):
        shapes = generator.normal(size=(3, 3)) + 1j * generator.normal(size=(3, 3))
        correlations = measured(seed)
        found.append(contributions(poles, np.concatenate([exact.mode_shapes, shapes]), correlations))
    assert np.min(found, axis=0)[:3].min() > 15
    np.testing.assert_allclose(np.mean(found, axis=0)[3:], 1, atol=0.35)


def test_what_a_sensor_has_alone_contributes_nothing(vehicle):
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
        found.append(contributions(poles, shapes, correlations))
    assert np.median(found, axis=0)[3] < 2
    assert np.median(found, axis=0)[:3].min() > 10


def test_auto_correlations_do_not_count_where_there_are_others(vehicle, measured):
    exact, correlations = vehicle("chain3").modes(), measured(1)
    own = np.eye(3)[:, :, None] * np.random.default_rng(0).normal(size=40)
    own_blocks = np.arange(len(correlations.blocks))[:, None, None, None] * own
    changed = replace(correlations, values=correlations.values + 5 * own, blocks=correlations.blocks + own_blocks)
    wanted = contributions(exact.poles, exact.mode_shapes, correlations)
    np.testing.assert_allclose(contributions(exact.poles, exact.mode_shapes, changed), wanted, rtol=1e-9)


def test_a_single_channel_is_judged_by_its_auto_correlation(vehicle, measured):
    exact, correlations = vehicle("chain3").modes(), measured(1).select(["acc_3"], ["acc_3"])
    ghost = 2 * np.pi * 12.0 * (-0.02 + 1j)
    found = contributions(np.append(exact.poles, ghost), np.ones((4, 1), dtype=complex), correlations)
    assert found[:3].min() > 30
    assert found[3] < 5


def test_contributions_do_not_depend_on_the_scale_of_shapes_or_units(vehicle, measured):
    exact, correlations = vehicle("chain3").modes(), measured(2)
    in_other_units = replace(correlations, values=correlations.values * 1e6, blocks=correlations.blocks * 1e6)
    wanted = contributions(exact.poles, exact.mode_shapes, correlations)
    np.testing.assert_allclose(contributions(exact.poles, 3j * exact.mode_shapes, in_other_units), wanted, rtol=1e-9)


def test_exact_correlations_leave_no_room_for_chance(known):
    correlations, poles, shapes = known("chain3", 125.0)
    assert np.isinf(contributions(poles, shapes, correlations)).all()


# Shapes on all channels


@pytest.mark.parametrize(
    ("name", "rate", "outputs"),
    [("chain3", 125.0, "2"), ("chain3", 125.0, "13"), ("zafira", 100.0, "14"), ("zafira", 100.0, "231")],
)
def test_shapes_on_some_channels_are_completed_to_all(known, name, rate, outputs):
    correlations, poles, shapes = known(name, rate)
    rows = [int(channel) - 1 for channel in outputs]
    completed = complete_shapes(poles, (2 - 1j) * shapes[:, rows], correlations, tuple(outputs))
    assert completed.shape == shapes.shape
    assert 1 - np.diag(mac(completed, shapes)).min() < 1e-9
    np.testing.assert_allclose(completed[:, rows], (2 - 1j) * shapes[:, rows], atol=1e-6)


def test_completion_does_not_look_at_auto_correlations(known):
    correlations, poles, shapes = known("chain3", 125.0)
    values = correlations.values + np.eye(3)[:, :, None] * np.cos(np.arange(correlations.n_lags))
    noisy = exact_correlations(values, sampling_rate=125.0)
    completed = complete_shapes(poles, shapes[:, [0, 2]], noisy, ("1", "3"))
    assert 1 - np.diag(mac(completed, shapes)).min() < 1e-9
