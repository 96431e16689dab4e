"""Lateral motion of a rail vehicle on bogies: sway, roll and yaw of its parts, with linear creep of its wheels."""

import math
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number, check_type
from sprung.errors import ParameterError
from sprung.recording import Channel
from sprung.units import STANDARD_GRAVITY
from sprung.vehicles.description import Vehicle
from sprung.vehicles.sections import Bogie, Lateral
from sprung.vehicles.structure import MOTIONS, Component
from sprung.vehicles.system import ExactModes, MechanicalSystem, Outputs, modes

#: Field of `Lateral` that holds each part, in pairs of which the lateral one is the second.
LATERAL_PARTS = MappingProxyType(
    {
        "primary_longitudinal_spring": "primary_stiffness",
        "primary_lateral_spring": "primary_stiffness",
        "lateral_spring": "secondary_stiffness",
        "lateral_damper": "secondary_damping",
        "yaw_damper": "secondary_damping",
    }
)


def lateral_system(vehicle: Vehicle, *, speed: float) -> MechanicalSystem:
    """Return the lateral motion of a rail vehicle on straight track at a speed.

    Parameters
    ----------
    vehicle
        Vehicle with a table `[bogie.lateral]` for each bogie, and the height of its body.
    speed
        Speed [m/s], above 0.

    Returns
    -------
    MechanicalSystem
        Coordinates sway, roll and yaw of the body ("sway", "roll", "yaw") of the frames ("bogie1_sway" ...) and
        of the wheelsets. Inputs for each wheelset: "alignment_wheelset1" ..., the lateral displacement of the
        track's centre line [m], then "cross_level_wheelset1" ..., the roll of the track [rad]. Its stiffness matrix is
        not symmetric.

    Raises
    ------
    ParameterError
        If the vehicle has no bogies, or its file lacks their lateral tables or the height of the body.

    Notes
    -----
    Axes of ISO 8855, as in `sensor_outputs`: the point (x, y, h) of a part moves by s + x w - h r to the left, by -y w
    forward and by y r upward. Every spring acts between such points of two parts, and what it carries leans with the
    part below it. Wheels are cones on rails: a wheelset that moves by s and rolls by r has its contacts at u = s + R r
    with the radius R of a wheel, stands on both rails where b r = c u, and is held by

    - creep: lateral force -2 f22 (u' / V - w), yaw moment -2 f11 b (c u / R + b w' / V),
    - gravity: lateral force -W r, yaw moment W b c w,
    - its spin, of inertia J: yaw moment J V r' / R, roll moment -J V w' / R,

    with the creep coefficients f11 (longitudinal) and f22 (lateral) of a wheel, half the distance b of the contacts,
    the equivalent conicity c and the axle load W; u counts from the centre line, which an irregular alignment moves,
    and r from the roll of the track. Spin creep, the forces between vehicles and motion along the track are left out.
    Modes and readings are those of a multibody engine within 0.1 % and 2 % (`benchmarks.multibody.coach`).

    References
    ----------
    A. H. Wickens, Fundamentals of Rail Vehicle Dynamics, Swets and Zeitlinger, 2003, chapters 2, 3 and 5.
    J. J. Kalker, Survey of wheel-rail rolling contact theory, Vehicle System Dynamics 8 (1979) 317-358.
    """
    check_number("speed", speed, above=0)
    coordinates = _coordinates(vehicle)
    damping, stiffness, aside, tilts = rolling_on_rails(vehicle, coordinates, speed=speed)
    rails = [2 * bogie.contact_half_spacing**2 * bogie.contact_stiffness for bogie in vehicle.bogie for _ in range(2)]
    stiffness += (tilts * rails) @ tilts.T
    mass = np.zeros(len(coordinates))
    springs = list(springs_across(vehicle))
    rows = np.array([[row.get(name, 0.0) for name in coordinates] for _, _, row, _, _ in springs])
    k, c = np.array([values for _, _, _, *values in springs]).T
    stiffness += rows.T * k @ rows
    damping += rows.T * c @ rows
    body = vehicle.body
    mass[:3] = body.mass, vehicle.inertias[1], body.yaw_inertia or vehicle.inertias[0]
    for number, (bogie, lateral) in enumerate(_tables(vehicle), start=1):
        frame = coordinates.index(f"bogie{number}_sway")
        mass[frame : frame + 3] = bogie.mass, bogie.roll_inertia, lateral.yaw_inertia
        for wheelset in (frame + 3, frame + 6):
            mass[wheelset : wheelset + 3] = bogie.wheelset_mass, bogie.wheelset_roll, lateral.wheelset_yaw_inertia
    wheelsets = range(1, 2 * len(vehicle.bogie) + 1)
    inputs = tuple(f"{kind}_wheelset{number}" for kind in ("alignment", "cross_level") for number in wheelsets)
    forces = np.hstack([aside, tilts * rails])
    return MechanicalSystem(np.diag(mass), damping, stiffness, forces, coordinates, inputs)


