"""Group of channels of which a reader yields any, by their indices."""

from collections.abc import Hashable, Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Protocol

from sprung.formats.stated import chosen_indices
from sprung.formats.table import Block, Column, Group, Table


class RowsOf(Protocol):
    """Function that yields rows of the channels at some indices; of none, only the time stamps."""

    def __call__(self, indices: Sequence[int], first: int = 0, last: int | None = None) -> Iterator[Block]:
        """Yield the rows from `first` to before `last`, counted from 0 (None: to the end), in blocks."""


def column_group(
    path: Path,
    name: str,
    columns: Sequence[Column],
    rows: RowsOf,
    *,
    clock: Hashable,
    n_rows: int | None = None,
    sampling_rate: float | None = None,
    time_heading: str | None = None,
    row_word: str = "sample",
    start: int | None = None,
    comment: str = "",
) -> Group:
    """Return a group whose table holds the channels that are wanted; further parameters as of `Group` and `Table`.

    Raises
    ------
    FormatError
        When it is opened: if there are no columns.
    ParameterError
        When it is opened: if there is no column of a channel.
    """

    def open_table(channels: Sequence[str] | None) -> Table:
        indices = chosen_indices(columns, channels, path=path)
        return Table(
            path,
            tuple(columns[index] for index in indices),
            time_heading,
            partial(rows, indices),
            row_word,
            sampling_rate,
            start,
            partial(rows, ()) if time_heading else None,
            comment,
        )

    headings = tuple(column.heading for column in columns)
    return Group(name, headings, clock, open_table, sampling_rate, n_rows)
