"""Vehicle files read, written and shipped, and vehicles as structures: chain of masses, quarter car, body on wheels."""

import json
import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import resources
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from sprung._arrays import Real
from sprung._checks import check_number, check_path, check_type, wrong_type
from sprung.errors import FormatError, ParameterError
from sprung.toml import checked, toml_fields
from sprung.units import STANDARD_GRAVITY
from sprung.vehicles.description import KINDS, Chain, Description, Quarter, Vehicle, corner_names
from sprung.vehicles.lateral import rolling_on_rails, springs_across
from sprung.vehicles.sections import Axle, FlexibleMode, MountedMass
from sprung.vehicles.structure import SUSPENSIONS, BodyShape, Element, Structure, body_row, sensor_outputs
from sprung.vehicles.system import Outputs

#: Vehicles shipped with the package.
VEHICLES = (
    *("chain3", "coach", "metro", "metro-b", "plate", "quarter", "scale-bogie"),
    *("y25", "y25-wagon", "zafira", "zafira-printed"),
)

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
            lines.append(f"\n[{prefix}{key}]\n{_toml(value, f'{prefix}{key}.')}".rstrip("\n"))
        elif _is_table(value):
            lines += [f"\n[[{prefix}{key}]]\n{_toml(entry, f'{prefix}{key}.')}".rstrip("\n") for entry in value]
    return "\n".join(lines) + "\n"


def _is_table(value: Any) -> bool:
    """Whether a value is a table or a list of tables."""
    return isinstance(value, Mapping) or (isinstance(value, list) and bool(value) and isinstance(value[0], Mapping))


def _toml_value(value: Any) -> str:
    """Write text, numbers and lists of numbers; their TOML is their JSON, but for the delete character."""
    return json.dumps(value, ensure_ascii=False).replace("\x7f", "\\u007f")


class _Corner(NamedTuple):
    """Corner with its axle and its lateral position [m]."""

    name: str
    axle: Axle
    y: float


class _Body(NamedTuple):
    """Body or another rigid part among the coordinates of its vehicle, with the shapes of its flexible modes."""

    coordinates: tuple[str, ...]
    shapes: tuple[BodyShape, ...] = ()
    part: str = "body"

    def row(self, x: float, y: float) -> Real:
        """Return the upward displacement at (x, y) [m] for one unit of each coordinate."""
        return body_row(self.coordinates, x=x, y=y, shapes=self.shapes, part=self.part)


#: Modal mass of the bending of an even beam, over its mass: its coordinate is the displacement of its middle.
BENDING_SHARE = 0.8
#: Default of a missing unsprung mass: mass of all wheels over mass of the body; about 0.09 to 0.13 in cars.
UNSPRUNG_SHARE = 1 / 9


@dataclass(frozen=True, slots=True)
class Rolling:
    """How tyres roll that hold the body sideways."""

    #: Speed where none is stated [m/s].
    speed: float = 15.0
    #: Speed of a standing vehicle, on which tyres are springs [m/s].
    creeping: float = 1e-3
    #: Height of a hub where no rolling radius is stated [m].
    radius: float = 0.32
    #: Time in which a driver returns to the lane at the usual speed [s]: without it the body could rest anywhere.
    lane_keeping: float = 10.0


ROLLING = Rolling()


def structure(description: Description, *, speed: float | None = None) -> Structure:
    """Return the masses, elements, inputs and sensors of the vehicle that a file describes.

    Parameters
    ----------
    description
        Vehicle description: a `Chain`, driven by a force on each mass; a `Quarter` or a `Vehicle`, on axles or bogies,
        driven by the displacement of the road or rail under each wheel.
    speed
        Speed of a vehicle whose tyres have a cornering stiffness, or whose wheels creep on rails [m/s], at least 0;
        None: 15 m/s.

    Returns
    -------
    Structure
        Structure whose outputs are the motion sensors of the description; sensors of other quantities are left out.

    Raises
    ------
    ParameterError
        If the description is none of the three.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle
    >>> zafira = structure(read_vehicle("zafira"))
    >>> zafira.coordinates
    ('bounce', 'pitch', 'roll', 'wheel_front_left', 'wheel_front_right', 'wheel_rear_left', 'wheel_rear_right')
    >>> zafira.modes().natural_frequency[:3].round(2).tolist()
    [1.52, 1.76, 2.2]
    """
    match description:
        case Chain():
            return _chain(description)
        case Quarter():
            return _quarter(description)
        case Vehicle():
            return _vehicle(description, ROLLING.speed if speed is None else max(speed, ROLLING.creeping))
    raise wrong_type("description", description, "Vehicle")


