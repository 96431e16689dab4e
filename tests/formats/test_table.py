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
    cut,
    join,
    rebatch,
    reported,
)

PATH = Path("run.csv")


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
