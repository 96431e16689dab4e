"""The document of a fleet, `sprung.fleet/1`: vehicles of a type, ranked by how much each deviates from the others."""

import math
from collections.abc import Iterable, Sequence
from typing import Literal

from pydantic import Field

from sprung.diagnosis import RankedVehicle
from sprung.results.documents.document import Document, Pair


class RankedEntry(Document):
    """A vehicle against the others of its type; `part` is the most likely place of its deviation."""

    vehicle: str
    windows: int
    p_value: float
    deviates: bool
    part: str
    change: float | None
    interval: Pair | None


class RankingEntry(Document):
    """The vehicles of a type, the most deviating first."""

    name: str
    vehicles: tuple[RankedEntry, ...]


class FleetDocument(Document):
    """Rankings of the vehicles of each type."""

    schema_name: Literal["sprung.fleet/1"] = Field(alias="schema")
    rate: float
    types: tuple[RankingEntry, ...]
    notes: tuple[str, ...]


def fleet_document(
    rankings: Iterable[tuple[str, Sequence[RankedVehicle]]], *, rate: float, notes: Iterable[str] = ()
) -> FleetDocument:
    """Return rankings as `sprung.fleet/1`.

    Parameters
    ----------
    rankings
        Name of each type, and the result of `sprung.diagnosis.rank_fleet`.
    rate
        Expected share of sound vehicles among those reported to deviate.
    notes
        Sentences about types and vehicles that are not ranked.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((8, 3, 12))
    >>> values[2, :, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> fleet = {
    ...     f"car-{n}": [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(of_car)]
    ...     for n, of_car in enumerate(values)
    ... }
    >>> document = fleet_document([("zafira", sprung.rank_fleet(fleet))], rate=0.05)
    >>> [(entry.vehicle, entry.part) for entry in document.types[0].vehicles if entry.deviates]
    [('car-2', 'front_left.spring')]
    """
    types = [{"name": name, "vehicles": list(map(_entry, ranked))} for name, ranked in rankings]
    return FleetDocument.model_validate(
        {"schema": "sprung.fleet/1", "rate": rate, "types": types, "notes": list(notes)}
    )


def _entry(ranked: RankedVehicle) -> dict[str, object]:
    """Return a vehicle with its most likely deviation."""
    best = ranked.detection.candidates[0]
    return {
        "vehicle": ranked.vehicle,
        "windows": ranked.n_windows,
        "p_value": math.exp(-ranked.detection.e_value),
        "deviates": ranked.is_discovery,
        "part": best.hypothesis.name,
        "change": best.change,
        "interval": best.interval,
    }
