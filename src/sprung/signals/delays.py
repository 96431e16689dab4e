"""Channels advanced in time by fractions of a sample."""

import itertools
from collections.abc import Callable, Sequence

import numpy as np

from sprung._arrays import Real
from sprung.signals.data_faults import equal_runs

#: Samples on each side that an interpolated one is computed from, and the shape of their Kaiser window: flat within
#: 0.01 % up to 0.85 of half the sampling rate.
_REACH, _KAISER = 32, 8.0
#: Samples in a plateau, which stays one: clipped and stuck values remain recognisable.
_PLATEAU = 3
#: Part of a sample that counts as none.
_NONE = 1e-6


def advanced(values: Real, shift: float, *, breaks: Sequence[int] = ()) -> Real:
    """Return the samples of a channel at times later by `shift` samples; missing where nothing was recorded.

    Parameters
    ----------
    values
        Samples of one channel, shape (samples,); missing ones are NaN.
    shift
        Time by which the channel is late, in samples; negative: early.
    breaks
        Indices at which a new run begins, such as those of gaps.

    Returns
    -------
    ndarray
        Values x(k + shift), shape (samples,): NaN where k + shift lies outside the run of values around sample k.

    Notes
    -----
    Interpolation by a sinc with a Kaiser window of 64 samples, the ends of each run extended by odd reflection. Runs of
    three or more equal values are moved by whole samples, and nothing exceeds those at the limits of a clipped channel.

    References
    ----------
    J. F. Kaiser (1974), Nonrecursive digital filter design using the I0-sinh window function, Proceedings of the IEEE
    International Symposium on Circuits and Systems, 20-23.

    Examples
    --------
    >>> advanced(np.array([0.0, 1.0, 2.0, 4.0]), 2.0)
    array([ 2.,  4., nan, nan])
    """
    moved = _by_run(values, shift, breaks, _interpolated)
    starts, lengths = equal_runs(values, breaks=breaks)
    starts, lengths = starts[lengths >= _PLATEAU], lengths[lengths >= _PLATEAU]
    whole = round(shift)
    for start, length in zip(starts, lengths, strict=True):
        first, last = max(0, start - whole), max(0, start + length - whole)
        moved[first:last] = np.where(np.isnan(moved[first:last]), np.nan, values[start])
    return _within_limits(moved, values, values[starts])


def _within_limits(moved: Real, values: Real, plateaus: Real) -> Real:
    """Return moved samples not beyond the extreme values of a channel that has plateaus there."""
    if not plateaus.size:
        return moved
    low, high = np.nanmin(values), np.nanmax(values)
    return np.clip(moved, low if low in plateaus else -np.inf, high if high in plateaus else np.inf)


def advanced_linearly(values: Real, shift: float, *, breaks: Sequence[int] = ()) -> Real:
    """Return the samples of a slow channel, such as a speed, at times later by `shift` samples.

    Parameters
    ----------
    values, shift, breaks
        As for `advanced`.

    Notes
    -----
    Interpolation by straight lines: a constant stays exactly that.
    """
    return _by_run(values, shift, breaks, _on_lines)


def _by_run(values: Real, shift: float, breaks: Sequence[int], method: Callable[[Real, float], Real]) -> Real:
    """Return each run of values that are not missing moved by a method for fractions of a sample."""
    moved = np.full(values.size, np.nan)
    for start, stop in _runs(values, breaks):
        whole = int(np.floor(shift + _NONE))
        part = shift - whole
        run = values[start:stop]
        inside = run if part <= _NONE else method(run, part)
        first, last = start + max(0, -whole), start + min(run.size, inside.size - whole)
        if first < last:
            moved[first:last] = inside[first + whole - start : last + whole - start]
    return moved


def _runs(values: Real, breaks: Sequence[int]) -> list[tuple[int, int]]:
    """Return first and last index (not included) of each run of finite values."""
    is_finite = np.isfinite(values)
    is_edge = np.diff(is_finite, prepend=False) != 0
    is_edge[[index for index in breaks if index < values.size]] = True
    edges = [*np.flatnonzero(is_edge).tolist(), values.size]
    return [(start, stop) for start, stop in itertools.pairwise(edges) if is_finite[start]]


def _interpolated(run: Real, part: float) -> Real:
    """Return the band-limited signal between samples, shape (samples - 1,)."""
    if run.size < 2:
        return np.zeros(0)
    extended = np.pad(run, _REACH, mode="reflect", reflect_type="odd")
    distances = np.arange(1 - _REACH, _REACH + 1) - part
    window = np.i0(_KAISER * np.sqrt(np.clip(1 - (distances / _REACH) ** 2, 0, 1)))
    kernel = np.sinc(distances) * window
    moved = np.convolve(extended, kernel[::-1] / kernel.sum(), mode="valid")
    return np.asarray(moved[1 : run.size], dtype=np.float64)


def _on_lines(run: Real, part: float) -> Real:
    """Return the values on straight lines between samples, shape (samples - 1,)."""
    return np.asarray(run[:-1] + part * np.diff(run), dtype=np.float64)
