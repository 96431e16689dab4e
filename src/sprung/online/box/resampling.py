"""From single values with times to blocks of a constant rate."""

import math
from collections import deque
from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Real
from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.recording import Channel, Recording

#: Length of a block [s].
BLOCK = 1.0

# A time that is further than this from the latest one [s] indicates a pause, a clock that was set, or an error.
_STEP = 2.0
# Such times are accepted after this time [s], or number of messages, without others in between.
_WITNESSED = 1.0
_MAX_WITNESSES = 10_000
# Longest delay of the values of a channel after those of others of the same time [s].
_PATIENCE = 1.0
# Most values of a channel that are kept: only faulty senders send more in 3 s.
_MAX_VALUES = 20_000
# Largest plausible value of a sensor; squares of larger ones would overflow.
_LARGEST = 1e100
# A value this close to a sample, in sample intervals, is taken as it is: floating-point stamps are rounded.
_NEAR = 0.01


class Regular:
    """Resamples single values with times to blocks of a constant rate.

    Parameters
    ----------
    channels
        Channels, or their names.
    sampling_rate
        Sampling rate of the blocks [Hz], at most 100,000. Nothing is filtered: it must not be below that of the values.
    longest
        Longest time between two values of a channel [s], at most 2; samples within longer intervals are missing.
        Channels slower than 2 Hz need more than the default.

    Raises
    ------
    ParameterError
        If channels are missing or repeated, or a number is out of range.

    Notes
    -----
    The first time is that of the first sample. Samples are interpolated linearly between values; they are missing
    before the first value of a channel, after its last one, next to a missing value (NaN) and between values more than
    `longest` apart, unless a value is within 1 % of a sample interval.

    A block is complete once a further second has arrived, so values of one time need not arrive together. The times of
    a channel must increase: a value that is not later than the one before is discarded.

    A time more than 2 s from the latest one, forward or back, is a pause, a clock that was set, or an error. It is
    accepted once such times have continued for 1 s: then the present blocks are closed, and new ones begin. Until then
    a single time that agrees with the old ones indicates an error, and the deviating values are discarded. If the
    clocks of senders disagree permanently, the values of the first sender are kept.

    Memory is bounded for any input.

    Examples
    --------
    >>> regular = Regular(["acc_fl"], 4.0)
    >>> [block] = [block for k in range(9) for block in regular.add(k * 250_000_000, {"acc_fl": k})]
    >>> block.samples.tolist(), block.start
    ([[0.0, 1.0, 2.0, 3.0]], 0)
    >>> [block.samples.tolist() for block in regular.finish()]
    [[[4.0, 5.0, 6.0, 7.0]], [[8.0]]]
    """

    def __init__(self, channels: Sequence[Channel | str], sampling_rate: float, *, longest: float = 0.5) -> None:
        self._channels = tuple(Channel(item) if isinstance(item, str) else item for item in channels)
        names = [channel.name for channel in self._channels]
        if not names:
            raise ParameterError("no channel is named: name those of the blocks")
        repeated = sorted({name for name in names if names.count(name) > 1})
        if repeated:
            raise ParameterError(f"channel {repeated[0]!r} is named more than once: name it once")
        self._sampling_rate = check_number("sampling_rate", sampling_rate, above=0, at_most=1e5)
        self._longest = round(check_number("longest", longest, above=0, at_most=_STEP) * 1e9)
        self._hold = max(round(_PATIENCE * 1e9), self._longest)
        self._step = max(1, round(BLOCK * sampling_rate))
        self._points: dict[str, deque[tuple[int, float]]] = {name: deque() for name in names}
        self._waiting: list[tuple[int, dict[str, float]]] = []
        self._origin = 0
        self._n_done = 0
        self._latest: int | None = None

    def add(self, when: int, values: Mapping[str, float]) -> list[Recording]:
        """Take in values at a time (UTC ns), and return the blocks that are complete with them.

        Values of other channels are ignored.
        """
        known = {name: float(value) for name, value in values.items() if name in self._points}
        if not known:
            return []
        if not 0 <= when < 1 << 62:
            return []
        if self._agrees(when):
            self._doubt()
            self._take(when, known)
            return self._complete()
        if self._waiting and abs(when - self._waiting[-1][0]) > _STEP * 1e9:
            self._doubt()
        self._waiting.append((when, known))
        if when - self._waiting[0][0] < _WITNESSED * 1e9 and len(self._waiting) < _MAX_WITNESSES:
            return []
        return self._begin_anew()

    def finish(self) -> list[Recording]:
        """Return the samples up to the latest value; values added afterwards begin a new block."""
        self._doubt()
        blocks = self._rest()
        self._forget()
        return blocks

    def _agrees(self, when: int) -> bool:
        """Return whether a time continues from the latest accepted one, not from unconfirmed ones."""
        if self._latest is None:
            return True
        off = abs(when - self._latest)
        return off <= _STEP * 1e9 and not (self._waiting and abs(when - self._waiting[-1][0]) < off)

    def _doubt(self) -> None:
        """Discard values whose times were not confirmed."""
        self._waiting = []

    def _begin_anew(self) -> list[Recording]:
        """Close the present blocks, and continue with the values at other times."""
        blocks = self._rest()
        self._forget()
        waiting, self._waiting = self._waiting, []
        for when, values in waiting:
            self._take(when, values)
            blocks += self._complete()
        return blocks

    def _forget(self) -> None:
        """Begin with the next value."""
        for points in self._points.values():
            points.clear()
        self._latest = None

    def _take(self, when: int, values: Mapping[str, float]) -> None:
        if self._latest is None:
            self._origin = when
            self._n_done = 0
            self._latest = when
        self._latest = max(self._latest, when)
        for name, value in values.items():
            points = self._points[name]
            if not (points and when <= points[-1][0]) and len(points) < _MAX_VALUES:
                points.append((when, value if abs(value) <= _LARGEST else np.nan))

    def _complete(self) -> list[Recording]:
        blocks = []
        while self._latest is not None and self._time(self._step - 1) + self._hold <= self._latest:
            blocks.append(self._block(self._step))
        return [block for block in blocks if block is not None]

    def _rest(self) -> list[Recording]:
        """Return the blocks up to the latest value."""
        blocks = []
        while (n_left := self._n_left()) > 0:
            blocks.append(self._block(min(self._step, n_left)))
        return [block for block in blocks if block is not None]

    def _n_left(self) -> int:
        """Return the number of samples up to the latest value."""
        if self._latest is None:
            return 0
        return math.floor((self._latest - self._time(0)) * self._sampling_rate / 1e9 + _NEAR) + 1

    def _time(self, index: int) -> int:
        """Return the time of a sample of the next block, UTC ns."""
        return self._origin + round((self._n_done + index) * 1e9 / self._sampling_rate)

    def _block(self, n_samples: int) -> Recording | None:
        """Return the next block, None if it is empty, and release values before its end."""
        begin = self._time(0)
        times = np.array([self._time(index) - begin for index in range(n_samples)], dtype=np.int64)
        samples = np.array([self._at(name, begin, times) for name in self._points])
        self._n_done += n_samples
        for points in self._points.values():
            while len(points) > 1 and points[1][0] <= self._time(0):
                points.popleft()
        return None if np.isnan(samples).all() else Recording(samples, self._sampling_rate, self._channels, begin)

    def _at(self, name: str, begin: int, times: NDArray[np.int64]) -> Real:
        """Return a channel at times after `begin` [ns], shape (samples,)."""
        points = self._points[name]
        if not points:
            return np.full(times.size, np.nan)
        known = np.array([when - begin for when, _ in points], dtype=np.int64)
        values = np.array([value for _, value in points])
        following = np.minimum(np.searchsorted(known, times), known.size - 1)
        before = np.maximum(following - 1, 0)
        width = np.maximum(known[following] - known[before], 1)
        is_between = (known[before] < times) & (times < known[following]) & (width <= self._longest)
        share = (times - known[before]) / width
        lines = np.where(is_between, (1 - share) * values[before] + share * values[following], np.nan)
        nearest = np.where(times - known[before] < known[following] - times, before, following)
        is_near = np.abs(known[nearest] - times) * self._sampling_rate <= _NEAR * 1e9
        return np.where(np.isnan(lines) & is_near, values[nearest], lines)
