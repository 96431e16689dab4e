"""A vehicle file from a data sheet: masses and geometry as printed, the rest by rules of thumb."""

import math
import re
from dataclasses import dataclass
from typing import Literal, TypeVar

from sprung._checks import check_number, check_one_of, check_type
from sprung._display import counted
from sprung.errors import ParameterError
from sprung.units import STANDARD_GRAVITY
from sprung.vehicles import Axle, Body, Seat, Sensor, Vehicle, corner_names
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
    #: The same in the mass on its axle, where that is stated.
    unsprung_of_axle: float = 0.056
    #: Pitch: squared radius of gyration over the mean squared distance of the loads on axles.
    pitch: float = 0.88
    #: Roll: squared radius of gyration over the squared half track width.
    roll: float = 0.52
    #: Roll of a vehicle of known height: the same over that of a full box.
    roll_of_box: float = 0.7
    #: Stiffness of the anti-roll bars of the front axle and of the others over that of one spring.
    bars: tuple[float, float] = (0.3, 0.15)
    #: Side force over slip angle and load of a tyre at a car's usual load [1/rad], that load [N], and how it falls.
    cornering: float = 15.0
    usual_load: float = 4e3
    falling: float = -0.3
    #: Height of the centre of gravity over the wheelbase, and over the height of a vehicle of which it is known.
    height: float = 0.2
    height_of_box: float = 0.36
    #: Roll centre of an axle with independent suspension [m]; that of a rigid one is at the height of its hubs.
    roll_centre: float = 0.06
    #: Load above which an axle of a vehicle of known height is taken to be rigid, also in front [kg].
    heavy: float = 3500.0
    #: Distance of the springs of a rigid axle from the middle, and its radius of gyration, over half the track.
    spring_base: float = 0.66
    gyration: float = 0.75
    #: Mass of a person [kg].
    person: float = 75.0
    #: Front seats and further ones behind the front axle, over the wheelbase; of a van or truck, too.
    rows: tuple[float, float] = (0.48, 0.82)
    front_of_van: float = 0.3
    #: Distance of seats from the middle over the track.
    aside: float = 0.24
    #: Largest number of seats in rows; more are four groups at these distances from the front axle over the wheelbase.
    most_in_rows: int = 9
    quarters: tuple[float, float] = (0.2, 0.8)
    #: Mass up to which a vehicle has seats as a car or a van [kg].
    light: float = 3500.0
    #: Largest relative difference between the mass and the sum of the loads on axles.
    loads_within: float = 0.02


RULES = SheetRules()


@dataclass(frozen=True, slots=True)
class GuessWidths:
    """Standard deviations of ln of the guesses, by the field of the vehicle file."""

    spring_stiffness: float = 0.2
    damping: float = 0.3
    tyre_stiffness: float = 0.15
    unsprung_mass: float = 0.15
    wheelset_mass: float = 0.15
    wheelset_roll_inertia: float = 0.3
    half_track: float = 0.15
    anti_roll_stiffness: float = 0.5
    cornering_stiffness: float = 0.3
    height: float = 0.15
    pitch_inertia: float = 0.1
    roll_inertia: float = 0.15
    #: Standard deviation of the share of the front axle.
    front_share: float = 0.02


WIDTHS = GuessWidths()
_SIZE = re.compile(r"(2x)?\s*(\d{3})/(\d{2,3})\s*Z?R\s*(\d{2}(?:\.\d)?)C?", re.IGNORECASE)
Sensors = Literal["corners", "imu", "travel"]
Value = TypeVar("Value")


