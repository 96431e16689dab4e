"""From the rows of a table to recordings: missing values cut, gaps found, samples brought onto a uniform grid.

A table is read twice. The survey establishes the facts that concern all rows: which channels are alive and how time
advances. The second pass turns blocks of rows into recordings. Both need memory for one block only.
"""

import itertools
import math
import sys
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Booleans, Indices, Real
from sprung.channel_names import identified, mapping_in_words, read_name_table
from sprung.errors import DataError, FormatError, ParameterError
from sprung.formats.bridging import bridged, said
from sprung.formats.settings import TIME_UNITS, ReadSettings
from sprung.formats.table import Block, Table
from sprung.formats.time_columns import stated_unit, timed
from sprung.formats.timing import Clock, ClockFit, TimeScale, find_gaps, interpolate, time_scale, uncrowded
from sprung.recording import Channel, Gap, Recording

# Largest number that counts as measured; the squares of larger ones might overflow.
_LARGEST = 1e100
# Relative difference of a stated rate and that of the time column up to which they agree, and rate [Hz] below which a
# clock is doubted.
_AGREEMENT, _SLOW = 0.01, 0.5
# Fewest rows whose slow clock is doubted.
_FEWEST_ROWS = 20
# A channel with fewer values than this share of the rows is dead.
_ALIVE_SHARE = 0.5
# Rows around the end of a block that are used again with the next one, the reach of splines and medians.
_MARGIN = 64
# Samples on either side of a gap that give its duration.
_REACH = 1000


@dataclass(frozen=True, eq=False, slots=True)
class Survey:
    """Facts about all rows: living channels, scale and advance of time, and the first lines of the history.

    `is_overruled` says that the stated sampling rate takes the place of a clock that contradicts itself.
    """

    alive: Booleans
    scale: TimeScale | None
    clock: Clock
    history: tuple[str, ...]
    is_overruled: bool = False


def limited(table: Table, settings: ReadSettings) -> Table:
    """Return the table with its time column and only the rows of the wanted part.

    Parameters
    ----------
    table
        Opened file.
    settings
        Time column, start and end of the part [s after the first row], and longest gap to bridge [s].

    Raises
    ------
    ParameterError
        If the part begins after the end of the file, or as raised by `time_columns.timed`.
    FormatError
        As raised by `time_columns.timed`.
    """
    table = _named(replace(timed(table, settings), bridge=settings.bridge), settings)
    if settings.start is None and settings.end is None:
        return table
    begin, end, origin = _part(table, settings)

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        return table.blocks(begin + first, end if last is None else min(end, begin + last))

    return replace(table, blocks=blocks, times=None, start=None if table.start is None else table.start + origin)


def _named(table: Table, settings: ReadSettings) -> Table:
    """Return the table with what the names of its channels state and the file does not."""
    rules = read_name_table(settings.names)
    columns, notes = [], []
    for column in table.columns:
        channel = Channel(column.name, column.quantity)
        named, factor, rule = identified(channel, rules)
        if rule is None or column.unit:
            columns.append(column)
            continue
        notes.append(mapping_in_words(channel, rule))
        quantity, factor = named.quantity, column.factor * factor
        columns.append(replace(column, quantity=quantity, factor=factor, direction=named.direction))
    return replace(table, columns=tuple(columns), notes=(*table.notes, *notes))


def _part(table: Table, settings: ReadSettings) -> tuple[int, int, int]:
    """Return the first row of the wanted part, the row after its last one, and its start without stamps [ns]."""
    start, end = settings.start or 0.0, np.inf if settings.end is None else settings.end
    if table.time_heading is None:
        rate = _stated_rate(table, settings.sampling_rate)
        first = int(np.ceil(start * rate - 1e-9))
        return first, sys.maxsize if np.isinf(end) else int(np.ceil(end * rate - 1e-9)), round(1e9 * first / rate)
    scale, n_before, n_until = None, 0, 0
    for block in (table.times or table.blocks)():
        if block.stamps is None:
            break
        scale = scale or time_scale(block.stamps, time_unit(table))
        seconds = scale.seconds(block.stamps)
        n_before += int(np.count_nonzero(seconds < start))
        n_until += int(np.count_nonzero(seconds < end))
        if seconds[-1] >= end:
            break
    if n_until <= n_before:
        raise ParameterError(f"{table.path} holds no rows from {start:g} s on: state a part within the recording")
    return n_before, n_until, 0


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
    stated = _stated_rate(table, sampling_rate)
    n_rows = 0
    counts = np.zeros(len(table.columns), dtype=int)
    scale = None
    doubt = ""
    fit = ClockFit(f"{table.path}, {table.row_word}")
    for block in blocks:
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
    history = _history(table, _history_of_clock(clock, scale, doubt, n_rows), counts, n_rows)
    return Survey(alive, scale, clock, tuple(history), is_overruled=bool(doubt))


