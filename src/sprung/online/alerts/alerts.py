"""Alerts as values: one for each cause in a vehicle, in the terms of ANSI/ISA-18.2 (IEC 62682)."""

from dataclasses import dataclass, field
from typing import Any, Literal

from sprung._checks import check_number
from sprung.errors import ParameterError

#: Names of the five steps of severity, from 1 to 200, 201 to 400 and so on.
STEPS = ("note", "low", "medium", "high", "critical")
#: Causes that concern monitoring and not the vehicle.
WATCHING = ("silent", "lost", "monitor")

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
        _check_names(self.vehicle, self.cause)
        _check_severity(self.severity)


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
        _check_names(self.vehicle, self.cause)
        _check_severity(self.severity)

    @property
    def is_shelved(self) -> bool:
        """Whether it is shelved: nobody is notified until the shelving ends."""
        return self.shelved_until is not None


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


def state_name(alert: Alert) -> str:
    """Return the state in the terms of ISA-18.2.

    Returns
    -------
    str
        "shelved", "unacknowledged", "acknowledged", "returned to normal, unacknowledged" or "normal"; "shelved" takes
        precedence.

    Examples
    --------
    >>> from sprung.online.alerts import AlertSettings, Report, acknowledged, reported
    >>> alert = reported(None, Report("bus-17", "front_left.spring", 700, "softer"), AlertSettings(), now=0).alert
    >>> state_name(alert), state_name(acknowledged(alert, "Ada", now=60).alert)
    ('unacknowledged', 'acknowledged')
    """
    if alert.is_shelved:
        return "shelved"
    if alert.is_active:
        return "acknowledged" if alert.is_acknowledged else "unacknowledged"
    return "normal" if alert.is_acknowledged else "returned to normal, unacknowledged"


def severity_step(severity: int) -> int:
    """Return the step of a severity in `STEPS`: 0 for 1 to 200, 4 for 801 to 1000.

    Examples
    --------
    >>> STEPS[severity_step(700)], severity_step(1), severity_step(1000)
    ('high', 0, 4)
    """
    return (severity - 1) // 200


def is_of_suspension(cause: str) -> bool:
    """Return whether a cause is a change of the suspension, rather than of a sensor ("sensor:acc_fl") or monitoring.

    Examples
    --------
    >>> [is_of_suspension(cause) for cause in ("front_left.spring", "sensor:acc_fl", "silent")]
    [True, False, False]
    """
    return ":" not in cause and cause not in WATCHING


def _check_severity(severity: int) -> None:
    """Refuse a severity out of range."""
    check_number("severity", severity, at_least=1, at_most=1000)


def _check_names(vehicle: str, cause: str) -> None:
    """Refuse an alert without vehicle or cause."""
    if not vehicle or not cause:
        raise ParameterError(f"vehicle {vehicle!r} and cause {cause!r} must not be empty: name both")
