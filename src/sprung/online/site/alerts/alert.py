"""One alert: its page with evidence and history, and the actions of people on it."""

from collections.abc import Callable, Sequence
from typing import Any, Literal

from fastapi import APIRouter, Request
from fastapi.responses import JSONResponse, RedirectResponse, Response
from pydantic import Field

from sprung.errors import ParameterError
from sprung.online.monitor import MONITOR, operations
from sprung.online.monitor.operations import require_alert, send_work_order, work_order
from sprung.online.site.access import Engineer, EngineerForm, Form, Viewer
from sprung.online.site.accounts import Person, Role
from sprung.online.site.alerts.evidence import BEFORE, SINCE, Evidence, course_of, evidence_of
from sprung.online.site.alerts.lists import STATES
from sprung.online.site.rendering import page
from sprung.online.site.shared import Answer, Context, Done, Given, Line, Number, Outcome, Shared, Text
from sprung.results.documents import WorkOrderDocument, document_text
from sprung.results.documents.monitoring import AlertEntry, HistoryEntry
from sprung.results.tables.table import in_words

api = APIRouter(tags=["alerts"])
pages = APIRouter(include_in_schema=False)

VerdictWord = Literal["confirmed", "another part", "nothing found", "not looked at"]
#: Actions that take a comment alone, and what each does.
_COMMENTED: dict[str, tuple[Callable[..., None], str]] = {
    "acknowledge": (operations.acknowledge, "Acknowledge an alert."),
    "comment": (operations.add_comment, "Comment on an alert."),
    "unshelve": (operations.unshelve, "End the shelving of an alert."),
    "close": (operations.close, "Clear an alert whose cause was removed."),
}
#: Durations for which an alert can be shelved [h], in words.
_SHELVES = {8: "8 hours", 24: "1 day", 72: "3 days", 168: "1 week", 720: "30 days"}
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
#: Longest text of a form.
_MAX_TEXT = 4000


class VerdictEntry(Answer):
    """A verdict of the workshop on an alert."""

    id: int
    alert: int
    time: int
    who: str
    verdict: VerdictWord
    part: str
    action: str
    request: int | None = Field(description="number of the request for a new baseline")


class AlertDetail(Answer):
    """An alert with its evidence, history and verdicts."""

    alert: AlertEntry
    evidence: dict[str, Any]
    history: tuple[HistoryEntry, ...]
    verdicts: tuple[VerdictEntry, ...]


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

    verdict: VerdictWord
    part: Line = ""
    action: Text = ""
    new_baseline: bool = False


@api.get("/alerts/{number}")
def alert_detail(context: Shared, _: Viewer, number: Number) -> AlertDetail:
    """An alert with its evidence, history and verdicts."""
    state = require_alert(context.store, number)
    store = context.store
    return AlertDetail(
        alert=AlertEntry(**state.as_entry()),
        evidence=dict(state.evidence),
        history=tuple(HistoryEntry.model_validate(each, from_attributes=True) for each in store.alerts.history(number)),
        verdicts=tuple(VerdictEntry.model_validate(each) for each in store.verdicts.all(alerts=[number])),
    )


@api.get("/alerts/{number}/evidence")
def evidence(context: Shared, _: Viewer, number: Number) -> Evidence:
    """The evidence behind an alert: change, hypotheses, course of the evidence, windows."""
    return evidence_of(context, require_alert(context.store, number))


def _add_commented_action(name: str) -> None:
    """Add the route of an action that takes a comment alone."""
    act, meaning = _COMMENTED[name]

    def route(context: Shared, person: Engineer, number: Number, given: Comment) -> AlertDetail:
        act(context.store, number, **_by(context, person, given.comment))
        return alert_detail(context, person, number)

    api.post(f"/alerts/{{number}}/{name}", name=name, description=meaning)(route)


for _name in _COMMENTED:
    _add_commented_action(_name)


