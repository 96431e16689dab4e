"""Tables of the vehicles of a fleet, and sentences about the baseline of a type."""

from collections.abc import Mapping
from typing import Any

from sprung._display import counted
from sprung.diagnosis import TypeBaseline
from sprung.results.tables.table import Table, in_words


def fleet_tables(document: Mapping[str, Any]) -> list[Table]:
    """Return the table of each type in a `sprung.fleet/1`, the most deviating vehicles first.

    Examples
    --------
    >>> sound = {"vehicle": "car-1", "windows": 3, "p_value": 0.4, "deviates": False}
    >>> soft = {"vehicle": "car-2", "windows": 3, "p_value": 1e-6, "deviates": True, "part": "front_left.spring"}
    >>> soft |= {"change": -0.3, "interval": (-0.33, -0.27)}
    >>> (table,) = fleet_tables({"rate": 0.05, "types": [{"name": "zafira", "vehicles": [soft, sound]}]})
    >>> table.title
    'vehicles of the type zafira'
    >>> for row in table.rows:
    ...     print(" | ".join(row))
    car-2 | 3 | 1e-06 | -30 (-33 to -27) | deviates: front left spring
    car-1 | 3 | 0.4 |  | no deviation detected
    """
    caption = (
        f"p: probability that a sound vehicle deviates as much from the others; at most {100 * document['rate']:.3g} % "
        "of the vehicles reported to deviate are expected to be sound"
    )
    columns = ("vehicle", "windows", "p", "change [%]", "verdict")
    return [
        Table(
            f"vehicles of the type {ranking['name']}" if ranking["name"] else "",
            columns,
            tuple(map(_row, ranking["vehicles"])),
            caption=caption,
        )
        for ranking in document["types"]
    ]


def type_in_words(type_baseline: TypeBaseline) -> str:
    """Return a sentence on the numbers of vehicles and windows that the baseline of a type was learnt from.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((8, 3, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> fleet = {
    ...     f"car-{n}": [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(of_car)]
    ...     for n, of_car in enumerate(values)
    ... }
    >>> type_in_words(sprung.learn_type(fleet, name="zafira"))
    'baseline of the type zafira: learnt from 24 windows of 8 vehicles'
    """
    vehicles = counted(type_baseline.n_vehicles, "vehicle")
    return (
        f"baseline of the type {type_baseline.name}: learnt from {counted(type_baseline.n_windows, 'window')} of "
        f"{vehicles}"
    )


def _row(entry: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the cells of a vehicle; the change is empty if no deviation was detected."""
    if not entry["deviates"]:
        return (entry["vehicle"], str(entry["windows"]), f"{entry['p_value']:.2g}", "", "no deviation detected")
    size = ""
    if entry["change"] is not None:
        low, high = entry["interval"]
        size = f"{100 * entry['change']:+.0f} ({100 * low:+.0f} to {100 * high:+.0f})"
    what = "several parts, or one that the model lacks" if entry["change"] is None else in_words(entry["part"])
    return (entry["vehicle"], str(entry["windows"]), f"{entry['p_value']:.2g}", size, f"deviates: {what}")
