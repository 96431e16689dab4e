"""The columns of a file: which groups and channels are wanted, and which column is the time.

Groups that share a clock stand side by side; channels of others are interpolated at the times of the first. A column is
taken as time by its name and its behaviour together. Behaviour alone is not enough: a ramp without noise rises as a
clock does. Only the first column of a table without names may be the time by its behaviour.
"""

import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Booleans, Real
from sprung.channel_names import describe_mapping, identified, read_name_table
from sprung.errors import DataError, FormatError, ParameterError, SprungError
from sprung.formats.clock import interpolated, time_scale, unwrapped
from sprung.formats.settings import CLOCK_FACES, TIME_UNITS, ReadSettings
from sprung.formats.table import (
    Block,
    Column,
    Group,
    Opener,
    Table,
    index_of,
    is_time,
    join,
    rebatch,
    spellings,
    split_heading,
)
from sprung.recording import Channel


@dataclass(frozen=True, slots=True)
class _Limits:
    """Limits by which columns are judged."""

    head_rows: int = 4096  # first rows by which the behaviour of a column is judged
    min_steps: int = 20  # fewer steps show neither a unit of time nor a clock without a name
    even: float = 0.1  # an even step differs from the usual one by at most this part of it
    min_even_share: float = 0.95  # share of even steps of a clock
    min_new_share: float = 0.05  # share of rows with a new stamp, of stamps in bursts
    line: float = 0.1  # deviation of stamps in bursts from a straight line, as part of their span
    long_step: float = 2.0  # a column without a unit hardly counts seconds with larger steps
    min_rate: float = 5.0  # sampling rates [Hz] that another unit may give
    max_rate: float = 20e3
    same_rate: float = 0.05  # difference from the stated rate up to which a column is the time
    day: float = 24e4  # a day as HHMMSS
    hour: float = 1e4  # an hour: smaller numbers are times of day only where their digits are carried
    block_rows: int = 1 << 16  # rows that are joined at a time


