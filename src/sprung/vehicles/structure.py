"""Rigid masses joined by springs with dampers, the form of every vehicle; its parts by corner and kind, and faults."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import ArrayLike

from sprung._arrays import Complex, Real
from sprung._checks import check_number, check_one_of, freeze, frozen_array
from sprung.errors import ParameterError
from sprung.recording import Channel
from sprung.units import STANDARD_GRAVITY
from sprung.vehicles.system import ExactModes, MechanicalSystem, Outputs, StateSpace, discretised, modes, state_space

if TYPE_CHECKING:
    from pydantic import GetCoreSchemaHandler
    from pydantic_core import CoreSchema


@dataclass(frozen=True, order=True, slots=True)
class Component:
    """A spring, damper or tyre of a vehicle.

    Parameters
    ----------
    corner
        "front_left", "axle2_right" ..., or another owner of elements, such as "mass_1" or "front_axle".
    kind
        "spring", "damper", "tyre", or another component of `sprung.vehicles.structure.PARTS`.

    Examples
    --------
    >>> soft = Component.parse("front_left.spring")
    >>> soft.axle, soft.side, soft.kind
    ('front', 'left', 'spring')
    >>> print(soft)
    front_left.spring
    """

    corner: str
    kind: str

    @classmethod
    def parse(cls, text: str) -> "Component":
        """Return the component written as CORNER.KIND.

        Raises
        ------
        ParameterError
            If the text is not of that form.
        """
        corner, dot, kind = text.partition(".")
        if not (corner and dot and kind) or "." in kind:
            raise ParameterError(f"component {text!r} is not of the form CORNER.KIND: write front_left.spring")
        return cls(corner, kind)

    @classmethod
    def __get_pydantic_core_schema__(cls, source: Any, handler: "GetCoreSchemaHandler") -> "CoreSchema":
        """Return how pydantic reads and writes a component: as its text."""
        from pydantic_core import core_schema

        text = core_schema.no_info_after_validator_function(cls.parse, core_schema.str_schema())
        return core_schema.json_or_python_schema(
            json_schema=text,
            python_schema=core_schema.no_info_before_validator_function(
                lambda value: cls.parse(value) if isinstance(value, str) else value, core_schema.is_instance_schema(cls)
            ),
            serialization=core_schema.to_string_ser_schema(),
        )

    def __str__(self) -> str:
        return f"{self.corner}.{self.kind}"

    @property
    def side(self) -> str | None:
        """Side of the vehicle, "left" or "right"; None if the owner is not a corner."""
        side = self.corner.rpartition("_")[2]
        return side if side in {"left", "right"} else None

    @property
    def axle(self) -> str:
        """Axle of the corner, such as "front" or "axle2"; the owner itself if it is not a corner."""
        return self.corner if self.side is None else self.corner.rpartition("_")[0]


_FORM = re.compile(r"(?P<owner>\w+)\.(?P<component>\w+)=(?P<change>[^@]+)(@(?P<onset>[^+]+)(\+(?P<growth>.+))?)?")


@dataclass(frozen=True, slots=True)
class Fault:
    """Change of one component.

    Parameters
    ----------
    component
        Spring, damper or tyre that changes.
    change
        Relative change, above -1: -0.2 is 20 % less.
    onset
        Time at which the change begins [s], at least 0.
    growth
        Time over which the change grows linearly to its full size [s], at least 0; 0: sudden.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """

    component: Component
    change: float
    onset: float = 0.0
    growth: float = 0.0

    def __post_init__(self) -> None:
        check_number(f"change of {self.component}", self.change, above=-1, advice="-0.2 means 20 % less")
        check_number(f"onset of {self.component}", self.onset, at_least=0)
        check_number(f"growth of {self.component}", self.growth, at_least=0)

    @property
    def is_constant(self) -> bool:
        """Whether the fault exists from the start and does not grow."""
        return self.onset == 0 and self.growth == 0

    @property
    def knots(self) -> tuple[float, ...]:
        """Times at which the slope of the change jumps [s]; two equal times are a step."""
        return (self.onset, self.onset + self.growth)

    def factor(self, time: ArrayLike) -> Real:
        """Return the ratio of the component's value to its nominal value at times [s], same shape."""
        t = np.asarray(time, dtype=np.float64)
        if self.growth == 0:
            return np.where(t >= self.onset, 1 + self.change, 1.0)
        return 1 + self.change * np.clip((t - self.onset) / self.growth, 0, 1)