@dataclass(frozen=True, slots=True)
class DataSheet:
    """What a data sheet states about a car, van, truck or bus, and usual values for what it does not.

    Parameters
    ----------
    mass
        Mass of the vehicle as it is driven [kg].
    wheelbase
        Distance of the rear axle from the front axle [m]; of more than two axles the distance of each further one.
    track
        Mean distance of the wheels of an axle, of twin tyres that of their middles [m].
    tyre
        Size of the tyres, such as "205/55R16"; or that of each axle, twin tyres as "2x275/70R22.5".
    front_share
        Share of the mass on the front axle of two.
    axle_loads
        Mass on each axle [kg], which more than two axles need; None: by `front_share`.
    ride_frequencies
        Natural frequency of the body above the front axle and above each other one, on springs and tyres [Hz]; the last
        holds for all further axles.
    damping_ratio
        Damping ratio of the body above each axle.
    unsprung_masses
        Unsprung mass of a wheel of the front axle and of each other one [kg], as `ride_frequencies`; None: 2.8 % of the
        mass each, or 5.6 % of the mass on their axle where `axle_loads` are stated.
    height
        Height of a van, truck or bus [m], for its roll inertia and its centre of gravity; None: those of a car.
    rigid_axles
        Axles whose wheels are joined, such as "rear"; None: of a vehicle of stated height all but a front axle under
        3.5 t, of a car none.
    seats
        Number of seats; None: 5 of a car, 2 of a van or truck up to 3.5 t, none of a heavier vehicle.
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
    wheelbase: float | tuple[float, ...]
    track: float
    tyre: str | tuple[str, ...]
    front_share: float = 0.58
    axle_loads: tuple[float, ...] | None = None
    ride_frequencies: tuple[float, ...] = (1.2, 1.4)
    damping_ratio: float = 0.28
    unsprung_masses: tuple[float, ...] | None = None
    height: float | None = None
    rigid_axles: tuple[str, ...] | None = None
    seats: int | None = None
    pressure: float = RULES.pressure
    sensors: Sensors = "corners"
    name: str = "car"

    def __post_init__(self) -> None:
        check_number("mass", self.mass, at_least=300, at_most=60_000)
        for distance, before in zip(self.distances[1:], self.distances, strict=False):
            check_number("wheelbase", distance - before, at_least=0.9, at_most=15)
        check_number("wheelbase", self.distances[-1], at_least=1.2, at_most=15)
        check_number("track", self.track, at_least=0.8, at_most=3)
        check_number("front_share", self.front_share, at_least=0.2, at_most=0.8)
        check_number("damping_ratio", self.damping_ratio, above=0, at_most=1)
        check_number("pressure", self.pressure, at_least=50e3, at_most=1.2e6)
        check_number("seats", self.seats or 0, at_least=0, at_most=150)
        for frequency in self.ride_frequencies:
            check_number("ride_frequencies", frequency, at_least=0.5, at_most=4)
        check_one_of("sensors", self.sensors, ("corners", "imu", "travel"))
        if self.height is not None:
            check_number("height", self.height, at_least=1, at_most=4.5)
        for tyre in self.tyres:
            tyre_size(tyre)
        for name in self.rigid_axles or ():
            check_one_of("rigid_axles", name, self.names)
        self._check_loads()

    def _check_loads(self) -> None:
        """Check that there is a load for each axle, and that they make up the mass."""
        count = len(self.distances)
        if self.axle_loads is None:
            if count > 2:
                raise ParameterError(f"{count} axles need the mass on each of them: state axle_loads (--axle-load)")
            return
        if len(self.axle_loads) != count:
            raise ParameterError(
                f"axle_loads has {counted(len(self.axle_loads), 'value')} for {count} axles: state one for each"
            )
        for load in self.axle_loads:
            check_number("axle_loads", load, at_least=100, at_most=20_000)
        total = sum(self.axle_loads)
        if abs(total / self.mass - 1) > RULES.loads_within:
            raise ParameterError(
                f"axle_loads add up to {total:.0f} kg, but the mass is {self.mass:.0f} kg: correct one of them"
            )

    @property
    def distances(self) -> tuple[float, ...]:
        """Distance of each axle from the front axle [m], shape (axles,)."""
        return (0.0, *(self.wheelbase if isinstance(self.wheelbase, tuple) else (self.wheelbase,)))

    @property
    def names(self) -> tuple[str, ...]:
        """Name of each axle."""
        return tuple(left.removesuffix("_left") for left in corner_names(len(self.distances))[::2])

    @property
    def are_rigid(self) -> tuple[bool, ...]:
        """Whether the wheels of each axle are joined."""
        if self.rigid_axles is not None:
            return tuple(name in self.rigid_axles for name in self.names)
        return tuple(
            self.height is not None and (index > 0 or load > RULES.heavy) for index, load in enumerate(self.loads)
        )

    @property
    def tyres(self) -> tuple[str, ...]:
        """Size of the tyres of each axle."""
        return self._each(self.tyre if isinstance(self.tyre, tuple) else (self.tyre,))

    @property
    def loads(self) -> tuple[float, ...]:
        """Mass on each axle [kg]."""
        if self.axle_loads is None:
            return self.mass * self.front_share, self.mass * (1 - self.front_share)
        return tuple(load * self.mass / sum(self.axle_loads) for load in self.axle_loads)

    @property
    def frequencies(self) -> tuple[float, ...]:
        """Natural frequency of the body above each axle [Hz]."""
        return self._each(self.ride_frequencies)

    @property
    def wheels(self) -> tuple[float, ...]:
        """Unsprung mass of a wheel of each axle [kg]."""
        if self.unsprung_masses is not None:
            return self._each(self.unsprung_masses)
        if self.axle_loads is not None:
            return tuple(RULES.unsprung_of_axle * load for load in self.loads)
        return self._each((RULES.unsprung * self.mass,))

    def _each(self, values: tuple[Value, ...]) -> tuple[Value, ...]:
        """Return a value for each axle: the last holds for all further ones."""
        return tuple(values[min(index, len(values) - 1)] for index in range(len(self.distances)))


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
    width, aspect, rim = (float(part) for part in found.groups()[1:])
    return width / 1000, round(rim * 0.0254 + 2 * width * aspect / 1e5, 6)


def tyre_stiffness(tyre: str, *, pressure: float = RULES.pressure) -> float:
    """Return the usual vertical stiffness of a tyre or of twin tyres [N/m], with an error of about 15 %.

    Parameters
    ----------
    tyre
        Size, such as "205/55R16", or "2x275/70R22.5" for twin tyres.
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
    return _count(tyre) * RULES.per_pressure * pressure * math.sqrt(width * diameter)


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
    has r k / (k - r); damping 2 z sqrt(spring m). Radii of gyration of the body: k_y^2 is 0.88 of the mean squared
    distance of the axles' loads from the centre of gravity, which is a b of two axles at the distances a and b (Olley's
    k^2/ab is 0.8 to 1 in cars); k_x^2 is 0.52 of the squared half track, or 0.7 of that of a full box as wide and high
    as the vehicle: rules with errors of 10 and 15 %, not regressions on measured vehicles.

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
    above = [load - 2 * mass for load, mass in zip(sheet.loads, sheet.wheels, strict=True)]
    sprung = sum(above)
    centre = sum(load * distance for load, distance in zip(above, sheet.distances, strict=True)) / sprung
    places = tuple(centre - distance for distance in sheet.distances)
    axles = tuple(
        _axle(sheet, index, place, load / 2) for index, (place, load) in enumerate(zip(places, above, strict=True))
    )
    height = RULES.height * sheet.distances[-1] if sheet.height is None else RULES.height_of_box * sheet.height
    body = Body(
        mass=round(sprung, 1),
        pitch_inertia=round(RULES.pitch * sum(load * x**2 for load, x in zip(above, places, strict=True)), 1),
        roll_inertia=round(_roll_radius(sheet) ** 2 * sprung, 1),
        height=round(height, 3),
    )
    return Vehicle(
        name=sheet.name,
        kind="road",
        body=body,
        axle=axles,
        seat=_seats(sheet, centre),
        sensor=_sensors(sheet, places),
        learnt=_guesses(body, axles, sheet),
    )


