"""Ladders: exact correlations in, exact poles out on every high enough rung, and the lags that they need."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.identification import BlockRowLadder, OrderLadder
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
        (lambda: BlockRowLadder(45, 12), "block rows 45 to 12 must rise from 2 or more"),
        (lambda: BlockRowLadder(1, 12), "block rows 1 to 12 must rise from 2 or more"),
    ],
)
def test_impossible_ladders_are_refused(make, sentence) -> None:
    with pytest.raises(ParameterError) as refusal:
        make()
    assert str(refusal.value) == sentence
