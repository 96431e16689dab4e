"""Documents of fleets: ranking, `sprung.fleet/1`, runs over an archive, and the lake they read."""

import math
from collections.abc import Iterable, Sequence
from typing import Literal

from pydantic import Field

from sprung.diagnosis import RankedVehicle, to_inspect
from sprung.results.documents.document import Document, Pair


class RankedEntry(Document):
    """A vehicle against its baseline, or the others of its type; `part` is the most likely place of its deviation."""

    vehicle: str
    windows: int
    p_value: float
    deviates: bool
    part: str
    change: float | None
    interval: Pair | None


class InspectionEntry(Document):
    """The vehicle whose inspection would teach most, and its most likely change."""

    vehicle: str
    information: float
    probability: float
    part: str
    change: float | None


class RankingEntry(Document):
    """The vehicles of a type, the most deviating first."""

    name: str
    vehicles: tuple[RankedEntry, ...]
    inspect_next: InspectionEntry | None = None


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
        Expected share of healthy vehicles among those reported to deviate.
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
    types = [
        {"name": name, "vehicles": list(map(_entry, ranked)), "inspect_next": _next(ranked)}
        for name, ranked in rankings
    ]
    return FleetDocument.of(rate=rate, types=types, notes=list(notes))


def _next(ranked: Sequence[RankedVehicle]) -> dict[str, object] | None:
    """Return the vehicle to inspect next, and why."""
    best = to_inspect(ranked)
    if best is None:
        return None
    entry = _entry(best)
    of_type = {"information": best.information, "probability": best.probability}
    return of_type | {name: entry[name] for name in ("vehicle", "part", "change")}


def _entry(ranked: RankedVehicle) -> dict[str, object]:
    """Return a vehicle with its most likely deviation."""
    best = ranked.detection.candidates[0]
    return {
        "vehicle": ranked.vehicle,
        "windows": ranked.n_windows,
        "p_value": min(1.0, math.exp(-ranked.detection.e_value)),
        "deviates": ranked.is_discovery,
        "part": best.hypothesis.name,
        "change": best.change,
        "interval": best.interval,
    }


class ReasonEntry(Document):
    """A reason for which windows have no result, and their number."""

    reason: str
    windows: int


class FleetFindingEntry(Document):
    """A finding of a vehicle that has changed; `since` is UTC seconds since 1970."""

    vehicle: str
    corner: str
    component: str
    change: float | None
    lower: float | None
    upper: float | None
    since: float
    severity: str


class FleetRunDocument(Document):
    """A run over a lake: windows analysed now, and what the tables of results hold after it."""

    schema_name: Literal["sprung.fleet-run/1"] = Field(alias="schema")
    results: str
    steps: tuple[str, ...]
    analysed: dict[str, int]
    vehicles_assessed: int
    analysis_time: float
    windows: dict[str, int]
    without_result: dict[str, int]
    reasons: tuple[ReasonEntry, ...]
    verdicts: dict[str, int]
    discoveries: int
    findings: tuple[FleetFindingEntry, ...]


class FleetPlanDocument(Document):
    """Work to be done by a run over a lake, and an estimate of its cost."""

    schema_name: Literal["sprung.fleet-plan/1"] = Field(alias="schema")
    windows: int
    new: dict[str, int]
    vehicles: int
    without_vehicle_file: int
    seconds_per_window: dict[str, float]
    measured_on: str
    core_hours: float
    cores: int


class LakeVehicle(Document):
    """A vehicle in a lake: times of its first and last window, UTC ns."""

    vehicle: str
    windows: int
    first: int
    last: int


class LakeDocument(Document):
    """Contents of a lake, after what was done to it."""

    schema_name: Literal["sprung.lake/1"] = Field(alias="schema")
    lake: str
    windows: int
    files: int
    bytes: int
    first: str | None
    last: str | None
    vehicles: tuple[LakeVehicle, ...]
    compacted: int | None
    removed: int | None
    exported: tuple[str, ...]


class ImportedVehicle(Document):
    """Windows of a vehicle that were added, and that were in the lake already."""

    vehicle: str
    files: int
    added: int
    known: int


class BadFile(Document):
    """A file that could not be imported."""

    file: str
    reason: str


class LakeImportDocument(Document):
    """Result of an import."""

    schema_name: Literal["sprung.lake-import/1"] = Field(alias="schema")
    lake: str
    vehicles: tuple[ImportedVehicle, ...]
    bad_files: tuple[BadFile, ...]
