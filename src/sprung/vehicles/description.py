"""Contents of a vehicle file, body, axles or bogies, sensors, with the checks of every field."""

import math
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from types import MappingProxyType
from typing import Annotated, Literal, NamedTuple, TypeVar

from pydantic import AfterValidator, Field, model_validator
from pydantic_core import PydanticKnownError

from sprung._checks import check_number, check_type
from sprung._display import in_short, listed
from sprung.errors import ParameterError
from sprung.units import STANDARD_GRAVITY
from sprung.vehicles.sections import (
    LONGEST_DELAY,
    Axle,
    Body,
    Bogie,
    ChainMass,
    FlexibleMode,
    LearntNumber,
    MountedMass,
    Name,
    Positive,
    QuarterBody,
    QuarterCorner,
    Seat,
    Section,
    Sensor,
)
from sprung.vehicles.structure import FLEXIBLE_SHAPES, MOTIONS


@dataclass(frozen=True, slots=True)
class _Limits:
    """Magnitudes beyond which a number of a vehicle file is taken for one in a wrong unit."""

    gyration: tuple[float, float] = (0.05, 4.0)  # radius over the distance of the farthest axle or wheel
    farthest: float = 5.0  # place of a sensor or mounted mass over the wheelbase
    highest: float = 10.0  # height over the wheelbase
    half_tracks: tuple[float, float] = (0.002, 20.0)  # over the wheelbase
    longest: float = 100.0  # wheelbase [m]
    mass_of_area: tuple[float, float] = (0.5, 5e4)  # [kg/m^2]: a plate on springs has 20, a locomotive 4000
    highest_bounce: float = 200.0  # [Hz], of a vehicle of full size; a shorter model has the root of its scale (Froude)
    full_size: float = 2.5  # wheelbase from which a vehicle is none of these models [m]
    deepest: float = 25.0  # sinking of a quarter vehicle into its spring [m]; of a vehicle on axles: its wheelbase
    unsprung: tuple[float, float] = (1e-3, 50.0)  # mass of a wheel over the mass above it
    tyres: tuple[float, float] = (0.05, 1e6)  # stiffness over that of the spring above
    heaviest_mounted: float = 20.0  # mounted mass over that of the body
    damping: tuple[float, float] = (1e-3, 20.0)  # ratio of the body above a wheel; 0 and low ones of a rig are a choice


_LIMITS = _Limits()

#: Coordinates of the body; sway and yaw only where what holds it sideways is given.
BODY_MOTIONS = ("bounce", "pitch", "roll", "sway", "yaw")
#: Default of missing inertias: radius of gyration squared over front times rear axle distance (pitch), or over half
#: the track width squared (roll). The shipped vehicles have 0.77 to 0.90 and 0.49 to 0.57.
PITCH_SHARE, ROLL_SHARE = 0.85, 0.5


def corner_names(n_axles: int) -> tuple[str, ...]:
    """Return the names of the corners from front to rear, left before right.

    Raises
    ------
    ParameterError
        If there are fewer than two axles.

    Examples
    --------
    >>> corner_names(3)
    ('front_left', 'front_right', 'axle2_left', 'axle2_right', 'rear_left', 'rear_right')
    """
    check_number("n_axles", n_axles, at_least=2)
    axles = ["front", *(f"axle{number}" for number in range(2, n_axles)), "rear"]
    return tuple(f"{axle}_{side}" for axle in axles for side in ("left", "right"))


class Wheel(NamedTuple):
    """Wheel by the name of its corner, its place on the road or track [m], and the radius on which it rolls [m/rad]."""

    corner: str
    x: float
    y: float
    rolling_radius: float | None = None


_Support = TypeVar("_Support", Axle, Bogie)


def _none_or_several(supports: tuple[_Support, ...]) -> tuple[_Support, ...]:
    """Refuse a single axle or bogie, on which no body stands."""
    if len(supports) == 1:
        raise PydanticKnownError("too_short", {"field_type": "Tuple", "min_length": 2, "actual_length": 1})
    return supports


