"""Tables of a vehicle file: sensor, body, axle, mounted mass, flexible mode, learnt number."""

import math
from types import MappingProxyType
from typing import Annotated, Literal

from pydantic import AliasChoices, BaseModel, ConfigDict, Field, model_validator

from sprung.recording import QUANTITIES, Channel
from sprung.signals.data_faults import CONDITIONS
from sprung.units import STANDARD_ATMOSPHERE, conversion
from sprung.vehicles.structure import MOTIONS

Positive = Annotated[float, Field(gt=0, allow_inf_nan=False)]
NotNegative = Annotated[float, Field(ge=0, allow_inf_nan=False)]
Length = Annotated[float, Field(allow_inf_nan=False)]
Name = Annotated[str, Field(min_length=1, max_length=100, pattern=r"^\S(.*\S)?$")]
Vector = Annotated[tuple[Length, Length, Length], Field(strict=False)]

#: Longest delay of a channel [s].
LONGEST_DELAY = 10.0
#: Quantities of sensors, and those of their channels in recordings: a file of samples states the unit, and not what
#: moves.
SENSOR_QUANTITIES = MappingProxyType(
    {quantity: quantity for quantity in QUANTITIES if quantity != "unknown"}
    | {"travel": "displacement", "wheel_speed": "angular_velocity"}
)


class Section(BaseModel):
    """Table of a vehicle file: strictly typed, without unknown keys, immutable."""

    model_config = ConfigDict(strict=True, extra="forbid", frozen=True, populate_by_name=True, defer_build=True)


class Sensor(Section):
    """Sensor of one channel of the recordings: quantity, unit, place and axis.

    Parameters
    ----------
    channel
        Name of the channel in the recordings.
    quantity
        Key of `SENSOR_QUANTITIES`.
    unit
        Unit of that quantity; raw value times `scale` is in this unit.
    position
        Position x forward, y left, z up from the body's centre of gravity [m]; of a sensor on a bogie frame or wheelset
        of a vehicle with two stages, from its own.
    direction
        Measured axis, or axis of rotation, of length 1.
    scale
        Factor of the raw values, not 0.
    on
        Part that carries the sensor: "body", or a coordinate such as "wheel_front_left", "bogie1" or "mass_1". A file
        may also call this key `body`.
    between
        Suspension between whose ends the sensor is, such as "front_left": its elongation is the quantity "travel",
        positive in extension; with the quantity "temperature", that of the damper.
    delay
        Time by which the channel is late [s]; negative: early.
    """

    channel: Name
    quantity: str
    unit: str
    position: Vector | None = None
    direction: Vector | None = None
    scale: Annotated[float, Field(allow_inf_nan=False)] = 1.0
    on: Name = Field("body", validation_alias=AliasChoices("on", "body"))
    between: Name | None = None
    delay: Annotated[float, Field(ge=-LONGEST_DELAY, le=LONGEST_DELAY, allow_inf_nan=False)] = 0.0

    @model_validator(mode="after")
    def _fits(self) -> "Sensor":
        if self.quantity not in SENSOR_QUANTITIES:
            raise ValueError(f"quantity {self.quantity!r} is not one of {', '.join(SENSOR_QUANTITIES)}")
        measured, _ = conversion(self.unit)
        if QUANTITIES[measured] != QUANTITIES[SENSOR_QUANTITIES[self.quantity]]:
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
        if self.quantity == "travel" and self.between is None:
            raise ValueError("quantity 'travel' needs the suspension that it measures: add between = \"front_left\"")
        if self.between is not None and self.quantity not in {"travel", "temperature"}:
            raise ValueError(
                f"between={self.between!r} is for the quantities travel and temperature: remove it, or state with on "
                "which part carries the sensor"
            )
        return self

    @property
    def is_motion(self) -> bool:
        """Whether the motion of the vehicle determines the reading."""
        return self.quantity == "travel" or self.quantity in MOTIONS

    @property
    def is_condition(self) -> bool:
        """Whether the sensor measures an operating condition: speed, temperature, pressure."""
        return self.quantity == "wheel_speed" or self.quantity in CONDITIONS

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
        return Channel(self.channel, SENSOR_QUANTITIES[self.quantity], self.position, direction)


