"""Tables of the vehicles of a fleet, and sentences about the baseline of a type."""

from collections.abc import Mapping
from typing import Any

from sprung._display import counted
from sprung.diagnosis import TypeBaseline
from sprung.tables.table import Table, in_words


def fleet_tables(document: Mapping[str, Any]) -> list[Table]:
    """Return the table of each type in a `sprung.fleet/1`, the most deviating vehicles first."""
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
    """Return a sentence on the number of vehicles and windows from which the baseline of a type was learnt."""
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