def parse_fault(text: str) -> Fault:
    """Return the fault written as CORNER.COMPONENT=CHANGE, with @ONSET and +GROWTH in seconds if it is not constant.

    Raises
    ------
    ParameterError
        If the text does not have this form, or a number is out of range.

    Examples
    --------
    >>> parse_fault("front_left.spring=-0.2")
    Fault(component=Component(corner='front_left', kind='spring'), change=-0.2, onset=0.0, growth=0.0)
    >>> parse_fault("rear_right.damper=-0.3@120+60").factor([0, 150, 180]).tolist()
    [1.0, 0.85, 0.7]
    """
    match = _FORM.fullmatch(text.strip()) if isinstance(text, str) else None
    numbers = [match[name] for name in ("change", "onset", "growth")] if match else []
    try:
        if match is None:
            raise ValueError
        change, onset, growth = (float(number) if number else 0.0 for number in numbers)
        if not all(map(math.isfinite, (change, onset, growth))):
            raise ValueError
    except ValueError:
        raise ParameterError(
            f"fault {text!r} is not of the form CORNER.COMPONENT=CHANGE, such as front_left.spring=-0.2, with "
            "@ONSET+GROWTH in seconds if it begins later or grows: correct it"
        ) from None
    return Fault(Component(match["owner"], match["component"]), change, onset, growth)


#: Components that the stiffness and the damping of each part of a corner are called after.
PARTS = MappingProxyType(
    {
        "suspension": ("spring", "damper"),
        "primary": ("primary_spring", "primary_damper"),
        "secondary": ("secondary_spring", "secondary_damper"),
        "tyre": ("tyre", None),
        "anti_roll": ("anti_roll", None),
        "mount": ("spring", "damper"),
        "lateral": ("lateral_spring", "lateral_damper"),
        "primary_lateral": ("primary_lateral_spring", "primary_lateral_damper"),
        "weight": ("weight", None),
        "yaw": ("yaw_spring", "yaw_damper"),
        "rod": ("traction_rod", "traction_rod_damper"),
        "primary_along": ("primary_longitudinal_spring", "primary_longitudinal_damper"),
        "cornering": ("cornering_spring", "cornering"),
        "longitudinal": ("longitudinal_spring", None),
        "torsion": ("torsion", "torsion_damping"),
        "bending": ("bending", "bending_damping"),
    }
)


#: Parts between whose ends a sensor of travel can be.
SUSPENSIONS = ("suspension", "primary", "secondary")
#: Kinds of their springs and dampers.
SPRINGS = ("spring", "primary_spring", "secondary_spring")
DAMPERS = ("damper", "primary_damper", "secondary_damper")

#: Shapes of flexible modes of the body, and the coordinates called after them.
FLEXIBLE_SHAPES = ("torsion", "bending")

#: Quantities of a motion: order of the time derivative, and whether it is a rotation.
MOTIONS = MappingProxyType(
    {
        "acceleration": (2, False),
        "velocity": (1, False),
        "displacement": (0, False),
        "angular_velocity": (1, True),
        "angle": (0, True),
    }
)


#: No suspension between whose ends a sensor is.
NO_ELONGATIONS: Mapping[str, Real] = MappingProxyType({})


