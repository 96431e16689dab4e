"""Tables of a file joined: rows with equal times side by side, others interpolated at the times of the first table."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from sprung._arrays import Real
from sprung.errors import DataError, ParameterError
from sprung.formats.survey import time_unit
from sprung.formats.table import Block, Table, rebatch
from sprung.formats.timing import TimeScale, interpolate, time_scale

_BLOCK_ROWS = 1 << 16
# Rows on either side of a block that the splines through it need.
_MARGIN = 64
# Rates that differ by less are of one kind of sensor.
_SAME_RATE = 0.01
#: Quantities that vary slowly: they may come from a slower group.
_SLOW = ("speed", "temperature", "pressure", "unknown")


def side_by_side(tables: Sequence[Table]) -> Table:
    """Return tables with the same rows as one."""

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        parts = (rebatch(table.blocks(first, last), _BLOCK_ROWS) for table in tables)
        for same in zip(*parts, strict=True):
            yield replace(same[0], values=np.concatenate([block.values for block in same]))

    columns = tuple(column for table in tables for column in table.columns)
    return replace(tables[0], columns=columns, blocks=blocks)


def interpolated(tables: Sequence[Table]) -> Table:
    """Return tables with rows of different times as one, with the rows of the first.

    Parameters
    ----------
    tables
        Tables of one file, each with its clock. Speeds, temperatures and pressures of the others are interpolated
        linearly, motion of about the same rate by cubic splines.

    Returns
    -------
    Table
        Values are missing, and the rows left out, where a table has no rows around the time.

    Raises
    ------
    ParameterError
        If a table has no clock that can be compared, or its motion has another rate.
    """
    others = tables[1:]
    clocks = [_Clock(table) for table in tables]
    for table, clock in zip(others, clocks[1:], strict=True):
        _check(table, clock, clocks[0])

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        readers = [_Interpolation(table, clock, clocks[0]) for table, clock in zip(others, clocks[1:], strict=True)]
        row = first
        for block in tables[0].blocks(first, last):
            seconds = clocks[0].seconds(block.stamps, row, block.n_rows)
            row += block.n_rows
            yield replace(block, values=np.concatenate([block.values, *(reader.at(seconds) for reader in readers)]))

    columns = tuple(column for table in tables for column in table.columns)
    return replace(tables[0], columns=columns, blocks=blocks)


class _Clock:
    """Times of the rows of a table: seconds since 1970 where its start is known, otherwise as in the file."""

    def __init__(self, table: Table) -> None:
        head = next(iter(table.blocks(0, 1000)), None)
        if head is None or head.n_rows < 2:
            raise DataError(f"{table.path}: channel {table.columns[0].name!r} holds fewer than two samples")
        self.scale: TimeScale | None = None
        self.rate = table.sampling_rate or 0.0
        self.start = table.start
        if head.stamps is not None:
            self.scale = time_scale(head.stamps, time_unit(table))
            self.start = self.scale.start if self.scale.start is not None else table.start
            steps = np.diff(self.scale.seconds(head.stamps))
            self.rate = 1 / max(float(np.mean(steps)), 1e-12)
        self.is_absolute = self.start is not None

    def seconds(self, stamps: np.ndarray | None, first: int, n_rows: int) -> Real:
        """Return the times of rows [s], since 1970 or since the origin of the stamps."""
        if stamps is None or self.scale is None:
            relative: Real = (first + np.arange(n_rows)) / self.rate
        else:
            relative = self.scale.seconds(stamps)
            if self.scale.start is None:
                relative = relative + self.scale.origin * self.scale.factor
        return relative

    def offset(self, reference: "_Clock") -> float:
        """Return the time of the origin after that of another clock [s]."""
        return 1e-9 * ((self.start or 0) - (reference.start or 0))


def _check(table: Table, clock: _Clock, reference: _Clock) -> None:
    """Raise if the channels of a table cannot be joined to those with the clock `reference`."""
    names = ", ".join(column.name for column in table.columns)
    if clock.is_absolute != reference.is_absolute:
        raise ParameterError(
            f"{table.path}: the group of {names} states no time that the first group shares: read it by itself"
        )
    fast = [column.name for column in table.columns if column.quantity not in _SLOW]
    if fast and abs(clock.rate / reference.rate - 1) > _SAME_RATE:
        raise ParameterError(
            f"{table.path}: {', '.join(fast)} was sampled at {clock.rate:.4g} Hz, the first group at "
            f"{reference.rate:.4g} Hz: read motion of one rate at a time, or choose speed, temperature and pressure "
            "with --channels"
        )


class _Interpolation:
    """Channels of a table at rising times, read as the times advance."""

    def __init__(self, table: Table, clock: _Clock, reference: _Clock) -> None:
        self._clock, self._shift = clock, clock.offset(reference)
        self._blocks = rebatch(table.blocks(), _BLOCK_ROWS)
        self._row = 0
        self._is_smooth = np.array([column.quantity not in _SLOW for column in table.columns])
        self._seconds: Real = np.empty(0)
        self._values: Real = np.empty((len(table.columns), 0))

    def at(self, seconds: Real) -> Real:
        """Return the channels at some times [s] of the reference, shape (channels, times)."""
        times = seconds - self._shift
        self._read_until(times[-1])
        result = np.full((len(self._values), times.size), np.nan)
        if self._seconds.size > 1:
            inside = (times >= self._seconds[0]) & (times <= self._seconds[-1])
            for row, values in enumerate(self._values):
                known = ~np.isnan(values)
                if known.sum() > 1:
                    result[row, inside] = np.interp(times[inside], self._seconds[known], values[known])
            smooth = self._is_smooth & ~np.isnan(self._values).any(axis=1)
            if smooth.any() and np.all(np.diff(self._seconds) > 0):
                result[np.ix_(smooth, inside)] = interpolate(self._values[smooth], self._seconds, times[inside])
        keep = max(0, int(np.searchsorted(self._seconds, times[-1])) - _MARGIN)
        self._seconds, self._values = self._seconds[keep:], self._values[:, keep:]
        return result

    def _read_until(self, time: float) -> None:
        """Read rows until some lie behind a time."""
        while self._seconds.size < _MARGIN or self._seconds[-_MARGIN] < time:
            block = next(self._blocks, None)
            if block is None:
                return
            seconds = self._clock.seconds(block.stamps, self._row, block.n_rows)
            self._row += block.n_rows
            self._seconds = np.concatenate([self._seconds, seconds])
            self._values = np.concatenate([self._values, block.values], axis=1)
