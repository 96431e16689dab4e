"""What a vehicle file says: body, axles, sensors, with the checks of every field."""

import math
from enum import StrEnum
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


class Corner(StrEnum):
    """Corners of a vehicle with two axles."""

    FRONT_LEFT = "front_left"
    FRONT_RIGHT = "front_right"
    REAR_LEFT = "rear_left"
    REAR_RIGHT = "rear_right"


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
        others = tuple(name for name in self.coordinates if name not in {"bounce", "pitch", "roll"})
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
    """

    mass: Positive = 1.0
    pitch_inertia: Positive | None = None
    roll_inertia: Positive | None = None


class Axle(_Section):
    """Two wheels and their suspension; every value but x is per wheel.

    Parameters
    ----------
    x
        Distance ahead of the body's centre of gravity [m]; negative behind it.
    half_track
        Distance of the suspension from the middle [m].
    unsprung_mass
        In kg; where left out, one ninth of the body's mass is shared by all wheels.
    spring_stiffness, damping
        In N/m and N s/m.
    tyre_stiffness
        Of the tyre or the wheel-rail contact [N/m]; left out, the suspension stands on the ground without wheels.
    anti_roll_stiffness
        Force per difference between the deflections of the two springs [N/m].
    """

    x: Length
    half_track: Positive
    unsprung_mass: Positive | None = None
    spring_stiffness: Positive
    damping: NotNegative
    tyre_stiffness: Positive | None = None
    anti_roll_stiffness: NotNegative = 0.0

    @model_validator(mode="after")
    def _wheels_stand_on_tyres(self) -> "Axle":
        if self.unsprung_mass is not None and self.tyre_stiffness is None:
            raise ValueError("unsprung_mass needs tyre_stiffness: add it, or leave both out")
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
        """Bounce, pitch and roll of the body, the wheels that stand on tyres, the mounted masses."""
        corners = corner_names(len(self.axle))
        has_wheels = [axle.tyre_stiffness is not None for axle in self.axle for _ in "lr"]
        wheels = [f"wheel_{corner}" for corner, has in zip(corners, has_wheels, strict=True) if has]
        mounted = [f"mounted_mass_{number}" for number in range(1, len(self.mounted_mass) + 1)]
        return ("bounce", "pitch", "roll", *wheels, *mounted)

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
        return self

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
