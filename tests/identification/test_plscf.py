"""Poly-reference least-squares complex frequency domain method: exact poles, clear diagrams, deviations."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.identification.plscf import PolynomialLadder, polynomial_ladder, suitable_ladder
from sprung.modal import mac

N_LAGS = 80


def on_rung(poles, order):
    """Poles and shapes of one order."""
    chosen = poles.rungs == poles.ladder.index(order)
    return poles.poles[chosen], poles.mode_shapes[chosen]


# The normal equations square the condition of the problem: the wheels of a car, damped by 30 % and sampled at 14 times
# the frequency of its body, come out to 1e-5 at the lowest order that holds them.
@pytest.mark.parametrize(
    ("name", "rate", "lowest", "tolerance"),
    [
        ("chain3", 125.0, 2, 1e-12),
        ("chain3", 500.0, 2, 1e-10),
        ("quarter", 250.0, 2, 1e-10),
        ("zafira", 50.0, 6, 1e-6),
        ("zafira-printed", 50.0, 6, 1e-4),
    ],
)
def test_truncated_exact_correlations_give_exact_poles_and_shapes(known, name, rate, lowest, tolerance) -> None:
    # 73 % of the first mode of the chain are left after 80 lags at 125 Hz: no window is needed.
    correlations, poles, shapes = known(name, rate)
    found = polynomial_ladder(correlations, n_lags=N_LAGS, max_order=lowest + 4)
    assert found.ladder == tuple(range(1, lowest + 5))
    for order in range(lowest, lowest + 5):
        values, forms = on_rung(found, order)
        errors = np.abs(values[:, None] - poles) / np.abs(poles)
        assert errors.min(axis=0).max() < tolerance
        nearest = np.argmin(errors, axis=0)
        assert 1 - np.diag(mac(forms[nearest], shapes)).min() < tolerance
    assert np.isnan(found.natural_frequency_std).all()
    assert np.isnan(found.damping_ratio_std).all()


def test_surplus_poles_grow_and_are_left_out(known) -> None:
    correlations, poles, _ = known("chain3", 125.0)
    found = polynomial_ladder(correlations, n_lags=N_LAGS, max_order=12)
    counts = np.bincount(found.rungs, minlength=12)
    assert np.all(counts[1:] == len(poles))
    assert np.all(found.poles.real < 0)


def test_noise_of_the_sensors_at_lag_0_does_not_matter(known) -> None:
    correlations, poles, _ = known("chain3", 125.0)
    values = np.array(correlations.values)
    values[:, :, 0] += 100 * np.eye(3)
    found = polynomial_ladder(replace(correlations, values=values, blocks=values[None]), n_lags=N_LAGS, max_order=4)
    assert np.abs(np.sort_complex(on_rung(found, 4)[0]) - np.sort_complex(poles)).max() < 1e-9 * np.abs(poles).max()


def test_some_outputs_as_references_suffice(known) -> None:
    correlations, poles, shapes = known("chain3", 125.0)
    part = correlations.select(correlations.channels, correlations.references[2:])
    values, forms = on_rung(polynomial_ladder(part, n_lags=N_LAGS, max_order=6), 6)
    nearest = np.argmin(np.abs(values[:, None] - poles), axis=0)
    assert np.abs(values[nearest] - poles).max() < 1e-9 * np.abs(poles).max()
    assert np.diag(mac(forms[nearest], shapes)) == pytest.approx(1, abs=1e-9)


@pytest.mark.parametrize("order", [2, 5, 12])
def test_standard_deviations_equal_a_finite_difference_of_the_poles(measured, order) -> None:
    correlations = measured(seed=1, n_lags=N_LAGS)
    found = polynomial_ladder(correlations, n_lags=N_LAGS, max_order=order)
    chosen = np.flatnonzero((found.rungs == order - 1) & (found.natural_frequency < 45))
    step = 1e-5
    squares = np.zeros((2, len(chosen)))
    for change in correlations.changes:
        moved = polynomial_ladder(
            _with_values(correlations, correlations.values + step * change), n_lags=N_LAGS, max_order=order
        )
        nearest = np.argmin(np.abs(moved.poles[:, None] - found.poles[chosen]), axis=0)
        for row, name in enumerate(("natural_frequency", "damping_ratio")):
            squares[row] += ((getattr(moved, name)[nearest] - getattr(found, name)[chosen]) / step) ** 2
    expected = np.sqrt(squares)
    assert found.natural_frequency_std[chosen] == pytest.approx(expected[0], rel=2e-3)
    assert found.damping_ratio_std[chosen] == pytest.approx(expected[1], rel=2e-3)


def _with_values(correlations, values):
    """Correlations with other values, and the same changes in the blocks."""
    return replace(correlations, values=values, blocks=correlations.blocks - correlations.values + values)


@pytest.mark.parametrize(
    ("rows", "n_references", "given", "expected"),
    [
        (40, 3, {}, (60, 24)),
        (66, 4, {}, (99, 25)),
        (66, 17, {}, (99, 8)),
        (66, 40, {}, (99, 8)),
        (20, 3, {"block_rows": 20}, (20, 8)),
        (20, 3, {"max_order": 5}, (30, 5)),
        (2, 3, {}, (3, 2)),
    ],
)
def test_sizes_suit_lags_and_references(rows, n_references, given, expected) -> None:
    ladder = suitable_ladder(rows, n_references, **given)
    assert (ladder.block_rows, ladder.max_order) == expected


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: PolynomialLadder(1, 12), "block_rows=1 must be at least 2"),
        (lambda: PolynomialLadder(20, 1), "max_order=1 must be at least 2"),
        (
            lambda: PolynomialLadder(20, 17),
            "max_order=17 is more than the half spectra of block_rows=20 can carry: use max_order <= 16 or more"
            " block rows",
        ),
    ],
)
def test_impossible_ladders_are_refused(make, sentence) -> None:
    with pytest.raises(ParameterError) as refusal:
        make()
    assert str(refusal.value) == sentence


def test_too_few_lags_are_refused(known) -> None:
    correlations = known("chain3", 125.0)[0]
    with pytest.raises(ParameterError, match=r"n_lags=100 is more than the correlations hold: .* block_rows <= 40"):
        polynomial_ladder(correlations, n_lags=100, max_order=4)