def _roll_radius(sheet: DataSheet) -> float:
    """Return the radius of gyration of the body about its longitudinal axis [m]."""
    if sheet.height is None:
        return math.sqrt(RULES.roll) * sheet.track / 2
    width = sheet.track + max(tyre_size(tyre)[0] for tyre in sheet.tyres)
    return math.sqrt(RULES.roll_of_box * (width**2 + sheet.height**2) / 12)


def _axle(sheet: DataSheet, index: int, x: float, load: float) -> Axle:
    """Return an axle, by its place [m] and the sprung mass above one of its wheels [kg]."""
    tyre, frequency = tyre_stiffness(sheet.tyres[index], pressure=sheet.pressure), sheet.frequencies[index]
    ride = (2 * math.pi * frequency) ** 2 * load
    if ride > tyre / 2:
        raise ParameterError(
            f"ride_frequencies={frequency:g} Hz of {load:.0f} kg on a wheel need a stiffness of "
            f"{ride:.3g} N/m, but the tyre has {tyre:.3g} N/m: correct mass, tyre or frequencies"
        )
    spring = ride * tyre / (tyre - ride)
    half, wheel = sheet.track / 2, round(sheet.wheels[index], 2)
    unsprung: dict[str, float] = {"half_track": half, "unsprung_mass": wheel, "roll_centre_height": RULES.roll_centre}
    if sheet.are_rigid[index]:
        unsprung = {
            "half_track": round(RULES.spring_base * half, 4),
            "contact_half_track": half,
            "wheelset_mass": 2 * wheel,
            "wheelset_roll_inertia": round(2 * wheel * (RULES.gyration * half) ** 2, 2),
            "roll_centre_height": round(tyre_size(sheet.tyres[index])[1] / 2, 3),
        }
    return Axle(
        x=round(x, 4),
        **unsprung,
        spring_stiffness=round(spring),
        damping=round(2 * sheet.damping_ratio * math.sqrt(spring * load)),
        tyre_stiffness=round(tyre),
        anti_roll_stiffness=round(RULES.bars[min(index, 1)] * spring),
        cornering_stiffness=round(_cornering(sheet.tyres[index], load + sheet.wheels[index])),
    )


