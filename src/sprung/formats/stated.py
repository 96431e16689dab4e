"""Rules for formats that state names and units of channels apart: the wanted ones, distinct names, comments."""

from collections.abc import Sequence
from pathlib import Path

from sprung.errors import FormatError, ParameterError
from sprung.formats.raw import one_line
from sprung.formats.table import Column, refuse_repeated, split_heading


def chosen_indices(columns: Sequence[Column], channels: Sequence[str] | None, *, path: Path) -> list[int]:
    """Return the indices of `channels` among the columns, in that order; None: of all columns.

    Raises
    ------
    FormatError
        If there are no columns, or a name occurs twice.
    ParameterError
        If there is no column of a channel.
    """
    if not columns:
        raise FormatError(f"{path} holds no channel: it needs at least one column of numbers")
    names = [column.name for column in columns]
    refuse_repeated(names, path=path)
    if channels is None:
        return list(range(len(columns)))
    indices = []
    for wanted in channels:
        index = next((k for k, column in enumerate(columns) if wanted in _names(column)), None)
        if index is None:
            raise ParameterError(f"{path} has no channel {wanted!r}: choose from {', '.join(names)}")
        indices.append(index)
    return indices


def _names(column: Column) -> tuple[str, ...]:
    return column.name, column.heading, split_heading(column.heading)[0]


def distinct(names: Sequence[str]) -> list[str]:
    """Return the names, with " 2", " 3" ... after those that repeat earlier ones."""
    taken = set(names)
    seen: set[str] = set()
    unique = []
    for name in names:
        candidate, number = name, 1
        while candidate in seen or (number > 1 and candidate in taken):
            number += 1
            candidate = f"{name} {number}"
        seen.add(candidate)
        unique.append(candidate)
    return unique


def described(*texts: str) -> str:
    """Return texts as one comment, without empty and repeated ones."""
    plain = map(one_line, texts)
    return "; ".join(dict.fromkeys(text for text in plain if text))
