"""Numbers of a vehicle file that can be learnt from drives, and how far they may be from what the file states."""

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import partial

from sprung.calibration.draft import Draft, VehicleNumber
from sprung.vehicles import Component, Vehicle, corner_names

#: Standard deviations of ln(value / given value): a corner over its axle (manufacturing tolerances), wheels, inertias,
#: anti-roll bars, gains of sensors; mounted masses: mass, frequency, damping.
_SIDE, _WHEEL, _INERTIA, _BAR, _GAIN = 0.05, 0.07, 0.1, 0.3, 0.03
_MOUNTED = {"mass": 0.3, "frequency": 0.15, "damping_ratio": 0.5}
#: Factor of these and of the place for a mass that the file lacks.
_NEW = 2.0
#: Flexible modes of the body, likewise.
_FLEXIBLE = {"frequency": 0.1, "damping_ratio": 0.4, "mass": 0.25}
#: Smallest standard deviation of a number in a later calibration over the usual one.
_SURE = 0.1
#: Standard deviations of the centre of gravity, of the places of sensors and of mounted masses [m], of delays [s], and
#: of the directions of gyroscopes (direction cosine: 2 degrees).
_CENTRE, _PLACE, _MASS_PLACE, _DELAY, _TILT = 0.05, 0.1, 0.2, 2e-3, 0.035
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
    return tuple(number for index in range(len(draft.vehicle.axle)) for number in _axle_components(draft, index, std))


def _axle_components(draft: Draft, index: int, std: float) -> Iterator[VehicleNumber]:
    """Yield the components of one axle."""
    left, right = corner_names(len(draft.vehicle.axle))[2 * index : 2 * index + 2]
    for name, (kind, unit) in COMPONENT_FIELDS.items():
        if not getattr(draft.vehicle.axle[index], name):
            continue
        both = Component(left, kind), Component(right, kind)
        of_axle = _entry(("axle", index, name), f"{left.removesuffix('_left')}.{name}", std=std, unit=unit)
        yield replace(of_axle, components=both)
        for component in both:
            get, put = partial(_factor, component), partial(_with_factor, component)
            yield VehicleNumber(str(component), "sides", _SIDE, True, get, put, components=(component,))


def file_numbers(draft: Draft, channels: Sequence[str]) -> tuple[VehicleNumber, ...]:
    """Return the other numbers of a file that can be learnt from drives: body, wheels, anti-roll bars, sensors.

    Parameters
    ----------
    draft
        Vehicle as given.
    channels
        Channels that were recorded.
    """
    return (*_body(draft), *_wheels(draft), *sensor_numbers(draft, channels))


def mounted_numbers(draft: Draft, *, given: Vehicle) -> tuple[VehicleNumber, ...]:
    """Return mass, frequency, damping and place of the mounted masses; those that `given` lacks are less known."""
    numbers = []
    for index, mass in enumerate(draft.vehicle.mounted_mass):
        where, factor = f"mounted_mass_{index + 1}", 1.0 if index < len(given.mounted_mass) else _NEW
        for name, unit in (("mass", "kg"), ("frequency", "Hz"), ("damping_ratio", "")):
            if getattr(mass, name) > 0:
                numbers.append(
                    _entry(("mounted_mass", index, name), f"{where}.{name}", std=factor * _MOUNTED[name], unit=unit)
                )
        for name in ("x", "y"):
            place = ("mounted_mass", index, name)
            numbers.append(_entry(place, f"{where}.{name}", std=factor * _MASS_PLACE, unit="m", is_log=False))
    return tuple(numbers)


def mode_numbers(draft: Draft, *, given: Vehicle) -> tuple[VehicleNumber, ...]:
    """Return frequency, damping and modal mass of the flexible modes; those that `given` lacks are less known."""
    known = {mode.shape for mode in given.flexible_mode}
    numbers = []
    for index, mode in enumerate(draft.vehicle.flexible_mode):
        factor = 1.0 if mode.shape in known else _NEW
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
        replace(number, std=max(_relative(number, draft, stated[number.name]), _SURE * number.std))
        if number.name in stated
        else number
        for number in numbers
    )


def _relative(number: VehicleNumber, draft: Draft, std: float) -> float:
    """Return the standard deviation of a number's parameter for that of its value."""
    return std / abs(number.get(draft)) if number.is_log else std


