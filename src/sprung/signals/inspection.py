"""Facts about a recording: levels and faults of its channels, gaps; doubts about its units and clock."""

import re
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from sprung._arrays import Booleans, Real
from sprung._checks import check_type
from sprung._display import Savable, Tabular, counted, in_short, listed
from sprung.errors import DataError
from sprung.recording import Channel, Recording
from sprung.signals import data_faults
from sprung.units import STANDARD_GRAVITY


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
    missing
        Share of the samples that are missing, 0 to 1.
    clipped
        Share of the values in plateaus of at least three samples at the maximum or minimum, 0 to 1; 0 for conditions
        such as the speed, which may stay at a value.
    stuck
        Share of the values in runs of one value for at least a second and ten samples, 0 to 1, while the vehicle moves
        if the recording has its speed; 0 for conditions.
    is_dead
        Whether the channel holds no value, none in more than half of its samples, or measures motion and never changes.
    is_intermittent, is_stuck
        Whether the channel rests at 0, or at another value, for 2 % of the time, or for 1 % and two seconds at a
        stretch.
    is_clipped
        Whether the channel is on plateaus at its limits for more than 0.03 % of its samples.
    filler
        Value far outside all others that repeats exactly; None without one.
    fillers, repeated
        Shares of the samples with that value, and in stretches of half a second or more that are exact copies of
        earlier ones, 0 to 1.
    n_spikes
        Number of single-sample spikes: jumps and returns that are too large for the motion of any body.
    reason
        Why the channel takes no part in the recording, or some of its values do not; empty where all do.
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
    missing: float
    clipped: float
    stuck: float
    is_dead: bool
    is_intermittent: bool
    is_stuck: bool
    is_clipped: bool
    filler: float | None
    fillers: float
    repeated: float
    n_spikes: int
    reason: str = ""

    @property
    def faults(self) -> tuple[str, ...]:
        """Kinds of faults: dead, half-dead, stuck, clipped, spiking, filled, repeating."""
        kinds = {
            "dead": self.is_dead,
            "half-dead": self.is_intermittent,
            "stuck": self.is_stuck,
            "clipped": self.is_clipped,
            "spiking": self.n_spikes >= data_faults.FEWEST_SPIKES,
            "filled": self.fillers > 0,
            "repeating": self.repeated > 0,
        }
        return tuple(kind for kind, is_present in kinds.items() if is_present)


@dataclass(frozen=True, slots=True)
class Inspection(Tabular, Savable):
    """Facts about a recording.

    Parameters
    ----------
    channels
        Facts about each channel.
    sampling_rate
        Sampling rate [Hz].
    n_samples, duration
        Number of samples of each channel, and recorded time without gaps [s].
    n_gaps, gap_duration
        Number of gaps and their total length [s].
    start
        Time of the first sample, UTC in nanoseconds since 1970; None where unknown.
    history
        One line for each processing step, jitter of the time stamps included.
    group
        Group of the file, where its groups have clocks of their own; None otherwise.
    """

    channels: tuple[ChannelFacts, ...]
    sampling_rate: float
    n_samples: int
    duration: float
    n_gaps: int
    gap_duration: float
    start: int | None
    history: tuple[str, ...]
    group: str | None = None

    def __repr__(self) -> str:
        """Return the size, and the channels with faults."""
        faults = listed(f"{facts.name} {' and '.join(facts.faults)}" for facts in self.channels if facts.faults)
        size = f"{self.n_samples} samples at {self.sampling_rate:.8g} Hz, {counted(self.n_gaps, 'gap')}"
        head = f"Inspection: {counted(len(self.channels), 'channel')} of {size}"
        return in_short(head, f"faults: {faults}" if faults else "no faults of channels")


