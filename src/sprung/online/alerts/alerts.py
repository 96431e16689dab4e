"""Reports of windows and changes of alerts, as values, in the terms of ANSI/ISA-18.2 (IEC 62682)."""

from dataclasses import dataclass, field
from typing import Any, Literal

from sprung._checks import check_number
from sprung.state.alerts import AlertState, check_alert

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
        check_alert(self.vehicle, self.cause, self.severity)


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

    alert: AlertState
    what: Change
    who: str = ""
    comment: str = ""
    is_notified: bool = False
