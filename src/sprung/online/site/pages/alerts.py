"""Alerts: the list, and one alert with its evidence and the actions on it."""

from collections.abc import Callable, Sequence
from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request
from fastapi.responses import RedirectResponse, Response
from pydantic import Field

from sprung.errors import ParameterError
from sprung.online.alerts import STEPS, is_of_suspension, severity_step
from sprung.online.monitor import MONITOR, operations
from sprung.online.monitor.operations import work_order
from sprung.online.site import alert_views, views
from sprung.online.site.access import Viewer
from sprung.online.site.alert_views import STATES, AlertCounts, WantedAlerts
from sprung.online.site.api import Number
from sprung.online.site.api_alerts import send_order
from sprung.online.site.context import Context, Shared
from sprung.online.site.models import AlertDetail
from sprung.online.site.pages.course import course_of
from sprung.online.site.pages.forms import EngineerForm, Form
from sprung.online.site.pages.rendering import page
from sprung.online.site.people import Person, Role
from sprung.online.site.precision import precision
from sprung.results.documents import document_text
from sprung.results.documents.monitoring import HistoryEntry
from sprung.results.tables import counted
from sprung.results.tables.table import in_words

router = APIRouter()

#: Alerts on a page.
_LIMIT = 50
#: Sign of each state of an alert, next to its name.
_MARKS = dict(zip(STATES, "●◐○‖✓", strict=True))
#: Durations for which an alert can be shelved [h], in words.
_SHELVES = ((8, "8 hours"), (24, "1 day"), (72, "3 days"), (168, "1 week"), (720, "30 days"))
#: Result of an action, by the word in the address of the page that follows.
_DONE = {
    "acknowledge": "Acknowledged.",
    "assign": "Assigned.",
    "shelve": "Shelved: nobody is notified until the shelving ends.",
    "unshelve": "No longer shelved.",
    "comment": "Comment added.",
    "close": "Cleared.",
    "verdict": "Verdict recorded.",
    "baseline": "Verdict recorded, and a new baseline requested: it is learnt from the next usable windows.",
    "work-order": "Work order sent.",
}
_LONGEST = 4000


class _Wanted(WantedAlerts):
    """Which alerts are shown; the address of the page states it."""

    cursor: str | None = Field(None, max_length=200)


@router.get("/alerts")
def alerts(request: Request, context: Shared, _: Viewer, wanted: Annotated[_Wanted, Query()]) -> Response:
    """Show the list of alerts."""
    counts = alert_views.alert_counts(context, wanted)
    given = wanted.model_dump(exclude_defaults=True)
    cursor = given.pop("cursor", None)

    def link(**changes: Any) -> str:
        kept = {name: value for name, value in (given | changes).items() if value not in (None, [], "", False)}
        return "/alerts" + (f"?{urlencode(kept, doseq=True)}" if kept else "")

    return page(
        request,
        "alerts.html",
        section="/alerts",
        sentence=_sentence(counts),
        counts=counts,
        page=alert_views.alert_page(context, wanted, cursor=cursor, limit=_LIMIT),
        precision=precision(context.store),
        wanted=wanted,
        is_all=not given,
        cursor=cursor,
        limit=_LIMIT,
        link=link,
        state_names=STATES,
        state_signs=_MARKS,
        step_of=_step,
        monitor=MONITOR,
    )


@router.get("/alerts/{number}")
def alert(
    request: Request,
    context: Shared,
    person: Viewer,
    number: Number,
    done: Annotated[str, Query(max_length=20)] = "",
) -> Response:
    """Show an alert, to which notifications lead."""
    return _alert_page(request, context, person, number, notice=_DONE.get(done, ""))


@router.get("/alerts/{number}/work-order.json")
def order(request: Request, context: Shared, person: Viewer, number: Number) -> Response:
    """Give the work order of an alert as a file."""
    link = context.site.alert_url(number) or f"{request.base_url}alerts/{number}"
    document = work_order(context.store, number, who=person.name, now=context.clock(), link=link)
    headers = {"content-disposition": f'attachment; filename="work-order-{number}.json"', "cache-control": "no-store"}
    return Response(document_text(document), media_type="application/json", headers=headers)


