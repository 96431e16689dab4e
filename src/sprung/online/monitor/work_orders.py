"""Work orders: what a workshop is to do about an alert, as `sprung.work-order/1`."""

from collections.abc import Sequence

from sprung.errors import ParameterError
from sprung.online.alerts import Message, Sender, deliver
from sprung.online.monitor import operations
from sprung.online.monitor.vehicle_states import alert_state
from sprung.online.store import Store
from sprung.results.documents import WorkOrderDocument


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
    alert = alert_state(row)
    corner, part = alert.place
    return WorkOrderDocument.model_validate(
        {
            "schema": "sprung.work-order/1",
            "key": f"work-order-{number}-{alert.raised}",
            "alert": number,
            "created": now,
            "created_by": who,
            "vehicle": alert.vehicle,
            "corner": corner,
            "part": part,
            "change": alert.change,
            "interval": alert.interval,
            "since": alert.onset or alert.raised,
            "since_interval": alert.onset_interval,
            "severity": alert.severity,
            "step": alert.step,
            "urgency": alert.urgency,
            "sentence": alert.text,
            "runner_up": alert.runner_up,
            "state": alert.state,
            "raised": alert.raised,
            "assignee": alert.assignee,
            "evidence": alert.evidence,
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
    operations.add_comment(store, number, who=who, comment=f"work order {words}", now=now)
    return results


def _message(order: WorkOrderDocument) -> Message:
    """Return the message of a work order, as senders take it."""
    subject = f"Work order: {order.vehicle} {order.part}"
    document = order.as_json()
    return Message(
        order.vehicle, "work order", order.severity, subject, order.sentence, order.created, document, key=order.key
    )
