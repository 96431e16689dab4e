"""Documents of the archive of a fleet: what a run has done, `sprung.fleet-run/1`, or would, `sprung.fleet-plan/1`."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Literal

from pydantic import Field

from sprung.results.documents.document import Document


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
    return FleetRunDocument.model_validate(
        {
            "schema": "sprung.fleet-run/1",
            **counts,
            "reasons": [{"reason": reason, "windows": count} for reason, count in reasons],
            "findings": [{name: row[name] for name in names} for row in findings],
        }
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
    return FleetPlanDocument.model_validate({"schema": "sprung.fleet-plan/1", **fields})
