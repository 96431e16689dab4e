"""Contents of a vehicle file, body, axles, sensors, with the checks of every field; files read and written."""

import json
import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from types import MappingProxyType
from typing import Annotated, Any, Literal, NamedTuple

from pydantic import Field, model_validator

from sprung._checks import check_number, check_path, check_type
from sprung._display import in_short, listed
from sprung.errors import FormatError, ParameterError
from sprung.toml import checked, toml_fields
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
        _check(_magnitudes(self))
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
    """Yield the numbers of a body on axles, the most basic first."""
    wheelbase = vehicle.axle[0].x - vehicle.axle[-1].x
    base = f"[[axle]], x: a wheelbase of {wheelbase:g} m"
    of_vehicle = f"of a vehicle with a wheelbase of {wheelbase:g} m"
    body, share = vehicle.body, vehicle.body.mass / (2 * len(vehicle.axle))
    axles = {f"[[axle]] {number}": axle for number, axle in enumerate(vehicle.axle, start=1)}
    low, high = _LIMITS.half_tracks
    for where, axle in axles.items():
        half, ratio = axle.half_track, axle.half_track / wheelbase
        yield _Magnitude(f"{where}, half_track={half:g} m {of_vehicle}", ratio, high=high, above=_MILLIMETRES)
        yield _Magnitude(f"{base} with a half track of {half:g} m", ratio, low=low, below=_MILLIMETRES)
    yield _Magnitude(base, wheelbase, high=_LIMITS.longest, above=_MILLIMETRES)
    area = wheelbase * 2 * max(axle.half_track for axle in vehicle.axle)
    if body.mass != 1:  # else all is per kilogram of body
        remedy = "Give kilograms, or leave it out where all values are per kilogram of body"
        what = f"body, mass={body.mass:g} kg of a vehicle with {area:.3g} m2 between its wheels"
        limits = _LIMITS.mass_of_area
        yield _Magnitude(what, body.mass / area, *limits, f"is that t? {remedy}", f"is that g? {remedy}")
    yield from _inertias(vehicle)
    for where, axle in axles.items():
        yield from _suspension(where, axle, share, room=wheelbase, is_road=vehicle.kind in {"road", "rail"})
    farthest = _LIMITS.farthest * wheelbase
    beyond = f"is more than {farthest:.3g} m, five wheelbases, from the centre of gravity"
    for number, sensor in enumerate(vehicle.sensor, start=1):
        what = f"[[sensor]] {number}, position={list(sensor.position or ())} {beyond}"
        yield _Magnitude(what, max(map(abs, sensor.position or (0.0,))), high=farthest, above=_MILLIMETRES)
    for number, part in enumerate(vehicle.mounted_mass, start=1):
        where = f"[[mounted_mass]] {number}"
        what = f"{where}, x={part.x:g}, y={part.y:g} {beyond}"
        yield _Magnitude(what, max(abs(part.x), abs(part.y)), high=farthest, above=_MILLIMETRES)
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
    reach = max(abs(axle.x) for axle in vehicle.axle), max(axle.half_track for axle in vehicle.axle)
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