def lateral_systems(vehicle: Vehicle) -> Callable[[float], MechanicalSystem]:
    """Return the lateral motion as a function of the speed [m/s]: its damping is A + B / V + C V, all else constant.

    Raises
    ------
    ParameterError
        As raised by `lateral_system`.
    """
    known = (10.0, 20.0, 40.0)
    systems = [lateral_system(vehicle, speed=speed) for speed in known]
    shares = np.linalg.inv([[1.0, 1 / speed, speed] for speed in known])
    parts = np.tensordot(shares, [system.damping for system in systems], axes=1)
    return lambda speed: replace(systems[0], damping=parts[0] + parts[1] / speed + parts[2] * speed)


def rolling_on_rails(vehicle: Vehicle, coordinates: Sequence[str], *, speed: float) -> tuple[Real, Real, Real, Real]:
    """Return what acts on wheelsets that roll on rails but for the stiffness of the contacts, as `lateral_system` says.

    Returns
    -------
    damping, stiffness
        Matrices, shape (n, n) for n coordinates.
    aside
        Forces for the alignment under each wheelset, those of the contacts included, shape (n, wheelsets).
    tilts
        Roll of each wheelset above its rails for one unit of each coordinate, shape (n, wheelsets).
    """
    names, size = list(coordinates), len(coordinates)
    damping, stiffness = np.zeros((size, size)), np.zeros((size, size))
    aside, tilts = np.zeros((2, size, 2 * len(vehicle.bogie)))
    for number, (bogie, lateral) in enumerate(_tables(vehicle), start=1):
        longitudinal, sideways = (2 * coefficient for coefficient in lateral.creep)
        half, cone = bogie.contact_half_spacing, lateral.conicity
        load = STANDARD_GRAVITY * (bogie.wheelset_mass + bogie.mass / 2 + vehicle.body.mass / (2 * len(vehicle.bogie)))
        radius, rail = lateral.wheel_radius, 2 * half**2 * bogie.contact_stiffness
        for wheelset in (2 * number - 2, 2 * number - 1):
            sway, roll, yaw = (names.index(name) for name in _motions(f"wheelset{wheelset + 1}"))
            at_rail = np.eye(size)[sway] + radius * np.eye(size)[roll]
            tilts[:, wheelset] = np.eye(size)[roll] - cone / half * at_rail
            damping += sideways / speed * np.outer(at_rail, at_rail)
            damping[yaw, yaw] += longitudinal * half**2 / speed
            damping[[yaw, roll], [roll, yaw]] += np.array([1, -1]) * bogie.wheelset_spin * speed / radius
            stiffness[:, yaw] -= sideways * at_rail
            stiffness[sway, roll] += load
            guiding = longitudinal * half * cone / radius
            stiffness[yaw] += guiding * at_rail
            stiffness[yaw, yaw] -= load * half * cone
            aside[:, wheelset] = -rail * cone / half * tilts[:, wheelset]
            aside[yaw, wheelset] += guiding
    return damping, stiffness, aside, tilts


def has_lateral_sensors(vehicle: Vehicle) -> bool:
    """Return whether a vehicle has lateral tables and sensors that sway or yaw moves."""
    is_described = bool(vehicle.bogie) and all(bogie.lateral is not None for bogie in vehicle.bogie)
    return is_described and bool(_lateral_channels(vehicle, _coordinates(vehicle)))


