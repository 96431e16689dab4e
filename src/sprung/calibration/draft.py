"""A vehicle file in the course of its completion, and the numbers of it that drives can teach."""

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any

import numpy as np

from sprung._arrays import Complex, Real
from sprung.vehicles import Component, Structure, Vehicle, corner_names, structure

#: Group of the numbers of sensors, which leave the motion of the vehicle as it is.
SENSORS = "sensors"
#: Where a number is in a draft: a component of a corner, or the fields and indices that lead to it in the vehicle file,
#: such as ("axle", 0, "damping"); none for the centre of gravity.
Place = Component | tuple[str | int, ...]
#: Vectors of a sensor that are not stated.
_VECTORS = MappingProxyType({"position": (0.0, 0.0, 0.0), "direction": (0.0, 0.0, 1.0)})


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
        """Return the vehicle as a structure at the usual speed, its sides unlike."""
        nominal = structure(self.vehicle)
        return nominal.changed(self.factors) if self.factors else nominal

    def value_at(self, place: Place) -> float:
        """Return a number of the draft."""
        if isinstance(place, Component):
            return self.factors.get(place, 1.0)
        part: Any = self.vehicle if place else 0.0  # the centre of gravity is the origin
        for key in place:
            part = _part(part, key)
        return float(part)

    def with_value(self, place: Place, value: float) -> "Draft":
        """Return the draft with another number."""
        if isinstance(place, Component):
            return replace(self, factors={**self.factors, place: value})
        return replace(self, vehicle=_with_part(self.vehicle, place, value)) if place else self.ahead(value)

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
            for name in ("axle", "mounted_mass", "seat")
        }
        return self.with_fields(sensor=sensors, **tables)

    def with_fields(self, **values: object) -> "Draft":
        """Return the draft with fields of the vehicle replaced."""
        return replace(self, vehicle=self.vehicle.model_copy(update=values))


def _part(whole: Any, key: str | int) -> Any:
    """Return a field of a table, or an entry of several."""
    if isinstance(key, int):
        return whole[key]
    value = getattr(whole, key)
    return _VECTORS[key] if value is None and key in _VECTORS else value


def _with_part(whole: Any, place: tuple[str | int, ...], value: float) -> Any:
    """Return a table, or several, with the number at a place replaced."""
    if not place:
        return value
    key, *deeper = place
    changed = _with_part(_part(whole, key), tuple(deeper), value)
    if isinstance(key, int):
        return (*whole[:key], changed, *whole[key + 1 :])
    return whole.model_copy(update={key: changed})


@dataclass(frozen=True, eq=False, slots=True)
class VehicleNumber:
    """A number of the vehicle file that can be learnt from drives.

    Parameters
    ----------
    name
        Place of the number, such as "front.spring_stiffness", "acc_fl.x" or "mounted_mass_1.frequency".
    group
        Kind of number: "components", "sides", "body", "wheels", "sensors", "mounted_masses", "modes".
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
    is_new
        Whether it belongs to a part that the given file lacks.
    """

    name: str
    group: str
    std: float
    is_log: bool
    place: Place
    unit: str = ""
    components: tuple[Component, ...] = ()
    channel: str = ""
    is_new: bool = False

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
    true, taken = ({sensor.channel: sensor for sensor in each.vehicle.sensor} for each in (draft, given))
    gains = np.array([taken[name].scale / true[name].scale for name in channels])
    delays = np.array([true[name].delay - taken[name].delay for name in channels])
    return np.asarray(gains * np.exp(-2j * np.pi * frequencies[:, None] * delays), dtype=np.complex128)


def motion_of(channels: Sequence[str], vehicle: Structure) -> Real:
    """Return the reading of channels for one unit of acceleration of each coordinate, shape (channels, n)."""
    rows = [vehicle.outputs.names.index(name) for name in channels]
    return vehicle.outputs.motion[rows]