class Description(Section):
    """Fields of all vehicle files.

    Parameters
    ----------
    schema
        Version of the file.
    name
        Name of the vehicle.
    speed_channel
        Channel with the speed [m/s].
    speed_delay
        Time by which that channel is late [s]; negative: early.
    speed_scale
        True speed divided by the speed that the channel states.
    sensor
        Sensors of the recordings.
    """

    schema_name: Literal["sprung.vehicle/1"] = Field(alias="schema", default="sprung.vehicle/1")
    name: Name
    speed_channel: Name = "speed"
    speed_delay: Annotated[float, Field(ge=-LONGEST_DELAY, le=LONGEST_DELAY, allow_inf_nan=False)] = 0.0
    speed_scale: Positive = 1.0
    sensor: Annotated[tuple[Sensor, ...], Field(strict=False, max_length=1000)] = ()

    def __repr__(self) -> str:
        """Return name and kind, sensors, and coordinates."""
        sensors = listed(sensor.channel for sensor in self.sensor) or "no sensors"
        head = f"{type(self).__name__} {self.name!r} of kind {getattr(self, 'kind', 'none')}"
        return in_short(head, f"sensors: {sensors}", f"coordinates: {listed(self.coordinates)}")

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates of the motion."""
        return ()

    @property
    def parts(self) -> tuple[str, ...]:
        """Parts that can carry a sensor: the body, and every coordinate that is not a motion of the body."""
        of_body = {*BODY_MOTIONS, *FLEXIBLE_SHAPES}
        others = tuple(
            name for name in self.coordinates if name not in of_body and not name.endswith(("_pitch", "_roll"))
        )
        return others if "bounce" not in self.coordinates else ("body", *others)

    @property
    def suspensions(self) -> tuple[str, ...]:
        """Owners of the suspensions, between whose ends sensors can be."""
        return ()

    @model_validator(mode="after")
    def _sensors_fit(self) -> "Description":
        names = [sensor.channel for sensor in self.sensor]
        for number, sensor in enumerate(self.sensor, start=1):
            if names.count(sensor.channel) > 1:
                raise ValueError(f"channel {sensor.channel!r} has more than one [[sensor]]: rename or remove one")
            if sensor.is_motion and sensor.between is None and sensor.on not in self.parts:
                raise ValueError(
                    f"[[sensor]] {number}, on={sensor.on!r} must be one of {', '.join(self.parts)}: correct it"
                )
            if sensor.between is not None and sensor.between not in self.suspensions:
                known = f"must be one of {', '.join(self.suspensions)}: correct it"
                raise ValueError(
                    f"[[sensor]] {number}, between={sensor.between!r} "
                    + (known if self.suspensions else "needs a vehicle with corners: remove it")
                )
        return self


class Vehicle(Description):
    """Body on two or more axles, or on bogies, from front to rear; for the other fields see `Description`.

    Parameters
    ----------
    kind
        Excitation of the wheels: a road or track, whose rear wheels follow the front ones, or a rig of rollers.
    body
        Sprung body.
    axle
        Axles from front to rear.
    bogie
        Bogies from front to rear, in place of axles: a rail vehicle with two stages of suspension.
    mounted_mass
        Masses on mounts on the body.
    seat
        Seats on the body, whose load is each window's own.
    flexible_mode
        Torsion and bending of the body.
    learnt
        Numbers that a calibration learnt from drives.
    """

    kind: Literal["road", "rail", "rig"]
    body: Body = Body()
    axle: Annotated[tuple[Axle, ...], Field(strict=False, max_length=50), AfterValidator(_none_or_several)] = ()
    bogie: Annotated[tuple[Bogie, ...], Field(strict=False, max_length=20), AfterValidator(_none_or_several)] = ()
    mounted_mass: Annotated[tuple[MountedMass, ...], Field(strict=False, max_length=50)] = ()
    seat: Annotated[tuple[Seat, ...], Field(strict=False, max_length=20)] = ()
    flexible_mode: Annotated[tuple[FlexibleMode, ...], Field(strict=False, max_length=2)] = ()
    learnt: Annotated[tuple[LearntNumber, ...], Field(strict=False, max_length=1000)] = ()

    @property
    def inertias(self) -> tuple[float, float]:
        """Pitch and roll inertia of the body [kg m^2], estimated from mass and geometry where the file has none."""
        body, supports = self.body, self.axle or self.bogie
        pitch = body.pitch_inertia or PITCH_SHARE * body.mass * supports[0].x * -supports[-1].x
        return pitch, body.roll_inertia or ROLL_SHARE * body.mass * self.half_width**2

    @property
    def wheels(self) -> tuple[Wheel, ...]:
        """Wheels from front to rear, left before right; places of axles without wheels too."""
        axles = [(axle.x, axle.contact_half_track or axle.half_track, axle.rolling_radius) for axle in self.axle] + [
            (bogie.x + sign * bogie.half_wheelbase, bogie.contact_half_spacing, None)
            for bogie in self.bogie
            for sign in (1, -1)
        ]
        names = self.suspensions if self.axle else [name for name in self.suspensions if name.count("_") > 1]
        places = [(x, side * half, radius) for x, half, radius in axles for side in (1, -1)]
        return tuple(Wheel(name, *place) for name, place in zip(names, places, strict=True))

    @property
    def wheelbase(self) -> float:
        """Distance of the last axle or wheelset behind the first one [m]."""
        return self.wheels[0].x - self.wheels[-1].x

    @property
    def suspensions(self) -> tuple[str, ...]:
        """Names of the corners; of bogies the sides of the secondary and the axle boxes of the primary suspension."""
        if self.axle:
            return corner_names(len(self.axle))
        places = ("left", "right", "front_left", "front_right", "rear_left", "rear_right")
        return tuple(f"bogie{number}_{place}" for number in range(1, len(self.bogie) + 1) for place in places)

    @property
    def sways_on_bogies(self) -> bool:
        """Whether the file states what holds body and frames sideways, so that they sway as they roll."""
        return bool(self.bogie) and self.body.height is not None and all(bogie.lateral for bogie in self.bogie)

    @property
    def surges_on_bogies(self) -> bool:
        """Whether the file states, with traction rods, what holds frames along the track, so that they surge."""
        return self.sways_on_bogies and all(bogie.lateral and bogie.lateral.traction_rod for bogie in self.bogie)

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the motions of body, frames, wheels or wheelsets and mounted masses, and of the flexible modes."""
        sways = self.axle and (self.axle[0].lateral_stiffness or self.axle[0].cornering_stiffness) is not None
        body = (*BODY_MOTIONS[: 5 if sways or self.sways_on_bogies else 3], *["surge"] * self.surges_on_bogies)
        bogies: list[str] = []
        for number in range(1, len(self.bogie) + 1):
            bogies += [f"bogie{number}", f"bogie{number}_pitch", f"bogie{number}_roll"]
            bogies += [f"bogie{number}_sway", f"bogie{number}_yaw"] * self.sways_on_bogies
            bogies += [f"bogie{number}_surge", f"bogie{number}_rolling"] * self.surges_on_bogies
            for wheelset in (f"wheelset{2 * number - 1}", f"wheelset{2 * number}"):
                bogies += [wheelset, f"{wheelset}_roll"]
                bogies += [f"{wheelset}_sway", f"{wheelset}_yaw"] * self.sways_on_bogies
        wheels: list[str] = []
        for axle, left, right in zip(self.axle, self.suspensions[::2], self.suspensions[1::2], strict=False):
            name = left.removesuffix("_left")
            if axle.wheelset_mass is not None:
                wheels += [f"wheelset_{name}", f"wheelset_{name}_roll"]
            elif axle.tyre_stiffness is not None:
                wheels += [f"wheel_{left}", f"wheel_{right}"]
        mounted = [f"mounted_mass_{number}" for number in range(1, len(self.mounted_mass) + 1)]
        flexible = [mode.shape for mode in self.flexible_mode]
        return (*body, *bogies, *wheels, *mounted, *flexible)

    @property
    def half_width(self) -> float:
        """Largest distance of a spring from the middle [m]."""
        return max([axle.half_track for axle in self.axle] + [max(bogie.half_spacing) for bogie in self.bogie])

    @model_validator(mode="after")
    def _axles_in_order(self) -> "Vehicle":
        if self.bogie:
            self._check_bogies()
        elif not self.axle:
            raise ValueError("axle is missing: add it")
        what, supports = ("bogies", self.bogie) if self.bogie else ("axles", self.axle)
        positions = [support.x for support in supports]
        if positions != sorted(set(positions), reverse=True) or not positions[0] > 0 > positions[-1]:
            raise ValueError(
                f"x of the {what} is {positions}, but must fall from front to rear with the body's centre of gravity "
                f"(x = 0) between the first and the last: order the {what} and give x behind it a minus sign"
            )
        for sensor in self.sensor:
            if sensor.is_motion and sensor.between is None and (sensor.on == "body" or sensor.on.startswith("bogie")):
                self._check_layout(sensor)
            if sensor.quantity == "wheel_speed":
                self._check_wheel(sensor)
        for name in ("lateral_stiffness", "cornering_stiffness"):
            if len({getattr(axle, name) is None for axle in self.axle}) > 1:
                raise ValueError(f"{name} is given for some axles only: give it for all, or for none")
        if self.axle and self.axle[0].cornering_stiffness is not None and self.body.height is None:
            raise ValueError("cornering_stiffness needs the height of the centre of gravity: add height to [body]")
        _check(_magnitudes(self))
        return self

    def _check_bogies(self) -> None:
        """Raise if the file has what a vehicle on bogies cannot have."""
        if self.axle:
            raise ValueError("the file has both [[axle]] and [[bogie]] tables: keep those of one kind")
        if self.kind != "rail":
            raise ValueError(f'kind={self.kind!r} must be "rail" for a vehicle with [[bogie]] tables: correct it')
        if any(mode.shape != "bending" for mode in self.flexible_mode):
            raise ValueError('shape = "torsion" is for bodies on [[axle]] tables: remove it')
        if any(sensor.quantity == "wheel_speed" for sensor in self.sensor):
            raise ValueError("quantity 'wheel_speed' is for wheels of [[axle]] tables: give the speed in m/s")

    @model_validator(mode="after")
    def _shapes_differ(self) -> "Vehicle":
        shapes = [mode.shape for mode in self.flexible_mode]
        if len(set(shapes)) < len(shapes):
            raise ValueError(f"[[flexible_mode]]: shape {shapes[0]!r} occurs more than once: remove one")
        return self

    @staticmethod
    def _check_layout(sensor: Sensor) -> None:
        """Raise if a motion sensor on the body lacks the position or axis that its rigid motion needs."""
        _, is_rotation = MOTIONS[sensor.quantity]
        wanted = ("direction",) if is_rotation else ("position", "direction")
        missing = [name for name in wanted if getattr(sensor, name) is None]
        if missing:
            raise ValueError(f"sensor {sensor.channel!r} has no {missing[0]}: add {missing[0]} = [forward, left, up]")

    def _check_wheel(self, sensor: Sensor) -> None:
        """Raise if a sensor of a wheel's rotation is not on a wheel of known radius."""
        wheels = {f"wheel_{wheel.corner}": wheel for wheel in self.wheels}
        if sensor.on not in wheels:
            raise ValueError(
                f"sensor {sensor.channel!r}, on={sensor.on!r} must be one of {', '.join(wheels)}: correct it"
            )
        if wheels[sensor.on].rolling_radius is None:
            raise ValueError(
                f"sensor {sensor.channel!r} measures the rotation of {sensor.on}, whose axle has no rolling_radius: "
                "add rolling_radius = 0.31 (in metres) to the axle"
            )


