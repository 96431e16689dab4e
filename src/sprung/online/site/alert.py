"""One alert: its page with evidence and history, and the actions of people on it."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from math import exp
from typing import Any, Literal, NamedTuple

import numpy as np
from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, RedirectResponse, Response
from pydantic import Field

from sprung.errors import ParameterError
from sprung.online.monitor import MONITOR, operations
from sprung.online.monitor.operations import require_alert, send_work_order, work_order
from sprung.online.site.accounts import Engineer, EngineerForm, Person, Role, Viewer
from sprung.online.site.alerts import STATES
from sprung.online.site.rendering import page
from sprung.online.site.shared import (
    Answer,
    Context,
    Done,
    Given,
    Line,
    Mileage,
    Name,
    Number,
    Outcome,
    Shared,
    Text,
    finite,
)
from sprung.online.store import Entry, VerdictRow
from sprung.results.documents import WorkOrderDocument, document_text
from sprung.results.documents.monitoring import AlertEntry, HistoryEntry
from sprung.results.tables.wording import format_name
from sprung.state import TIME_ROUNDING, AlertState, interval_95
from sprung.vehicles import Component

api = APIRouter(tags=["alerts"])
pages = APIRouter(include_in_schema=False)


@dataclass(frozen=True, slots=True)
class PageSettings:
    """Settings of the page of an alert."""

    #: Largest number of windows behind it that are shown: since the onset, and before it.
    since: int = 20
    before: int = 5
    #: Size of the chart of the evidence and its margins [px], and largest number of marks on its axis.
    width: int = 600
    height: int = 240
    left: int = 48
    right: int = 16
    top: int = 16
    bottom: int = 40
    marks: int = 5
    #: Durations for which it can be shelved, in days.
    shelf_days: tuple[tuple[float, str], ...] = (
        (1 / 3, "8 hours"),
        (1, "1 day"),
        (3, "3 days"),
        (7, "1 week"),
        (30, "30 days"),
    )


PAGE = PageSettings()


class PartChange(Answer):
    """Change of one part of a pair."""

    name: str
    change: float
    interval: tuple[float, float] = Field(description="95 % interval")


class HypothesisEntry(Answer):
    """A possible change, and its evidence."""

    name: str
    log_evidence: float = Field(description="ln of its likelihood over that of no change")
    change: float | None
    interval: tuple[float, float] | None
    parts: tuple[PartChange, ...] = Field((), description="changes of the parts of a pair")


class PartEntry(Answer):
    """Value of a part in a window, relative to the vehicle file."""

    name: str
    value: float
    interval: tuple[float, float] = Field(description="95 % interval")


class EvidenceWindow(Answer):
    """A window behind an alert, with the conditions in which it was measured."""

    boot: int
    number: int
    t0: int
    is_since_onset: bool
    speed: float | None = Field(description="mean speed [m/s]")
    payload: float | None = Field(description="[kg]")
    roughness: float | None = Field(description="roughness of the road, G(n0) of ISO 8608 [m^3]")
    temperature: float | None = Field(description="mean temperature [°C]")
    parts: tuple[PartEntry, ...] = Field(description="parts that the alert names")
    note: str | None = Field(description="why the window gives no information on them; null if it does")


class EvidencePoint(Answer):
    """Evidence of a change after a window."""

    time: int
    log_evidence: float


class Evidence(Answer):
    """The evidence behind an alert."""

    is_active: bool = Field(description="whether the cause holds now")
    is_acknowledged: bool
    change: float | None
    interval: tuple[float, float] | None = Field(description="95 % interval of the change")
    since: int | None = Field(description="onset; null if unknown")
    since_interval: tuple[int, int] | None
    runner_up: str | None = Field(description="second hypothesis in words; null: far less likely")
    advice: str | None
    detectable: dict[str, float] = Field(description="smallest detectable loss of each part")
    hypotheses: tuple[HypothesisEntry, ...] = Field(description="the most probable first")
    course: tuple[EvidencePoint, ...] = Field(description="evidence after the last windows")
    threshold: float | None = Field(description="ln of the evidence at which an alert is raised")
    windows: tuple[EvidenceWindow, ...] = Field(description="windows before the onset and since then")


class AlertDetail(Answer):
    """An alert with its evidence, history and verdicts."""

    alert: AlertEntry
    evidence: dict[str, Any]
    history: tuple[HistoryEntry, ...]
    verdicts: tuple[VerdictRow, ...]


class Comment(Given):
    """A comment."""

    comment: Text = ""


class Shelf(Comment):
    """Duration for which an alert is shelved."""

    hours: float = Field(gt=0, le=24 * 366)


class Assignment(Comment):
    """Assignee of an alert; null: nobody."""

    assignee: Line | None


class WorkshopVerdict(Given):
    """Finding and work of the workshop, and whether a new baseline is learnt."""

    verdict: Literal["confirmed", "another part", "nothing found", "not looked at"]
    part: Line = ""
    action: Text = ""
    new_baseline: bool = False
    mileage: Mileage | None = None


class Action(NamedTuple):
    """An action on an alert: what a request says, the function that does it, its meaning, and its result."""

    body: type[Given]
    act: Callable[..., object]
    meaning: str
    done: str


#: Actions on an alert, by the word in their address.
ACTIONS = {
    "acknowledge": Action(Comment, operations.acknowledge, "Acknowledge an alert.", "Acknowledged."),
    "comment": Action(Comment, operations.add_comment, "Comment on an alert.", "Comment added."),
    "unshelve": Action(Comment, operations.unshelve, "End the shelving of an alert.", "No longer shelved."),
    "close": Action(Comment, operations.close, "Clear an alert whose cause was removed.", "Cleared."),
    "assign": Action(Assignment, operations.assign, "Assign an alert to a person, or to nobody.", "Assigned."),
    "shelve": Action(
        Shelf,
        operations.shelve,
        "Shelve an alert for some hours.",
        "Shelved: nobody is notified until the shelving ends.",
    ),
    "verdict": Action(
        WorkshopVerdict,
        operations.add_verdict,
        "Record what the workshop found and did, and learn a new baseline if requested.",
        "Verdict recorded.",
    ),
}
#: Result of an action, by the word in the address of the page that follows.
_DONE = {
    **{name: action.done for name, action in ACTIONS.items()},
    "baseline": "Verdict recorded, and a new baseline requested: it is learnt from the next usable windows.",
    "work-order": "Work order sent.",
}


@api.get("/alerts/{number}")
def alert_detail(context: Shared, _: Viewer, number: Number) -> AlertDetail:
    """An alert with its evidence, history and verdicts."""
    store, state = context.store, require_alert(context.store, number)
    return AlertDetail(
        alert=AlertEntry(**state.as_entry()),
        evidence=dict(state.evidence),
        history=tuple(HistoryEntry.model_validate(each, from_attributes=True) for each in store.alerts.history(number)),
        verdicts=tuple(store.verdicts.all(alerts=[number])),
    )


@api.get("/alerts/{number}/evidence")
def evidence(context: Shared, _: Viewer, number: Number) -> Evidence:
    """The evidence behind an alert: change, hypotheses, course of the evidence, windows."""
    return evidence_of(context, require_alert(context.store, number))


def _add_route(name: str, action: Action) -> None:
    """Add the route of an action."""

    def route(context: Shared, person: Engineer, number: Number, given: Any) -> AlertDetail:
        _act(context, person, number, name, given)
        return alert_detail(context, person, number)

    route.__annotations__["given"] = action.body
    api.post(f"/alerts/{{number}}/{name}", name=name, description=action.meaning)(route)


for _name, _action in ACTIONS.items():
    _add_route(_name, _action)


@api.get("/alerts/{number}/work-order", response_model=WorkOrderDocument)
def order(request: Request, context: Shared, person: Viewer, number: Number) -> JSONResponse:
    """The work order of an alert, `sprung.work-order/1`."""
    return JSONResponse(_work_order(request, context, person, number).as_json())


@api.post("/alerts/{number}/work-order")
def send_order(context: Shared, person: Engineer, number: Number) -> Done:
    """Send the work order of an alert through the webhooks of the site file."""
    hooks = [hook.as_sender(f"webhook {k}") for k, hook in enumerate(context.site.send.webhook, start=1)]
    link = context.site.alert_url(number)
    results = send_work_order(context.store, number, hooks, who=person.name, now=context.clock(), link=link)
    words = "; ".join(f"{name}: {error or 'sent'}" for name, error in results.items())
    if any(results.values()):
        raise ParameterError(
            f"the work order was not delivered everywhere ({words}): correct the site file, or download it"
        )
    return Done(sentence=f"the work order was sent ({words})", number=number)


@pages.get("/alerts/{number}")
def show(request: Request, context: Shared, person: Viewer, number: Number, done: Outcome = "") -> Response:
    """Show an alert, to which notifications lead."""
    return _page(request, context, person, number, notice=_DONE.get(done, ""))


@pages.get("/alerts/{number}/work-order.json")
def order_file(request: Request, context: Shared, person: Viewer, number: Number) -> Response:
    """Give the work order of an alert as a file."""
    text = document_text(_work_order(request, context, person, number))
    headers = {"content-disposition": f'attachment; filename="work-order-{number}.json"', "cache-control": "no-store"}
    return Response(text, media_type="application/json", headers=headers)


@pages.post("/alerts/{number}/{action}")
def act_by_form(request: Request, context: Shared, form: EngineerForm, number: Number, action: Name) -> Response:
    """Act on an alert, and return to it; with what was entered, and a sentence, if the action is impossible."""
    if action != "work-order" and action not in ACTIONS:
        raise ParameterError(f"unknown action {action!r}: see the page of the alert")
    try:
        if action == "work-order":
            send_order(context, form.person, number)
        else:
            given = form.body(ACTIONS[action].body)
            _act(context, form.person, number, action, given)
            action = "baseline" if getattr(given, "new_baseline", False) else action
    except ParameterError as error:
        require_alert(context.store, number)
        return _page(request, context, form.person, number, problem=str(error), given=form.fields)
    return RedirectResponse(f"/alerts/{number}?done={action}", 303)


def _act(context: Context, person: Person, number: int, name: str, given: Given) -> None:
    """Act on an alert as the body of a request says."""
    ACTIONS[name].act(context.store, number, **given.model_dump(), who=person.name, now=context.clock())


def _work_order(request: Request, context: Context, person: Person, number: int) -> WorkOrderDocument:
    """Return the work order of an alert."""
    link = context.site.alert_url(number) or f"{request.base_url}alerts/{number}"
    return work_order(context.store, number, who=person.name, now=context.clock(), link=link)


def _page(
    request: Request,
    context: Context,
    person: Person,
    number: int,
    *,
    notice: str = "",
    problem: str = "",
    given: dict[str, str] | None = None,
) -> Response:
    """Return the page of an alert."""
    state = require_alert(context.store, number)
    found = evidence_of(context, state)
    detail = alert_detail(context, person, number)
    clauses = state.text.split("; ")
    n_head = 2 if found.advice else len(clauses)  # a finding, and what to do
    head = "; ".join(clauses[:n_head])
    rest = "; ".join(clauses[n_head:])
    if not head.startswith(state.vehicle):  # names stay as they are
        head = head[:1].upper() + head[1:]
    may_act = person.role.includes(Role.ENGINEER)
    return page(
        request,
        "alert.html",
        status=409 if problem else 200,
        section="/alerts",
        notice=notice,
        problem=problem,
        given=given or {},
        alert=state,
        head=head,
        rest=rest[:1].upper() + rest[1:],
        detail=detail,
        history=_folded(detail.history),
        evidence=found,
        rivals=[each for each in found.hypotheses if not _extends_best(each, found)],
        extensions=[each for each in found.hypotheses if _extends_best(each, found)],
        likelihood=lambda each, best: exp(min(0.0, each.log_evidence - best)),
        course=course_of(found.course, found.threshold),
        is_of_vehicle=state.vehicle != MONITOR and state.cause.partition(":")[0] != "monitor",
        may_act=may_act,
        names=[account.name for account in context.store.accounts.all()] if may_act else [],
        shelves=[(round(24 * days), words) for days, words in PAGE.shelf_days],
        has_webhook=bool(context.site.send.webhook),
        state_signs=STATES,
        in_words=format_name,
        verdicts=operations.VERDICTS,
        n_before=PAGE.before,
        n_since=PAGE.since,
    )


def _extends_best(hypothesis: HypothesisEntry, found: Evidence) -> bool:
    """Return whether a hypothesis is the best one with another part."""
    best = set(found.hypotheses[0].name.split("+"))
    return best < set(hypothesis.name.split("+"))


def _folded(history: Sequence[HistoryEntry]) -> list[tuple[int, HistoryEntry]]:
    """Return the entries of a history, the last first; of consecutive updates only the last one, and how many."""
    folded: list[tuple[int, HistoryEntry]] = []
    for entry in reversed(history):
        if folded and folded[-1][1].what == entry.what == "updated":
            folded[-1] = folded[-1][0] + 1, folded[-1][1]
        else:
            folded.append((1, entry))
    return folded


def evidence_of(context: Context, alert: AlertState) -> Evidence:
    """Return what led to an alert."""
    detection = alert.evidence.get("detection") or {}
    names = ("is_active", "is_acknowledged", "change", "interval", "runner_up", "advice", "detectable")
    return Evidence(
        **{name: getattr(alert, name) for name in names},
        since=alert.onset,
        since_interval=alert.onset_interval,
        hypotheses=tuple(HypothesisEntry.model_validate(each) for each in detection.get("hypotheses", ())),
        course=tuple(
            EvidencePoint(time=round(time * 1e9), log_evidence=value)
            for time, value in zip(detection.get("times", ()), detection.get("evidence", ()), strict=True)
        ),
        threshold=detection.get("threshold"),
        windows=_windows(context, alert),
    )


def _windows(context: Context, alert: AlertState) -> tuple[EvidenceWindow, ...]:
    """Return the windows behind an alert of the suspension or of a sensor."""
    if not alert.is_of_suspension and not alert.cause.startswith("sensor:"):
        return ()
    since = (_first_with_fault(context, alert) if alert.onset is None else alert.onset) - TIME_ROUNDING
    observations = context.store.results.observations
    before = observations(alert.vehicle, until=since - 1, limit=PAGE.before)
    after = observations(alert.vehicle, since=since, until=alert.cleared, limit=PAGE.since)
    windows = [*((entry, False) for entry in before), *((entry, True) for entry in after)]
    return tuple(_window(entry, alert, is_since=is_since) for entry, is_since in windows)


def _first_with_fault(context: Context, alert: AlertState) -> int:
    """Return the start of the first of the windows before an alert that show its fault, UTC ns.

    Samples may be older than the alert by any time, as those of a box that was offline.
    """
    channel, first = alert.cause.removeprefix("sensor:"), alert.raised
    for entry in reversed(context.store.results.observations(alert.vehicle, until=alert.raised, limit=PAGE.since)):
        if all(each.get("channel") != channel for each in entry.document.get("sensor_faults") or ()):
            break
        first = entry.t0
    return first


def _window(entry: Entry, alert: AlertState, *, is_since: bool) -> EvidenceWindow:
    """Return a window with its values of the parts that an alert names."""
    document = entry.document
    conditions = document.get("conditions") or {}
    names: Sequence[str] = document.get("components") or ()
    named = set(map(str, alert.names([Component.parse(name) for name in names])))
    parts = []
    for k, name in enumerate(names):
        if name in named:
            log_ratio, variance = document["log_ratios"][k], document["covariance"][k][k]
            low, high = 1 + interval_95(np.array(log_ratio), np.sqrt(max(variance, 0.0)))
            parts.append(PartEntry(name=name, value=exp(log_ratio), interval=(float(low), float(high))))
    faults = (
        f"{each.get('channel')} {each.get('kind', '').replace('_', ' ')}"
        for each in document.get("sensor_faults") or ()
    )
    return EvidenceWindow(
        boot=entry.boot,
        number=entry.number,
        t0=entry.t0,
        is_since_onset=is_since,
        parts=tuple(parts),
        note=document.get("reason") or "; ".join(faults) or None,
        **{name: finite(conditions.get(name)) for name in ("speed", "payload", "roughness", "temperature")},
    )


class Dot(NamedTuple):
    """Evidence after a window: place in the drawing, and whether it is at the threshold or above."""

    x: float
    y: float
    is_above: bool
    point: EvidencePoint


class Course(NamedTuple):
    """Evidence after each of some windows, as it is drawn.

    Parameters
    ----------
    dots
        Windows in the order of time, at equal distances.
    threshold
        Place of the threshold.
    marks
        Places and numbers of the axis.
    """

    dots: tuple[Dot, ...]
    threshold: float
    marks: tuple[tuple[float, int], ...]


def course_of(points: Sequence[EvidencePoint], threshold: float | None) -> Course | None:
    """Return the chart of the evidence; None without a window."""
    if not points or threshold is None:
        return None
    values = [point.log_evidence for point in points]
    low = min(0.0, *values)
    high = max(threshold, *values) * 1.05
    across = (PAGE.width - PAGE.left - PAGE.right) / max(1, len(points) - 1)

    def height(value: float) -> float:
        return PAGE.top + (PAGE.height - PAGE.top - PAGE.bottom) * (high - value) / (high - low)

    # The first round distance that needs few enough marks.
    step = next(step for k in range(9) for step in (10**k, 2 * 10**k, 5 * 10**k) if (high - low) / step <= PAGE.marks)
    first = -(-int(low) // step) * step
    return Course(
        dots=tuple(
            Dot(PAGE.left + across * k, height(point.log_evidence), point.log_evidence >= threshold, point)
            for k, point in enumerate(points)
        ),
        threshold=height(threshold),
        marks=tuple((height(number), number) for number in range(first, int(high) + 1, step)),
    )