class Body(Section):
    """Sprung body; its inertias are about its centre of gravity, without mounted masses.

    Parameters
    ----------
    mass
        Mass [kg]; default: 1, so that every mass, stiffness and damping of the file is per kilogram of body.
    pitch_inertia, roll_inertia
        Moments of inertia [kg m^2]; default: estimates from mass, wheelbase and track width.
    yaw_inertia
        Moment of inertia [kg m^2], used only with lateral or cornering stiffness; default: that of pitch.
    product_of_inertia
        Entry of the mass matrix between pitch and roll [kg m^2]: a mass m at (x, y) adds -m x y.
    height
        Height of the centre of gravity above the ground [m].
    """

    mass: Positive = 1.0
    pitch_inertia: Positive | None = None
    roll_inertia: Positive | None = None
    yaw_inertia: Positive | None = None
    product_of_inertia: Length = 0.0
    height: Positive | None = None


class Axle(Section):
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
    rolling_radius
        Speed of the vehicle over the angular velocity of a wheel [m/rad], for sensors of the wheels' rotation.
    cornering_stiffness
        Side force of a tyre over its slip angle [N/rad]; adds sway and yaw to the motions of the body, sway along its
        own axes. Default: tyres leave the body free to move sideways, and it rolls about its centre of gravity.
    roll_centre_height
        Height above the ground of the point about which the body rolls on this axle [m], with cornering stiffness.
    relaxation_length
        Distance rolled until the side force of a tyre has grown to all but 1/e [m], with cornering stiffness.
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
    rolling_radius: Positive | None = None
    cornering_stiffness: Positive | None = None
    roll_centre_height: Length = 0.0
    relaxation_length: Positive = 0.35

    @model_validator(mode="after")
    def _wheels_stand_on_tyres(self) -> "Axle":
        for name in ("unsprung_mass", "wheelset_mass", "cornering_stiffness"):
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
        if self.cornering_stiffness is not None and self.lateral_stiffness is not None:
            raise ValueError("lateral_stiffness is for wheels on rails, cornering_stiffness for tyres: leave one out")
        return self


Pair = Annotated[tuple[NotNegative, NotNegative], Field(strict=False)]


class Lateral(Section):
    """Lateral suspension, places and wheel-rail contact of a bogie; pairs are longitudinal and lateral.

    Parameters
    ----------
    frame_height, secondary_height
        Height of the frame's centre of gravity and of the middle of the secondary springs above the rails [m].
    yaw_inertia, wheelset_yaw_inertia
        Moments of inertia of the frame and of a wheelset [kg m^2].
    primary_stiffness, primary_damping
        Horizontal stiffness [N/m] and damping [N s/m] at an axle box, at the height of the axle.
    secondary_stiffness, secondary_damping
        The same on one side, between frame and body; longitudinal damping is that of the yaw damper.
    wheel_radius
        Radius of a wheel [m].
    conicity
        Equivalent conicity of wheels and rails.
    creep
        Creep coefficients of a wheel [N], Kalker's f11 and f22.
    wheelset_spin_inertia
        Moment of inertia of a wheelset about its axle [kg m^2]; default: 0.29 times mass times radius squared.
    traction_rod
        Stiffness [N/m], damping [N s/m] and height above the rails [m] of the traction rod; default: none.
    yaw_damper_place
        Distance from the centre line and height above the rails of the yaw dampers [m]; default: beside the secondary
        springs, at the height of the frame.
    """

    frame_height: Positive
    secondary_height: Positive
    yaw_inertia: Positive
    wheelset_yaw_inertia: Positive
    primary_stiffness: Pair
    primary_damping: Pair = (0.0, 0.0)
    secondary_stiffness: Pair
    secondary_damping: Pair = (0.0, 0.0)
    wheel_radius: Positive
    conicity: Annotated[float, Field(gt=0, le=1)]
    creep: Annotated[tuple[Positive, Positive], Field(strict=False)]
    wheelset_spin_inertia: Positive | None = None
    traction_rod: Annotated[tuple[Positive, NotNegative, Positive], Field(strict=False)] | None = None
    yaw_damper_place: Annotated[tuple[Positive, Positive], Field(strict=False)] | None = None


#: Default of a missing inertia of a wheelset about its axle, over mass times radius^2: that of the Manchester coach.
SPIN_SHARE = 0.29
#: Default of a missing roll inertia of a wheelset: radius of gyration [m] of the wheelsets of the Manchester coach.
WHEELSET_GYRATION = 0.786


