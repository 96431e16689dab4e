"""Correlations at lower rates: poles and shapes stay, and what lies above the new rate goes."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.identification import OrderLadder
from sprung.identification.correlation import exact_correlations
from sprung.identification.ladders import PASSED, STOPPED, decimate_correlations, filter_half_width
from sprung.identification.subspace import poles_of_orders, realise, with_deviations
from sprung.modal import mac


def test_a_factor_of_one_changes_nothing(known) -> None:
    correlations, _, _ = known("chain3", 125.0)
    assert decimate_correlations(correlations, 1, n_lags=10) is correlations
    assert filter_half_width(1) == 0


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


@pytest.mark.parametrize("factor", [3, 9])
def test_the_low_pass_passes_and_stops_at_its_edges(factor) -> None:
    half = filter_half_width(factor)
    lags = np.arange(-half, half + 1)
    edges = np.array([0.0, PASSED, STOPPED, 1.3]) / factor
    values = np.cos(2 * np.pi * edges[:, None] * np.arange(2 * half + 2 * factor))[:, None]
    gains = [
        decimate_correlations(exact_correlations(value[None], sampling_rate=1.0), factor, n_lags=1).values[0, 0, 0]
        for value in values
    ]
    assert lags.size == 2 * half + 1
    np.testing.assert_allclose(gains, [1.0, 1.0, 0.0, 0.0], atol=3e-3)


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


@pytest.mark.parametrize("strides", [(), (2,), (1, 1), (1, 9, 3)])
def test_strides_rise_from_one(strides) -> None:
    with pytest.raises(ParameterError) as refusal:
        OrderLadder(20, 12, strides)
    assert str(refusal.value) == f"strides {strides} must rise from 1"
