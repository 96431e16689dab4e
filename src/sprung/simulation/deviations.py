"""Deviations of a vehicle from its file: values, parts that the file lacks, production scatter, wear, its sensors."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number, check_one_of
from sprung.errors import ParameterError
from sprung.simulation.sensors import Imperfection, delayed, scaled
from sprung.toml import checked
from sprung.vehicles import Component, Fault, FlexibleMode, MountedMass, Sensor, Structure, Vehicle, structure
from sprung.vehicles.structure import DAMPERS, SPRINGS

#: Fields of the body and of all axles whose values may differ from the file.
_BODY = ("mass", "pitch_inertia", "roll_inertia")
_AXLES = {"wheelbase": "x", "track": "half_track", "unsprung_mass": "unsprung_mass"}
_AXLES |= {"anti_roll_stiffness": "anti_roll_stiffness"}
#: Values that may differ from the file.
VALUES = (*_BODY, *_AXLES)
#: Field of the production scatter of each kind of part; contacts with rails count as tyres.
_SCATTERING = {**dict.fromkeys(SPRINGS, "spring"), **dict.fromkeys(DAMPERS, "damper"), "tyre": "tyre"}
#: Streams of random numbers of one vehicle, so that switching on one deviation leaves the others as they are.
_SCATTER, _PLACES, _TILTS, _GAINS, _LAGS, WHEELS = range(6)


@dataclass(frozen=True, slots=True)
class PartScatter:
    """Production scatter of parts between vehicles of a type.

    Parameters
    ----------
    spring, damper, tyre
        Standard deviation relative to nominal, at least 0.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """

    spring: float = 0.04
    damper: float = 0.05
    tyre: float = 0.03

    def __post_init__(self) -> None:
        for name in ("spring", "damper", "tyre"):
            check_number(f"scatter of every {name}", getattr(self, name), at_least=0, at_most=0.3)


@dataclass(frozen=True, slots=True)
class Wear:
    """Part that changes with every drive.

    Parameters
    ----------
    component
        Spring, damper or tyre.
    per_drive
        Relative change in each drive, above -1; after n drives the part has (1 + per_drive)^n of its value.

    Raises
    ------
    ParameterError
        If the change is out of range.
    """

    component: Component
    per_drive: float

    def __post_init__(self) -> None:
        check_number(f"wear of {self.component}", self.per_drive, above=-1, advice="-0.01 means 1 % less in each drive")

    def fault(self, n_drives: int) -> Fault:
        """Return the change after a number of drives."""
        return Fault(self.component, (1 + self.per_drive) ** n_drives - 1)


@dataclass(frozen=True, slots=True)
class SensorErrors:
    """Errors of the sensors of one vehicle against its file.

    Parameters
    ----------
    places
        Distance of every sensor on the body from the stated place, in a random horizontal direction [m].
    moved
        Offset of single sensors from the stated place by channel, (x, y, z) [m].
    tilt
        Angle of every sensor's axis to the stated one, about a random axis [rad].
    gain
        Standard deviation of the gains about 1.
    lag
        Largest delay of a sensor [s]; delays are uniform from 0 on.

    Raises
    ------
    ParameterError
        If a number is out of range.
    """

    places: float = 0.0
    moved: Mapping[str, tuple[float, float, float]] = field(default_factory=dict)
    tilt: float = 0.0
    gain: float = 0.0
    lag: float = 0.0

    def __post_init__(self) -> None:
        object.__setattr__(self, "moved", dict(self.moved))
        for name, most in (("places", 10.0), ("tilt", math.pi / 2), ("gain", 0.5), ("lag", 10.0)):
            check_number(name, getattr(self, name), at_least=0, at_most=most)


@dataclass(frozen=True, slots=True)
class Deviations:
    """Deviations of a vehicle from its file, which keeps the nominal numbers.

    Parameters
    ----------
    values
        Relative differences by name, a key of `VALUES`: {"mass": 0.07} is 7 % heavier than the file states.
    mounted_masses
        Masses on mounts that the file lacks, in addition to the mass of the body.
    flexible_modes
        Torsion and bending of the body that the file lacks.
    scatter
        Production scatter of parts; None: parts as in the file.
    wear
        Parts that change with every drive.
    n_drives
        Number of drives that the vehicle has completed, at least 0.
    sensors
        Errors of places, axes, gains and delays of sensors.
    individual
        Number of the vehicle among those of its type, at least 0: the seed of its random deviations, which are the same
        in all its drives.

    Raises
    ------
    ParameterError
        If a number is out of range, or a value has no such name.
    """

    values: Mapping[str, float] = field(default_factory=dict)
    mounted_masses: tuple[MountedMass, ...] = ()
    flexible_modes: tuple[FlexibleMode, ...] = ()
    scatter: PartScatter | None = None
    wear: tuple[Wear, ...] = ()
    n_drives: int = 0
    sensors: SensorErrors = SensorErrors()
    individual: int = 0

    def __post_init__(self) -> None:
        object.__setattr__(self, "values", dict(self.values))
        for name, change in self.values.items():
            check_one_of("value of the vehicle file", name, VALUES)
            check_number(f"difference of {name}", change, above=-0.9, at_most=10, advice="0.07 means 7 % more")
        check_number("n_drives", self.n_drives, at_least=0)
        check_number("individual", self.individual, at_least=0)

    @property
    def worn(self) -> tuple[Fault, ...]:
        """Changes by wear."""
        return tuple(wear.fault(self.n_drives) for wear in self.wear)

    def factors(self, vehicle: Structure) -> dict[Component, float]:
        """Return the true over the nominal value of each spring, damper and tyre of a corner, by production scatter."""
        if self.scatter is None:
            return {}
        generator, factors = self.generator(_SCATTER), {}
        for component in vehicle.components():
            if component.side is not None and component.kind in _SCATTERING:
                std = getattr(self.scatter, _SCATTERING[component.kind])
                factors[component] = math.exp(std * generator.standard_normal())
        return factors

    def sensor_imperfections(self, vehicle: Vehicle) -> tuple[Imperfection, ...]:
        """Return what scales and delays the channels of a vehicle: its file, and errors of gain and delay."""
        gains, lags = self.generator(_GAINS), self.generator(_LAGS)
        changes: list[tuple[str, float, float]] = []
        for sensor in vehicle.sensor:
            if sensor.is_motion:
                gain, lag = 1 + self.sensors.gain * gains.standard_normal(), self.sensors.lag * lags.random()
                changes.append((sensor.channel, gain / sensor.scale, lag + sensor.delay))
            elif sensor.is_condition:
                changes.append((sensor.channel, 1 / sensor.scale, sensor.delay))
        changes.append((vehicle.speed_channel, 1 / vehicle.speed_scale, vehicle.speed_delay))
        scales = [partial(scaled, channel=name, factor=float(factor)) for name, factor, _ in changes if factor != 1]
        return (*scales, *(partial(delayed, channel=name, delay=float(lag)) for name, _, lag in changes if lag != 0))

    def generator(self, stream: int) -> np.random.Generator:
        """Return the generator of one stream of random numbers of the vehicle."""
        return np.random.default_rng(np.random.SeedSequence(self.individual, spawn_key=(stream,)))


def true_vehicle(vehicle: Vehicle, deviations: Deviations) -> Vehicle:
    """Return the true vehicle: that of the file, changed by the deviations.

    Parameters
    ----------
    vehicle
        Vehicle as in its file.
    deviations
        Deviations of the true vehicle from the file. Scatter and wear of parts differ between left and right, which no
        file can state: see `Deviations.factors` and `Deviations.worn`.

    Returns
    -------
    Vehicle
        Description with true masses, inertias, geometry, mounted masses, and places and axes of sensors.

    Raises
    ------
    ParameterError
        If the vehicle lacks a sensor that was moved or a value that differs, or a changed value is impossible.

    Examples
    --------
    >>> from sprung.vehicles import read_vehicle
    >>> zafira = read_vehicle("zafira")
    >>> round(true_vehicle(zafira, Deviations(values={"mass": 0.1})).body.mass, 6)
    1628.0
    """
    fields = _explicit(vehicle).model_dump()
    for name, change in deviations.values.items():
        key = _AXLES.get(name, name)
        sections = [part for part in ([fields["body"]] if name in _BODY else fields["axle"]) if part[key]]
        if not sections:
            raise ParameterError(f"vehicle {vehicle.name!r} has no {name} that could differ: leave it out")
        for section in sections:
            section[key] *= 1 + change
    fields["mounted_mass"] = [*fields["mounted_mass"], *(part.model_dump() for part in deviations.mounted_masses)]
    fields["flexible_mode"] = [*fields["flexible_mode"], *(mode.model_dump() for mode in deviations.flexible_modes)]
    fields["sensor"] = [sensor.model_dump() for sensor in _true_sensors(vehicle, deviations)]
    return checked(Vehicle, fields)


def _explicit(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with estimates of the inertias and unsprung masses that its file does not state."""
    nominal = structure(vehicle)
    values = dict(zip(nominal.coordinates, np.diag(nominal.mass).tolist(), strict=True))
    pitch_inertia, roll_inertia = vehicle.inertias
    body = vehicle.body.model_copy(update={"pitch_inertia": pitch_inertia, "roll_inertia": roll_inertia})
    wheels = [name for name in nominal.coordinates if name.startswith("wheel_") and name.endswith("_left")]
    axles = vehicle.axle
    if len(wheels) == len(axles):
        axles = tuple(
            axle.model_copy(update={"unsprung_mass": values[name]}) for axle, name in zip(axles, wheels, strict=True)
        )
    return vehicle.model_copy(update={"body": body, "axle": axles})