class AirSpring(Section):
    """Air spring with a surge reservoir, in place of a secondary spring and its damper.

    Parameters
    ----------
    pressure
        Pressure above that of the atmosphere [Pa]; the spring carries it times the effective area.
    area, area_rate
        Effective area [m^2], and its increase for each metre that the spring is pressed together [m].
    volume, reservoir_volume
        Volume of the bellows and of the surge reservoir [m^3].
    pipe_damping
        Damping of the pipe or orifice between them [N s/m]: force by the pressure that drives the air through it, over
        the velocity of a piston of the effective area that moves this air.
    exponent
        Polytropic exponent of the air.
    """

    pressure: Positive
    area: Positive
    area_rate: Length = 0.0
    volume: Positive
    reservoir_volume: Positive
    pipe_damping: Positive
    exponent: Annotated[float, Field(ge=1, le=1.4)] = 1.4

    @property
    def stage(self) -> tuple[float, float, float]:
        """Stiffness [N/m], and damping [N s/m] and stiffness [N/m] of a damper and a spring in series beside it.

        Notes
        -----
        Air of the absolute pressure p in a volume V is a spring k = n p A^2 / V. The bellows, k_b, is in series with
        the reservoir k_r and its pipe c side by side: the same as k_b k_r / (k_b + k_r) beside a damper c k_b^2 /
        (k_b + k_r)^2 in series with k_b^2 / (k_b + k_r). The pressure times the rate of the area is a spring beside
        both.

        References
        ----------
        M. Presthus, Derivation of air spring model parameters for train simulation, Lulea University of Technology,
        2002 (linear models with a surge reservoir).
        """
        air = self.exponent * (self.pressure + STANDARD_ATMOSPHERE) * self.area**2
        bellows, reservoir = air / self.volume, air / self.reservoir_volume
        share = bellows / (bellows + reservoir)
        return share * reservoir + self.pressure * self.area_rate, share**2 * self.pipe_damping, share * bellows


class Bogie(Section):
    """Bogie with two wheelsets below a car body: springs per axle box (primary) and per side (secondary).

    Parameters
    ----------
    x
        Distance of its pivot ahead of the body's centre of gravity [m]; negative behind it.
    mass
        Mass of the frame [kg].
    pitch_inertia, roll_inertia
        Moments of inertia of the frame [kg m^2].
    half_wheelbase
        Distance of the wheelsets from the pivot [m].
    half_spacing
        Distance of the primary and of the secondary springs from the middle [m].
    wheelset_mass
        Mass of a wheelset with its axle boxes [kg].
    wheelset_roll_inertia
        Roll inertia of a wheelset [kg m^2]; default: a radius of gyration of 0.79 m, that of the Manchester coach.
    primary_stiffness, primary_damping
        Vertical stiffness [N/m] and damping [N s/m] at an axle box.
    secondary_stiffness, secondary_damping
        Vertical stiffness [N/m] and damping [N s/m] on one side, between frame and body; with an air spring left out.
    air_spring
        Air spring on each side in their place; default: none.
    anti_roll_stiffness
        Stiffness of the anti-roll bar between frame and body [N m/rad].
    contact_stiffness
        Stiffness of the contact of a wheel with the rail [N/m], that of Hertz linearised at the static load.
    contact_half_spacing
        Distance of the contacts with the rails from the middle [m]; default: that of standard gauge.
    lateral
        Lateral suspension and contact, for the lateral motion (`lateral_system`); default: vertical motion only.
    """

    x: Length
    mass: Positive
    pitch_inertia: Positive
    roll_inertia: Positive
    half_wheelbase: Positive
    half_spacing: Annotated[tuple[Positive, Positive], Field(strict=False)]
    wheelset_mass: Positive
    wheelset_roll_inertia: Positive | None = None
    primary_stiffness: Positive
    primary_damping: NotNegative
    secondary_stiffness: Positive | None = None
    secondary_damping: NotNegative | None = None
    air_spring: AirSpring | None = None
    anti_roll_stiffness: NotNegative = 0.0
    contact_stiffness: Positive = 1.0e9
    contact_half_spacing: Positive = 0.75
    lateral: Lateral | None = None

    @model_validator(mode="after")
    def _has_one_secondary_stage(self) -> "Bogie":
        given = [name for name in ("secondary_stiffness", "secondary_damping") if getattr(self, name) is not None]
        if self.air_spring is not None and given:
            raise ValueError(f"{given[0]} is that of the air_spring: leave one of them out")
        if self.air_spring is None and len(given) < 2:
            missing = "secondary_damping" if given == ["secondary_stiffness"] else "secondary_stiffness"
            raise ValueError(f"{missing} is missing: add it, or a [bogie.air_spring] table")
        return self

    @property
    def secondary(self) -> tuple[float, float, float | None]:
        """Stiffness [N/m] and damping [N s/m] of one side, and stiffness in series with the damper; None: rigid."""
        if self.air_spring is not None:
            return self.air_spring.stage
        return self.secondary_stiffness or 0.0, self.secondary_damping or 0.0, None

    @property
    def wheelset_spin(self) -> float:
        """Inertia of a wheelset about its axle [kg m^2], from the file or its mass; 0 without a radius."""
        if self.lateral is None:
            return 0.0
        return self.lateral.wheelset_spin_inertia or SPIN_SHARE * self.wheelset_mass * self.lateral.wheel_radius**2

    @property
    def yaw_damper_place(self) -> tuple[float, float]:
        """Distance of the yaw dampers from the centre line and their height above the rails [m]."""
        place = self.lateral and (self.lateral.yaw_damper_place or (self.half_spacing[1], self.lateral.frame_height))
        return place or (0.0, 0.0)

    @property
    def wheelset_roll(self) -> float:
        """Roll inertia of a wheelset [kg m^2], from the file or its mass."""
        return self.wheelset_roll_inertia or WHEELSET_GYRATION**2 * self.wheelset_mass


