"""Lists of alerts, and the evidence behind one, from the store: values, no markup."""

from collections.abc import Mapping, Sequence
from math import exp, isfinite
from typing import Any, Literal, TypeAlias

import numpy as np
from pydantic import BaseModel, ConfigDict, Field

from sprung.errors import ParameterError
from sprung.online.alerts import STEPS
from sprung.online.monitor.histories import alert_state
from sprung.online.site.context import Context
from sprung.online.site.models import Alerts, Answer
from sprung.online.store import AlertFilter, AlertPlace, AlertRow, Entry
from sprung.results.documents.monitoring import AlertEntry
from sprung.state import TIME_ROUNDING, AlertState, interval_95
from sprung.vehicles import Component

#: States in the terms of ISA-18.2, those that require action first.
StateName: TypeAlias = Literal[
    "unacknowledged", "acknowledged", "returned to normal, unacknowledged", "shelved", "normal"
]
STATES: tuple[StateName, ...] = (
    "unacknowledged",
    "acknowledged",
    "returned to normal, unacknowledged",
    "shelved",
    "normal",
)
StepName: TypeAlias = Literal["note", "low", "medium", "high", "critical"]
#: Largest number of windows behind an alert: since the onset, and before it.
SINCE, BEFORE = 20, 5
#: Pattern of the place after which a page of alerts begins.
CURSOR = r"^[0-9]{1,4}~[0-8]?[0-9]{1,18}~[0-8]?[0-9]{1,18}$"


class WantedAlerts(BaseModel):
    """Which alerts are listed; the address of the page states it."""

    model_config = ConfigDict(frozen=True)

    state: list[StateName] = Field([], description="states; empty: all but normal")
    step: list[StepName] = Field([], description="steps of severity; empty: all")
    vehicle: str = Field("", max_length=64, description="part of the vehicle's name")
    assignee: str | None = Field(None, max_length=200, description="assignee")
    is_complete: bool = Field(False, description="whether to include alerts that have returned to normal")


class AlertCounts(Answer):
    """Numbers of alerts by state, and of those that are not normal by step of severity."""

    states: dict[str, int]
    steps: dict[str, int]


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
    note: str = Field(description="why the window gives no information on them; empty if it does")


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
    runner_up: str = Field(description="second hypothesis in words; empty: far less likely")
    advice: str
    detectable: dict[str, float] = Field(description="smallest detectable loss of each part")
    hypotheses: tuple[HypothesisEntry, ...] = Field(description="the most probable first")
    course: tuple[EvidencePoint, ...] = Field(description="evidence after the last windows")
    threshold: float | None = Field(description="ln of the evidence at which an alert is raised")
    windows: tuple[EvidenceWindow, ...] = Field(description="windows before the onset and since then")


def alert_page(context: Context, wanted: WantedAlerts, *, cursor: str | None = None, limit: int) -> Alerts:
    """Return alerts, the most severe first, from a cursor on."""
    after = None if cursor is None else _place(cursor)
    rows = context.store.alerts.page(_filter(wanted), after=after, limit=limit + 1)
    shown = rows[:limit]
    following = _cursor(shown[-1]) if len(rows) > limit else None
    return Alerts(alerts=tuple(AlertEntry(**alert_state(row).as_entry()) for row in shown), next=following)


def alert_counts(context: Context, wanted: WantedAlerts) -> AlertCounts:
    """Return the numbers of alerts, with the filter for vehicle and assignee but not for state and step."""
    counts = context.store.alerts.counts(AlertFilter(vehicle=wanted.vehicle, assignee=wanted.assignee))
    return AlertCounts(
        states={name: sum(count for (state, _), count in counts.items() if state == name) for name in STATES},
        steps={
            name: sum(count for (state, number), count in counts.items() if number == step and state != "normal")
            for step, name in enumerate(STEPS)
        },
    )


def evidence_of(context: Context, number: int) -> Evidence:
    """Return what led to an alert.

    Raises
    ------
    ParameterError
        If no alert has that number.
    """
    row = context.store.alerts.row(number)
    if row is None:
        raise ParameterError(f"unknown alert {number}: see the list of alerts")
    alert = alert_state(row)
    detection = alert.evidence.get("detection") or {}
    return Evidence(
        is_active=alert.is_active,
        is_acknowledged=alert.is_acknowledged,
        change=alert.change,
        interval=alert.interval,
        since=alert.onset,
        since_interval=alert.onset_interval,
        runner_up=alert.runner_up,
        advice=alert.advice,
        detectable=alert.detectable,
        hypotheses=tuple(HypothesisEntry.model_validate(each) for each in detection.get("hypotheses", ())),
        course=tuple(
            EvidencePoint(time=round(time * 1e9), log_evidence=value)
            for time, value in zip(detection.get("times", ()), detection.get("evidence", ()), strict=True)
        ),
        threshold=detection.get("threshold"),
        windows=_windows(context, row, alert),
    )