def check_on_axles(vehicle: Vehicle, what: str) -> None:
    """Refuse a vehicle on bogies, or what is no vehicle, for what needs axles.

    Raises
    ------
    ParameterError
        If it is not a vehicle on axles.
    """
    check_type("vehicle", vehicle, Vehicle)
    if vehicle.bogie:
        raise ParameterError(f"vehicle {vehicle.name!r} stands on [[bogie]] tables, but {what} needs [[axle]] tables")


class Quarter(Description):
    """Quarter vehicle: a body that bounces on one wheel; for the other fields see `Description`.

    Parameters
    ----------
    kind
        Kind of the vehicle.
    body
        Sprung mass.
    corner
        Wheel and suspension.
    """

    kind: Literal["quarter"]
    body: QuarterBody = QuarterBody()
    corner: QuarterCorner

    @model_validator(mode="after")
    def _is_plausible(self) -> "Quarter":
        _check(_suspension("[corner]", self.corner, self.body.mass, room=_LIMITS.deepest, is_road=False))
        return self

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the motions of the body and of the wheel."""
        return ("bounce", "wheel")

    @property
    def suspensions(self) -> tuple[str, ...]:
        """The only corner."""
        return ("corner",)


class Chain(Description):
    """Masses above one another, from the ground up, the last one free; other fields: see `Description`.

    Parameters
    ----------
    kind
        Kind of the vehicle.
    mass
        Masses from the ground up.
    """

    kind: Literal["chain"]
    mass: Annotated[tuple[ChainMass, ...], Field(strict=False, min_length=1, max_length=200)]

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the masses from the ground up."""
        return tuple(f"mass_{number}" for number in range(1, len(self.mass) + 1))


