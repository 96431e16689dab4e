"""From the rows of a table to recordings: missing values cut, gaps kept or bridged, samples on a uniform grid.

A table is read twice. The survey establishes the facts that concern all rows: which channels are alive, which numbers
are fillers and how time advances. The second pass turns blocks of rows into recordings. Both need memory for one block
only.
"""

import copy
import itertools
import math
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Booleans, Indices, Real
from sprung._display import counted
from sprung.errors import DataError, FormatError, MixedRatesError, ParameterError
from sprung.formats.clock import Clock, ClockFit, TimeScale, find_gaps, interpolate, time_scale, uncrowded
from sprung.formats.columns import stated_rate
from sprung.formats.table import Block, Column, Doubles, FillerCount, Table, without_fillers
from sprung.recording import PLACES, Channel, Gap, Recording


@dataclass(frozen=True, slots=True)
class _Limits:
    """Limits by which rows are judged."""

    max_value: float = 1e100  # larger numbers are not measured, and their squares might overflow
    same_rate: float = 0.01  # difference up to which a stated rate and that of the time column agree
    slow: float = 0.5  # rate [Hz] below which a clock is doubted
    min_rows: int = 20  # fewer rows may well be slow
    alive_share: float = 0.5  # a channel with values in fewer rows is dead
    longest_line: float = 10.0  # between two fixes of a receiver [s]; through longer times the last one is held
    margin: int = 64  # rows around the end of a block that are used again: the reach of splines and medians
    reach: int = 1000  # samples on either side of a gap that give its duration
    min_gap: float = 0.25  # a shorter gap [intervals] is none
    bridge_reach: int = 16  # samples on either side from which those in a gap are interpolated
    min_bridge: int = 4  # fewer samples do not carry a bridge
    bridge_fraction: float = 0.25  # difference of a bridged gap from whole sample intervals


_LIMITS = _Limits()
#: What the history says of a value that is infinite or too large, after its place.
UNMEASURED = "cannot be measured: taken as missing"


@dataclass(frozen=True, eq=False, slots=True)
class Survey:
    """Facts about all rows: live channels, scale and advance of time, and the first lines of the history.

    `is_overruled` says that the stated sampling rate takes the place of an inconsistent clock; `fillers` are
    the numbers of each channel that stand for missing values; `has_doubles` says that rows which repeat the stamp and
    all values of the row before are left out.
    """

    alive: Booleans
    scale: TimeScale | None
    clock: Clock
    history: tuple[str, ...]
    is_overruled: bool = False
    fillers: tuple[tuple[float, ...], ...] = ()
    has_doubles: bool = False