def chain(
    n_masses: int = 3, *, mass: ArrayLike = 1.0, stiffness: ArrayLike = 9800.0, damping: ArrayLike = 5.0
) -> Structure:
    """Return a fixed-free chain with an accelerometer on each mass; by default the three masses of chain3.

    Parameters
    ----------
    n_masses
        Number of masses, at least 1.
    mass, stiffness, damping
        Mass [kg], and stiffness [N/m] and damping [N s/m] below each mass; one value for all masses, or one for each.

    Returns
    -------
    Structure

    Raises
    ------
    ParameterError
        If a number is out of range, or there are not as many values as masses.

    References
    ----------
    F. Liu, Online Identification of Vehicle Dynamic Systems for Condition Monitoring, University of Huddersfield
    (2020), section 4.3; the parameters were recovered from its table 4-1.

    Examples
    --------
    >>> chain().modes().natural_frequency.round(2).tolist()
    [7.01, 19.65, 28.39]
    """
    check_number("n_masses", n_masses, at_least=1)
    links: list[dict[str, float]] = [{} for _ in range(n_masses)]
    for name, value in (("mass", mass), ("stiffness", stiffness), ("damping", damping)):
        if np.shape(value) not in {(), (n_masses,)}:
            raise ParameterError(f"{name} has shape {np.shape(value)}, but must be one value or {n_masses}: correct it")
        for link, number in zip(links, np.broadcast_to(value, n_masses).tolist(), strict=True):
            link[name] = number
    sensors = [
        {"channel": f"acc_{number}", "quantity": "acceleration", "unit": "m/s^2", "on": f"mass_{number}"}
        for number in range(1, n_masses + 1)
    ]
    return structure(parse_vehicle({"name": f"chain{n_masses}", "kind": "chain", "mass": links, "sensor": sensors}))


def _chain(description: Chain) -> Structure:
    """Return a chain of masses with a force on each."""
    coordinates, n = description.coordinates, len(description.mass)
    elongations = np.eye(n) - np.eye(n, k=-1)
    elements = tuple(
        Element(owner, "suspension", elongation, link.stiffness, link.damping)
        for owner, elongation, link in zip(coordinates, elongations, description.mass, strict=True)
    )
    return Structure(
        coordinates=coordinates,
        mass=np.diag([link.mass for link in description.mass]),
        elements=elements,
        inputs=tuple(f"force_{number}" for number in range(1, n + 1)),
        forces=np.eye(n),
        outputs=_outputs(description, ()),
    )


def _quarter(description: Quarter) -> Structure:
    """Return a body that bounces on one wheel."""
    corner = description.corner
    suspension = Element(
        "corner",
        "suspension",
        np.array([1.0, -1.0]),
        corner.spring_stiffness,
        corner.damping,
        series_stiffness=corner.damper_bushing_stiffness,
    )
    tyre = Element("corner", "tyre", np.array([0.0, 1.0]), corner.tyre_stiffness, foot="road")
    return Structure(
        coordinates=description.coordinates,
        mass=np.diag([description.body.mass, corner.unsprung_mass]),
        elements=(suspension, tyre),
        inputs=("road",),
        forces=np.zeros((2, 1)),
        outputs=_outputs(description, (suspension, tyre)),
    )


