"""The evidence behind an alert: change, hypotheses, course over the windows, and the windows themselves."""

from collections.abc import Sequence
from math import exp
from typing import NamedTuple

import numpy as np
from pydantic import Field

from sprung.online.site.shared import Answer, Context, finite
from sprung.online.store import Entry
from sprung.state import TIME_ROUNDING, AlertState, interval_95
from sprung.vehicles import Component

#: Largest number of windows behind an alert: since the onset, and before it.
SINCE = 20
BEFORE = 5
#: Size of the chart of the evidence, and of its margins.
WIDTH = 600
HEIGHT = 240
LEFT = 48
RIGHT = 16
TOP = 16
BOTTOM = 40


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
    before = observations(alert.vehicle, until=since - 1, limit=BEFORE)
    after = observations(alert.vehicle, since=since, until=alert.cleared, limit=SINCE)
    windows = [*((entry, False) for entry in before), *((entry, True) for entry in after)]
    return tuple(_window(entry, alert, is_since=is_since) for entry, is_since in windows)


def _first_with_fault(context: Context, alert: AlertState) -> int:
    """Return the start of the first of the windows before an alert that show its fault, UTC ns.

    Samples may be older than the alert by any time, as those of a box that was offline.
    """
    channel, first = alert.cause.removeprefix("sensor:"), alert.raised
    for entry in reversed(context.store.results.observations(alert.vehicle, until=alert.raised, limit=SINCE)):
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
        note=document.get("reason") or "; ".join(faults),
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
    across = (WIDTH - LEFT - RIGHT) / max(1, len(points) - 1)

    def height(value: float) -> float:
        return TOP + (HEIGHT - TOP - BOTTOM) * (high - value) / (high - low)

    # The first round distance that needs at most five marks.
    step = next(step for k in range(9) for step in (10**k, 2 * 10**k, 5 * 10**k) if (high - low) / step <= 5)
    first = -(-int(low) // step) * step
    return Course(
        dots=tuple(
            Dot(LEFT + across * k, height(point.log_evidence), point.log_evidence >= threshold, point)
            for k, point in enumerate(points)
        ),
        threshold=height(threshold),
        marks=tuple((height(number), number) for number in range(first, int(high) + 1, step)),
    )
