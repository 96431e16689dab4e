"""What a file states: its bytes as text, distinct names, calibrations, and groups of channels chosen by name."""

import io
import itertools
import logging
import mmap
import warnings
from collections import Counter
from collections.abc import Hashable, Iterator, Sequence
from contextlib import contextmanager, redirect_stderr, redirect_stdout, suppress
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Protocol

from sprung.errors import FormatError
from sprung.formats.table import Block, Column, Group, Table, index_of, spellings

#: Longest name or text that is taken from a file; damaged files may state longer ones.
_MAX_NAME = 120
#: Bytes of text that are parsed at once.
_PIECE_BYTES = 1_048_576
_MAX_TEXT = 1000


@contextmanager
def mapped(path: Path) -> Iterator[mmap.mmap]:
    """Map a file, of which only the parts that are used are read."""
    with path.open("rb") as file, mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ) as content:
        yield content


def whole_lines(content: mmap.mmap, begin: int, end: int) -> Iterator[tuple[int, bytes]]:
    """Yield pieces of whole lines between two offsets, each with its offset."""
    while begin < end:
        until = min(end, begin + _PIECE_BYTES)
        if until < end:
            until = content.rfind(b"\n", begin, until) + 1 or until
        yield begin, content[begin:until]
        begin = until


def decoded(raw: bytes) -> str:
    """Return text; bytes that are not UTF-8 are Latin-1."""
    try:
        return raw.decode("utf-8-sig")
    except UnicodeDecodeError:
        return raw.decode("latin-1")


def half_digit(number: str) -> float:
    """Return half of the last digit of a printed number, such as 5e-11 for 1.52588E-05."""
    mantissa, _, exponent = number.lower().partition("e")
    return 0.5 * 10.0 ** (int(exponent or 0) - len(mantissa.partition(".")[2]))


def utc(*fields: str | int, fraction: str | None = "") -> int | None:
    """Return year, month, day, hour, minute and second as UTC [ns since 1970], with digits after the second's point.

    None if there is no such time.
    """
    with suppress(ValueError, OverflowError):
        year, month, day, hour, minute, second = map(int, fields)
        seconds = round(datetime(year, month, day, hour, minute, second, tzinfo=UTC).timestamp())
        return seconds * 10**9 + int((fraction or "").ljust(9, "0")[:9])
    return None


def plain(text: object, longest: int | None = _MAX_TEXT) -> str:
    """Return a text of a file as one printable line; an empty one for None."""
    printable = (character if character.isprintable() else " " for character in str("" if text is None else text))
    return " ".join("".join(printable).split())[:longest]


def distinct(names: Sequence[object], details: Sequence[str] = ()) -> list[str]:
    """Return plain names: those of one kind with their details, and where these are equal with their number."""
    plain_names = [plain(name, _MAX_NAME) or f"channel {index}" for index, name in enumerate(names, 1)]
    if details:
        counts = Counter(plain_names)
        pairs = zip(plain_names, details, strict=True)
        plain_names = [f"{name} ({detail})" if detail and counts[name] > 1 else name for name, detail in pairs]
    taken: dict[str, None] = {}
    for name in plain_names:
        numbers = itertools.count(2)
        unique = name
        while unique in taken:
            unique = f"{name} ({next(numbers)})"
        taken[unique] = None
    return list(taken)


def linear(factor: float, offset: float) -> str:
    """Return a linear calibration in words; nothing where raw and physical values are the same."""
    if (factor, offset) == (1, 0):
        return ""
    return f"{factor:.9g} * raw" + (f" {'-' if offset < 0 else '+'} {abs(offset):.9g}" if offset else "")


def described(*texts: object) -> str:
    """Return texts as one comment, without empty and repeated ones."""
    lines = dict.fromkeys(plain(text, None) for text in texts)
    return "; ".join(filter(None, lines))


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


class RowsOf(Protocol):
    """Function that yields rows of the channels at some indices."""

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
    """Return a group whose table holds the channels that are wanted.

    Further parameters are as of `Group` and `Table`.

    Raises
    ------
    FormatError
        When it is opened: if there are no columns.
    ParameterError
        When it is opened: if there is no column of a channel.
    """

    def open_table(channels: Sequence[str] | None) -> Table:
        if not columns:
            raise FormatError(f"{path} holds no channel of numbers")
        indices = list(range(len(columns)))
        if channels is not None:
            spelled = [(column.name, *spellings(column.heading)) for column in columns]
            indices = [index_of(name, spelled, path=path) for name in channels]
        return Table(
            path,
            tuple(columns[index] for index in indices),
            time_heading,
            partial(rows, indices),
            row_word,
            sampling_rate,
            start,
            comment,
        )

    headings = tuple(column.heading for column in columns)
    return Group(name, headings, clock, open_table, sampling_rate, n_rows)
