"""Alerts with their history, and the outbox of notifications."""

from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, replace
from functools import cache
from typing import Any

import sqlalchemy as sa

from sprung.online.store.database import Tables
from sprung.online.store.schema import (
    ALERT_HISTORY,
    ALERTS,
    DAY,
    DELIVERIES,
    NOTIFICATIONS,
    AlertFilter,
    AlertPlace,
    Delivery,
    Document,
    HistoryRow,
    NotificationRow,
    in_steps,
)
from sprung.state import STEP_SIZE, AlertState

#: Values of one query: databases refuse more than some 32,000.
_MAX_VALUES = 1000
#: Columns of the progress of a sender, besides the number of attempts.
_PROGRESS = ("next_attempt", "sent", "given_up", "last_error")


class Alerts(Tables):
    """One alert for each cause on each vehicle."""

    def find(self, *, vehicle: str | None = None, is_active: bool | None = None) -> list[AlertState]:
        """Return alerts, the most severe first, then the oldest."""
        values = {"vehicle": vehicle, "is_active": is_active}
        conditions = {name: value for name, value in values.items() if value is not None}
        return self._database.rows(AlertState, _alerts(*conditions), conditions)

    def row(self, number: int) -> AlertState | None:
        """Return the alert of a number; None if there is none."""
        return self._database.row(AlertState, sa.select(ALERTS).where(ALERTS.c.number == number))

    def rows(self, numbers: Collection[int]) -> dict[int, AlertState]:
        """Return the alerts of some numbers, by number."""
        wanted = list(numbers)
        rows: list[AlertState] = []
        for first in range(0, len(wanted), _MAX_VALUES):
            query = sa.select(ALERTS).where(ALERTS.c.number.in_(wanted[first : first + _MAX_VALUES]))
            rows += self._database.rows(AlertState, query)
        return {row.number: row for row in rows}

    def page(self, wanted: AlertFilter, *, after: AlertPlace | None = None, limit: int) -> list[AlertState]:
        """Return alerts, the most severe first, then the oldest, from the one that follows a place on."""
        query = sa.select(ALERTS).where(*_conditions(wanted))
        if after is not None:
            place = sa.tuple_(-ALERTS.c.severity, ALERTS.c.raised, ALERTS.c.number)
            query = query.where(place > sa.tuple_(-after.severity, after.raised, after.id))
        query = query.order_by(ALERTS.c.severity.desc(), ALERTS.c.raised, ALERTS.c.number).limit(limit)
        return self._database.rows(AlertState, query)

    def counts(self, wanted: AlertFilter) -> dict[tuple[str, int], int]:
        """Return the number of alerts by state and step of severity, 0 to 4."""
        state = sa.case(*((condition, sa.literal(name)) for name, condition in _STATES.items()), else_=sa.literal(""))
        step = sa.case(*((ALERTS.c.severity <= STEP_SIZE * (k + 1), k) for k in range(4)), else_=4)
        query = sa.select(state.label("state"), step.label("step")).where(*_conditions(wanted)).subquery()
        counted = sa.select(query.c.state, query.c.step, sa.func.count()).group_by(query.c.state, query.c.step)
        with self._database.reading() as connection:
            return {(name, number): count for name, number, count in connection.execute(counted)}

    def n_active(self) -> int:
        """Return the number of active alerts."""
        return self._database.scalar(sa.select(sa.func.count()).where(ALERTS.c.is_active)) or 0

    def of_vehicles(self, vehicles: Sequence[str]) -> dict[str, list[AlertState]]:
        """Return the active alerts of some vehicles, the most severe first, by vehicle."""
        found: dict[str, list[AlertState]] = {}
        query = sa.select(ALERTS).where(ALERTS.c.vehicle.in_(vehicles), ALERTS.c.is_active)
        for row in self._database.rows(AlertState, query.order_by(ALERTS.c.severity.desc(), ALERTS.c.number)):
            found.setdefault(row.vehicle, []).append(row)
        return found

    def put(
        self, alert: AlertState, *, history: tuple[str, str, str], notify: Document | None = None, now: int
    ) -> AlertState:
        """Store an alert, replacing the one of the same vehicle and cause.

        Parameters
        ----------
        alert
            Alert to store; its `number` and `updated` are ignored.
        history
            Event, operator and comment.
        notify
            Notification to send; None: none.
        now
            Present time, UTC ns.

        Returns
        -------
        AlertState
            Alert as stored.
        """
        values = {name: value for name, value in asdict(alert).items() if name != "number"} | {"updated": now}
        put = self._database.insert(ALERTS).values(values)
        put = put.on_conflict_do_update(index_elements=["vehicle", "cause"], set_=values)
        what, who, comment = history
        with self._database.writing() as connection:
            identity = connection.execute(put.returning(ALERTS.c.number)).scalar_one()
            entry = {"alert": identity, "time": now, "what": what, "who": who, "comment": comment}
            after = {"assignee": alert.assignee, "shelved_until": alert.shelved_until}
            connection.execute(ALERT_HISTORY.insert(), entry | after)
            if notify is not None:
                message = {"alert": identity, "created": now, "document": notify, "attempts": 0}
                connection.execute(NOTIFICATIONS.insert(), message)
        return replace(alert, number=identity, updated=now)

    def record(self, alert_id: int, what: str, comment: str, *, now: int) -> None:
        """Add an event to the history of an alert that leaves the alert as it is."""
        of_alert = ALERTS.c.number == alert_id
        entry = {"alert": alert_id, "time": now, "what": what, "who": "", "comment": comment}
        with self._database.writing() as connection:
            after = connection.execute(sa.select(ALERTS.c.assignee, ALERTS.c.shelved_until).where(of_alert)).mappings()
            connection.execute(ALERT_HISTORY.insert(), entry | dict(after.one()))

    def history(self, alert_id: int) -> list[HistoryRow]:
        """Return the history of an alert, oldest event first."""
        query = sa.select(ALERT_HISTORY).where(ALERT_HISTORY.c.alert == alert_id).order_by(ALERT_HISTORY.c.id)
        return self._database.rows(HistoryRow, query)

    def shelved(self, *, until: int) -> list[AlertState]:
        """Return the alerts whose shelving ends at a time at the latest."""
        query = sa.select(ALERTS).where(ALERTS.c.shelved_until <= until).order_by(ALERTS.c.number)
        return self._database.rows(AlertState, query)

    @contextmanager
    def locked(self, vehicle: str, cause: str) -> Iterator[AlertState | None]:
        """Yield an alert, None if there is none; what is stored in the context is one transaction, before any other."""
        query = sa.select(ALERTS).where(ALERTS.c.vehicle == vehicle, ALERTS.c.cause == cause).with_for_update()
        with self._database.together(), self._database.writing() as connection:
            row = connection.execute(query).mappings().first()
            yield None if row is None else AlertState(**row)

    @contextmanager
    def locked_of(self, vehicle: str) -> Iterator[list[AlertState]]:
        """Yield all alerts of a vehicle; what is stored in the context is one transaction, before any other."""
        query = sa.select(ALERTS).where(ALERTS.c.vehicle == vehicle).order_by(ALERTS.c.number).with_for_update()
        with self._database.together(), self._database.writing() as connection:
            yield [AlertState(**row) for row in connection.execute(query).mappings()]

    def next_notification(self, sender: str, *, now: int) -> NotificationRow | None:
        """Return the notification that a sender is to send next; None if none is due.

        Parameters
        ----------
        sender
            Name of the sender.
        now
            Present time, UTC ns.

        Returns
        -------
        NotificationRow or None
            Of those that the sender has not settled and whose next attempt is due, the one with the fewest attempts,
            then the oldest. An attempt that is due in more than a day counts as due: the clock was set back.
        """
        with self._database.reading() as connection:
            row = connection.execute(_next(), {"sender": sender, "now": now, "tomorrow": now + DAY}).first()
        if row is None:
            return None
        progress = Delivery(row.attempts, row.next_attempt, row.sent, row.given_up, row.last_error)
        return NotificationRow(row.id, row.alert, row.created, row.document, progress)

    def n_open(self) -> int:
        """Return the number of notifications that are neither sent nor given up."""
        return self._database.scalar(_N_OPEN) or 0

    def put_delivery(
        self, notification: int, sender: str, delivery: Delivery, *, senders: Collection[str], now: int
    ) -> None:
        """Store the progress of a sender with a notification, which is closed once all `senders` have settled it."""
        values = asdict(delivery)
        put = self._database.insert(DELIVERIES).values(notification=notification, sender=sender, **values)
        with self._database.writing() as connection:
            # First, as it locks the row: of two senders that settle at the same time the second sees the first.
            connection.execute(_COUNTED, {"counted": notification, "last_error": delivery.last_error})
            connection.execute(put.on_conflict_do_update(index_elements=["notification", "sender"], set_=values))
            values = {"senders": list(senders), "n_senders": len(senders), "now": now, "closed": notification}
            connection.execute(_closed(is_one=True), values)

    def close_settled(self, senders: Collection[str], *, now: int) -> None:
        """Close the notifications that all `senders` have settled, as when another one was taken from the site file."""
        with self._database.writing() as connection:
            values = {"senders": list(senders), "n_senders": len(senders), "now": now}
            connection.execute(_closed(is_one=False), values)

    def given_up(self) -> dict[str, str]:
        """Return the reason of the last failure by name of each sender that gave up what it settled last."""
        with self._database.reading() as connection:
            return {row.sender: row.last_error or "" for row in connection.execute(_given_up())}


