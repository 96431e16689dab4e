"""Tables, as every format provides and writes them: columns with their units, and rows in blocks of any size."""

import re
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Booleans, Real
from sprung.errors import FormatError, ParameterError, SprungError
from sprung.formats.settings import TIME_UNITS
from sprung.recording import Recording
from sprung.units import UNITS, conversion

#: Function of the names of wanted channels (None: all) that returns their table.
Opener = Callable[[Sequence[str] | None], "Table"]

#: Names of a time column, in lower case and without a unit.
TIME_NAMES = ("time", "t", "t_s", "time_s", "timestamp")

#: Texts that stand for a missing number.
MISSING = (
    *("", "nan", "NaN", "NAN", "NA", "N/A", "n/a", "#N/A", "#NA", "#NV", "#VALUE!", "#WERT!", "#DIV/0!"),
    *("null", "NULL", "None", "nil", "-", "--", "---"),
)

#: Rows that are read at once: 0.5 MB a channel.
PIECE_ROWS = 65_536
_NO_UNIT = ("", "-")
#: Units of what a sensor puts out, which no factor turns into motion: such columns keep their values.
_RAW_UNITS = frozenset({"V", "mV", "Volt", "Volts", "A", "mA", "counts", "count", "LSB", "raw", "digits", "%"})
_BRACKETS = re.compile(r"(?P<name>.*?)\s*(?P<bracket>[\[(])(?P<unit>[^\[\]()]*)[\])]\s*")
_NUMBER = re.compile(r"[+-]?(\d+\.?\d*|\.\d+)([eE][+-]?\d+)?|[+-]?(inf|infinity|nan)", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class Column:
    """Channel of a file: its heading, its name, its quantity, and the factor to SI units.

    `unit` is a stated unit that is not in `sprung.units`: values stay as they are. `comment` and `calibration` are as
    stated in the file, `direction` is that of a name that means an axis of the vehicle.
    """

    heading: str
    name: str
    quantity: str = "unknown"
    factor: float = 1.0
    unit: str = ""
    comment: str = ""
    calibration: str = ""
    direction: tuple[float, float, float] | None = None

    def with_facts(self, facts: Mapping[str, str | None]) -> "Column":
        """Return the column with its "comment" and "calibration"."""
        return replace(self, comment=facts.get("comment") or "", calibration=facts.get("calibration") or "")


@dataclass(frozen=True, eq=False, slots=True)
class Block:
    """Consecutive rows: time stamps as in the file (None without a time column), values of shape (channels, rows)."""

    first_row: int
    stamps: NDArray[Any] | None
    values: Real

    @property
    def n_rows(self) -> int:
        """Number of rows."""
        return int(self.values.shape[1])


class Doubles:
    """Finds the rows that repeat the stamp and all values of the row before, block by block."""

    def __init__(self) -> None:
        self._last: Block | None = None

    def update(self, block: Block) -> Booleans:
        """Add the next rows; return which are repeated, shape (rows,)."""
        is_double = np.zeros(block.n_rows, dtype=bool)
        if block.stamps is not None and block.n_rows:
            last = self._last or replace(block, stamps=block.stamps[:0], values=block.values[:, :0])
            stamps = np.concatenate([np.asarray(last.stamps), block.stamps])
            values = np.concatenate([last.values, block.values], axis=1)
            same = 1 + np.flatnonzero(stamps[1:] == stamps[:-1])
            own, before = values[:, same], values[:, same - 1]
            is_same = np.all((own == before) | (np.isnan(own) & np.isnan(before)), axis=0)
            is_double[same[is_same] - last.n_rows] = True
            self._last = replace(block, stamps=block.stamps[-1:], values=block.values[:, -1:])
        return is_double


@dataclass(frozen=True, slots=True)
class _FillerLimits:
    """Which numbers stand for missing values."""

    min_count: int = 3  # fewer equal values are no filler
    max_share: float = 0.5  # numbers in more of the values may be what a channel measures
    distance: float = 3.0  # of a filler from all other values, over their range
    numbers: tuple[float, ...] = (  # that loggers write, as in the file, those of the first line also negative
        *(999.0, 999.9, 9999.0, 9999.9, 99999.0, 999999.0, 1e30, 1e31),
        *(-32768.0, 32767.0, 65535.0, -2147483648.0, 2147483647.0, 4294967295.0),
    )


_FILLER_LIMITS = _FillerLimits()
_FILLERS = np.array([*_FILLER_LIMITS.numbers, *(-number for number in _FILLER_LIMITS.numbers[:8])])


class FillerCount:
    """Counts the fillers in channels block by block."""

    def __init__(self, n_channels: int) -> None:
        self._counts = np.zeros((n_channels, _FILLERS.size), dtype=np.intp)
        self._others = np.zeros(n_channels, dtype=np.intp)
        self._lowest = np.full(n_channels, np.inf)
        self._highest = np.full(n_channels, -np.inf)

    def update(self, values: Real) -> None:
        """Add the next rows, shape (channels, rows), missing values as NaN."""
        is_other = np.isfinite(values)
        is_large = np.abs(values) >= np.abs(_FILLERS).min()
        for row in np.flatnonzero(is_large.any(axis=1)):
            matches = values[row] == _FILLERS[:, None]
            self._counts[row] += np.count_nonzero(matches, axis=1)
            is_other[row] &= ~matches.any(axis=0)
        self._others += np.count_nonzero(is_other, axis=1)
        lowest = np.min(values, axis=1, where=is_other, initial=np.inf)
        highest = np.max(values, axis=1, where=is_other, initial=-np.inf)
        self._lowest = np.minimum(self._lowest, lowest)
        self._highest = np.maximum(self._highest, highest)

    def fillers(self, channel: int) -> dict[float, int]:
        """Return the fillers of a channel, each with the number of its values.

        A filler occurs at least three times and is farther from all other values than three times their range; a
        channel of which it is more than half has none, as it may be what the channel measures.
        """
        n_others = int(self._others[channel])
        low, high = self._lowest[channel], self._highest[channel]
        counts = self._counts[channel]
        if not n_others or counts.sum() > _FILLER_LIMITS.max_share * (n_others + counts.sum()):
            return {}
        distance = np.maximum(low - _FILLERS, _FILLERS - high)
        is_filler = (
            (counts >= _FILLER_LIMITS.min_count) & (distance > _FILLER_LIMITS.distance * (high - low)) & (distance > 0)
        )
        return {float(_FILLERS[k]): int(counts[k]) for k in np.flatnonzero(is_filler)}


def without_fillers(values: Real, fillers: tuple[tuple[float, ...], ...]) -> Real:
    """Return values (channels, rows) with NaN for the fillers of each channel."""
    if not any(fillers):
        return values
    cleaned = values.copy()
    for row, numbers in enumerate(fillers):
        if numbers:
            cleaned[row, np.isin(cleaned[row], numbers)] = np.nan
    return cleaned


class Rows(Protocol):
    """Function that yields the rows of a table."""

    def __call__(self, first: int = 0, last: int | None = None) -> Iterator[Block]:
        """Yield the rows from `first` to before `last`, counted from 0 (None: to the end), in blocks."""


@dataclass(frozen=True, eq=False, slots=True)
class Table:
    """Opened table of a file: its channels, its time column, and a function that reads its rows.

    Parameters
    ----------
    path
        Path of the file.
    columns
        Channels.
    time_heading
        Heading of the time column; None if the rows have no time stamps.
    blocks
        Function that yields some rows, reading no more of the file than it must (`within` cuts rows read in order).
    row_word
        Word for a row in messages ("line" in text).
    sampling_rate
        Sampling rate stored in the file [Hz]; None: only the time stamps give it.
    start
        Time of the origin of time stamps that count seconds (without stamps: of the first row), UTC in nanoseconds
        since 1970; None where unknown.
    comment
        Comment on the measurement, as in the file.
    time_factor
        Seconds in one unit of the time stamps; None: by their heading or magnitude.
    notes
        Lines for the history on how the table was opened.
    left_out
        Name of each channel of another length, and why it is left out.
    """

    path: Path
    columns: tuple[Column, ...]
    time_heading: str | None
    blocks: Rows
    row_word: str = "row"
    sampling_rate: float | None = None
    start: int | None = None
    comment: str = ""
    time_factor: float | None = None
    notes: tuple[str, ...] = ()
    left_out: tuple[tuple[str, str], ...] = ()


@dataclass(frozen=True, eq=False, slots=True)
class Group:
    """Channels of a file whose samples were taken together.

    Parameters
    ----------
    name
        Name of the group, distinct within the file.
    headings
        Headings of its channels, as in the file.
    clock
        Value that is equal for groups whose rows have the same times.
    open
        Function of the names of wanted channels (None: all) that returns their table.
    sampling_rate
        Sampling rate [Hz]; None where only the time stamps show it.
    n_rows
        Number of rows; None where unknown before reading.
    """

    name: str
    headings: tuple[str, ...]
    clock: Hashable
    open: Opener
    sampling_rate: float | None = None
    n_rows: int | None = None

    def has(self, name: str) -> bool:
        """Return whether the group has the channel called `name`, with its unit or without."""
        return any(name in spellings(heading) for heading in self.headings)


def within(blocks: Iterable[Block], first: int, last: int | None) -> Iterator[Block]:
    """Yield the rows from `first` to before `last` (None: to the end) of blocks that are read in order."""
    row = 0
    for block in blocks:
        end = row + block.n_rows
        if end > first:
            yield cut(block, slice(max(0, first - row), None if last is None else last - row))
        row = end
        if last is not None and row >= last:
            return


def arrow_values(array: Any) -> NDArray[Any]:
    """Return numbers, date-times or durations of Arrow, missing ones as NaN or NaT; its own way imports pandas."""
    import pyarrow as pa

    if isinstance(array, pa.ChunkedArray):
        array = array.combine_chunks()
    letter = "M" if pa.types.is_timestamp(array.type) else "m" if pa.types.is_duration(array.type) else ""
    kind = f"{letter}8[{array.type.unit}]" if letter else "f8"
    if pa.types.is_integer(array.type) and not array.null_count:
        kind = array.type.to_pandas_dtype()
    elif not letter and not pa.types.is_float64(array.type):  # a cast imports `pyarrow.compute`
        array = array.cast(pa.float64(), safe=False)
    validity, data = array.buffers()
    part = slice(array.offset, array.offset + len(array))
    values = np.frombuffer(data or b"", dtype=kind)[part]
    if not array.null_count:
        return values
    is_valid = np.unpackbits(np.frombuffer(validity, dtype=np.uint8), bitorder="little")[part]
    return np.where(is_valid, values, np.array("NaT" if letter else np.nan, dtype=values.dtype))


def row_pieces(n_rows: int, first: int, last: int | None, *, size: int | None = None) -> Iterator[slice]:
    """Yield slices of at most `size` (None: `PIECE_ROWS`) of `n_rows` rows, from `first` to before `last`."""
    end = n_rows if last is None else min(last, n_rows)
    step = size or PIECE_ROWS
    for begin in range(first, end, step):
        yield slice(begin, min(begin + step, end))


def split_heading(heading: str) -> tuple[str, str | None, bool]:
    """Return name, unit (None without one) and whether the unit is in square brackets."""
    match = _BRACKETS.fullmatch(heading.strip())
    if match is None:
        return heading.strip(), None, False
    return match["name"], match["unit"].strip(), match["bracket"] == "["


def spellings(heading: str) -> tuple[str, str, str]:
    """Return the names by which people call the channel with this heading, the plain one first."""
    return split_heading(heading)[0], heading, heading.strip()


def is_time(heading: str) -> bool:
    """Return whether `heading` names a time column."""
    return split_heading(heading)[0].lower() in TIME_NAMES


def is_number(text: str) -> bool:
    """Return whether `text` is one number with a decimal point."""
    return _NUMBER.fullmatch(text.strip()) is not None


def stated_column(heading: str, name: str, unit: str, *, comment: str = "", calibration: str = "") -> Column:
    """Return the channel of a file that states name and unit apart; an unknown unit leaves the values as they are."""
    plain = unit.strip()
    known = ("unknown", 1.0) if plain in _NO_UNIT else known_unit(plain)
    quantity, factor = known or ("unknown", 1.0)
    return Column(heading, name, quantity, factor, "" if known else plain, comment, calibration)


def column(heading: str, *, unit: str | None = None, path: Path) -> Column:
    """Return the channel that `heading` describes; `unit` where the file states it elsewhere.

    Square brackets always hold a unit; round ones belong to the name if the unit is not known. Values in volts or
    counts stay as they are.

    Raises
    ------
    FormatError
        If the heading has no name, or an unknown unit in square brackets.
    """
    name, bracketed, is_square = split_heading(heading)
    if not is_square and not known_unit(bracketed or ""):
        name, bracketed = heading.strip(), bracketed if bracketed in _RAW_UNITS else None
    if not name:
        raise FormatError(f"{path}: column {heading!r} has no name: give every column a name")
    stated = (bracketed or "") if unit is None else unit
    if stated.strip() not in (*_NO_UNIT, *TIME_UNITS, *_RAW_UNITS):
        try:
            conversion(stated)
        except ParameterError as error:
            raise FormatError(f"{path}: column {heading!r}: {error}") from None
    return stated_column(heading, name, stated)


def known_unit(unit: str) -> tuple[str, float] | None:
    """Return the quantity of a unit and its factor to SI; None where the unit cannot be converted."""
    try:
        return conversion(unit)
    except ParameterError:
        return None


def is_unit(text: str) -> bool:
    """Return whether `text` is a unit of a channel or of time, with or without brackets."""
    plain = text.strip().strip("[]()")
    return plain in (*_NO_UNIT, *TIME_UNITS) or known_unit(plain) is not None


def time_column(headings: Iterable[str], *, stated: str | None = None) -> str | None:
    """Return the first heading that names a time column, or the one called `stated`; None if there is none."""
    times = [heading for heading in headings if is_time(heading)]
    named = [heading for heading in times if stated in (heading, split_heading(heading)[0])]
    return next(iter(named + times), None)


def chosen_columns(
    headings: Sequence[str],
    channels: Sequence[str] | None,
    *,
    units: Sequence[str | None] | None = None,
    time: str | None = None,
    path: Path,
) -> tuple[Column, ...]:
    """Return the columns of `channels`, in that order; None: all that have a name and are not the column `time`.

    Raises
    ------
    FormatError
        If there is no column of a channel.
    """
    stated = dict(zip(headings, units or [None] * len(headings), strict=True))
    kept = [heading for heading in headings if heading.strip() and heading != time]
    refuse_repeated(kept, path=path)
    if channels is not None:
        names = [spellings(heading) for heading in kept]
        kept = [kept[index_of(name, names, path=path)] for name in channels]
    columns = tuple(column(heading, unit=stated[heading], path=path) for heading in kept)
    refuse_repeated([item.name for item in columns], path=path)
    if not columns:
        raise FormatError(f"{path} holds no channel: it needs a column of numbers in addition to the time")
    return columns


def refuse_repeated(names: Sequence[str], *, path: Path) -> None:
    """Raise a `FormatError` if a name occurs twice."""
    for name, count in Counter(names).items():
        if count > 1:
            raise FormatError(f"{path}: column name {name!r} occurs more than once: rename one of them")


def index_of(name: str, spelled: Iterable[Sequence[str]], *, path: Path) -> int:
    """Return the index of the channel called `name` among channels with several spellings each."""
    spelled = list(spelled)
    for index, spellings in enumerate(spelled):
        if name in spellings:
            return index
    known = ", ".join(spellings[0] for spellings in spelled)
    raise ParameterError(f"{path} has no channel {name!r}: choose from {known}")


def join(blocks: Sequence[Block]) -> Block:
    """Return consecutive blocks as one."""
    stamps = [block.stamps for block in blocks if block.stamps is not None]
    values = np.concatenate([block.values for block in blocks], axis=1)
    return Block(blocks[0].first_row, np.concatenate(stamps) if stamps else None, values)


def cut(block: Block, rows: slice) -> Block:
    """Return some rows of `block`."""
    stamps = None if block.stamps is None else block.stamps[rows]
    return Block(block.first_row + rows.indices(block.n_rows)[0], stamps, block.values[:, rows])


def rebatch(blocks: Iterable[Block], n_rows: int) -> Iterator[Block]:
    """Yield the same rows in blocks of `n_rows`; only the last block may be shorter."""
    waiting: list[Block] = []
    for block in blocks:
        waiting.append(block)
        if sum(item.n_rows for item in waiting) < n_rows:
            continue
        whole = join(waiting)
        full = whole.n_rows - whole.n_rows % n_rows
        for first in range(0, full, n_rows):
            yield cut(whole, slice(first, first + n_rows))
        waiting = [cut(whole, slice(full, None))] if full < whole.n_rows else []
    if waiting:
        yield join(waiting)


@contextmanager
def reported(path: Path, kind: str) -> Iterator[None]:
    """Turn any error that a parser raises on a damaged file into one sentence.

    Parsers of binary formats may raise almost any exception on unexpected bytes, hence the broad `except`.
    """
    try:
        yield
    except SprungError:
        raise
    except Exception as error:
        detail = " ".join(str(error).split())[:200] or type(error).__name__
        raise FormatError(f"{path} cannot be read as {kind} ({detail}): check that the file is complete") from error


@dataclass(frozen=True, eq=False, slots=True)
class Written:
    """Columns of a file that is read as a recording.

    Parameters
    ----------
    headings, units
        Heading of each channel, with its unit where the format states it nowhere else, and its unit.
    time, stamps
        Name and values of the time column: UTC date-times if the start is known, else seconds.
    values
        Samples in these units, shape (channels, samples).
    """

    headings: list[str]
    units: list[str]
    time: str
    stamps: NDArray[Any]
    values: Real


def written(recording: Recording, *, has_units: bool) -> Written:
    """Return the columns of a recording; `has_units`: whether headings state units.

    Raises
    ------
    ParameterError
        If a name would be read as a unit, a number, a missing value or a time column.
    """
    headings, units, factors = [], [], []
    for channel in recording.channels:
        unit, factor = next(
            ((unit, factor) for unit, (quantity, factor) in UNITS.items() if quantity == channel.quantity), ("", 1.0)
        )
        expected = Column(channel.name, channel.name)
        if unit and has_units:
            expected = Column(f"{channel.name} [{unit}]", channel.name, channel.quantity, factor)
        if not _reads_back(expected):
            raise ParameterError(
                f"channel name {channel.name!r} would not be read back from a file: rename it to plain text "
                "without a unit, not a number and not a name of a time column"
            )
        headings.append(expected.heading)
        units.append(unit)
        factors.append([factor])
    seconds = seconds_of(recording)
    name, stamps = "time", np.round(seconds, 9)
    if recording.start is not None:
        nanoseconds = recording.start + np.round(seconds * 1e9).astype(np.int64)
        name, stamps = "timestamp", nanoseconds.astype("M8[ns]")
    return Written(headings, units, name, stamps, recording.samples / np.array(factors))


def _reads_back(expected: Column) -> bool:
    """Return whether a file with the heading of a column gives this channel."""
    name = expected.name
    if not name.isprintable() or is_number(name) or name in MISSING or is_time(expected.heading):
        return False
    try:
        return column(expected.heading, path=Path()) == expected
    except FormatError:
        return False


def without_unit(name: str) -> str:
    """Return a name without a known unit in brackets at its end, with which it would not be read back."""
    plain, unit, _ = split_heading(name)
    return plain if plain and known_unit(unit or "") else name


def seconds_of(recording: Recording) -> Real:
    """Return the time of each sample since the first one [s]."""
    seconds: Real = np.arange(recording.n_samples) / recording.sampling_rate
    for gap in recording.gaps:
        seconds[gap.index :] += gap.duration
    return seconds