def _vehicle(description: Vehicle, speed: float) -> Structure:
    """Return a body on wheels; on axles without wheels, forces on the body replace the road."""
    corners, coordinates = _corners(description), description.coordinates
    body = _Body(coordinates, tuple(_body_shape(description, mode.shape) for mode in description.flexible_mode))
    elements = [*_bogie_elements(body, description), *(e for corner in corners for e in _corner_elements(body, corner))]
    elements += [
        element
        for left, right in zip(corners[::2], corners[1::2], strict=True)
        for element in (*_anti_roll_bar(body, left, right), *_side_force(body, description, left, right, speed))
    ]
    elements += [*_held_across(description), *_held_along(description)]
    elements += [
        _mount(body, f"mounted_mass_{number}", mass) for number, mass in enumerate(description.mounted_mass, start=1)
    ]
    elements += [_flexibility(coordinates, description, mode) for mode in description.flexible_mode]
    inputs = tuple(_input_name(corner) for corner in corners) or tuple(f"road_{w.corner}" for w in description.wheels)
    forces = np.zeros((len(coordinates), len(inputs)))
    for column, (_, axle, y) in enumerate(corners):
        if axle.tyre_stiffness is None:
            forces[:, column] = body.row(axle.x, y)
    mass = np.diag(_masses(description))
    mass[1, 2] = mass[2, 1] = description.body.product_of_inertia
    outputs = _outputs(description, elements, body.shapes)
    rolling = rolling_on_rails(description, coordinates, speed=speed)[:2] if description.sways_on_bogies else None
    if any(axle.cornering_stiffness is not None for axle in description.axle):  # a body that turns as it moves
        elements.append(_leaning(description))
        mass += _masses_aside(description)
        rolling = _turning(coordinates, mass, speed)
        outputs = _in_turning_body(outputs, coordinates, speed)
    return Structure(
        coordinates=coordinates,
        mass=mass,
        elements=tuple(elements),
        inputs=inputs,
        forces=forces,
        outputs=outputs,
        shapes=body.shapes,
        rolling=rolling,
    )


def _hub(axle: Axle) -> float:
    """Return the height of the hubs of an axle above the ground [m]."""
    return axle.rolling_radius or ROLLING.radius


def _masses_aside(description: Vehicle) -> Real:
    """Return the mass matrix of wheels that move sideways with a body on tyres, at the height of their hubs."""
    names, height = description.coordinates, description.body.height or 0.0
    mass = np.zeros((len(names), len(names)))
    for axle, unsprung in zip(description.axle, _unsprung_masses(description), strict=True):
        moved = {"sway": 1.0, "yaw": axle.x, "roll": height - _hub(axle)}
        row = np.array([moved.get(name, 0.0) for name in names])
        mass += (2 * unsprung + (axle.wheelset_mass or 0.0)) * np.outer(row, row)
    return mass


def _turning(coordinates: Sequence[str], mass: Real, speed: float) -> tuple[Real, Real]:
    """Return the damping and stiffness matrix of a body that turns as it moves, along whose own axes it sways.

    A body with the yaw velocity r and the lateral velocity u along its own axes has the lateral acceleration u' + v r.

    References
    ----------
    H. B. Pacejka, Tire and Vehicle Dynamics, 3rd edition, Butterworth-Heinemann, 2012, section 1.3.1.
    """
    damping = np.zeros_like(mass)
    damping[:, coordinates.index("yaw")] = speed * mass[:, coordinates.index("sway")]
    return damping, np.zeros_like(mass)


def _in_turning_body(outputs: Outputs, coordinates: Sequence[str], speed: float) -> Outputs:
    """Return the outputs with the reading v r of accelerometers that feel sway, in a body that turns."""
    velocity = outputs.velocity.copy()
    velocity[:, coordinates.index("yaw")] += speed * outputs.acceleration[:, coordinates.index("sway")]
    return replace(outputs, velocity=velocity)