def _conditions(wanted: AlertFilter) -> list[sa.ColumnElement[bool]]:
    """Return the conditions of a filter; alerts in their first hold-off are none yet."""
    conditions: list[sa.ColumnElement[bool]] = [ALERTS.c["count"] > 0]
    if wanted.states:
        conditions.append(sa.or_(*(_STATES[name] for name in wanted.states)))
    if wanted.steps:
        conditions.append(in_steps(ALERTS.c.severity, wanted.steps))
    if wanted.vehicle:
        conditions.append(ALERTS.c.vehicle.icontains(wanted.vehicle, autoescape=True))
    if wanted.assignee is not None:
        conditions.append(ALERTS.c.assignee == wanted.assignee)
    return conditions


def _is_open(table: sa.Table) -> sa.ColumnElement[bool]:
    """Return the condition for notifications or deliveries that are neither sent nor given up."""
    return sa.and_(table.c.sent.is_(None), table.c.given_up.is_(None))


_IS_SHELVED, _IS_ACKNOWLEDGED = ALERTS.c.shelved_until.is_not(None), ALERTS.c.is_acknowledged
#: Condition of each state in the terms of ISA-18.2; shelving takes precedence.
_STATES: dict[str, sa.ColumnElement[bool]] = {
    "shelved": _IS_SHELVED,
    **{
        name: sa.and_(sa.not_(_IS_SHELVED), active, acknowledged)
        for name, active, acknowledged in (
            ("unacknowledged", ALERTS.c.is_active, sa.not_(_IS_ACKNOWLEDGED)),
            ("acknowledged", ALERTS.c.is_active, _IS_ACKNOWLEDGED),
            ("returned to normal, unacknowledged", sa.not_(ALERTS.c.is_active), sa.not_(_IS_ACKNOWLEDGED)),
            ("normal", sa.not_(ALERTS.c.is_active), _IS_ACKNOWLEDGED),
        )
    },
}

