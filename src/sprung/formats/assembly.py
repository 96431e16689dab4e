"""From the rows of a table to recordings: missing values cut, gaps found, samples brought onto a uniform grid.

A table is read twice. The survey establishes the facts that concern all rows: which channels are alive and how time
advances. The second pass turns blocks of rows into recordings. Both need memory for one block only.
"""

import itertools
import math
import sys
from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from sprung._arrays import Indices, Real
from sprung.channel_names import identified, mapping_in_words, read_name_table
from sprung.errors import ParameterError
from sprung.formats.bridging import bridged, said
from sprung.formats.fillers import without_fillers
from sprung.formats.settings import ReadSettings
from sprung.formats.survey import Survey, stated_rate, survey, time_unit
from sprung.formats.table import Block, Table
from sprung.formats.time_columns import timed
from sprung.formats.timing import find_gaps, interpolate, time_scale, uncrowded
from sprung.recording import Channel, Gap, Recording

__all__ = ["assemble", "limited", "survey"]

# Rows around the end of a block that are used again with the next one, the reach of splines and medians.
_MARGIN = 64
# Samples on either side of a gap that give its duration.
_REACH = 1000


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
        rate = stated_rate(table, settings.sampling_rate)
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
        """Add the rows in which every live channel has a value."""
        values = without_fillers(block.values, self._facts.fillers)
        present = ~np.isnan(values)
        whole = present[self._facts.alive].all(axis=0)
        self._n_cut += int(present.any(axis=0).sum() - whole.sum())
        if self._facts.scale and block.stamps is not None and not self._facts.is_overruled:
            seconds = self._facts.scale.seconds(block.stamps[whole])
        else:
            rows = self._n_rows + np.flatnonzero(whole)
            seconds = rows.astype(np.float64) * self._clock.interval
        self._n_rows += block.n_rows
        self._seconds = np.concatenate([self._seconds, seconds])
        self._samples = np.concatenate([self._samples, values[:, whole] * self._factors], axis=1)

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
            history.append(f"{self._n_cut} rows removed in which a channel has no value")
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
