"""Work orders: what a workshop is to do about an alert, as `sprung.work-order/1`."""

from collections.abc import Sequence
from typing import Any

from sprung.diagnosis import SEVERITIES
from sprung.errors import ParameterError
from sprung.online.alerts import STEPS, Message, Sender, deliver, is_of_suspension, severity_step, state_name
from sprung.online.monitor import desk
from sprung.online.monitor.alert_book import alert_of
from sprung.online.store import Store
from sprung.results.documents import WorkOrderDocument

#: Times above this are counted from 1970 [s]: those of a recording without a date are not.
_DATED = 1e8


def work_order(store: Store, number: int, *, who: str, now: int, link: str = "") -> WorkOrderDocument:
    """Return the work order of an alert.

    Parameters
    ----------
    store
        Store of the monitor.
    number
        Alert number.
    who
        Name of the person or program that requests it.
    now
        Present time, UTC ns.
    link
        Address of the alert; empty: none.

    Raises
    ------
    ParameterError
        If no alert has that number, or it is about the monitor and not about a vehicle.
    """
    row = store.alerts.row(number)
    if row is None:
        raise ParameterError(f"unknown alert {number}: sprung alerts list --all lists all alerts")
    if row.cause.partition(":")[0] == "monitor":
        raise ParameterError(f"alert {number} is about the monitor ({row.cause}): a work order is about a vehicle")
    alert = alert_of(row)
    evidence = alert.evidence
    corner, part = corner_and_part(row.cause)
    return WorkOrderDocument.model_validate(
        {
            "schema": "sprung.work-order/1",
            "key": f"work-order-{number}-{row.raised}",
            "alert": number,
            "created": now,
            "created_by": who,
            "vehicle": row.vehicle,
            "corner": corner,
            "part": part,
            "change": evidence.get("change"),
            "interval": evidence.get("interval"),
            "since": onset_of(evidence) or row.raised,
            "since_interval": _times(evidence.get("since_interval")),
            "severity": row.severity,
            "step": STEPS[severity_step(row.severity)],
            "urgency": evidence.get("advice") or _urgency(row.severity),
            "sentence": row.text,
            "runner_up": evidence.get("runner_up") or "",
            "state": state_name(alert),
            "raised": row.raised,
            "assignee": row.assignee,
            "evidence": evidence,
            "link": link or None,
        }
    )


def send_work_order(
    store: Store, number: int, senders: Sequence[Sender], *, who: str, now: int, link: str = ""
) -> dict[str, str]:
    """Send the work order of an alert, and record in its history who sent it and where it arrived.

    Parameters
    ----------
    store, number, who, now, link
        As for `work_order`.
    senders
        Webhooks of the site file.

    Returns
    -------
    dict
        Reason of the failure by name of the sender; empty if it arrived.

    Raises
    ------
    ParameterError
        If there is no such work order, or no sender.
    """
    order = work_order(store, number, who=who, now=now, link=link)
    if not senders:
        raise ParameterError("the site file has no webhook: add [[send.webhook]] to it, or download the work order")
    errors = deliver(_message(order), senders)
    results = {sender.name: errors.get(sender.name, "") for sender in senders}
    words = "; ".join(f"by {name}: {error or 'sent'}" for name, error in results.items())
    desk.add_comment(store, number, who=who, comment=f"work order {words}", now=now)
    return results


def corner_and_part(cause: str) -> tuple[str | None, str]:
    """Return corner and part of a cause; None for a part that belongs to no corner.

    Examples
    --------
    >>> corner_and_part("front_left.spring"), corner_and_part("sensor:acc_fl"), corner_and_part("silent")
    (('front_left', 'spring'), (None, 'sensor acc_fl'), (None, 'measuring box'))
    """
    if is_of_suspension(cause):
        corner, _, part = cause.rpartition(".")
        return corner or None, part
    kind, _, channel = cause.partition(":")
    return None, f"sensor {channel}" if kind == "sensor" else "measuring box"


def onset_of(evidence: dict[str, Any]) -> int | None:
    """Return the onset in the evidence of an alert, UTC ns; None if it is unknown."""
    return _time(evidence.get("since"))


def _time(seconds: Any) -> int | None:
    """Return a time of the windows' clock [s] as UTC ns; None if it does not count from 1970."""
    is_dated = isinstance(seconds, int | float) and seconds >= _DATED
    return round(seconds * 1e9) if is_dated else None


def _times(interval: Any) -> tuple[int, int] | None:
    """Return the ends of an interval of time [s] as UTC ns."""
    begin, end = (_time(seconds) for seconds in interval or (None, None))
    return None if begin is None or end is None else (begin, end)


def _urgency(severity: int) -> str:
    """Return what to do by a severity, as findings of that severity state it."""
    step = severity_step(severity)
    return next((words for _, _, least, words in SEVERITIES if severity_step(least) <= step), SEVERITIES[-1][3])


def _message(order: WorkOrderDocument) -> Message:
    """Return the message of a work order, as senders take it."""
    subject = f"Work order: {order.vehicle} {order.part}"
    document = order.as_json()
    return Message(
        order.vehicle, "work order", order.severity, subject, order.sentence, order.created, document, key=order.key
    )
