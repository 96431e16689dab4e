"""Faults of data that a channel shows by itself: dead, stuck, clipped, spiking, with fillers or repeated stretches.

They are defined here only: `sprung info`, the sensor checks and identification use the same functions and limits.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Booleans, Indices, Real
from sprung.recording import Recording

#: Quantities that are conditions of the motion, not motion: they may stay at a value, even at their highest one.
CONDITIONS = ("speed", "temperature", "pressure", "distance")
#: Speed above which a vehicle moves [m/s]: while it stands, sensors may well be constant.
MOVING = 2.0
#: Relative variation of a constant after resampling and conversion of units: a channel within it is dead.
ROUNDING = 1e-12
#: Share of missing values above which a channel is dead.
DEAD_SHARE = 0.5
#: Share of clipped samples above which a fit suffers.
CLIPPED_SHARE = 3e-4
#: Share of the values on the move in runs of one value of a second or more, from which a channel rests; a few of them,
#: as from a slow sensor on a smooth road, are not a fault.
REST_SHARE = 0.02
#: Length [s] of a single run, and its share of the record, from which a channel rests.
REST_DURATION, REST_RUN_SHARE = 2.0, 0.01
#: Smallest number of spikes that is a fault.
FEWEST_SPIKES = 3


@dataclass(frozen=True, slots=True)
class FaultLimits:
    """Limits of the faults."""

    plateau: int = 3  # consecutive samples at the largest or smallest value that are a plateau of clipping
    stuck_duration: float = 1.0  # duration of a run of equal values that counts as stuck [s]
    stuck_run: int = 10  # samples of such a run
    zero: float = 1e-6  # largest magnitude of 0, over the standard deviation
    around: int = 16  # samples around an isolated spike
    isolated: float = 0.15  # largest bend among them over that of the spike
    least_scale: float = 1e-100  # smallest standard deviation of bends, over the largest bend
    one_spike: int = 5  # samples within which a spike rings after resampling to regular time stamps
    min_fillers: int = 3  # samples with a filler
    far: float = 3.0  # distance of a filler from all other values over their range
    repeated_duration: float = 0.5  # length of a repeated stretch [s]
    repeated_samples: int = 32  # and in samples
    changing: float = 0.5  # share of its samples that differ from the one before
    min_values: int = 12  # different values in it
    periodic: float = 0.5  # share of a record with repeats from which it is periodic


_LIMITS = FaultLimits()
#: Robust standard deviations of the bend at a spike.
SPIKE = 12.0
#: Its jump in standard deviations of the samples that no body can perform: on a smooth road the edge of a pothole
#: reaches 1.2.
NO_BODY = 6.0


_FACTOR = np.uint64(0x9E3779B97F4A7C15)


def is_condition(name: str, quantity: str) -> bool:
    """Return whether a channel measures an operating condition (speed, temperature, pressure, distance), no motion.

    Parameters
    ----------
    name, quantity
        Name and quantity as in the recording. A channel of unknown quantity named "speed", in any case of letters,
        is the speed.
    """
    return quantity in CONDITIONS or (quantity == "unknown" and name.casefold() == "speed")


def moving_samples(recording: Recording) -> Booleans:
    """Return whether the vehicle moves at each sample, shape (samples,); False throughout without a speed channel.

    Parameters
    ----------
    recording
        Recording with a channel of speed [m/s] or without.
    """
    for values, channel in zip(recording.samples, recording.channels, strict=True):
        if channel.quantity == "speed" or (channel.quantity == "unknown" and channel.name.casefold() == "speed"):
            return np.asarray(values > MOVING)
    return np.zeros(recording.n_samples, dtype=np.bool_)


def equal_runs(values: Real, *, breaks: Sequence[int] = ()) -> tuple[Indices, Indices]:
    """Return the start and length of every run of equal values.

    Parameters
    ----------
    values
        Samples of one channel, shape (samples,). A missing value (NaN) is a run of its own.
    breaks
        Indices at which a new run starts for any values, such as those of gaps.
    """
    is_start = np.ones(values.size, dtype=np.bool_)
    is_start[1:] = np.diff(values) != 0
    is_start[list(breaks)] = True
    starts = np.flatnonzero(is_start)
    return starts, np.diff(starts, append=values.size)


def stuck_runs(values: Real, sampling_rate: float, *, breaks: Sequence[int] = ()) -> tuple[Indices, Indices]:
    """Return the start and length of every run of one value for at least a second and ten samples.

    Parameters
    ----------
    values, breaks
        As for `equal_runs`.
    sampling_rate
        Sampling rate [Hz].
    """
    starts, lengths = equal_runs(values, breaks=breaks)
    is_long = (lengths >= max(_LIMITS.stuck_run, _LIMITS.stuck_duration * sampling_rate)) & ~np.isnan(values[starts])
    return starts[is_long], lengths[is_long]


def has_runs(values: Real) -> bool:
    """Return whether a channel has missing values, a plateau at its largest or smallest value, or may be stuck.

    Parameters
    ----------
    values
        Samples of one channel, shape (samples,).

    Notes
    -----
    Without any of these it has no `stuck_runs` and no `plateaus` at all, for any breaks.
    """
    if values.size < _LIMITS.plateau or np.isnan(values).any():
        return True
    is_same = values[1:] == values[:-1]
    heads = np.flatnonzero(is_same[1:] & is_same[:-1])
    if not heads.size:
        return False
    lag = _LIMITS.stuck_run - _LIMITS.plateau
    is_stuck = heads[lag:] - heads[: max(heads.size - lag, 0)] == lag
    plateaus = values[heads]
    return bool(is_stuck.any() or (plateaus == values.min()).any() or (plateaus == values.max()).any())


@dataclass(frozen=True, slots=True)
class Rest:
    """Runs of one value of a second or more in a channel.

    Parameters
    ----------
    n_values, n_resting
        Number of values, and of those in such runs.
    longest, value
        Length of the longest run [samples], and the value in it.
    """

    n_values: int = 0
    n_resting: int = 0
    longest: int = 0
    value: float = 0.0

    @property
    def share(self) -> float:
        """Share of the values in such runs, 0 to 1."""
        return self.n_resting / max(1, self.n_values)

    def is_fault(self, sampling_rate: float) -> bool:
        """Return whether the channel rests for 2 % of the time, or for 1 % and two seconds at a stretch."""
        longest = max(REST_DURATION * sampling_rate, REST_RUN_SHARE * self.n_values)
        return self.n_resting > 0 and (self.share >= REST_SHARE or self.longest >= longest)

    def is_at_zero(self, standard_deviation: float) -> bool:
        """Return whether the value is 0 to rounding, by the standard deviation of the channel."""
        return abs(self.value) <= _LIMITS.zero * max(standard_deviation, 1e-12)


def rest_of(
    values: Real, sampling_rate: float, *, breaks: Sequence[int] = (), is_moving: Booleans | None = None
) -> Rest:
    """Return the runs of one value of a second or more.

    Parameters
    ----------
    values, breaks
        As for `equal_runs`.
    sampling_rate
        Sampling rate [Hz].
    is_moving
        Samples that count, shape (samples,); None: all.
    """
    counted = values if is_moving is None else np.where(is_moving, values, np.nan)
    n_values = int(np.count_nonzero(np.isfinite(counted)))
    starts, lengths = stuck_runs(counted, sampling_rate, breaks=breaks)
    if not starts.size:
        return Rest(n_values)
    longest = int(np.argmax(lengths))
    return Rest(n_values, int(lengths.sum()), int(lengths[longest]), float(counted[starts[longest]]))


def clipped_share(values: Real, *, breaks: Sequence[int] = ()) -> float:
    """Return the share of the values in plateaus of at least three samples at the maximum or minimum, 0 to 1.

    Parameters
    ----------
    values, breaks
        As for `equal_runs`.
    """
    finite = values[~np.isnan(values)]
    if finite.size == 0:
        return 0.0
    minimum, maximum = float(finite.min()), float(finite.max())
    at_minimum, at_maximum = plateaus(values, minimum, maximum, breaks=breaks)
    return (at_maximum + (at_minimum if minimum < maximum else 0)) / finite.size


def plateaus(values: Real, minimum: float, maximum: float, *, breaks: Sequence[int] = ()) -> tuple[int, int]:
    """Return the number of samples in plateaus of at least three at a minimum and at a maximum.

    Parameters
    ----------
    values, breaks
        As for `equal_runs`.
    minimum, maximum
        Extreme values.
    """
    starts, lengths = equal_runs(values, breaks=breaks)
    heads, is_plateau = values[starts], lengths >= _LIMITS.plateau
    return int(lengths[is_plateau & (heads == minimum)].sum()), int(lengths[is_plateau & (heads == maximum)].sum())


def missing_share(values: Real) -> float:
    """Return the share of the values that are missing (NaN) or infinite, 0 to 1; 1 for an empty array."""
    return 1 - np.count_nonzero(np.isfinite(values)) / values.size if values.size else 1.0


def constant_value(values: Real, *, tolerance: float = 0.0) -> float | None:
    """Return the value of a constant channel; None if it changes or holds no value.

    Parameters
    ----------
    values
        Samples of one channel, shape (samples,); missing values are ignored.
    tolerance
        Largest difference of any two values, relative to the largest magnitude, that counts as constant.
    """
    is_known = np.isfinite(values)
    finite = values if is_known.all() else values[is_known]
    if finite.size == 0:
        return None
    low, high = finite.min(), finite.max()
    if high - low > tolerance * max(abs(low), abs(high)):
        return None
    return float(finite[0])


def bends(values: Real) -> tuple[Real, Real]:
    """Return the distance of samples from the mean of their neighbours, as it is and in robust standard deviations.

    Where most lie on it, the smallest distance stands for the standard deviation.

    Parameters
    ----------
    values
        Samples without missing values, shape (..., samples).

    Returns
    -------
    tuple of numpy.ndarray
        Two arrays of shape (..., samples - 2).
    """
    bend = values[..., 1:-1] - (values[..., 2:] + values[..., :-2]) / 2
    size = np.abs(bend)
    scale = 1.4826 * np.median(size, axis=-1, keepdims=True)
    if not (scale > 0).all():
        smallest = np.min(size, axis=-1, keepdims=True, where=size > 0, initial=np.inf)
        scale = np.where(scale > 0, scale, smallest)
    # Next to the largest, traces of rounding need no size that overflows when it is squared.
    return bend, bend / np.maximum(scale, _LIMITS.least_scale * size.max(axis=-1, keepdims=True, initial=0.0))


def returns(sizes: Real) -> Booleans:
    """Return whether both neighbours of each inner sample bend the other way.

    Parameters
    ----------
    sizes
        Bends in robust standard deviations, shape (samples,).
    """
    middle = sizes[1:-1]
    limit = -0.25 * middle**2
    return np.asarray((sizes[:-2] * middle < limit) & (sizes[2:] * middle < limit))


def count_apart(places: Indices) -> int:
    """Return the number of spikes at sample indices, where those within a few samples are one."""
    return int(places.size and 1 + np.count_nonzero(np.diff(places) > _LIMITS.one_spike))


def count_spikes(values: Real) -> int:
    """Return the number of single-sample spikes: jumps and returns too large for any body, in calm surroundings.

    Parameters
    ----------
    values
        Samples of one channel, shape (samples,); missing ones are passed over.
    """
    finite = values[np.isfinite(values)]
    if finite.size < 5:
        return 0
    bend, sizes = bends(finite)
    size = np.abs(bend)
    is_spike = (np.abs(sizes[1:-1]) > SPIKE) & returns(sizes) & (size[1:-1] > NO_BODY * finite.std())
    places = np.flatnonzero(is_spike) + 1
    return count_apart(places[are_isolated(bend, places)])


def are_isolated(bends: Real, places: Indices) -> Booleans:
    """Return whether the bends at places are far above all around them: what rings after an impact is no spike.

    Parameters
    ----------
    bends
        Distances of samples from the mean of their neighbours, shape (samples,).
    places
        Indices of bends, shape (places,).
    """
    reach, sizes = _LIMITS.around, np.abs(bends)
    largest = [
        max(
            sizes[max(0, place - reach) : place - 1].max(initial=0.0),
            sizes[place + 2 : place + reach + 1].max(initial=0.0),
        )
        for place in places.tolist()
    ]
    return np.asarray(np.array(largest) < _LIMITS.isolated * sizes[places])


def filler(values: Real) -> tuple[float, int] | None:
    """Return a value far outside all others that repeats exactly, and the number of its samples; None without one.

    Parameters
    ----------
    values
        Samples of one channel, shape (samples,); missing ones are passed over.
    """
    finite = values[np.isfinite(values)]
    if finite.size == 0:
        return None
    for extreme in (float(finite.min()), float(finite.max())):
        rest = finite[finite != extreme]
        count = finite.size - rest.size
        if count < _LIMITS.min_fillers or rest.size < finite.size / 2:
            continue
        distance = np.abs(rest - extreme).min()
        if distance > _LIMITS.far * np.ptp(rest) and distance > 0:
            return extreme, count
    return None


def repeated_samples(values: Real, sampling_rate: float) -> int:
    """Return the number of samples in stretches of half a second or more that are exact copies of earlier ones.

    Parameters
    ----------
    values
        Samples of one channel, shape (samples,).
    sampling_rate
        Sampling rate [Hz].

    Notes
    -----
    Windows are compared by a polynomial hash, H(i) = p^-i (S(i + n) - S(i)), S(i) the sum of x(k) p^k modulo 2^64 over
    the bits x of the samples before i. Stretches that hardly change do not count, nor does a periodic signal.

    References
    ----------
    R. M. Karp, M. O. Rabin (1987), Efficient randomized pattern-matching algorithms, IBM Journal of Research and
    Development 31, 249-260.
    """
    n = max(_LIMITS.repeated_samples, round(_LIMITS.repeated_duration * sampling_rate))
    if values.size < 2 * n:
        return 0
    bits = np.ascontiguousarray(values + 0.0).view(np.uint64) * _FACTOR
    bits ^= bits >> np.uint64(29)
    powers = _powers(_FACTOR, values.size)
    sums = np.concatenate([np.zeros(1, dtype=np.uint64), np.cumsum(bits * powers, dtype=np.uint64)])
    hashes = (sums[n:] - sums[:-n]) * _powers(np.uint64(pow(int(_FACTOR), -1, 2**64)), sums.size - n)
    ordered = np.sort(hashes)  # whether any occurs twice, in a fraction of the time of finding which
    if not np.any(ordered[1:] == ordered[:-1]):
        return 0
    _, first, inverse = np.unique(hashes, return_index=True, return_inverse=True)
    changes = np.concatenate([[0], np.cumsum(np.diff(values) != 0)])
    is_lively = changes[n - 1 :] - changes[: changes.size - n + 1] >= _LIMITS.changing * (n - 1)
    copies = np.flatnonzero((first[inverse] + n <= np.arange(hashes.size)) & is_lively)
    if not copies.size or np.unique(values[copies[0] : copies[0] + n]).size < _LIMITS.min_values:
        return 0
    edges = np.zeros(values.size + 1, dtype=np.intp)
    np.add.at(edges, copies, 1)
    np.add.at(edges, copies + n, -1)
    count = int(np.count_nonzero(np.cumsum(edges)[:-1]))
    return count if count < _LIMITS.periodic * values.size else 0


def _powers(factor: np.uint64, count: int) -> np.ndarray[tuple[int], np.dtype[np.uint64]]:
    """Return the powers of a factor modulo 2^64 from 0 on."""
    powers = np.full(count, factor, dtype=np.uint64)
    powers[0] = 1
    return np.cumprod(powers, dtype=np.uint64)
