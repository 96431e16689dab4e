"""Speed over time, and the route of a vehicle: its curves and cross slope, and how they accelerate its body."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sprung._arrays import Real
from sprung._checks import check_number, freeze
from sprung.errors import ParameterError
from sprung.excitation.noise import FunctionOfTime

#: Gravity [m/s^2].
GRAVITY = 9.81


@dataclass(frozen=True, slots=True)
class _Habits:
    """How drivers drive and roads are built: what random speeds and routes are drawn from."""

    jerk_time: float = 0.6  # in which an acceleration is built up [s]
    standing: tuple[float, float] = (5.0, 15.0)  # duration of a standstill [s]
    straight: tuple[float, float] = (5.0, 25.0)  # time between curves [s]
    curve: tuple[float, float] = (2.5, 8.0)  # time in a curve [s]
    slowest: float = 3.0  # speed of a curve [m/s]
    level: tuple[float, float] = (40.0, 150.0)  # distance between changes of the cross slope [m]
    transition: tuple[float, float] = (20.0, 40.0)  # length of these changes [m]


_HABITS = _Habits()


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
        held = generator.uniform(*(_HABITS.standing if speeds[-1] == 0 else changes.steady))
        wanted = 0.0 if is_stop else float(generator.uniform(low, high))
        rate = generator.uniform(*(changes.braking if wanted < speeds[-1] else changes.accelerating))
        change = max(abs(wanted - speeds[-1]) / rate, 0.1)
        times += [times[-1] + held, times[-1] + held + change]
        speeds += [speeds[-1], wanted]
    return SpeedProfile(np.array(times), np.array(speeds))


@dataclass(frozen=True, eq=False, slots=True)
class SmoothSteps:
    """Function that is constant but for smooth steps; 0 before the first.

    Parameters
    ----------
    knots
        Middles of the steps, rising, shape (steps,) [s or m].
    jumps
        Heights of the steps, shape (steps,).
    widths
        Lengths of the steps, above 0, shape (steps,) [s or m].

    Raises
    ------
    ParameterError
        If the arrays differ in shape, or a width is not above 0.

    Notes
    -----
    A step of width w at x0 rises as u + 1/2 + sin(2 pi u) / (2 pi) with u = (x - x0) / w between -1/2 and 1/2: a jump
    seen through a Hann window.
    """

    knots: Real
    jumps: Real
    widths: Real

    def __post_init__(self) -> None:
        freeze(self, knots=1, jumps=1, widths=1)
        if not self.knots.shape == self.jumps.shape == self.widths.shape or np.any(self.widths <= 0):
            raise ParameterError(
                f"{self.knots.size} knots need as many jumps and widths above 0, not {self.jumps.size} and "
                f"{self.widths.size}: correct them"
            )

    def __call__(self, position: ArrayLike) -> Real:
        """Return the values at rising positions, same shape."""
        x = np.asarray(position, dtype=np.float64)
        values = np.zeros(x.shape)
        for knot, jump, width in zip(self.knots, self.jumps, self.widths, strict=True):
            first, last = np.searchsorted(x, [knot - width / 2, knot + width / 2])
            u = (x[first:last] - knot) / width
            values[first:last] += jump * (u + 0.5 + np.sin(2 * np.pi * u) / (2 * np.pi))
            values[last:] += jump
        return values


#: A straight, or a level road.
NO_STEPS = SmoothSteps(np.zeros(0), np.zeros(0), np.zeros(0))


@dataclass(frozen=True, eq=False, slots=True)
class Route:
    """Speed over time, and curvature and cross slope over distance.

    Parameters
    ----------
    speed
        Speed over time [m/s].
    curvature
        Curvature of the path over distance [1/m], positive to the left.
    cross_slope
        Slope of the road over distance [rad], positive where its left side is higher.
    has_longitudinal
        Whether changes of the speed accelerate the body; without, they only move the vehicle along the road.
    """

    speed: SpeedProfile
    curvature: SmoothSteps = NO_STEPS
    cross_slope: SmoothSteps = NO_STEPS
    has_longitudinal: bool = False

    def longitudinal(self, time: ArrayLike) -> Real:
        """Return the longitudinal acceleration at rising times [m/s^2], positive forward; smooth over 0.6 s."""
        t = np.asarray(time, dtype=np.float64)
        knots, speeds = self.speed.times, self.speed.speeds
        if not self.has_longitudinal or knots.size < 2:
            return np.zeros(t.shape)
        slopes = np.concatenate([[0.0], np.diff(speeds) / np.diff(knots), [0.0]])
        return SmoothSteps(knots, np.diff(slopes), np.full(knots.size, _HABITS.jerk_time))(t)

    def lateral(self, time: ArrayLike) -> Real:
        """Return the lateral acceleration at rising times [m/s^2], positive to the left: curvature times speed^2."""
        return self.curvature(self.speed.distance(time)) * self.speed.speed(time) ** 2

    def yaw_rate(self, time: ArrayLike) -> Real:
        """Return the yaw rate at rising times [rad/s], positive to the left."""
        return self.curvature(self.speed.distance(time)) * self.speed.speed(time)


@dataclass(frozen=True, eq=False, slots=True)
class BodyAccelerations(FunctionOfTime):
    """Accelerations of a route that pitch and roll the body: longitudinal, and lateral with gravity's share on a slope.

    Parameters
    ----------
    route
        Speed, curves and cross slope.

    Notes
    -----
    Inputs: a_x, and a_y + g slope; on a slope the tyres hold the body as in a curve towards its higher side.
    """

    route: Route

    @property
    def n_inputs(self) -> int:
        """Number of inputs: longitudinal and lateral."""
        return 2

    def at(self, time: Real, generator: np.random.Generator) -> Real:
        """Return the accelerations at rising times [s], shape (2, times) [m/s^2]."""
        del generator  # a route is not random
        slope = self.route.cross_slope(self.route.speed.distance(time))
        return np.stack([self.route.longitudinal(time), self.route.lateral(time) + GRAVITY * slope])


@dataclass(frozen=True, eq=False, slots=True)
class CrossSlope(FunctionOfTime):
    """Height under each wheel of a road that slopes to one side.

    Parameters
    ----------
    route
        Speed and cross slope.
    axle_positions
        Distance of each axle ahead of the centre of gravity, front to rear [m].
    half_tracks
        Distance of the wheels of each axle from the middle [m].
    """

    route: Route
    axle_positions: tuple[float, ...]
    half_tracks: tuple[float, ...]

    @property
    def n_inputs(self) -> int:
        """Number of inputs: two wheels on each axle."""
        return 2 * len(self.axle_positions)

    def at(self, time: Real, generator: np.random.Generator) -> Real:
        """Return the heights at rising times [s], shape (wheels, times) [m]; left before right."""
        del generator  # a route is not random
        distance = self.route.speed.distance(time)
        slopes = (
            half_track * self.route.cross_slope(distance + x)
            for x, half_track in zip(self.axle_positions, self.half_tracks, strict=True)
        )
        return np.stack([side * height for height in slopes for side in (1, -1)])


def random_curvature(
    speed: SpeedProfile, *, duration: float, largest: float, generator: np.random.Generator
) -> SmoothSteps:
    """Return the curvature over distance of a winding road, with curves to both sides.

    Parameters
    ----------
    speed
        Speed of the drive.
    duration
        Duration of the drive [s].
    largest
        Largest lateral acceleration of a curve at the speed in its middle [m/s^2], above 0; each has 0.3 to 1 of it.
    generator
        Source of the randomness.

    Raises
    ------
    ParameterError
        If a number is out of range.

    Examples
    --------
    >>> from sprung.excitation import constant_speed
    >>> speed = constant_speed(20.0)
    >>> winding = random_curvature(speed, duration=120.0, largest=3.0, generator=np.random.default_rng(1))
    >>> lateral = 20.0**2 * np.cumsum(winding.jumps)[::2]
    >>> bool(np.all((np.abs(lateral) >= 0.9) & (np.abs(lateral) <= 3.0)))
    True
    """
    check_number("duration", duration, above=0)
    check_number("largest lateral acceleration", largest, above=0)
    knots, jumps, widths = [], [], []
    begin = generator.uniform(*_HABITS.straight)
    while begin < duration:
        end = begin + generator.uniform(*_HABITS.curve)
        acceleration = largest * generator.uniform(0.3, 1.0) * generator.choice([-1.0, 1.0])
        middle = float(speed.speed((begin + end) / 2))
        if middle > _HABITS.slowest:
            first, last = speed.distance([begin, end])
            ramp = (last - first) / 3
            knots += [first + ramp / 2, last - ramp / 2]
            jumps += [acceleration / middle**2, -acceleration / middle**2]
            widths += [ramp, ramp]
        begin = end + generator.uniform(*_HABITS.straight)
    return SmoothSteps(np.array(knots), np.array(jumps), np.array(widths))


def random_cross_slope(length: float, *, largest: float, generator: np.random.Generator) -> SmoothSteps:
    """Return the cross slope over distance of a road whose slope changes every 40 to 150 m.

    Parameters
    ----------
    length
        Length of the road [m].
    largest
        Largest slope to either side [rad], above 0.
    generator
        Source of the randomness.

    Raises
    ------
    ParameterError
        If the slope is not above 0.

    Examples
    --------
    >>> slope = random_cross_slope(1000.0, largest=0.05, generator=np.random.default_rng(1))
    >>> bool(np.all(np.abs(np.cumsum(slope.jumps)) <= 0.05)), bool(np.all(np.diff(slope.knots) >= 40.0))
    (True, True)
    """
    check_number("largest cross slope", largest, above=0)
    knots, slopes, widths = [], [0.0], []
    knot = generator.uniform(*_HABITS.transition)
    while knot < length:
        knots.append(knot)
        slopes.append(generator.uniform(-largest, largest))
        widths.append(generator.uniform(*_HABITS.transition))
        knot += generator.uniform(*_HABITS.level)
    return SmoothSteps(np.array(knots), np.diff(slopes), np.array(widths))
