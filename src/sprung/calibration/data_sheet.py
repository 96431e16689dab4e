"""A vehicle file from a data sheet: masses and geometry as printed, the rest by rules of thumb."""

import math
import re
from dataclasses import dataclass
from typing import Literal

from sprung._checks import check_number, check_one_of, check_type
from sprung.errors import ParameterError
from sprung.vehicles import Axle, Body, Sensor, Vehicle
from sprung.vehicles.sections import LearntNumber


@dataclass(frozen=True, slots=True)
class SheetRules:
    """Usual values of what a data sheet does not state."""

    #: Pressure of a car's tyre [Pa].
    pressure: float = 230e3
    #: Vertical stiffness of a tyre over pressure times sqrt(width x diameter).
    per_pressure: float = 2.7
    #: Share of each wheel with hub and half of its links and springs in the mass of a car.
    unsprung: float = 0.028
    #: Pitch: squared radius of gyration over the product of the axles' distances.
    pitch: float = 0.88
    #: Roll: squared radius of gyration over the squared half track width.
    roll: float = 0.52
    #: Stiffness of the anti-roll bars of front and rear axle over that of one spring.
    bars: tuple[float, float] = (0.3, 0.15)


RULES = SheetRules()


@dataclass(frozen=True, slots=True)
class GuessWidths:
    """Standard deviations of ln of the guesses, by the field of the vehicle file."""

    spring_stiffness: float = 0.2
    damping: float = 0.3
    tyre_stiffness: float = 0.15
    unsprung_mass: float = 0.15
    anti_roll_stiffness: float = 0.5
    pitch_inertia: float = 0.1
    roll_inertia: float = 0.15
    #: Standard deviation of the share of the front axle.
    front_share: float = 0.02


WIDTHS = GuessWidths()
_SIZE = re.compile(r"(\d{3})/(\d{2,3})\s*Z?R\s*(\d{2}(?:\.\d)?)C?", re.IGNORECASE)
Sensors = Literal["corners", "imu", "travel"]


@dataclass(frozen=True, slots=True)
class DataSheet:
    """What a data sheet states about a car, and usual values for what it does not.

    Parameters
    ----------
    mass
        Mass of the car as it is driven [kg].
    wheelbase, track
        Distance of the axles, and mean distance of the wheels of an axle [m].
    tyre
        Size of the tyres, such as "205/55R16".
    front_share
        Share of the mass on the front axle.
    ride_frequencies
        Natural frequency of the body above each axle, on springs and tyres [Hz].
    damping_ratio
        Damping ratio of the body above each axle.
    unsprung_masses
        Unsprung mass of a front and of a rear wheel [kg]; None: 2.8 % of the mass each.
    pressure
        Pressure of the tyres [Pa].
    sensors
        "corners": accelerometers above the wheels; "imu": vertical acceleration, roll rate and pitch rate at the centre
        of gravity; "travel": spring deflections.
    name
        Name of the vehicle.

    Raises
    ------
    ParameterError
        If a number is out of range, or the size of the tyres cannot be read.
    """

    mass: float
    wheelbase: float
    track: float
    tyre: str
    front_share: float = 0.58
    ride_frequencies: tuple[float, float] = (1.2, 1.4)
    damping_ratio: float = 0.28
    unsprung_masses: tuple[float, float] | None = None
    pressure: float = RULES.pressure
    sensors: Sensors = "corners"
    name: str = "car"

    def __post_init__(self) -> None:
        check_number("mass", self.mass, at_least=300, at_most=20_000)
        check_number("wheelbase", self.wheelbase, at_least=1.2, at_most=10)
        check_number("track", self.track, at_least=0.8, at_most=3)
        check_number("front_share", self.front_share, at_least=0.2, at_most=0.8)
        check_number("damping_ratio", self.damping_ratio, above=0, at_most=1)
        check_number("pressure", self.pressure, at_least=50e3, at_most=1.2e6)
        for frequency in self.ride_frequencies:
            check_number("ride_frequencies", frequency, at_least=0.5, at_most=4)
        check_one_of("sensors", self.sensors, ("corners", "imu", "travel"))
        tyre_size(self.tyre)


