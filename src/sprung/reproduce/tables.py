"""Tables built by columns: published numbers next to ours."""

from collections.abc import Sequence

import numpy as np
from numpy.typing import ArrayLike

from sprung.reproduce.thesis import deviation, number
from sprung.results.tables import Table

#: Heading and cells of a column.
Column = tuple[str, Sequence[str]]


def numbers_table(title: str, columns: tuple[str, ...], rows: tuple[tuple[str, ...], ...], remark: str = "") -> Table:
    """Return a table of formatted numbers whose first column holds words.

    Parameters
    ----------
    title
        Title, with the number of the thesis' table where there is one.
    columns
        Headings with units.
    rows
        Cells of each row, as many as there are columns.
    remark
        Sentence below the table.
    """
    return Table(title, columns, rows, ends_in_words=False, caption=remark)


def column_table(title: str, columns: Sequence[Column], *, remark: str = "") -> Table:
    """Return a table of columns with as many cells each.

    Parameters
    ----------
    title
        Title with the number of the thesis' table.
    columns
        Heading and cells of each column, the names of the rows first.
    remark
        Sentence below the table.
    """
    headings, cells = zip(*columns, strict=True)
    return numbers_table(title, tuple(headings), tuple(zip(*cells, strict=True)), remark)


def numbers(values: ArrayLike, *, digits: int = 2) -> list[str]:
    """Return the cells of a column of numbers, a dash where there is none."""
    return [number(value, digits=digits) for value in np.asarray(values, dtype=np.float64)]


def deviations(ours: ArrayLike, published: ArrayLike) -> list[str]:
    """Return the cells of a column of relative deviations from published numbers."""
    return [deviation(our, other) for our, other in np.column_stack([np.asarray(ours), np.asarray(published)])]


def theory_table(
    title: str,
    names: Sequence[str],
    frequencies: tuple[ArrayLike, ArrayLike],
    dampings: tuple[ArrayLike, ArrayLike],
    *,
    digits: tuple[int, int, int, int] = (2, 4, 2, 4),
    remark: str = "",
) -> Table:
    """Return the table of theoretical modes, published next to ours.

    Parameters
    ----------
    title
        Title with the number of the thesis' table or figure.
    names
        Names of the modes.
    frequencies, dampings
        Published and our natural frequencies [Hz], and damping ratios [%].
    digits
        Decimals of published and our frequencies, and of published and our damping ratios.
    remark
        Sentence below the table.
    """
    columns: list[Column] = [("", names)]
    for symbol, unit, (published, ours), (few, many) in (
        ("f", "Hz", frequencies, digits[:2]),
        ("ξ", "%", dampings, digits[2:]),
    ):
        columns += [
            (f"{symbol} published [{unit}]", numbers(published, digits=few)),
            (f"{symbol} ours [{unit}]", numbers(ours, digits=many)),
            ("deviation", deviations(ours, published)),
        ]
    return column_table(title, columns, remark=remark)
