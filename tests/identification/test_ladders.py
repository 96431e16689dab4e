"""Ladders: exact correlations in, exact poles out on every high enough rung, also at lower rates and of polynomials."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.identification import BlockRowLadder, OrderLadder
from sprung.identification.ladders import PolynomialLadder, decimate_correlations, filter_half_width, polynomial_ladder
from sprung.identification.subspace import poles_of_orders, realise, with_deviations
from sprung.modal import mac

LADDERS = {
    "orders": (OrderLadder(20, 12), tuple(range(2, 13, 2)), 40, False),
    "block rows": (BlockRowLadder(8, 20), tuple(range(8, 21)), 60, True),
}


@pytest.mark.parametrize(("ladder", "rungs", "n_lags", "is_biased"), LADDERS.values(), ids=LADDERS)
def test_the_last_rung_has_the_true_modes(known, ladder, rungs, n_lags, is_biased) -> None:
    correlations, poles, shapes = known("chain3", 125.0)
    found = ladder.poles(correlations)
    assert found.ladder == rungs
    assert (ladder.n_lags, ladder.is_biased) == (n_lags, is_biased)
    last = found.rungs == len(rungs) - 1
    errors = np.abs(found.poles[last][:, None] - poles) / np.abs(poles)
    assert errors.min(axis=0).max() < 1e-9
    nearest = np.argmin(errors, axis=0)
    assert 1 - np.diag(mac(found.mode_shapes[last][nearest], shapes)).min() < 1e-9


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: OrderLadder(1, 12), "block_rows=1 must be at least 2"),
        (lambda: OrderLadder(20, 0), "max_order=0 must be at least 2"),
        *[
            (partial(OrderLadder, 20, 12, wrong), "strides .* must rise from 1")
            for wrong in ((), (2,), (1, 1), (1, 9, 3))
        ],
        (lambda: BlockRowLadder(45, 12), "block rows 45 to 12 must rise from 2 or more"),
        (lambda: BlockRowLadder(1, 12), "block rows 1 to 12 must rise from 2 or more"),
        (lambda: PolynomialLadder(1, 12), "block_rows=1 must be at least 2"),
        (lambda: PolynomialLadder(20, 1), "max_order=1 must be at least 2"),
        (lambda: PolynomialLadder(20, 17), "max_order=17 is more than the half spectra .* use max_order <= 16"),
    ],
)
def test_impossible_ladders_are_refused(make, sentence) -> None:
    with pytest.raises(ParameterError, match=f"^{sentence}"):
        make()


@pytest.mark.parametrize(("factor", "n_modes"), [(3, 3), (7, 1)])
def test_poles_and_shapes_below_the_pass_edge_stay(known, factor, n_modes) -> None:
    """At 300 / 3 and 300 / 7 Hz all three modes of the chain, and the first, lie below 0.35 of the rate."""
    correlations, poles, shapes = known("chain3", 300.0, 2 * 20 * factor + 2 * filter_half_width(factor))
    decimated = decimate_correlations(correlations, factor, n_lags=40)
    assert decimated.sampling_rate == pytest.approx(300.0 / factor)
    assert decimated.n_lags == 40
    found = poles_of_orders(realise(decimated, block_rows=20, max_order=12), [12])
    errors = np.abs(found.poles[:, None] - poles[:n_modes]) / np.abs(poles[:n_modes])
    assert errors.min(axis=0).max() < 1e-4
    nearest = np.argmin(errors, axis=0)
    assert 1 - np.diag(mac(found.mode_shapes[nearest], shapes[:n_modes])).min() < 1e-4


def test_without_the_outputs_among_the_references_poles_are_exact(known) -> None:
    """Only later lags are used: the low-pass multiplies each exponential by a constant."""
    correlations, poles, _ = known("chain3", 300.0, 158)
    decimated = decimate_correlations(correlations.select(("1",), ("2", "3")), 3, n_lags=40)
    found = poles_of_orders(realise(decimated, block_rows=20, max_order=6), [6])
    errors = np.abs(found.poles[:, None] - poles) / np.abs(poles)
    assert errors.min(axis=0).max() < 1e-9


def test_a_ladder_of_several_strides_holds_each_mode_once(known) -> None:
    ladder = OrderLadder(20, 12, (1, 3, 9))
    correlations, poles, _ = known("chain3", 300.0, ladder.n_lags)
    found = ladder.poles(correlations)
    assert found.ladder == (2, 4, 6, 8, 10, 12)
    assert np.all(np.diff(found.rungs) >= 0)
    last = found.poles[found.rungs == 5]
    errors = np.abs(last[:, None] - poles) / np.abs(poles)
    assert errors.min(axis=0).max() < 1e-4
    assert ((errors < 0.01).sum(axis=0) == 1).all()
    assert ladder.span == 360


def test_joined_strides_keep_the_deviations_of_their_own_poles(measured) -> None:
    ladder = OrderLadder(8, 8, (1, 2))
    correlations = measured(seed=2, n_lags=ladder.n_lags)
    joined = with_deviations(ladder.poles(correlations))
    parts = [
        poles_of_orders(
            realise(decimate_correlations(correlations, stride, n_lags=16), block_rows=8, max_order=8), range(2, 9, 2)
        )
        for stride in ladder.strides
    ]
    of_parts = {pole: std for part in parts for pole, std in zip(part.poles, part.natural_frequency_std, strict=True)}
    assert len({pole in parts[0].poles for pole in joined.poles}) == 2
    np.testing.assert_allclose(joined.natural_frequency_std, [of_parts[pole] for pole in joined.poles], rtol=1e-9)


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


def test_too_few_lags_are_refused(known) -> None:
    correlations = known("chain3", 125.0)[0]
    with pytest.raises(ParameterError, match=r"n_lags=100 is more than the correlations hold: .* block_rows <= 40"):
        polynomial_ladder(correlations, n_lags=100, max_order=4)