@dataclass(frozen=True, eq=False, slots=True)
class Element:
    """A spring with a damper in parallel, and its attachment.

    Parameters
    ----------
    owner
        Corner, mass or axle that it belongs to, such as "front_left".
    part
        A key of `PARTS`.
    elongation
        Elongation for one unit of each coordinate, shape (n,).
    stiffness, damping
        Stiffness [N/m] and damping [N s/m], at least 0; a weight that leans has a negative stiffness.
    foot
        Name of the base displacement that moves its lower end; None if that end is fixed or on a mass. An element with
        a foot has no damping, as the velocity of the base is not an input.
    series_stiffness
        Stiffness of the bushing in series with the damper [N/m], above 0; None if the damper is fixed rigidly.

    Raises
    ------
    ParameterError
        If a number is out of range, or an element on a moving base has damping.
    """

    owner: str
    part: str
    elongation: Real
    stiffness: float
    damping: float = 0.0
    foot: str | None = None
    series_stiffness: float | None = None

    def __post_init__(self) -> None:
        freeze(self, elongation=1)
        check_one_of("part", self.part, PARTS)
        least = -math.inf if self.part == "weight" else 0
        check_number(f"stiffness of {self.owner} {self.part}", self.stiffness, at_least=least)
        check_number(f"damping of {self.owner} {self.part}", self.damping, at_least=0)
        if self.series_stiffness is not None:
            check_number(f"series_stiffness of {self.owner} {self.part}", self.series_stiffness, above=0)
        if self.foot is not None and self.damping != 0:
            raise ParameterError(
                f"damping={self.damping:g} of {self.owner} {self.part} must be 0: it stands on the moving base"
            )

    @property
    def components(self) -> tuple[Component, Component | None]:
        """Components of its stiffness and of its damping; None if it has no damping of its own."""
        spring, damper = PARTS[self.part]
        return Component(self.owner, spring), None if damper is None else Component(self.owner, damper)

    def dynamic_stiffness(self, s: Complex | complex, *, spring: float = 1.0, damper: float = 1.0) -> Complex:
        """Return the force of the element per unit of elongation.

        Parameters
        ----------
        s
            Complex angular frequencies [rad/s], any shape.
        spring, damper
            Factors of the stiffness and of the damping.

        Returns
        -------
        ndarray
            Dynamic stiffness [N/m], shape of `s`.

        Notes
        -----
        z(s) = k + s c, and with a bushing of stiffness k_b in series with the damper
        z(s) = k + 1 / (1 / (s c) + 1 / k_b) = k + s c k_b / (k_b + s c), the standard linear solid.
        dz / d ln k = k; for the other derivatives see `damping_derivative`.

        References
        ----------
        C. Zener, Elasticity and Anelasticity of Metals, University of Chicago Press, 1948 (standard linear solid).
        """
        viscous = np.asarray(s, dtype=np.complex128) * (damper * self.damping)
        if self.series_stiffness is not None:
            viscous = viscous * (self.series_stiffness / (self.series_stiffness + viscous))
        return np.asarray(spring * self.stiffness + viscous, dtype=np.complex128)

    def damping_derivative(self, s: Complex | complex, *, damper: float = 1.0) -> Complex:
        """Return the derivative of `dynamic_stiffness` with respect to ln(damping), shape of `s`, in N/m.

        Parameters
        ----------
        s
            Complex angular frequencies [rad/s], any shape.
        damper
            Factor of the damping.

        Notes
        -----
        dz / d ln c = s c, and s c k_b^2 / (k_b + s c)^2 with a bushing. As z depends on s through the product s c
        only, dz / ds = (dz / d ln c) / s.
        """
        viscous = np.asarray(s, dtype=np.complex128) * (damper * self.damping)
        if self.series_stiffness is not None:
            viscous = viscous * (self.series_stiffness / (self.series_stiffness + viscous)) ** 2
        return np.asarray(viscous, dtype=np.complex128)


@dataclass(frozen=True, slots=True)
class BodyShape:
    """Shape of a flexible mode: the point (x, y) of the body moves up by constant + twist x y + curvature x^2.

    Parameters
    ----------
    coordinate
        Coordinate of the mode: "torsion" or "bending".
    constant, twist, curvature
        Displacement for one unit of the coordinate: dimensionless, and both in 1/m^2.
    """

    coordinate: str
    constant: float = 0.0
    twist: float = 0.0
    curvature: float = 0.0

    def deflection(self, x: float, y: float) -> float:
        """Return the upward displacement at (x, y) [m] for one unit of the coordinate."""
        return self.constant + self.twist * x * y + self.curvature * x**2

    def rotation(self, x: float, y: float) -> tuple[float, float]:
        """Return local pitch (positive nose down) and roll (positive left side up) at (x, y) [m] [rad per unit]."""
        return -(self.twist * y + 2 * self.curvature * x), self.twist * x