_LIMITS = _Limits()
#: Words for time and its units, as parts of names.
_UNIT_WORDS = {
    **dict.fromkeys(("s", "sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("ms", "msec", "msecs", "millis", "millisecond", "milliseconds"), "ms"),
    **dict.fromkeys(("us", "µs", "usec", "micros", "microsecond", "microseconds"), "us"),
    **dict.fromkeys(("ns", "nsec", "nanos", "nanosecond", "nanoseconds"), "ns"),
    **dict.fromkeys(("min", "minutes"), "min"),
}
_TIME_WORDS = {"time", "timestamp", "timestamps", "elapsed", "clock", "zeit", "uhrzeit", "zeitstempel", "epoch", "utc"}
_TIME_WORDS |= {word for word in _UNIT_WORDS if len(word) > 4}
_CLOCK_WORDS = {"clock", "uhrzeit", "utc", "gmt", "gps", "hhmmss", *map(str.lower, CLOCK_FACES)}
_COUNTER_WORDS = {"counter", "count", "packet", "index", "idx", "sample", "samples", "row", "line", "frame", "number"}
_COUNTER_WORDS |= {"no", "nr", "num", "id", "seq", "sequence", "scan", "unnamed", "#"}
_FLAG_WORDS = {"status", "flag", "flags", "valid", "error", "errors", "state", "mode", "quality", "ok", "sync", "id"}
#: First column of a table without names, or without one for the first column.
_FIRST = re.compile(r"(column|channel|unnamed)_1")
_UNNAMED = "unnamed_1"
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-zµäöü]+|#")


def wanted_table(path: Path, groups: Sequence[Group], settings: ReadSettings) -> Table:
    """Return the table of the wanted groups, channels and rows of a file, with its time column.

    Raises
    ------
    FormatError
        If the unit of the time column cannot be found out.
    ParameterError
        If a group, a channel or the time column is not in the file, the groups have several clocks, or the wanted part
        begins after the end of the file; or if there is neither a time column nor a sampling rate, but a column that
        rises as a clock does.
    """
    wanted = [_group(path, groups, name) for name in settings.groups] or list(groups)
    if settings.channels is not None and len(wanted) > 1:
        spelled = [(heading, *spellings(heading)) for group in wanted for heading in group.headings]
        for name in settings.channels:
            index_of(name, spelled, path=path)
        wanted = [group for group in wanted if any(map(group.has, settings.channels))]
    openers = [wanted[0].open] if len(wanted) == 1 else [partial(_distinct, wanted, group) for group in wanted]
    if len({group.clock for group in wanted}) == 1:
        table = _timed(partial(_side_by_side, openers), settings)
    elif settings.groups:
        table = interpolated([_timed(opener, settings) for opener in openers])
    else:
        listed = "; ".join(f"{group.name!r} ({', '.join(group.headings)})" for group in wanted)
        raise ParameterError(
            f"{path} holds {len(wanted)} groups of channels with different clocks: choose with --group (in Python: "
            f"groups=[...]), several to interpolate at the times of the first: {listed}"
        )
    return _part(_named(table, settings), settings)


def _group(path: Path, groups: Sequence[Group], name: str) -> Group:
    """Return the group called `name`."""
    for group in groups:
        if group.name == name:
            return group
    raise ParameterError(f"{path} has no group {name!r}: choose from {', '.join(repr(group.name) for group in groups)}")


def _distinct(groups: Sequence[Group], group: Group, channels: Sequence[str] | None) -> Table:
    """Return the table of a group; names that an earlier group has as well begin with the name of the group."""
    table = group.open(None if channels is None else list(filter(group.has, channels)))
    taken = {heading for earlier in groups[: groups.index(group)] for heading in earlier.headings}
    columns = (
        replace(column, name=f"{group.name}_{column.name}") if column.heading in taken else column
        for column in table.columns
    )
    return replace(table, columns=tuple(columns))


def _side_by_side(openers: Sequence[Opener], channels: Sequence[str] | None) -> Table:
    """Return the tables of groups with the same rows as one."""
    tables = [opener(channels) for opener in openers]
    if len(tables) == 1:
        return tables[0]

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        parts = (rebatch(table.blocks(first, last), _LIMITS.block_rows) for table in tables)
        for same in zip(*parts, strict=True):
            yield replace(same[0], values=np.concatenate([block.values for block in same]))

    return replace(tables[0], columns=tuple(column for table in tables for column in table.columns), blocks=blocks)


def _timed(opener: Opener, settings: ReadSettings) -> Table:
    """Return the wanted channels with their time column, without counters, flags and clocks unless they are wanted."""
    table = opener(settings.channels)
    if settings.time is not None:
        table = _with_time(table, opener, settings, settings.time, "as stated")
    elif table.time_heading is None:
        table = _with_found_time(table, opener, settings)
    else:
        table = _with_steadier_time(table, opener, settings)
    if settings.channels is None:
        table = _of_motion(table)
    return _with_unit(table, settings)


def stated_unit(heading: str) -> str | None:
    """Return the unit of time, a key of `TIME_UNITS`, that a heading states in brackets or its name; None without."""
    name, unit, _ = split_heading(heading)
    if unit in TIME_UNITS:
        return unit
    words = _words(name)
    long = [_UNIT_WORDS[word] for word in words if word in _UNIT_WORDS and len(word) > 4]
    last = [_UNIT_WORDS[word] for word in words[-1:] if word in _UNIT_WORDS and len(words) > 1]
    return next(iter(long + last), None)


def _words(name: str) -> list[str]:
    """Return the words of a name such as "SampleTimeFine" or "time_ms" in lower case."""
    return [word.lower() for word in _WORD.findall(name)]


def names_time(heading: str) -> bool:
    """Return whether a heading is that of a clock, such as "SampleTimeFine", "t_us" or "elapsed [ms]"."""
    name, unit, _ = split_heading(heading)
    words = _words(name)
    if unit in TIME_UNITS or not _TIME_WORDS.isdisjoint(words) or any(word.endswith("time") for word in words):
        return True
    return words[:1] == ["t"] and all(word in _UNIT_WORDS for word in words[1:])


def _steps(values: Real) -> Real:
    """Return the steps of a column; none where a value is missing, or it does not rise from the first to the last."""
    if values.size < 2 or not np.isfinite(values).all():
        return np.zeros(0)
    stamps = next(unwrapped([Block(1, values, np.zeros((0, values.size)))])).stamps
    return np.diff(stamps) if stamps is not None and stamps[-1] > stamps[0] else np.zeros(0)


def _is_even(values: Real) -> bool:
    """Return whether a column rises in even steps."""
    steps = _steps(values)
    if steps.size < _LIMITS.min_steps or not np.all(steps > 0):
        return False
    usual = np.median(steps)
    return bool(np.mean(np.abs(steps - usual) <= _LIMITS.even * usual) >= _LIMITS.min_even_share)


def _is_in_bursts(values: Real) -> bool:
    """Return whether a column rises along a straight line, several rows at a time."""
    steps = _steps(values)
    if steps.size < _LIMITS.min_steps or np.any(steps < 0) or not np.any(steps == 0):
        return False
    rows = np.arange(values.size)
    away = values - np.polynomial.Polynomial.fit(rows, values, 1)(rows)
    return bool(np.mean(steps > 0) >= _LIMITS.min_new_share and np.ptp(away) <= 2 * _LIMITS.line * np.ptp(values))


def _role(column: Column, values: Real) -> str:
    """Return what a column is that measures no motion; empty for one that may."""
    if column.quantity == "unknown":
        words, steps = _words(column.name), _steps(values)
        if names_time(column.heading) and steps.size and np.all(steps >= 0):
            return "a clock"
        present = values[np.isfinite(values)]
        is_whole = present.size and np.all(present == np.round(present))
        counts = steps.size > 1 and np.mean(steps >= 0) > 0.99
        counts = counts and np.mean(steps <= 2 * max(1.0, float(np.median(steps)))) > 0.9
        if is_whole and counts and not _COUNTER_WORDS.isdisjoint(words):
            return "a counter"
        if is_whole and np.all(present == present[0]) and not _FLAG_WORDS.isdisjoint(words):
            return "a constant flag"
    return "without a name" if column.name == _UNNAMED else ""


def _head(table: Table) -> Block:
    """Return the first rows of the channels."""
    empty = Block(0, None, np.zeros((len(table.columns), 0)))
    return join([*table.blocks(0, _LIMITS.head_rows)] or [empty])


def _with_found_time(table: Table, opener: Opener, settings: ReadSettings) -> Table:
    """Return the table with the time column that names and behaviour show; without one as it is."""
    whole = table
    if settings.channels is not None:
        with suppress(SprungError):
            whole = opener(None)
    head = _head(whole).values
    columns = list(zip(whole.columns, head, strict=True))
    clocks = [column for column, values in columns if _role(column, values) == "a clock"]
    clocks.sort(key=lambda column: stated_unit(column.heading) is None)
    if clocks:
        return _with_time(table, opener, settings, clocks[0].heading, "by its name, and as it rises steadily")
    rate = settings.sampling_rate or table.sampling_rate
    if columns and _is_first(whole.columns[0], head[0], rate):
        why = "as the first column rises as a clock does"
        return _with_time(table, opener, settings, whole.columns[0].heading, why)
    even = [column for column, values in columns if _is_even(values) and _role(column, values) != "a counter"]
    if rate is None and even:
        raise ParameterError(
            f"{table.path} has no time column by name, but {even[0].name!r} rises evenly: if it is the time, name it "
            f"with --time {even[0].name} (in Python: time=...); otherwise state the sampling rate in Hz with "
            "--sampling-rate (in Python: sampling_rate=...)"
        )
    return table


def _with_steadier_time(table: Table, opener: Opener, settings: ReadSettings) -> Table:
    """Return the table with its time by name, or with that of another clock where only that one advances evenly."""
    whole, head = table, _head(table)
    if settings.channels is not None:
        with suppress(SprungError):
            every = opener(None)
            whole, head = every, _head(every)
    own = np.zeros(0) if head.stamps is None or not head.n_rows else time_scale(head.stamps).seconds(head.stamps)
    for column, values in zip(whole.columns, head.values, strict=True):
        if _role(column, values) != "a clock":
            continue
        if not _is_even(own) and _is_even(values):
            why = f"as {table.time_heading!r} does not advance evenly"
            return _with_time(table, opener, settings, column.heading, why)
        if is_time(column.heading) and _steps(own).size and not _agree(own, values):
            raise FormatError(
                f"{table.path} has the time columns {table.time_heading!r} and {column.heading!r}, which advance at "
                "different rates: keep one of them, or name it with --time"
            )
    note = f"time: column {table.time_heading!r}, by its name"
    return table if table.notes else replace(table, notes=(note,))


def _agree(clock: Real, other: Real) -> bool:
    """Return whether two clocks advance at one rate, in whichever units."""
    spans = (clock[-1] - clock[0], other[-1] - other[0])
    ratios = (one / two for one in TIME_UNITS.values() for two in TIME_UNITS.values())
    return any(abs(spans[1] * ratio / spans[0] - 1) < _LIMITS.same_rate for ratio in ratios)


def _is_first(column: Column, values: Real, rate: float | None) -> bool:
    """Return whether the first column of a table without names is the time."""
    steps = _steps(values)
    rises = bool(steps.size and np.all(steps >= 0))
    is_clock = _is_even(values) or _is_in_bursts(values) or (column.name == _UNNAMED and rises)
    if not is_clock or not _FIRST.fullmatch(column.name):
        return False
    if np.all(steps == 1) and values[0] == np.round(values[0]):
        return False
    mean = float(steps.mean())
    return rate is None or any(abs(mean * unit * rate - 1) < _LIMITS.same_rate for unit in TIME_UNITS.values())


def _with_time(table: Table, opener: Opener, settings: ReadSettings, name: str, why: str) -> Table:
    """Return the table with the column called `name` as its time."""
    if table.time_heading is not None and name in (table.time_heading, split_heading(table.time_heading)[0]):
        return table
    if settings.channels is not None and _place(table, name) is None:
        table = opener([*settings.channels, name])
    index = _place(table, name)
    if index is None:
        known = ", ".join(column.name for column in table.columns)
        raise ParameterError(f"{table.path} has no column {name!r} for the time: choose from {known}")
    column = table.columns[index]
    kept = [k for k in range(len(table.columns)) if k != index or name in (settings.channels or ())]
    notes = (*table.notes, f"time: column {column.name!r}, {why}")
    return replace(_taken(table, kept, time=index), time_heading=column.heading, notes=notes)


def _place(table: Table, name: str) -> int | None:
    """Return the index of the column called `name`; None without one."""
    return next((k for k, item in enumerate(table.columns) if name in (item.heading, item.name)), None)


def _taken(table: Table, kept: Sequence[int], *, time: int | None = None) -> Table:
    """Return some columns of a table, perhaps with another one as its time."""

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        for block in table.blocks(first, last):
            yield Block(block.first_row, block.stamps if time is None else block.values[time], block.values[kept])

    return replace(table, columns=tuple(table.columns[k] for k in kept), blocks=blocks)


def _of_motion(table: Table) -> Table:
    """Return the table without counters, flags and clocks, which are named in its notes."""
    roles = [_role(column, values) for column, values in zip(table.columns, _head(table).values, strict=True)]
    reasons = {column.name: role for column, role in zip(table.columns, roles, strict=True) if role}
    if not reasons:
        return table
    kept = [k for k, column in enumerate(table.columns) if column.name not in reasons]
    words = ", ".join(f"{name!r} ({reason})" for name, reason in reasons.items())
    if not kept:
        raise DataError(f"{table.path} holds no channel of motion: {words}")

    note = f"left out, as they do not measure motion: {words}; name them in --channels to keep them"
    return replace(_taken(table, kept), notes=(*table.notes, note))


def _with_unit(table: Table, settings: ReadSettings) -> Table:
    """Return the table with the unit of its time column, and counters that restart continued."""
    if table.time_heading is None:
        return table

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        return unwrapped(table.blocks(first, last))

    continued = replace(table, blocks=blocks)
    if settings.time_unit in CLOCK_FACES:
        return _with_time_of_day(table, settings.time_unit, "as stated")
    if settings.time_unit is not None:
        note = f"time: column {table.time_heading!r} in {settings.time_unit}, as stated"
        return replace(continued, time_factor=TIME_UNITS[settings.time_unit], notes=(*table.notes, note))
    first = next((each.stamps for each in table.blocks(0, 1) if each.stamps is not None), np.zeros(0))
    faces: tuple[str, ...] = ()
    if first.size and first.dtype.kind in "iuf" and 0 < first[0] < _LIMITS.day * max(CLOCK_FACES.values()):
        numbers = np.asarray(join([*table.blocks(0, _LIMITS.block_rows)]).stamps, dtype=np.float64)
        faces, is_carried = _clock_faces(numbers)
        if is_carried:
            return _with_time_of_day(table, faces[0], "as its digits are carried at full minutes")
    unit = stated_unit(table.time_heading)
    if unit is not None:
        return replace(continued, time_factor=TIME_UNITS[unit])
    return _with_likely_unit(continued, faces, settings.sampling_rate or table.sampling_rate)


def _with_time_of_day(table: Table, face: str, why: str) -> Table:
    """Return the table with its time, the digits of a time of day, as durations since midnight."""

    def decoded(stamps: NDArray[Any] | None) -> NDArray[Any] | None:
        if stamps is None or stamps.dtype.kind in "mM":
            return stamps
        with np.errstate(invalid="ignore"):
            times = np.round(1e9 * _time_of_day(stamps, CLOCK_FACES[face])).astype("m8[ns]")
        return np.where(np.isfinite(stamps), times, np.timedelta64("NaT", "ns"))

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        return unwrapped(replace(each, stamps=decoded(each.stamps)) for each in table.blocks(first, last))

    note = f"time: column {table.time_heading!r} as {face}, {why}"
    return replace(table, blocks=blocks, notes=(*table.notes, note))


def _time_of_day(numbers: NDArray[Any], ticks: int) -> Real:
    """Return the digits HHMMSS followed by those of `ticks` in a second as seconds since midnight."""
    minutes = numbers // (100 * ticks)
    seconds: Real = numbers / ticks - 40 * minutes - 2400 * (minutes // 100)
    return seconds


def _clock_faces(numbers: Real) -> tuple[tuple[str, ...], bool]:
    """Return the forms of a time of day that numbers may have, and whether their digits show that they have the first.

    Sixty seconds are carried to a minute: steps are even only where that is so. Within one minute and after one o'clock
    numbers may have a form, or count: in the last units of a second, the steps are those of a likely rate.
    """
    possible = []
    for face, ticks in CLOCK_FACES.items():
        minute = 100 * ticks
        is_face = (numbers >= 0) & (numbers < _LIMITS.day * ticks) & (numbers % (100 * minute) < 60 * minute)
        if not np.all(is_face & (numbers % minute < 60 * ticks)):
            continue
        steps = np.diff(_time_of_day(numbers, ticks))
        carried = np.diff(numbers) >= 40 * ticks
        usual = float(np.median(steps[steps > 0])) if np.any(steps > 0) else 0.0
        if carried.any() and usual <= _LIMITS.long_step and np.all(steps[carried] <= 2 * usual):
            return (face,), True
        is_whole = ticks > 1 and numbers[0] >= _LIMITS.hour * ticks and np.all(numbers == np.round(numbers))
        if is_whole and not carried.any() and _is_even(numbers):
            possible.append(face)
    return tuple(possible), False


def _with_likely_unit(table: Table, faces: Sequence[str], rate: float | None) -> Table:
    """Return the table with the unit of time, or form of a time of day, that gives a likely rate where seconds do not.

    A name such as UTC distinguishes a time of day from a counter, and so does a step that is too long for seconds
    in no other unit.
    """
    stamps = _head(table).stamps
    if stamps is None or stamps.dtype.kind in "mM" or not np.isfinite(stamps).all():
        return table
    numbers = stamps.astype(np.float64)
    steps = np.diff(numbers)
    if steps.size < _LIMITS.min_steps or np.any(steps < 0):
        return table
    step = float(np.median(steps)) or float(steps.mean())
    is_short = step * time_scale(stamps).factor <= _LIMITS.long_step
    if is_short and not faces:
        return table
    rates = {face: CLOCK_FACES[face] / step for face in faces}
    if not is_short:
        rates = {unit: 1 / (step * TIME_UNITS[unit]) for unit in ("s", "ms", "us", "ns")} | rates
        # thousandths of a second within a minute are milliseconds
        rates.pop("HHMMSSmmm", None)
    if rate is None:
        likely = {unit: value for unit, value in rates.items() if _LIMITS.min_rate <= value <= _LIMITS.max_rate}
    else:
        likely = {unit: value for unit, value in rates.items() if abs(value / rate - 1) < _LIMITS.same_rate}
    by_name = [
        face for face in faces if face in likely and not _CLOCK_WORDS.isdisjoint(_words(table.time_heading or ""))
    ]
    chosen = by_name[:1] or list(likely)
    whole: Booleans = numbers == np.round(numbers)
    as_seconds = f"as seconds would mean {1 / step:.3g} Hz"
    if chosen and chosen[0] in CLOCK_FACES and (by_name or is_short or len(chosen) == 1):
        return _with_time_of_day(table, chosen[0], f"{as_seconds}: state --time-unit if it counts")
    if len(likely) == 1 and (rate is not None or whole.all()):
        note = f"time: column {table.time_heading!r} in {chosen[0]}, {as_seconds}"
        return replace(table, time_factor=TIME_UNITS[chosen[0]], notes=(*table.notes, note))
    if rate is not None or is_short:
        return table
    others = "".join(
        f"; {value:.4g} Hz {'as' if unit in CLOCK_FACES else 'in'} {unit}" for unit, value in likely.items()
    )
    raise FormatError(
        f"{table.path}: time column {table.time_heading!r} advances by {step:g} from row to row: {1 / step:.3g} Hz in "
        f"seconds{others}: state its unit with --time-unit, or the rate with --sampling-rate"
    )


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
        notes.append(describe_mapping(channel, rule))
        quantity, factor = named.quantity, column.factor * factor
        columns.append(replace(column, quantity=quantity, factor=factor, direction=named.direction))
    return replace(table, columns=tuple(columns), notes=(*table.notes, *notes))


def _part(table: Table, settings: ReadSettings) -> Table:
    """Return the table with only the rows of the wanted part."""
    if settings.start is None and settings.end is None:
        return table
    begin, end, origin = _rows_of_part(table, settings)

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        return table.blocks(begin + first, end if last is None else min(end, begin + last))

    return replace(table, blocks=blocks, start=None if table.start is None else table.start + origin)


def stated_rate(table: Table, sampling_rate: float | None) -> float:
    """Return the sampling rate from the caller or the file [Hz]; NaN if only the time stamps give it."""
    stated = table.sampling_rate if sampling_rate is None else sampling_rate
    if stated is None and table.time_heading is None:
        raise ParameterError(
            f"{table.path} has no time column (time, t, t_s, time_s or timestamp): state its sampling rate in Hz "
            "with --sampling-rate (in Python: sampling_rate=...)"
        )
    return np.nan if stated is None else stated


def _rows_of_part(table: Table, settings: ReadSettings) -> tuple[int, int, int]:
    """Return the first row of the wanted part, the row after its last one, and its start without stamps [ns]."""
    start, end = settings.start or 0.0, np.inf if settings.end is None else settings.end
    if table.time_heading is None:
        rate = stated_rate(table, settings.sampling_rate)
        first = int(np.ceil(start * rate - 1e-9))
        return first, sys.maxsize if np.isinf(end) else int(np.ceil(end * rate - 1e-9)), round(1e9 * first / rate)
    scale, n_before, n_until = None, 0, 0
    for block in table.blocks():
        if block.stamps is None:
            break
        scale = scale or time_scale(block.stamps, table.time_factor)
        seconds = scale.seconds(block.stamps)
        n_before += int(np.count_nonzero(seconds < start))
        n_until += int(np.count_nonzero(seconds < end))
        if seconds[-1] >= end:
            break
    if n_until <= n_before:
        raise ParameterError(f"{table.path} holds no rows from {start:g} s on: state a part within the recording")
    return n_before, n_until, 0
