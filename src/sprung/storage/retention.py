"""What becomes of the rows of every table: how long they stay, and why the others are never deleted."""

from collections.abc import Mapping
from dataclasses import dataclass

from sqlalchemy import ColumnElement, and_, delete, exists, not_, or_, select, tuple_

from sprung.storage.database import Database
from sprung.storage.schema import (
    ALERT_HISTORY,
    ALERTS,
    AUDIT,
    BASELINES,
    COMMANDS,
    CURSORS,
    FINDINGS,
    FORGOTTEN,
    FRAMES,
    METADATA,
    MODES,
    NOTIFICATIONS,
    OBSERVATIONS,
    SESSIONS,
    SET_ASIDE,
    SNAPSHOTS,
)

#: Why rows of some tables are not deleted by their age.
KEPT = {
    "vehicles": "one for each vehicle",
    "frames": "until the stored state of the analysis covers them; intake stops before the disk is full",
    "snapshots": "one for each vehicle",
    "statuses": "one for each vehicle",
    "alerts": "one for each vehicle and cause",
    "deliveries": "with their notification",
    "forgotten": "one for each vehicle",
    "verdicts": "few, and the site's precision is counted from all of them",
    "accounts": "one for each person",
    "tokens": "one for each program, until it is revoked",
    "leases": "one for each shard",
    "monitors": "one for each monitor that runs",
    "compatibility": "one for each schema",
}
#: Number of rows of a transaction, which other writers wait for.
_BATCH = 1000


@dataclass(frozen=True, slots=True)
class Ages:
    """Times before which rows are deleted, UTC ns.

    Parameters
    ----------
    results
        For results, notifications, requests and what was set aside.
    audit
        For the audit trail and the history of alerts.
    boots
        For the progress of finished starts of boxes.
    """

    results: int
    audit: int
    boots: int


def delete_older(database: Database, ages: Ages, *, limit: int) -> int:
    """Delete rows that are older than `ages`, at most about `limit`, and return their number."""
    n_deleted = 0
    for name, condition in conditions(ages).items():
        while n_deleted < limit:
            n_rows = _delete_some(database, name, condition)
            n_deleted += n_rows
            if n_rows < _BATCH:
                break
    return n_deleted


def conditions(ages: Ages) -> Mapping[str, ColumnElement[bool]]:
    """Return the condition for the rows to delete of each table that is not in `KEPT`."""
    # By both times, so that results of an old recording that is replayed stay as long as others.
    entries = {
        table.name: and_(table.c.stored < ages.results, table.c.t0 < ages.results)
        for table in (OBSERVATIONS, MODES, FINDINGS)
    }
    newer = BASELINES.alias()
    is_replaced = exists().where(newer.c.vehicle == BASELINES.c.vehicle, newer.c.version > BASELINES.c.version)
    is_of_active_alert = exists().where(
        ALERTS.c.id == ALERT_HISTORY.c.alert, ALERTS.c.is_active, ALERTS.c.raised <= ALERT_HISTORY.c.time
    )
    return {
        **entries,
        "baselines": and_(BASELINES.c.created < ages.results, is_replaced),
        "notifications": or_(NOTIFICATIONS.c.sent < ages.results, NOTIFICATIONS.c.given_up < ages.results),
        "commands": COMMANDS.c.done < ages.results,
        "set_aside": SET_ASIDE.c.stored < ages.results,
        "alert_history": and_(ALERT_HISTORY.c.time < ages.audit, not_(is_of_active_alert)),
        "audit": AUDIT.c.time < ages.audit,
        "sessions": SESSIONS.c.expires < ages.results,
        "cursors": and_(CURSORS.c.updated < ages.boots, _is_finished()),
    }


def _is_finished() -> ColumnElement[bool]:
    """Return the condition for the progress of boots that the analysis has left behind.

    The stored state is that of a later boot, which is analysed only after all frames of the boots before it, as its box
    states their number; and no frame of the boot waits.
    """
    is_left = exists().where(SNAPSHOTS.c.vehicle == CURSORS.c.vehicle, SNAPSHOTS.c.boot > CURSORS.c.boot)
    waits = exists().where(FRAMES.c.vehicle == CURSORS.c.vehicle, FRAMES.c.boot == CURSORS.c.boot)
    return and_(CURSORS.c.contiguous == CURSORS.c.done, is_left, not_(waits))


def _delete_some(database: Database, name: str, condition: ColumnElement[bool]) -> int:
    """Delete some rows of a table in one transaction, and return their number."""
    table = METADATA.tables[name]
    keys = table.primary_key.columns
    with database.writing() as connection:
        rows = [tuple(row) for row in connection.execute(select(*keys).where(condition).limit(_BATCH))]
        if rows:
            connection.execute(delete(table).where(tuple_(*keys).in_(rows)))
        if rows and table is CURSORS:
            put = database.insert(FORGOTTEN)
            is_later = put.excluded.boot > FORGOTTEN.c.boot
            put = put.on_conflict_do_update(index_elements=["vehicle"], set_=dict(put.excluded), where=is_later)
            connection.execute(put, [{"vehicle": vehicle, "boot": boot} for vehicle, boot in rows])
    return len(rows)
