"""The state of an alert: the facts behind it, read once."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal, TypeAlias, get_args

from pydantic import BaseModel

from sprung._checks import check_number
from sprung.diagnosis import SEVERITIES, Hypothesis
from sprung.errors import ParameterError
from sprung.results.documents.monitoring import AlertEntry
from sprung.vehicles import Component

#: Names of the five steps of severity, each of 200: note from 1, low from 201, critical from 801 to 1000.
StepName: TypeAlias = Literal["note", "low", "medium", "high", "critical"]
STEPS: tuple[StepName, ...] = get_args(StepName)
STEP_SIZE = 200
#: Causes that concern monitoring and not the vehicle.
WATCHING = ("silent", "lost", "monitor")
#: Weight of alerts of sensors in the health index; those of the suspension have 1.
SENSOR_WEIGHT = 1 / 3
#: Times above this are counted from 1970 [s]: those of a recording without a date are not.
_DATED = 1e8


@dataclass(frozen=True, slots=True)
class AlertState:
    """Alert of one cause on one vehicle, as it is stored, changed and shown. Times are UTC ns.

    Parameters
    ----------
    vehicle, cause
        Name of the vehicle, and what the alert is about: "front_left.spring", "sensor:acc_fl", "silent".
    severity
        Severity, 1 to 1000.
    text
        Sentence for people, with the smallest detectable change where it is known.
    raised
        Time when it last became active; if it never did, time of its first report.
    is_active, is_acknowledged
        Whether the cause holds now, and whether an operator has acknowledged it; also true if it never was active.
    shelved_until
        End of the shelving, until which nobody is notified; None if it is not shelved.
    cleared, count
        Time when it last became inactive, None while it is active and before it ever was; and how often it became
        active: 0 during its first hold-off, when no list of alerts should show it.
    assignee
        Name of the person responsible; None: nobody.
    evidence
        Plain values behind the alert: the document of its finding and of the change test.
    updated
        Time of the last change.
    streak
        Number of consecutive windows that contradict `is_active`: reports of an inactive alert, absences of an active
        one.
    worst
        Highest severity since `raised`. Only a severity at least a step above it is notified again, so that a severity
        that varies between two steps is notified once.
    notified
        Time of the last notification since `raised`; None before the first.
    number
        Number of the alert, which the store gives; 0 before.
    """

    vehicle: str
    cause: str
    severity: int
    text: str
    raised: int
    is_active: bool = True
    is_acknowledged: bool = False
    shelved_until: int | None = None
    cleared: int | None = None
    count: int = 1
    assignee: str | None = None
    evidence: Mapping[str, Any] = field(default_factory=dict, hash=False)
    updated: int = 0
    streak: int = 0
    worst: int = 0
    notified: int | None = None
    number: int = 0

    def __post_init__(self) -> None:
        check_alert(self.vehicle, self.cause, self.severity)

    @property
    def is_shelved(self) -> bool:
        """Whether it is shelved: nobody is notified until the shelving ends."""
        return self.shelved_until is not None

    @property
    def state(self) -> str:
        """State in the terms of ISA-18.2; "shelved" takes precedence.

        Examples
        --------
        >>> from dataclasses import replace
        >>> alert = AlertState("bus-17", "front_left.spring", 700, "softer", raised=0)
        >>> alert.state, replace(alert, is_acknowledged=True).state, replace(alert, shelved_until=60).state
        ('unacknowledged', 'acknowledged', 'shelved')
        """
        if self.is_shelved:
            return "shelved"
        if self.is_active:
            return "acknowledged" if self.is_acknowledged else "unacknowledged"
        return "normal" if self.is_acknowledged else "returned to normal, unacknowledged"

    @property
    def step(self) -> str:
        """Step of the severity, of `STEPS`."""
        return STEPS[severity_step(self.severity)]

    @property
    def is_of_suspension(self) -> bool:
        """Whether the cause is a change of the suspension."""
        return is_of_suspension(self.cause)

    @property
    def impact(self) -> float:
        """Severity, weighted: a third for sensors, none for what only concerns monitoring."""
        if self.is_of_suspension:
            return self.severity
        return 0.0 if self.cause.partition(":")[0] in WATCHING else SENSOR_WEIGHT * self.severity

    @property
    def sentence(self) -> str:
        """The finding in plain words; without a finding, the text."""
        return str(self.evidence.get("sentence") or self.text)

    @property
    def change(self) -> float | None:
        """Relative change; None without a size."""
        return self.evidence.get("change")

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % interval of the change, in order; None without one."""
        ends = self.evidence.get("interval")
        low, high = sorted(map(float, ends)) if ends else (None, None)
        return None if low is None or high is None else (low, high)

    @property
    def onset(self) -> int | None:
        """Start of the change; None if it is unknown."""
        return time_of(self.evidence.get("since"))

    @property
    def onset_interval(self) -> tuple[int, int] | None:
        """Earliest and latest onset; None if they are unknown."""
        first, last = map(time_of, self.evidence.get("since_interval") or (None, None))
        return None if first is None or last is None else (first, last)

    @property
    def runner_up(self) -> str | None:
        """Second hypothesis in words; None if it is far less likely."""
        return self.evidence.get("runner_up") or None

    @property
    def advice(self) -> str | None:
        """What to do; None without a finding."""
        return self.evidence.get("advice") or None

    @property
    def urgency(self) -> str:
        """What to do, without a finding as findings of that severity state it."""
        by_step = {word: advice for _, word, _, advice in SEVERITIES}
        return self.advice or by_step.get(self.step, SEVERITIES[-1][3])

    @property
    def detectable(self) -> dict[str, float]:
        """Smallest detectable loss of each part in the change test behind it; empty if unknown."""
        return dict(self.evidence.get("detectable") or {})

    @property
    def place(self) -> tuple[str | None, str]:
        """Corner and part; None for a part that belongs to no corner."""
        if self.is_of_suspension:
            corner, _, part = self.cause.rpartition(".")
            return corner or None, part
        kind, _, channel = self.cause.partition(":")
        return None, f"sensor {channel}" if kind == "sensor" else "measuring box"

    @property
    def name(self) -> str:
        """The cause in words: "rear-right damper", "sensor acc_fl", "silent"."""
        if not self.is_of_suspension:
            return self.cause.replace("sensor:", "sensor ", 1)
        corner, part = self.place
        return f"{(corner or '').replace('_', '-')} {part.replace('_', ' ')}".strip()

    def names(self, components: Sequence[Component]) -> tuple[Component, ...]:
        """Return those components that the cause names."""
        corner, dot, kind = self.cause.partition(".")
        return tuple(Hypothesis("", corner, kind).parts(tuple(components))) if dot else ()

    def facts(self, document: type[BaseModel]) -> dict[str, Any]:
        """Return those fields of a published document that are facts of the alert."""
        return {name: getattr(self, name) for name in document.model_fields if hasattr(self, name)}

    def as_entry(self) -> dict[str, Any]:
        """Return the alert as in `sprung.alerts/1`."""
        return self.facts(AlertEntry)


