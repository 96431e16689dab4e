"""Documents of fleets: ranking, `sprung.fleet/1`, runs over an archive, and the lake they read."""

import math
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any, Literal

from pydantic import Field

from sprung.diagnosis import RankedVehicle
from sprung.results.documents.document import Document, Pair, document_from


class RankedEntry(Document):
    """A vehicle against its baseline, or the others of its type; `part` is the most likely place of its deviation."""

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
    types = [{"name": name, "vehicles": list(map(_entry, ranked))} for name, ranked in rankings]
    return document_from(FleetDocument, None, rate=rate, types=types, notes=list(notes))


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


def fleet_run_document(
    *, counts: Mapping[str, Any], reasons: Iterable[tuple[str, int]], findings: Sequence[Mapping[str, Any]]
) -> FleetRunDocument:
    """Return a run as `sprung.fleet-run/1`.

    Parameters
    ----------
    counts
        Fields of the document but reasons and findings.
    reasons
        Reasons for which windows have no result, and their numbers.
    findings
        Findings of the vehicles that have changed, as rows of the table of findings.

    Examples
    --------
    >>> counts = {"results": "results", "steps": ["windows"], "analysed": {"windows": 12}, "vehicles_assessed": 4}
    >>> counts |= {"analysis_time": 61.0, "windows": {"windows": 48}, "without_result": {"windows": 3}}
    >>> counts |= {"verdicts": {"no_change_detected": 4}, "discoveries": 0}
    >>> document = fleet_run_document(counts=counts, reasons=[("the vehicle stood still", 3)], findings=[])
    >>> document.schema_name, document.reasons[0].windows
    ('sprung.fleet-run/1', 3)
    """
    names = FleetFindingEntry.model_fields
    return document_from(
        FleetRunDocument,
        None,
        reasons=[{"reason": reason, "windows": count} for reason, count in reasons],
        findings=[{name: row[name] for name in names} for row in findings],
        **counts,
    )


def fleet_plan_document(fields: Mapping[str, Any]) -> FleetPlanDocument:
    """Return a plan as `sprung.fleet-plan/1`; fields are those of the document.

    Examples
    --------
    >>> plan = {"windows": 5000, "new": {"corners": 1800}, "vehicles": 40, "without_vehicle_file": 0, "cores": 8}
    >>> plan |= {"seconds_per_window": {"corners": 2.0}, "measured_on": "3 windows of the lake", "core_hours": 1.0}
    >>> document = fleet_plan_document(plan)
    >>> document.schema_name, document.new
    ('sprung.fleet-plan/1', {'corners': 1800})
    """
    return document_from(FleetPlanDocument, None, **fields)


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


def lake_document(
    lake: str,
    *,
    windows: int,
    files: int,
    n_bytes: int,
    first: str | None,
    last: str | None,
    vehicles: Iterable[tuple[str, int, int, int]],
    compacted: int | None = None,
    removed: int | None = None,
    exported: Iterable[Path] = (),
) -> LakeDocument:
    """Return the contents of a lake as `sprung.lake/1`.

    Parameters
    ----------
    lake
        Folder or URL.
    windows, files, n_bytes
        Numbers of windows and files, and their size.
    first, last
        First and last date, as YYYY-mm-dd.
    vehicles
        Name of each vehicle, its number of windows, and the times of its first and last one, UTC ns.
    compacted, removed
        Numbers of dates that were compacted and of windows that were deleted; None: not asked for.
    exported
        Files that windows were written to.

    Examples
    --------
    >>> vehicle = ("bus-17", 144, 1_790_000_000_000_000_000, 1_790_086_400_000_000_000)
    >>> document = lake_document(
    ...     "lake", windows=144, files=3, n_bytes=21_000_000, first="2026-09-21", last="2026-09-22", vehicles=[vehicle]
    ... )
    >>> document.schema_name, document.vehicles[0].windows, document.removed is None
    ('sprung.lake/1', 144, True)
    """
    return document_from(
        LakeDocument,
        None,
        lake=lake,
        windows=windows,
        files=files,
        bytes=n_bytes,
        first=first,
        last=last,
        vehicles=[dict(zip(LakeVehicle.model_fields, own, strict=True)) for own in vehicles],
        compacted=compacted,
        removed=removed,
        exported=list(map(str, exported)),
    )


def lake_import_document(
    lake: str, vehicles: Iterable[tuple[str, int, int, int]], bad_files: Iterable[tuple[Path, str]]
) -> LakeImportDocument:
    """Return the result of an import as `sprung.lake-import/1`.

    Parameters
    ----------
    lake
        Folder or URL.
    vehicles
        Name of each vehicle, its number of files, of windows added, and of windows known before.
    bad_files
        Files that could not be imported, and why.

    Examples
    --------
    >>> from pathlib import Path
    >>> document = lake_import_document("lake", [("bus-17", 2, 10, 4)], [(Path("x.csv"), "no time column")])
    >>> document.vehicles[0].added, document.bad_files[0].reason
    (10, 'no time column')
    """
    return document_from(
        LakeImportDocument,
        None,
        lake=lake,
        vehicles=[dict(zip(ImportedVehicle.model_fields, own, strict=True)) for own in vehicles],
        bad_files=[{"file": str(path), "reason": reason} for path, reason in bad_files],
    )
