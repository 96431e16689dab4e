"""Conditions of a drive, each of which can be switched on alone: load, suspension, road, driving, wheels."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

import numpy as np

from sprung._checks import check_number, check_one_of
from sprung.errors import ParameterError
from sprung.excitation import (
    ROAD_CLASSES,
    Lines,
    Potholes,
    Route,
    SpeedChanges,
    SpeedProfile,
    random_cross_slope,
    random_curvature,
)
from sprung.vehicles import Vehicle

#: Highest frequency of flats and corrugation [Hz]: motion is simulated at 1000 Hz or more.
FASTEST = 400.0
#: Gauge pressure of a tyre at 20 degrees Celsius [Pa].
TYRE_PRESSURE = 2.2e5


@dataclass(frozen=True, slots=True)
class _Usual:
    """Figures of drivers, wheels and tyres."""

    gentlest: float = 0.3  # smallest over largest deceleration of a drive
    acceleration: float = 0.7  # largest acceleration over largest deceleration
    steady: tuple[float, float] = (5.0, 25.0)  # stretches of steady speed of a drive with braking [s]
    wheels: tuple[float, float] = (0.3, 1.7)  # unbalance and run-out of single wheels over the usual one
    radii: float = 2e-3  # standard deviation of the radii of wheels, relative
    reference_speed: float = 10.0  # at which the amplitude of an unbalance is given [m/s]
    atmosphere: float = 1.013e5  # pressure of the air outside [Pa]
    of_pressure: float = 0.8  # share of a tyre's stiffness that is in proportion to the gauge pressure


_USUAL = _Usual()


@dataclass(frozen=True, slots=True)
class ForceLaw:
    """Departure of a spring and damper from the linear force k e + c e', with the elongation e.

    Parameters
    ----------
    asymmetry
        Relative asymmetry of the damper, -1 to 1: c (1 + asymmetry) in rebound (e' > 0), c (1 - asymmetry) in bump.
    asymmetry_velocity
        Velocity scale of the transition between the two [m/s].
    knee, knee_slope
        Speed [m/s] beyond which the damper's force rises with `knee_slope` times its slope; below 1: digressive.
    friction, friction_velocity
        Dry friction force [N] and its velocity scale [m/s]: friction e' / sqrt(e'^2 + friction_velocity^2).
    cubic
        Cubic hardening of the spring [1/m^2]: k (e + cubic e^3).
    load_friction
        Dry friction over the force that the spring carries [N/N], with the same velocity scale: of dampers that the
        load presses together, such as the Lenoir links of freight bogies. Without a load on the spring there is none.
    gap, stop_stiffness
        Free travel [m] and stiffness [N/m] of the bump stops; the stiffness is added where abs(e) exceeds gap.
    rubber_stiffness, rubber_force
        Stiffness [N/m] and limit force [N] of a friction element in parallel (Dahl), stiff at small and soft at large
        amplitudes: its force r follows r' = rubber_stiffness e' (1 - sign(e') r / rubber_force).

    Raises
    ------
    ParameterError
        If a number is out of range.

    References
    ----------
    P. R. Dahl, Solid friction damping of mechanical vibrations, AIAA Journal 14 (1976), 1675-1682.
    """

    asymmetry: float = 0.0
    asymmetry_velocity: float = 0.02
    knee: float = math.inf
    knee_slope: float = 1.0
    friction: float = 0.0
    friction_velocity: float = 0.005
    load_friction: float = 0.0
    cubic: float = 0.0
    gap: float = math.inf
    stop_stiffness: float = 0.0
    rubber_stiffness: float = 0.0
    rubber_force: float = 1.0

    def __post_init__(self) -> None:
        check_number("asymmetry", self.asymmetry, at_least=-1, at_most=1)
        for name in ("asymmetry_velocity", "friction_velocity", "rubber_force"):
            check_number(name, getattr(self, name), above=0)
        for name in ("knee_slope", "friction", "load_friction", "stop_stiffness", "rubber_stiffness"):
            check_number(name, getattr(self, name), at_least=0)

    def steepest(self, load: float) -> tuple[float, float]:
        """Return the largest stiffness [N/m] and damping [N s/m] that the law adds near rest, under a load [N]."""
        friction = self.friction + self.load_friction * max(load, 0.0)
        return self.rubber_stiffness + self.stop_stiffness, friction / self.friction_velocity

    @property
    def fastest(self) -> float:
        """Rate [rad/s] at which the rubber's force follows a motion of 1 m/s, the fastest expected."""
        return self.rubber_stiffness / self.rubber_force


def damping_factor(temperature: float) -> float:
    """Return the damping at an oil temperature [degrees Celsius] over that at 20 degrees Celsius.

    Raises
    ------
    ParameterError
        If the temperature is not within -60 to 200 degrees Celsius.

    Notes
    -----
    exp(-0.005 (T - 20)): half a percent per degree, the order of magnitude of tests on car dampers.

    Examples
    --------
    >>> [round(damping_factor(temperature), 2) for temperature in (-20, 20, 60)]
    [1.22, 1.0, 0.82]
    """
    check_number("temperature", temperature, at_least=-60, at_most=200)
    return math.exp(-0.005 * (temperature - 20))


def tyre_factor(temperature: float) -> float:
    """Return the stiffness of a tyre at an air temperature [degrees Celsius] over that at 20 degrees Celsius.

    Raises
    ------
    ParameterError
        If the temperature is not within -60 to 200 degrees Celsius.

    Notes
    -----
    The air in the tyre keeps its volume: the absolute pressure follows the absolute temperature. Four fifths of the
    stiffness are in proportion to the gauge pressure, here 2.2 bar at 20 degrees: 0.4 % per degree.

    Examples
    --------
    >>> [round(tyre_factor(temperature), 2) for temperature in (-20, 20, 60)]
    [0.84, 1.0, 1.16]
    """
    check_number("temperature", temperature, at_least=-60, at_most=200)
    warmer = (temperature - 20) / (20 + 273.15)
    return 1 + _USUAL.of_pressure * warmer * (TYRE_PRESSURE + _USUAL.atmosphere) / TYRE_PRESSURE


def pressure_of(factor: float) -> float:
    """Return the gauge pressure of a tyre [Pa] whose stiffness is `factor` times that at 2.2 bar; at least 0."""
    return max(0.0, TYRE_PRESSURE * (1 + (factor - 1) / _USUAL.of_pressure))


#: A car's suspension: damping 35 % higher in rebound and 35 % lower in bump, 25 N of friction, springs that harden
#: by 10 % at 5 cm, bump stops at 7 cm.
REALISTIC_FORCE_LAWS = MappingProxyType(
    {"suspension": ForceLaw(asymmetry=0.35, friction=25.0, cubic=40.0, gap=0.07, stop_stiffness=100e3)}
)


def rail_force_laws(vehicle: Vehicle) -> dict[str, ForceLaw]:
    """Return usual force laws of the stages of a rail vehicle.

    Parameters
    ----------
    vehicle
        Vehicle on bogies, or a bogie alone.

    Notes
    -----
    A bogie alone, such as a Y25, has friction of 10 % of what its springs carry, as of friction coefficients of 0.3 and
    Lenoir links 18 degrees from upright, and bump stops beyond 20 mm; a vehicle on bogies has bump stops beyond 30 mm
    (primary) and 50 mm (secondary). All figures are assumed, of usual size.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle
    >>> [(stage, law.load_friction, law.gap) for stage, law in rail_force_laws(read_vehicle("metro")).items()]
    [('primary', 0.0, 0.03), ('secondary', 0.0, 0.05)]
    """
    if not vehicle.bogie:
        return {"suspension": ForceLaw(load_friction=0.1, friction_velocity=0.002, gap=0.02, stop_stiffness=1e7)}
    return {
        "primary": ForceLaw(gap=0.03, stop_stiffness=5e6),
        "secondary": ForceLaw(gap=0.05, stop_stiffness=2e6),
    }


@dataclass(frozen=True, slots=True)
class Payload:
    """Mass fixed to the body.

    Parameters
    ----------
    mass
        Mass [kg], at least 0.
    x, y
        Position ahead and to the left of the body's centre of gravity [m].

    Raises
    ------
    ParameterError
        If the mass is negative or not finite, or a position is not finite.
    """

    mass: float = 0.0
    x: float = 0.0
    y: float = 0.0

    def __post_init__(self) -> None:
        check_number("mass of the payload", self.mass, at_least=0)
        check_number("x of the payload", self.x)
        check_number("y of the payload", self.y)


@dataclass(frozen=True, slots=True)
class SuspensionConditions:
    """Departures of the suspension on a drive from the linear one of the vehicle file.

    Parameters
    ----------
    temperature
        Temperature of the dampers [°C]; damping is nominal at 20 °C.
    force_laws
        Nonlinear force laws by part or by owner and part, see `simulate_nonlinear`; empty: a linear suspension.
    tyre_temperature
        Temperature of the air in the tyres [°C]; their stiffness is nominal at 20 °C.
    """

    temperature: float = 20.0
    force_laws: Mapping[str, ForceLaw] = field(default_factory=dict)
    tyre_temperature: float = 20.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "force_laws", dict(self.force_laws))


@dataclass(frozen=True, slots=True)
class RoadConditions:
    """Road that a vehicle drives on.

    Parameters
    ----------
    road_class
        Roughness class of ISO 8608, "A" to "H".
    potholes
        Potholes and bumps on the way; None: none.
    right_rougher_db
        Spectral density of the right track over that of the left one, which is of the class [dB]; potholes are not
        scaled.

    Raises
    ------
    ParameterError
        If the class does not exist, or the level is not within -20 to 20 dB.
    """

    road_class: str = "C"
    potholes: Potholes | None = None
    right_rougher_db: float = 0.0

    def __post_init__(self) -> None:
        check_one_of("road class", self.road_class.upper(), ROAD_CLASSES)
        check_number("right_rougher_db", self.right_rougher_db, at_least=-20, at_most=20)

    @property
    def right_over_left(self) -> float:
        """Unevenness of the right track over that of the left one, an amplitude ratio."""
        return float(10 ** (self.right_rougher_db / 20))


@dataclass(frozen=True, slots=True)
class Driving:
    """Braking, curves and cross slope, which pitch and roll the body through the height of its centre of gravity.

    Parameters
    ----------
    braking
        Largest deceleration [m/s^2]; 0: a calm drive, whose changes of speed do not pitch the body. Accelerations are
        up to 0.7 of it.
    cornering
        Largest lateral acceleration [m/s^2]; 0: a straight road.
    cross_slope
        Largest slope of the road to either side [rad]; 0: a level road.
    height
        Height of the body's centre of gravity above the ground [m]; None: that of the vehicle file, or 0.55 m.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """

    braking: float = 0.0
    cornering: float = 0.0
    cross_slope: float = 0.0
    height: float | None = None

    def __post_init__(self) -> None:
        for name, most in (("braking", 10.0), ("cornering", 10.0), ("cross_slope", 0.3)):
            check_number(name, getattr(self, name), at_least=0, at_most=most)
        if self.height is not None:
            check_number("height", self.height, above=0)

    @property
    def is_steady(self) -> bool:
        """Whether the road alone accelerates the body."""
        return not (self.braking or self.cornering or self.cross_slope)

    @property
    def speed_changes(self) -> SpeedChanges:
        """Ranges of accelerations, decelerations and steady stretches."""
        if not self.braking:
            return SpeedChanges()
        largest = _USUAL.acceleration * self.braking
        return SpeedChanges(
            (_USUAL.gentlest * largest, largest), (_USUAL.gentlest * self.braking, self.braking), _USUAL.steady
        )

    def route(self, speed: SpeedProfile, *, duration: float, generator: np.random.Generator) -> Route:
        """Return a random route with these curves and slopes.

        Parameters
        ----------
        speed
            Speed of the drive.
        duration
            Duration of the drive [s].
        generator
            Source of the randomness.
        """
        parts = {}
        if self.cornering:
            parts["curvature"] = random_curvature(speed, duration=duration, largest=self.cornering, generator=generator)
        if self.cross_slope:
            length = float(speed.distance(duration))
            parts["cross_slope"] = random_cross_slope(length, largest=self.cross_slope, generator=generator)
        return Route(speed, **parts, has_longitudinal=self.braking > 0)


@dataclass(frozen=True, slots=True)
class WheelOrders:
    """Unbalance, run-out and flats of the wheels, which excite the vehicle at the harmonics of their rotation.

    Parameters
    ----------
    unbalance
        Usual static unbalance of a wheel [kg m], at least 0; 5 g on a radius of 0.2 m are 1e-3.
    run_out
        Usual radial run-out of a wheel at the first, second ... harmonic of its rotation, amplitudes [m].
    radius
        Rolling radius [m], above 0.
    flat
        Length of a flat on the tread of each wheel [m], at least 0, of a steel wheel on a rail.
    wheels
        Names of the wheels that have them, such as "front_left"; none given: all.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """

    unbalance: float = 0.0
    run_out: tuple[float, ...] = ()
    radius: float = 0.31
    wheels: tuple[str, ...] = ()
    flat: float = 0.0

    def __post_init__(self) -> None:
        check_number("unbalance", self.unbalance, at_least=0)
        check_number("flat", self.flat, at_least=0, at_most=self.radius)
        check_number("radius", self.radius, above=0)
        for amplitude in self.run_out:
            check_number("run_out", amplitude, at_least=0)

    def lines(self, vehicle: Vehicle, speed: SpeedProfile, generator: np.random.Generator) -> tuple[Lines, ...]:
        """Return the lines of each wheel, as heights of the road under it.

        Parameters
        ----------
        vehicle
            Vehicle with tyres.
        speed
            Speed of the drive.
        generator
            Source of what differs between the wheels: 0.3 to 1.7 of the usual amplitudes, any phase, and radii that
            scatter by 0.2 %, so that wheels drift apart.

        Raises
        ------
        ParameterError
            If the vehicle has no tyres, or not these wheels.

        Notes
        -----
        The radial force U (v / R)^2 of an unbalance U equals a motion of the road by U (v / R)^2 / k_t under a tyre of
        stiffness k_t, here the nominal one.

        A wheel of radius R pivots about one end of a flat of length l, and then about the other: its centre falls by
        (l / 2 - |x|)^2 / (2 R) at a distance x from the middle, l^2 / (8 R) at most (S. G. Newton and R. A. Clark, An
        investigation into the dynamic effects on the track of wheelflats on railway vehicles, Journal of Mechanical
        Engineering Science 21 (1979)). It is the sum of -2 (a - sin a) / (pi R^2 k^3) cos(k x), a = k l / 2, of
        all k = 1 / R, 2 / R .. up to 400 Hz at the highest speed. The contact never opens.
        """
        lines = []
        names = [wheel.corner for wheel in vehicle.wheels]
        for name in self.wheels:
            check_one_of("wheels", name, names)
        stiffnesses = [axle.tyre_stiffness for axle in vehicle.axle for _ in range(2)]
        stiffnesses += [bogie.contact_stiffness for bogie in vehicle.bogie for _ in range(4)]
        for name, stiffness in zip(names, stiffnesses, strict=True):
            if stiffness is None:
                raise ParameterError(f"vehicle {vehicle.name!r} has no tyres that could be unbalanced: leave that out")
            radius = self.radius * (1 + _USUAL.radii * generator.standard_normal())
            shares = tuple(float(other == name) for other in names)
            sizes = generator.uniform(*_USUAL.wheels, 1 + len(self.run_out)) * (not self.wheels or name in self.wheels)
            phases = generator.uniform(0, 2 * math.pi, sizes.size)
            turns = 1 / (2 * math.pi * radius)
            force = sizes[0] * self.unbalance * (_USUAL.reference_speed / radius) ** 2
            lines += [
                Lines(
                    speed,
                    (turns,),
                    (float(force / stiffness),),
                    shares,
                    reference_speed=_USUAL.reference_speed,
                    speed_exponent=2.0,
                    phases=(float(phases[0]),),
                ),
                Lines(
                    speed,
                    tuple(turns * (number + 1) for number in range(len(self.run_out))),
                    tuple(float(size * usual) for size, usual in zip(sizes[1:], self.run_out, strict=True)),
                    shares,
                    phases=tuple(phases[1:].tolist()),
                ),
            ]
            if self.flat and (not self.wheels or name in self.wheels):
                order = turns * np.arange(1, int(FASTEST / (turns * float(speed.speeds.max()))) + 1)
                k = 2 * math.pi * order
                drop = 2 * (k * self.flat / 2 - np.sin(k * self.flat / 2)) / (math.pi * radius**2 * k**3)
                phase = order / turns * generator.uniform(0, 2 * math.pi) - math.pi / 2
                amplitudes = tuple(drop.tolist())
                lines.append(Lines(speed, tuple(order.tolist()), amplitudes, shares, phases=tuple(phase.tolist())))
        return tuple(lines)


def wheel_order_facts(lines: tuple[Lines, ...], vehicle: Vehicle) -> dict[str, list[dict[str, float]]]:
    """Return the lines of `WheelOrders.lines` by corner: periods per metre, amplitude at 10 m/s [m], phase [rad]."""
    facts: dict[str, list[dict[str, float]]] = {wheel.corner: [] for wheel in vehicle.wheels}
    for line in lines:
        corner = list(facts)[line.shares.index(1.0)]
        facts[corner] += [
            {"order": order, "amplitude": amplitude, "phase": phase, "speed_exponent": line.speed_exponent}
            for order, amplitude, phase in zip(line.orders, line.amplitudes, line.phases or (), strict=True)
            if amplitude > 0
        ]
    return facts


#: A car's suspension with asymmetric dampers, friction, progressive springs and bump stops, at 20 degrees Celsius.
REALISTIC_SUSPENSION = SuspensionConditions(force_laws=REALISTIC_FORCE_LAWS)
#: Three potholes per kilometre.
FEW_POTHOLES = Potholes(per_kilometre=3.0)
