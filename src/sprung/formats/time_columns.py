"""Columns that show the advance of the rows and not motion: the time, further clocks, counters and flags.

A column is taken as time by its name and its behaviour together. Behaviour alone is not enough: a ramp without noise
rises as a clock does. Only the first column of a table without names may be the time by its behaviour.
"""

import re
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import replace

import numpy as np

from sprung._arrays import Booleans, Real
from sprung.errors import DataError, FormatError, ParameterError, SprungError
from sprung.formats.settings import TIME_UNITS, ReadSettings
from sprung.formats.table import Block, Column, Table, join, split_heading
from sprung.formats.timing import time_scale
from sprung.formats.wraps import unwrapped

#: First rows by which the behaviour of a column is judged.
_HEAD_ROWS = 4096
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
_COUNTER_WORDS = {"counter", "count", "packet", "index", "idx", "sample", "samples", "row", "line", "frame", "number"}
_COUNTER_WORDS |= {"no", "nr", "num", "id", "seq", "sequence", "scan", "unnamed", "#"}
_FLAG_WORDS = {"status", "flag", "flags", "valid", "error", "errors", "state", "mode", "quality", "ok", "sync", "id"}
#: First column of a table without names, or without one for the first column.
_FIRST, _UNNAMED = re.compile(r"(column|channel|unnamed)_1"), "unnamed_1"
_WORD = re.compile(r"[A-Z]+(?![a-z])|[A-Z]?[a-zµäöü]+|#")
#: Fewest steps that show a unit of time or a clock without a name, and share of the steps that must be alike, within
#: this part of the usual one.
_FEWEST_STEPS, _EVEN_SHARE, _EVEN = 20, 0.95, 0.1
#: Of stamps in bursts: least share of rows with a new one, largest deviation from a straight line, as part of the span.
_FEWEST_NEW, _LINE = 0.05, 0.1
#: Step above which a column without a unit hardly counts seconds, and sampling rates [Hz] that another unit may give.
_LONG_STEP, _RATES = 2.0, (5.0, 20e3)
#: Relative difference of a stated rate and one of a column that shows that the column is the time.
_SAME_RATE = 0.05


def timed(table: Table, settings: ReadSettings) -> Table:
    """Return a table with its time column, and without counters, flags and further clocks.

    Parameters
    ----------
    table
        Opened file; its time column, if it has one, was found by its name.
    settings
        Name and unit of the time column, sampling rate and channels, where stated; a channel that is named stays.

    Raises
    ------
    FormatError
        If the unit of the time column cannot be found out.
    ParameterError
        If there is no column of the stated name; or neither a time column nor a sampling rate, but a column that rises
        as a clock does.
    """
    if settings.time is not None:
        table = _with_time(table, settings.time, "as stated", settings)
    elif table.time_heading is None:
        table = _with_found_time(table, settings)
    elif not table.notes:
        table = replace(table, notes=(f"time: column {table.time_heading!r}, by its name",))
    if settings.channels is None:
        table = _of_motion(table)
    return _with_unit(table, settings)


def stated_unit(heading: str) -> str | None:
    """Return the unit of time, a key of `TIME_UNITS`, that a heading states in brackets or in its name; None without.

    Parameters
    ----------
    heading
        Heading such as "Timestamp (ns)", "time_ms" or "seconds_elapsed".
    """
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
    """Return whether a heading is that of a clock, such as "SampleTimeFine", "t_us" or "elapsed [ms]".

    Parameters
    ----------
    heading
        Heading as in the file.
    """
    name, unit, _ = split_heading(heading)
    words = _words(name)
    if unit in TIME_UNITS or not _TIME_WORDS.isdisjoint(words) or any(word.endswith("time") for word in words):
        return True
    return words[:1] == ["t"] and all(word in _UNIT_WORDS for word in words[1:])


def _is_clock(column: Column, values: Real) -> bool:
    """Return whether a column rises and has the name of a clock."""
    return column.quantity == "unknown" and names_time(column.heading) and _rises(values)


def _steps(values: Real) -> Real:
    """Return the steps of a column; none where a value is missing, or it does not rise from the first to the last."""
    if values.size < 2 or not np.isfinite(values).all():
        return np.zeros(0)
    stamps = next(unwrapped([Block(1, values, np.zeros((0, values.size)))])).stamps
    return np.diff(stamps) if stamps is not None and stamps[-1] > stamps[0] else np.zeros(0)


def _rises(values: Real) -> bool:
    """Return whether a column rises and never falls."""
    steps = _steps(values)
    return bool(steps.size and np.all(steps >= 0))


