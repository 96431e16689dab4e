"""Magnitudes of the numbers in a vehicle file, judged by the vehicle's own mass and size: wrong units stand out."""

import math
from collections.abc import Iterable, Iterator
from typing import TYPE_CHECKING

from sprung.units import STANDARD_GRAVITY

if TYPE_CHECKING:
    from sprung.vehicles.description import Quarter, Vehicle
    from sprung.vehicles.sections import Axle, QuarterCorner

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


def check_magnitudes(vehicle: "Vehicle") -> None:
    """Reject a body on axles with numbers that no vehicle has; the usual reason is a wrong unit.

    Parameters
    ----------
    vehicle
        Vehicle with its axles in order.

    Raises
    ------
    ValueError
        If a number is out of all proportion to mass and geometry; the message asks for the likely unit.
    """
    _raise_first(_problems(vehicle))


def check_quarter(quarter: "Quarter") -> None:
    """Reject a quarter vehicle with numbers that none has.

    Parameters
    ----------
    quarter
        Quarter vehicle.

    Raises
    ------
    ValueError
        As raised by `check_magnitudes`.
    """
    _raise_first(_suspension_problems("[corner]", quarter.corner, quarter.body.mass, room=_DEEPEST, is_road=False))


def _raise_first(problems: Iterable[str]) -> None:
    """Raise the first problem, if there is one."""
    for problem in problems:
        raise ValueError(problem)


def _problems(vehicle: "Vehicle") -> Iterator[str]:
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


def _geometry_problems(vehicle: "Vehicle", wheelbase: float) -> Iterator[str]:
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


def _inertia_problems(vehicle: "Vehicle") -> Iterator[str]:
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
    where: str, corner: "Axle | QuarterCorner", mass: float, *, room: float, is_road: bool
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


def _damping_problems(where: str, corner: "Axle | QuarterCorner", mass: float, *, is_road: bool) -> Iterator[str]:
    """Yield a damping that does not go with spring stiffness and mass [kg]; a rig may have hardly any."""
    ratio = corner.damping / (2 * math.sqrt(corner.spring_stiffness * mass))
    if ratio > _MOST_DAMPED or (is_road and 0 < ratio < _LEAST_DAMPED):
        unit = "is that N s/mm?" if ratio < 1 else "is the stiffness in another unit?"
        yield (
            f"{where}, damping={corner.damping:g} N s/m under {mass:.3g} kg of body: that damps it by "
            f"{100 * ratio:.2g} %: {unit} Give N s/m, kg and N/m"
        )


def _place_problems(vehicle: "Vehicle", wheelbase: float) -> Iterator[str]:
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
