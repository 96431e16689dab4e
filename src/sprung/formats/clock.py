"""The clock of a file: from time stamps in any form to seconds, a sampling rate, gaps and jitter.

Stamps are numbers in some unit, counters that wrap around, or date-times. The stamps t of the samples i are compared
with straight lines t = a + i/fs, one for each stretch between gaps. Their deviation from the line, as a fraction of the
sample interval, is the jitter.

Samples are left as they are if their stamps deviate by less than 1 % of an interval (RMS), or by no more than the
rounding of printed digits. Taking such samples as uniform adds an error of at most 2 pi f/fs times the
deviation: 0.6 % of the amplitude at a tenth of the sampling rate. Resampling would cost more at high frequencies.

Channels of groups with clocks of their own are interpolated at the times of the first group.
"""

import itertools
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Indices, Real
from sprung._display import counted
from sprung.errors import DataError, FormatError, ParameterError
from sprung.formats.table import PIECE_ROWS, Block, Table, rebatch


@dataclass(frozen=True, slots=True)
class _Limits:
    """Limits by which stamps are judged, in sample intervals where no unit is given."""

    jitter: float = 0.01  # RMS deviation from a line up to which samples are left as they are
    constant: float = 1e-4  # standard deviation of steps below which they are called constant
    rounding: float = 0.35  # the same in printed digits: rounding to steps of q has an RMS error of q/sqrt(12)
    gap_step: float = 1.5  # a larger step may be a gap
    gap_step_unsteady: float = 2.5  # where a missing sample cannot be distinguished from a late one
    gap_shift: float = 0.5  # after a gap, stamps stay late by more than this: after a late stamp they catch up
    window: int = 8  # samples on either side of a step that decide this
    burst_window: int = 64  # the same where several samples share a stamp
    backlog: float = 0.1  # part of a step between bursts that must remain once a backlog has arrived
    off_step: float = 0.1  # an uneven step differs from a multiple of the interval by more than this
    max_off_share: float = 0.02  # share of uneven steps above which the clock is unsteady
    min_off: int = 3  # a few uneven steps are late stamps
    samples_per_gap: int = 20  # more gaps than one in this number of samples are a mixture of rates
    burst_share: float = 0.1  # share of rows with the stamp of the row before from which stamps come in bursts
    few: float = 0.01  # the same up to which single stamps are wrong
    min_bursts: int = 30  # fewer bursts give no rate
    piece: int = 1 << 16  # samples within which the drift of a clock does not matter; over a day it does
    line: int = 1000  # stamps that show a rate and its jitter
    rate_change: float = 1.05  # ratio of rates of such stretches that exceeds any drift of clocks
    counters: tuple[float, ...] = (2.0**16, 2.0**24, 2.0**32)  # ranges of counters, after which they begin again
    day: float = 86_400e9  # that of the time of day [ns]
    edge: float = 1 / 16  # part at the ends of a range where a clock begins again
    epoch: tuple[float, float] = (1e9, 4.1e9)  # seconds from 1970 to 2001 and to 2100: other stamps count from a start
    crowding: float = 0.5  # smallest distance of two stamps: splines through crowded samples oscillate


_LIMITS = _Limits()


@dataclass(frozen=True, slots=True)
class TimeScale:
    """Origin (first stamp, in its own unit), seconds per unit, UTC nanoseconds of the origin or None."""

    origin: float
    factor: float
    start: int | None = None

    def seconds(self, stamps: NDArray[Any]) -> Real:
        """Return stamps as seconds since the origin; NaN where a stamp is missing."""
        numbers = _plain_numbers(stamps)
        with np.errstate(invalid="ignore"):
            seconds: Real = (numbers - numbers.dtype.type(self.origin)) * self.factor
        if stamps.dtype.kind in "mM":
            seconds[np.isnat(stamps)] = np.nan
        return seconds

    def rounding(self, stamps: NDArray[Any]) -> float:
        """Return the distance of neighbouring floating-point numbers at the largest of the stamps [s]."""
        if stamps.dtype.kind != "f" or stamps.size == 0:
            return 0.0
        return float(np.spacing(np.abs(stamps).max())) * self.factor


def _plain_numbers(stamps: NDArray[Any]) -> NDArray[Any]:
    """Return date-times and durations as int64 nanoseconds, other integers as int64, the rest as float64."""
    if stamps.dtype.kind in "mM":
        return stamps.astype(f"{stamps.dtype.kind}8[ns]").view(np.int64)
    return stamps.astype(np.int64 if stamps.dtype.kind in "iu" else np.float64)