def _is_even(values: Real) -> bool:
    """Return whether a column rises in even steps."""
    steps = _steps(values)
    if steps.size < _FEWEST_STEPS or not np.all(steps > 0):
        return False
    usual = np.median(steps)
    return bool(np.mean(np.abs(steps - usual) <= _EVEN * usual) >= _EVEN_SHARE)


def _is_in_bursts(values: Real) -> bool:
    """Return whether a column rises along a straight line, several rows at a time."""
    steps = _steps(values)
    if steps.size < _FEWEST_STEPS or np.any(steps < 0) or not np.any(steps == 0):
        return False
    rows = np.arange(values.size)
    away = values - np.polynomial.Polynomial.fit(rows, values, 1)(rows)
    return bool(np.mean(steps > 0) >= _FEWEST_NEW and np.ptp(away) <= 2 * _LINE * np.ptp(values))


def _is_counter(column: Column, values: Real) -> bool:
    """Return whether a column counts rows or packets."""
    if column.quantity != "unknown" or _COUNTER_WORDS.isdisjoint(_words(column.name)):
        return False
    steps = _steps(values)
    is_whole = steps.size > 1 and bool(np.all(values == np.round(values)))
    return is_whole and bool(np.mean(steps >= 0) > 0.99 and np.mean(steps <= 2 * max(1.0, np.median(steps))) > 0.9)


def _is_flag(column: Column, values: Real) -> bool:
    """Return whether a column holds a constant whole number that says how the logger does."""
    if column.quantity != "unknown" or _FLAG_WORDS.isdisjoint(_words(column.name)):
        return False
    present = values[np.isfinite(values)]
    return bool(present.size and np.all(present == present[0]) and present[0] == np.round(present[0]))


def _head(table: Table) -> Real:
    """Return the first rows of the channels, shape (channels, rows)."""
    blocks = list(table.blocks(0, _HEAD_ROWS))
    return join(blocks).values if blocks else np.zeros((len(table.columns), 0))


def _whole(table: Table) -> Table:
    """Return the table with all channels of the file; as it is where they cannot be read."""
    if table.others is not None:
        with suppress(SprungError):
            return table.others(None)
    return table


def _with_found_time(table: Table, settings: ReadSettings) -> Table:
    """Return the table with the time column that names and behaviour show; without one as it is."""
    whole = _whole(table)
    head = _head(whole)
    columns = list(zip(whole.columns, head, strict=True))
    clocks = [column for column, values in columns if _is_clock(column, values)]
    clocks.sort(key=lambda column: stated_unit(column.heading) is None)
    if clocks:
        return _with_time(table, clocks[0].heading, "by its name, and as it rises steadily", settings)
    rate = settings.sampling_rate or table.sampling_rate
    if columns and _is_first(whole.columns[0], head[0], rate):
        return _with_time(table, whole.columns[0].heading, "as the first column rises as a clock does", settings)
    even = [column for column, values in columns if _is_even(values) and not _is_counter(column, values)]
    if rate is None and even:
        raise ParameterError(
            f"{table.path} has no time column by name, but {even[0].name!r} rises evenly: if it is the time, name it "
            f"with --time {even[0].name} (in Python: time=...); otherwise state the sampling rate in Hz with "
            "--sampling-rate (in Python: sampling_rate=...)"
        )
    return table


def _is_first(column: Column, values: Real, rate: float | None) -> bool:
    """Return whether the first column of a table without names is the time."""
    is_clock = _is_even(values) or _is_in_bursts(values) or (column.name == _UNNAMED and _rises(values))
    if not is_clock or not _FIRST.fullmatch(column.name):
        return False
    steps = _steps(values)
    if np.all(steps == 1) and values[0] == np.round(values[0]):
        return False
    mean = float(steps.mean())
    return rate is None or any(abs(mean * unit * rate - 1) < _SAME_RATE for unit in TIME_UNITS.values())


def _with_time(table: Table, name: str, why: str, settings: ReadSettings) -> Table:
    """Return the table with the column called `name` as its time."""
    if table.time_heading is not None and name in (table.time_heading, split_heading(table.time_heading)[0]):
        return table
    opened = _opened_with(table, name, settings.channels)
    index, column = next((k, item) for k, item in enumerate(opened.columns) if name in (item.heading, item.name))
    kept = [k for k in range(len(opened.columns)) if k != index or name in (settings.channels or ())]

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        for block in opened.blocks(first, last):
            yield Block(block.first_row, block.values[index], block.values[kept])

    return replace(
        opened,
        columns=tuple(opened.columns[k] for k in kept),
        time_heading=column.heading,
        blocks=blocks,
        times=None,
        notes=(*opened.notes, f"time: column {column.name!r}, {why}"),
    )