def lateral_outputs(vehicle: Vehicle) -> Outputs:
    """Return the output matrices of the vehicle's sensors of lateral motion: those that sway or yaw moves.

    Raises
    ------
    ParameterError
        As raised by `lateral_system`, or if no sensor measures lateral motion.

    Notes
    -----
    An accelerometer that points to the left reads gravity times the roll of its part.
    """
    measured = _lateral_channels(vehicle, _coordinates(vehicle))
    if not measured:
        raise ParameterError(
            f"vehicle {vehicle.name!r} has no lateral sensor: add [[sensor]] tables with direction = [0, 1, 0]"
        )
    displacement, velocity, acceleration = np.moveaxis(np.array([rows for _, rows in measured]), 1, 0)
    return Outputs(tuple(channel for channel, _ in measured), acceleration, velocity, displacement)


def lateral_modes(vehicle: Vehicle, *, speed: float) -> ExactModes:
    """Return the exact lateral modes of a rail vehicle at a speed, without those of the contacts with the rails.

    Motion that decays faster than it oscillates is left out, too.

    Raises
    ------
    ParameterError
        As raised by `lateral_system`.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle
    >>> coach = read_vehicle("coach")
    >>> [round(float(min(lateral_modes(coach, speed=speed).damping_ratio)), 2) for speed in (20.0, 60.0)]
    [0.21, 0.13]
    """
    none = np.zeros((0, len(_coordinates(vehicle))))
    exact = modes(lateral_system(vehicle, speed=speed), Outputs((), none, none, none))
    below = slice(exact.poles.size - 2 * len(vehicle.bogie))  # the fastest are wheelsets that roll on their rails
    return replace(exact, poles=exact.poles[below], mode_shapes=exact.mode_shapes[below], labels=exact.labels[below])


def critical_speed(vehicle: Vehicle, *, highest: float = 200.0) -> float | None:
    """Return the lowest speed at which a lateral mode is not damped [m/s]; None: all are up to the highest.

    Parameters
    ----------
    vehicle
        Rail vehicle with lateral tables.
    highest
        Highest speed that is considered [m/s], above 1.

    Raises
    ------
    ParameterError
        As raised by `lateral_system`.

    Notes
    -----
    The linear critical speed: the first of the speeds, in steps of 1 m/s from 1 m/s, at which an eigenvalue has a real
    part above 0, refined by bisection. With worn profiles a vehicle may hunt with large amplitudes below it.
    """
    at = lateral_systems(vehicle)

    def growth(speed: float) -> float:
        return float(np.linalg.eigvals(at(speed).state_matrix()).real.max())

    unstable = next((speed for speed in np.arange(1.0, highest + 1.0) if growth(speed) > 0), None)
    if unstable is None:
        return None
    low, high = float(unstable) - 1.0, float(unstable)
    while high - low > 1e-6:
        middle = (low + high) / 2
        low, high = (middle, high) if middle > 0 and growth(middle) <= 0 else (low, middle)
    return high


def lateral_components(vehicle: Vehicle) -> dict[str, float]:
    """Return the values of lateral components, such as "conicity" and "bogie1.lateral_damper", that are not 0.

    Raises
    ------
    ParameterError
        If the vehicle has no lateral tables.
    """
    tables = _tables(vehicle)
    values = {"conicity": tables[0][1].conicity, "creep": tables[0][1].creep[1]}
    for number, (_, lateral) in enumerate(tables, start=1):
        for part, name in LATERAL_PARTS.items():
            value = getattr(lateral, name)["lateral" in part]
            if value > 0:
                values[f"bogie{number}.{part}"] = value
    return values


def lateral_parts(vehicle: Vehicle) -> dict[Component, str]:
    """Return the parts that lateral components are of, with their names there: all but creep, which is the rails' too.

    Raises
    ------
    ParameterError
        As raised by `lateral_components`.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle
    >>> [str(part) for part in lateral_parts(read_vehicle("coach"))][:3]
    ['wheelsets.conicity', 'bogie1.primary_longitudinal_spring', 'bogie1.primary_lateral_spring']
    """
    names = [name for name in lateral_components(vehicle) if name != "creep"]
    return {Component.parse(name if "." in name else f"wheelsets.{name}"): name for name in names}


