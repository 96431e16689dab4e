"""Channels of formats that state everything about them: distinct names, plain texts, a choice by name."""

import io
import logging
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path

from sprung.errors import FormatError, ParameterError
from sprung.formats.table import Column, split_heading

#: Longest name or text that is taken from a file; damaged files may state longer ones.
_LONGEST_NAME, _LONGEST_TEXT = 120, 1000


def plain(text: object, longest: int = _LONGEST_TEXT) -> str:
    """Return a text of a file as one printable line; an empty one for None."""
    line = " ".join(str("" if text is None else text).split())
    return "".join(character for character in line if character.isprintable())[:longest]


def distinct(names: Sequence[object]) -> list[str]:
    """Return plain names, the second and later ones of a kind with their number; a channel without a name is named."""
    result: list[str] = []
    taken: set[str] = set()
    for index, stated in enumerate(names):
        name = first = plain(stated, _LONGEST_NAME) or f"channel {index + 1}"
        number = 1
        while name in taken:
            number += 1
            name = f"{first} ({number})"
        taken.add(name)
        result.append(name)
    return result


def linear(factor: float, offset: float) -> str:
    """Return a linear calibration in words; nothing where raw and physical values are the same."""
    if (factor, offset) == (1, 0):
        return ""
    return f"{factor:.9g} * raw" + (f" {'-' if offset < 0 else '+'} {abs(offset):.9g}" if offset else "")


def chosen(path: Path, columns: Sequence[Column], names: Sequence[str] | None) -> tuple[Column, ...]:
    """Return the columns of some channels, in that order; None: all.

    Raises
    ------
    ParameterError
        If a channel is not in the file.
    FormatError
        If there is no channel.
    """
    if not columns:
        raise FormatError(f"{path} holds no channel of numbers")
    return tuple(columns) if names is None else tuple(_column(path, columns, name) for name in names)


def _column(path: Path, columns: Sequence[Column], name: str) -> Column:
    """Return the column of the channel called `name`, with its unit or without."""
    for column in columns:
        if name in {column.heading, split_heading(column.heading)[0]}:
            return column
    known = ", ".join(column.name for column in columns)
    raise ParameterError(f"{path} has no channel {name!r}: choose from {known}")


@contextmanager
def silenced(*loggers: str) -> Iterator[None]:
    """Keep a foreign reader from printing, logging and warning about its file: what matters becomes an error."""
    logs = [logging.getLogger(name) for name in loggers]
    before = [log.disabled for log in logs]
    for log in logs:
        log.disabled = True
    try:
        with warnings.catch_warnings(), redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        for log, disabled in zip(logs, before, strict=True):
            log.disabled = disabled
