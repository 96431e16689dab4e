"""Alerts with their history, and the outbox of notifications."""

from dataclasses import asdict, replace

from sqlalchemy import select, update

from sprung.storage.database import Database
from sprung.storage.rows import AlertRow, Document, HistoryRow, NotificationRow
from sprung.storage.schema import ALERT_HISTORY, ALERTS, NOTIFICATIONS


class Alerts:
    """One alert for each cause on each vehicle.

    Parameters
    ----------
    database
        Database of the store.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def find(self, *, vehicle: str | None = None, is_active: bool | None = None) -> list[AlertRow]:
        """Return alerts, the most severe first, then the oldest."""
        query = select(ALERTS).order_by(ALERTS.c.severity.desc(), ALERTS.c.raised, ALERTS.c.id)
        if vehicle is not None:
            query = query.where(ALERTS.c.vehicle == vehicle)
        if is_active is not None:
            query = query.where(ALERTS.c.is_active == is_active)
        with self._database.reading() as connection:
            return [AlertRow(**row) for row in connection.execute(query).mappings()]

    def put(
        self, row: AlertRow, *, history: tuple[str, str, str], notify: Document | None = None, now: int
    ) -> AlertRow:
        """Store an alert, replacing the one of the same vehicle and cause.

        Parameters
        ----------
        row
            Alert to store; its `id` and `updated` are ignored.
        history
            Event, operator and comment.
        notify
            Notification to send; None: none.
        now
            Present time, UTC ns.

        Returns
        -------
        AlertRow
            Alert as stored.
        """
        values = {name: value for name, value in asdict(row).items() if name != "id"} | {"updated": now}
        put = self._database.insert(ALERTS).values(values)
        put = put.on_conflict_do_update(index_elements=["vehicle", "cause"], set_=values)
        what, who, comment = history
        with self._database.writing() as connection:
            identity = connection.execute(put.returning(ALERTS.c.id)).scalar_one()
            entry = {"alert": identity, "time": now, "what": what, "who": who, "comment": comment}
            after = {"assignee": row.assignee, "shelved_until": row.shelved_until}
            connection.execute(ALERT_HISTORY.insert(), entry | after)
            if notify is not None:
                message = {"alert": identity, "created": now, "document": notify, "attempts": 0}
                connection.execute(NOTIFICATIONS.insert(), message)
        return replace(row, id=identity, updated=now)

    def record(self, alert_id: int, what: str, comment: str, *, now: int) -> None:
        """Add an event to the history of an alert that leaves the alert as it is."""
        of_alert = ALERTS.c.id == alert_id
        entry = {"alert": alert_id, "time": now, "what": what, "who": "", "comment": comment}
        with self._database.writing() as connection:
            after = connection.execute(select(ALERTS.c.assignee, ALERTS.c.shelved_until).where(of_alert)).mappings()
            connection.execute(ALERT_HISTORY.insert(), entry | dict(after.one()))

    def history(self, alert_id: int) -> list[HistoryRow]:
        """Return the history of an alert, oldest event first."""
        query = select(ALERT_HISTORY).where(ALERT_HISTORY.c.alert == alert_id).order_by(ALERT_HISTORY.c.id)
        with self._database.reading() as connection:
            return [HistoryRow(**row) for row in connection.execute(query).mappings()]

    def due_notifications(self, limit: int) -> list[NotificationRow]:
        """Return notifications to send, first those with the fewest attempts, then the oldest."""
        order = (NOTIFICATIONS.c.attempts, NOTIFICATIONS.c.id)
        query = select(NOTIFICATIONS).where(NOTIFICATIONS.c.sent.is_(None)).order_by(*order).limit(limit)
        with self._database.reading() as connection:
            return [NotificationRow(**row) for row in connection.execute(query).mappings()]

    def notification_sent(self, notification_id: int, now: int) -> None:
        """Store that a notification was delivered."""
        self._record_attempt(notification_id, sent=now, last_error=None)

    def notification_failed(self, notification_id: int, error: str) -> None:
        """Store that an attempt to send a notification failed, and the error."""
        self._record_attempt(notification_id, last_error=error)

    def _record_attempt(self, notification_id: int, **outcome: int | str | None) -> None:
        """Store the outcome of one attempt."""
        is_open = NOTIFICATIONS.c.sent.is_(None)
        notification = update(NOTIFICATIONS).where(NOTIFICATIONS.c.id == notification_id, is_open)
        with self._database.writing() as connection:
            connection.execute(notification.values(attempts=NOTIFICATIONS.c.attempts + 1, **outcome))
