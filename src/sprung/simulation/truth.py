"""Truth of a simulated recording as JSON: modes, components, speed and faults."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import fields, is_dataclass
from functools import partial
from typing import Any

import numpy as np
from pydantic import BaseModel

from sprung.excitation import SpeedProfile
from sprung.simulation.conditions import Payload, SuspensionConditions
from sprung.simulation.deviations import Deviations
from sprung.simulation.sensors import Imperfection
from sprung.vehicles import Component, ExactModes, Fault, Structure, Vehicle, with_faults

#: Number of instants at which changing modes are given.
_INSTANTS = 11


def truth(
    vehicle: Structure,
    *,
    seed: int | None = None,
    speed: SpeedProfile | None = None,
    duration: float = 0.0,
    faults: Sequence[Fault] = (),
) -> dict[str, Any]:
    """Return the truth of a simulated recording as the JSON object `sprung.truth/1`.

    Parameters
    ----------
    vehicle
        Structure that was simulated, without its faults.
    seed
        Seed of the simulation.
    speed
        Speed of the drive; None without one.
    duration
        Duration of the recording [s].
    faults
        Changes of its components.

    Returns
    -------
    dict
        Exact modes at the sensors and components by corner or mass with their SI values, both at the end of the
        recording; speed (mean, lowest, highest [m/s]) or null; faults by component; and if a fault begins later or
        grows, `fault_courses` (onset and growth [s]) and `modes_over_time` (frequencies and damping at equal
        intervals).

    Examples
    --------
    >>> from sprung.vehicles import parse_fault, read_vehicle, structure
    >>> zafira = structure(read_vehicle("zafira"))
    >>> document = truth(zafira, seed=1, faults=[parse_fault("front_left.spring=-0.2")])
    >>> document["faults"]
    {'front_left.spring': -0.2}
    >>> [mode["label"] for mode in document["modes"]][:3]
    ['bounce', 'pitch', 'roll']
    """
    changed = with_faults(vehicle, faults, time=duration)
    modes = changed.modes()
    document: dict[str, Any] = {
        "schema": "sprung.truth/1",
        "channels": list(modes.channels),
        "modes": list(_modes(modes)),
        "components": _components(changed),
        "speed": None if speed is None else _speed(speed, duration),
        "faults": _changes(faults),
        "seed": seed,
    }
    if not all(fault.is_constant for fault in faults):
        document["fault_courses"] = {
            str(fault.component): {"onset": fault.onset, "growth": fault.growth} for fault in faults
        }
        document["modes_over_time"] = [
            {
                "time": float(time),
                "modes": [
                    {key: mode[key] for key in ("natural_frequency", "damping_ratio", "label")}
                    for mode in _modes(with_faults(vehicle, faults, time=time).modes())
                ],
            }
            for time in np.linspace(0, duration, _INSTANTS)
        ]
    return document


def true_conditions(
    vehicle: Vehicle,
    healthy: Structure,
    *,
    payloads: Sequence[Payload],
    suspension: SuspensionConditions,
    deviations: Deviations,
    imperfections: Sequence[Imperfection],
) -> dict[str, Any]:
    """Return the true conditions of a drive as plain values by name.

    Parameters
    ----------
    vehicle
        True vehicle, with the places and axes of its sensors.
    healthy
        Its structure with the payload.
    payloads, suspension, deviations, imperfections
        Conditions of every kind of drive.

    Returns
    -------
    dict
        Payload, body (mass, centre of gravity in the coordinates of the file, inertias about their origin), suspension,
        deviations with the factors of each part, sensors, imperfections.
    """
    bounce, pitch, roll = (healthy.coordinates.index(name) for name in ("bounce", "pitch", "roll"))
    mass = healthy.mass
    return {
        "payload": plain(payloads),
        "body": {
            "mass": float(mass[bounce, bounce]),
            "x": float(-mass[bounce, pitch] / mass[bounce, bounce]),
            "y": float(mass[bounce, roll] / mass[bounce, bounce]),
            "pitch_inertia": float(mass[pitch, pitch]),
            "roll_inertia": float(mass[roll, roll]),
            "product_of_inertia": float(mass[pitch, roll]),
        },
        "suspension": {
            "temperature": suspension.temperature,
            "tyre_temperature": suspension.tyre_temperature,
            "nonlinear": bool(suspension.force_laws),
        },
        "deviations": plain(deviations) | {"factors": plain(deviations.factors(healthy))},
        "sensors": {
            sensor.channel: {"position": plain(sensor.position), "direction": plain(sensor.direction)}
            for sensor in vehicle.sensor
        },
        "imperfections": plain(tuple(imperfections)),
    }


def plain(value: Any) -> Any:
    """Return a value of the settings as JSON holds it.

    Parameters
    ----------
    value
        Dataclass, vehicle section, mapping, sequence, or function with its options bound; anything else stays.
    """
    if isinstance(value, partial):
        return {"function": value.func.__name__.removeprefix("_"), **plain(value.keywords)}
    if isinstance(value, Component):
        return str(value)
    if isinstance(value, tuple | list):
        return [plain(entry) for entry in value]
    if isinstance(value, BaseModel):
        value = value.model_dump()
    elif is_dataclass(value):
        value = {entry.name: getattr(value, entry.name) for entry in fields(value)}
    return {str(name): plain(entry) for name, entry in value.items()} if isinstance(value, Mapping) else value


def _changes(faults: Iterable[Fault]) -> dict[str, float]:
    """Return the relative change of each component; changes of the same one multiply."""
    changes: dict[str, float] = {}
    for fault in faults:
        before = changes.get(str(fault.component), 0.0)
        changes[str(fault.component)] = before + fault.change + before * fault.change
    return changes


def _components(vehicle: Structure) -> dict[str, dict[str, dict[str, float]]]:
    """Return the values of all components by corner and kind."""
    components: dict[str, dict[str, dict[str, float]]] = {}
    for component, value in vehicle.components().items():
        components.setdefault(component.corner, {})[component.kind] = {"value": value}
    return components


def _modes(modes: ExactModes) -> Iterable[dict[str, Any]]:
    """Yield each mode as a JSON object."""
    columns = zip(modes.natural_frequency, modes.damping_ratio, modes.mode_shapes, modes.labels, strict=True)
    for frequency, ratio, shape, label in columns:
        yield {
            "natural_frequency": float(frequency),
            "damping_ratio": float(ratio),
            "mode_shape": {"real": shape.real.tolist(), "imag": shape.imag.tolist()},
            "label": label,
        }


def _speed(speed: SpeedProfile, duration: float) -> dict[str, float]:
    """Return mean and range of a speed over a recording."""
    values = speed.speed(np.linspace(0, duration, 10_001))
    return {
        "mean": float(speed.distance(duration) / duration),
        "lowest": float(values.min()),
        "highest": float(values.max()),
    }
