"""Alerts as values: one for each cause in a vehicle, in the terms of ANSI/ISA-18.2 (IEC 62682)."""

from dataclasses import dataclass, field, fields
from typing import Any, Literal

from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.state import AlertState

#: Changes of an alert. "pending": only the count of reports changed; "none": no change.
Change = Literal[
    "raised",
    "updated",
    "cleared",
    "acknowledged",
    "shelved",
    "unshelved",
    "assigned",
    "commented",
    "pending",
    "none",
]


@dataclass(frozen=True, slots=True)
class AlertSettings:
    """Delays after which alerts are raised, cleared and notified again.

    Parameters
    ----------
    raise_after
        Hold-off: consecutive reports before an alert is active, at least 1.
    clear_after
        Hysteresis: consecutive windows without a report before it clears, at least 1.
    renotify_after
        Time after which an active, unacknowledged alert is notified again [ns]; None: never.

    Raises
    ------
    ParameterError
        If a number is below 1, or a time is not above 0.
    """

    raise_after: int = 1
    clear_after: int = 3
    renotify_after: int | None = None

    def __post_init__(self) -> None:
        check_number("raise_after", self.raise_after, at_least=1, advice="1 raises at the first report")
        check_number("clear_after", self.clear_after, at_least=1, advice="1 clears at the first window without it")
        if self.renotify_after is not None:
            check_number("renotify_after", self.renotify_after, above=0, advice="None never notifies again")


@dataclass(frozen=True, slots=True)
class Report:
    """Report of one window on one cause.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    cause
        Identifier of the cause, the same every time: "front_left.spring", "sensor:acc_fl", "silent", "monitor".
    severity
        Severity, 1 to 1000, as in OPC 10000-110.
    text
        Sentence for people.
    evidence
        Plain values behind the report, such as numbers, intervals and addresses of windows.
    """

    vehicle: str
    cause: str
    severity: int
    text: str
    evidence: dict[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        _check(self.vehicle, self.cause, self.severity)


@dataclass(frozen=True, slots=True)
class Alert:
    """State of one cause in one vehicle. Times are UTC ns since 1970.

    Parameters
    ----------
    vehicle, cause, severity, text, evidence
        Contents of the last report, see `Report`; after clearing, of the last report while the alert was active.
    is_active
        Whether the cause holds now.
    is_acknowledged
        Whether an operator has acknowledged it; also true if it never was active.
    shelved_until
        End of the shelving, until which nobody is notified; None if it is not shelved.
    raised
        Time when it last became active; if it never did, time of its first report.
    updated
        Time of the last change.
    cleared
        Time when it last became inactive; None while it is active, and before it ever was.
    count
        Number of times it became active; 0 during its first hold-off, when no list of alerts should show it.
    assignee
        Name of the person responsible; None: nobody.
    streak
        Number of consecutive windows that contradict `is_active`: reports of an inactive alert, absences of an active
        one.
    worst
        Highest severity since `raised`. Only a severity at least a step above it is notified again, so that a severity
        that varies between two steps is notified once.
    notified
        Time of the last notification since `raised`; None before the first.
    """

    vehicle: str
    cause: str
    severity: int
    text: str
    is_active: bool
    is_acknowledged: bool
    shelved_until: int | None
    raised: int
    updated: int
    cleared: int | None
    count: int
    assignee: str | None
    streak: int
    evidence: dict[str, Any] = field(default_factory=dict, hash=False)
    worst: int = 0
    notified: int | None = None

    def __post_init__(self) -> None:
        _check(self.vehicle, self.cause, self.severity)

    @property
    def is_shelved(self) -> bool:
        """Whether it is shelved: nobody is notified until the shelving ends."""
        return self.shelved_until is not None

    def as_state(self, number: int = 0) -> AlertState:
        """Return the alert as it is published, with its number in the store.

        Examples
        --------
        >>> from sprung.online.alerts import AlertSettings, Report, acknowledged, reported
        >>> alert = reported(None, Report("bus-17", "front_left.spring", 700, "softer"), AlertSettings(), now=0).alert
        >>> alert.as_state().state, acknowledged(alert, "Ada", now=60).alert.as_state().state
        ('unacknowledged', 'acknowledged')
        """
        shared = [each.name for each in fields(AlertState) if each.name != "number"]
        return AlertState(number=number, **{name: getattr(self, name) for name in shared})


@dataclass(frozen=True, slots=True)
class Transition:
    """An alert after an event, and the event.

    Parameters
    ----------
    alert
        Alert after the event; equal to the one before if `what` is "none".
    what
        Event, see `Change`.
    who
        Name of the operator; empty if a window caused the event.
    comment
        Comment of the operator.
    is_notified
        Whether a notification is due.
    """

    alert: Alert
    what: Change
    who: str = ""
    comment: str = ""
    is_notified: bool = False


def _check(vehicle: str, cause: str, severity: int) -> None:
    """Refuse an alert without vehicle or cause, and a severity out of range."""
    if not vehicle or not cause:
        raise ParameterError(f"vehicle {vehicle!r} and cause {cause!r} must not be empty: name both")
    check_number("severity", severity, at_least=1, at_most=1000)
