"""Fillers: numbers that a logger writes where it has no value, such as -999 or 32767."""

import numpy as np

from sprung._arrays import Real

#: Numbers that loggers write, as in the file.
_FILLERS = np.array(
    [
        *(sign * number for number in (999.0, 999.9, 9999.0, 9999.9, 99999.0, 999999.0) for sign in (-1, 1)),
        *(-32768.0, 32767.0, 65535.0, -2147483648.0, 2147483647.0, 4294967295.0, 1e30, -1e30, 1e31, -1e31),
    ]
)
#: Fewest values that are a filler, largest share of them, and distance from all others over their range.
_FEWEST, _LARGEST_SHARE, _FAR = 3, 0.5, 3.0


class FillerCount:
    """Counts the fillers in channels block by block.

    Parameters
    ----------
    n_channels
        Number of channels.
    """

    def __init__(self, n_channels: int) -> None:
        self._counts = np.zeros((n_channels, _FILLERS.size), dtype=np.intp)
        self._others = np.zeros(n_channels, dtype=np.intp)
        self._lowest = np.full(n_channels, np.inf)
        self._highest = np.full(n_channels, -np.inf)

    def update(self, values: Real) -> None:
        """Add the next rows, shape (channels, rows), missing values as NaN."""
        is_other = np.isfinite(values)
        is_large = np.abs(values) >= np.abs(_FILLERS).min()
        for row in np.flatnonzero(is_large.any(axis=1)):
            matches = values[row] == _FILLERS[:, None]
            self._counts[row] += np.count_nonzero(matches, axis=1)
            is_other[row] &= ~matches.any(axis=0)
        self._others += np.count_nonzero(is_other, axis=1)
        lowest = np.min(values, axis=1, where=is_other, initial=np.inf)
        highest = np.max(values, axis=1, where=is_other, initial=-np.inf)
        self._lowest, self._highest = np.minimum(self._lowest, lowest), np.maximum(self._highest, highest)

    def fillers(self, channel: int) -> dict[float, int]:
        """Return the fillers of a channel, each with the number of its values.

        A filler occurs at least three times and is farther from all other values than three times their range; a
        channel of which it is more than half has none, as it may be what the channel measures.

        Parameters
        ----------
        channel
            Row of the channel.
        """
        n_others = int(self._others[channel])
        low, high = self._lowest[channel], self._highest[channel]
        counts = self._counts[channel]
        if not n_others or counts.sum() > _LARGEST_SHARE * (n_others + counts.sum()):
            return {}
        distance = np.maximum(low - _FILLERS, _FILLERS - high)
        is_filler = (counts >= _FEWEST) & (distance > _FAR * (high - low)) & (distance > 0)
        return {float(_FILLERS[k]): int(counts[k]) for k in np.flatnonzero(is_filler)}


def without_fillers(values: Real, fillers: tuple[tuple[float, ...], ...]) -> Real:
    """Return values with NaN for fillers.

    Parameters
    ----------
    values
        Values as in the file, shape (channels, rows).
    fillers
        Fillers of each channel.
    """
    if not any(fillers):
        return values
    cleaned = values.copy()
    for row, numbers in enumerate(fillers):
        if numbers:
            cleaned[row, np.isin(cleaned[row], numbers)] = np.nan
    return cleaned
