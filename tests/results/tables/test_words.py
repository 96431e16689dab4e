"""Values, shapes, orders and trends in words."""

import math

import numpy as np
import pytest

from sprung.diagnosis import Trend
from sprung.results.tables import counted, orders_in_words, shapes_in_words, trend_in_words, with_deviation


def test_values_have_the_digits_that_their_uncertainty_leaves():
    assert with_deviation(7.01234, 0.0123) == "7.012 ± 0.012"
    assert with_deviation(1234.5, 67.0) == "1234 ± 67"
    assert with_deviation(44279.6, 723.4) == "44280 ± 720"
    assert with_deviation(0.1882345, 0.00024) == "0.18823 ± 0.00024"
    assert with_deviation(19.6543, math.nan) == "19.65"
    assert with_deviation(19.6543, 0.0) == "19.65"


def test_shapes_in_words():
    shapes = np.array([[1.0, 0.9 + 0.1j, -0.8, 0.1], [0.2, 0.5j, 1.0, -0.6]])
    channels = ("acc_fl", "acc_fr", "acc_rl", "acc_rr")
    assert shapes_in_words(channels, shapes) == ["fl+ fr+ rl-", "fr~ rl+ rr-"]
    assert shapes_in_words(("a_1", "b_1", "c", "d"), shapes)[0] == "a_1+ b_1+ c-"
    assert shapes_in_words(("only",), np.ones((1, 1), dtype=complex)) == ["only+"]
    many = [f"s{k}" for k in range(8)]
    assert shapes_in_words(many, np.linspace(0.3, 1, 8, dtype=complex)[None]) == ["s2+ s3+ s4+ s5+ s6+ s7+ ..."]


def test_orders_inorders_in_words():
    assert orders_in_words([1]) == ""
    assert orders_in_words([1, 2, 3, 5, 7, 8]) == "1 to 3, 5, 7 to 8"
    assert orders_in_words([2]) == "2"


def test_counts_in_words():
    assert [counted(number, "mode") for number in (0, 1, 2)] == ["0 modes", "1 mode", "2 modes"]


@pytest.mark.parametrize(
    ("trend", "words"),
    [
        (None, "trend not estimated: it needs a single part and at least four windows since the onset"),
        (Trend(0.01, (-0.01, 0.03), None), "no trend detected: -1.0 to +3.0 % per hour of driving"),
        (Trend(0.02, (0.01, 0.03), None), "trend: +2.0 % (+1.0 to +3.0) per hour of driving"),
        (
            Trend(-0.02, (-0.03, -0.01), (2.0, 6.0)),
            "trend: -2.0 % (-3.0 to -1.0) per hour of driving, 30 % in 2.0 to 6.0 hours",
        ),
        (Trend(-0.02, (-0.03, -0.01), (0.0, 0.0)), "trend: -2.0 % (-3.0 to -1.0) per hour of driving, 30 % is reached"),
    ],
)
def test_a_trend_in_words(trend, words):
    assert trend_in_words(trend) == words