def tyre_size(text: str) -> tuple[float, float]:
    """Return width and outer diameter [m] of a tyre.

    Raises
    ------
    ParameterError
        If the text is not a size.

    Examples
    --------
    >>> tyre_size("205/55R16")
    (0.205, 0.6319)
    """
    found = _SIZE.match(text.strip())
    if found is None:
        raise ParameterError(f"tyre={text!r} is not a size: write width/aspect ratio R rim, such as 205/55R16")
    width, aspect, rim = (float(part) for part in found.groups())
    return width / 1000, round(rim * 0.0254 + 2 * width * aspect / 1e5, 6)


def tyre_stiffness(tyre: str, *, pressure: float = RULES.pressure) -> float:
    """Return the usual vertical stiffness of a tyre [N/m], with an error of about 15 %.

    Parameters
    ----------
    tyre
        Size, such as "205/55R16".
    pressure
        Pressure above that of the atmosphere [Pa].

    Notes
    -----
    2.7 p sqrt(w D) with width w and outer diameter D: the pressure carries the load on a contact patch that grows with
    width and diameter; the factor is a rule, not a published regression.

    References
    ----------
    T. B. Rhyne, Development of a vertical stiffness relationship for belted radial tires, Tire Science and Technology
    33 (2005), 136-155 (stiffness from pressure and size).

    Examples
    --------
    In kN/m, at the usual pressure and at 2.8 bar:

    >>> [round(tyre_stiffness("205/55R16", pressure=pressure) / 1e3) for pressure in (2.3e5, 2.8e5)]
    [224, 272]
    """
    width, diameter = tyre_size(tyre)
    return RULES.per_pressure * pressure * math.sqrt(width * diameter)


def described(sheet: DataSheet) -> Vehicle:
    """Return the vehicle file of a data sheet; its table [[learnt]] has the standard deviation of every guess.

    Parameters
    ----------
    sheet
        Data of the car.

    Raises
    ------
    ParameterError
        If the tyres are softer than the ride frequencies need.

    Notes
    -----
    The ride rate r = (2 pi f)^2 m of a corner with sprung mass m is the series of spring and tyre k, so that the spring
    has r k / (k - r); damping 2 z sqrt(spring m). Radii of gyration of the body: k_y^2 = 0.88 a b with the axles'
    distances a and b from the centre of gravity (Olley's k^2/ab is 0.8 to 1 in cars), k_x^2 = 0.52 of the squared half
    track: rules with errors of 10 and 15 %, not regressions on measured vehicles.

    References
    ----------
    M. Olley, Independent wheel suspension - its whys and wherefores, SAE Journal 34 (1934), 73-81 (softer front
    springs, k^2/ab).
    T. D. Gillespie, Fundamentals of Vehicle Dynamics, SAE, 1992, chapter 5 (ride rate, ride frequencies).

    Examples
    --------
    Spring and tyre in series carry the body above the front axle at the ride frequency of the sheet:

    >>> import math
    >>> from sprung.calibration import DataSheet
    >>> vehicle = described(DataSheet(mass=1600.0, wheelbase=2.7, track=1.52, tyre="205/55R16"))
    >>> front, rear = vehicle.axle
    >>> rate = 1 / (1 / front.spring_stiffness + 1 / front.tyre_stiffness)
    >>> load = vehicle.body.mass / 2 * rear.x / (rear.x - front.x)
    >>> round(math.sqrt(rate / load) / (2 * math.pi), 2)
    1.2
    """
    check_type("sheet", sheet, DataSheet)
    unsprung = sheet.unsprung_masses or (RULES.unsprung * sheet.mass, RULES.unsprung * sheet.mass)
    shares = sheet.front_share, 1 - sheet.front_share
    loads = [sheet.mass * share - 2 * mass for share, mass in zip(shares, unsprung, strict=True)]
    sprung = sum(loads)
    places = (sheet.wheelbase * loads[1] / sprung, -sheet.wheelbase * loads[0] / sprung)
    axles = tuple(
        _axle(sheet, index, place, load / 2, mass)
        for index, (place, load, mass) in enumerate(zip(places, loads, unsprung, strict=True))
    )
    body = Body(
        mass=round(sprung, 1),
        pitch_inertia=round(RULES.pitch * sprung * places[0] * -places[1], 1),
        roll_inertia=round(RULES.roll * sprung * (sheet.track / 2) ** 2, 1),
    )
    return Vehicle(
        name=sheet.name,
        kind="road",
        body=body,
        axle=axles,
        sensor=_sensors(sheet, places),
        learnt=_guesses(body, axles, sheet),
    )