#: Description of each kind of vehicle.
KINDS: MappingProxyType[str, type[Chain] | type[Quarter] | type[Vehicle]] = MappingProxyType(
    {"road": Vehicle, "rail": Vehicle, "rig": Vehicle, "quarter": Quarter, "chain": Chain}
)


class _Magnitude(NamedTuple):
    """A number with the range that it must be in, and what to say where it is below or above."""

    what: str
    number: float
    low: float = -math.inf
    high: float = math.inf
    below: str = ""
    above: str = ""


def _check(magnitudes: Iterable[_Magnitude]) -> None:
    """Reject the first number that no vehicle has; the usual reason is a wrong unit."""
    for what, number, low, high, below, above in magnitudes:
        if not low <= number <= high:
            raise ValueError(f"{what}: {below if number < low else above}")


_MILLIMETRES = "is that mm? Give metres"


def _magnitudes(vehicle: Vehicle) -> Iterator[_Magnitude]:
    """Yield the numbers of a body on axles or bogies, the most basic first."""
    table, wheelbase, body = "[[axle]]" if vehicle.axle else "[[bogie]]", vehicle.wheelbase, vehicle.body
    base = f"{table}, x: a wheelbase of {wheelbase:g} m"
    of_vehicle = f"of a vehicle with a wheelbase of {wheelbase:g} m"
    axles = {f"[[axle]] {number}": axle for number, axle in enumerate(vehicle.axle, start=1)}
    bogies = {f"[[bogie]] {number}": bogie for number, bogie in enumerate(vehicle.bogie, start=1)}
    widths = {f"{where}, half_track": axle.half_track for where, axle in axles.items()} | {
        f"{where}, {name}": width
        for where, bogie in bogies.items()
        for name, width in zip(("half_spacing[1]", "half_spacing[2]"), bogie.half_spacing, strict=True)
    }
    low, high = _LIMITS.half_tracks
    for where, half in widths.items():
        name, ratio = where.rpartition(", ")[2].replace("_", " "), half / wheelbase
        yield _Magnitude(f"{where}={half:g} m {of_vehicle}", ratio, high=high, above=_MILLIMETRES)
        yield _Magnitude(f"{base} with a {name} of {half:g} m", ratio, low=low, below=_MILLIMETRES)
    yield _Magnitude(base, wheelbase, high=_LIMITS.longest, above=_MILLIMETRES)
    area = wheelbase * 2 * vehicle.half_width
    if body.mass != 1:  # else all is per kilogram of body
        remedy = "Give kilograms, or leave it out where all values are per kilogram of body"
        what = f"body, mass={body.mass:g} kg of a vehicle with {area:.3g} m2 between its wheels"
        limits = _LIMITS.mass_of_area
        yield _Magnitude(what, body.mass / area, *limits, f"is that t? {remedy}", f"is that g? {remedy}")
    yield from _inertias(vehicle)
    is_road = vehicle.kind in {"road", "rail"}
    for where, axle in axles.items():
        yield from _suspension(where, axle, body.mass / (2 * len(axles)), room=wheelbase, is_road=is_road)
    for where, bogie in bogies.items():
        share = body.mass / (2 * len(bogies))
        primary = _Stage(
            bogie.primary_stiffness, bogie.primary_damping, bogie.wheelset_mass / 2, bogie.contact_stiffness
        )
        secondary = _Stage(*bogie.secondary[:2], bogie.mass / 2, None)
        stages = ("secondary", secondary, share), ("primary", primary, share / 2 + bogie.mass / 4)
        for stage, corner, mass in stages:
            yield from _suspension(where, corner, mass, room=wheelbase, is_road=is_road, stage=stage)
    farthest = _LIMITS.farthest * wheelbase
    beyond = f"is more than {farthest:.3g} m, five wheelbases, from the centre of gravity"
    for number, sensor in enumerate(vehicle.sensor, start=1):
        what = f"[[sensor]] {number}, position={list(sensor.position or ())} {beyond}"
        yield _Magnitude(what, max(map(abs, sensor.position or (0.0,))), high=farthest, above=_MILLIMETRES)
    parts = {f"[[mounted_mass]] {number}": part for number, part in enumerate(vehicle.mounted_mass, start=1)}
    seats = {f"[[seat]] {number}": part for number, part in enumerate(vehicle.seat, start=1)}
    for where, part in (parts | seats).items():
        what = f"{where}, x={part.x:g}, y={part.y:g} {beyond}"
        yield _Magnitude(what, max(abs(part.x), abs(part.y)), high=farthest, above=_MILLIMETRES)
    for where, part in parts.items():
        what = f"{where}, mass={part.mass:g} kg on a body of {body.mass:g} kg"
        advice = "is that g, or is the mass of the body missing? Give kilograms"
        yield _Magnitude(what, part.mass / body.mass, high=_LIMITS.heaviest_mounted, above=advice)
    heights = {"body, height": body.height} | {
        f"{where}, {name}": getattr(axle, name)
        for where, axle in axles.items()
        for name in ("height", "rolling_radius")
    }
    for name, height in heights.items():
        what = f"{name}={height or 0:g} m {of_vehicle}"
        yield _Magnitude(what, abs(height or 0.0), high=_LIMITS.highest * wheelbase, above=_MILLIMETRES)


