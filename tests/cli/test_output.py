import math

import numpy as np
import pytest

from sprung.cli.files import names
from sprung.cli.modes import orders_in_words, shapes_in_words, with_deviation
from sprung.cli.printing import printable
from sprung.errors import ParameterError


def test_lists_of_names():
    assert names(None) is None
    assert names("acc_fl") == ("acc_fl",)
    assert names("a, b ,c") == ("a", "b", "c")
    assert names('"x, y",z') == ("x, y", "z")
    for text in ("", "a,", "a,a"):
        with pytest.raises(ParameterError, match="commas"):
            names(text)


def test_text_is_one_printable_line():
    assert printable("a\n\tb\x1b[31mc\x07") == "a b [31mc"


def test_values_have_the_digits_that_their_uncertainty_leaves():
    assert with_deviation(7.01234, 0.0123) == "7.012 ± 0.012"
    assert with_deviation(1234.5, 67.0) == "1234 ± 67"
    assert with_deviation(0.1882345, 0.00024) == "0.18823 ± 0.00024"
    assert with_deviation(19.6543, math.nan) == "19.65"
    assert with_deviation(19.6543, 0.0) == "19.65"


def test_shapes_in_words():
    shapes = np.array([[1.0, 0.9 + 0.1j, -0.8, 0.1], [0.2, 0.5j, 1.0, -0.6]])
    channels = ("acc_fl", "acc_fr", "acc_rl", "acc_rr")
    assert shapes_in_words(channels, shapes) == ["fl+ fr+ rl-", "fr~ rl+ rr-"]
    assert shapes_in_words(("a_1", "b_1", "c", "d"), shapes)[0] == "a_1+ b_1+ c-"
    assert shapes_in_words(("only",), np.ones((1, 1))) == ["only+"]
    many = [f"s{k}" for k in range(8)]
    assert shapes_in_words(many, np.linspace(0.3, 1, 8)[None]) == ["s2+ s3+ s4+ s5+ s6+ s7+ ..."]


def test_orders_inorders_in_words():
    assert orders_in_words([1]) == ""
    assert orders_in_words([1, 2, 3, 5, 7, 8]) == "1 to 3, 5, 7 to 8"
    assert orders_in_words([2]) == "2"
