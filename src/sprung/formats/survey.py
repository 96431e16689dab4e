"""First reading of a table: live channels, fillers, and timing."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Booleans, Indices, Real
from sprung.errors import DataError, FormatError, ParameterError
from sprung.formats.fillers import FillerCount
from sprung.formats.settings import TIME_UNITS
from sprung.formats.table import Block, Table
from sprung.formats.time_columns import stated_unit
from sprung.formats.timing import Clock, ClockFit, TimeScale, time_scale

# Largest number that counts as measured; the squares of larger ones might overflow.
_LARGEST = 1e100
# Relative difference of a stated rate and that of the time column up to which they agree, and rate [Hz] below which a
# clock is doubted.
_AGREEMENT, _SLOW = 0.01, 0.5
# Fewest rows whose slow clock is doubted.
_FEWEST_ROWS = 20
# A channel with fewer values than this share of the rows is dead.
_ALIVE_SHARE = 0.5


@dataclass(frozen=True, eq=False, slots=True)
class Survey:
    """Facts about all rows: live channels, scale and advance of time, and the first lines of the history.

    `is_overruled` says that the stated sampling rate takes the place of an inconsistent clock; `fillers` are
    the numbers of each channel that stand for missing values.
    """

    alive: Booleans
    scale: TimeScale | None
    clock: Clock
    history: tuple[str, ...]
    is_overruled: bool = False
    fillers: tuple[tuple[float, ...], ...] = ()


def survey(table: Table, blocks: Iterable[Block], *, sampling_rate: float | None) -> Survey:
    """Return the facts about all rows of a table.

    Parameters
    ----------
    table
        Opened file.
    blocks
        Rows of the table.
    sampling_rate
        Sampling rate as stated by the caller [Hz]; None: that of the file.

    Returns
    -------
    Survey

    Raises
    ------
    FormatError
        If a value is infinite, or time is missing, repeated or runs backwards; the message names the row.
    DataError
        If no channel holds values, there is only one sample, or rates are mixed.
    ParameterError
        If the sampling rate is missing, or contradicts the time column by more than 1 %.
    """
    stated = stated_rate(table, sampling_rate)
    n_rows = 0
    counts = np.zeros(len(table.columns), dtype=int)
    scale = None
    doubt = ""
    fit = ClockFit(f"{table.path}, {table.row_word}")
    count = FillerCount(len(table.columns))
    for block in blocks:
        count.update(block.values)
        has_value = _values_present(table, block)
        rows = has_value.any(axis=0)
        n_rows += int(rows.sum())
        counts += has_value.sum(axis=1)
        if block.stamps is None or not rows.any() or doubt:
            continue
        scale = scale or time_scale(block.stamps[rows], time_unit(table))
        stamps = block.stamps[rows]
        numbers = block.first_row + np.flatnonzero(rows)
        try:
            fit.update(_seconds(table, stamps, numbers, scale), numbers, rounding=scale.rounding(stamps))
        except (DataError, FormatError) as error:
            doubt = _doubt(error, sampling_rate)
    fillers = [count.fillers(channel) for channel in range(len(table.columns))]
    counts -= [sum(numbers.values()) for numbers in fillers]
    alive = _alive(table, counts, n_rows)
    clock = Clock(stated, 1 / stated)
    if scale and not doubt:
        try:
            clock = fit.clock()
        except (DataError, FormatError) as error:
            doubt = _doubt(error, sampling_rate)
    if not doubt and sampling_rate is not None:
        doubt = _disagreement(table, clock, sampling_rate)
    if doubt:
        clock = Clock(stated, 1 / stated)
    elif table.time_heading is not None:
        _check_agreement(table, clock, stated)
    history = (
        *_history(table, _history_of_clock(clock, scale, doubt, n_rows), counts, n_rows),
        *_history_of_fillers(table, fillers),
    )
    return Survey(alive, scale, clock, history, bool(doubt), tuple(tuple(numbers) for numbers in fillers))


def _doubt(error: Exception, sampling_rate: float | None) -> str:
    """Return why an inconsistent clock is doubted; raise it where no sampling rate overrules."""
    if sampling_rate is None:
        raise error
    return str(error).rsplit(": ", 1)[0]


def _disagreement(table: Table, clock: Clock, stated: float) -> str:
    """Return what is doubtful in a clock that the stated rate contradicts; empty if it agrees, or is a clean clock."""
    if abs(stated / clock.sampling_rate - 1) <= _AGREEMENT or not (clock.is_coarse or clock.sampling_rate < _SLOW):
        return ""
    why = "but several rows share a stamp" if clock.is_coarse else "which is hardly that of a measurement of motion"
    return f"{table.path}: {table.time_heading!r} advances at {clock.sampling_rate:.4g} Hz, {why}"


def stated_rate(table: Table, sampling_rate: float | None) -> float:
    """Return the sampling rate from the caller or the file [Hz]; NaN if only the time stamps give it."""
    stated = table.sampling_rate if sampling_rate is None else sampling_rate
    if stated is None and table.time_heading is None:
        raise ParameterError(
            f"{table.path} has no time column (time, t, t_s, time_s or timestamp): state its sampling rate in Hz "
            "with --sampling-rate (in Python: sampling_rate=...)"
        )
    return np.nan if stated is None else stated


def _values_present(table: Table, block: Block) -> Booleans:
    """Return which values are present, shape (channels, rows); raise on infinite values and on other rates."""
    excessive = np.abs(block.values) > _LARGEST
    if excessive.any():
        channel, row = np.argwhere(excessive)[0]
        raise FormatError(
            f"{table.path}, {table.row_word} {block.first_row + row}, column {table.columns[channel].heading!r}: "
            f"{block.values[channel, row]:g} is not a measured value: correct it or leave it empty"
        )
    present = ~np.isnan(block.values)
    for column, has_value in zip(table.columns, present, strict=True):
        rows = np.flatnonzero(has_value)
        if 10 <= rows.size < 0.6 * block.n_rows and np.median(np.diff(rows)) >= 2:
            raise DataError(
                f"{table.path}: channel {column.name!r} has a value in every {np.median(np.diff(rows)):.0f}th row only "
                "(another rate): keep the channels of one rate with --channels, or write it to a file of its own"
            )
    return present


def time_unit(table: Table) -> float | None:
    """Return the seconds in one unit of the time column; None if the column does not state a unit."""
    unit = stated_unit(table.time_heading or "")
    return table.time_factor if unit is None or table.time_factor is not None else TIME_UNITS[unit]


def _seconds(table: Table, stamps: NDArray[Any], rows: Indices, scale: TimeScale) -> Real:
    """Return the times of the numbered rows [s]; every row with a value must have one."""
    seconds = scale.seconds(stamps)
    missing = ~np.isfinite(seconds)
    if missing.any():
        raise FormatError(
            f"{table.path}, {table.row_word} {rows[np.argmax(missing)]}: column {table.time_heading!r} holds no time: "
            "fill it in or remove the row"
        )
    return seconds


def _alive(table: Table, counts: Indices, n_rows: int) -> Booleans:
    """Return which channels have values in at least half of the rows."""
    alive = counts >= max(1.0, _ALIVE_SHARE * n_rows)
    if n_rows == 0 or not alive.any():
        raise DataError(
            f"{table.path} holds no samples: every channel is empty or has values in less than half the rows"
        )
    if n_rows == 1:
        raise DataError(f"{table.path} holds one sample: a recording needs at least two")
    return alive


def _check_agreement(table: Table, clock: Clock, stated: float) -> None:
    """Raise if the stated rate differs by more than 1 % from that of the time column; NaN: no rate is stated."""
    if abs(stated / clock.sampling_rate - 1) > _AGREEMENT:
        raise ParameterError(
            f"{table.path}: sampling_rate={stated:g} contradicts the time column {table.time_heading!r}, which "
            f"advances at {clock.sampling_rate:.6g} Hz: leave --sampling-rate out or correct the column"
        )


def _history(table: Table, of_clock: Iterable[str], counts: Indices, n_rows: int) -> Iterator[str]:
    """Yield the history of reading, line by line."""
    yield f"read {table.path.name}: {len(table.columns)} channels, {n_rows} rows"
    if table.comment:
        yield f"comment: {table.comment}"
    for column in table.columns:
        if column.unit:
            yield f"{column.name}: unit {column.unit!r} is unknown, values as in the file"
        if column.quantity != "unknown" and column.factor != 1:
            yield f"{column.name}: values times {column.factor:.6g} give {column.quantity.replace('_', ' ')} in SI"
    yield from of_clock
    yield from table.notes
    for column, count in zip(table.columns, counts, strict=True):
        if count < _ALIVE_SHARE * n_rows:
            yield f"{column.name}: dead, values in {count} of {n_rows} rows"


def _history_of_clock(clock: Clock, scale: TimeScale | None, doubt: str, n_rows: int) -> Iterator[str]:
    """Yield what the history says of the clock."""
    if doubt:
        yield f"{clock.sampling_rate:g} Hz as stated, in place of an inconsistent clock ({doubt})"
    else:
        yield clock.describe() if scale else f"no time column: {clock.sampling_rate:g} Hz as stated"
    if scale and n_rows >= _FEWEST_ROWS and clock.sampling_rate < _SLOW:
        yield f"is {clock.sampling_rate:.3g} Hz right? if not, state the sampling rate or the unit of the time column"


def _history_of_fillers(table: Table, fillers: Sequence[dict[float, int]]) -> Iterator[str]:
    """Yield what the history says of fillers."""
    for column, numbers in zip(table.columns, fillers, strict=True):
        for number, count in numbers.items():
            yield f"{column.name}: {number:g} in {count} rows is a filler, far from all other values: taken as missing"
