"""Speed over time, of a vehicle or of the rotation of a roller."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sprung._arrays import Real
from sprung._checks import check_number, freeze
from sprung.errors import ParameterError

#: Range of the durations of standstill [s].
_STANDING = (5.0, 15.0)


@dataclass(frozen=True, eq=False, slots=True)
class SpeedProfile:
    """Speed that is linear between knots and constant before the first and after the last.

    Parameters
    ----------
    times
        Times of the knots, rising, shape (knots,) [s].
    speeds
        Speeds at the knots, at least 0, shape (knots,) [m/s, or revolutions per second].

    Raises
    ------
    ParameterError
        If times do not rise or a speed is negative.
    """

    times: Real
    speeds: Real

    def __post_init__(self) -> None:
        freeze(self, times=1, speeds=1)
        if self.times.size == 0 or self.times.shape != self.speeds.shape or np.any(np.diff(self.times) <= 0):
            raise ParameterError(
                f"times of a speed profile must rise, one for each of {self.speeds.size} speeds: correct them"
            )
        if not np.all(np.isfinite(self.speeds)) or np.any(self.speeds < 0):
            raise ParameterError("speeds of a speed profile must be finite and at least 0: vehicles drive forward only")

    def speed(self, time: ArrayLike) -> Real:
        """Return the speed at times [s]."""
        return np.interp(np.asarray(time), self.times, self.speeds)

    def distance(self, time: ArrayLike) -> Real:
        """Return the distance travelled since time 0 [m], the exact integral of the speed; negative before.

        Examples
        --------
        >>> SpeedProfile([0.0, 10.0], [0.0, 20.0]).distance([5.0, 10.0, 11.0]).tolist()
        [25.0, 100.0, 120.0]
        """
        return self._since_first(time) - self._since_first(0.0)

    def _since_first(self, time: ArrayLike) -> Real:
        """Return the distance travelled since the first knot."""
        t = np.asarray(time, dtype=np.float64)
        steps = np.diff(self.times) * (self.speeds[1:] + self.speeds[:-1]) / 2
        passed = np.concatenate([[0.0], np.cumsum(steps)])
        knot = np.clip(np.searchsorted(self.times, t, side="right") - 1, 0, None)
        return passed[knot] + (t - self.times[knot]) * (self.speed(t) + self.speeds[knot]) / 2


def constant_speed(speed: float) -> SpeedProfile:
    """Return a constant speed profile.

    Raises
    ------
    ParameterError
        If the speed is negative or not finite.

    Examples
    --------
    >>> constant_speed(20.0).distance([0.0, 5.0]).tolist()
    [0.0, 100.0]
    """
    check_number("speed", speed, at_least=0)
    return SpeedProfile(np.zeros(1), np.array([speed]))


@dataclass(frozen=True, slots=True)
class SpeedChanges:
    """Ranges from which the changes of a random speed are drawn.

    Parameters
    ----------
    accelerating, braking
        Smallest and largest acceleration and deceleration [m/s^2], above 0.
    steady
        Shortest and longest stretch of steady speed [s], above 0.

    Raises
    ------
    ParameterError
        If a range is empty or not above 0.
    """

    accelerating: tuple[float, float] = (0.4, 1.5)
    braking: tuple[float, float] = (0.4, 1.5)
    steady: tuple[float, float] = (8.0, 40.0)

    def __post_init__(self) -> None:
        for name in ("accelerating", "braking", "steady"):
            low, high = getattr(self, name)
            check_number(f"smallest {name}", low, above=0)
            check_number(f"largest {name}", high, at_least=low)


def random_speed(
    duration: float,
    *,
    low: float,
    high: float,
    n_stops: int = 0,
    generator: np.random.Generator,
    changes: SpeedChanges | None = None,
) -> SpeedProfile:
    """Return the random speed of a drive: stretches of steady speed, changes between them, stops.

    Parameters
    ----------
    duration
        Duration of the drive [s]; the last stretch extends beyond it.
    low, high
        Range of the steady speeds [m/s].
    n_stops
        Number of stops, spread over the drive; a drive that is too short has fewer.
    generator
        Source of the randomness.
    changes
        Ranges of accelerations, decelerations and steady stretches; None: those of a calm drive.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> speed = random_speed(300.0, low=10.0, high=30.0, n_stops=1, generator=np.random.default_rng(1))
    >>> time = np.linspace(0.0, 300.0, 3001)
    >>> bool(speed.speed(time).max() <= 30.0), float(speed.speed(time).min())
    (True, 0.0)
    """
    changes = changes or SpeedChanges()
    check_number("duration", duration, above=0)
    check_number("lowest speed", low, above=0)
    check_number("highest speed", high, at_least=low)
    stops = list(np.sort(generator.uniform(0.1, 0.9, size=n_stops)) * duration)
    times, speeds = [0.0], [float(generator.uniform(low, high))]
    while times[-1] < duration:
        is_stop = bool(stops) and times[-1] > stops[0] and speeds[-1] > 0
        if is_stop:
            stops.pop(0)
        held = generator.uniform(*(_STANDING if speeds[-1] == 0 else changes.steady))
        wanted = 0.0 if is_stop else float(generator.uniform(low, high))
        rate = generator.uniform(*(changes.braking if wanted < speeds[-1] else changes.accelerating))
        change = max(abs(wanted - speeds[-1]) / rate, 0.1)
        times += [times[-1] + held, times[-1] + held + change]
        speeds += [speeds[-1], wanted]
    return SpeedProfile(np.array(times), np.array(speeds))