def health_index(alerts: Iterable[AlertState]) -> float:
    """Return the health of a vehicle from 0 (inspect first) to 100 (no active alert).

    Notes
    -----
    100 - max(w severity / 10) over the active alerts, with w = 1 for the suspension, 1/3 for sensors, and 0 for what
    only concerns monitoring ("silent", "lost", "monitor"). A critical change (900) gives 10, a dead sensor of severity
    600 gives 80.

    The index ranks vehicles for planning only: it neither raises nor clears alerts. A shelved or acknowledged alert
    counts like any other, as neither repairs the vehicle. For a vehicle that is silent or could not be assessed, 100
    means an unknown state, not a healthy one.

    Examples
    --------
    >>> health_index([])
    100.0
    """
    return 100.0 - max((alert.impact / 10 for alert in alerts if alert.is_active), default=0.0)


def severity_step(severity: int) -> int:
    """Return the step of a severity in `STEPS`: 0 for 1 to 200, 4 for 801 to 1000.

    Examples
    --------
    >>> STEPS[severity_step(700)], severity_step(1), severity_step(1000)
    ('high', 0, 4)
    """
    return (severity - 1) // STEP_SIZE


def is_of_suspension(cause: str) -> bool:
    """Return whether a cause is a change of the suspension, rather than of a sensor ("sensor:acc_fl") or monitoring.

    Examples
    --------
    >>> [is_of_suspension(cause) for cause in ("front_left.spring", "sensor:acc_fl", "silent")]
    [True, False, False]
    """
    return ":" not in cause and cause not in WATCHING


def time_of(seconds: Any) -> int | None:
    """Return a time of the windows' clock [s] as UTC ns; None if it does not count from 1970.

    Examples
    --------
    >>> time_of(600.0), time_of(1.79e9)
    (None, 1790000000000000000)
    """
    is_dated = isinstance(seconds, int | float) and seconds >= _DATED
    return round(seconds * 1e9) if is_dated else None


def check_alert(vehicle: str, cause: str, severity: int) -> None:
    """Refuse an alert without vehicle or cause, and a severity out of range.

    Raises
    ------
    ParameterError
        If a name is empty, or the severity is below 1 or above 1000.
    """
    if not vehicle or not cause:
        raise ParameterError(f"vehicle {vehicle!r} and cause {cause!r} must not be empty: name both")
    check_number("severity", severity, at_least=1, at_most=1000)
