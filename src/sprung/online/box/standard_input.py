"""Blocks of comma-separated lines that come one by one, such as from standard input."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Protocol

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number
from sprung._display import counted
from sprung.errors import FormatError
from sprung.formats.table import MISSING, Column, chosen_columns, is_number, is_time
from sprung.online.box.resampling import BLOCK
from sprung.recording import Channel, Recording

# Name of the stream in messages.
_NAME = "standard input"
# Longest line [characters].
_LONGEST_LINE = 1 << 16
# Largest plausible value of a sensor; squares of larger ones would overflow.
_LARGEST = 1e100
# A longer wait for a line [s] may be a pause of the sender.
_PAUSE = 2.0


class LineStream(Protocol):
    """Stream of text that is read line by line, such as `sys.stdin`."""

    def readline(self, limit: int, /) -> str:
        """Return the next line, at most `limit` characters of it; empty at the end."""


def from_lines(lines: LineStream, *, sampling_rate: float, start: Callable[[], int]) -> Iterator[Recording]:
    r"""Return the blocks of comma-separated values as they arrive, such as from standard input.

    Parameters
    ----------
    lines
        Lines of the stream. The first has the names of the channels, with units in brackets as in files; the others
        have a number for each, or nothing where it is missing.
    sampling_rate
        Sampling rate of the lines [Hz].
    start
        Function that returns the present time, UTC ns.

    Raises
    ------
    FormatError
        If a line cannot be read, with its number, after the samples before it.
    ParameterError
        If the sampling rate is not above 0.

    Notes
    -----
    The first line of values has its time of arrival; the times of later lines follow from their number. After a pause
    of more than 2 s, or if the clock was set back meanwhile, a new block begins at the arrival of the next line.

    Examples
    --------
    >>> from io import StringIO
    >>> lines = StringIO("acc_fl [g]" + 200 * "\n0.5")
    >>> blocks = list(from_lines(lines, sampling_rate=100.0, start=lambda: 0))
    >>> [(block.start, block.n_samples, float(block.samples[0, 0])) for block in blocks]
    [(0, 100, 4.903325), (1000000000, 100, 4.903325)]
    """
    check_number("sampling_rate", sampling_rate, above=0)
    return _blocks(lines, sampling_rate, start)


def _blocks(lines: LineStream, sampling_rate: float, start: Callable[[], int]) -> Iterator[Recording]:
    """Yield blocks of lines."""
    texts = _texts(lines)
    columns = _columns(texts)
    collected = _Collected(columns, sampling_rate)
    began = start()
    try:
        for number, text in texts:
            came = start()
            if collected.is_interrupted(began, came):
                yield from collected.block()
                collected.begin_anew()
            collected.add(_values(text, number, columns), came)
            if collected.is_full:
                yield from collected.block()
            began = start()
    except FormatError:
        yield from collected.block()
        raise
    yield from collected.block()


class _Collected:
    """Lines of a block, and the time of its first one."""

    def __init__(self, columns: tuple[Column, ...], sampling_rate: float) -> None:
        self._channels = tuple(Channel(column.name, column.quantity) for column in columns)
        self._factors = np.array([[column.factor] for column in columns])
        self._sampling_rate = sampling_rate
        self._step = max(1, round(BLOCK * sampling_rate))
        self._pause = max(_PAUSE, 5 / sampling_rate) * 1e9
        self._rows: list[list[float]] = []
        self._next: int | None = None

    @property
    def is_full(self) -> bool:
        """Whether the lines make a whole block."""
        return len(self._rows) >= self._step

    def is_interrupted(self, began: int, came: int) -> bool:
        """Return whether a line for which the wait began and ended at times [ns] follows a pause.

        A late line is not a pause if lines before it were early, as from a sender that writes in batches.
        """
        if self._next is None:
            return False
        counted = self._next + len(self._rows) * 1e9 / self._sampling_rate
        return came - began < -self._pause or (came - began > self._pause and came - counted > self._pause)

    def add(self, values: list[float], came: int) -> None:
        """Add a line."""
        if self._next is None:
            self._next = came
        self._rows.append(values)

    def block(self) -> Iterator[Recording]:
        """Yield the collected lines as a block, if there are any."""
        if not self._rows or self._next is None:
            return
        samples: Real = np.array(self._rows).T * self._factors
        begin = self._next
        self._next = begin + round(len(self._rows) * 1e9 / self._sampling_rate)
        self._rows = []
        yield Recording(samples, self._sampling_rate, self._channels, begin)

    def begin_anew(self) -> None:
        """Take the time of the next block from its first line."""
        self._next = None


def _texts(lines: LineStream) -> Iterator[tuple[int, str]]:
    """Yield the lines that are not blank, with their numbers."""
    number = 0
    while True:
        number += 1
        try:
            line = lines.readline(_LONGEST_LINE)
        except UnicodeDecodeError:
            raise FormatError(f"line {number} of {_NAME} is not text in UTF-8: send names and numbers") from None
        if not line:
            return
        if len(line) >= _LONGEST_LINE:
            raise FormatError(
                f"line {number} of {_NAME} is longer than {_LONGEST_LINE} characters: end each line of values"
            )
        if line.strip():
            yield number, line.removeprefix("\ufeff").strip()


def _columns(texts: Iterator[tuple[int, str]]) -> tuple[Column, ...]:
    """Return the channels that the first line names."""
    number, text = next(texts, (0, ""))
    headings = [_bare(heading) for heading in text.split(",")]
    if not text:
        raise FormatError(f"{_NAME} is empty: the first line must name the channels")
    if not all(headings) or any(is_number(heading) for heading in headings):
        raise FormatError(
            f"line {number} of {_NAME} is {text[:60]!r}: it must name the channels, separated by commas, before the "
            "lines of numbers"
        )
    stamped = [heading for heading in headings if is_time(heading)]
    if stamped:
        raise FormatError(f"{_NAME} has a time column {stamped[0]!r}: leave it out, as lines are timed on arrival")
    return chosen_columns(headings, None, path=Path(_NAME))


def _values(text: str, number: int, columns: tuple[Column, ...]) -> list[float]:
    """Return the numbers of a line; NaN where one is missing."""
    fields = [_bare(field) for field in text.split(",")]
    if len(fields) != len(columns):
        found = f"{counted(len(fields), 'value')} for {counted(len(columns), 'channel')} ({text[:60]!r})"
        raise FormatError(
            f"line {number} of {_NAME} has {found}: send one for each, or nothing between commas where it is missing"
        )
    values = []
    for field, column in zip(fields, columns, strict=True):
        if field in MISSING:
            values.append(np.nan)
        elif is_number(field) and abs(float(field)) < _LARGEST:
            values.append(float(field))
        else:
            raise FormatError(
                f"line {number} of {_NAME}, channel {column.name!r}: {field[:40]!r} is not a measured value: send a "
                "number, or nothing where it is missing"
            )
    return values


def _bare(field: str) -> str:
    """Return the contents of a field, without blanks and quotes around it."""
    text = field.strip()
    return text[1:-1].strip() if len(text) > 1 and text[0] == text[-1] == '"' else text
