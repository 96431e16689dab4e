"""Facts about a recording: levels, dead, clipped and stuck channels, gaps."""

from collections.abc import Iterable
from dataclasses import asdict, dataclass, replace
from typing import Any

import numpy as np

from sprung._arrays import Indices, Real
from sprung.errors import DataError
from sprung.recording import Channel, Recording

# So many equal samples in a row at the largest or smallest value are a plateau of clipping.
_PLATEAU = 3
# A channel is called clipped from this share of its samples on, and stuck from this duration [s] and run on.
_CLIPPED_SHARE = 1e-4
_STUCK_DURATION = 1.0
_STUCK_RUN = 10


@dataclass(frozen=True, slots=True)
class ChannelFacts:
    """Facts about one channel.

    Parameters
    ----------
    name, quantity, unit
        As in the recording; the levels below are in this unit.
    n_values
        Number of samples that are not missing.
    mean, rms, standard_deviation, minimum, maximum
        Of these values; the RMS includes the mean. None where there is no value.
    clipped
        Share of the values in plateaus of at least three samples at the maximum or minimum, 0 to 1.
    stuck
        Share of the values in runs of one value for at least a second and ten samples, 0 to 1.
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
        """Whether the channel never changes or holds no value."""
        return self.minimum == self.maximum

    @property
    def is_clipped(self) -> bool:
        """Whether the channel spends more than 0.01 % of its time on plateaus at its limits."""
        return not self.is_dead and self.clipped > _CLIPPED_SHARE

    @property
    def is_stuck(self) -> bool:
        """Whether the channel repeats one value for a second or longer."""
        return not self.is_dead and self.stuck > 0


@dataclass(frozen=True, slots=True)
class Inspection:
    """Facts about a recording.

    Parameters
    ----------
    channels
        Facts about each channel.
    sampling_rate
        In Hz.
    n_samples, duration
        Samples of each channel, and recorded time without gaps [s].
    n_gaps, gap_duration
        Number of gaps and their total length [s].
    start
        Time of the first sample, UTC in nanoseconds since 1970; None where unknown.
    history
        What was done to the samples; jitter of the time stamps is told here.
    """

    channels: tuple[ChannelFacts, ...]
    sampling_rate: float
    n_samples: int
    duration: float
    n_gaps: int
    gap_duration: float
    start: int | None
    history: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """Return the facts as plain values for JSON."""
        facts = asdict(self)
        for plain, channel in zip(facts["channels"], self.channels, strict=True):
            plain.update(is_dead=channel.is_dead, is_clipped=channel.is_clipped, is_stuck=channel.is_stuck)
        return facts


def inspect(recording: Recording) -> Inspection:
    """Return the facts about a recording.

    Parameters
    ----------
    recording
        Of any length, missing values as NaN.

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
    return inspect_blocks([recording])


def inspect_blocks(blocks: Iterable[Recording]) -> Inspection:
    """Return the facts about a recording that comes in blocks, in bounded memory.

    Runs of equal samples are counted within each block.

    Raises
    ------
    DataError
        Where there is no block.
    """
    total: Inspection | None = None
    tallies: list[_Tally] = []
    for block in blocks:
        added = [_tally(values, block) for values in block.samples]
        tallies = [_merged(*pair) for pair in zip(tallies, added, strict=True)] if tallies else added
        total = _extended(total, block)
    if total is None:
        raise DataError("there is nothing to inspect: the recording has no blocks")
    facts = zip(block.channels, tallies, strict=True)
    return replace(total, channels=tuple(_facts(channel, tally) for channel, tally in facts))


def _extended(total: Inspection | None, block: Recording) -> Inspection:
    """Return what concerns all channels, with `block` added."""
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


def _tally(samples: Real, block: Recording) -> _Tally:
    """Return the sums over one channel of a block."""
    values = samples[~np.isnan(samples)]
    if values.size == 0:
        return _Tally()
    mean, minimum, maximum = values.mean(), values.min(), values.max()
    starts, lengths = _runs(samples, block)
    heads = samples[starts]
    is_plateau = lengths >= _PLATEAU
    is_stuck = lengths >= max(_STUCK_RUN, _STUCK_DURATION * block.sampling_rate)
    return _Tally(
        n_values=values.size,
        mean=float(mean),
        squares=float(np.sum((values - mean) ** 2)),
        minimum=float(minimum),
        maximum=float(maximum),
        n_at_minimum=int(lengths[is_plateau & (heads == minimum)].sum()),
        n_at_maximum=int(lengths[is_plateau & (heads == maximum)].sum()),
        n_stuck=int(lengths[is_stuck & ~np.isnan(heads)].sum()),
    )


def _runs(samples: Real, block: Recording) -> tuple[Indices, Indices]:
    """Return start and length of every run of equal samples; a gap ends a run."""
    is_start = np.ones(samples.size, dtype=bool)
    is_start[1:] = np.diff(samples) != 0
    is_start[[gap.index for gap in block.gaps]] = True
    starts = np.flatnonzero(is_start)
    return starts, np.diff(starts, append=samples.size)


def _merged(one: _Tally, other: _Tally) -> _Tally:
    """Return the sums over both (means and squares after Chan, Golub and LeVeque, 1983)."""
    n_values = one.n_values + other.n_values
    if n_values == 0:
        return one
    shift = other.mean - one.mean
    minimum, maximum = min(one.minimum, other.minimum), max(one.maximum, other.maximum)
    both = (one, other)
    return _Tally(
        n_values=n_values,
        mean=one.mean + shift * other.n_values / n_values,
        squares=one.squares + other.squares + shift**2 * one.n_values * other.n_values / n_values,
        minimum=minimum,
        maximum=maximum,
        n_at_minimum=sum(tally.n_at_minimum for tally in both if tally.minimum == minimum),
        n_at_maximum=sum(tally.n_at_maximum for tally in both if tally.maximum == maximum),
        n_stuck=one.n_stuck + other.n_stuck,
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
