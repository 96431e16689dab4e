"""Contents of a vehicle file: body, axles, sensors, with the checks of every field."""

import math
from collections.abc import Iterable, Iterator
from types import MappingProxyType
from typing import Annotated, Literal

from pydantic import Field, model_validator

from sprung._checks import check_number
from sprung._display import in_short, listed
from sprung.units import STANDARD_GRAVITY
from sprung.vehicles.sections import (
    LONGEST_DELAY,
    Axle,
    Body,
    ChainMass,
    FlexibleMode,
    LearntNumber,
    MountedMass,
    Name,
    Positive,
    QuarterBody,
    QuarterCorner,
    Section,
    Sensor,
)
from sprung.vehicles.structure import FLEXIBLE_SHAPES, MOTIONS

#: Plausible radii of gyration over the distance of the farthest axle or wheel.
_GYRATION = (0.05, 4.0)
#: Farthest sensor or mounted mass, and largest height, over the wheelbase.
_FARTHEST, _HIGHEST = 5.0, 10.0
#: Plausible half track over wheelbase, and longest wheelbase [m].
_HALF_TRACKS, _LONGEST = (0.002, 20.0), 100.0
#: Plausible mass over the area between the wheels [kg/m^2]: a plate on springs has 20, a car 400, a locomotive 4000.
_MASS_OF_AREA = (0.5, 5e4)
#: Highest plausible natural frequency of the body on its springs [Hz], of a vehicle with a wheelbase of that length [m]
#: or more; a model that is shorter vibrates faster, as the root of its scale (Froude).
_HIGHEST_BOUNCE, _FULL_SIZE = 200.0, 2.5
#: Farthest plausible sinking of a quarter vehicle into its spring [m]; that of a vehicle on axles is its wheelbase.
_DEEPEST = 25.0
#: Plausible unsprung mass and tyre stiffness of a wheel over the mass and the spring stiffness above it.
_UNSPRUNG, _TYRES = (1e-3, 50.0), (0.05, 1e6)
#: Plausible mounted mass over that of the body.
_HEAVIEST_MOUNTED = 20.0
#: Plausible damping ratio of the body above a wheel; 0 is a choice, and so is a low one of a rig.
_LEAST_DAMPED, _MOST_DAMPED = 1e-3, 20.0