def _inertias(vehicle: Vehicle) -> Iterator[_Magnitude]:
    """Yield the inertias of a body of its mass and size."""
    body, advice = vehicle.body, "correct the unit"
    reach = max(abs(support.x) for support in vehicle.axle or vehicle.bogie), vehicle.half_width
    for name, inertia, length in zip(("pitch", "roll"), (body.pitch_inertia, body.roll_inertia), reach, strict=True):
        if inertia is not None:
            low, high = ((share * length) ** 2 * body.mass for share in _LIMITS.gyration)
            what = (
                f"body, {name}_inertia={inertia:g} kg m2 must be {low:.3g} to {high:.3g} for a mass of {body.mass:g} "
                f"kg with axles and wheels within {length:g} m"
            )
            yield _Magnitude(what, inertia, low, high, advice, advice)
    product, limit = body.product_of_inertia, math.sqrt(math.prod(vehicle.inertias))
    what = (
        f"body, product_of_inertia={product:g} kg m2 must be between -{limit:.4g} and {limit:.4g}, the root of pitch "
        "times roll inertia"
    )
    yield _Magnitude(what, abs(product), high=math.nextafter(limit, 0), above=advice)


class _Stage(NamedTuple):
    """Stage of a suspension, with what moves below it."""

    spring_stiffness: float
    damping: float
    unsprung_mass: float
    tyre_stiffness: float | None


