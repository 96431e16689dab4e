"""Results of a run over the fleet, from the table that `sprung fleet run` writes: those that stand out first."""

import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from typing import Annotated, Any

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field

from sprung.diagnosis import Verdict
from sprung.errors import DataError
from sprung.online.site.accounts import Viewer
from sprung.online.site.rendering import filter_link, page
from sprung.online.site.shared import LIMITS, Answer, Shared, Wanted, column_number, parse_cursor
from sprung.online.store import StoreError
from sprung.results.tables import counted
from sprung.state import STEPS

api = APIRouter(tags=["runs"])
pages = APIRouter(include_in_schema=False)


class WantedRuns(Wanted):
    """Which vehicles are listed, and how many of them."""

    text: str = Field("", max_length=64, description="part of the vehicle's name")
    verdict: list[Verdict] = Field([], description="verdicts; empty: all")
    is_discovery: bool = Field(False, description="only vehicles that stand out from the fleet")
    cursor: str | None = Field(None, pattern=r"^[01]~[0-5]~.{1,200}$")
    limit: int = Field(50, ge=1, le=200)


class RunVehicle(Answer):
    """The diagnosis of a vehicle by the last run."""

    vehicle: str
    type: str = Field(description="type of the vehicle: those with the same vehicle file apart from the name")
    verdict: Verdict
    severity: str | None = Field(description="of the most severe finding: low, medium, high or critical")
    e_value: float | None = Field(description="ln of the e-value of a change, over a year")
    is_discovery: bool = Field(description="whether it stands out at the fleet's rate of false names over a year")
    windows: int = Field(description="windows that count")
    since: int | None = Field(description="start of the first window that was compared with the baseline")
    until: int | None = Field(description="start of the last one")
    reason: str | None = Field(description="why it is inconclusive; null if it is not")
    is_known: bool = Field(description="whether this monitor knows the vehicle")


class RunPage(Answer):
    """Vehicles by the last run: discoveries first, then by severity."""

    total: int = Field(description="vehicles of the run")
    discoveries: int
    verdicts: dict[str, int] = Field(description="number of vehicles by verdict")
    vehicles: tuple[RunVehicle, ...]
    next: str | None = Field(description="cursor of the next page; null after the last")


class RunResults:
    """The last results of runs; from any thread.

    Parameters
    ----------
    location
        Folder or URL that the runs write to; None: no results.
    timer
        Present time [s] of a monotonic clock.

    Notes
    -----
    Rows are kept until a run has replaced them, without their documents.
    """

    def __init__(self, location: str | None, timer: Callable[[], float]) -> None:
        self._location = location
        self._timer = timer
        self._lock = threading.Lock()
        self._looked = float("-inf")
        self._version = -1
        self._rows: list[dict[str, Any]] = []

    def rows(self) -> Sequence[dict[str, Any]]:
        """Return the vehicles of the last run in order; none before the first run.

        Raises
        ------
        StoreError
            If the results cannot be read.
        """
        with self._lock:
            if self._location is not None and self._timer() - self._looked >= LIMITS.fresh:
                try:
                    self._read(f"{self._location.rstrip('/')}/diagnoses")
                except DataError as error:
                    raise StoreError(str(error)) from None
                self._looked = self._timer()
            return self._rows

    def _read(self, location: str) -> None:
        """Read the table if it has changed."""
        import pyarrow as pa

        from sprung.fleet.lake import Table

        texts = ("vehicle", "type", "verdict", "severity", "reason")
        kinds = dict.fromkeys(texts, pa.string()) | dict.fromkeys(("n_windows", "since", "until"), pa.int64())
        kinds |= {"is_discovery": pa.bool_(), "e_value": pa.float64()}
        table = Table(location, pa.schema(list(kinds.items())))
        version = table.version
        if version != self._version:
            self._rows = sorted(table.rows(tuple(kinds)).to_pylist(), key=_order)
            self._version = version


def _order(row: Mapping[str, Any]) -> tuple[bool, int, str]:
    """Return the place of a row: discoveries first, then by severity and name."""
    return (
        not row["is_discovery"],
        -(0 if row["severity"] is None else STEPS.index(row["severity"]) + 1),
        row["vehicle"],
    )


@api.get("/runs")
def runs(request: Request, context: Shared, _: Viewer, wanted: Annotated[WantedRuns, Query()]) -> RunPage:
    """Vehicles by the last run over the fleet (`keep.results`): discoveries first, then by severity."""
    results: RunResults = request.app.state.runs
    rows = results.rows()
    chosen = [
        row
        for row in rows
        if wanted.text.lower() in row["vehicle"].lower()
        and (not wanted.verdict or row["verdict"] in wanted.verdict)
        and (row["is_discovery"] or not wanted.is_discovery)
    ]
    if wanted.cursor is not None:
        discovery, step, vehicle = parse_cursor(wanted.cursor, column_number, column_number, str)
        place = (not discovery, -step, vehicle)
        chosen = [row for row in chosen if _order(row) > place]
    shown = chosen[: wanted.limit]
    is_last, step, vehicle = _order(shown[-1]) if shown else (True, 0, "")
    return RunPage(
        total=len(rows),
        discoveries=sum(bool(row["is_discovery"]) for row in rows),
        verdicts=Counter(row["verdict"] for row in rows),
        vehicles=tuple(
            RunVehicle(
                **row
                | {"type": row["type"] or "", "reason": row["reason"] or None}
                | {"is_discovery": bool(row["is_discovery"]), "windows": row["n_windows"] or 0},
                is_known=context.store.inbox.vehicle(row["vehicle"]) is not None,
            )
            for row in shown
        ),
        next=f"{int(not is_last)}~{-step}~{vehicle}" if len(chosen) > len(shown) else None,
    )


@pages.get("/runs")
def show(request: Request, context: Shared, person: Viewer, wanted: Annotated[WantedRuns, Query()]) -> Response:
    """Show the results of the last run."""
    found = runs(request, context, person, wanted)
    stands = "stands" if found.discoveries == 1 else "stand"
    summary = f"{found.discoveries} of {counted(found.total, 'vehicle')} {stands} out from the fleet."
    return page(
        request,
        "runs.html",
        section="/runs",
        sentence=summary if found.total else "No run has stored results yet.",
        page=found,
        wanted=wanted,
        link=filter_link("/runs", wanted),
        results=context.site.keep.results,
    )
