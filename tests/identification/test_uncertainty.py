"""First-order uncertainty of poles."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.identification.correlation import exact_correlations
from sprung.identification.subspace import poles_of_orders, realise

BLOCK_ROWS = 20
FORMS = {
    "Toeplitz, weighted": {},
    "Toeplitz, unweighted": {"is_weighted": False},
    "Hankel": {"is_hankel": True},
}


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
def test_standard_deviations_equal_a_finite_difference_of_the_poles(known, case, step, tolerance, form) -> None:
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


@pytest.mark.slow
@pytest.mark.parametrize("snr", [10.0, 0.5])
@pytest.mark.parametrize("is_weighted", [True, False])
def test_standard_deviations_are_those_of_repeated_runs(vehicle, measured, snr, is_weighted) -> None:
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


def test_ten_times_the_length_has_a_third_of_the_deviation(measured) -> None:
    short, long = (
        poles_of_orders(realise(measured(1, duration=duration), block_rows=BLOCK_ROWS, max_order=6), [6])
        for duration in (60.0, 600.0)
    )
    ratio = np.median(short.natural_frequency_std) / np.median(long.natural_frequency_std)
    assert ratio == pytest.approx(np.sqrt(10), rel=0.35)
