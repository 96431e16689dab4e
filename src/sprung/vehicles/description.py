"""What a vehicle file says: body, axles, sensors, with the checks of every field."""

import math
from types import MappingProxyType
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from sprung._checks import check_number
from sprung.recording import QUANTITIES, Channel
from sprung.units import conversion
from sprung.vehicles.structure import MOTIONS

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Length = Annotated[float, Field(allow_inf_nan=False)]
Name = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^\S(.*\S)?$")]
Vector = Annotated[tuple[Length, Length, Length], Field(strict=False)]


#: Coordinates of the body; sway and yaw only where lateral stiffness is given.
BODY_MOTIONS = ("bounce", "pitch", "roll", "sway", "yaw")
#: Radius of gyration over the farthest axle or wheel that is plausible, and distance of a sensor over the wheelbase.
_GYRATION, _FARTHEST_SENSOR = (0.05, 4.0), 5.0
#: Plausible natural frequency of the body on its springs alone [Hz].
_BOUNCE = (0.05, 500.0)


def corner_names(n_axles: int) -> tuple[str, ...]:
    """Return the corners from front to rear, left before right.

    Examples
    --------
    >>> corner_names(3)
    ('front_left', 'front_right', 'axle2_left', 'axle2_right', 'rear_left', 'rear_right')
    """
    check_number("n_axles", n_axles, at_least=2)
    axles = ["front", *(f"axle{number}" for number in range(2, n_axles)), "rear"]
    return tuple(f"{axle}_{side}" for axle in axles for side in ("left", "right"))


class _Section(BaseModel):
    """A table of a vehicle file: typed strictly, closed to unknown keys, unchangeable."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, populate_by_name=True)


class Sensor(_Section):
    """One channel of the recordings: what it measures, where, along which axis and in which unit.

    Parameters
    ----------
    channel
        Name of the channel in the recordings.
    quantity
        A key of `sprung.recording.QUANTITIES`.
    unit
        A unit of that quantity; raw value times `scale` is in this unit.
    position
        x forward, y left, z up from the body's centre of gravity [m].
    direction
        Measured axis, or axis of rotation, of length 1.
    scale
        Multiplies the raw values.
    on
        Part that carries the sensor: "body", or a coordinate such as "wheel_front_left" or "mass_1".
    """

    channel: Name
    quantity: str
    unit: str
    position: Vector | None = None
    direction: Vector | None = None
    scale: Annotated[float, Field(allow_inf_nan=False)] = 1.0
    on: Name = "body"

    @model_validator(mode="after")
    def _fits(self) -> "Sensor":
        if self.quantity not in QUANTITIES or self.quantity == "unknown":
            known = ", ".join(quantity for quantity in QUANTITIES if quantity != "unknown")
            raise ValueError(f"quantity {self.quantity!r} is not one of {known}")
        measured, _ = conversion(self.unit)
        if QUANTITIES[measured] != QUANTITIES[self.quantity]:
            raise ValueError(
                f"unit {self.unit!r} measures {measured}, not {self.quantity}: correct the unit or the quantity"
            )
        if self.scale == 0:
            raise ValueError("scale=0 must not be 0: leave it out where raw values are in the unit")
        if self.direction is not None and abs(math.hypot(*self.direction) - 1) > 0.01:
            raise ValueError(
                f"direction {list(self.direction)} has length {math.hypot(*self.direction):.3g}, but must have 1: "
                "divide it by its length"
            )
        return self

    @property
    def factor(self) -> float:
        """SI value = factor times raw value."""
        return self.scale * conversion(self.unit)[1]

    def as_channel(self) -> Channel:
        """Return the sensor as the channel of a recording in SI units, its direction of length 1."""
        direction = self.direction
        if direction is not None:
            length = math.hypot(*direction)
            direction = (direction[0] / length, direction[1] / length, direction[2] / length)
        return Channel(self.channel, self.quantity, self.position, direction)


class Description(_Section):
    """What all vehicle files have: schema, name, sensors and the name of the speed channel."""

    schema_name: Literal["sprung.vehicle/1"] = Field(alias="schema", default="sprung.vehicle/1")
    name: Name
    speed_channel: Name = "speed"
    sensor: Annotated[tuple[Sensor, ...], Field(strict=False, max_length=1000)] = ()

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the coordinates of the motion."""
        return ()

    @property
    def parts(self) -> tuple[str, ...]:
        """What can carry a sensor: the body, and every coordinate that is no motion of the body."""
        others = tuple(name for name in self.coordinates if name not in BODY_MOTIONS and not name.endswith("_roll"))
        return others if "bounce" not in self.coordinates else ("body", *others)

    @model_validator(mode="after")
    def _sensors_fit(self) -> "Description":
        names = [sensor.channel for sensor in self.sensor]
        for number, sensor in enumerate(self.sensor, start=1):
            if names.count(sensor.channel) > 1:
                raise ValueError(f"channel {sensor.channel!r} has more than one [[sensor]]: rename or remove one")
            if sensor.quantity in MOTIONS and sensor.on not in self.parts:
                raise ValueError(
                    f"[[sensor]] {number}, on={sensor.on!r} must be one of {', '.join(self.parts)}: correct it"
                )
        return self