def time_scale(stamps: NDArray[Any], unit: float | None = None) -> TimeScale:
    """Return the scale of all stamps from the first one.

    Numbers count seconds, or `unit` seconds where the column states a unit. Without a unit, numbers so large that they
    can only count from 1970 are an epoch: in seconds from 1e9, in ms from 1e12, in us from 1e15, in ns from 1e18.
    So are ms, us and ns of which there are as many as from 1970 to a time between 2001 and 2100.
    """
    origin = _plain_numbers(stamps[:1])[0].item()
    if stamps.dtype.kind in "mM":
        return TimeScale(origin, 1e-9, origin if stamps.dtype.kind == "M" else None)
    if unit is not None:
        is_epoch = unit < 1 and _LIMITS.epoch[0] <= origin * unit < _LIMITS.epoch[1]
        return TimeScale(origin, unit, round(origin * round(unit * 1e9)) if is_epoch else None)
    for nanoseconds in (1, 10**3, 10**6, 10**9):
        if abs(origin) * nanoseconds >= _LIMITS.epoch[0] * 1e9:
            return TimeScale(origin, nanoseconds * 1e-9, round(origin * nanoseconds))
    return TimeScale(origin, 1.0)


def unwrapped(blocks: Iterable[Block]) -> Iterator[Block]:
    """Yield blocks whose time stamps continue where a counter, or the time of day at midnight, restarts.

    A stamp that falls from the last sixteenth of a range (of 16, 24 or 32 bits, or a day) into its first sixteenth
    begins a new one; all stamps that fall otherwise stay.
    """
    offset: float | int = 0
    last = None
    for block in blocks:
        stamps = block.stamps
        if stamps is None or stamps.dtype.kind == "M" or stamps.size == 0:
            yield block
            continue
        numbers = stamps if stamps.dtype.kind == "f" else _plain_numbers(stamps)
        before = np.concatenate([numbers[:1] if last is None else [last], numbers[:-1]])
        offsets = np.full(numbers.size, offset, dtype=numbers.dtype)
        for index in np.flatnonzero(numbers < before):
            for period in (_LIMITS.day,) if stamps.dtype.kind == "m" else _LIMITS.counters:
                if (1 - _LIMITS.edge) * period < before[index] < period and 0 <= numbers[index] < _LIMITS.edge * period:
                    offsets[index:] += numbers.dtype.type(period)
                    break
        last, offset = numbers[-1], offsets[-1]
        continued = numbers + offsets if offsets.any() else numbers
        if stamps.dtype.kind == "m":
            continued = np.where(np.isnat(stamps), np.timedelta64("NaT"), continued.view("m8[ns]"))
        yield replace(block, stamps=continued)


@dataclass(frozen=True, slots=True)
class Clock:
    """Advance of the time stamps of a file.

    Parameters
    ----------
    sampling_rate
        Sampling rate [Hz].
    pitch
        Usual step in time [s]: one sample interval, or the interval from burst to burst.
    gap_step
        Smallest step in time that may be a gap, in multiples of the pitch.
    jitter_rms, jitter_max
        Deviation from straight lines, in sample intervals.
    interval_std
        Standard deviation of the steps from stamp to stamp between gaps [s].
    in_bursts
        Whether several rows share a stamp, which is the time when they arrived; the straight line is the time when they
        were sampled.
    is_resampled
        Whether the samples must be brought onto a uniform grid.
    is_coarse
        Whether many rows have the stamp of the row before.
    n_repeated
        Number of rows that have the stamp of the row before, where these are few.
    """

    sampling_rate: float
    pitch: float
    gap_step: float = _LIMITS.gap_step
    jitter_rms: float = 0.0
    jitter_max: float = 0.0
    interval_std: float = 0.0
    in_bursts: bool = False
    is_resampled: bool = False
    is_coarse: bool = False
    n_repeated: int = 0

    @property
    def interval(self) -> float:
        """Time from sample to sample [s]."""
        return 1 / self.sampling_rate

    @property
    def shares_stamps(self) -> bool:
        """Whether several samples may share a stamp."""
        return self.pitch > 1.01 * self.interval

    def describe(self) -> str:
        """Return the line for the history."""
        fate = "resampled onto a uniform grid by cubic splines" if self.is_resampled else "samples left as they are"
        between = ", placed evenly up to the next stamp" if self.is_resampled else ""
        if self.n_repeated:
            fate += f"; {counted(self.n_repeated, 'row')} with the stamp of the row before{between}"
        if self.in_bursts:
            fate = f"time taken from a straight line, {fate}"
        pace = f"time stamps advance at {self.sampling_rate:.8g} Hz{' in bursts' * self.in_bursts}"
        if self.interval_std < _LIMITS.constant * self.interval:
            return f"{pace} in constant intervals: {fate}"
        return (
            f"{pace}, intervals of {1e3 * self.interval:.4g} ms with a standard deviation of "
            f"{1e3 * self.interval_std:.2g} ms, stamps at most {1e3 * self.jitter_max * self.interval:.2g} ms off a "
            f"straight line: {fate}"
        )


