"""A vehicle file in the course of its completion, and those of its numbers that can be learnt from drives."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sprung._arrays import Complex, Real
from sprung.vehicles import Component, Sensor, Structure, Vehicle, corner_names, structure

#: Group of the numbers of sensors, which leave the motion of the vehicle as it is.
SENSORS = "sensors"


@dataclass(frozen=True, eq=False, slots=True)
class Draft:
    """A vehicle file, and what a file does not hold: the differences between the corners of an axle.

    Parameters
    ----------
    vehicle
        Vehicle with all its masses and inertias stated.
    factors
        Value of a corner's component over that of its axle; 1 for those that are absent.
    """

    vehicle: Vehicle
    factors: Mapping[Component, float] = field(default_factory=dict)

    def structure(self) -> Structure:
        """Return the vehicle as a structure, its sides unlike."""
        nominal = structure(self.vehicle)
        return nominal.changed(self.factors) if self.factors else nominal

    def sensor(self, channel: str) -> Sensor:
        """Return the sensor of a channel."""
        return next(sensor for sensor in self.vehicle.sensor if sensor.channel == channel)

    def with_sensor(self, channel: str, **values: object) -> "Draft":
        """Return the draft with fields of one sensor replaced."""
        sensors = tuple(
            sensor.model_copy(update=values) if sensor.channel == channel else sensor for sensor in self.vehicle.sensor
        )
        return self.with_fields(sensor=sensors)

    def with_entry(self, table: str, index: int, **values: object) -> "Draft":
        """Return the draft with fields of one entry of a table such as "axle" replaced."""
        entries = list(getattr(self.vehicle, table))
        entries[index] = entries[index].model_copy(update=values)
        return self.with_fields(**{table: tuple(entries)})

    def ahead(self, distance: float) -> "Draft":
        """Return the draft with the body's centre of gravity moved ahead: all else is farther back from it."""
        sensors = tuple(
            sensor
            if sensor.position is None or sensor.on != "body"
            else sensor.model_copy(update={"position": (sensor.position[0] - distance, *sensor.position[1:])})
            for sensor in self.vehicle.sensor
        )
        tables = {
            name: tuple(entry.model_copy(update={"x": entry.x - distance}) for entry in getattr(self.vehicle, name))
            for name in ("axle", "mounted_mass")
        }
        return self.with_fields(sensor=sensors, **tables)

    def with_body(self, **values: object) -> "Draft":
        """Return the draft with fields of the body replaced."""
        return self.with_fields(body=self.vehicle.body.model_copy(update=values))

    def with_fields(self, **values: object) -> "Draft":
        """Return the draft with fields of the vehicle replaced."""
        return replace(self, vehicle=self.vehicle.model_copy(update=values))


@dataclass(frozen=True, eq=False, slots=True)
class VehicleNumber:
    """A number of the vehicle file that can be learnt from drives.

    Parameters
    ----------
    name
        Place of the number, such as "front.spring_stiffness", "acc_fl.x" or "mounted_mass_1.frequency".
    group
        Kind of number: "components", "sides", "body", "wheels", "sensors", "mounted_masses".
    std
        Standard deviation before any data: of ln(value / given value) or of the value.
    is_log
        Whether the parameter is ln(value / given value); otherwise it is value - given value.
    get, put
        Value in a draft; draft with another value.
    unit
        Unit of the value.
    components
        Components of corners that it multiplies, if that is all it changes.
    channel
        Channel of the sensor that it belongs to; empty for others.
    """

    name: str
    group: str
    std: float
    is_log: bool
    get: Callable[[Draft], float]
    put: Callable[[Draft, float], Draft]
    unit: str = ""
    components: tuple[Component, ...] = ()
    channel: str = ""

    @property
    def field(self) -> str:
        """Last part of the name, such as "x"."""
        return self.name.rpartition(".")[2]

    def moved(self, draft: Draft, parameter: float) -> Draft:
        """Return the draft with the number moved by a parameter."""
        given = self.get(draft)
        return self.put(draft, given * float(np.exp(parameter)) if self.is_log else given + parameter)

    def value(self, given: float, parameter: float) -> float:
        """Return the value that a parameter stands for."""
        return given * float(np.exp(parameter)) if self.is_log else given + parameter

    def std_of_value(self, value: float, std: float) -> float:
        """Return the standard deviation of the value for that of the parameter."""
        return abs(value) * std if self.is_log else std


def moved(draft: Draft, numbers: Sequence[VehicleNumber], parameters: Real) -> Draft:
    """Return the draft with numbers moved by parameters, shape (numbers,)."""
    for number, parameter in zip(numbers, parameters.tolist(), strict=True):
        draft = number.moved(draft, parameter)
    return draft


def explicit(vehicle: Vehicle) -> Draft:
    """Return a vehicle as a draft whose masses and inertias are all stated, the estimates included."""
    pitch, roll = vehicle.inertias
    nominal = structure(vehicle)
    by_name = dict(zip(nominal.coordinates, np.diag(nominal.mass).tolist(), strict=True))
    axles = tuple(
        axle.model_copy(update={"unsprung_mass": by_name[f"wheel_{left}"]}) if f"wheel_{left}" in by_name else axle
        for axle, left in zip(vehicle.axle, corner_names(len(vehicle.axle))[::2], strict=True)
    )
    body = vehicle.body.model_copy(update={"pitch_inertia": pitch, "roll_inertia": roll})
    return Draft(vehicle.model_copy(update={"body": body, "axle": axles}))


def channel_responses(draft: Draft, given: Draft, channels: Sequence[str], frequencies: Real) -> Complex:
    """Return the reading of channels, scaled as `given` states, for one unit of what they measure.

    Parameters
    ----------
    draft, given
        Sensors as they may be, and as they were taken to be when the recording was placed.
    channels
        Names of the channels.
    frequencies
        Frequencies [Hz], shape (grid,).

    Returns
    -------
    ndarray
        Shape (grid, channels): scale as given over true scale times e^(-i w delay).
    """
    gains = np.array([given.sensor(name).scale / draft.sensor(name).scale for name in channels])
    delays = np.array([draft.sensor(name).delay - given.sensor(name).delay for name in channels])
    return np.asarray(gains * np.exp(-2j * np.pi * frequencies[:, None] * delays), dtype=np.complex128)


def motion_of(channels: Sequence[str], vehicle: Structure) -> Real:
    """Return the reading of channels for one unit of acceleration of each coordinate, shape (channels, n)."""
    outputs = vehicle.outputs
    rows = [outputs.names.index(name) for name in channels]
    return np.asarray((outputs.acceleration + outputs.velocity + outputs.displacement)[rows], dtype=np.float64)