def _doubt(error: Exception, sampling_rate: float | None) -> str:
    """Return what a clock that contradicts itself is doubted for; raise it where no sampling rate overrules."""
    if sampling_rate is None:
        raise error
    return str(error).rsplit(": ", 1)[0]


def _disagreement(table: Table, clock: Clock, stated: float) -> str:
    """Return what is doubtful in a clock that the stated rate contradicts; empty if it agrees, or is a clean clock."""
    if abs(stated / clock.sampling_rate - 1) <= _AGREEMENT or not (clock.is_coarse or clock.sampling_rate < _SLOW):
        return ""
    why = "but several rows share a stamp" if clock.is_coarse else "which is hardly that of a measurement of motion"
    return f"{table.path}: {table.time_heading!r} advances at {clock.sampling_rate:.4g} Hz, {why}"


def _stated_rate(table: Table, sampling_rate: float | None) -> float:
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
        yield f"{clock.sampling_rate:g} Hz as stated, in place of a clock that contradicts itself ({doubt})"
    else:
        yield clock.describe() if scale else f"no time column: {clock.sampling_rate:g} Hz as stated"
    if scale and n_rows >= _FEWEST_ROWS and clock.sampling_rate < _SLOW:
        yield f"is {clock.sampling_rate:.3g} Hz right? if not, state the sampling rate or the unit of the time column"


def assemble(table: Table, blocks: Iterable[Block], facts: Survey) -> Iterator[Recording]:
    """Yield recordings of consecutive blocks: each begins where the one before ends; gaps lie inside recordings."""
    assembler = _Assembler(table, facts)
    for block, following in itertools.pairwise(itertools.chain(blocks, [None])):
        if block is not None:
            recording = assembler.update(block, is_last=following is None)
            if recording is not None:
                yield recording