def find_gaps(seconds: Real, clock: Clock) -> Indices:
    """Return the indices of the samples before which time is missing.

    A step of more than 1.5 intervals (2.5 if the clock is unsteady) is a gap if the stamps after it stay late by
    more than half an interval; after a single late stamp they return to the line. Medians over a few samples up to the
    next large step decide. Stamps in bursts may first have to catch up with a backlog.
    """
    large = np.flatnonzero(np.diff(seconds) > clock.gap_step * clock.pitch)
    if large.size == 0:
        return large
    offset = seconds - clock.interval * np.arange(seconds.size)
    if clock.shares_stamps:
        is_gap = np.array([_outlasts_backlog(offset, int(index), clock) for index in large])
    else:
        first = np.concatenate([[0], large[:-1] + 1])[:, None]
        last = np.concatenate([large[1:], [seconds.size - 1]])[:, None]
        before = np.median(offset[np.maximum(large[:, None] - np.arange(_LIMITS.window), first)], axis=1)
        after = np.median(offset[np.minimum(large[:, None] + 1 + np.arange(_LIMITS.window), last)], axis=1)
        is_gap = after - before > _LIMITS.gap_shift * clock.pitch
    gaps: Indices = large[is_gap] + 1
    return gaps


def _outlasts_backlog(offset: Real, index: int, clock: Clock) -> bool:
    """Return whether stamps in bursts stay late after `index`, once the backlog of a stalled logger has arrived."""
    step = offset[index + 1] - offset[index] + clock.interval
    reach = max(_LIMITS.burst_window, int(1.2 * step / clock.interval))
    before = np.median(offset[max(0, index + 1 - reach) : index + 1])
    after = np.median(offset[index + 1 :][reach : 2 * reach] if index + 1 + reach < offset.size else offset[-1:])
    return bool(after - before > max(_LIMITS.gap_shift * clock.pitch, _LIMITS.backlog * step))


def uncrowded(seconds: Real, interval: float) -> Real:
    """Return stamps that are at least half an interval apart.

    Rows of one stamp are placed evenly up to the next one. A stamp can be late but not early: of two that are too
    close, the first is moved back.
    """
    firsts = np.flatnonzero(np.diff(seconds, prepend=-np.inf) > 0)
    if firsts.size < seconds.size:
        seconds = np.interp(np.arange(seconds.size), firsts, seconds[firsts])
    ramp = _LIMITS.crowding * interval * np.arange(seconds.size)
    apart: Real = np.minimum.accumulate((seconds - ramp)[::-1])[::-1] + ramp
    return apart


def interpolate(samples: Real, seconds: Real, wanted: Real) -> Real:
    """Return `samples` (channels, samples) at the `wanted` times by not-a-knot cubic splines.

    A channel with any missing value becomes NaN throughout, as splines cannot pass through NaN.
    """
    from scipy.interpolate import CubicSpline

    result = np.full((samples.shape[0], wanted.size), np.nan)
    whole = np.isfinite(samples).all(axis=1)
    if seconds.size == 1:
        result[whole] = samples[whole]
    else:
        result[whole] = CubicSpline(seconds, samples[whole], axis=1)(wanted)
    return result