def _opened_with(table: Table, name: str, channels: Sequence[str] | None) -> Table:
    """Return the table with the wanted channels and the one called `name`."""
    if any(name in (column.heading, column.name) for column in table.columns) or table.others is None:
        opened = table
    else:
        opened = table.others(None if channels is None else [*channels, name])
    if not any(name in (column.heading, column.name) for column in opened.columns):
        known = ", ".join(column.name for column in opened.columns)
        raise ParameterError(f"{table.path} has no column {name!r} for the time: choose from {known}")
    return opened


def _of_motion(table: Table) -> Table:
    """Return the table without counters, flags and clocks, which are named in its notes."""
    head = _head(table)
    reasons = {}
    for column, values in zip(table.columns, head, strict=True):
        if _is_clock(column, values):
            reasons[column.name] = "a clock"
        elif _is_counter(column, values):
            reasons[column.name] = "a counter"
        elif _is_flag(column, values):
            reasons[column.name] = "a constant flag"
        elif column.name == _UNNAMED:
            reasons[column.name] = "without a name"
    if not reasons:
        return table
    kept = [k for k, column in enumerate(table.columns) if column.name not in reasons]
    words = ", ".join(f"{name!r} ({reason})" for name, reason in reasons.items())
    if not kept:
        raise DataError(f"{table.path} holds no channel of motion: {words}")

    def rows(source: Iterable[Block]) -> Iterator[Block]:
        return (replace(block, values=block.values[kept]) for block in source)

    return replace(
        table,
        columns=tuple(table.columns[k] for k in kept),
        blocks=lambda first=0, last=None: rows(table.blocks(first, last)),
        notes=(*table.notes, f"left out, as they do not measure motion: {words}; name them in --channels to keep them"),
    )


def _with_unit(table: Table, settings: ReadSettings) -> Table:
    """Return the table with the unit of its time column, and counters that restart continued."""
    if table.time_heading is None:
        return table

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        return unwrapped(table.blocks(first, last))

    times = table.times
    continued = replace(table, blocks=blocks, times=None if times is None else lambda: unwrapped(times()))
    if settings.time_unit is not None:
        note = f"time: column {table.time_heading!r} in {settings.time_unit}, as stated"
        return replace(continued, time_factor=TIME_UNITS[settings.time_unit], notes=(*table.notes, note))
    unit = stated_unit(table.time_heading)
    if unit is not None:
        return replace(continued, time_factor=TIME_UNITS[unit])
    return _with_likely_unit(continued, settings.sampling_rate or table.sampling_rate)


def _with_likely_unit(table: Table, rate: float | None) -> Table:
    """Return the table with the unit of time that gives a likely sampling rate, where seconds do not."""
    blocks = list(table.blocks(0, _HEAD_ROWS))
    stamps = join(blocks).stamps if blocks else None
    if stamps is None or stamps.dtype.kind in "mM" or not np.isfinite(stamps).all():
        return table
    numbers = stamps.astype(np.float64)
    steps = np.diff(numbers)
    if steps.size < _FEWEST_STEPS or np.any(steps < 0):
        return table
    step = float(np.median(steps)) or float(steps.mean())
    if step * time_scale(stamps).factor <= _LONG_STEP:
        return table
    likely = {unit: 1 / (step * TIME_UNITS[unit]) for unit in ("s", "ms", "us", "ns")}
    if rate is None:
        likely = {unit: value for unit, value in likely.items() if _RATES[0] <= value <= _RATES[1]}
    else:
        likely = {unit: value for unit, value in likely.items() if abs(value / rate - 1) < _SAME_RATE}
    whole: Booleans = numbers == np.round(numbers)
    if len(likely) == 1 and (rate is not None or whole.all()):
        ((unit, _),) = likely.items()
        note = f"time: column {table.time_heading!r} in {unit}, as seconds would mean {1 / step:.3g} Hz"
        return replace(table, time_factor=TIME_UNITS[unit], notes=(*table.notes, note))
    if rate is not None:
        return table
    others = "".join(f"; {value:.4g} Hz in {unit}" for unit, value in likely.items())
    raise FormatError(
        f"{table.path}: time column {table.time_heading!r} advances by {step:g} from row to row: {1 / step:.3g} Hz in "
        f"seconds{others}: state its unit with --time-unit, or the rate with --sampling-rate"
    )