def with_lateral(vehicle: Vehicle, log_ratios: Mapping[str, float]) -> Vehicle:
    """Return the vehicle with lateral components, named as by `lateral_components`, times exp(log ratio)."""
    factors = {name: float(np.exp(value)) for name, value in log_ratios.items()}
    bogies = []
    for number, (bogie, lateral) in enumerate(_tables(vehicle), start=1):
        fields = {name: list(getattr(lateral, name)) for name in LATERAL_PARTS.values()}
        for part, name in LATERAL_PARTS.items():
            fields[name]["lateral" in part] *= factors.get(f"bogie{number}.{part}", 1.0)
        changed: dict[str, object] = {name: tuple(values) for name, values in fields.items()}
        changed["conicity"] = lateral.conicity * factors.get("conicity", 1.0)
        changed["creep"] = tuple(value * factors.get("creep", 1.0) for value in lateral.creep)
        bogies.append(bogie.model_copy(update={"lateral": lateral.model_copy(update=changed)}))
    return vehicle.model_copy(update={"bogie": tuple(bogies)})


def with_load(vehicle: Vehicle, mass: float) -> Vehicle:
    """Return the vehicle with a load [kg] at the centre of gravity of its body."""
    return vehicle.model_copy(update={"body": vehicle.body.model_copy(update={"mass": vehicle.body.mass + mass})})


def _tables(vehicle: Vehicle) -> list[tuple[Bogie, Lateral]]:
    """Return the bogies with their lateral tables."""
    check_type("vehicle", vehicle, Vehicle)
    tables = [(bogie, bogie.lateral) for bogie in vehicle.bogie if bogie.lateral is not None]
    if not vehicle.bogie:
        raise ParameterError(f"vehicle {vehicle.name!r} has no [[bogie]] tables, of which lateral motion is modelled")
    if len(tables) < len(vehicle.bogie):
        raise ParameterError(
            f"vehicle {vehicle.name!r} has no [bogie.lateral] table for each [[bogie]]: add them for its lateral motion"
        )
    if vehicle.body.height is None:
        raise ParameterError(
            f"the body of vehicle {vehicle.name!r} has no height, which its lateral motion needs: add it"
        )
    return tables


def _motions(part: str) -> tuple[str, str, str]:
    """Return the names of sway, roll and yaw of a part."""
    prefix = "" if part == "body" else f"{part}_"
    return f"{prefix}sway", f"{prefix}roll", f"{prefix}yaw"


def _coordinates(vehicle: Vehicle) -> tuple[str, ...]:
    names = list(_motions("body"))
    for number in range(1, len(_tables(vehicle)) + 1):
        names += _motions(f"bogie{number}")
        for wheelset in (2 * number - 1, 2 * number):
            names += _motions(f"wheelset{wheelset}")
    return tuple(names)


def _lateral_channels(vehicle: Vehicle, coordinates: tuple[str, ...]) -> list[tuple[Channel, Real]]:
    """Return the channels of lateral motion with their readings by order of derivative, shape (3, coordinates)."""
    channels = []
    for sensor in vehicle.sensor:
        if not sensor.is_motion or sensor.between is not None:
            continue
        (x, y, h), (dx, dy, dz) = sensor.position or (0.0,) * 3, sensor.direction or (0.0, 0.0, 1.0)
        order, is_rotation = MOTIONS[sensor.quantity]
        motion = (0.0, dx, dz) if is_rotation else (dy, dz * y - dy * h, dy * x - dx * y)
        rows = np.zeros((3, len(coordinates)))
        for name, value in zip(names := _motions(sensor.on), motion, strict=True):
            if name in coordinates:
                rows[order, coordinates.index(name)] = value
        if order == 2 and names[1] in coordinates:
            rows[0, coordinates.index(names[1])] = STANDARD_GRAVITY * dy
        if abs(dz) > abs(dy) if is_rotation else abs(dy) > abs(dz):
            channels.append((sensor.as_channel(), rows))
    return channels