@dataclass(frozen=True, eq=False, slots=True)
class Structure:
    """Coordinates, masses, elements, inputs and sensors of a vehicle.

    Parameters
    ----------
    coordinates
        Names of the n coordinates: "bounce", "pitch", "roll" of the body, "wheel_front_left" ..., "mass_1" ...;
        "torsion" and "bending" of a flexible body; other parts see `motions_of`.
    mass
        Mass matrix [kg, kg m^2], shape (n, n).
    elements
        Springs with dampers; their stiffness and damping matrices add up.
    inputs
        Names of the inputs, forces [N] or base displacements [m].
    forces
        Generalised force of one unit of each input that acts as a force, shape (n, inputs); zeros for base
        displacements, which act through the elements that stand on them.
    outputs
        Output matrices of the sensors.
    shapes
        Shapes of the flexible modes of the body.
    rolling
        Damping and stiffness matrix that are not symmetric, of wheels that roll on rails or of a body that turns as it
        moves on tyres, shape (n, n) each; None: there are none.

    Raises
    ------
    ParameterError
        If elements, inputs or outputs do not match the coordinates.
    """

    coordinates: tuple[str, ...]
    mass: Real
    elements: tuple[Element, ...]
    inputs: tuple[str, ...]
    forces: Real
    outputs: Outputs
    shapes: tuple[BodyShape, ...] = ()
    rolling: tuple[Real, Real] | None = None

    def __post_init__(self) -> None:
        freeze(self, mass=2, forces=2)
        n = len(self.coordinates)
        for element in self.elements:
            if len(element.elongation) != n:
                raise ParameterError(
                    f"{element.owner} {element.part} has {len(element.elongation)} elongations, but must have one "
                    f"for each of {n} coordinates"
                )
            if element.foot is not None:
                check_one_of(f"foot of {element.owner} {element.part}", element.foot, self.inputs)
        if self.outputs.acceleration.shape[1] != n:
            raise ParameterError(
                f"the outputs read {self.outputs.acceleration.shape[1]} coordinates, but the structure has {n}"
            )

    @property
    def elongations(self) -> Real:
        """Elongation of each element for one unit of each coordinate, shape (elements, n)."""
        return np.stack([element.elongation for element in self.elements])

    @property
    def feet(self) -> Real:
        """1 where the base displacement of an input moves the foot of an element, shape (elements, inputs)."""
        return np.array([[float(element.foot == name) for name in self.inputs] for element in self.elements])

    @property
    def system(self) -> MechanicalSystem:
        """Matrices of the structure.

        Notes
        -----
        With elongations e = D q - F u: K = D^T diag(k) D, C = D^T diag(c) D, B = forces + D^T diag(k) F; those of
        `rolling` are added to C and K. A damper with a bushing is not part of C but an arm of its own.
        """
        D, none = self.elongations, np.zeros_like(self.mass)
        rolling_damping, rolling_stiffness = self.rolling or (none, none)
        stiffness = np.array([element.stiffness for element in self.elements])
        damping = np.array([0.0 if element.series_stiffness else element.damping for element in self.elements])
        arms = [element for element in self.elements if element.series_stiffness and element.damping > 0]
        return MechanicalSystem(
            mass=self.mass,
            damping=_weighted_gram(D, damping) + rolling_damping,
            stiffness=_weighted_gram(D, stiffness) + rolling_stiffness,
            input_matrix=self.forces + (D.T * stiffness) @ self.feet,
            coordinates=self.coordinates,
            inputs=self.inputs,
            arm_elongations=np.array([arm.elongation for arm in arms]).reshape(-1, len(self.coordinates)),
            arm_stiffness=np.array([arm.series_stiffness for arm in arms], dtype=np.float64),
            arm_damping=np.array([arm.damping for arm in arms], dtype=np.float64),
        )

    @property
    def static_loads(self) -> Real:
        """Force with which the weight of all parts presses each element together [N], shape (elements,)."""
        still = ("pitch", "roll", "yaw", "sway", "surge", "rolling", *FLEXIBLE_SHAPES)
        upwards = np.array([float(name.rpartition("_")[2] not in still) for name in self.coordinates])
        D, stiffness = self.elongations, np.array([element.stiffness for element in self.elements])
        weight = STANDARD_GRAVITY * self.mass @ upwards
        at_rest = np.linalg.lstsq(_weighted_gram(D, stiffness), -weight, rcond=1e-12)[0]  # sway may have no spring
        return np.asarray(-stiffness * (D @ at_rest), dtype=np.float64)

    def rolling_at(self, s: Complex | complex) -> Complex:
        """Return the dynamic stiffness K + s C of `rolling` at complex angular frequencies, shape (*s, n, n)."""
        none = np.zeros_like(self.mass)
        damping, stiffness = self.rolling or (none, none)
        return np.asarray(stiffness + np.multiply.outer(s, damping), dtype=np.complex128)

    def changed(self, factors: Mapping[Component, float]) -> "Structure":
        """Return the structure with some components multiplied by a factor.

        Parameters
        ----------
        factors
            Factors by component, such as {Component("front_left", "spring"): 0.8}; at least 0.

        Raises
        ------
        ParameterError
            If the structure lacks a component, or a factor is below 0.
        """
        known = {str(component) for component in self.components()}
        for component, factor in factors.items():
            check_one_of("component", str(component), known)
            check_number(f"factor of {component}", factor, at_least=0)
        elements = []
        for element in self.elements:
            of_stiffness, of_damping = (
                1.0 if component is None else factors.get(component, 1.0) for component in element.components
            )
            elements.append(
                replace(element, stiffness=of_stiffness * element.stiffness, damping=of_damping * element.damping)
            )
        return replace(self, elements=tuple(elements))

    def with_payload(self, mass: float, *, x: float = 0.0, y: float = 0.0) -> "Structure":
        """Return the structure with a load fixed to its body.

        Parameters
        ----------
        mass
            Mass of the load [kg], at least 0.
        x, y
            Position ahead and to the left of the body's own centre of gravity [m]. The coordinates stay those of the
            empty body, so that sensors and springs keep their positions.

        Raises
        ------
        ParameterError
            If the mass is negative, or the structure has no body on axles.
        """
        check_number("mass of the payload", mass, at_least=0)
        upwards = body_row(self.coordinates, x=x, y=y, shapes=self.shapes)
        sideways = np.array([{"sway": 1.0, "yaw": x}.get(name, 0.0) for name in self.coordinates])
        return replace(self, mass=self.mass + mass * (np.outer(upwards, upwards) + np.outer(sideways, sideways)))

    def modes(self) -> ExactModes:
        """Return the exact modes as observed by the sensors."""
        return modes(self.system, self.outputs)

    def state_space(self) -> StateSpace:
        """Return the continuous state space from inputs to sensors."""
        return state_space(self.system, self.outputs)

    def discretised(self, sampling_rate: float) -> StateSpace:
        """Return the state space sampled at `sampling_rate` [Hz], inputs held between samples."""
        return discretised(self.state_space(), sampling_rate=sampling_rate)

    def components(self) -> dict[Component, float]:
        """Return the stiffness [N/m] or damping [N s/m] of every component, in the order of the elements."""
        values: dict[Component, float] = {}
        for element in self.elements:
            spring, damper = element.components
            values[spring] = element.stiffness
            if damper is not None:
                values[damper] = element.damping
        return values


