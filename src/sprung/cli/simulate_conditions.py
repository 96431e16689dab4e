"""Texts of the options of `sprung simulate` as values of `sprung.simulation`."""

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.excitation import Potholes
    from sprung.simulation import Imperfection, Payload, WheelOrders
    from sprung.vehicles import Fault, MountedMass, Vehicle

#: Further sensors at the centre of gravity: quantity, unit and axis.
ALSO = {
    "acc_x": ("acceleration", "m/s^2", (1.0, 0.0, 0.0)),
    "acc_y": ("acceleration", "m/s^2", (0.0, 1.0, 0.0)),
    "yaw_rate": ("angular_velocity", "rad/s", (0.0, 0.0, 1.0)),
    "temperature": ("temperature", "degC", None),
}


def faults(texts: Sequence[str] | None) -> "tuple[Fault, ...]":
    """Return the faults of `--fault`."""
    from sprung.vehicles import parse_fault

    return tuple(parse_fault(text) for text in texts or ())


def payloads(texts: Sequence[str] | None) -> "tuple[Payload, ...]":
    """Return the masses of `--payload`."""
    from sprung.simulation import Payload

    return tuple(Payload(*_numbers("--payload", text, "KG or KG,X,Y", counts=(1, 3))) for text in texts or ())


def mounted_masses(texts: Sequence[str] | None) -> "tuple[MountedMass, ...]":
    """Return the masses of `--mounted-mass`."""
    from sprung.toml import checked
    from sprung.vehicles import MountedMass

    names = ("mass", "x", "y", "frequency", "damping_ratio")
    form = "KG,X,Y,HZ,DAMPING"
    numbers = [_numbers("--mounted-mass", text, form, counts=(5,)) for text in texts or ()]
    return tuple(checked(MountedMass, dict(zip(names, values, strict=True))) for values in numbers)


def changes(name: str, texts: Sequence[str] | None) -> dict[str, float]:
    """Return the numbers of an option of the form NAME=NUMBER by name."""
    return {key: values[0] for key, values in _by_name(name, texts, "NAME=CHANGE", counts=(1,)).items()}


def offsets(texts: Sequence[str] | None) -> dict[str, tuple[float, float, float]]:
    """Return the offsets of `--moved` by channel."""
    found = _by_name("--moved", texts, "CHANNEL=X,Y,Z", counts=(3,))
    return {channel: (x, y, z) for channel, (x, y, z) in found.items()}


def potholes(
    per_kilometre: float | None, side: Literal["left", "right"] | None, *, nonlinear: bool
) -> "Potholes | None":
    """Return the potholes of a road."""
    from dataclasses import replace

    from sprung.simulation import FEW_POTHOLES

    if per_kilometre is None and not nonlinear:
        if side is not None:
            raise ParameterError(f"--pothole-side {side} needs --potholes: state how many there are per kilometre")
        return None
    rate = FEW_POTHOLES.per_kilometre if per_kilometre is None else per_kilometre
    return replace(FEW_POTHOLES, per_kilometre=rate, side=side)


def wheel_orders(unbalance: float, run_out: Sequence[float] | None, radius: float) -> "WheelOrders | None":
    """Return the unbalance [g m] and run-out [mm] of wheels of a radius [m]."""
    from sprung.simulation import WheelOrders

    if not (unbalance or run_out):
        return None
    return WheelOrders(1e-3 * unbalance, tuple(1e-3 * amplitude for amplitude in run_out or ()), radius)


def imperfections(
    speed_channel: str,
    *,
    accelerometers: tuple[float, float, int | None],
    speed: tuple[float, float | None, float],
) -> "tuple[Imperfection, ...]":
    """Return the imperfections of accelerometers (noise, range, bits) and of the speed (delay, rate, scale)."""
    from functools import partial

    from sprung.excitation import GRAVITY
    from sprung.simulation import delayed, held, mems_accelerometers, scaled

    noise_density, full_scale, bits = accelerometers
    delay, rate, scale = speed
    parts: list[Imperfection] = []
    noise, resolution = mems_accelerometers(
        noise_density=1e-6 * GRAVITY * noise_density, full_scale=GRAVITY * full_scale, bits=bits or 32
    )
    parts += [noise] if noise_density else []
    parts += [resolution] if bits else []
    if scale != 1:
        parts.append(partial(scaled, channel=speed_channel, factor=scale))
    if rate is not None:
        parts.append(partial(held, channel=speed_channel, rate=rate, delay=delay))
    elif delay:
        parts.append(partial(delayed, channel=speed_channel, delay=delay))
    return tuple(parts)


def with_sensors(vehicle: "Vehicle", names: Sequence[str] | None) -> "Vehicle":
    """Return the vehicle with further sensors at its centre of gravity."""
    from sprung.vehicles import Sensor

    sensors = []
    for name in names or ():
        if name not in ALSO:
            raise ParameterError(f"--also {name} is not one of {', '.join(ALSO)}: correct it")
        if name in [sensor.channel for sensor in vehicle.sensor]:
            raise ParameterError(f"--also {name}: the vehicle file has this sensor already, leave it out")
        quantity, unit, axis = ALSO[name]
        place = None if axis is None else (0.0, 0.0, 0.0)
        sensors.append(Sensor(channel=name, quantity=quantity, unit=unit, position=place, direction=axis))
    return vehicle.model_copy(update={"sensor": (*vehicle.sensor, *sensors)}) if sensors else vehicle


def _by_name(option: str, texts: Sequence[str] | None, form: str, *, counts: Sequence[int]) -> dict[str, list[float]]:
    """Return the numbers of texts NAME=NUMBERS by name."""
    values = {}
    for text in texts or ():
        name, sign, numbers = text.partition("=")
        if not sign:
            raise ParameterError(f"{option} {text} is not of the form {form}: correct it")
        values[name.strip()] = _numbers(option, numbers, form, counts=counts)
    return values


def _numbers(option: str, text: str, form: str, *, counts: Sequence[int]) -> list[float]:
    """Return the numbers of a text, separated by commas."""
    try:
        numbers = [float(part) for part in text.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) not in counts or not all(map(math.isfinite, numbers)):
        raise ParameterError(f"{option} {text} is not of the form {form}: correct it")
    return numbers
