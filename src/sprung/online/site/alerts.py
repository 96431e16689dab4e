"""The list of alerts, with their numbers by state and severity."""

from typing import Annotated, Literal, TypeAlias

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field

from sprung.online.monitor import MONITOR
from sprung.online.site.accounts import Viewer
from sprung.online.site.outcomes import precision
from sprung.online.site.rendering import filter_link, page, with_others
from sprung.online.site.shared import Answer, Shared, Wanted, column_number, parse_cursor
from sprung.online.store import AlertFilter, AlertPlace
from sprung.results.documents.monitoring import AlertEntry
from sprung.results.tables import counted
from sprung.state import STEPS, StepName, severity_step

api = APIRouter(tags=["alerts"])
pages = APIRouter(include_in_schema=False)

StateName: TypeAlias = Literal[
    "unacknowledged", "acknowledged", "returned to normal, unacknowledged", "shelved", "normal"
]
#: Sign of each state in the terms of ISA-18.2, those that require action first.
STATES: dict[StateName, str] = {
    "unacknowledged": "●",
    "acknowledged": "◐",
    "returned to normal, unacknowledged": "○",
    "shelved": "‖",
    "normal": "✓",
}


class WantedAlerts(Wanted):
    """Which alerts are listed; the address of the page states it."""

    state: list[StateName] = Field([], description="states; empty: all but normal")
    step: list[StepName] = Field([], description="steps of severity; empty: all")
    vehicle: str = Field("", max_length=64, description="part of the vehicle's name")
    assignee: str | None = Field(None, max_length=200, description="assignee")
    is_complete: bool = Field(False, description="whether to include alerts that have returned to normal")


class WantedPage(WantedAlerts):
    """Which alerts are listed, and how many of them."""

    cursor: str | None = Field(None, pattern=r"^[0-9]{1,4}~[0-8]?[0-9]{1,18}~[0-8]?[0-9]{1,18}$")
    limit: int = Field(50, ge=1, le=200)


class Alerts(Answer):
    """Alerts, the most severe first."""

    alerts: tuple[AlertEntry, ...]
    next: str | None = Field(description="cursor of the next page; null after the last")


class AlertCounts(Answer):
    """Numbers of alerts by state, and of those that are not normal by step of severity."""

    states: dict[str, int]
    steps: dict[str, int]


@api.get("/alerts")
def alerts(context: Shared, _: Viewer, wanted: Annotated[WantedPage, Query()]) -> Alerts:
    """Alerts, the most severe first."""
    states = tuple(wanted.state) or (() if wanted.is_complete else tuple(STATES)[:-1])
    chosen = AlertFilter(states, tuple(STEPS.index(name) for name in wanted.step), wanted.vehicle, wanted.assignee)
    after = None if wanted.cursor is None else AlertPlace(*parse_cursor(wanted.cursor, *3 * [column_number]))
    rows = context.store.alerts.page(chosen, after=after, limit=wanted.limit + 1)
    shown = rows[: wanted.limit]
    last = shown[-1] if len(rows) > wanted.limit else None
    return Alerts(
        alerts=tuple(AlertEntry(**alert.as_entry()) for alert in shown),
        next=None if last is None else f"{last.severity}~{last.raised}~{last.number}",
    )


@api.get("/alert-counts")
def counts(context: Shared, _: Viewer, wanted: Annotated[WantedAlerts, Query()]) -> AlertCounts:
    """Numbers of alerts by state and by step of severity."""
    found = context.store.alerts.counts(AlertFilter(vehicle=wanted.vehicle, assignee=wanted.assignee))
    return AlertCounts(
        states={name: sum(count for (state, _), count in found.items() if state == name) for name in STATES},
        steps={
            name: sum(count for (state, number), count in found.items() if number == step and state != "normal")
            for step, name in enumerate(STEPS)
        },
    )


@pages.get("/alerts")
def show(request: Request, context: Shared, person: Viewer, wanted: Annotated[WantedPage, Query()]) -> Response:
    """Show the list of alerts."""
    found = counts(context, person, wanted)
    return page(
        request,
        "alerts.html",
        section="/alerts",
        sentence=_sentence(found.states),
        counts=found,
        page=alerts(context, person, wanted),
        precision=precision(context.store),
        wanted=wanted,
        link=filter_link("/alerts", wanted),
        state_signs=STATES,
        step_of=lambda severity: STEPS[severity_step(severity)],
        monitor=MONITOR,
    )


def _sentence(states: dict[str, int]) -> str:
    """Return the number of open alerts in words."""
    if not any(number for name, number in states.items() if name != "normal"):
        return "No alert is open."
    waiting = states["unacknowledged"] + states["returned to normal, unacknowledged"]
    first = f"{counted(waiting, 'alert') if waiting else 'No alert'} {'needs' if waiting < 2 else 'need'} attention."
    return with_others(first, {word: states[word] for word in ("acknowledged", "shelved")})
