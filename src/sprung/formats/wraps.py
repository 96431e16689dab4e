"""Clocks that wrap around: counters of 16, 24 or 32 bits, and the time of day at midnight."""

from collections.abc import Iterable, Iterator
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung.formats.table import Block

#: Ranges of counters, and that of the time of day [ns].
_RANGES = (2.0**16, 2.0**24, 2.0**32)
_DAY = 86_400_000_000_000
#: Part of the range within which the stamps before and after the new beginning lie.
_EDGE = 1 / 16


def unwrapped(blocks: Iterable[Block]) -> Iterator[Block]:
    """Yield blocks whose time stamps continue where a counter, or the time of day, restarts.

    Parameters
    ----------
    blocks
        Consecutive rows with stamps as in the file. A stamp that falls from the last sixteenth of a range (of 16, 24 or
        32 bits, or a day) into its first sixteenth begins a new one; all stamps that fall otherwise stay.
    """
    offset: float | int = 0
    last = None
    for block in blocks:
        stamps = block.stamps
        if stamps is None or stamps.dtype.kind == "M" or stamps.size == 0:
            yield block
            continue
        if stamps.dtype.kind == "m":
            stamps = stamps.astype("m8[ns]")
        numbers = _numbers(stamps)
        before = np.concatenate([numbers[:1] if last is None else [last], numbers[:-1]])
        offsets = np.full(numbers.size, offset, dtype=numbers.dtype)
        for index in np.flatnonzero(numbers < before):
            period = _period(float(before[index]), float(numbers[index]), stamps.dtype.kind)
            offsets[index:] += numbers.dtype.type(period)
        last, offset = numbers[-1], offsets[-1]
        continued = numbers + offsets if offsets.any() else numbers
        if stamps.dtype.kind == "m":
            continued = np.where(np.isnat(stamps), stamps, continued.view(stamps.dtype))
        yield replace(block, stamps=continued)


def _numbers(stamps: NDArray[Any]) -> NDArray[Any]:
    """Return stamps as numbers to which a range may be added."""
    if stamps.dtype.kind == "m":
        return stamps.view(np.int64)
    return stamps.astype(np.int64) if stamps.dtype.kind in "iu" else stamps


def _period(before: float, after: float, kind: str) -> float:
    """Return the range of a clock that falls from `before` to `after` by wrapping around; 0 for any other fall."""
    periods = (float(_DAY),) if kind == "m" else _RANGES
    for period in periods:
        if (1 - _EDGE) * period < before < period and 0 <= after < _EDGE * period:
            return period
    return 0.0