def _suspension(
    where: str, corner: Axle | QuarterCorner, mass: float, *, room: float, is_road: bool
) -> Iterator[_Magnitude]:
    """Yield the numbers of a suspension against the mass above it [kg] and the room below it [m]."""
    above, stiffness = f"under {mass:.3g} kg of body", corner.spring_stiffness
    spring = f"{where}, spring_stiffness={stiffness:g} N/m {above}"
    sinking = STANDARD_GRAVITY * mass / stiffness
    what = f"{spring}: sinking by {sinking:.3g} m, more than {room:.3g} m"
    yield _Magnitude(what, sinking, high=room, above="is that N/mm? Give N/m")
    frequency = math.sqrt(stiffness / mass) / (2 * math.pi)
    highest = _LIMITS.highest_bounce * math.sqrt(max(1.0, _LIMITS.full_size / room))
    what = f"{spring}: a bounce at {frequency:.3g} Hz"
    yield _Magnitude(what, frequency, high=highest, above="correct the units, N/m and kg")
    if corner.unsprung_mass is not None:
        what = f"{where}, unsprung_mass={corner.unsprung_mass:g} kg {above}"
        grams = "is that g, or is the mass of the body missing? Give kilograms"
        yield _Magnitude(what, corner.unsprung_mass / mass, *_LIMITS.unsprung, "is that t? Give kilograms", grams)
    if corner.tyre_stiffness is not None:
        what = f"{where}, tyre_stiffness={corner.tyre_stiffness:g} N/m below springs of {stiffness:g} N/m"
        other = "is one of them in another unit? Give N/m"
        yield _Magnitude(what, corner.tyre_stiffness / stiffness, *_LIMITS.tyres, "is that N/mm? Give N/m", other)
    ratio, (low, high) = corner.damping / (2 * math.sqrt(stiffness * mass)), _LIMITS.damping
    what = f"{where}, damping={corner.damping:g} N s/m {above}: that damps it by {100 * ratio:.2g} %"
    units = "Give N s/m, kg and N/m"
    questions = f"is that N s/mm? {units}", f"is the stiffness in another unit? {units}"
    yield _Magnitude(what, ratio, low if is_road and ratio > 0 else 0.0, high, *questions)


#: Vehicles shipped with the package.
VEHICLES = ("chain3", "plate", "quarter", "scale-bogie", "y25", "zafira", "zafira-printed")

# A vehicle file is a page of text; anything larger is another file.
_LARGEST_FILE = 1_000_000


def read_vehicle(path_or_name: str | Path) -> Vehicle:
    """Read the file of a vehicle on axles, or one of those shipped with the package.

    Parameters
    ----------
    path_or_name
        A name of `VEHICLES`, or the path of a TOML file.

    Returns
    -------
    Vehicle
        Description of a body on axles (kind road, rail or rig). `read_description` reads quarter vehicles and chains
        as well.

    Raises
    ------
    ParameterError
        If the file or name does not exist, or describes a quarter vehicle or a chain.
    FormatError
        If the file is not a valid vehicle file; the message names file, field, rule and remedy.

    Examples
    --------
    >>> read_vehicle("zafira").body.mass
    1480.0
    """
    return _on_axles(read_description(path_or_name), source=str(path_or_name))


def read_description(path_or_name: str | Path) -> Vehicle | Quarter | Chain:
    """Read a vehicle file of any kind, or one of the vehicles shipped with the package.

    Parameters
    ----------
    path_or_name
        A name of `VEHICLES`, or the path of a TOML file.

    Returns
    -------
    Vehicle, Quarter or Chain
        Description of the kind that the file states.

    Raises
    ------
    ParameterError
        If the file or name does not exist.
    FormatError
        If the file is not a valid vehicle file; the message names file, field, rule and remedy.

    Examples
    --------
    >>> read_description("chain3").kind
    'chain'
    """
    check_path("path_or_name", path_or_name)
    if str(path_or_name) in VEHICLES:
        return _read(str(path_or_name), _shipped(str(path_or_name)))
    path = Path(path_or_name)
    if not path.is_file():
        raise ParameterError(
            f"vehicle {str(path_or_name)!r} is neither a file nor one of {', '.join(VEHICLES)}: correct the path"
        )
    if path.stat().st_size > _LARGEST_FILE:
        raise FormatError(
            f"{path} has {path.stat().st_size} bytes, more than any vehicle file: give the TOML file of the vehicle"
        )
    return _read(str(path), path.read_bytes())


def parse_vehicle(fields: Mapping[str, Any]) -> Vehicle | Quarter | Chain:
    """Check the fields of a vehicle and return it.

    Parameters
    ----------
    fields
        Fields as in a vehicle file; `schema` may be left out.

    Raises
    ------
    ParameterError
        If a field is missing, unknown or outside its range; the message names field, rule and remedy.

    Examples
    --------
    >>> corner = {"unsprung_mass": 40.0, "spring_stiffness": 2e4, "damping": 1500.0, "tyre_stiffness": 2e5}
    >>> quarter = parse_vehicle({"kind": "quarter", "name": "mine", "corner": corner, "body": {"mass": 400.0}})
    >>> quarter.corner.tyre_stiffness
    200000.0
    """
    kind = fields.get("kind")
    if not isinstance(kind, str) or kind not in KINDS:
        raise ParameterError(f"kind={kind!r} must be one of {', '.join(KINDS)}: add or correct it")
    return checked(KINDS[kind], fields)


