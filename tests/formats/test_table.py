"""Headings, units and blocks of rows that all formats share."""

from itertools import accumulate, pairwise
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sprung.errors import FormatError, ParameterError
from sprung.formats.table import (
    Block,
    Column,
    chosen_columns,
    column,
    cut,
    is_number,
    is_time,
    is_unit,
    join,
    rebatch,
    reported,
    time_column,
    written_headings,
    written_stamps,
)
from sprung.recording import QUANTITIES, Channel, Gap, Recording

PATH = Path("run.csv")


@pytest.mark.parametrize(
    ("heading", "expected"),
    [
        ("az [g]", Column("az [g]", "az", "acceleration", 9.80665)),
        ("speed (km/h)", Column("speed (km/h)", "speed", "speed", 1 / 3.6)),
        ("gyro [deg/s]", Column("gyro [deg/s]", "gyro", "angular_velocity", np.pi / 180)),
        ("damper (front left)", Column("damper (front left)", "damper (front left)")),
        (" plain ", Column(" plain ", "plain")),
    ],
)
def test_headings_are_names_with_units(heading, expected) -> None:
    found = column(heading, path=PATH)
    assert (found.heading, found.name, found.quantity) == (expected.heading, expected.name, expected.quantity)
    assert found.factor == pytest.approx(expected.factor, rel=1e-12)


def test_square_brackets_always_hold_a_unit() -> None:
    with pytest.raises(FormatError, match=r"run.csv: column 'az \[furlong\]'"):
        column("az [furlong]", path=PATH)
    with pytest.raises(FormatError, match="has no name: give every column a name"):
        column(" ", path=PATH)


def test_times_numbers_and_units_are_recognised() -> None:
    assert [is_time(text) for text in ("Time [s]", "t", "timestamp", "tempo")] == [True, True, True, False]
    assert all(is_number(text) for text in (" -1.5e3 ", "7", ".5", "nan"))
    assert not any(is_number(text) for text in ("1,5", "x", ""))
    assert [is_unit(text) for text in ("[m/s^2]", "g", "s", "furlong")] == [True, True, True, False]


def test_one_time_column_at_most() -> None:
    assert time_column(["a", "t [s]"], path=PATH) == "t [s]"
    assert time_column(["a"], path=PATH) is None
    with pytest.raises(FormatError, match="has the time columns 't' and 'time': keep one of them"):
        time_column(["t", "a", "time"], path=PATH)


def test_columns_are_chosen_by_name_with_or_without_unit() -> None:
    headings = ["t", "a [g]", "b", ""]
    assert [item.name for item in chosen_columns(headings, None, path=PATH)] == ["a", "b"]
    assert [item.name for item in chosen_columns(headings, ["b", "a"], path=PATH)] == ["b", "a"]
    assert [item.name for item in chosen_columns(headings, ["a [g]"], path=PATH)] == ["a"]
    with pytest.raises(ParameterError, match="has no channel 'c': choose from a, b"):
        chosen_columns(headings, ["c"], path=PATH)
    with pytest.raises(FormatError, match="column name 'a' occurs more than once"):
        chosen_columns(["a [g]", "a"], None, path=PATH)


@given(sizes=st.lists(st.integers(0, 9), min_size=1, max_size=8), n_rows=st.integers(1, 7))
def test_blocks_of_another_size_hold_the_same_rows(sizes, n_rows) -> None:
    total = sum(sizes)
    whole = Block(5, np.arange(total), np.arange(2.0 * total).reshape(2, total))
    pieces = [cut(whole, slice(first, last)) for first, last in pairwise(accumulate(sizes, initial=0))]
    again = list(rebatch(pieces, n_rows))
    assert all(block.n_rows == n_rows for block in again[:-1])
    assert [block.first_row for block in again if block.n_rows] == list(range(5, 5 + total, n_rows))
    joined = join(again)
    assert joined.stamps is not None
    assert joined.stamps.tolist() == list(range(total))
    assert np.array_equal(joined.values, whole.values)


def test_errors_of_foreign_parsers_are_one_sentence() -> None:
    with (
        pytest.raises(FormatError, match=r"^run.csv cannot be read as CSV \(two lines\): check"),
        reported(PATH, "CSV"),
    ):
        raise RuntimeError("two\nlines")
    with pytest.raises(ParameterError, match=r"^as it was$"), reported(PATH, "CSV"):
        raise ParameterError("as it was")


@pytest.mark.parametrize("quantity", QUANTITIES)
def test_written_headings_are_read_as_the_channel(quantity) -> None:
    recording = Recording(np.zeros((1, 3)), 10.0, (Channel("a", quantity),))
    (heading,) = written_headings(recording)
    found = column(heading, path=PATH)
    assert (found.name, found.quantity) == ("a", quantity)


def test_written_stamps_pass_over_gaps() -> None:
    gaps = (Gap(2, 5.0),)
    name, seconds = written_stamps(Recording(np.zeros((1, 4)), 10.0, (Channel("a"),), None, gaps))
    assert (name, seconds.tolist()) == ("time", [0.0, 0.1, 5.2, 5.3])
    name, stamps = written_stamps(Recording(np.zeros((1, 4)), 10.0, (Channel("a"),), 10**18, gaps))
    assert name == "timestamp"
    assert (stamps.astype(np.int64) - 10**18).tolist() == [0, 10**8, 52 * 10**8, 53 * 10**8]