def _true_sensors(vehicle: Vehicle, deviations: Deviations) -> list[Sensor]:
    """Return the sensors where they are and with the axes that they have."""
    errors = deviations.sensors
    for channel in errors.moved:
        check_one_of("moved sensor", channel, [sensor.channel for sensor in vehicle.sensor])
    places, tilts = deviations.generator(_PLACES), deviations.generator(_TILTS)
    sensors = []
    for sensor in vehicle.sensor:
        angle, turn = places.uniform(0, 2 * math.pi), tilts.standard_normal(3)
        offset = errors.places * np.array([math.cos(angle), math.sin(angle), 0.0]) + errors.moved.get(
            sensor.channel, (0.0, 0.0, 0.0)
        )
        update: dict[str, Any] = {}
        if sensor.position is not None and sensor.on == "body" and sensor.is_motion:
            update["position"] = tuple((np.array(sensor.position) + offset).tolist())
        if sensor.direction is not None and errors.tilt:
            update["direction"] = tuple(_tilted(np.array(sensor.direction), turn, errors.tilt).tolist())
        sensors.append(sensor.model_copy(update=update))
    return sensors


def _tilted(direction: Real, towards: Real, angle: float) -> Real:
    """Return a direction turned by an angle towards the part of a vector that is normal to it."""
    direction = direction / np.linalg.norm(direction)
    normal = towards - (towards @ direction) * direction
    return np.asarray(math.cos(angle) * direction + math.sin(angle) * normal / np.linalg.norm(normal))