def _leaning(description: Vehicle) -> Element:
    """Return the weight of a body that leans as it rolls, on wheels that carry it at the height of their hubs."""
    row = np.array([float(name == "roll") for name in description.coordinates])
    lever = (description.body.height or 0.0) - float(np.mean([_hub(axle) for axle in description.axle]))
    return Element("body", "weight", row, -STANDARD_GRAVITY * description.body.mass * lever)


def modal_mass(description: Vehicle, mode: FlexibleMode) -> float:
    """Return the modal mass of a flexible mode of the body [kg].

    Parameters
    ----------
    description
        Vehicle with the mode.
    mode
        Flexible mode of its body.

    Notes
    -----
    The integral of the squared shape over the mass, if the file does not state it. Torsion x y / (a b) of a body whose
    mass is spread independently along and across: I_pitch I_roll / (m a^2 b^2). Bending 1 - x^2 / k^2 of a uniform beam
    of mass m with k^2 = I_pitch / m: 0.8 m, as the mean of x^4 is 9/5 k^4.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle
    >>> zafira = read_vehicle("zafira")
    >>> bending = FlexibleMode(shape="bending", frequency=25.0, damping_ratio=0.02)
    >>> modal_mass(zafira, bending) / zafira.body.mass
    0.8
    """
    if mode.mass is not None:
        return mode.mass
    body, (pitch_inertia, roll_inertia) = description.body, description.inertias
    if mode.shape == "bending":
        return BENDING_SHARE * body.mass
    return pitch_inertia * roll_inertia * _body_shape(description, "torsion").twist ** 2 / body.mass


def _body_shape(description: Vehicle, shape: str) -> BodyShape:
    """Return the shape of a flexible mode: torsion x y / (a b), bending 1 - x^2 m / I."""
    if shape == "bending":
        return BodyShape(shape, constant=1.0, curvature=-description.body.mass / description.inertias[0])
    axles = description.axle
    half_wheelbase, half_track = (axles[0].x - axles[-1].x) / 2, np.mean([axle.half_track for axle in axles])
    return BodyShape(shape, twist=1 / float(half_wheelbase * half_track))


def wheel_hop_frequencies(description: Vehicle) -> Real:
    """Return the wheel-hop frequency of each axle with the body fixed [Hz], shape (axles,); NaN without wheels.

    Notes
    -----
    sqrt((spring + tyre stiffness) / unsprung mass) / 2 pi, with half the mass of a wheelset. The frequencies of the
    exact undamped modes differ slightly, as the body moves too. On bogies: of each wheelset, below a fixed frame.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle
    >>> wheel_hop_frequencies(read_vehicle("zafira")).round(2).tolist()
    [12.13, 11.92]
    """
    halves = np.array([(axle.wheelset_mass or 0.0) / 2 for axle in description.axle])
    unsprung = _unsprung_masses(description) + halves
    stiffness = [axle.spring_stiffness + (axle.tyre_stiffness or np.nan) for axle in description.axle]
    for bogie in description.bogie:
        stiffness += [bogie.primary_stiffness + bogie.contact_stiffness] * 2
        unsprung = np.append(unsprung, [bogie.wheelset_mass / 2] * 2)
    return np.sqrt(np.array(stiffness) / unsprung) / (2 * np.pi)


def _corners(description: Vehicle) -> list[_Corner]:
    names = corner_names(len(description.axle)) if description.axle else ()
    sides = [(axle, side * axle.half_track) for axle in description.axle for side in (1, -1)]
    return [_Corner(name, axle, y) for name, (axle, y) in zip(names, sides, strict=True)]


def _input_name(corner: _Corner) -> str:
    """Return the name of a corner's input: the road under its wheel, or a force if there is no wheel."""
    return f"force_{corner.name}" if corner.axle.tyre_stiffness is None else f"road_{corner.name}"