def _suspension(
    where: str, corner: Axle | QuarterCorner | _Stage, mass: float, *, room: float, is_road: bool, stage: str = ""
) -> Iterator[_Magnitude]:
    """Yield the numbers of a suspension against the mass above it [kg] and the room below it [m]."""
    above, stiffness = f"under {mass:.3g} kg of body", corner.spring_stiffness
    named = {"spring": f"{stage}_stiffness", "damper": f"{stage}_damping", "tyre": "contact_stiffness"}
    named = named if stage else {"spring": "spring_stiffness", "damper": "damping", "tyre": "tyre_stiffness"}
    spring = f"{where}, {named['spring']}={stiffness:g} N/m {above}"
    sinking = STANDARD_GRAVITY * mass / stiffness
    what = f"{spring}: sinking by {sinking:.3g} m, more than {room:.3g} m"
    yield _Magnitude(what, sinking, high=room, above="is that N/mm? Give N/m")
    frequency = math.sqrt(stiffness / mass) / (2 * math.pi)
    highest = _LIMITS.highest_bounce * math.sqrt(max(1.0, _LIMITS.full_size / room))
    what = f"{spring}: a bounce at {frequency:.3g} Hz"
    yield _Magnitude(what, frequency, high=highest, above="correct the units, N/m and kg")
    if corner.unsprung_mass is not None:
        what = f"{where}, {'mass below' if stage else 'unsprung_mass'}={corner.unsprung_mass:g} kg {above}"
        grams = "is that g, or is the mass of the body missing? Give kilograms"
        yield _Magnitude(what, corner.unsprung_mass / mass, *_LIMITS.unsprung, "is that t? Give kilograms", grams)
    if corner.tyre_stiffness is not None:
        what = f"{where}, {named['tyre']}={corner.tyre_stiffness:g} N/m below springs of {stiffness:g} N/m"
        other = "is one of them in another unit? Give N/m"
        yield _Magnitude(what, corner.tyre_stiffness / stiffness, *_LIMITS.tyres, "is that N/mm? Give N/m", other)
    ratio, (low, high) = corner.damping / (2 * math.sqrt(stiffness * mass)), _LIMITS.damping
    what = f"{where}, {named['damper']}={corner.damping:g} N s/m {above}: that damps it by {100 * ratio:.2g} %"
    units = "Give N s/m, kg and N/m"
    questions = f"is that N s/mm? {units}", f"is the stiffness in another unit? {units}"
    yield _Magnitude(what, ratio, low if is_road and ratio > 0 else 0.0, high, *questions)