def inspect(recording: Recording, *, counts_odd_samples: bool = True) -> Inspection:
    """Return the facts about a recording.

    Parameters
    ----------
    recording
        Recording of any length, missing values as NaN.
    counts_odd_samples
        Whether spikes and copied stretches are counted, which takes most of the time; False: as if there were none.

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
    return inspect_blocks([recording], counts_odd_samples=counts_odd_samples)


def inspect_blocks(blocks: Iterable[Recording], *, counts_odd_samples: bool = True) -> Inspection:
    """Return the facts about a recording from its blocks, in bounded memory; parameters as `inspect`.

    Runs of equal samples are counted within each block.

    Raises
    ------
    DataError
        If there are no blocks.
    """
    total: Inspection | None = None
    tallies: list[_Tally] = []
    for block in blocks:
        is_moving = data_faults.moving_samples(block)
        rows = zip(block.samples, block.channels, strict=True)
        added = [_tally(values, channel, block, is_moving, counts_odd_samples) for values, channel in rows]
        tallies = [_merged(*pair) for pair in zip(tallies, added, strict=True)] if tallies else added
        total = _extended(total, block)
    if total is None:
        raise DataError("there is nothing to inspect: the recording has no blocks")
    facts = zip(block.channels, tallies, strict=True)
    return replace(total, channels=tuple(_facts(channel, tally, total.sampling_rate) for channel, tally in facts))


def facts_without_values(name: str, reason: str) -> ChannelFacts:
    """Return the row of a channel that cannot be read, with the reason."""
    return replace(_facts(Channel(name), _Tally(), 1.0), missing=0.0, is_dead=False, reason=reason)


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
    """Sums over the values of a channel; those at its extremes, in long runs and with other faults are counted."""

    n_samples: int = 0
    n_values: int = 0
    mean: float = 0.0
    squares: float = 0.0
    minimum: float = np.inf
    maximum: float = -np.inf
    n_at_minimum: int = 0
    n_at_maximum: int = 0
    rest: data_faults.Rest = field(default_factory=data_faults.Rest)
    rest_moving: data_faults.Rest = field(default_factory=data_faults.Rest)
    filler: float | None = None
    n_fillers: int = 0
    n_repeated: int = 0
    n_spikes: int = 0


def _tally(samples: Real, channel: Channel, block: Recording, is_moving: Booleans, counts_odd_samples: bool) -> _Tally:
    """Return the sums over one channel of a block."""
    values = samples[~np.isnan(samples)]
    if values.size == 0:
        return _Tally(samples.size)
    mean, minimum, maximum = float(values.mean()), float(values.min()), float(values.max())
    levels = _Tally(samples.size, values.size, mean, float(np.sum((values - mean) ** 2)), minimum, maximum)
    found = data_faults.filler(samples) or (None, 0)
    levels = replace(levels, filler=found[0], n_fillers=found[1])
    if data_faults.is_condition(channel.name, channel.quantity):
        return levels
    breaks = [gap.index for gap in block.gaps]
    n_at_minimum, n_at_maximum = data_faults.plateaus(samples, minimum, maximum, breaks=breaks)
    return replace(
        levels,
        n_at_minimum=n_at_minimum,
        n_at_maximum=n_at_maximum,
        rest=data_faults.rest_of(samples, block.sampling_rate, breaks=breaks),
        rest_moving=data_faults.rest_of(samples, block.sampling_rate, breaks=breaks, is_moving=is_moving),
        n_repeated=data_faults.repeated_samples(samples, block.sampling_rate) if counts_odd_samples else 0,
        n_spikes=data_faults.count_spikes(samples) if counts_odd_samples else 0,
    )


def _merged(first: _Tally, second: _Tally) -> _Tally:
    """Return the sums over both (means and squares after Chan, Golub and LeVeque, 1983)."""
    n_values = first.n_values + second.n_values
    n_samples = first.n_samples + second.n_samples
    if n_values == 0:
        return replace(first, n_samples=n_samples)
    shift = second.mean - first.mean
    minimum, maximum = min(first.minimum, second.minimum), max(first.maximum, second.maximum)
    both = (first, second)
    return _Tally(
        n_samples=n_samples,
        n_values=n_values,
        mean=first.mean + shift * second.n_values / n_values,
        squares=first.squares + second.squares + shift**2 * first.n_values * second.n_values / n_values,
        minimum=minimum,
        maximum=maximum,
        n_at_minimum=sum(tally.n_at_minimum for tally in both if tally.minimum == minimum),
        n_at_maximum=sum(tally.n_at_maximum for tally in both if tally.maximum == maximum),
        rest=_longer(first.rest, second.rest),
        rest_moving=_longer(first.rest_moving, second.rest_moving),
        filler=first.filler if first.n_fillers >= second.n_fillers else second.filler,
        n_fillers=first.n_fillers + second.n_fillers,
        n_repeated=first.n_repeated + second.n_repeated,
        n_spikes=first.n_spikes + second.n_spikes,
    )


def _longer(first: data_faults.Rest, second: data_faults.Rest) -> data_faults.Rest:
    """Return the runs of both, with the value of the longest."""
    longer = first if first.longest >= second.longest else second
    return replace(longer, n_values=first.n_values + second.n_values, n_resting=first.n_resting + second.n_resting)


def _facts(channel: Channel, tally: _Tally, sampling_rate: float) -> ChannelFacts:
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
    missing = 1 - tally.n_values / max(1, tally.n_samples)
    is_constant = tally.maximum - tally.minimum <= data_faults.ROUNDING * max(abs(tally.maximum), abs(tally.minimum))
    is_constant &= not data_faults.is_condition(channel.name, channel.quantity)
    is_dead = tally.n_values == 0 or missing > data_faults.DEAD_SHARE or is_constant
    rest = tally.rest_moving if tally.rest_moving.n_values else tally.rest
    is_resting = not is_dead and rest.is_fault(sampling_rate)
    is_at_zero = is_resting and rest.is_at_zero(levels["standard_deviation"])
    n_clipped = tally.n_at_maximum + (tally.n_at_minimum if tally.minimum < tally.maximum else 0)
    clipped = n_clipped / max(1, tally.n_values)
    return ChannelFacts(
        name=channel.name,
        quantity=channel.quantity,
        unit=channel.unit,
        n_values=tally.n_values,
        **levels,
        missing=missing,
        clipped=clipped,
        stuck=rest.share,
        is_dead=is_dead,
        is_intermittent=is_at_zero,
        is_stuck=is_resting and not is_at_zero,
        is_clipped=not is_dead and clipped > data_faults.CLIPPED_SHARE,
        filler=tally.filler,
        fillers=tally.n_fillers / max(1, tally.n_samples),
        repeated=tally.n_repeated / max(1, tally.n_samples),
        n_spikes=tally.n_spikes,
    )


@dataclass(frozen=True, slots=True)
class PlausibleLevels:
    """Levels beyond which a unit or a clock is doubted."""

    #: Highest sampling rate of vehicles and structures [Hz]; above, a clock in s may be stated in ms.
    rate: float = 20e3
    #: Shortest duration of a record [s] that is sampled faster.
    shortest: float = 2.0
    #: Largest resting acceleration [m/s^2], and relative tolerance of gravity in a wrong unit.
    resting: float = 1.6 * STANDARD_GRAVITY
    gravity: float = 0.08
    #: Standard deviation of accelerations [m/s^2], beyond wheels under impacts, and of angular velocities [rad/s].
    acceleration: float = 500.0
    angular_velocity: float = 6.0
    #: Number of samples from which a recording is judged.
    samples: int = 5000
    #: Largest speed [m/s], and travel of a displacement sensor [m].
    speed: float = 110.0
    travel: float = 2.0


LEVELS = PlausibleLevels()
#: Units that gravity is taken for, by its value over that in m/s^2.
_WRONG_UNITS = {1000.0: "mg", STANDARD_GRAVITY: "m/s^2", 1 / STANDARD_GRAVITY: "g"}
#: Displacements that are no travel of a suspension.
_PLACES = re.compile(r"alt|height|elev|lat|lon|north|east|odo|dist|mileage|pos", re.IGNORECASE)


def doubts(inspection: Inspection) -> tuple[str, ...]:
    """Return doubts about the clock and the units of a recording, one sentence each with the likely cause.

    Parameters
    ----------
    inspection
        Facts about the recording; levels in SI units.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> from sprung.signals.inspection import inspect
    >>> resting = Recording(np.full((1, 1000), 9806.65), 100.0, (Channel("acc_z", "acceleration"),))
    >>> doubts(inspect(resting))
    ('acc_z rests at 9.81e+03 m/s^2, 1,000 times gravity: is its unit mg?',)
    """
    known = [facts for facts in inspection.channels if facts.mean is not None]
    resting = _of_gravity([facts for facts in known if facts.quantity == "acceleration"])
    moving = [facts for facts in known if not resting or facts.quantity != "acceleration"]
    return (*_of_clock(inspection), *resting, *(words for facts in moving for words in _of_level(facts)))


def doubts_of(recording: Recording) -> tuple[str, ...]:
    """Return the doubts about a recording, from a part of its samples."""
    step = max(1, recording.n_samples // LEVELS.samples)
    thinned = replace(recording, samples=recording.samples[:, ::step], gaps=())
    facts = inspect(thinned, counts_odd_samples=False)
    return doubts(replace(facts, sampling_rate=recording.sampling_rate, duration=recording.duration))


def _of_clock(inspection: Inspection) -> tuple[str, ...]:
    """Return a doubt about the unit of the time."""
    rate, duration = inspection.sampling_rate, inspection.duration
    is_in_ms = any(re.match(r"time: column .*\b(ms|msec|millis)", line) for line in inspection.history)
    if is_in_ms and rate > LEVELS.rate and duration < LEVELS.shortest:
        return (f"{duration:.3g} s at {rate:.6g} Hz: is the time in s, not in ms? State it with --time-unit",)
    return ()


def _of_gravity(accelerations: Sequence[ChannelFacts]) -> tuple[str, ...]:
    """Return doubts about accelerations whose resting value is gravity in another unit, or far beyond it.

    Three channels whose names differ by x, y and z are the axes of one sensor. Gravity in g is asked of those only: one
    channel reads 1 m/s^2 where it leans by 6 degrees.
    """
    found = []
    letters = [set(each) for each in zip(*(facts.name.lower() for facts in accelerations), strict=False)]
    are_axes = len(accelerations) == 3 and [each for each in letters if len(each) > 1] == [{"x", "y", "z"}]
    for group in [accelerations] if are_axes else [[facts] for facts in accelerations]:
        resting = float(np.linalg.norm([facts.mean or 0.0 for facts in group]))
        moving = max((facts.standard_deviation or 0.0 for facts in group), default=0.0)
        names = (
            " and ".join(facts.name for facts in group) if len(group) < 3 else f"{group[0].name} to {group[-1].name}"
        )
        verb = "rests" if len(group) == 1 else "rest together"
        causes = [
            (ratio, unit)
            for ratio, unit in _WRONG_UNITS.items()
            if abs(resting / (ratio * STANDARD_GRAVITY) - 1) < LEVELS.gravity
            and moving < 3 * resting
            and (ratio > 1 or are_axes)
        ]
        for ratio, unit in causes:
            of_gravity = f"{ratio:,.4g} times gravity" if ratio > 1 else "as gravity in g"
            words = "are their units" if len(group) > 1 else "is its unit"
            found.append(f"{names} {verb} at {resting:.3g} m/s^2, {of_gravity}: {words} {unit}?")
        if not causes and resting > LEVELS.resting:
            found.append(f"{names} {verb} at {resting:.3g} m/s^2, more than gravity: check unit and offset")
    return tuple(found)


def _of_level(facts: ChannelFacts) -> tuple[str, ...]:
    """Return a doubt about the unit of one channel by its motion."""
    moving = facts.standard_deviation or 0.0
    lowest, highest = facts.minimum or 0.0, facts.maximum or 0.0
    match facts.quantity:
        case "acceleration" if moving > LEVELS.acceleration:
            return (
                f"{facts.name} has a standard deviation of {moving:.3g} m/s^2: no vehicle moves so, check its unit",
            )
        case "angular_velocity" if moving > LEVELS.angular_velocity:
            return (f"{facts.name} has a standard deviation of {moving:.3g} rad/s: is its unit deg/s?",)
        case "speed" if highest > LEVELS.speed:
            return (f"{facts.name} reaches {highest:.3g} m/s: is its unit km/h?",)
        case "displacement" if highest - lowest > LEVELS.travel and not _PLACES.search(facts.name):
            return (f"{facts.name} travels {highest - lowest:.3g} m: is its unit mm?",)
        case _:
            return ()