def _masses(description: Vehicle) -> list[float]:
    """Return the masses and inertias of the coordinates, estimated where the description omits them."""
    body, axles = description.body, description.axle
    pitch_inertia, roll_inertia = description.inertias
    plane = [body.mass, body.yaw_inertia or pitch_inertia] if "sway" in description.coordinates else []
    plane += [body.mass] * description.surges_on_bogies
    wheels: list[float] = []
    for bogie in description.bogie:
        wheels += [bogie.mass, bogie.pitch_inertia, bogie.roll_inertia]
        wheelset = [bogie.wheelset_mass, bogie.wheelset_roll]
        if description.sways_on_bogies and bogie.lateral is not None:
            rolling = 2 * (bogie.wheelset_mass + bogie.wheelset_spin / bogie.lateral.wheel_radius**2)
            wheels += [bogie.mass, bogie.lateral.yaw_inertia, *[bogie.mass, rolling] * description.surges_on_bogies]
            wheelset += [bogie.wheelset_mass, bogie.lateral.wheelset_yaw_inertia]
        wheels += 2 * wheelset
    for axle, unsprung in zip(axles, _unsprung_masses(description), strict=True):
        if axle.wheelset_mass is not None and axle.wheelset_roll_inertia is not None:
            wheels += [
                axle.wheelset_mass + 2 * unsprung,
                axle.wheelset_roll_inertia + 2 * unsprung * axle.half_track**2,
            ]
        elif axle.tyre_stiffness is not None:
            wheels += [unsprung, unsprung]
    mounted = [part.mass for part in description.mounted_mass]
    flexible = [modal_mass(description, mode) for mode in description.flexible_mode]
    return [body.mass, pitch_inertia, roll_inertia, *plane, *wheels, *mounted, *flexible]


def _unsprung_masses(description: Vehicle) -> Real:
    """Return the mass of one wheel of each axle, or the mass fixed to one end of a wheelset."""
    usual = UNSPRUNG_SHARE * description.body.mass / (2 * max(len(description.axle), 1))
    return np.array([axle.unsprung_mass or (usual if axle.wheelset_mass is None else 0.0) for axle in description.axle])


def _wheel_row(coordinates: Sequence[str], corner: _Corner, y: float) -> Real:
    """Return the upward displacement of a wheel, or of a wheelset at y [m], for one unit of each coordinate."""
    if corner.axle.wheelset_mass is not None:
        return body_row(coordinates, x=0.0, y=y, part=f"wheelset_{corner.name.rsplit('_', 1)[0]}")
    if corner.axle.tyre_stiffness is not None:
        return body_row(coordinates, x=0.0, y=y, part=f"wheel_{corner.name}")
    return np.zeros(len(coordinates))


def _deflection(body: _Body, corner: _Corner) -> Real:
    """Return the elongation of a suspension for one unit of each coordinate."""
    return body.row(corner.axle.x, corner.y) - _wheel_row(body.coordinates, corner, corner.y)


def _corner_elements(body: _Body, corner: _Corner) -> Iterator[Element]:
    """Yield the suspension and the tyre of one corner."""
    (name, axle, y), coordinates = corner, body.coordinates
    yield Element(
        name,
        "suspension",
        _deflection(body, corner),
        axle.spring_stiffness,
        axle.damping,
        series_stiffness=axle.damper_bushing_stiffness,
    )
    if axle.tyre_stiffness is not None:
        wheel = _wheel_row(coordinates, corner, math.copysign(axle.contact_half_track or axle.half_track, y))
        yield Element(name, "tyre", wheel, axle.tyre_stiffness, foot=f"road_{name}")
    plane = dict.fromkeys(coordinates, 0.0)
    if axle.longitudinal_stiffness > 0:
        forward = plane | {"pitch": axle.height} | ({"yaw": -y} if "yaw" in plane else {})
        yield Element(name, "longitudinal", np.array(list(forward.values())), axle.longitudinal_stiffness)
    if axle.lateral_stiffness is not None:
        sideways = plane | {"sway": 1.0, "yaw": axle.x, "roll": -axle.height}
        elongation = np.array(list(sideways.values()))
        yield Element(name, "lateral", elongation, axle.lateral_stiffness, axle.lateral_damping)


