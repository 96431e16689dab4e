"""Doubts about units and clocks: levels that no vehicle and no structure has, with their likely causes."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from sprung.recording import Recording
from sprung.signals.inspection import ChannelFacts, Inspection, inspect
from sprung.units import STANDARD_GRAVITY


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