class Body(_Section):
    """The sprung body; its inertias are about its centre of gravity and leave mounted masses out.

    Parameters
    ----------
    mass
        In kg; 1 where left out, so that every mass, stiffness and damping of the file is per kilogram of body.
    pitch_inertia, roll_inertia
        In kg m^2; where left out, estimated from mass, wheelbase and track width.
    yaw_inertia
        In kg m^2, used with lateral stiffness only; where left out, that of pitch.
    """

    mass: Positive = 1.0
    pitch_inertia: Positive | None = None
    roll_inertia: Positive | None = None
    yaw_inertia: Positive | None = None


class Axle(_Section):
    """Two wheels and their suspension; every value but x is per wheel.

    Parameters
    ----------
    x
        Distance ahead of the body's centre of gravity [m]; negative behind it.
    half_track
        Distance of the suspension from the middle [m].
    unsprung_mass
        In kg; where left out, one ninth of the body's mass is shared by all wheels. With a wheelset what is fixed to
        it at the suspension, such as an axle box; where left out, nothing.
    wheelset_mass, wheelset_roll_inertia
        Of a rigid wheelset in the place of two wheels [kg, kg m^2]; both or none.
    spring_stiffness, damping
        In N/m and N s/m.
    tyre_stiffness
        Of the tyre or the wheel-rail contact [N/m]; left out, the suspension stands on the ground without wheels.
    anti_roll_stiffness
        Force per difference between the deflections of the two springs [N/m].
    damper_bushing_stiffness
        Of the rubber in series with the damper [N/m]; left out, the damper is fixed rigidly.
    contact_half_track
        Distance of tyre or rail contact from the middle [m], of a wheelset only; left out, that of the suspension.
    longitudinal_stiffness, lateral_stiffness, lateral_damping
        Of the suspension in the plane [N/m, N s/m]; lateral stiffness adds sway and yaw to the body's motions. Wheels
        do not move in the plane.
    height
        Of the suspension in the plane above the body's centre of gravity [m], usually negative: it couples pitch with
        longitudinal and roll with lateral stiffness.
    """

    x: Length
    half_track: Positive
    unsprung_mass: Positive | None = None
    spring_stiffness: Positive
    damping: NotNegative
    tyre_stiffness: Positive | None = None
    anti_roll_stiffness: NotNegative = 0.0
    damper_bushing_stiffness: Positive | None = None
    wheelset_mass: Positive | None = None
    wheelset_roll_inertia: Positive | None = None
    contact_half_track: Positive | None = None
    longitudinal_stiffness: NotNegative = 0.0
    lateral_stiffness: Positive | None = None
    lateral_damping: NotNegative = 0.0
    height: Length = 0.0

    @model_validator(mode="after")
    def _wheels_stand_on_tyres(self) -> "Axle":
        for name in ("unsprung_mass", "wheelset_mass"):
            if getattr(self, name) is not None and self.tyre_stiffness is None:
                raise ValueError(f"{name} needs tyre_stiffness: add it, or leave both out")
        for name, needed in (
            ("wheelset_mass", "wheelset_roll_inertia"),
            ("wheelset_roll_inertia", "wheelset_mass"),
            ("contact_half_track", "wheelset_mass"),
        ):
            if getattr(self, name) is not None and getattr(self, needed) is None:
                raise ValueError(f"{name} needs {needed}: add it, or leave {name} out")
        if self.lateral_damping > 0 and self.lateral_stiffness is None:
            raise ValueError("lateral_damping needs lateral_stiffness: add it, or leave both out")
        return self


class MountedMass(_Section):
    """A mass on mounts on the body (engine, tank, cab), moving vertically; not counted in the body's mass.

    Parameters
    ----------
    mass
        In kg.
    x, y
        Ahead and to the left of the body's centre of gravity [m].
    frequency, damping_ratio
        On its mounts with the body held [Hz, -].
    """

    mass: Positive
    x: Length
    y: Length = 0.0
    frequency: Positive
    damping_ratio: NotNegative