@api.post("/alerts/{number}/assign")
def assign(context: Shared, person: Engineer, number: Number, given: Assignment) -> AlertDetail:
    """Assign an alert to a person, or to nobody."""
    operations.assign(context.store, number, assignee=given.assignee, **_by(context, person, given.comment))
    return alert_detail(context, person, number)


@api.post("/alerts/{number}/shelve")
def shelve(context: Shared, person: Engineer, number: Number, given: Shelf) -> AlertDetail:
    """Shelve an alert for some hours."""
    operations.shelve(context.store, number, hours=given.hours, **_by(context, person, given.comment))
    return alert_detail(context, person, number)


@api.post("/alerts/{number}/verdict")
def verdict(context: Shared, person: Engineer, number: Number, given: WorkshopVerdict) -> AlertDetail:
    """Record what the workshop found and did, and learn a new baseline if requested."""
    operations.add_verdict(
        context.store,
        number,
        verdict=given.verdict,
        part=given.part,
        action=given.action,
        is_new_baseline=given.new_baseline,
        who=person.name,
        now=context.clock(),
    )
    return alert_detail(context, person, number)


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
def act_by_form(
    request: Request,
    context: Shared,
    form: EngineerForm,
    number: Number,
    action: Literal["acknowledge", "comment", "unshelve", "close", "assign", "shelve", "verdict", "work-order"],
) -> Response:
    """Act on an alert, and return to it; with what was entered, and a sentence, if the action is impossible."""
    try:
        done = _act(context, form, number, action)
    except ParameterError as error:
        if context.store.alerts.row(number) is None:
            raise
        return _page(request, context, form.person, number, problem=str(error), given=form.fields)
    return RedirectResponse(f"/alerts/{number}?done={done}", 303)


def _act(context: Context, form: Form, number: int, action: str) -> str:
    """Act on an alert as a form says, and return the word of the result."""
    for name in ("comment", "part", "action"):
        if len(form.text(name)) > _MAX_TEXT:
            raise ParameterError(f"{name} has {len(form.text(name))} characters, but may have {_MAX_TEXT}: shorten it")
    by = _by(context, form.person, form.text("comment"))
    if action == "work-order":
        send_order(context, form.person, number)
    elif action == "verdict":
        fields: dict[str, Any] = {name: form.text(name) for name in ("verdict", "part", "action")}
        given = WorkshopVerdict.model_construct(**fields, new_baseline=form.text("new_baseline") == "yes")
        verdict(context, form.person, number, given)
        return "baseline" if given.new_baseline else "verdict"
    elif action == "assign":
        operations.assign(context.store, number, assignee=form.text("assignee")[:200] or None, **by)
    elif action == "shelve":
        hours = next((hours for hours in _SHELVES if str(hours) == form.text("hours")), 0)
        operations.shelve(context.store, number, hours=hours, **by)
    else:
        _COMMENTED[action][0](context.store, number, **by)
    return action


def _by(context: Context, person: Person, comment: str) -> dict[str, Any]:
    """Return who acts when, and with which comment."""
    return {"who": person.name, "comment": comment, "now": context.clock()}


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
        course=course_of(found.course, found.threshold),
        is_of_vehicle=state.vehicle != MONITOR and state.cause.partition(":")[0] != "monitor",
        may_act=may_act,
        names=[account.name for account in context.store.accounts.all()] if may_act else [],
        shelves=_SHELVES.items(),
        has_webhook=bool(context.site.send.webhook),
        state_signs=STATES,
        in_words=in_words,
        verdicts=operations.VERDICTS,
        n_before=BEFORE,
        n_since=SINCE,
    )


def _folded(history: Sequence[HistoryEntry]) -> list[tuple[int, HistoryEntry]]:
    """Return the entries of a history, the last first; of consecutive updates only the last one, and how many."""
    folded: list[tuple[int, HistoryEntry]] = []
    for entry in reversed(history):
        if folded and folded[-1][1].what == entry.what == "updated":
            folded[-1] = folded[-1][0] + 1, folded[-1][1]
        else:
            folded.append((1, entry))
    return folded
