"""Channels of formats that state everything about them: distinct names, plain texts, a choice by name."""

import io
import logging
import warnings
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path

from sprung.errors import FormatError
from sprung.formats.raw import one_line
from sprung.formats.table import Column, index_of, spellings

#: Longest name or text that is taken from a file; damaged files may state longer ones.
_MAX_NAME = 120
_MAX_TEXT = 1000


def plain(text: object, longest: int = _MAX_TEXT) -> str:
    """Return a text of a file as one printable line; an empty one for None."""
    line = " ".join(str("" if text is None else text).split())
    return "".join(character for character in line if character.isprintable())[:longest]


def distinct(names: Sequence[object]) -> list[str]:
    """Return plain names, the second and later ones of a kind with their number; a channel without a name is named."""
    result: list[str] = []
    taken: set[str] = set()
    for index, stated in enumerate(names):
        name = first = plain(stated, _MAX_NAME) or f"channel {index + 1}"
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
    """Return the columns of some channels, in that order; None: all. Raises as `chosen_indices`."""
    return tuple(columns[index] for index in chosen_indices(columns, names, path=path))


def chosen_indices(columns: Sequence[Column], channels: Sequence[str] | None, *, path: Path) -> list[int]:
    """Return the indices of `channels` among the columns, in that order; None: of all columns.

    Raises
    ------
    FormatError
        If there are no columns.
    ParameterError
        If there is no column of a channel.
    """
    if not columns:
        raise FormatError(f"{path} holds no channel of numbers")
    if channels is None:
        return list(range(len(columns)))
    spelled = [(column.name, *spellings(column.heading)) for column in columns]
    return [index_of(name, spelled, path=path) for name in channels]


def described(*texts: str) -> str:
    """Return texts as one comment, without empty and repeated ones."""
    lines = map(one_line, texts)
    return "; ".join(dict.fromkeys(line for line in lines if line))


@contextmanager
def silenced(*loggers: str) -> Iterator[None]:
    """Keep a foreign reader from printing, logging and warning about its file: what matters becomes an error."""
    before = {log: log.disabled for log in map(logging.getLogger, loggers)}
    for log in before:
        log.disabled = True
    try:
        with warnings.catch_warnings(), redirect_stdout(io.StringIO()), redirect_stderr(io.StringIO()):
            warnings.simplefilter("ignore")
            yield
    finally:
        for log, disabled in before.items():
            log.disabled = disabled