class Vehicle(Description):
    """A body on two or more axles, from front to rear."""

    kind: Literal["road", "rail", "rig"]
    body: Body = Body()
    axle: Annotated[tuple[Axle, ...], Field(strict=False, min_length=2, max_length=50)]
    mounted_mass: Annotated[tuple[MountedMass, ...], Field(strict=False, max_length=50)] = ()

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Motions of the body, the wheels or wheelsets that stand on tyres or rails, the mounted masses."""
        corners = corner_names(len(self.axle))
        wheels: list[str] = []
        for axle, left, right in zip(self.axle, corners[::2], corners[1::2], strict=True):
            name = left.removesuffix("_left")
            if axle.wheelset_mass is not None:
                wheels += [f"wheelset_{name}", f"wheelset_{name}_roll"]
            elif axle.tyre_stiffness is not None:
                wheels += [f"wheel_{left}", f"wheel_{right}"]
        mounted = [f"mounted_mass_{number}" for number in range(1, len(self.mounted_mass) + 1)]
        return (*BODY_MOTIONS[: 5 if self.axle[0].lateral_stiffness is not None else 3], *wheels, *mounted)

    @model_validator(mode="after")
    def _axles_in_order(self) -> "Vehicle":
        positions = [axle.x for axle in self.axle]
        if positions != sorted(set(positions), reverse=True) or not positions[0] > 0 > positions[-1]:
            raise ValueError(
                f"x of the axles is {positions}, but must fall from front to rear with the body's centre of gravity "
                "(x = 0) between the first and the last: order the axles and give x behind it a minus sign"
            )
        for sensor in self.sensor:
            if sensor.on == "body" and sensor.quantity in MOTIONS:
                self._check_layout(sensor)
        self._check_plausible()
        return self

    def _check_plausible(self) -> None:
        """Refuse what no vehicle can be; the usual reason is a wrong unit."""
        if len({axle.lateral_stiffness is None for axle in self.axle}) > 1:
            raise ValueError("lateral_stiffness is given for some axles only: give it for all, or for none")
        reach = max(abs(axle.x) for axle in self.axle), max(axle.half_track for axle in self.axle)
        for name, length in zip(("pitch_inertia", "roll_inertia"), reach, strict=True):
            inertia = getattr(self.body, name)
            if inertia is not None:
                low, high = ((share * length) ** 2 * self.body.mass for share in _GYRATION)
                if not low <= inertia <= high:
                    raise ValueError(
                        f"body, {name}={inertia:g} kg m2 must be {low:.3g} to {high:.3g} for a mass of "
                        f"{self.body.mass:g} kg with axles and wheels within {length:g} m: correct the unit"
                    )
        bounce = math.sqrt(2 * sum(axle.spring_stiffness for axle in self.axle) / self.body.mass) / (2 * math.pi)
        if not _BOUNCE[0] <= bounce <= _BOUNCE[1]:
            raise ValueError(
                f"[[axle]], spring_stiffness: a body of {self.body.mass:g} kg would bounce on these springs at "
                f"{bounce:.3g} Hz, but must do so at {_BOUNCE[0]:g} to {_BOUNCE[1]:g} Hz: correct the units, N/m and kg"
            )
        farthest = _FARTHEST_SENSOR * (self.axle[0].x - self.axle[-1].x)
        for number, sensor in enumerate(self.sensor, start=1):
            if sensor.position is not None and max(map(abs, sensor.position)) > farthest:
                raise ValueError(
                    f"[[sensor]] {number}, position={list(sensor.position)} is more than {farthest:.3g} m, five "
                    "wheelbases, from the centre of gravity: give metres"
                )

    @staticmethod
    def _check_layout(sensor: Sensor) -> None:
        """Refuse a motion sensor on the body without the place and axis that its rigid motion needs."""
        _, is_rotation = MOTIONS[sensor.quantity]
        wanted = ("direction",) if is_rotation else ("position", "direction")
        missing = [name for name in wanted if getattr(sensor, name) is None]
        if missing:
            raise ValueError(f"sensor {sensor.channel!r} has no {missing[0]}: add {missing[0]} = [forward, left, up]")


class QuarterCorner(_Section):
    """Suspension and wheel of a quarter vehicle, in the units of `Axle`."""

    unsprung_mass: Positive
    spring_stiffness: Positive
    damping: NotNegative
    tyre_stiffness: Positive
    damper_bushing_stiffness: Positive | None = None


class QuarterBody(_Section):
    """Sprung mass of a quarter vehicle [kg]; 1 where left out, so that everything is per kilogram of it."""

    mass: Positive = 1.0


class Quarter(Description):
    """A quarter vehicle: a body that bounces on one wheel."""

    kind: Literal["quarter"]
    body: QuarterBody = QuarterBody()
    corner: QuarterCorner

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Bounce of the body, and the wheel."""
        return ("bounce", "wheel")


class ChainMass(_Section):
    """A mass of a chain with the spring and damper below it, in kg, N/m and N s/m."""

    mass: Positive
    stiffness: Positive
    damping: NotNegative


class Chain(Description):
    """Masses above one another, the first one on the ground, the last one free."""

    kind: Literal["chain"]
    mass: Annotated[tuple[ChainMass, ...], Field(strict=False, min_length=1, max_length=200)]

    @property
    def coordinates(self) -> tuple[str, ...]:
        """The masses from the ground up."""
        return tuple(f"mass_{number}" for number in range(1, len(self.mass) + 1))


#: Kinds of vehicle and what their files hold.
KINDS: MappingProxyType[str, type[Chain] | type[Quarter] | type[Vehicle]] = MappingProxyType(
    {"road": Vehicle, "rail": Vehicle, "rig": Vehicle, "quarter": Quarter, "chain": Chain}
)