class _Assembler:
    """Turns blocks of rows into recordings; holds back the last rows of each block until the next one."""

    def __init__(self, table: Table, facts: Survey) -> None:
        self._table = table
        self._facts = facts
        self._clock = facts.clock
        self._channels = tuple(
            Channel(
                column.name,
                column.quantity,
                direction=column.direction,
                comment=column.comment,
                calibration=column.calibration,
            )
            for column in table.columns
        )
        self._factors = np.array([[column.factor] for column in table.columns])
        self._n_rows = 0
        self._seconds: Real = np.empty(0)
        self._samples: Real = np.empty((len(self._channels), 0))
        self._n_done = 0
        self._next_time: float | None = None
        self._n_cut = 0
        self._bridged: dict[float, float] = {}

    def update(self, block: Block, *, is_last: bool) -> Recording | None:
        """Add the next rows; return the recording that they complete, None if there is none."""
        self._append(block)
        n_rows = self._seconds.size
        gaps = self._gaps()
        gaps = gaps[gaps > self._n_done]
        end = n_rows if is_last else max(self._n_done, _quiet_end(gaps, n_rows))
        if end <= self._n_done:
            return None
        recording = self._resample(gaps, end) if self._clock.is_resampled else self._take_rows(gaps, end)
        self._forget(gaps, end)
        return bridged(recording, self._table.bridge) if self._table.bridge else recording

    def _gaps(self) -> Indices:
        """Return the rows before which time is missing; without short ones where splines pass over them."""
        gaps = find_gaps(self._seconds, self._clock)
        if not self._clock.is_resampled or not self._table.bridge:
            return gaps
        missing = self._seconds[gaps] - self._seconds[gaps - 1] - self._clock.interval
        is_short = missing <= self._table.bridge
        self._bridged |= {
            float(self._seconds[gap]): float(length)
            for gap, length in zip(gaps[is_short], missing[is_short], strict=True)
        }
        return gaps[~is_short]

    def _append(self, block: Block) -> None:
        """Add the rows in which every living channel has a value."""
        present = ~np.isnan(block.values)
        whole = present[self._facts.alive].all(axis=0)
        self._n_cut += int(present.any(axis=0).sum() - whole.sum())
        if self._facts.scale and block.stamps is not None and not self._facts.is_overruled:
            seconds = self._facts.scale.seconds(block.stamps[whole])
        else:
            rows = self._n_rows + np.flatnonzero(whole)
            seconds = rows.astype(np.float64) * self._clock.interval
        self._n_rows += block.n_rows
        self._seconds = np.concatenate([self._seconds, seconds])
        self._samples = np.concatenate([self._samples, block.values[:, whole] * self._factors], axis=1)

    def _take_rows(self, gaps: Indices, end: int) -> Recording:
        """Return the rows up to `end` as they are; straight lines through the stamps give their times."""
        offsets = self._seconds - self._clock.interval * np.arange(self._seconds.size)
        edges = [0, *gaps, offsets.size]
        durations = []
        for first, here, last in zip(edges, edges[1:], edges[2:], strict=False):
            before = np.median(offsets[max(first, here - _REACH) : here])
            after = np.median(offsets[here : min(last, here + _REACH)])
            durations.append((here, after - before))
        start = np.median(offsets[: min(edges[1], _REACH)])
        return self._recording(self._samples[:, :end], float(start), [gap for gap in durations if gap[0] < end])

    def _resample(self, gaps: Indices, end: int) -> Recording:
        """Return the samples at uniform times, interpolated within each stretch."""
        interval = self._clock.interval
        edges = [0, *gaps, self._seconds.size]
        parts: list[Real] = []
        durations: list[tuple[int, float]] = []
        next_time = self._next_time
        start = None
        for first, last in itertools.pairwise(edges):
            if first >= end:
                break
            times = uncrowded(self._seconds[first:last], interval)
            origin = times[0] if first or next_time is None else next_time
            # An open stretch ends where the next block continues it; a closed one is used to its last sample.
            until = times[-1] + 1e-6 * interval if last <= end else times[end - first]
            wanted = origin + interval * np.arange(np.ceil((until - origin) / interval))
            index = sum(part.shape[1] for part in parts)
            if index and next_time is not None:
                durations.append((index, float(origin - next_time)))
            start = origin if start is None else start
            parts.append(interpolate(self._samples[:, first:last], times, wanted))
            next_time = float(origin + interval * wanted.size)
        self._next_time = next_time
        return self._recording(np.concatenate(parts, axis=1), float(start or 0.0), durations)

    def _recording(self, samples: Real, start: float, gaps: list[tuple[int, float]]) -> Recording:
        """Return the recording that begins `start` seconds after the origin."""
        history = list(self._facts.history)
        if self._n_cut:
            history.append(f"{self._n_cut} rows cut in which a channel has no value")
        if self._bridged:
            history.append(said(len(self._bridged), sum(self._bridged.values())))
        origin = self._origin()
        least = 0.25 * self._clock.interval
        self._n_cut = 0
        return Recording(
            samples,
            self._clock.sampling_rate,
            self._channels,
            start=None if origin is None else origin + round(start * 1e9),
            gaps=tuple(Gap(int(index), float(length)) for index, length in gaps if length > least),
            history=tuple(history),
            comment=self._table.comment,
        )

    def _origin(self) -> int | None:
        """Return the UTC time [ns] of the first row, or of the origin of its stamps."""
        scale, stated = self._facts.scale, self._table.start
        if scale is None or scale.start is not None or stated is None:
            return stated if scale is None else scale.start
        offset = scale.origin * scale.factor
        return stated + round(1e9 * offset) if math.isfinite(offset) else stated

    def _forget(self, gaps: Indices, end: int) -> None:
        """Drop the rows before `end`, except those that splines beyond it need."""
        last_gap = max((int(gap) for gap in gaps if gap <= end), default=0)
        first = max(last_gap, end - _MARGIN) if self._clock.is_resampled else end
        self._seconds = self._seconds[first:]
        self._samples = self._samples[:, first:]
        self._n_done = end - first


def _quiet_end(gaps: Indices, n_rows: int) -> int:
    """Return a row before the last ones without a gap at it and, if possible, without one near it."""
    latest = n_rows - _MARGIN
    end = latest
    for gap in gaps[::-1]:
        if gap <= end - _MARGIN:
            return end
        end = min(end, int(gap) - _MARGIN)
    if end > _MARGIN:
        return end
    calm = np.setdiff1d(np.arange(max(0, latest - _REACH), latest + 1), gaps)
    return int(calm.max(initial=0))