class ClockFit:
    """Fits a clock to stamps block by block, in bounded memory.

    Parameters
    ----------
    place
        Words before the number of a row in messages, such as "run.csv, line".
    """

    def __init__(self, place: str) -> None:
        self._place = place
        self._pace: Clock | None = None
        self._last = -np.inf
        self._resolution = 1e9
        self._moment = 0.0  # sum over the lines of interval times spread
        self._spread = 0.0
        self._squares = 0.0
        self._largest = 0.0
        self._step_squares = 0.0
        self._n_steps = 0
        self._shortest = np.inf  # intervals of long stretches
        self._longest = 0.0
        self._n_stamps = 0
        self._n_fitted = 0
        self._n_gaps = 0
        self._n_repeated = 0
        self._first_repeated = -1

    def update(self, seconds: Real, rows: Indices, *, rounding: float = 0.0) -> None:
        """Add the next stamps [s], with the numbers of their rows and the rounding of the stamps [s]."""
        self._resolution = resolution(seconds, largest=self._resolution, rounding=rounding)
        for first in range(0, seconds.size, _LIMITS.piece):
            piece = seconds[first : first + _LIMITS.piece]
            self._check_order(piece, rows[first : first + _LIMITS.piece])
            if self._pace is None:
                self._pace = _first_pace(piece, self._resolution)
            gaps = find_gaps(piece, self._pace)
            self._n_stamps += piece.size
            self._n_gaps += gaps.size
            for begin, end in itertools.pairwise([0, *gaps, piece.size]):
                if end - begin > 2:
                    self._fit(piece[begin:end], self._pace)

    def _check_order(self, seconds: Real, rows: Indices) -> None:
        """Raise if time runs backwards; count repeated stamps."""
        steps = np.diff(seconds, prepend=self._last)
        if np.any(steps < 0):
            row = rows[np.argmax(steps < 0)]
            raise FormatError(
                f"{self._place} {row}: time runs backwards: sort the rows, split the file or state --sampling-rate"
            )
        repeated = np.flatnonzero(steps == 0)
        if repeated.size and not self._n_repeated:
            self._first_repeated = int(rows[repeated[0]])
        self._n_repeated += repeated.size
        self._last = float(seconds[-1])

    def _fit(self, stretch: Real, pace: Clock) -> None:
        """Add a straight line through the stamps between two gaps."""
        n = stretch.size
        spread = n * (n * n - 1) / 12
        interval = float((np.arange(n) - (n - 1) / 2) @ stretch) / spread
        if pace.shares_stamps:
            interval = _nearer(stretch, interval)
        self._moment += interval * spread
        self._spread += spread
        self._step_squares += (n - 1) * float(np.var(np.diff(stretch)))
        self._n_steps += n - 1
        for deviation in _deviations(stretch):
            self._squares += float(np.vdot(deviation, deviation))
            self._n_fitted += deviation.size
            self._largest = max(self._largest, float(np.abs(deviation).max()))
        if n >= _LIMITS.line:
            self._shortest = min(self._shortest, interval)
            self._longest = max(self._longest, interval)

    def clock(self) -> Clock:
        """Return the clock of all stamps so far.

        Raises
        ------
        DataError
            If there are fewer than two stamps, or rates are mixed.
        FormatError
            If more than a few stamps are repeated although they do not come in bursts.
        """
        pace = self._pace
        if pace is None or self._n_stamps < 2:
            raise DataError(
                f"{self._place} {self._n_stamps} is the only one with values: a recording needs at least two samples"
            )
        self._check_rate()
        interval = self._moment / self._spread if self._spread else pace.interval
        rms, is_coarse = self.rms, self.is_coarse
        is_uniform = rms <= max(_LIMITS.jitter * interval, _LIMITS.rounding * self._resolution)
        if self._n_repeated > _LIMITS.few * self._n_stamps and not is_uniform and not is_coarse:
            raise FormatError(
                f"{self._place} {self._first_repeated} repeats the time of the row before: give every row its own "
                "time, or state --sampling-rate"
            )
        n_bursts = self._n_stamps - self._n_repeated
        if is_coarse and n_bursts < _LIMITS.min_bursts:
            raise DataError(
                f"{self._place}s up to the last: {self._n_stamps} rows share {n_bursts} time stamps, too few for a "
                "rate: state --sampling-rate"
            )
        digit = max(self._resolution, 2e-6 * interval)
        return Clock(
            # uncertain by half a printed digit over the record, or by the standard error
            sampling_rate=neat_rate(interval, digit * max(0.5 / self._n_stamps, 1 / np.sqrt(max(1.0, self._spread)))),
            pitch=pace.pitch if pace.shares_stamps else interval,
            gap_step=pace.gap_step,
            jitter_rms=rms / interval,
            jitter_max=self._largest / interval,
            interval_std=float(np.sqrt(self._step_squares / max(1, self._n_steps))),
            in_bursts=is_coarse and not is_uniform,
            is_resampled=not is_uniform and not is_coarse,
            is_coarse=is_coarse,
            n_repeated=0 if is_coarse else self._n_repeated,
        )

    @property
    def rms(self) -> float:
        """Deviation of the stamps from straight lines [s], RMS."""
        return float(np.sqrt(self._squares / max(1, self._n_fitted)))

    @property
    def is_coarse(self) -> bool:
        """Whether many rows have the stamp of the row before."""
        return self._n_repeated >= _LIMITS.burst_share * self._n_stamps

    def _check_rate(self) -> None:
        """Raise if the stamps do not advance at one rate."""
        if self._n_gaps > max(2, self._n_stamps / _LIMITS.samples_per_gap):
            raise DataError(
                f"{self._place}s up to the last: time jumps {self._n_gaps} times in {self._n_stamps} rows, so rates "
                "are mixed: keep the channels of one rate with --channels, or write one file for each rate"
            )
        if self._longest > _LIMITS.rate_change * self._shortest:
            raise DataError(
                f"{self._place}s up to the last: the sampling rate changes from {1 / self._shortest:.4g} to "
                f"{1 / self._longest:.4g} Hz: write one file for each rate"
            )


