"""Facts about a recording: levels, dead, clipped and stuck channels, gaps.

Dead, stuck, clipped and missing are defined here only; callers with other thresholds pass them as arguments.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from sprung._arrays import Indices, Real
from sprung._checks import check_type
from sprung._display import Savable, Tabular, counted, in_short, listed
from sprung.errors import DataError
from sprung.recording import Channel, Recording

#: Quantities that are conditions of the motion, not motion: they may stay at a value, even at their highest one.
CONDITIONS = ("speed", "temperature", "pressure")
#: Smallest number of consecutive samples at the largest or smallest value that counts as a plateau of clipping.
_PLATEAU = 3
#: Share of the samples in plateaus above which a channel is called clipped.
_CLIPPED_SHARE = 1e-4
#: Shortest duration [s] and smallest number of samples of a run of equal values that counts as stuck.
_STUCK_DURATION, _STUCK_RUN = 1.0, 10


@dataclass(frozen=True, slots=True)
class ChannelFacts:
    """Facts about one channel.

    Parameters
    ----------
    name, quantity, unit
        Name, quantity and unit as in the recording; the levels below are in this unit.
    n_values
        Number of samples that are not missing.
    mean, rms, standard_deviation, minimum, maximum
        Levels of the values; the RMS includes the mean. None without values.
    clipped
        Share of the values in plateaus of at least three samples at the maximum or minimum, 0 to 1; 0 for conditions
        such as the speed, which may stay at a value.
    stuck
        Share of the values in runs of one value for at least a second and ten samples, 0 to 1; 0 for conditions.
    """

    name: str
    quantity: str
    unit: str
    n_values: int
    mean: float | None
    rms: float | None
    standard_deviation: float | None
    minimum: float | None
    maximum: float | None
    clipped: float
    stuck: float

    @property
    def is_dead(self) -> bool:
        """Whether the channel holds no value, or measures motion and never changes."""
        if self.n_values == 0:
            return True
        return self.minimum == self.maximum and not is_condition(self.name, self.quantity)

    @property
    def is_clipped(self) -> bool:
        """Whether the channel is on plateaus at its limits for more than 0.01 % of its samples."""
        return not self.is_dead and self.clipped > _CLIPPED_SHARE

    @property
    def is_stuck(self) -> bool:
        """Whether the channel repeats one value for a second or longer."""
        return not self.is_dead and self.stuck > 0


@dataclass(frozen=True, slots=True)
class Inspection(Tabular, Savable):
    """Facts about a recording.

    Parameters
    ----------
    channels
        Facts about each channel.
    sampling_rate
        In Hz.
    n_samples, duration
        Number of samples of each channel, and recorded time without gaps [s].
    n_gaps, gap_duration
        Number of gaps and their total length [s].
    start
        Time of the first sample, UTC in nanoseconds since 1970; None where unknown.
    history
        One line for each processing step, jitter of the time stamps included.
    """

    channels: tuple[ChannelFacts, ...]
    sampling_rate: float
    n_samples: int
    duration: float
    n_gaps: int
    gap_duration: float
    start: int | None
    history: tuple[str, ...]

    def __repr__(self) -> str:
        """Return the size, and the channels with faults."""
        faults = listed(
            f"{facts.name} {'dead' if facts.is_dead else 'clipped' if facts.is_clipped else 'stuck'}"
            for facts in self.channels
            if facts.is_dead or facts.is_clipped or facts.is_stuck
        )
        size = f"{self.n_samples} samples at {self.sampling_rate:.8g} Hz, {counted(self.n_gaps, 'gap')}"
        head = f"Inspection: {counted(len(self.channels), 'channel')} of {size}"
        return in_short(head, f"faults: {faults}" if faults else "no dead, clipped or stuck channel")


def is_condition(name: str, quantity: str) -> bool:
    """Return whether a channel shows a condition of the motion (speed, temperature, pressure) and not motion itself.

    Parameters
    ----------
    name, quantity
        Name and quantity as in the recording. A channel of unknown quantity named "speed", in any case of letters,
        is the speed.
    """
    return quantity in CONDITIONS or (quantity == "unknown" and name.casefold() == "speed")


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
        In Hz.
    """
    starts, lengths = equal_runs(values, breaks=breaks)
    is_long = (lengths >= max(_STUCK_RUN, _STUCK_DURATION * sampling_rate)) & ~np.isnan(values[starts])
    return starts[is_long], lengths[is_long]


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
    at_minimum, at_maximum = _plateaus(values, breaks, minimum, maximum)
    return (at_maximum + (at_minimum if minimum < maximum else 0)) / finite.size


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
    finite = values[np.isfinite(values)]
    if finite.size == 0 or np.ptp(finite) > tolerance * np.abs(finite).max():
        return None
    return float(finite[0])


def inspect(recording: Recording) -> Inspection:
    """Return the facts about a recording.

    Parameters
    ----------
    recording
        Recording of any length, missing values as NaN.

    Returns
    -------
    Inspection
        Levels and faults of each channel, and gaps.

    Examples
    --------
    >>> samples = np.array([[0.0, 3.0, 3.0, 3.0, -1.0]])
    >>> facts = inspect(Recording(samples, 100.0, (Channel("acc_fl", "acceleration"),)))
    >>> facts.channels[0].maximum, facts.channels[0].clipped
    (3.0, 0.6)
    """
    check_type("recording", recording, Recording)
    return inspect_blocks([recording])


