"""Groups of a file with clocks of their own: channels of the others are interpolated at the times of the first."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from sprung._arrays import Real
from sprung.errors import DataError, ParameterError
from sprung.formats.clock import TimeScale, interpolate, time_scale
from sprung.formats.table import PIECE_ROWS, Block, Table, rebatch

#: Quantities that vary slowly: they may come from a slower group.
_SLOW = ("speed", "temperature", "pressure", "distance", "unknown")
#: Difference of rates of one kind of sensor.
_SAME_SENSOR = 0.01
#: Rows on either side of a block that the splines through it need.
_MARGIN = 64


def interpolated(tables: Sequence[Table]) -> Table:
    """Return tables with rows of different times as one, with the rows of the first.

    Speeds, temperatures and pressures of the others are interpolated linearly, motion of about the same rate by cubic
    splines. Values are missing, and the rows left out, where a table has no rows around the time.
    """
    reference, *others = (_Times(table) for table in tables)
    for times in others:
        times.check(reference)

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        readers = [_Interpolation(times, reference) for times in others]
        row = first
        for block in tables[0].blocks(first, last):
            seconds = reference.seconds(block, row)
            row += block.n_rows
            yield replace(block, values=np.concatenate([block.values, *(reader.at(seconds) for reader in readers)]))

    return replace(tables[0], columns=tuple(column for table in tables for column in table.columns), blocks=blocks)


class _Times:
    """Times of the rows of a table: seconds since 1970 where its start is known, otherwise as in the file."""

    def __init__(self, table: Table) -> None:
        head = next(iter(table.blocks(0, 1000)), None)
        if head is None or head.n_rows < 2:
            raise DataError(f"{table.path}: channel {table.columns[0].name!r} holds fewer than two samples")
        self.table = table
        self.scale: TimeScale | None = None
        self.rate = table.sampling_rate or 0.0
        self.start = table.start
        if head.stamps is not None:
            self.scale = time_scale(head.stamps, table.time_factor)
            self.start = table.start if self.scale.start is None else self.scale.start
            self.rate = 1 / max(float(np.mean(np.diff(self.scale.seconds(head.stamps)))), 1e-12)

    def seconds(self, block: Block, first: int) -> Real:
        """Return the times of rows from `first` on [s], since 1970 or since the origin of the stamps."""
        if block.stamps is None or self.scale is None:
            relative: Real = (first + np.arange(block.n_rows)) / self.rate
            return relative
        origin = 0.0 if self.scale.start is not None else self.scale.origin * self.scale.factor
        return self.scale.seconds(block.stamps) + origin

    def check(self, reference: "_Times") -> None:
        """Raise if the channels cannot be joined to those of a reference."""
        path = self.table.path
        if (self.start is None) != (reference.start is None):
            names = ", ".join(column.name for column in self.table.columns)
            raise ParameterError(
                f"{path}: the group of {names} states no time that the first group shares: read it by itself"
            )
        fast = [column.name for column in self.table.columns if column.quantity not in _SLOW]
        if fast and abs(self.rate / reference.rate - 1) > _SAME_SENSOR:
            raise ParameterError(
                f"{path}: {', '.join(fast)} was sampled at {self.rate:.4g} Hz, the first group at "
                f"{reference.rate:.4g} Hz: read motion of one rate at a time, or choose speed, temperature and "
                "pressure with --channels"
            )


class _Interpolation:
    """Channels of a table at rising times, read as the times advance."""

    def __init__(self, times: _Times, reference: _Times) -> None:
        columns = times.table.columns
        self._times = times
        self._shift = 1e-9 * ((times.start or 0) - (reference.start or 0))
        self._blocks = rebatch(times.table.blocks(), PIECE_ROWS)
        self._row = 0
        self._is_smooth = np.array([column.quantity not in _SLOW for column in columns])
        self._seconds: Real = np.empty(0)
        self._values: Real = np.empty((len(columns), 0))

    def at(self, seconds: Real) -> Real:
        """Return the channels at some times [s] of the reference, shape (channels, times)."""
        times = seconds - self._shift
        self._read_until(times[-1])
        result = np.full((len(self._values), times.size), np.nan)
        if self._seconds.size > 1:
            inside = (times >= self._seconds[0]) & (times <= self._seconds[-1])
            for row, values in enumerate(self._values):
                known = np.isfinite(values)
                if known.sum() > 1:
                    result[row, inside] = np.interp(times[inside], self._seconds[known], values[known])
            smooth = self._is_smooth & np.isfinite(self._values).all(axis=1)
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
            self._seconds = np.concatenate([self._seconds, self._times.seconds(block, self._row)])
            self._values = np.concatenate([self._values, block.values], axis=1)
            self._row += block.n_rows