@dataclass(frozen=True, slots=True)
class Widths:
    """Standard deviations of numbers before any drive: of ln(value / given value) where no unit is stated."""

    #: A corner over its axle (manufacturing tolerance).
    side: float = 0.05
    #: Unsprung mass.
    wheel: float = 0.07
    #: Roll inertia of a rigid axle, and the distance of its springs.
    axle: float = 0.15
    #: Inertias of the body.
    inertia: float = 0.1
    #: Stiffness of anti-roll bars.
    bar: float = 0.3
    #: Cornering stiffness of tyres.
    cornering: float = 0.3
    #: Height of the roll centre of an axle [m], and relaxation length of its tyres.
    roll_centre: float = 0.04
    relaxation: float = 0.3
    #: Stiffness of the rubber that carries a damper.
    bushing: float = 0.6
    #: Gains of sensors.
    gain: float = 0.03
    #: Height of the centre of gravity.
    height: float = 0.1
    #: Centre of gravity [m].
    centre: float = 0.05
    #: Places of sensors [m].
    place: float = 0.1
    #: Delays of sensors [s].
    delay: float = 2e-3
    #: Directions of gyroscopes (direction cosine: 2 degrees).
    tilt: float = 0.035
    #: Masses on mounts: mass, frequency, damping ratio, place [m].
    mount_mass: float = 0.3
    mount_frequency: float = 0.15
    mount_damping: float = 0.5
    mount_place: float = 0.2
    #: Flexible modes: frequency, damping ratio, modal mass.
    mode_frequency: float = 0.1
    mode_damping: float = 0.4
    mode_mass: float = 0.25
    #: Factor for a mass or mode that the file lacks.
    new: float = 2.0
    #: Smallest width in a later calibration over the first one.
    sure: float = 0.1


WIDTHS = Widths()
#: Fields of an axle that make the components of its corners.
COMPONENT_FIELDS = {
    "spring_stiffness": ("spring", "N/m"),
    "damping": ("damper", "N s/m"),
    "tyre_stiffness": ("tyre", "N/m"),
}
#: Fields of tables that can be learnt where the file states them, with their widths and units.
_WHEELS = {
    "unsprung_mass": (WIDTHS.wheel, "kg"),
    "anti_roll_stiffness": (WIDTHS.bar, "N/m"),
    "wheelset_mass": (WIDTHS.wheel, "kg"),
    "wheelset_roll_inertia": (WIDTHS.axle, "kg m2"),
}
_TYRES = {"cornering_stiffness": (WIDTHS.cornering, "N/rad"), "roll_centre_height": (WIDTHS.roll_centre, "m")}
_MOUNTED = {
    "mass": (WIDTHS.mount_mass, "kg"),
    "frequency": (WIDTHS.mount_frequency, "Hz"),
    "damping_ratio": (WIDTHS.mount_damping, ""),
    "x": (WIDTHS.mount_place, "m"),
    "y": (WIDTHS.mount_place, "m"),
}
_RUBBER = {"damper_bushing_stiffness": (WIDTHS.bushing, "N/m")}
_FLEXIBLE = {
    "frequency": (WIDTHS.mode_frequency, "Hz"),
    "damping_ratio": (WIDTHS.mode_damping, ""),
    "mass": (WIDTHS.mode_mass, "kg"),
}


def _axles(draft: Draft) -> Iterator[tuple[str, tuple[str, str]]]:
    """Yield the name of each axle, and of its left and right corner."""
    corners = corner_names(len(draft.vehicle.axle))
    for left, right in zip(corners[::2], corners[1::2], strict=True):
        yield left.removesuffix("_left"), (left, right)


def _entries(
    draft: Draft,
    place: tuple[str, int],
    name: str,
    group: str,
    fields: Mapping[str, tuple[float, str]],
    *,
    is_new: bool = False,
) -> Iterator[VehicleNumber]:
    """Yield fields of an entry of a table as numbers: places [m] in any case, others where they are not 0."""
    for own, (std, unit) in fields.items():
        is_log, where = unit != "m", (*place, own)
        if not is_log or _part(_part(_part(draft.vehicle, place[0]), place[1]), own):
            width = (WIDTHS.new if is_new else 1.0) * std
            yield VehicleNumber(f"{name}.{own}", group, width, is_log, where, unit, is_new=is_new)


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
    fields = {name: (std, unit) for name, (_, unit) in COMPONENT_FIELDS.items()}
    for index, (axle, corners) in enumerate(_axles(draft)):
        for number in _entries(draft, ("axle", index), axle, "components", fields):
            both = tuple(Component(corner, COMPONENT_FIELDS[number.field][0]) for corner in corners)
            sides = (VehicleNumber(str(one), "sides", WIDTHS.side, True, one, components=(one,)) for one in both)
            numbers += [replace(number, components=both), *sides]
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
    inertias = (
        VehicleNumber(f"body.{name}", "body", WIDTHS.inertia, True, ("body", name), "kg m2")
        for name in ("pitch_inertia", "roll_inertia")
    )
    wheels = (
        number
        for index, (axle, _) in enumerate(_axles(draft))
        if draft.vehicle.kind == "road" or draft.vehicle.axle[index].wheelset_mass is None
        for number in _wheel_numbers(draft, index, axle)
    )
    centre = [VehicleNumber("body.centre_x", "body", WIDTHS.centre, False, (), "m")]
    if draft.vehicle.axle[0].cornering_stiffness is not None:
        centre.append(VehicleNumber("body.height", "body", WIDTHS.height, True, ("body", "height"), "m"))
    return (*inertias, *centre, *wheels, *sensor_numbers(draft, channels))