def inspect_blocks(blocks: Iterable[Recording]) -> Inspection:
    """Return the facts about a recording from its blocks, in bounded memory.

    Runs of equal samples are counted within each block.

    Raises
    ------
    DataError
        If there are no blocks.
    """
    total: Inspection | None = None
    tallies: list[_Tally] = []
    for block in blocks:
        added = [_tally(values, channel, block) for values, channel in zip(block.samples, block.channels, strict=True)]
        tallies = [_merged(*pair) for pair in zip(tallies, added, strict=True)] if tallies else added
        total = _extended(total, block)
    if total is None:
        raise DataError("there is nothing to inspect: the recording has no blocks")
    facts = zip(block.channels, tallies, strict=True)
    return replace(total, channels=tuple(_facts(channel, tally) for channel, tally in facts))


def _extended(total: Inspection | None, block: Recording) -> Inspection:
    """Return the facts about all channels together, with `block` added."""
    gap_duration = sum(gap.duration for gap in block.gaps)
    if total is None:
        return Inspection(
            channels=(),
            sampling_rate=block.sampling_rate,
            n_samples=block.n_samples,
            duration=block.duration,
            n_gaps=len(block.gaps),
            gap_duration=gap_duration,
            start=block.start,
            history=block.history,
        )
    return replace(
        total,
        n_samples=total.n_samples + block.n_samples,
        duration=total.duration + block.duration,
        n_gaps=total.n_gaps + len(block.gaps),
        gap_duration=total.gap_duration + gap_duration,
        history=(*total.history, *(line for line in block.history if line not in total.history)),
    )


@dataclass(frozen=True, slots=True)
class _Tally:
    """Sums over the values of a channel; those at its extremes and in long runs are counted."""

    n_values: int = 0
    mean: float = 0.0
    squares: float = 0.0
    minimum: float = np.inf
    maximum: float = -np.inf
    n_at_minimum: int = 0
    n_at_maximum: int = 0
    n_stuck: int = 0


def _tally(samples: Real, channel: Channel, block: Recording) -> _Tally:
    """Return the sums over one channel of a block."""
    values = samples[~np.isnan(samples)]
    if values.size == 0:
        return _Tally()
    mean, minimum, maximum = float(values.mean()), float(values.min()), float(values.max())
    levels = _Tally(values.size, mean, float(np.sum((values - mean) ** 2)), minimum, maximum)
    if is_condition(channel.name, channel.quantity):
        return levels
    breaks = [gap.index for gap in block.gaps]
    n_at_minimum, n_at_maximum = _plateaus(samples, breaks, minimum, maximum)
    n_stuck = int(stuck_runs(samples, block.sampling_rate, breaks=breaks)[1].sum())
    return replace(levels, n_at_minimum=n_at_minimum, n_at_maximum=n_at_maximum, n_stuck=n_stuck)


def _plateaus(values: Real, breaks: Sequence[int], minimum: float, maximum: float) -> tuple[int, int]:
    """Return the number of samples in plateaus at the minimum and at the maximum."""
    starts, lengths = equal_runs(values, breaks=breaks)
    heads, is_plateau = values[starts], lengths >= _PLATEAU
    return int(lengths[is_plateau & (heads == minimum)].sum()), int(lengths[is_plateau & (heads == maximum)].sum())


def _merged(first: _Tally, second: _Tally) -> _Tally:
    """Return the sums over both (means and squares after Chan, Golub and LeVeque, 1983)."""
    n_values = first.n_values + second.n_values
    if n_values == 0:
        return first
    shift = second.mean - first.mean
    minimum, maximum = min(first.minimum, second.minimum), max(first.maximum, second.maximum)
    both = (first, second)
    return _Tally(
        n_values=n_values,
        mean=first.mean + shift * second.n_values / n_values,
        squares=first.squares + second.squares + shift**2 * first.n_values * second.n_values / n_values,
        minimum=minimum,
        maximum=maximum,
        n_at_minimum=sum(tally.n_at_minimum for tally in both if tally.minimum == minimum),
        n_at_maximum=sum(tally.n_at_maximum for tally in both if tally.maximum == maximum),
        n_stuck=first.n_stuck + second.n_stuck,
    )


def _facts(channel: Channel, tally: _Tally) -> ChannelFacts:
    """Return the facts that the sums over a channel give."""
    if tally.n_values == 0:
        levels: dict[str, Any] = dict.fromkeys(("mean", "rms", "standard_deviation", "minimum", "maximum"))
    else:
        variance = tally.squares / tally.n_values
        levels = {
            "mean": tally.mean,
            "rms": float(np.sqrt(variance + tally.mean**2)),
            "standard_deviation": float(np.sqrt(variance)),
            "minimum": tally.minimum,
            "maximum": tally.maximum,
        }
    n_clipped = tally.n_at_maximum + (tally.n_at_minimum if tally.minimum < tally.maximum else 0)
    return ChannelFacts(
        name=channel.name,
        quantity=channel.quantity,
        unit=channel.unit,
        n_values=tally.n_values,
        **levels,
        clipped=n_clipped / max(1, tally.n_values),
        stuck=tally.n_stuck / max(1, tally.n_values),
    )
