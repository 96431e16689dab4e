"""Notifications about alerts, for people and programs."""

from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from math import isfinite
from typing import Any

from sprung.online.alerts.transitions import Transition
from sprung.results.documents.monitoring import NotificationDocument

_WORDS = {"updated": "still active", "unshelved": "no longer shelved", "commented": "commented on"}


@dataclass(frozen=True, slots=True)
class Message:
    """A notification, the same for all senders.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    what
        Event of the alert, see `Change`.
    severity
        Severity, 1 to 1000.
    subject
        Subject in one line.
    text
        Text of a few lines for people.
    time
        Time of the event, UTC ns.
    document
        Contents as `sprung.alert/1`, for programs.
    picture
        Figure of the alert as PNG, for senders that can show one; empty: none.
    key
        Identifier of the notification, the same whenever it is sent, by which a receiver discards repeats; empty: none.
    """

    vehicle: str
    what: str
    severity: int
    subject: str
    text: str
    time: int
    document: dict[str, Any] = field(hash=False)
    picture: bytes = field(default=b"", repr=False)
    key: str = ""


def message_of(transition: Transition) -> Message:
    """Return the notification about an event of an alert.

    Examples
    --------
    >>> from sprung.online.alerts import AlertSettings, Report, reported
    >>> report = Report("bus-17", "front_left.spring", 700, "front-left spring 20 % softer")
    >>> message_of(reported(None, report, AlertSettings(), now=0)).subject
    'bus-17: front-left spring raised (high)'
    """
    alert, by = transition.alert, transition.who or "nobody"
    words = _WORDS.get(transition.what, transition.what)
    subject = " ".join(f"{alert.vehicle}: {alert.name} {words} ({alert.step})".split())
    lines = {
        "Vehicle": alert.vehicle,
        "Cause": alert.cause,
        "State": alert.state,
        "Severity": f"{alert.severity} of 1000 ({alert.step})",
        "Raised": f"{_written(alert.raised)} (occurrence {alert.count})",
        "Cleared": None if alert.cleared is None else _written(alert.cleared),
        "Assigned to": alert.assignee,
        "By": ": ".join(filter(None, (by, transition.comment))) if transition.who or transition.comment else None,
    }
    document = {
        "schema": "sprung.alert/1",
        "time": _written(alert.updated),
        "what": transition.what,
        "who": transition.who,
        "comment": transition.comment,
        "subject": subject,
        **alert.facts(NotificationDocument),
        "evidence": _plain(alert.evidence),
    }
    del document["number"]  # which the store gives
    return Message(
        vehicle=alert.vehicle,
        what=transition.what,
        severity=alert.severity,
        subject=subject,
        text="\n".join([alert.text, "", *(f"{name}: {value}" for name, value in lines.items() if value is not None)]),
        time=alert.updated,
        document=document,
    )


def addressed(message: Message, *, number: int, key: str = "", link: str = "", picture: bytes = b"") -> Message:
    """Return a notification with what its recipient needs to act on it.

    Parameters
    ----------
    message
        Notification about an event of an alert, from `message_of`.
    number
        Number of the alert.
    key
        Identifier of the notification.
    link
        Address of the alert; empty: none.
    picture
        Figure of the alert as PNG; empty: none.

    Examples
    --------
    >>> from sprung.online.alerts import AlertSettings, Report, reported
    >>> event = reported(None, Report("bus-17", "front_left.spring", 700, "softer"), AlertSettings(), now=0)
    >>> message = addressed(message_of(event), number=8)
    >>> message.subject
    'bus-17: front-left spring raised (high), alert 8'
    >>> message.text.splitlines()[-1]
    'Alert: 8 (acknowledge with: sprung alerts ack 8)'
    """
    lines = [message.text, f"Alert: {number} (acknowledge with: sprung alerts ack {number})"]
    return replace(
        message,
        subject=f"{message.subject}, alert {number}",
        text="\n".join(lines + [f"Link: {link}"] * bool(link)),
        document={**message.document, "number": number, "key": key, "link": link or None},
        picture=picture,
        key=key,
    )


def trial_message(time: int) -> Message:
    """Return a notification to test senders, with its time (UTC ns); it belongs to no alert.

    Examples
    --------
    >>> message = trial_message(0)
    >>> message.subject, message.document["time"]
    ('Sprung: test message, no alert', '1970-01-01T00:00:00Z')
    """
    subject = "Sprung: test message, no alert"
    text = "This message tests the delivery of alerts. No alert was raised; there is nothing to do."
    document = {"schema": "sprung.alert/1", "time": _written(time), "what": "test", "subject": subject, "text": text}
    return Message("monitor", "test", 1, subject, text, time, document)


def _written(time: int) -> str:
    """Return a time [UTC ns] as ISO 8601, to the second."""
    return datetime.fromtimestamp(time // 1_000_000_000, tz=UTC).strftime("%Y-%m-%dT%H:%M:%SZ")


def _plain(value: Any) -> Any:
    """Return a value that JSON can hold: unusual evidence must not prevent a notification."""
    if isinstance(value, float):
        return float(value) if isfinite(value) else None
    if value is None or isinstance(value, bool | int | str):
        return value
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple | set | frozenset):
        return [_plain(item) for item in value]
    if hasattr(value, "tolist"):  # arrays and their scalars
        return _plain(value.tolist())
    return str(value)