@router.post("/alerts/{number}/acknowledge")
def acknowledge(request: Request, context: Shared, form: EngineerForm, number: Number) -> Response:
    """Acknowledge an alert."""
    return _act(request, context, form, number, act=operations.acknowledge, name="acknowledge")


@router.post("/alerts/{number}/comment")
def comment(request: Request, context: Shared, form: EngineerForm, number: Number) -> Response:
    """Comment on an alert."""
    return _act(request, context, form, number, act=operations.add_comment, name="comment")


@router.post("/alerts/{number}/assign")
def assign(request: Request, context: Shared, form: EngineerForm, number: Number) -> Response:
    """Assign an alert to somebody, or to nobody."""
    return _act(
        request,
        context,
        form,
        number,
        act=operations.assign,
        name="assign",
        assignee=form.text("assignee")[:200] or None,
    )


@router.post("/alerts/{number}/shelve")
def shelve(request: Request, context: Shared, form: EngineerForm, number: Number) -> Response:
    """Shelve an alert for one of the times that the page offers."""
    hours = next((hours for hours, _ in _SHELVES if str(hours) == form.text("hours")), 0)
    return _act(request, context, form, number, act=operations.shelve, name="shelve", hours=hours)


@router.post("/alerts/{number}/unshelve")
def unshelve(request: Request, context: Shared, form: EngineerForm, number: Number) -> Response:
    """End the shelving of an alert."""
    return _act(request, context, form, number, act=operations.unshelve, name="unshelve")


@router.post("/alerts/{number}/close")
def close(request: Request, context: Shared, form: EngineerForm, number: Number) -> Response:
    """Clear an alert whose cause was removed."""
    return _act(request, context, form, number, act=operations.close, name="close")


@router.post("/alerts/{number}/verdict")
def verdict(request: Request, context: Shared, form: EngineerForm, number: Number) -> Response:
    """Record what the workshop found and did, and request a new baseline if required."""
    is_new_baseline = form.text("new_baseline") == "yes"

    def act() -> None:
        operations.add_verdict(
            context.store,
            number,
            verdict=form.text("verdict"),
            part=_text(form, "part"),
            action=_text(form, "action"),
            is_new_baseline=is_new_baseline,
            who=form.person.name,
            now=context.clock(),
        )

    name = "baseline" if is_new_baseline else "verdict"
    return _after(request, context, form, number, act=act, name=name)


@router.post("/alerts/{number}/work-order")
def send(request: Request, context: Shared, form: EngineerForm, number: Number) -> Response:
    """Send the work order of an alert through the webhooks of the site file."""

    def act() -> None:
        send_order(context, number, who=form.person.name)

    return _after(request, context, form, number, act=act, name="work-order")


def _act(
    request: Request,
    context: Context,
    form: Form,
    number: int,
    *,
    act: Callable[..., object],
    name: str,
    **options: Any,
) -> Response:
    """Apply an operator action of `sprung.online.monitor.operations` with the comment of a form."""

    def applied() -> None:
        act(
            context.store,
            number,
            who=form.person.name,
            comment=_text(form, "comment"),
            now=context.clock(),
            **options,
        )

    return _after(request, context, form, number, act=applied, name=name)


def _after(
    request: Request, context: Context, form: Form, number: int, *, act: Callable[[], object], name: str
) -> Response:
    """Return to the alert after an action; with what was entered, and a sentence, if it is impossible."""
    try:
        act()
    except ParameterError as error:
        if context.store.alerts.row(number) is None:
            raise
        return _alert_page(request, context, form.person, number, trouble=str(error), given=form.fields)
    return RedirectResponse(f"/alerts/{number}?done={name}", 303)