def sensor_outputs(
    coordinates: Sequence[str],
    *,
    sensors: Sequence[Channel],
    carriers: Sequence[str],
    shapes: Sequence[BodyShape] = (),
    elongations: Mapping[str, Real] = NO_ELONGATIONS,
) -> Outputs:
    """Return the output matrices of motion sensors on the parts of a structure.

    Parameters
    ----------
    coordinates
        Names of the n coordinates of the structure.
    sensors
        Channels of a motion quantity, with position and direction where they are on the body.
    carriers
        Part that carries each sensor: "body", the name of a coordinate, or the owner of the suspension whose elongation
        it measures.
    shapes
        Shapes of the flexible modes of the body.
    elongations
        Elongation of each suspension for one unit of each coordinate, shape (n,), by owner.

    Raises
    ------
    ParameterError
        If a quantity is not a motion, or a carrier is not a part of the structure.

    Notes
    -----
    Small motions of a rigid body in ISO 8855 axes: with bounce z, pitch p (positive nose down), roll r (positive
    left side up), sway s and yaw w (positive to the left) the point (x, y, h) moves by (h p - y w, s + x w - h r,
    z - x p + y r), and the angular velocity is (r', p', w'). A flexible body adds the displacement of its shapes to z,
    and their slopes -dz/dx and dz/dy to p and r at the place of the sensor. A bogie frame moves as a rigid body about
    its own centre. A wheelset bounces and rolls. Gravity's share in the reading of a tilted accelerometer is left out.

    References
    ----------
    ISO 8855:2011, Road vehicles - Vehicle dynamics and road-holding ability - Vocabulary.

    Examples
    --------
    >>> gyro = Channel("gyr_x", "angular_velocity", direction=(1.0, 0.0, 0.0))
    >>> outputs = sensor_outputs(("bounce", "pitch", "roll"), sensors=[gyro], carriers=["body"])
    >>> outputs.velocity.tolist()
    [[0.0, 0.0, 1.0]]
    """
    rows = {order: np.zeros((len(sensors), len(coordinates))) for order in (0, 1, 2)}
    for row, (sensor, carrier) in enumerate(zip(sensors, carriers, strict=True)):
        if sensor.quantity not in MOTIONS:
            raise ParameterError(
                f"quantity {sensor.quantity!r} of channel {sensor.name!r} is not a motion: "
                f"use one of {', '.join(MOTIONS)}"
            )
        order, is_rotation = MOTIONS[sensor.quantity]
        if carrier in elongations:
            rows[order][row] = elongations[carrier]
            continue
        if carrier != "body" and carrier not in coordinates:
            raise ParameterError(
                f"channel {sensor.name!r} is on {carrier!r}, but the parts are "
                f"{', '.join(['body', *coordinates, *elongations])}"
            )
        has_pitch = motions_of(carrier)[1] in coordinates
        motion = _motion(sensor, carrier, shapes, is_rotation=is_rotation, has_pitch=has_pitch)
        for name, value in motion.items():  # names that the structure lacks are 0
            if name in coordinates:
                rows[order][row, coordinates.index(name)] = value
    return Outputs(channels=tuple(sensors), acceleration=rows[2], velocity=rows[1], displacement=rows[0])


