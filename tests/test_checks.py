"""Checks of arguments, and the sentences that refuse them."""

from dataclasses import dataclass

import numpy as np
import pytest

from sprung._arrays import Real
from sprung._checks import check_complete, check_number, check_one_of, freeze, frozen_array, nearest_name, required
from sprung.errors import DataError, MissingPackageError, ParameterError


@pytest.mark.parametrize(
    ("value", "bounds", "sentence"),
    [
        (0.0, {"above": 0}, "x=0 must be above 0"),
        (-1.0, {"at_least": 0}, "x=-1 must be at least 0"),
        (2.0, {"at_least": 0, "at_most": 1}, "x=2 must be at least 0 and at most 1"),
        (np.inf, {"above": 0}, "x=inf must be finite and above 0"),
        (np.nan, {}, "x=nan must be finite"),
        (3.0, {"at_most": 1, "advice": "use less"}, "x=3 must be at most 1: use less"),
    ],
)
def test_a_number_out_of_its_range_is_refused_with_its_bounds(value, bounds, sentence) -> None:
    with pytest.raises(ParameterError) as refusal:
        check_number("x", value, **bounds)
    assert str(refusal.value) == sentence


def test_bounds_that_are_included_hold() -> None:
    assert check_number("x", 1.0, at_least=1, at_most=1) == 1.0


def test_a_word_that_is_not_allowed_is_refused_with_those_that_are() -> None:
    assert check_one_of("kind", "road", ("rail", "road")) == "road"
    with pytest.raises(ParameterError, match=r"^kind 'boat' is not one of rail, road: choose one$"):
        check_one_of("kind", "boat", ("road", "rail"), advice="choose one")


def test_arrays_of_values_are_read_only_and_the_array_given_is_not() -> None:
    given = np.arange(3.0)
    frozen = frozen_array("x", given, ndim=1)
    assert np.shares_memory(frozen, given)
    with pytest.raises(ValueError, match="read-only"):
        frozen[0] = 1.0
    given[0] = 5.0
    with pytest.raises(ParameterError, match=r"^x has 1 dimensions \(3,\), but must have 2$"):
        frozen_array("x", given, ndim=2)


def test_freeze_turns_lists_of_a_frozen_dataclass_into_arrays() -> None:
    @dataclass(frozen=True)
    class Value:
        numbers: Real

        def __post_init__(self) -> None:
            freeze(self, numbers=1)

    value = Value(np.array([1, 2]))
    assert value.numbers.dtype == np.float64
    assert not value.numbers.flags.writeable


def test_a_package_that_is_not_installed_is_named_with_its_extra() -> None:
    assert required("json", purpose="reading", extra="online").loads("1") == 1
    with pytest.raises(MissingPackageError) as refusal:
        required("no_such_package", purpose="link", extra="online")
    assert str(refusal.value) == "link needs the package no_such_package: install it with pip install 'sprung[online]'"


def test_missing_values_are_counted_in_the_worst_channel() -> None:
    samples = np.zeros((2, 5))
    check_complete(("a", "b"), samples)
    samples[0, 0], samples[1, :3] = np.nan, np.inf
    with pytest.raises(DataError, match=r"^channel 'b' has 3 missing values: turn them into gaps"):
        check_complete(("a", "b"), samples)


def test_an_integer_beyond_those_of_numpy_is_a_number() -> None:
    assert check_number("x", 2**64, above=0) == 2**64


@pytest.mark.parametrize(
    ("name", "known", "meant"),
    [
        ("AccZ", ("Acc_X", "Acc_Y", "Acc_Z", "Gyr_Z"), "Acc_Z"),
        ("acc z (m/s^2)", ("accX", "accZ"), "accZ"),
        ("speed", ("Speed_kmh", "sped"), "Speed_kmh"),
        ("stifness", ("damping", "stiffness"), "stiffness"),
        ("acc_rear_left", ("acc_rear_lft", "acc_front_left"), "acc_rear_lft"),
        ("wings", ("mass", "x", "half_track"), None),
        ("g", ("mg",), None),
        ("a", (), None),
    ],
)
def test_the_name_that_was_meant_is_that_of_the_same_letters(name, known, meant) -> None:
    """Case, separators and units do not count; a few letters may differ."""
    assert nearest_name(name, known) == meant