def survey(table: Table, blocks: Iterable[Block], *, sampling_rate: float | None) -> Survey:
    """Return the facts about all rows of a table; `sampling_rate` as stated by the caller [Hz], None: of the file.

    Raises
    ------
    FormatError
        If time is missing, repeated or runs backwards; the message names the row.
    DataError
        If no channel holds values, there is only one sample, or rates are mixed.
    ParameterError
        If the sampling rate is missing, or contradicts the time column by more than 1 %.
    """
    stated = stated_rate(table, sampling_rate)
    n_rows = 0
    counts = np.zeros(len(table.columns), dtype=int)
    scale = None
    doubts: list[str] = []
    fit = ClockFit(f"{table.path}, {table.row_word}")
    doubles, distinct, n_doubles = Doubles(), None, 0
    count = FillerCount(len(table.columns))
    unmeasured: dict[str, tuple[str, int]] = {}
    for block in blocks:
        _note_unmeasured(unmeasured, table, block)
        values = _measured(block.values)
        count.update(values)
        has_value = _values_present(table, values)
        rows = has_value.any(axis=0)
        n_rows += int(rows.sum())
        counts += has_value.sum(axis=1)
        if block.stamps is None or not rows.any() or doubts:
            continue
        stamps = block.stamps[rows]
        scale = scale or time_scale(stamps, table.time_factor)
        seconds = scale.seconds(stamps)
        numbers = block.first_row + np.flatnonzero(rows)
        with _doubted(doubts, sampling_rate):
            if not np.isfinite(seconds).all():
                raise FormatError(
                    f"{table.path}, {table.row_word} {numbers[np.argmin(np.isfinite(seconds))]}: column "
                    f"{table.time_heading!r} holds no time: fill it in or remove the row"
                )
            is_double = doubles.update(block)[rows]
            n_doubles += int(is_double.sum())
            distinct = copy.deepcopy(fit) if distinct is None and n_doubles else distinct
            fit.update(seconds, numbers, rounding=scale.rounding(stamps))
            if distinct is not None:
                distinct.update(seconds[~is_double], numbers[~is_double], rounding=scale.rounding(stamps))
    fillers = [count.fillers(channel) for channel in range(len(table.columns))]
    counts -= np.array([sum(numbers.values()) for numbers in fillers], dtype=int)
    alive = _alive(table, counts, n_rows)
    clock = Clock(stated, 1 / stated)
    has_doubles = distinct is not None and not fit.is_coarse and distinct.rms < fit.rms
    if scale and not doubts:
        with _doubted(doubts, sampling_rate):
            clock = distinct.clock() if distinct is not None and has_doubles else fit.clock()
            if sampling_rate is not None:
                _check_agreement(table, clock, sampling_rate)
    if doubts:
        clock = Clock(stated, 1 / stated)
    elif table.time_heading is not None and abs(stated / clock.sampling_rate - 1) > _LIMITS.same_rate:
        raise ParameterError(
            f"{table.path}: sampling_rate={stated:g} contradicts the time column {table.time_heading!r}, which "
            f"advances at {clock.sampling_rate:.6g} Hz: leave --sampling-rate out or correct the column"
        )
    of_clock = _history_of_clock(clock, scale, doubts, n_rows)
    infinite = (
        f"{name}: {first}{f', the first of {n} values,' if n > 1 else ''} {UNMEASURED}"
        for name, (first, n) in unmeasured.items()
    )
    left_out = f"{counted(n_doubles, 'row')} left out that repeat{'s' * (n_doubles == 1)} the row before, its time too"
    history = (*_history(table, of_clock, counts, n_rows, fillers), *infinite, *[left_out] * has_doubles)
    return Survey(alive, scale, clock, history, bool(doubts), tuple(map(tuple, fillers)), has_doubles and not doubts)


@contextmanager
def _doubted(doubts: list[str], sampling_rate: float | None) -> Iterator[None]:
    """Collect what contradicts a clock, where a stated sampling rate takes its place."""
    try:
        yield
    except (DataError, FormatError) as error:
        if sampling_rate is None:
            raise
        doubts.append(str(error).rsplit(": ", 1)[0])


def _check_agreement(table: Table, clock: Clock, stated: float) -> None:
    """Raise if a clock that the stated rate contradicts is doubtful itself."""
    if abs(stated / clock.sampling_rate - 1) <= _LIMITS.same_rate:
        return
    if clock.is_coarse or clock.sampling_rate < _LIMITS.slow:
        why = "but several rows share a stamp" if clock.is_coarse else "which is hardly that of a measurement of motion"
        raise DataError(
            f"{table.path}: {table.time_heading!r} advances at {clock.sampling_rate:.4g} Hz, {why}: state its rate"
        )


def _measured(values: Real) -> Real:
    """Return values with NaN for infinite ones and those whose squares might overflow."""
    excessive = np.abs(values, dtype=np.float64) > _LIMITS.max_value
    return np.where(excessive, np.nan, values) if excessive.any() else values


def _note_unmeasured(found: dict[str, tuple[str, int]], table: Table, block: Block) -> None:
    """Add to what `found` holds of each channel: its first value that is not measured with its place, their number."""
    excessive = np.abs(block.values, dtype=np.float64) > _LIMITS.max_value
    for channel in np.flatnonzero(excessive.any(axis=1)):
        name, row = table.columns[channel].name, int(np.argmax(excessive[channel]))
        first, n = found.get(name, (f"{block.values[channel, row]:g} in {table.row_word} {block.first_row + row}", 0))
        found[name] = (first, n + int(excessive[channel].sum()))


def _values_present(table: Table, values: Real) -> Booleans:
    """Return which values are present, shape (channels, rows); raise on other rates in rows that hold any value."""
    present = ~np.isnan(values)
    shared = present[:, present.any(axis=0)]
    places = _places(table.columns)
    for number, (column, has_value) in enumerate(zip(table.columns, shared, strict=True)):
        rows = np.flatnonzero(has_value)
        if number not in places and 10 <= rows.size < 0.6 * shared.shape[1] and np.median(np.diff(rows)) >= 2:
            reason = f"a value in one of {np.median(np.diff(rows)):.0f} rows only"
            raise MixedRatesError(
                f"{table.path}: channel {column.name!r} has {reason} (another rate): keep the channels of one rate "
                "with --channels, or write it to a file of its own",
                tuple(other.name for other in table.columns if other is not column),
                ((column.name, reason),),
            )
    return present