def _point(part: str, x: float, y: float, h: float, sign: float = 1.0) -> list[dict[str, float]]:
    """Return the forward, lateral and vertical displacement of a point of a part for one unit of its coordinates."""
    sway, roll, yaw = _motions(part)
    return [{yaw: -sign * y}, {sway: sign, roll: -sign * h, yaw: sign * x}, {roll: sign * y}]


def springs_across(vehicle: Vehicle) -> Iterator[tuple[str, str, dict[str, float], float, float]]:
    """Yield owner, part, elongation by coordinate, stiffness and damping of every spring with its damper.

    Parts are those of `sprung.vehicles.structure.PARTS`; of upright springs and anti-roll bars it is empty.
    """
    height = vehicle.body.height or 0.0
    for number, (bogie, lateral) in enumerate(_tables(vehicle), start=1):
        name, (primary, secondary) = f"bogie{number}", bogie.half_spacing
        upright = (
            bogie.secondary[:2],
            (bogie.primary_stiffness, bogie.primary_damping),
        )
        lengthways, across = zip(lateral.secondary_stiffness, lateral.secondary_damping, strict=True)
        second = (lengthways[0], 0.0), across, upright[0]
        first = (*zip(lateral.primary_stiffness, lateral.primary_damping, strict=True), upright[1])
        drops = lateral.secondary_height - height, lateral.secondary_height - lateral.frame_height
        for y in (secondary, -secondary):
            ends = zip(_point("body", bogie.x, y, drops[0]), _point(name, 0.0, y, drops[1], -1.0), second, strict=True)
            for part, (upper, lower, values) in zip(("yaw", "lateral", ""), ends, strict=True):
                yield name, part, upper | lower, *values
            place = math.copysign(bogie.yaw_damper_place[0], y)
            pulled = _point("body", 0.0, place, 0.0)[0] | _point(name, 0.0, place, 0.0, -1.0)[0]
            yield name, "yaw", pulled, 0.0, lengthways[1]
        yield name, "", {"roll": 1.0, f"{name}_roll": -1.0}, bogie.anti_roll_stiffness, 0.0
        carried = STANDARD_GRAVITY * vehicle.body.mass / len(vehicle.bogie)
        yield from _leaning(("body", name), (bogie.x, 0.0), drops, carried)
        for wheelset, along in ((2 * number - 1, bogie.half_wheelbase), (2 * number, -bogie.half_wheelbase)):
            box, drop = f"wheelset{wheelset}", lateral.wheel_radius - lateral.frame_height
            for y in (primary, -primary):
                ends = zip(_point(name, along, y, drop), _point(box, 0.0, y, 0.0, -1.0), first, strict=True)
                for part, (upper, lower, values) in zip(("primary_along", "primary_lateral", ""), ends, strict=True):
                    yield name, part, upper | lower, *values
            yield from _leaning((name, box), (along, 0.0), (drop, 0.0), carried / 2 + STANDARD_GRAVITY * bogie.mass / 2)


def _leaning(
    parts: tuple[str, str], along: tuple[float, float], drops: tuple[float, float], carried: float
) -> Iterator[tuple[str, str, dict[str, float], float, float]]:
    """Yield what a load on the springs between two parts adds, as they stand upright on the lower one.

    Its energy is F (r_l d - (h_u r_u^2 - h_l r_l^2) / 2) with the load F, the rolls r of both parts, the heights h of
    the springs above their centres, and the lateral displacement d of the upper end over the lower one.
    """
    upper = _point(parts[0], along[0], 0.0, drops[0])[1]
    aside = upper | _point(parts[1], along[1], 0.0, drops[1], -1.0)[1]
    roll = f"{_motions(parts[1])[1]}"
    yield parts[1], "weight", {_motions(parts[0])[1]: 1.0}, carried * drops[0], 0.0
    yield parts[1], "weight", {roll: 1.0}, -carried * drops[1], 0.0
    for sign in (1.0, -1.0):  # 2 r d = ((r + d)^2 - (r - d)^2) / 2
        both = {name: sign * value for name, value in aside.items()}
        both[roll] = both.get(roll, 0.0) + 1.0
        yield parts[1], "weight", both, sign * carried / 2, 0.0