def _alert_page(
    request: Request,
    context: Context,
    person: Person,
    number: int,
    *,
    notice: str = "",
    trouble: str = "",
    given: dict[str, str] | None = None,
) -> Response:
    """Return the page of an alert."""
    detail = views.alert_detail(context, number)
    evidence = alert_views.evidence_of(context, number)
    alert = detail.alert
    head, rest = _clauses(alert.text, is_finding=bool(evidence.advice))
    if not head.startswith(alert.vehicle):  # names stay as they are
        head = head[:1].upper() + head[1:]
    may_act = person.role.includes(Role.ENGINEER)
    return page(
        request,
        "alert.html",
        status=409 if trouble else 200,
        section="/alerts",
        notice=notice,
        trouble=trouble,
        given=given or {},
        alert=alert,
        head=head,
        rest=rest,
        step=_step(alert.severity),
        detail=detail,
        facts=_facts(detail),
        acknowledged=_acknowledged(detail),
        history=_folded(detail.history),
        evidence=evidence,
        course=course_of(evidence.course, evidence.threshold),
        best=max((each.log_evidence for each in evidence.hypotheses), default=0.0),
        of_suspension=is_of_suspension(alert.cause),
        is_of_vehicle=alert.vehicle != MONITOR and alert.cause.partition(":")[0] != "monitor",
        may_act=may_act,
        me=person.name,
        names=[account.name for account in context.store.accounts.all()] if may_act else [],
        parts=[in_words(name) for name in evidence.detectable],
        shelves=_SHELVES,
        has_webhook=bool(context.site.send.webhook),
        state_signs=_MARKS,
        in_words=in_words,
        verdicts=operations.VERDICTS,
        n_before=alert_views.BEFORE,
        n_since=alert_views.SINCE,
    )


def _sentence(counts: AlertCounts) -> str:
    """Return the number of open alerts in words."""
    waiting = counts.states["unacknowledged"] + counts.states["returned to normal, unacknowledged"]
    if not any(counts.states[name] for name in STATES[:-1]):
        return "No alert is open."
    parts = [f"{counted(waiting, 'alert') if waiting else 'No alert'} {'needs' if waiting < 2 else 'need'} attention."]
    for number, word in ((counts.states["acknowledged"], "acknowledged"), (counts.states["shelved"], "shelved")):
        if number:
            parts.append(f"{number} {'is' if number == 1 else 'are'} {word}.")
    return " ".join(parts)


def _clauses(text: str, *, is_finding: bool) -> tuple[str, str]:
    """Return the sentence of an alert with what to do, and what else it states."""
    clauses = text.split("; ")
    n_head = 2 if is_finding else len(clauses)
    head, rest = "; ".join(clauses[:n_head]), "; ".join(clauses[n_head:])
    return head, rest[:1].upper() + rest[1:]


def _facts(detail: AlertDetail) -> list[tuple[str, str]]:
    """Return the plain values in the evidence of an alert that is not of the suspension."""
    if is_of_suspension(detail.alert.cause):
        return []
    plain = {name: value for name, value in detail.evidence.items() if isinstance(value, str | float) and value != ""}
    return [(in_words(name), str(value)) for name, value in plain.items()]


def _acknowledged(detail: AlertDetail) -> tuple[int, str] | None:
    """Return when and by whom an alert was acknowledged since it was raised; None if it was not."""
    events = (
        (entry.time, entry.who)
        for entry in reversed(detail.history)
        if entry.what == "acknowledged" and entry.time >= detail.alert.raised
    )
    return next(events, None)


def _folded(history: Sequence[HistoryEntry]) -> list[tuple[int, HistoryEntry]]:
    """Return the entries of a history, the last first; of consecutive updates only the last one, and how many."""
    folded: list[tuple[int, HistoryEntry]] = []
    for entry in reversed(history):
        if folded and folded[-1][1].what == entry.what == "updated":
            folded[-1] = folded[-1][0] + 1, folded[-1][1]
        else:
            folded.append((1, entry))
    return folded


def _step(severity: int) -> str:
    """Return the step of a severity."""
    return STEPS[severity_step(severity)]


def _text(form: Form, name: str) -> str:
    """Return a text of a form.

    Raises
    ------
    ParameterError
        If it is too long.
    """
    text = form.text(name)
    if len(text) > _LONGEST:
        raise ParameterError(f"{name} has {len(text)} characters, but may have {_LONGEST}: shorten it")
    return text