def _places(columns: Sequence[Column]) -> list[int]:
    """Return the rows of latitude and longitude, if both are there: their receiver is slow and may lose satellites."""
    found = [
        [
            row
            for row, each in enumerate(columns)
            if each.name.lower() in names and each.quantity in {"unknown", "angle"}
        ]
        for names in PLACES
    ]
    return list(itertools.chain(*found)) if all(found) else []


def _followed(fixes: Real, longest: float) -> Real:
    """Return places between fixes: on straight lines, or through more than `longest` rows at the last one."""
    known, rows = np.flatnonzero(np.isfinite(fixes)), np.arange(fixes.size)
    if not known.size:
        return fixes
    last = np.maximum(np.searchsorted(known, rows, side="right") - 1, 0)
    is_near = np.diff(known, append=known[-1])[last] <= longest
    return np.where(is_near, np.interp(rows, known, fixes[known]), fixes[known[last]])


def _alive(table: Table, counts: Indices, n_rows: int) -> Booleans:
    """Return which channels have values in at least half of the rows."""
    if not table.columns:
        raise DataError(f"{table.path} holds times alone: give the file with the samples, or both in one table")
    alive = counts >= max(1.0, _LIMITS.alive_share * n_rows)
    if n_rows == 0 or not alive.any():
        raise DataError(
            f"{table.path} holds no samples: every channel is empty or has values in less than half the rows"
        )
    if n_rows == 1:
        raise DataError(f"{table.path} holds one sample: a recording needs at least two")
    return alive


def _history(
    table: Table, of_clock: Iterable[str], counts: Indices, n_rows: int, fillers: Sequence[dict[float, int]]
) -> Iterator[str]:
    """Yield the history of reading, line by line."""
    yield f"read {table.path.name}: {counted(len(table.columns), 'channel')}, {n_rows} rows"
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
        if count < _LIMITS.alive_share * n_rows:
            yield f"{column.name}: dead, values in {count} of {n_rows} rows"
    for column, numbers in zip(table.columns, fillers, strict=True):
        for number, count in numbers.items():
            yield f"{column.name}: {number:g} in {count} rows is a filler, far from all other values: taken as missing"


def _history_of_clock(clock: Clock, scale: TimeScale | None, doubts: Sequence[str], n_rows: int) -> Iterator[str]:
    """Yield what the history says of the clock."""
    if doubts:
        yield f"{clock.sampling_rate:g} Hz as stated, in place of an inconsistent clock ({doubts[0]})"
    else:
        yield clock.describe() if scale else f"no time column: {clock.sampling_rate:g} Hz as stated"
    if scale and n_rows >= _LIMITS.min_rows and clock.sampling_rate < _LIMITS.slow:
        yield f"is {clock.sampling_rate:.3g} Hz right? if not, state the sampling rate or the unit of the time column"


def assemble(table: Table, blocks: Iterable[Block], facts: Survey, *, bridge: float = 0.0) -> Iterator[Recording]:
    """Yield recordings of consecutive blocks: each begins where the one before ends; gaps lie inside recordings.

    Samples are interpolated across gaps up to `bridge` [s].
    """
    assembler = _Assembler(table, facts, bridge)
    for block, following in itertools.pairwise(itertools.chain(blocks, [None])):
        if block is not None:
            recording = assembler.update(block, is_last=following is None)
            if recording is not None:
                yield recording