def _bogie_elements(body: _Body, description: Vehicle) -> Iterator[Element]:
    """Yield secondary suspension, anti-roll bar, primary suspension and wheel-rail contacts of every bogie."""
    for number, bogie in enumerate(description.bogie, start=1):
        name = f"bogie{number}"
        frame, (primary, secondary) = _Body(body.coordinates, part=name), bogie.half_spacing
        for side, sign in (("left", 1), ("right", -1)):
            elongation = body.row(bogie.x, sign * secondary) - frame.row(0.0, sign * secondary)
            stiffness, damping, series = bogie.secondary
            yield Element(f"{name}_{side}", "secondary", elongation, stiffness, damping, series_stiffness=series)
        if bogie.anti_roll_stiffness > 0:
            turn = body.row(0.0, 1.0) - body.row(0.0, 0.0) - frame.row(0.0, 1.0) + frame.row(0.0, 0.0)
            yield Element(name, "anti_roll", turn, bogie.anti_roll_stiffness)
        for end, along, wheelset in (("front", 1, 2 * number - 1), ("rear", -1, 2 * number)):
            axle = _Body(body.coordinates, part=f"wheelset{wheelset}")
            for side, sign in (("left", 1), ("right", -1)):
                owner, y = f"{name}_{end}_{side}", sign * primary
                elongation = frame.row(along * bogie.half_wheelbase, y) - axle.row(0.0, y)
                yield Element(owner, "primary", elongation, bogie.primary_stiffness, bogie.primary_damping)
                contact = axle.row(0.0, sign * bogie.contact_half_spacing)
                if description.sways_on_bogies and bogie.lateral is not None:  # the cone of a wheel lifts it
                    for motion, arm in (("sway", 1.0), ("roll", bogie.lateral.wheel_radius)):
                        row = body.coordinates.index(f"wheelset{wheelset}_{motion}")
                        contact[row] -= sign * bogie.lateral.conicity * arm
                yield Element(owner, "tyre", contact, bogie.contact_stiffness, foot=f"road_{owner}")


def _held_along(description: Vehicle) -> Iterator[Element]:
    """Yield what holds body and frames along the track: couplers, springs, yaw dampers, rods, wheelsets that roll.

    Couplers are soft and at the height of the body's centre of gravity.
    """

    def held(number: int, part: str, stiffness: float, damping: float, height: float) -> Element:
        """Return an element at a height above the rails between a frame and the body, or the wheelsets below it."""
        name, lateral = f"bogie{number}", description.bogie[number - 1].lateral
        lever = height - (lateral.frame_height if lateral else 0.0)
        rows = {f"{name}_surge": -1.0, f"{name}_pitch": -lever}
        on_body = {"surge": 1.0, "pitch": height - (description.body.height or 0.0)}
        rows |= {f"{name}_rolling": 1.0} if part == "primary_along" else on_body
        elongation = np.array([rows.get(coordinate, 0.0) for coordinate in description.coordinates])
        return Element(name, part, elongation, stiffness, damping)

    if description.surges_on_bogies:
        coupled = np.array([float(name == "surge") for name in description.coordinates])
        rate = 2 * np.pi / ROLLING.lane_keeping
        yield Element("body", "longitudinal", coupled, description.body.mass * rate**2)
        yield Element("body", "yaw", coupled, 0.0, 2 * description.body.mass * rate)
    for number, bogie in enumerate(description.bogie if description.surges_on_bogies else (), start=1):
        if (lateral := bogie.lateral) is not None and lateral.traction_rod is not None:
            k, c = 2 * lateral.secondary_stiffness[0], 2 * lateral.secondary_damping[0]
            boxes = 4 * lateral.primary_stiffness[0], 4 * lateral.primary_damping[0]
            rod, damping, height_of_rod = lateral.traction_rod
            yield held(number, "longitudinal", k, 0.0, lateral.secondary_height)
            yield held(number, "yaw", 0.0, c, bogie.yaw_damper_place[1])
            yield held(number, "rod", rod, damping, height_of_rod)
            yield held(number, "primary_along", *boxes, lateral.wheel_radius)


