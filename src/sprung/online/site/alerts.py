"""The list of alerts, and what became of them: precision, times to repair, ways driven since; interface and pages."""

from collections import Counter
from collections.abc import Sequence
from statistics import median
from typing import Annotated, Literal, TypeAlias

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field
from scipy.special import betaincinv

from sprung.online.monitor import MONITOR
from sprung.online.monitor.histories import LEARN, MILEAGE, driven_since
from sprung.online.monitor.operations import VERDICTS
from sprung.online.site.accounts import Viewer
from sprung.online.site.rendering import filter_link, page, with_others
from sprung.online.site.shared import LIMITS, Answer, Context, Shared, Wanted, column_number, parse_cursor
from sprung.online.store import AlertFilter, AlertPlace, Store, VerdictRow
from sprung.results.documents.monitoring import AlertEntry
from sprung.results.tables import counted
from sprung.state import STEPS, WATCHING, AlertState, StepName, severity_step, time_of

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


#: Verdicts after which something was wrong, and after which something was looked at.
_RIGHT = ("confirmed", "another part")
#: Share of a distribution outside each end of a 95 % interval.
TAIL = 0.025
#: Verdicts on the page, the last first.
_N_SHOWN = 20


class Share(Answer):
    """A share with its 95 % interval."""

    hits: int
    of: int
    value: float | None = Field(description="null without a verdict")
    interval: tuple[float, float] = Field(description="95 %, Clopper and Pearson")


class Delay(Answer):
    """Times between two events [ns]."""

    number: int
    median: int
    shortest: int
    longest: int


class Precision(Answer):
    """Precision of the alerts of the suspension and of sensors, from the verdicts of the workshop."""

    verdicts: dict[str, int] = Field(description="number of alerts by the last verdict on each")
    alert: Share = Field(description="alerts that were right: confirmed or another part, of those looked at")
    part: Share = Field(description="alerts that named the part: confirmed, of those looked at")
    onset_to_alert: Delay | None
    alert_to_repair: Delay | None
    onset_to_repair: Delay | None


class AlertOutcome(Answer):
    """What the workshop found because of an alert, and how the vehicle has driven since."""

    alert: int
    vehicle: str
    text: str
    verdict: str
    part: str = Field(description="part that was found instead; empty: none")
    action: str
    time: int = Field(description="time of the verdict, UTC ns")
    who: str
    distance: float | None = Field(description="way driven since in windows that state a speed [m]; null: none")
    is_back: bool = Field(description="whether the cause was raised again since")


class ResetEntry(Answer):
    """A reset of a vehicle after maintenance, from which a new baseline is learnt."""

    vehicle: str
    time: int = Field(description="UTC ns")
    who: str
    reason: str
    mileage: float | None = Field(description="[km]; null: not stated")


class Outcomes(Answer):
    """What came of the alerts of the suspension and of sensors."""

    precision: Precision
    resets: tuple[ResetEntry, ...] = Field(description="last resets of vehicles, the latest first")
    alerts: tuple[AlertOutcome, ...] = Field(description="last verdicts, the latest first")


@api.get("/precision")
def site_precision(context: Shared, _: Viewer) -> Precision:
    """Precision of the alerts and times to repair, from the verdicts of the workshop."""
    return precision(context.store)


@api.get("/outcomes")
def outcomes(context: Shared, _: Viewer) -> Outcomes:
    """What came of alerts: the last verdicts of the workshop, and the way that the vehicles have driven since."""
    judged = [verdict for verdict, cause in context.store.verdicts.judged() if cause.partition(":")[0] not in WATCHING]
    last = sorted(judged, key=lambda verdict: verdict.time, reverse=True)[:_N_SHOWN]
    rows = context.store.alerts.rows({verdict.alert for verdict in last})
    return Outcomes(
        precision=precision(context.store),
        resets=_resets(context.store),
        alerts=tuple(_outcome(context, rows[verdict.alert], verdict) for verdict in last),
    )


@pages.get("/outcomes")
def show_outcomes(request: Request, context: Shared, person: Viewer) -> Response:
    """Show what came of alerts."""
    return page(request, "outcomes.html", section="/outcomes", found=outcomes(context, person), right=_RIGHT)