def _axle(sheet: DataSheet, index: int, x: float, load: float, unsprung: float) -> Axle:
    """Return the front or rear axle, by the sprung mass above a wheel and the mass of the wheel [kg]."""
    tyre, frequency = tyre_stiffness(sheet.tyre, pressure=sheet.pressure), sheet.ride_frequencies[index]
    ride = (2 * math.pi * frequency) ** 2 * load
    if ride > tyre / 2:
        raise ParameterError(
            f"ride_frequencies={frequency:g} Hz of {load:.0f} kg on a wheel need a stiffness of "
            f"{ride:.3g} N/m, but the tyre has {tyre:.3g} N/m: correct mass, tyre or frequencies"
        )
    spring = ride * tyre / (tyre - ride)
    return Axle(
        x=round(x, 4),
        half_track=sheet.track / 2,
        unsprung_mass=round(unsprung, 2),
        spring_stiffness=round(spring),
        damping=round(2 * sheet.damping_ratio * math.sqrt(spring * load)),
        tyre_stiffness=round(tyre),
        anti_roll_stiffness=round(RULES.bars[index] * spring),
    )


def _guesses(body: Body, axles: tuple[Axle, ...], sheet: DataSheet) -> tuple[LearntNumber, ...]:
    """Return the guesses with their standard deviations and sources."""
    guesses = []
    for where, axle, frequency in zip(("front", "rear"), axles, sheet.ride_frequencies, strict=True):
        sources = {
            "spring_stiffness": f"ride frequency {frequency:g} Hz",
            "damping": f"damping ratio {sheet.damping_ratio:g}",
            "tyre_stiffness": f"size {sheet.tyre} at {sheet.pressure / 1e5:.2g} bar",
            "unsprung_mass": "usual share of the mass" if sheet.unsprung_masses is None else "data sheet",
            "anti_roll_stiffness": "usual share of the spring",
        }
        guesses += [(where, field, getattr(axle, field), source) for field, source in sources.items()]
    for field in ("pitch_inertia", "roll_inertia"):
        guesses.append(("body", field, getattr(body, field), "radius of gyration"))
    widths = [float(f"{getattr(WIDTHS, field) * value:.3g}") for _, field, value, _ in guesses]
    guesses.append(("body", "centre_x", 0.0, "share of the front axle"))
    widths.append(round(WIDTHS.front_share * sheet.wheelbase, 4))
    return tuple(
        LearntNumber(name=f"{where}.{field}", value=float(value), std=std, source=f"guess: {source}")
        for (where, field, value, source), std in zip(guesses, widths, strict=True)
    )


def _sensors(sheet: DataSheet, places: tuple[float, float]) -> tuple[Sensor, ...]:
    """Return the sensors of the usual layouts."""
    corners = {
        f"{end}{side}": (round(x, 4), sign * sheet.track / 2)
        for end, x in zip("fr", places, strict=True)
        for side, sign in (("l", 1.0), ("r", -1.0))
    }
    if sheet.sensors == "corners":
        return tuple(accelerometer(f"acc_{corner}", *place) for corner, place in corners.items())
    if sheet.sensors == "travel":
        names = {"fl": "front_left", "fr": "front_right", "rl": "rear_left", "rr": "rear_right"}
        return tuple(
            Sensor(channel=f"travel_{corner}", quantity="travel", unit="m", between=names[corner]) for corner in corners
        )
    return (
        accelerometer("acc_z", 0.0, 0.0),
        gyroscope("gyro_x", (1.0, 0.0, 0.0)),
        gyroscope("gyro_y", (0.0, 1.0, 0.0)),
    )


def accelerometer(channel: str, x: float, y: float) -> Sensor:
    """Return an accelerometer on the body that measures upwards."""
    place, upright = (x, y, 0.0), (0.0, 0.0, 1.0)
    return Sensor(channel=channel, quantity="acceleration", unit="m/s^2", position=place, direction=upright)


def gyroscope(channel: str, direction: tuple[float, float, float]) -> Sensor:
    """Return a gyroscope at the centre of gravity."""
    centre = (0.0, 0.0, 0.0)
    return Sensor(channel=channel, quantity="angular_velocity", unit="rad/s", position=centre, direction=direction)