def motions_of(part: str) -> tuple[str, str, str]:
    """Return the names of bounce, pitch and roll of a part: "bogie1", "bogie1_pitch", "bogie1_roll"; of the body's.

    Examples
    --------
    >>> motions_of("body")
    ('bounce', 'pitch', 'roll')
    """
    return ("bounce", "pitch", "roll") if part == "body" else (part, f"{part}_pitch", f"{part}_roll")


def body_row(
    coordinates: Sequence[str], *, x: float, y: float, shapes: Sequence[BodyShape] = (), part: str = "body"
) -> Real:
    """Return the upward displacement of a part at (x, y) [m] for one unit of each coordinate, shape (n,).

    Parameters
    ----------
    coordinates
        Names of the n coordinates.
    x, y
        Place ahead and to the left of the part's own centre of gravity [m].
    shapes
        Shapes of the flexible modes of the body.
    part
        "body", a bogie frame, a wheel or a wheelset; rotations that it lacks are left out.

    Raises
    ------
    ParameterError
        If the structure lacks the part, or its body lacks pitch or roll.

    Notes
    -----
    The row is [1, -x, y] for bounce, pitch (positive nose down) and roll (positive left side up); ISO 8855. Flexible
    modes of the body have the displacement of their shapes.

    References
    ----------
    ISO 8855:2011, Road vehicles - Vehicle dynamics and road-holding ability - Vocabulary.

    Examples
    --------
    >>> body_row(("bounce", "pitch", "roll"), x=1.2, y=0.7).tolist()
    [1.0, -1.2, 0.7]
    """
    row = np.zeros(len(coordinates))
    for name, value in zip(motions_of(part), (1.0, -x, y), strict=True):
        if name in coordinates:
            row[coordinates.index(name)] = value
        elif part in {"body", name}:
            raise ParameterError(f"the structure has no {name}: only a body on axles has a place at x and y")
    for shape in shapes:
        row[coordinates.index(shape.coordinate)] = shape.deflection(x, y)
    return row