class _Assembler:
    """Turns blocks of rows into recordings; holds back the last rows of each block until the next one."""

    def __init__(self, table: Table, facts: Survey, bridge: float) -> None:
        self._table = table
        self._bridge = bridge
        self._facts = facts
        self._clock = facts.clock
        self._channels = tuple(
            Channel(each.name, each.quantity, None, each.direction, each.comment, each.calibration)
            for each in table.columns
        )
        self._doubles = Doubles()
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
        return _bridge_gaps(recording, self._bridge) if self._bridge else recording

    def _gaps(self) -> Indices:
        """Return the rows before which time is missing; without short ones where splines pass over them."""
        gaps = find_gaps(self._seconds, self._clock)
        if not self._clock.is_resampled or not self._bridge:
            return gaps
        missing = self._seconds[gaps] - self._seconds[gaps - 1] - self._clock.interval
        is_short = missing <= self._bridge
        self._bridged |= {
            float(self._seconds[gap]): float(length)
            for gap, length in zip(gaps[is_short], missing[is_short], strict=True)
        }
        return gaps[~is_short]

    def _append(self, block: Block) -> None:
        """Add the rows in which every live channel has a value."""
        values = without_fillers(_measured(block.values), self._facts.fillers)
        if places := _places(self._table.columns):
            values, longest = values.copy(), _LIMITS.longest_line * self._clock.sampling_rate
            values[places] = [_followed(values[row], longest) for row in places]
        present = ~np.isnan(values)
        whole = present[self._facts.alive].all(axis=0)
        self._n_cut += int(present.any(axis=0).sum() - whole.sum())
        if self._facts.has_doubles:
            whole &= ~self._doubles.update(block)
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
            before = np.median(offsets[max(first, here - _LIMITS.reach) : here])
            after = np.median(offsets[here : min(last, here + _LIMITS.reach)])
            durations.append((here, after - before))
        start = np.median(offsets[: min(edges[1], _LIMITS.reach)])
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
            history.append(f"{counted(self._n_cut, 'row')} removed in which a channel has no value")
        if self._bridged:
            history.append(_said(len(self._bridged), sum(self._bridged.values())))
        origin = self._origin()
        min_gap = _LIMITS.min_gap * self._clock.interval
        self._n_cut = 0
        return Recording(
            samples,
            self._clock.sampling_rate,
            self._channels,
            start=None if origin is None else origin + round(start * 1e9),
            gaps=tuple(Gap(int(index), float(length)) for index, length in gaps if length > min_gap),
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
        first = max(last_gap, end - _LIMITS.margin) if self._clock.is_resampled else end
        self._seconds = self._seconds[first:]
        self._samples = self._samples[:, first:]
        self._n_done = end - first


def _quiet_end(gaps: Indices, n_rows: int) -> int:
    """Return a row before the last ones without a gap at it and, if possible, without one near it."""
    latest = n_rows - _LIMITS.margin
    end = latest
    for gap in gaps[::-1]:
        if gap <= end - _LIMITS.margin:
            return end
        end = min(end, int(gap) - _LIMITS.margin)
    if end > _LIMITS.margin:
        return end
    calm = np.setdiff1d(np.arange(max(0, latest - _LIMITS.reach), latest + 1), gaps)
    return int(calm.max(initial=0))


def _bridge_gaps(recording: Recording, longest: float) -> Recording:
    """Return the recording with gaps up to `longest` [s] filled by cubic splines through the samples on either side.

    A gap stays if it is not a whole number of sample intervals long, or fewer than four samples lie between it and the
    next one or an end of the recording: nothing is extrapolated.
    """
    edges = [0, *(gap.index for gap in recording.gaps), recording.n_samples]
    parts: list[Real] = [recording.samples[:, : edges[1]]]
    kept: list[Gap] = []
    filled: list[float] = []
    added = 0
    for gap, first, last in zip(recording.gaps, edges, edges[2:], strict=False):
        n_before = gap.index - first
        n_after = last - gap.index
        wanted = gap.duration * recording.sampling_rate
        n_missing = round(wanted)
        is_whole = n_missing and abs(wanted - n_missing) < _LIMITS.bridge_fraction
        if is_whole and gap.duration <= longest and min(n_before, n_after) >= _LIMITS.min_bridge:
            before = np.arange(-min(_LIMITS.bridge_reach, n_before), 0)
            after = np.arange(min(_LIMITS.bridge_reach, n_after))
            samples = recording.samples[:, gap.index + before[0] : gap.index + after.size]
            times = np.concatenate([before, n_missing + after]).astype(np.float64)
            parts.append(interpolate(samples, times, np.arange(n_missing, dtype=np.float64)))
            filled.append(gap.duration)
            added += n_missing
        else:
            kept.append(replace(gap, index=gap.index + added))
        parts.append(recording.samples[:, gap.index : last])
    if not filled:
        return recording
    step = _said(len(filled), sum(filled))
    return recording.changed(step, samples=np.concatenate(parts, axis=1), gaps=tuple(kept))


def _said(count: int, duration: float) -> str:
    """Return the line of the history on bridged gaps, their number and total length [s]."""
    return f"{count} gap{'s' * (count > 1)} of {duration:.4g} s in all bridged by cubic interpolation"