def _seats(sheet: DataSheet, centre: float) -> tuple[Seat, ...]:
    """Return seats by the place of the centre of gravity behind the front axle [m]: rows, or quarters of many seats."""
    first, second = RULES.rows
    count = sheet.seats
    if count is None:
        count = 0 if sheet.mass > RULES.light else 5 if sheet.height is None else 2
    if sheet.height is not None:
        first = RULES.front_of_van
    aside, length, person = round(RULES.aside * sheet.track, 3), sheet.distances[-1], RULES.person
    if count > RULES.most_in_rows:
        group = round(person * count / 4)
        return tuple(
            Seat(x=round(centre - share * length, 3), y=side * aside, load=group)
            for share in RULES.quarters
            for side in (1.0, -1.0)
        )
    front = round(centre - first * length, 3)
    seats = [Seat(x=front, y=side * aside, load=person) for side in (1.0, -1.0)[:count]]
    if count > 2:
        seats.append(Seat(x=round(centre - second * length, 3), load=round(person * math.sqrt(count - 2))))
    return tuple(seats)


def _cornering(tyre: str, load: float) -> float:
    """Return the usual cornering stiffness of the tyre or twin tyres [N/rad] of a corner that carries a mass [kg]."""
    force, count = STANDARD_GRAVITY * load, _count(tyre)
    return RULES.cornering * force * (force / count / RULES.usual_load) ** RULES.falling


