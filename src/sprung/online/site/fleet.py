"""The fleet: every vehicle, the most urgent first."""

from collections.abc import Sequence
from typing import Annotated, Literal

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field

from sprung.online.monitor import embedded_port
from sprung.online.monitor.histories import vehicle_state
from sprung.online.site.accounts import Viewer
from sprung.online.site.rendering import filter_link, page, with_others
from sprung.online.site.shared import Answer, Context, Shared, Wanted, column_number, parse_cursor
from sprung.online.store import FleetCounts, FleetFilter, FleetRow, Place, VehicleRow
from sprung.results.tables import counted
from sprung.state import STEPS, AlertState, StepName, VehicleState, Verdict

api = APIRouter(tags=["vehicles"])
pages = APIRouter(include_in_schema=False)

#: Beginning of the causes of alerts about sensors.
_SENSOR = "sensor:"


class WantedVehicles(Wanted):
    """Which vehicles are listed, and how many of them."""

    text: str = Field("", max_length=64, description="part of the name")
    step: list[Literal[StepName, "none"]] = Field([], description="steps of severity, none: no alert; empty: all")
    assignee: str | None = Field(None, max_length=200)
    is_unacknowledged: bool = False
    is_learning: bool = False
    is_silent: bool = False
    cursor: str | None = Field(None, pattern=r"^[0-9]{1,4}~[0-9]{1,4}[.][0-9]{1,20}~.{1,64}$")
    limit: int = Field(50, ge=1, le=200)


class FleetVehicle(Answer):
    """A vehicle in the fleet."""

    vehicle: str
    verdict: Verdict = Field(description="what matters most")
    severity: int = Field(description="greatest severity of its active alerts, 1 to 1000; 0: none")
    step: str | None = Field(description="step of that severity: note, low, medium, high or critical")
    alert: int | None = Field(description="number of that alert")
    sentence: str = Field(description="its state in a sentence")
    since: int | None = Field(description="time when that alert was raised")
    health_index: float | None = Field(description="0 to 100 for planning; null while its state is not known")
    channels: int = Field(description="number of its channels")
    failing: tuple[str, ...] = Field(description="channels with an active alert about their sensor")
    has_lost: bool = Field(description="whether an active alert states that frames were lost")
    last_seen: int
    is_parked: bool
    is_old: bool = Field(description="whether it is silent, or was parked more than a day ago")
    windows_learnt: int | None = Field(description="windows collected for a baseline")
    windows_needed: int | None = Field(description="windows needed for a baseline")
    baseline: int | None = Field(description="version of its baseline")
    assignee: str | None
    alert_state: str | None = Field(description="state of that alert in the terms of ISA-18.2")

    @classmethod
    def of(cls, state: VehicleState, *, channels: int, is_parked: bool, baseline: int | None) -> "FleetVehicle":
        """Return a vehicle from its state, and what else its row in the fleet shows."""
        of_state = ("vehicle", "verdict", "severity", "step", "sentence", "health_index", "last_seen", "is_old")
        worst = state.worst
        causes = [alert.cause for alert in state.alerts]
        return cls(
            **{name: getattr(state, name) for name in (*of_state, "windows_learnt", "windows_needed")},
            alert=None if worst is None else worst.number,
            since=None if worst is None else worst.raised,
            assignee=None if worst is None else worst.assignee,
            alert_state=None if worst is None else worst.state,
            channels=channels,
            failing=tuple(cause.removeprefix(_SENSOR) for cause in causes if cause.startswith(_SENSOR)),
            has_lost="lost" in causes,
            is_parked=is_parked,
            baseline=baseline,
        )


class FleetPage(Answer):
    """Vehicles in order of urgency."""

    vehicles: tuple[FleetVehicle, ...]
    next: str | None = Field(description="cursor of the next page; null after the last")


@api.get("/vehicles")
def vehicles(context: Shared, _: Viewer, wanted: Annotated[WantedVehicles, Query()]) -> FleetPage:
    """Vehicles, the most urgent first."""
    steps = [STEPS.index(name) if name in STEPS else -1 for name in wanted.step]
    silent_before = context.silent_before if wanted.is_silent else None
    chosen = FleetFilter(
        wanted.text, steps, wanted.assignee, wanted.is_unacknowledged, wanted.is_learning, silent_before
    )
    after = None if wanted.cursor is None else Place(*parse_cursor(wanted.cursor, column_number, float, str))
    rows = context.store.fleet.page(chosen, after=after, limit=wanted.limit + 1)
    shown = rows[: wanted.limit]
    alerts = context.store.alerts.of_vehicles([row.place.vehicle for row in shown])
    last = shown[-1].place if len(rows) > wanted.limit else None
    return FleetPage(
        vehicles=tuple(
            FleetVehicle.of(
                state_seen(context, row.place.vehicle, row, alerts.get(row.place.vehicle, [])),
                channels=row.n_channels,
                is_parked=row.is_parked,
                baseline=row.baseline,
            )
            for row in shown
        ),
        next=None if last is None else f"{last.severity}~{last.impact!r}~{last.vehicle}",
    )


@api.get("/counts")
def counts(context: Shared, _: Viewer) -> FleetCounts:
    """Numbers of vehicles in each state."""
    return context.store.fleet.counts(silent_before=context.silent_before)


class Advice(Answer):
    """Advice on inspections."""

    sentences: tuple[str, ...] = Field(description="of each type, the vehicle whose inspection teaches most, and why")


@api.get("/advice")
def advice(context: Shared, _: Viewer) -> Advice:
    """Vehicles whose inspection would teach most about their type; at most an hour old."""
    return Advice(sentences=context.advice())


@pages.get("/")
def show(request: Request, context: Shared, person: Viewer, wanted: Annotated[WantedVehicles, Query()]) -> Response:
    """Show the fleet."""
    counted_vehicles = counts(context, person)
    port = embedded_port(context.site.broker)
    return page(
        request,
        "fleet.html",
        section="/",
        sentence=_sentence(counted_vehicles),
        counts=counted_vehicles,
        page=vehicles(context, person, wanted),
        wanted=wanted,
        link=filter_link("/", wanted),
        broker=context.site.broker if port is None else f"mqtt://127.0.0.1:{port}",
    )


def state_seen(
    context: Context, vehicle: str, row: FleetRow | VehicleRow, active: Sequence[AlertState]
) -> VehicleState:
    """Return the state of a vehicle with its active alerts, by when it was last seen."""
    return vehicle_state(
        context.store,
        vehicle,
        now=context.clock(),
        silent_after=context.site.alerts.silent_after_minutes,
        last_seen=row.last_seen,
        is_parked=row.is_parked,
        alerts=active,
    )


def _sentence(counts: FleetCounts) -> str:
    """Return the state of the fleet in words."""
    if not counts.vehicles:
        return "No vehicle is known yet."
    urgent = counts.unacknowledged
    need = "needs" if urgent < 2 else "need"
    first = f"{urgent or 'None'} of {counted(counts.vehicles, 'vehicle')} {need} attention."
    return with_others(first, {"silent": counts.silent, "still learning": counts.learning})