def _weighted_gram(rows: Real, weights: Real) -> Real:
    """Sum of weight times row^T row, symmetric to the last digit."""
    gram = (rows.T * weights) @ rows
    return (gram + gram.T) / 2


def _motion(
    sensor: Channel, part: str, shapes: Sequence[BodyShape], *, is_rotation: bool, has_pitch: bool
) -> dict[str, float]:
    """Motion at the sensor for one unit of each coordinate; that of parts without pitch, wheels, is vertical."""
    x, y, h = sensor.position or (0.0, 0.0, 0.0)
    dx, dy, dz = sensor.direction or (0.0, 0.0, 1.0)
    bounce, pitch, roll = motions_of(part)
    of_body: dict[str, float] = {}
    if part == "body" and is_rotation:
        of_body = {shape.coordinate: float(np.dot((dy, dx), shape.rotation(x, y))) for shape in shapes}
        of_body["yaw"] = sensor.direction[2] if sensor.direction else 0.0
    elif part == "body":
        of_body = {
            shape.coordinate: dz * shape.deflection(x, y) + float(np.dot((dx * h, -dy * h), shape.rotation(x, y)))
            for shape in shapes
        }
        of_body |= {"sway": dy, "yaw": dy * x - dx * y}
    if is_rotation:
        return {pitch: dy, roll: dx, **of_body}
    return {bounce: dz, pitch: dx * h - dz * x, roll: dz * y - (dy * h if has_pitch else 0.0), **of_body}


def with_faults(structure: Structure, faults: Iterable[Fault], *, time: float = math.inf) -> Structure:
    """Return a structure with faults as they are at a time [s]; default: at their full size.

    Raises
    ------
    ParameterError
        If the structure has no such component.

    Examples
    --------
    >>> from sprung.vehicles import parse_fault, read_vehicle
    >>> from sprung.vehicles.models import structure
    >>> zafira = structure(read_vehicle("zafira"))
    >>> soft = with_faults(zafira, [parse_fault("front_left.spring=-0.2")])
    >>> spring = Component("front_left", "spring")
    >>> round(soft.components()[spring] / zafira.components()[spring], 6)
    0.8
    """
    factors: dict[Component, float] = {}
    for fault in faults:
        factors[fault.component] = factors.get(fault.component, 1.0) * float(fault.factor(time))
    return structure.changed(factors)


def frequency_response(structure: Structure, frequencies: ArrayLike) -> Complex:
    """Return the frequency responses of the sensors to the inputs.

    Parameters
    ----------
    structure
        Masses, elements and sensors of a vehicle.
    frequencies
        Frequencies [Hz], at least 0, shape (frequencies,).

    Returns
    -------
    ndarray
        Output over input, such as m/s^2 over m, shape (frequencies, channels, inputs).

    Raises
    ------
    ParameterError
        If a frequency is negative or not finite.

    Notes
    -----
    H(f) = C (i w I - A)^-1 B + D with w = 2 pi f.

    Examples
    --------
    >>> from sprung.vehicles import read_description
    >>> from sprung.vehicles.models import structure
    >>> quarter = structure(read_description("quarter"))
    >>> f = np.array([0.5, 13.21])
    >>> body = np.abs(frequency_response(quarter, f)[:, 0, 0]) / (2 * np.pi * f) ** 2  # over the height of the road
    >>> body.round(2).tolist()  # far below its mode, and at it
    [1.0, 4.2]
    """
    f = frozen_array("frequencies", frequencies, ndim=1)
    if not np.all(np.isfinite(f)) or np.any(f < 0):
        raise ParameterError("frequencies must be finite and at least 0: correct them")
    space = structure.state_space()
    resolvent = 2j * np.pi * f[:, None, None] * np.eye(len(space.state_matrix)) - space.state_matrix
    states = np.linalg.solve(resolvent, np.broadcast_to(space.input_matrix, (f.size, *space.input_matrix.shape)))
    return np.asarray(space.output_matrix @ states + space.feedthrough, dtype=np.complex128)