#: Coordinates of the body; sway and yaw only where lateral stiffness is given.
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
        others = tuple(name for name in self.coordinates if name not in of_body and not name.endswith("_roll"))
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
    """Body on two or more axles, from front to rear; for the other fields see `Description`.

    Parameters
    ----------
    kind
        Excitation of the wheels: a road or track, whose rear wheels follow the front ones, or a rig of rollers.
    body
        Sprung body.
    axle
        Axles from front to rear.
    mounted_mass
        Masses on mounts on the body.
    flexible_mode
        Torsion and bending of the body.
    learnt
        Numbers that a calibration learnt from drives.
    """

    kind: Literal["road", "rail", "rig"]
    body: Body = Body()
    axle: Annotated[tuple[Axle, ...], Field(strict=False, min_length=2, max_length=50)]
    mounted_mass: Annotated[tuple[MountedMass, ...], Field(strict=False, max_length=50)] = ()
    flexible_mode: Annotated[tuple[FlexibleMode, ...], Field(strict=False, max_length=2)] = ()
    learnt: Annotated[tuple[LearntNumber, ...], Field(strict=False, max_length=1000)] = ()

    @property
    def inertias(self) -> tuple[float, float]:
        """Pitch and roll inertia of the body [kg m^2], estimated from mass and geometry where the file has none."""
        body, half_track = self.body, max(axle.half_track for axle in self.axle)
        pitch = body.pitch_inertia or PITCH_SHARE * body.mass * self.axle[0].x * -self.axle[-1].x
        return pitch, body.roll_inertia or ROLL_SHARE * body.mass * half_track**2

    @property
    def suspensions(self) -> tuple[str, ...]:
        """Names of the corners."""
        return corner_names(len(self.axle))

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the motions of body, wheels or wheelsets and mounted masses, and of the flexible modes."""
        corners = corner_names(len(self.axle))
        wheels: list[str] = []
        for axle, left, right in zip(self.axle, corners[::2], corners[1::2], strict=True):
            name = left.removesuffix("_left")
            if axle.wheelset_mass is not None:
                wheels += [f"wheelset_{name}", f"wheelset_{name}_roll"]
            elif axle.tyre_stiffness is not None:
                wheels += [f"wheel_{left}", f"wheel_{right}"]
        mounted = [f"mounted_mass_{number}" for number in range(1, len(self.mounted_mass) + 1)]
        flexible = [mode.shape for mode in self.flexible_mode]
        return (*BODY_MOTIONS[: 5 if self.axle[0].lateral_stiffness is not None else 3], *wheels, *mounted, *flexible)

    @model_validator(mode="after")
    def _axles_in_order(self) -> "Vehicle":
        positions = [axle.x for axle in self.axle]
        if positions != sorted(set(positions), reverse=True) or not positions[0] > 0 > positions[-1]:
            raise ValueError(
                f"x of the axles is {positions}, but must fall from front to rear with the body's centre of gravity "
                "(x = 0) between the first and the last: order the axles and give x behind it a minus sign"
            )
        for sensor in self.sensor:
            if sensor.is_motion and sensor.between is None and sensor.on == "body":
                self._check_layout(sensor)
            if sensor.quantity == "wheel_speed":
                self._check_wheel(sensor)
        if len({axle.lateral_stiffness is None for axle in self.axle}) > 1:
            raise ValueError("lateral_stiffness is given for some axles only: give it for all, or for none")
        _check_magnitudes(self)
        return self

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
        wheels = {f"wheel_{corner}": self.axle[row // 2] for row, corner in enumerate(self.suspensions)}
        if sensor.on not in wheels:
            raise ValueError(
                f"sensor {sensor.channel!r}, on={sensor.on!r} must be one of {', '.join(wheels)}: correct it"
            )
        if wheels[sensor.on].rolling_radius is None:
            raise ValueError(
                f"sensor {sensor.channel!r} measures the rotation of {sensor.on}, whose axle has no rolling_radius: "
                "add rolling_radius = 0.31 (in metres) to the axle"
            )


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
        _check_quarter(self)
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


def _check_magnitudes(vehicle: Vehicle) -> None:
    """Reject a body on axles with numbers that no vehicle has; the usual reason is a wrong unit."""
    _raise_first(_problems(vehicle))


def _check_quarter(quarter: Quarter) -> None:
    """Reject a quarter vehicle with numbers that none has."""
    _raise_first(_suspension_problems("[corner]", quarter.corner, quarter.body.mass, room=_DEEPEST, is_road=False))


def _raise_first(problems: Iterable[str]) -> None:
    """Raise the first problem, if there is one."""
    for problem in problems:
        raise ValueError(problem)


def _problems(vehicle: Vehicle) -> Iterator[str]:
    """Yield everything that is out of proportion, the most basic first."""
    wheelbase = vehicle.axle[0].x - vehicle.axle[-1].x
    yield from _geometry_problems(vehicle, wheelbase)
    yield from _inertia_problems(vehicle)
    shares = vehicle.body.mass / (2 * len(vehicle.axle))
    for number, axle in enumerate(vehicle.axle, start=1):
        yield from _suspension_problems(
            f"[[axle]] {number}", axle, shares, room=wheelbase, is_road=vehicle.kind in {"road", "rail"}
        )
    yield from _place_problems(vehicle, wheelbase)


def _geometry_problems(vehicle: Vehicle, wheelbase: float) -> Iterator[str]:
    """Yield lengths of axles that do not go together, or with the mass of the body."""
    for number, axle in enumerate(vehicle.axle, start=1):
        ratio = axle.half_track / wheelbase
        if ratio > _HALF_TRACKS[1]:
            yield (
                f"[[axle]] {number}, half_track={axle.half_track:g} m of a vehicle with a wheelbase of {wheelbase:g} "
                "m: is that mm? Give metres"
            )
        if ratio < _HALF_TRACKS[0]:
            yield (
                f"[[axle]], x: a wheelbase of {wheelbase:g} m with a half track of {axle.half_track:g} m: is that mm? "
                "Give metres"
            )
    if wheelbase > _LONGEST:
        yield f"[[axle]], x: a wheelbase of {wheelbase:g} m: is that mm? Give metres"
    mass, area = vehicle.body.mass, wheelbase * 2 * max(axle.half_track for axle in vehicle.axle)
    if mass == 1:  # all is per kilogram of body
        return
    if mass < _MASS_OF_AREA[0] * area:
        unit = "is that t?"
    elif mass > _MASS_OF_AREA[1] * area:
        unit = "is that g?"
    else:
        return
    yield (
        f"body, mass={mass:g} kg of a vehicle with {area:.3g} m2 between its wheels: {unit} Give kilograms, or leave "
        "it out where all values are per kilogram of body"
    )


def _inertia_problems(vehicle: Vehicle) -> Iterator[str]:
    """Yield inertias that a body of its mass and size cannot have."""
    reach = max(abs(axle.x) for axle in vehicle.axle), max(axle.half_track for axle in vehicle.axle)
    mass = vehicle.body.mass
    for name, length in zip(("pitch_inertia", "roll_inertia"), reach, strict=True):
        inertia = getattr(vehicle.body, name)
        low, high = ((share * length) ** 2 * mass for share in _GYRATION)
        if inertia is not None and not low <= inertia <= high:
            yield (
                f"body, {name}={inertia:g} kg m2 must be {low:.3g} to {high:.3g} for a mass of {mass:g} kg with axles "
                f"and wheels within {length:g} m: correct the unit"
            )
    limit = math.sqrt(math.prod(vehicle.inertias))
    if abs(vehicle.body.product_of_inertia) >= limit:
        yield (
            f"body, product_of_inertia={vehicle.body.product_of_inertia:g} kg m2 must be between -{limit:.4g} and "
            f"{limit:.4g}, the root of pitch times roll inertia: correct the unit"
        )


def _suspension_problems(
    where: str, corner: Axle | QuarterCorner, mass: float, *, room: float, is_road: bool
) -> Iterator[str]:
    """Yield numbers of a suspension that do not go with the mass above it [kg] and the room below it [m]."""
    above = f"under {mass:.3g} kg of body"
    sinking = STANDARD_GRAVITY * mass / corner.spring_stiffness
    if sinking > room:
        yield (
            f"{where}, spring_stiffness={corner.spring_stiffness:g} N/m {above}: sinking by {sinking:.3g} m, "
            f"more than {room:.3g} m: is that N/mm? Give N/m"
        )
    frequency = math.sqrt(corner.spring_stiffness / mass) / (2 * math.pi)
    if frequency > _HIGHEST_BOUNCE * math.sqrt(max(1.0, _FULL_SIZE / room)):
        yield (
            f"{where}, spring_stiffness={corner.spring_stiffness:g} N/m {above}: a bounce at {frequency:.3g} "
            "Hz: correct the units, N/m and kg"
        )
    if corner.unsprung_mass is not None:
        ratio = corner.unsprung_mass / mass
        if not _UNSPRUNG[0] <= ratio <= _UNSPRUNG[1]:
            unit = "is that t?" if ratio < 1 else "is that g, or is the mass of the body missing?"
            yield f"{where}, unsprung_mass={corner.unsprung_mass:g} kg {above}: {unit} Give kilograms"
    if corner.tyre_stiffness is not None:
        ratio = corner.tyre_stiffness / corner.spring_stiffness
        if not _TYRES[0] <= ratio <= _TYRES[1]:
            unit = "is that N/mm?" if ratio < 1 else "is one of them in another unit?"
            yield (
                f"{where}, tyre_stiffness={corner.tyre_stiffness:g} N/m below springs of {corner.spring_stiffness:g} "
                f"N/m: {unit} Give N/m"
            )
    yield from _damping_problems(where, corner, mass, is_road=is_road)


def _damping_problems(where: str, corner: Axle | QuarterCorner, mass: float, *, is_road: bool) -> Iterator[str]:
    """Yield a damping that does not go with spring stiffness and mass [kg]; a rig may have hardly any."""
    ratio = corner.damping / (2 * math.sqrt(corner.spring_stiffness * mass))
    if ratio > _MOST_DAMPED or (is_road and 0 < ratio < _LEAST_DAMPED):
        unit = "is that N s/mm?" if ratio < 1 else "is the stiffness in another unit?"
        yield (
            f"{where}, damping={corner.damping:g} N s/m under {mass:.3g} kg of body: that damps it by "
            f"{100 * ratio:.2g} %: {unit} Give N s/m, kg and N/m"
        )


def _place_problems(vehicle: Vehicle, wheelbase: float) -> Iterator[str]:
    """Yield places far from the vehicle, and mounted masses that are far heavier than the body."""
    farthest = _FARTHEST * wheelbase
    beyond = f"is more than {farthest:.3g} m, five wheelbases, from the centre of gravity: is that mm? Give metres"
    for number, sensor in enumerate(vehicle.sensor, start=1):
        if sensor.position is not None and max(map(abs, sensor.position)) > farthest:
            yield f"[[sensor]] {number}, position={list(sensor.position)} {beyond}"
    for number, mounted in enumerate(vehicle.mounted_mass, start=1):
        if max(abs(mounted.x), abs(mounted.y)) > farthest:
            yield f"[[mounted_mass]] {number}, x={mounted.x:g}, y={mounted.y:g} {beyond}"
        if mounted.mass > _HEAVIEST_MOUNTED * vehicle.body.mass:
            yield (
                f"[[mounted_mass]] {number}, mass={mounted.mass:g} kg on a body of {vehicle.body.mass:g} kg: is that "
                "g, or is the mass of the body missing? Give kilograms"
            )
    heights = {"body, height": vehicle.body.height}
    for number, axle in enumerate(vehicle.axle, start=1):
        heights |= {
            f"[[axle]] {number}, height": axle.height,
            f"[[axle]] {number}, rolling_radius": axle.rolling_radius,
        }
    for name, height in heights.items():
        if height is not None and abs(height) > _HIGHEST * wheelbase:
            yield (f"{name}={height:g} m of a vehicle with a wheelbase of {wheelbase:g} m: is that mm? Give metres")
