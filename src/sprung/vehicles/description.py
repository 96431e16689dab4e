"""Contents of a vehicle file: body, axles, sensors, with the checks of every field."""

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
#: Plausible radii of gyration over the distance of the farthest axle or wheel, and largest plausible distance of a
#: sensor over the wheelbase.
_GYRATION, _FARTHEST_SENSOR = (0.05, 4.0), 5.0
#: Plausible natural frequency of the body on its springs alone [Hz].
_BOUNCE = (0.05, 500.0)


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


class _Section(BaseModel):
    """Table of a vehicle file: strictly typed, without unknown keys, immutable."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, populate_by_name=True)


class Sensor(_Section):
    """Sensor of one channel of the recordings: quantity, unit, place and axis.

    Parameters
    ----------
    channel
        Name of the channel in the recordings.
    quantity
        Key of `sprung.recording.QUANTITIES`.
    unit
        Unit of that quantity; raw value times `scale` is in this unit.
    position
        Position x forward, y left, z up from the body's centre of gravity [m].
    direction
        Measured axis, or axis of rotation, of length 1.
    scale
        Factor of the raw values, not 0.
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
    """Fields of all vehicle files: schema, name, sensors and the name of the speed channel."""

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
        """Parts that can carry a sensor: the body, and every coordinate that is not a motion of the body."""
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
    """Sprung body; its inertias are about its centre of gravity, without mounted masses.

    Parameters
    ----------
    mass
        Mass [kg]; default: 1, so that every mass, stiffness and damping of the file is per kilogram of body.
    pitch_inertia, roll_inertia
        Moments of inertia [kg m^2]; default: estimates from mass, wheelbase and track width.
    yaw_inertia
        Moment of inertia [kg m^2], used only with lateral stiffness; default: that of pitch.
    """

    mass: Positive = 1.0
    pitch_inertia: Positive | None = None
    roll_inertia: Positive | None = None
    yaw_inertia: Positive | None = None


class Axle(_Section):
    """Two wheels and their suspension; all values but x are per wheel.

    Parameters
    ----------
    x
        Distance ahead of the body's centre of gravity [m]; negative behind it.
    half_track
        Distance of the suspension from the middle [m].
    unsprung_mass
        Unsprung mass of a wheel [kg]; default: all wheels share one ninth of the mass of the body. With a wheelset:
        mass fixed to it at the suspension, such as an axle box; default: none.
    wheelset_mass, wheelset_roll_inertia
        Mass [kg] and roll inertia [kg m^2] of a rigid wheelset that replaces the two wheels; both or neither.
    spring_stiffness, damping
        Stiffness of the spring [N/m] and damping of the damper [N s/m].
    tyre_stiffness
        Stiffness of the tyre or the wheel-rail contact [N/m]; default: no wheels, the suspension stands on the ground.
    anti_roll_stiffness
        Force per difference between the deflections of the two springs [N/m].
    damper_bushing_stiffness
        Stiffness of the bushing in series with the damper [N/m]; default: the damper is attached rigidly.
    contact_half_track
        Distance of the tyre or rail contact of a wheelset from the middle [m]; default: that of the suspension.
    longitudinal_stiffness, lateral_stiffness, lateral_damping
        Horizontal stiffness [N/m] and damping [N s/m] of the suspension; lateral stiffness adds sway and yaw to the
        motions of the body. Wheels do not move horizontally.
    height
        Height of the horizontal suspension above the body's centre of gravity [m], usually negative: it couples pitch
        with longitudinal and roll with lateral stiffness.
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
    """Mass on mounts on the body (engine, tank, cab) that moves vertically; not part of the mass of the body.

    Parameters
    ----------
    mass
        Mass [kg].
    x, y
        Position ahead and to the left of the body's centre of gravity [m].
    frequency, damping_ratio
        Natural frequency [Hz] and damping ratio on the mounts with the body fixed.
    """

    mass: Positive
    x: Length
    y: Length = 0.0
    frequency: Positive
    damping_ratio: NotNegative


class Vehicle(Description):
    """Body on two or more axles, from front to rear."""

    kind: Literal["road", "rail", "rig"]
    body: Body = Body()
    axle: Annotated[tuple[Axle, ...], Field(strict=False, min_length=2, max_length=50)]
    mounted_mass: Annotated[tuple[MountedMass, ...], Field(strict=False, max_length=50)] = ()

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the motions of the body, of the wheels or wheelsets, and of the mounted masses."""
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
        """Raise if values are implausible for any vehicle; the usual reason is a wrong unit."""
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
        """Raise if a motion sensor on the body lacks the position or axis that its rigid motion needs."""
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
    """Sprung mass of a quarter vehicle [kg]; default: 1, so that all values are per kilogram of sprung mass."""

    mass: Positive = 1.0


class Quarter(Description):
    """Quarter vehicle: a body that bounces on one wheel."""

    kind: Literal["quarter"]
    body: QuarterBody = QuarterBody()
    corner: QuarterCorner

    @property
    def coordinates(self) -> tuple[str, ...]:
        """Names of the motions of the body and of the wheel."""
        return ("bounce", "wheel")


class ChainMass(_Section):
    """Mass of a chain [kg] with the spring [N/m] and damper [N s/m] below it."""

    mass: Positive
    stiffness: Positive
    damping: NotNegative


class Chain(Description):
    """Masses above one another, the first one on the ground, the last one free."""

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