def _nearer(stretch: Real, interval: float) -> float:
    """Return `interval`, or the median over long spans where its line is clearly nearer to most of the stamps.

    A logger that stalls for seconds and then catches up tilts the line of least squares.
    """
    n = stretch.size
    median = float(np.median(stretch[n // 2 :] - stretch[: n - n // 2])) / (n // 2)
    offsets = (stretch - candidate * np.arange(n) for candidate in (interval, median))
    spreads = [np.median(np.abs(offset - np.median(offset))) for offset in offsets]
    return median if spreads[1] < 0.5 * spreads[0] else interval


def _deviations(stretch: Real) -> Iterator[Real]:
    """Yield deviations of stamps from straight lines through each thousand of them: over more, clocks drift."""
    n_whole = stretch.size - stretch.size % _LIMITS.line
    for lines in (stretch[:n_whole].reshape(-1, _LIMITS.line), stretch[None, n_whole:]):
        n = lines.shape[1]
        if lines.size >= 3:
            ramp = np.arange(n) - (n - 1) / 2
            slopes = lines @ ramp / (n * (n * n - 1) / 12)
            yield lines - lines.mean(axis=1, keepdims=True) - slopes[:, None] * ramp


def _first_pace(seconds: Real, coarseness: float) -> Clock:
    """Return a first estimate of the clock from medians, on which a few gaps have no effect."""
    if seconds.size == 1:
        return Clock(1.0, 1.0)
    steps = np.diff(seconds)
    if np.mean(steps == 0) < 0.01:
        interval = float(np.median(steps))
        off = np.abs(steps - interval * np.maximum(1, np.round(steps / interval)))
        n_off = np.count_nonzero(off > max(_LIMITS.off_step * interval, 1.1 * coarseness))
        is_unsteady = n_off > max(_LIMITS.min_off, _LIMITS.max_off_share * steps.size)
        return Clock(1 / interval, interval, _LIMITS.gap_step_unsteady if is_unsteady else _LIMITS.gap_step)
    span = min(64, steps.size)
    interval = float(np.median(seconds[span:] - seconds[:-span])) / span
    if interval == 0:
        raise DataError("most rows share one time stamp: state --sampling-rate")
    return Clock(1 / interval, float(np.median(steps[steps >= interval])))


def resolution(seconds: Real, *, largest: float = 1e9, rounding: float = 0.0) -> float:
    """Return the coarsest power of ten [s], up to `largest`, of which all stamps are multiples.

    Without one, the `rounding` of the stamps as floating-point numbers.
    """
    step = largest
    tolerance = 1e-12 + rounding + 4 * np.spacing(np.abs(seconds).max(initial=0.0))
    while step > max(4 * tolerance, 5e-10):
        if np.all(np.abs(seconds - step * np.round(seconds / step)) <= tolerance):
            return step
        step /= 10
    return rounding


def neat_rate(interval: float, tolerance: float) -> float:
    """Return the roundest rate whose interval is within `tolerance` of `interval`."""
    for digits in range(1, 13):
        rate = float(f"{1 / interval:.{digits}g}")
        if abs(1 / rate - interval) < tolerance:
            return rate
    return 1 / interval


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