# Statements are built once: building one takes longer than running it.
_COUNTED = (
    sa.update(NOTIFICATIONS)
    .where(NOTIFICATIONS.c.id == sa.bindparam("counted"))
    .values(attempts=NOTIFICATIONS.c.attempts + 1, last_error=sa.bindparam("last_error"))
)
_N_OPEN = sa.select(sa.func.count()).where(_is_open(NOTIFICATIONS))


@cache
def _alerts(*conditions: str) -> sa.Select[Any]:
    """Return the query for alerts of which some columns have given values."""
    query = sa.select(ALERTS).order_by(ALERTS.c.severity.desc(), ALERTS.c.raised, ALERTS.c.number)
    return query.where(*(ALERTS.c[name] == sa.bindparam(name) for name in conditions))


@cache
def _next() -> sa.Select[Any]:
    """Return the query for the notification that `sender` is to send next at the time `now`."""
    of_sender = sa.and_(DELIVERIES.c.notification == NOTIFICATIONS.c.id, DELIVERIES.c.sender == sa.bindparam("sender"))
    next_attempt = sa.func.coalesce(DELIVERIES.c.next_attempt, 0)
    is_due = sa.or_(next_attempt <= sa.bindparam("now"), next_attempt > sa.bindparam("tomorrow"))
    attempts = sa.func.coalesce(DELIVERIES.c.attempts, 0).label("attempts")
    columns = [NOTIFICATIONS.c[name] for name in ("id", "alert", "created", "document")]
    return (
        sa.select(*columns, attempts, *(DELIVERIES.c[name] for name in _PROGRESS))
        .select_from(NOTIFICATIONS.outerjoin(DELIVERIES, of_sender))
        .where(_is_open(NOTIFICATIONS), _is_open(DELIVERIES), is_due)
        .order_by(attempts, NOTIFICATIONS.c.id)
        .limit(1)
    )


@cache
def _given_up() -> sa.Select[Any]:
    """Return the query for senders that gave up what they settled last, with the reasons."""
    latest = (
        sa.select(DELIVERIES.c.sender, sa.func.max(DELIVERIES.c.given_up).label("given_up"))
        .group_by(DELIVERIES.c.sender)
        .having(sa.func.max(DELIVERIES.c.given_up) > sa.func.coalesce(sa.func.max(DELIVERIES.c.sent), -1))
        .subquery()
    )
    is_latest = sa.and_(DELIVERIES.c.sender == latest.c.sender, DELIVERIES.c.given_up == latest.c.given_up)
    return sa.select(DELIVERIES.c.sender, DELIVERIES.c.last_error).join(latest, is_latest)


@cache
def _closed(*, is_one: bool) -> sa.Update:
    """Return the statement that closes notifications that all `senders` have settled, at the time `now`.

    They are closed as given up if any of them gave up, else as sent. With `is_one` only the notification `closed`.
    """
    is_of_senders = DELIVERIES.c.sender.in_(sa.bindparam("senders", expanding=True))
    of_senders = sa.and_(DELIVERIES.c.notification == NOTIFICATIONS.c.id, is_of_senders)
    n_settled = sa.select(sa.func.count()).where(of_senders, sa.not_(_is_open(DELIVERIES))).scalar_subquery()
    n_given_up = sa.select(sa.func.count()).where(of_senders, DELIVERIES.c.given_up.is_not(None)).scalar_subquery()
    closed = sa.update(NOTIFICATIONS).where(_is_open(NOTIFICATIONS), n_settled >= sa.bindparam("n_senders"))
    if is_one:
        closed = closed.where(NOTIFICATIONS.c.id == sa.bindparam("closed"))
    now = sa.bindparam("now", type_=NOTIFICATIONS.c.sent.type)
    return closed.values(sent=sa.case((n_given_up == 0, now)), given_up=sa.case((n_given_up > 0, now)))