def _outcome(context: Context, alert: AlertState, verdict: VerdictRow) -> AlertOutcome:
    """Return what came of an alert."""
    return AlertOutcome(
        **{name: getattr(verdict, name) for name in ("alert", "verdict", "part", "action", "time", "who")},
        vehicle=alert.vehicle,
        text=alert.sentence,
        distance=driven_since(context.store, alert.vehicle, verdict.time, limit=LIMITS.max_windows),
        is_back=alert.raised > verdict.time,
    )


def _resets(store: Store) -> tuple[ResetEntry, ...]:
    """Return the last resets of vehicles."""
    stated = {(row.subject, row.time): row.detail for row in store.requests.audited(act=MILEAGE)}
    return tuple(
        ResetEntry(
            vehicle=row.subject,
            time=row.time,
            who=row.who,
            reason=str(row.detail or ""),
            mileage=stated.get((row.subject, row.time)),
        )
        for row in reversed(store.requests.audited(act=LEARN, limit=_N_SHOWN))
    )


def precision(store: Store) -> Precision:
    """Return the precision of a site's alerts, and the times from onset to alert to repair.

    Parameters
    ----------
    store
        Store of the monitor.

    Notes
    -----
    An alert counts once for each time that it was raised, with the last verdict on it; one that nobody looked at does
    not count. Alerts about monitoring itself (a silent vehicle, the monitor) are left out. A repair is a verdict
    "confirmed" or "another part" that states what was done or requests a new baseline; its time is that of the verdict.
    An onset is the start of the change as the evidence has it, and is unknown for sensors and for recordings without a
    date.
    """
    judged = [verdict for verdict, cause in store.verdicts.judged() if cause.partition(":")[0] not in WATCHING]
    counts = Counter(verdict.verdict for verdict in judged)
    looked_at = len(judged) - counts["not looked at"]
    right = [verdict for verdict in judged if verdict.verdict in _RIGHT]
    rows = store.alerts.rows({verdict.alert for verdict in right})
    onsets = {verdict.id: _onset(store, rows[verdict.alert], verdict) for verdict in right}
    repaired = [verdict for verdict in right if verdict.action or verdict.request is not None]
    return Precision(
        verdicts={name: counts[name] for name in VERDICTS},
        alert=share(len(right), looked_at),
        part=share(counts["confirmed"], looked_at),
        onset_to_alert=_delay([(onsets[verdict.id], verdict.raised) for verdict in right]),
        alert_to_repair=_delay([(verdict.raised, verdict.time) for verdict in repaired]),
        onset_to_repair=_delay([(onsets[verdict.id], verdict.time) for verdict in repaired]),
    )


def share(hits: int, of: int) -> Share:
    """Return a share with its exact 95 % interval.

    Parameters
    ----------
    hits
        Number of hits, 0 to `of`.
    of
        Number of trials.

    Notes
    -----
    The ends p of the interval of k hits in n trials are those at which a binomial variable is at least k, or at most k,
    with probability 2.5 %: quantiles of beta distributions. It covers the true share with at least 95 %, however few
    the trials; without a trial it is 0 to 1.

    References
    ----------
    C. J. Clopper, E. S. Pearson, The use of confidence or fiducial limits illustrated in the case of the binomial,
    Biometrika 26 (1934) 404-413.

    Examples
    --------
    >>> low, high = share(0, 20).interval
    >>> f"{100 * low:.1f} to {100 * high:.1f} %"
    '0.0 to 16.8 %'
    """
    low = float(betaincinv(hits, of - hits + 1, TAIL)) if hits else 0.0
    high = float(betaincinv(hits + 1, of - hits, 1 - TAIL)) if hits < of else 1.0
    return Share(hits=hits, of=of, value=hits / of if of else None, interval=(low, high))


def _onset(store: Store, alert: AlertState, verdict: VerdictRow) -> int | None:
    """Return the onset of what a verdict is about; None if it is unknown."""
    if alert.raised == verdict.raised:
        return alert.onset
    entries = store.results.findings(alert.vehicle, until=verdict.time, limit=LIMITS.max_findings)
    documents = (entry.document for entry in reversed(entries))
    of_cause = (each for each in documents if f"{each.get('corner')}.{each.get('component')}" == alert.cause)
    return time_of(next(of_cause, {}).get("since"))


def _delay(spans: Sequence[tuple[int | None, int]]) -> Delay | None:
    """Return the times between two events, of those that are known and in order; None without any."""
    times = [end - begin for begin, end in spans if begin is not None and end >= begin]
    if not times:
        return None
    return Delay(number=len(times), median=round(median(times)), shortest=min(times), longest=max(times))
