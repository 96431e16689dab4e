"""A vehicle file in the course of its completion, and the numbers of it that drives can teach."""

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from sprung._arrays import Complex, Real
from sprung.vehicles import Component, Sensor, Structure, Vehicle, corner_names, structure

#: Group of the numbers of sensors, which leave the motion of the vehicle as it is.
SENSORS = "sensors"
#: Where a number is in a draft: field of the body, entry of a table with its field, channel of a sensor with its field
#: and axis, component of a corner, or the centre of gravity.
Place = tuple[str | int | Component, ...]


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

    def value_at(self, place: Place) -> float:
        """Return a number of the draft."""
        match place:
            case ("factors", Component() as component):
                return self.factors.get(component, 1.0)
            case ("body", str(name)):
                return float(getattr(self.vehicle.body, name))
            case ("sensor", str(channel), str(name)):
                return float(getattr(self.sensor(channel), name))
            case ("sensor", str(channel), str(name), int(axis)):
                return float(self._vector(channel, name)[axis])
            case (str(table), int(index), str(name)):
                return float(getattr(getattr(self.vehicle, table)[index], name))
        return 0.0  # the centre of gravity is the origin

    def with_value(self, place: Place, value: float) -> "Draft":
        """Return the draft with another number."""
        match place:
            case ("factors", Component() as component):
                return replace(self, factors={**self.factors, component: value})
            case ("body", str(name)):
                return self.with_body(**{name: value})
            case ("sensor", str(channel), str(name)):
                return self.with_sensor(channel, **{name: value})
            case ("sensor", str(channel), str(name), int(axis)):
                vector = self._vector(channel, name)
                return self.with_sensor(channel, **{name: (*vector[:axis], value, *vector[axis + 1 :])})
            case (str(table), int(index), str(name)):
                return self.with_entry(table, index, **{name: value})
        return self.ahead(value)

    def _vector(self, channel: str, name: str) -> tuple[float, ...]:
        return getattr(self.sensor(channel), name) or (0.0, 0.0, 1.0 if name == "direction" else 0.0)

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
    place
        Where it is in a draft.
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
    place: Place
    unit: str = ""
    components: tuple[Component, ...] = ()
    channel: str = ""

    @property
    def field(self) -> str:
        """Last part of the name, such as "x"."""
        return self.name.rpartition(".")[2]

    def moved(self, draft: Draft, parameter: float) -> Draft:
        """Return the draft with the number moved by a parameter."""
        return draft.with_value(self.place, self.value(draft.value_at(self.place), parameter))

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


@dataclass(frozen=True, slots=True)
class Widths:
    """Standard deviations of numbers before any drive: of ln(value / given value) where no unit is stated."""

    #: A corner over its axle (manufacturing tolerance), wheels, inertias, anti-roll bars and gains of sensors.
    side: float = 0.05
    wheel: float = 0.07
    inertia: float = 0.1
    bar: float = 0.3
    gain: float = 0.03
    #: Centre of gravity, places of sensors and of mounted masses [m].
    centre: float = 0.05
    place: float = 0.1
    mass_place: float = 0.2
    #: Delays of sensors [s], and directions of gyroscopes (direction cosine: 2 degrees).
    delay: float = 2e-3
    tilt: float = 0.035
    #: Factor for a mass or mode that the file lacks.
    new: float = 2.0
    #: Smallest width in a later calibration over the first one.
    sure: float = 0.1


WIDTHS = Widths()
#: Mounted masses and flexible modes of the body: widths of their fields.
_MOUNTED = {"mass": 0.3, "frequency": 0.15, "damping_ratio": 0.5}
_FLEXIBLE = {"frequency": 0.1, "damping_ratio": 0.4, "mass": 0.25}
#: Fields of an axle that make the components of its corners.
COMPONENT_FIELDS = {
    "spring_stiffness": ("spring", "N/m"),
    "damping": ("damper", "N s/m"),
    "tyre_stiffness": ("tyre", "N/m"),
}


def component_numbers(draft: Draft, *, std: float) -> tuple[VehicleNumber, ...]:
    """Return springs, dampers and tyres: the value of each axle, and each corner's over it.

    Parameters
    ----------
    draft
        Vehicle as given.
    std
        Standard deviation of ln(value / given value) of an axle's.
    """
    numbers = []
    corners = corner_names(len(draft.vehicle.axle))
    for index, axle in enumerate(draft.vehicle.axle):
        left, right = corners[2 * index : 2 * index + 2]
        for name, (kind, unit) in COMPONENT_FIELDS.items():
            if getattr(axle, name):
                both = Component(left, kind), Component(right, kind)
                of_axle = _entry(("axle", index, name), f"{left.removesuffix('_left')}.{name}", std=std, unit=unit)
                numbers.append(replace(of_axle, components=both))
                for one in both:
                    place = ("factors", one)
                    numbers.append(VehicleNumber(str(one), "sides", WIDTHS.side, True, place, components=(one,)))
    return tuple(numbers)


def file_numbers(draft: Draft, channels: Sequence[str]) -> tuple[VehicleNumber, ...]:
    """Return the other numbers of a file that can be learnt from drives: body, wheels, anti-roll bars, sensors.

    Parameters
    ----------
    draft
        Vehicle as given.
    channels
        Channels that were recorded.
    """
    return (*_body(), *_wheels(draft), *sensor_numbers(draft, channels))