def sensor_numbers(draft: Draft, channels: Sequence[str]) -> tuple[VehicleNumber, ...]:
    """Return places, scales, directions and delays of the sensors of motion."""
    numbers: list[VehicleNumber] = []
    for sensor in draft.vehicle.sensor:
        if sensor.channel not in channels or not sensor.is_motion:
            continue
        name = sensor.channel
        is_gyroscope = sensor.quantity in {"angular_velocity", "angle"}
        is_on_body = sensor.on == "body" and sensor.between is None
        if is_on_body and not is_gyroscope:
            numbers += [_place(name, axis) for axis in (0, 1)]
        if is_on_body and is_gyroscope:
            numbers += [_direction(name, axis) for axis in (0, 1) if abs((sensor.direction or (0, 0, 1))[axis]) < 0.5]
        numbers.append(
            VehicleNumber(f"{name}.scale", "sensors", _GAIN, True, partial(_scale, name), partial(_with_scale, name))
        )
        numbers.append(
            VehicleNumber(
                f"{name}.delay", "sensors", _DELAY, False, partial(_delay, name), partial(_with_delay, name), "s"
            )
        )
    return tuple(replace(number, channel=number.name.rpartition(".")[0]) for number in numbers)


def _body(draft: Draft) -> Iterator[VehicleNumber]:
    """Yield inertias and centre of gravity of the body."""
    for name in ("pitch_inertia", "roll_inertia"):
        yield VehicleNumber(
            f"body.{name}", "body", _INERTIA, True, partial(_of_body, name), partial(_with_body, name), "kg m2"
        )
    yield VehicleNumber("body.centre_x", "body", _CENTRE, False, _nothing, _with_centre, "m")


def _wheels(draft: Draft) -> Iterator[VehicleNumber]:
    """Yield unsprung masses and anti-roll bars."""
    names = corner_names(len(draft.vehicle.axle))[::2]
    for index, (axle, left) in enumerate(zip(draft.vehicle.axle, names, strict=True)):
        where = left.removesuffix("_left")
        for name, std, unit in (("unsprung_mass", _WHEEL, "kg"), ("anti_roll_stiffness", _BAR, "N/m")):
            if getattr(axle, name) and axle.wheelset_mass is None:
                yield _entry(("axle", index, name), f"{where}.{name}", std=std, unit=unit)


def _entry(entry: tuple[str, int, str], name: str, *, std: float, unit: str, is_log: bool = True) -> VehicleNumber:
    """Return a field of an entry of a table as a number: table, index, field."""
    group = "mounted_masses" if entry[0] == "mounted_mass" else "wheels"
    group = "modes" if entry[0] == "flexible_mode" else group
    group = "components" if entry[2] in COMPONENT_FIELDS else group
    return VehicleNumber(name, group, std, is_log, partial(_of_entry, *entry), partial(_with_entry, *entry), unit)


def _place(channel: str, axis: int) -> VehicleNumber:
    """Return a coordinate of a sensor's position."""
    name = f"{channel}.{'xyz'[axis]}"
    return VehicleNumber(
        name, "sensors", _PLACE, False, partial(_of_vector, channel, "position", axis),
        partial(_with_vector, channel, "position", axis), "m",
    )  # fmt: skip


def _direction(channel: str, axis: int) -> VehicleNumber:
    """Return a direction cosine of a sensor's axis."""
    name = f"{channel}.direction_{'xyz'[axis]}"
    return VehicleNumber(
        name, "sensors", _TILT, False, partial(_of_vector, channel, "direction", axis),
        partial(_with_vector, channel, "direction", axis),
    )  # fmt: skip


def _of_entry(table: str, index: int, field: str, draft: Draft) -> float:
    return float(getattr(getattr(draft.vehicle, table)[index], field))


def _with_entry(table: str, index: int, field: str, draft: Draft, value: float) -> Draft:
    return draft.with_entry(table, index, **{field: value})


def _of_body(field: str, draft: Draft) -> float:
    return float(getattr(draft.vehicle.body, field))


def _with_body(field: str, draft: Draft, value: float) -> Draft:
    return draft.with_body(**{field: value})


def _nothing(draft: Draft) -> float:
    return 0.0


def _with_centre(draft: Draft, distance: float) -> Draft:
    return draft.ahead(distance)


def _factor(component: Component, draft: Draft) -> float:
    return draft.factors.get(component, 1.0)


def _with_factor(component: Component, draft: Draft, value: float) -> Draft:
    return Draft(draft.vehicle, {**draft.factors, component: value})


def _scale(channel: str, draft: Draft) -> float:
    return draft.sensor(channel).scale


def _with_scale(channel: str, draft: Draft, value: float) -> Draft:
    return draft.with_sensor(channel, scale=value)


def _delay(channel: str, draft: Draft) -> float:
    return draft.sensor(channel).delay


def _with_delay(channel: str, draft: Draft, value: float) -> Draft:
    return draft.with_sensor(channel, delay=value)


def _of_vector(channel: str, field: str, axis: int, draft: Draft) -> float:
    vector = getattr(draft.sensor(channel), field) or (0.0, 0.0, 1.0 if field == "direction" else 0.0)
    return float(vector[axis])


def _with_vector(channel: str, field: str, axis: int, draft: Draft, value: float) -> Draft:
    vector = list(getattr(draft.sensor(channel), field) or (0.0, 0.0, 1.0 if field == "direction" else 0.0))
    vector[axis] = value
    return draft.with_sensor(channel, **{field: tuple(vector)})
