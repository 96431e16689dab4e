"""Retention of the rows of every table: how long they are kept, and why some are never deleted."""

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from functools import cache
from typing import Any

from sqlalchemy import BigInteger, ColumnElement, Select, and_, bindparam, delete, exists, not_, or_, select, tuple_

from sprung.online.store.database import Database
from sprung.online.store.schema import (
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
    QUARANTINE,
    SESSIONS,
    SNAPSHOTS,
)

#: Reasons why rows of some tables are not deleted by age.
KEPT = {
    "vehicles": "one for each vehicle",
    "frames": "until the stored state of the analysis covers them; intake stops before the disk is full",
    "snapshots": "one for each vehicle",
    "statuses": "one for each vehicle",
    "alerts": "one for each vehicle and cause",
    "deliveries": "with their notification",
    "forgotten": "one for each vehicle",
    "verdicts": "few, and the site's precision is computed from all of them",
    "accounts": "one for each person",
    "tokens": "one for each program, until it is revoked",
    "schema_version": "one row",
}
#: Number of rows of a transaction, which other writers wait for.
_BATCH = 1000


@dataclass(frozen=True, slots=True)
class Ages:
    """Times before which rows are deleted, UTC ns.

    Parameters
    ----------
    results
        For results, notifications, requests and what was quarantined.
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
    for name, old in _old_rows().items():
        while n_deleted < limit:
            n_rows = _delete_some(database, name, old, ages)
            n_deleted += n_rows
            if n_rows < _BATCH:
                break
    return n_deleted


def conditions() -> Mapping[str, ColumnElement[bool]]:
    """Return the condition for the rows to delete of each table not in `KEPT`, by the names of `Ages`."""
    results, audit, boots = (bindparam(field.name, type_=BigInteger) for field in fields(Ages))
    # By both times, so that results of an old recording that is replayed stay as long as others.
    entries = {
        table.name: and_(table.c.stored < results, table.c.t0 < results) for table in (OBSERVATIONS, MODES, FINDINGS)
    }
    newer = BASELINES.alias()
    is_replaced = exists().where(newer.c.vehicle == BASELINES.c.vehicle, newer.c.version > BASELINES.c.version)
    is_of_active_alert = exists().where(
        ALERTS.c.id == ALERT_HISTORY.c.alert, ALERTS.c.is_active, ALERTS.c.raised <= ALERT_HISTORY.c.time
    )
    return {
        **entries,
        "baselines": and_(BASELINES.c.created < results, is_replaced),
        "notifications": or_(NOTIFICATIONS.c.sent < results, NOTIFICATIONS.c.given_up < results),
        "commands": COMMANDS.c.done < results,
        "quarantine": QUARANTINE.c.stored < results,
        "alert_history": and_(ALERT_HISTORY.c.time < audit, not_(is_of_active_alert)),
        "audit": AUDIT.c.time < audit,
        "sessions": SESSIONS.c.expires < results,
        "cursors": and_(CURSORS.c.updated < boots, _is_finished()),
    }


def _is_finished() -> ColumnElement[bool]:
    """Return the condition for the progress of boots that the analysis has left behind.

    The stored state is that of a later boot, which is analysed only after all frames of the boots before it, as its box
    states their number; and no frame of the boot waits.
    """
    is_left = exists().where(SNAPSHOTS.c.vehicle == CURSORS.c.vehicle, SNAPSHOTS.c.boot > CURSORS.c.boot)
    waits = exists().where(FRAMES.c.vehicle == CURSORS.c.vehicle, FRAMES.c.boot == CURSORS.c.boot)
    return and_(CURSORS.c.contiguous == CURSORS.c.done, is_left, not_(waits))


@cache
def _old_rows() -> Mapping[str, Select[Any]]:
    """Return the query for the keys of rows to delete of each table, which takes longer to build than to run."""
    return {
        name: select(*METADATA.tables[name].primary_key.columns).where(condition).limit(_BATCH)
        for name, condition in conditions().items()
    }


def _delete_some(database: Database, name: str, old: Select[Any], ages: Ages) -> int:
    """Delete some rows of a table in one transaction, and return their number."""
    table = METADATA.tables[name]
    keys = table.primary_key.columns
    with database.writing() as connection:
        rows = [tuple(row) for row in connection.execute(old, asdict(ages))]
        if rows:
            connection.execute(delete(table).where(tuple_(*keys).in_(rows)))
        if rows and table is CURSORS:
            put = database.insert(FORGOTTEN)
            is_later = put.excluded.boot > FORGOTTEN.c.boot
            put = put.on_conflict_do_update(index_elements=["vehicle"], set_=dict(put.excluded), where=is_later)
            connection.execute(put, [{"vehicle": vehicle, "boot": boot} for vehicle, boot in rows])
    return len(rows)