def _count(tyre: str) -> int:
    """Return 2 for twin tyres, otherwise 1."""
    return 2 if tyre.strip().lower().startswith("2x") else 1


def _guesses(body: Body, axles: tuple[Axle, ...], sheet: DataSheet) -> tuple[LearntNumber, ...]:
    """Return the guesses with their standard deviations and sources."""
    guesses = []
    for where, axle, tyre, frequency in zip(sheet.names, axles, sheet.tyres, sheet.frequencies, strict=True):
        mass = "usual share of the mass" if sheet.unsprung_masses is None else "data sheet"
        of_wheels = {"unsprung_mass": mass}
        if axle.wheelset_mass is not None:
            of_wheels = {"wheelset_mass": mass, "wheelset_roll_inertia": "rigid axle", "half_track": "rigid axle"}
        sources = {
            "spring_stiffness": f"ride frequency {frequency:g} Hz",
            "damping": f"damping ratio {sheet.damping_ratio:g}",
            "tyre_stiffness": f"size {tyre} at {sheet.pressure / 1e5:.2g} bar",
            **of_wheels,
            "anti_roll_stiffness": "usual share of the spring",
            "cornering_stiffness": "load on the tyre",
        }
        guesses += [(where, field, getattr(axle, field), source) for field, source in sources.items()]
    for field in ("pitch_inertia", "roll_inertia"):
        guesses.append(("body", field, getattr(body, field), "radius of gyration"))
    guesses.append(("body", "height", body.height or 0.0, "size of the vehicle"))
    widths = [float(f"{getattr(WIDTHS, field) * value:.3g}") for _, field, value, _ in guesses]
    guesses.append(
        ("body", "centre_x", 0.0, "share of the front axle" if sheet.axle_loads is None else "loads of the axles")
    )
    widths.append(round(WIDTHS.front_share * sheet.distances[-1], 4))
    return tuple(
        LearntNumber(name=f"{where}.{field}", value=float(value), std=std, source=f"guess: {source}")
        for (where, field, value, source), std in zip(guesses, widths, strict=True)
    )


def _sensors(sheet: DataSheet, places: tuple[float, ...]) -> tuple[Sensor, ...]:
    """Return the sensors of the usual layouts."""
    names = corner_names(len(places))
    channels = [_channel_end(name) for name in names]
    if sheet.sensors == "corners":
        sides = [sign * sheet.track / 2 for sign in (1.0, -1.0)]
        where = [(round(x, 4), y) for x in places for y in sides]
        return tuple(accelerometer(f"acc_{end}", *place) for end, place in zip(channels, where, strict=True))
    if sheet.sensors == "travel":
        return tuple(
            Sensor(channel=f"travel_{end}", quantity="travel", unit="m", between=name)
            for end, name in zip(channels, names, strict=True)
        )
    return (
        accelerometer("acc_z", 0.0, 0.0),
        gyroscope("gyro_x", (1.0, 0.0, 0.0)),
        gyroscope("gyro_y", (0.0, 1.0, 0.0)),
    )


def _channel_end(corner: str) -> str:
    """Return the end of the names of a corner's channels: "fl", "2r" of axle2_right, "rr"."""
    axle, side = corner.rsplit("_", 1)
    return (axle[0] if axle in {"front", "rear"} else axle.removeprefix("axle")) + side[0]


def accelerometer(channel: str, x: float, y: float) -> Sensor:
    """Return an accelerometer on the body that measures upwards."""
    place, upright = (x, y, 0.0), (0.0, 0.0, 1.0)
    return Sensor(channel=channel, quantity="acceleration", unit="m/s^2", position=place, direction=upright)


def gyroscope(channel: str, direction: tuple[float, float, float]) -> Sensor:
    """Return a gyroscope at the centre of gravity."""
    centre = (0.0, 0.0, 0.0)
    return Sensor(channel=channel, quantity="angular_velocity", unit="rad/s", position=centre, direction=direction)
