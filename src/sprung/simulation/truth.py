"""Truth of a simulated recording as JSON: modes, components, speed and faults."""

from collections.abc import Iterable, Sequence
from typing import Any

import numpy as np

from sprung.excitation import SpeedProfile
from sprung.vehicles import ExactModes, Fault, Structure, with_faults

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
    """
    changed = with_faults(vehicle, faults, time=duration)
    modes = changed.modes()
    document: dict[str, Any] = {
        "schema": "sprung.truth/1",
        "channels": list(modes.channels),
        "modes": list(_modes(modes)),
        "components": _components(changed),
        "speed": None if speed is None else _speed(speed, duration),
        "faults": {str(fault.component): fault.change for fault in faults},
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