def _windows(context: Context, row: AlertRow, alert: AlertState) -> tuple[EvidenceWindow, ...]:
    """Return the windows behind an alert of the suspension or of a sensor."""
    if not alert.is_of_suspension and not row.cause.startswith("sensor:"):
        return ()
    since = (_first_with_fault(context, row) if alert.onset is None else alert.onset) - TIME_ROUNDING
    observations = context.store.results.observations
    before = observations(row.vehicle, until=since - 1, limit=BEFORE)
    after = observations(row.vehicle, since=since, until=row.cleared, limit=SINCE)
    windows = [*((entry, False) for entry in before), *((entry, True) for entry in after)]
    return tuple(_window(entry, alert, is_since=is_since) for entry, is_since in windows)


def _first_with_fault(context: Context, row: AlertRow) -> int:
    """Return the start of the first of the windows before an alert that show its fault, UTC ns.

    Samples may be older than the alert by any time, as those of a box that was offline.
    """
    channel, first = row.cause.removeprefix("sensor:"), row.raised
    for entry in reversed(context.store.results.observations(row.vehicle, until=row.raised, limit=SINCE)):
        if all(each.get("channel") != channel for each in entry.document.get("sensor_faults") or ()):
            break
        first = entry.t0
    return first


def _window(entry: Entry, alert: AlertState, *, is_since: bool) -> EvidenceWindow:
    """Return a window with its values of the parts that an alert names."""
    document = entry.document
    conditions: Mapping[str, Any] = document.get("conditions") or {}
    names: Sequence[str] = document.get("components") or ()
    logs: Sequence[float] = document.get("log_ratios") or ()
    covariance: Sequence[Sequence[float]] = document.get("covariance") or ()
    named = set(map(str, alert.names([Component.parse(name) for name in names])))
    parts = tuple(
        _part(name, log_ratio, variances[k])
        for k, (name, log_ratio, variances) in enumerate(zip(names, logs, covariance, strict=False))
        if name in named
    )
    faults = [(each.get("channel"), each.get("kind", "")) for each in document.get("sensor_faults") or ()]
    note = document.get("reason") or "; ".join(f"{channel} {kind.replace('_', ' ')}" for channel, kind in faults)
    return EvidenceWindow(
        boot=entry.boot,
        number=entry.number,
        t0=entry.t0,
        is_since_onset=is_since,
        parts=parts,
        note=note,
        **{name: _finite(conditions.get(name)) for name in ("speed", "payload", "roughness", "temperature")},
    )


def _part(name: str, log_ratio: float, variance: float) -> PartEntry:
    """Return the value of a part with its interval."""
    low, high = 1 + interval_95(np.array(log_ratio), np.sqrt(max(variance, 0.0)))
    return PartEntry(name=name, value=exp(log_ratio), interval=(float(low), float(high)))


def _finite(value: Any) -> float | None:
    """Return a condition; None if it is unknown."""
    return float(value) if isinstance(value, int | float) and isfinite(value) else None


def _filter(wanted: WantedAlerts) -> AlertFilter:
    """Return the filter of the store."""
    states = tuple(wanted.state) or (() if wanted.is_complete else STATES[:-1])
    return AlertFilter(states, tuple(STEPS.index(name) for name in wanted.step), wanted.vehicle, wanted.assignee)


def _cursor(row: AlertRow) -> str:
    """Return the text of a place."""
    return f"{row.severity}~{row.raised}~{row.id}"


def _place(cursor: str) -> AlertPlace:
    """Return the place of a text.

    Raises
    ------
    ParameterError
        If it is not a cursor.
    """
    parts = cursor.split("~")
    if len(parts) != len(AlertPlace._fields) or not all(part.isdecimal() and int(part) < 2**63 for part in parts):
        raise ParameterError(f"cursor {cursor!r} is not one of this list: omit it for the first page")
    return AlertPlace(*map(int, parts))