def mounted_numbers(draft: Draft, *, given: Vehicle) -> tuple[VehicleNumber, ...]:
    """Return mass, frequency, damping and place of the mounted masses; those that `given` lacks are less known."""
    numbers = []
    for index, mass in enumerate(draft.vehicle.mounted_mass):
        where, factor = f"mounted_mass_{index + 1}", 1.0 if index < len(given.mounted_mass) else WIDTHS.new
        for name, unit in (("mass", "kg"), ("frequency", "Hz"), ("damping_ratio", "")):
            if getattr(mass, name) > 0:
                numbers.append(
                    _entry(("mounted_mass", index, name), f"{where}.{name}", std=factor * _MOUNTED[name], unit=unit)
                )
        for name in ("x", "y"):
            place = ("mounted_mass", index, name)
            numbers.append(_entry(place, f"{where}.{name}", std=factor * WIDTHS.mass_place, unit="m", is_log=False))
    return tuple(numbers)


def mode_numbers(draft: Draft, *, given: Vehicle) -> tuple[VehicleNumber, ...]:
    """Return frequency, damping and modal mass of the flexible modes; those that `given` lacks are less known."""
    known = {mode.shape for mode in given.flexible_mode}
    numbers = []
    for index, mode in enumerate(draft.vehicle.flexible_mode):
        factor = 1.0 if mode.shape in known else WIDTHS.new
        for name, unit in (("frequency", "Hz"), ("damping_ratio", ""), ("mass", "kg")):
            if getattr(mode, name):
                entry, std = ("flexible_mode", index, name), factor * _FLEXIBLE[name]
                numbers.append(_entry(entry, f"{mode.shape}.{name}", std=std, unit=unit))
    return tuple(numbers)


def with_widths(numbers: Sequence[VehicleNumber], draft: Draft) -> tuple[VehicleNumber, ...]:
    """Return numbers with the standard deviations that the file's table [[learnt]] states, if any.

    A file from a data sheet says how good its guesses are, an earlier calibration how well it knew a number; drives may
    still move the latter by a tenth of what is usual.
    """
    stated = {entry.name: entry.std for entry in draft.vehicle.learnt if entry.std > 0}
    return tuple(
        replace(number, std=max(_relative(number, draft, stated[number.name]), WIDTHS.sure * number.std))
        if number.name in stated
        else number
        for number in numbers
    )


def _relative(number: VehicleNumber, draft: Draft, std: float) -> float:
    """Return the standard deviation of a number's parameter for that of its value."""
    return std / abs(draft.value_at(number.place)) if number.is_log else std


def sensor_numbers(draft: Draft, channels: Sequence[str]) -> tuple[VehicleNumber, ...]:
    """Return places, scales, directions and delays of the sensors of motion."""
    numbers: list[VehicleNumber] = []
    for sensor in draft.vehicle.sensor:
        if sensor.channel not in channels or not sensor.is_motion:
            continue
        name, axes = sensor.channel, (0, 1) if sensor.on == "body" and sensor.between is None else ()
        entries = [("scale", WIDTHS.gain, True, (), ""), ("delay", WIDTHS.delay, False, (), "s")]
        if sensor.quantity in {"angular_velocity", "angle"}:
            across = [axis for axis in axes if abs((sensor.direction or (0, 0, 1))[axis]) < 0.5]
            vectors = [(f"direction_{'xy'[axis]}", WIDTHS.tilt, False, ("direction", axis), "") for axis in across]
        else:
            vectors = [("xy"[axis], WIDTHS.place, False, ("position", axis), "m") for axis in axes]
        for last, std, is_log, of_vector, unit in (*vectors, *entries):
            place = ("sensor", name, *(of_vector or (last,)))
            numbers.append(VehicleNumber(f"{name}.{last}", SENSORS, std, is_log, place, unit, channel=name))
    return tuple(numbers)


def _body() -> Iterator[VehicleNumber]:
    """Yield inertias and centre of gravity of the body."""
    for name in ("pitch_inertia", "roll_inertia"):
        yield VehicleNumber(f"body.{name}", "body", WIDTHS.inertia, True, ("body", name), "kg m2")
    yield VehicleNumber("body.centre_x", "body", WIDTHS.centre, False, ("centre",), "m")


def _wheels(draft: Draft) -> Iterator[VehicleNumber]:
    """Yield unsprung masses and anti-roll bars."""
    names = corner_names(len(draft.vehicle.axle))[::2]
    for index, (axle, left) in enumerate(zip(draft.vehicle.axle, names, strict=True)):
        where = left.removesuffix("_left")
        for name, std, unit in (("unsprung_mass", WIDTHS.wheel, "kg"), ("anti_roll_stiffness", WIDTHS.bar, "N/m")):
            if getattr(axle, name) and axle.wheelset_mass is None:
                yield _entry(("axle", index, name), f"{where}.{name}", std=std, unit=unit)


def _entry(entry: tuple[str, int, str], name: str, *, std: float, unit: str, is_log: bool = True) -> VehicleNumber:
    """Return a field of an entry of a table as a number: table, index, field."""
    group = "mounted_masses" if entry[0] == "mounted_mass" else "wheels"
    group = "modes" if entry[0] == "flexible_mode" else group
    group = "components" if entry[2] in COMPONENT_FIELDS else group
    return VehicleNumber(name, group, std, is_log, entry, unit)