def write_vehicle(vehicle: Vehicle | Quarter | Chain, path: str | Path) -> None:
    """Write a vehicle file; reading it gives an equal vehicle.

    Examples
    --------
    >>> import tempfile
    >>> zafira = read_vehicle("zafira")
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_vehicle(zafira, Path(folder) / "car.toml")
    ...     again = read_vehicle(Path(folder) / "car.toml")
    ...
    >>> again == zafira
    True
    """
    check_type("vehicle", vehicle, Vehicle, Quarter, Chain)
    check_path("path", path)
    Path(path).write_text(vehicle_text(vehicle), encoding="utf-8")


def vehicle_text(vehicle: Vehicle | Quarter | Chain) -> str:
    """Return the text of a vehicle file.

    Examples
    --------
    >>> print(vehicle_text(read_vehicle("zafira")).splitlines()[0])
    schema = "sprung.vehicle/1"
    """
    fields = vehicle.model_dump(mode="json", exclude_defaults=True)
    return _toml({"schema": vehicle.schema_name, **fields})


def vehicle_from_text(text: str, *, source: str) -> Vehicle:
    """Return the vehicle on axles that the text of a file describes.

    Parameters
    ----------
    text
        Content of a vehicle file.
    source
        Name of the file in messages.

    Raises
    ------
    FormatError
        If the text is not a valid vehicle file.
    ParameterError
        If it describes a quarter vehicle or a chain.

    Examples
    --------
    >>> text = vehicle_text(read_vehicle("zafira"))
    >>> vehicle_from_text(text, source="zafira.toml") == read_vehicle("zafira")
    True
    """
    return _on_axles(_read(source, text.encode("utf-8")), source=source)


def _on_axles(description: Vehicle | Quarter | Chain, *, source: str) -> Vehicle:
    """Reject a description that is not of a body on axles."""
    if not isinstance(description, Vehicle):
        raise ParameterError(
            f"vehicle {source!r} is of kind {description.kind}, but must be a body on axles (kind road, rail or rig): "
            "give the file of such a vehicle"
        )
    return description


def _shipped(name: str) -> bytes:
    """Text of a vehicle file of the package."""
    return (resources.files("sprung.vehicles") / "data" / f"{name}.toml").read_bytes()


def _read(source: str, content: bytes) -> Vehicle | Quarter | Chain:
    """Parse and check a vehicle file; `source` is its name in messages."""
    fields = toml_fields(content, source=source)
    if fields.get("schema") != "sprung.vehicle/1":
        raise FormatError(
            f'{source}: schema={fields.get("schema")!r} must be "sprung.vehicle/1": add it as the first line if this '
            "is a vehicle file"
        )
    try:
        return parse_vehicle(fields)
    except ParameterError as error:
        raise FormatError(f"{source}: {error}") from None


def _toml(fields: Mapping[str, Any], prefix: str = "") -> str:
    """Write scalars and lists, then tables, then arrays of tables."""
    lines = [f"{key} = {_toml_value(value)}" for key, value in fields.items() if not _is_table(value)]
    for key, value in fields.items():
        if isinstance(value, Mapping):
            lines.append(f"\n[{prefix}{key}]\n{_toml(value)}".rstrip("\n"))
        elif _is_table(value):
            lines += [f"\n[[{prefix}{key}]]\n{_toml(entry)}".rstrip("\n") for entry in value]
    return "\n".join(lines) + "\n"


def _is_table(value: Any) -> bool:
    """Whether a value is a table or a list of tables."""
    return isinstance(value, Mapping) or (isinstance(value, list) and bool(value) and isinstance(value[0], Mapping))


def _toml_value(value: Any) -> str:
    """Write text, numbers and lists of numbers; their TOML is their JSON, but for the delete character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")