class MountedMass(Section):
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


class Seat(Section):
    """Seat or group of seats on the body: people on it move on it, not with the body.

    Parameters
    ----------
    x, y
        Position ahead and to the left of the body's centre of gravity [m].
    load
        Usual mass of the people on it [kg]: standard deviation of the mass that a fit finds there in each window. The
        vehicle itself is without it.
    frequency, damping_ratio
        Natural frequency [Hz] and damping ratio of people on the seat. Seated people have the largest apparent mass
        between 4 and 6 Hz (ISO 5982:2019).
    """

    x: Length
    y: Length = 0.0
    load: Positive
    frequency: Positive = 4.5
    damping_ratio: NotNegative = 0.3


class FlexibleMode(Section):
    """Flexible mode of the free body: its sensors and the upper ends of its suspensions move in its shape.

    Parameters
    ----------
    shape
        "torsion", displacement x y / (a b) at the point (x, y), with a half the wheelbase and b the mean half track; or
        "bending", displacement 1 - x^2 m / I with mass m and pitch inertia I of the body.
    frequency, damping_ratio
        Natural frequency [Hz] and damping ratio of the free body.
    mass
        Modal mass [kg]; default: that of a body whose mass is spread evenly along and across, see `modal_mass`.
    """

    shape: Literal["torsion", "bending"]
    frequency: Positive
    damping_ratio: NotNegative
    mass: Positive | None = None


class LearntNumber(Section):
    """Number of a calibrated vehicle file that was learnt from drives.

    Parameters
    ----------
    name
        Name of the number, such as "acc_fl.x" or "front.anti_roll_stiffness".
    value, std
        Value in the file, and its standard deviation.
    given
        Value before the calibration; None: the file had none.
    source
        Where the value comes from, in words.
    """

    name: Name
    value: Length
    std: NotNegative
    given: Length | None = None
    source: Annotated[str, Field(max_length=1000)] = ""


class QuarterCorner(Section):
    """Suspension and wheel of a quarter vehicle, in the units of `Axle`."""

    unsprung_mass: Positive
    spring_stiffness: Positive
    damping: NotNegative
    tyre_stiffness: Positive
    damper_bushing_stiffness: Positive | None = None


class QuarterBody(Section):
    """Sprung mass of a quarter vehicle [kg]; default: 1, so that all values are per kilogram of sprung mass."""

    mass: Positive = 1.0


class ChainMass(Section):
    """Mass of a chain [kg] with the spring [N/m] and damper [N s/m] below it."""

    mass: Positive
    stiffness: Positive
    damping: NotNegative
