"""Samples as integers of two or four bytes, arranged so that they compress well."""

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Real

#: Largest standard deviation of the rounding error of a channel in two bytes, relative to the scatter of its samples.
MOST_ROUNDING = 1e-3
#: Deviation from whole numbers below which samples are multiples of a step.
_WHOLE = 1e-6
#: Number of samples from which the step of a channel is taken.
_FOR_STEP = 4096


def quantised(samples: Real) -> tuple[NDArray[np.signedinteger], Real]:
    """Return samples as integers, and their scale.

    Parameters
    ----------
    samples
        Samples, shape (channels, samples); NaN where missing.

    Returns
    -------
    tuple
        Integers of two bytes, or of four where those would round too coarsely, shape (channels, samples), the lowest
        one for a missing value; and the value of one count, shape (channels,).

    Notes
    -----
    Samples that are whole multiples of a step, as those of converters and of text files are, keep that step and are
    exact. Others are rounded to 1/32767 of the largest one of their channel, or to 1/(2^31 - 1) of it where the error
    would exceed 1e-3 of the scatter of some channel.
    """
    values = np.asarray(samples, dtype=np.float64)
    missing = ~np.isfinite(values)
    scales = np.array([_step(row[~gone]) for row, gone in zip(values, missing, strict=True)])
    highest = 2**15 - 1
    coarse = np.array([_largest(row, gone) / highest for row, gone in zip(values, missing, strict=True)])
    is_exact = (scales > 0) & (coarse <= scales)
    spread = np.array([_spread(row[~gone]) for row, gone in zip(values, missing, strict=True)])
    if np.all(is_exact | (coarse / np.sqrt(12) <= MOST_ROUNDING * spread)):
        scale, integers = np.where(is_exact, scales, coarse), np.int16
    else:
        highest = 2**31 - 1
        fine = coarse * (2**15 - 1) / highest
        scale, integers = np.where((scales > 0) & (fine <= scales), scales, fine), np.int32  # type: ignore[assignment]
    scale = np.where(scale > 0, scale, 1.0)
    counts = np.rint(np.where(missing, 0.0, values) / scale[:, None])
    counts = np.clip(counts, -highest, highest).astype(integers)
    counts[missing] = -highest - 1
    return counts, scale


def values_of(counts: NDArray[np.signedinteger], scale: Real) -> Real:
    """Return the samples of integers, NaN where missing; inverse of `quantised`."""
    values: Real = counts * np.asarray(scale, dtype=np.float64)[:, None]
    values[counts == np.iinfo(counts.dtype).min] = np.nan
    return values


def packed(counts: NDArray[np.signedinteger]) -> bytes:
    """Return integers as the bytes of their differences along each row, bytes of equal weight together."""
    kind = counts.dtype.newbyteorder("<")
    steps = np.diff(counts, axis=1, prepend=counts.dtype.type(0)).astype(kind)  # wraps around, and back in `unpacked`
    octets = steps.view(np.uint8).reshape(*counts.shape, kind.itemsize)
    return np.ascontiguousarray(np.moveaxis(octets, -1, 0)).tobytes()


def unpacked(data: bytes, *, n_channels: int, n_samples: int) -> NDArray[np.signedinteger]:
    """Return the integers of `packed`, shape (channels, samples).

    Raises
    ------
    ValueError
        If the number of bytes does not fit.
    """
    width = len(data) // max(1, n_channels * n_samples)
    if width not in {2, 4} or len(data) != width * n_channels * n_samples:
        raise ValueError(f"{len(data)} bytes are not {n_channels} channels of {n_samples} samples")
    octets = np.moveaxis(np.frombuffer(data, dtype=np.uint8).reshape(width, n_channels, n_samples), 0, -1)
    kind = np.dtype(f"<i{width}")
    steps = np.ascontiguousarray(octets).view(kind)[..., 0]
    return np.cumsum(steps, axis=1, dtype=kind)


def _step(values: Real) -> float:
    """Return the step of which all values are whole multiples; 0 where there is none."""
    levels = np.unique(np.abs(values[:_FOR_STEP]))
    steps = np.diff(levels[levels > 0], prepend=0.0)
    steps = steps[steps > _WHOLE * levels[-1]] if levels.size else steps
    if not steps.size:
        return 0.0
    step = float(steps.min())
    step = float(levels[-1] / np.rint(levels[-1] / step))  # the largest value determines it best
    counts = values / step
    return step if np.all(np.abs(counts - np.rint(counts)) < _WHOLE) else 0.0


def _largest(values: Real, missing: NDArray[np.bool_]) -> float:
    """Return the largest absolute value."""
    return float(np.max(np.abs(values), initial=0.0, where=~missing))


def _spread(values: Real) -> float:
    """Return half the range of the middle two thirds, which a few spikes do not widen; else the standard deviation."""
    if not values.size:
        return 0.0
    low, high = np.quantile(values, [1 / 6, 5 / 6])
    return float(high - low) / 2 or float(np.std(values)) or _largest(values, np.zeros(values.shape, dtype=bool))