def _wheel_numbers(draft: Draft, index: int, axle: str) -> Iterator[VehicleNumber]:
    """Yield what is below the springs of an axle, and the distance of the springs of a rigid one."""
    place: tuple[str, int] = ("axle", index)
    holds = draft.vehicle.axle[index].cornering_stiffness is not None
    yield from _entries(draft, place, axle, "wheels", _WHEELS | _TYRES if holds else _WHEELS)
    if holds:
        where = (*place, "relaxation_length")
        yield VehicleNumber(f"{axle}.relaxation_length", "wheels", WIDTHS.relaxation, True, where, "m")
    if draft.vehicle.axle[index].wheelset_mass is not None:
        yield VehicleNumber(f"{axle}.half_track", "wheels", WIDTHS.axle, True, (*place, "half_track"), "m")


def added_numbers(draft: Draft, *, given: Vehicle) -> Iterator[VehicleNumber]:
    """Yield numbers of masses on mounts, rubber and flexible modes; those that `given` lacks are less known."""
    for index, (axle, _) in enumerate(_axles(draft)):
        is_new = given.axle[index].damper_bushing_stiffness is None
        yield from _entries(draft, ("axle", index), axle, "wheels", _RUBBER, is_new=is_new)
    for index in range(len(draft.vehicle.mounted_mass)):
        place, name, is_new = ("mounted_mass", index), f"mounted_mass_{index + 1}", index >= len(given.mounted_mass)
        yield from _entries(draft, place, name, "mounted_masses", _MOUNTED, is_new=is_new)
    known = {mode.shape for mode in given.flexible_mode}
    for index, mode in enumerate(draft.vehicle.flexible_mode):
        place, is_new = ("flexible_mode", index), mode.shape not in known
        yield from _entries(draft, place, mode.shape, "modes", _FLEXIBLE, is_new=is_new)


def sensor_numbers(draft: Draft, channels: Sequence[str]) -> tuple[VehicleNumber, ...]:
    """Return places, scales, directions and delays of the sensors of motion."""
    numbers: list[VehicleNumber] = []
    for index, sensor in enumerate(draft.vehicle.sensor):
        if sensor.channel not in channels or not sensor.is_motion:
            continue
        axes = (0, 1) if sensor.on == "body" and sensor.between is None else ()
        if sensor.quantity in {"angular_velocity", "angle"}:
            across = [axis for axis in axes if abs((sensor.direction or _VECTORS["direction"])[axis]) < 0.5]
            vectors = [(f"direction_{'xy'[axis]}", WIDTHS.tilt, ("direction", axis), "") for axis in across]
        else:
            vectors = [("xy"[axis], WIDTHS.place, ("position", axis), "m") for axis in axes]
        own = [*vectors, ("scale", WIDTHS.gain, ("scale",), ""), ("delay", WIDTHS.delay, ("delay",), "s")]
        numbers += [
            VehicleNumber(
                name=f"{sensor.channel}.{name}",
                group=SENSORS,
                std=std,
                is_log=name == "scale",
                place=("sensor", index, *field_of),
                unit=unit,
                channel=sensor.channel,
            )
            for name, std, field_of, unit in own
        ]
    return tuple(numbers)


def with_widths(numbers: Iterable[VehicleNumber], draft: Draft) -> tuple[VehicleNumber, ...]:
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


def is_in_one_range(vehicle: Vehicle) -> bool:
    """Return whether drives count in one range of speed, as side forces on rigid axles damp less at higher ones."""
    return any(axle.cornering_stiffness and axle.wheelset_mass for axle in vehicle.axle)


def _relative(number: VehicleNumber, draft: Draft, std: float) -> float:
    """Return the standard deviation of a number's parameter for that of its value."""
    return std / abs(draft.value_at(number.place)) if number.is_log else std