def _held_across(description: Vehicle) -> Iterator[Element]:
    """Yield what holds body, frames and wheelsets sideways and as they yaw, and the loads that lean."""
    for owner, part, rows, k, c in springs_across(description) if description.sways_on_bogies else ():
        if part:
            elongation = [rows.get(name, 0.0) for name in description.coordinates]
            yield Element(owner, part, np.array(elongation), k, c)


def _anti_roll_bar(body: _Body, left: _Corner, right: _Corner) -> Iterator[Element]:
    """Yield the anti-roll bar of one axle, if it has one."""
    if left.axle.anti_roll_stiffness > 0:
        difference = _deflection(body, left) - _deflection(body, right)
        owner = left.name.removesuffix("_left") + "_axle"
        yield Element(owner, "anti_roll", difference, left.axle.anti_roll_stiffness)


def _side_force(body: _Body, description: Vehicle, left: _Corner, right: _Corner, speed: float) -> Iterator[Element]:
    """Yield the side forces of the tyres of one axle, if the file has their cornering stiffness.

    A slip angle is the lateral velocity of the contact patch over the speed v, so that a tyre of cornering stiffness C
    and relaxation length l is a damper C / v in series with a spring C / l; it stands on that spring alone. The patch
    moves with sway, yaw and roll of the body about the roll centre of the axle, and with the tilt of the line between
    the wheels. The steering that follows a body in yaw is left out.

    References
    ----------
    H. B. Pacejka, Tire and Vehicle Dynamics, 3rd edition, Butterworth-Heinemann, 2012, chapters 1 and 7 (slip angle,
    relaxation length).
    """
    axle = left.axle
    if axle.cornering_stiffness is None:
        return
    half = axle.contact_half_track or axle.half_track
    tilt = _wheel_row(body.coordinates, left, half) - _wheel_row(body.coordinates, right, -half)
    arm = (description.body.height or 0.0) - axle.roll_centre_height
    moved = {"sway": 1.0, "yaw": axle.x, "roll": arm}
    elongation = axle.roll_centre_height * tilt / (2 * half)
    elongation += np.array([moved.get(name, 0.0) for name in body.coordinates])
    both, owner = 2 * axle.cornering_stiffness, left.name.removesuffix("_left") + "_tyres"
    centring = both / (ROLLING.speed * ROLLING.lane_keeping)
    bushing = both / axle.relaxation_length
    yield Element(owner, "cornering", elongation, centring, both / speed, series_stiffness=bushing)


def _mount(body: _Body, name: str, part: MountedMass) -> Element:
    """Return the mounts between a mass and the body."""
    angular_frequency = 2 * np.pi * part.frequency
    elongation = -body.row(part.x, part.y)
    elongation[body.coordinates.index(name)] = 1.0
    damping = 2 * part.damping_ratio * angular_frequency * part.mass
    return Element(name, "mount", elongation, part.mass * angular_frequency**2, damping)


def _flexibility(coordinates: Sequence[str], description: Vehicle, mode: FlexibleMode) -> Element:
    """Return the stiffness and damping of the body in a flexible mode."""
    angular_frequency, mass = 2 * np.pi * mode.frequency, modal_mass(description, mode)
    elongation = np.array([float(name == mode.shape) for name in coordinates])
    damping = 2 * mode.damping_ratio * angular_frequency * mass
    return Element("body", mode.shape, elongation, mass * angular_frequency**2, damping)


def _outputs(description: Description, elements: Iterable[Element], shapes: Sequence[BodyShape] = ()) -> Outputs:
    """Return the outputs of the motion sensors of a description."""
    sensors = [sensor for sensor in description.sensor if sensor.is_motion]
    suspensions = [element for element in elements if element.part in SUSPENSIONS]
    return sensor_outputs(
        description.coordinates,
        sensors=[sensor.as_channel() for sensor in sensors],
        carriers=[sensor.between or sensor.on for sensor in sensors],
        shapes=shapes,
        elongations={element.owner: element.elongation for element in suspensions},
    )
