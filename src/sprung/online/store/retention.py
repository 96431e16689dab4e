"""What the store and the archive contain, how long it is kept, and why some is never deleted."""

import os
import time
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import asdict, dataclass, fields
from functools import cache
from heapq import heapify, heappop, heappush
from pathlib import Path
from typing import Any

import sqlalchemy as sa

from sprung.link.archive import reported
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
    SCHEMA,
    SESSIONS,
    SNAPSHOTS,
    StoreError,
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
#: Number of rows at which counting ends, so that a large store answers soon, too.
MAX_COUNTED = 1_000_000
#: Key of the site file by which rows of a table are deleted; "keep.results_days" for all others that are not in `KEPT`.
AGE_KEYS = {"alert_history": "keep.audit_days", "audit": "keep.audit_days", "cursors": "keep.boots_days"}
# Within the ticks of its disk a folder can change again without a sign [ns].
_SETTLED = 2 * 10**9
_NEVER = 2**63


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


def conditions() -> Mapping[str, sa.ColumnElement[bool]]:
    """Return the condition for the rows to delete of each table not in `KEPT`, by the names of `Ages`."""
    results, audit, boots = (sa.bindparam(field.name, type_=sa.BigInteger) for field in fields(Ages))
    # By both times, so that results of an old recording that is replayed stay as long as others.
    entries = {
        table.name: sa.and_(table.c.stored < results, table.c.t0 < results) for table in (OBSERVATIONS, MODES, FINDINGS)
    }
    newer = BASELINES.alias()
    is_replaced = sa.exists().where(newer.c.vehicle == BASELINES.c.vehicle, newer.c.version > BASELINES.c.version)
    is_of_active_alert = sa.exists().where(
        ALERTS.c.number == ALERT_HISTORY.c.alert, ALERTS.c.is_active, ALERTS.c.raised <= ALERT_HISTORY.c.time
    )
    return {
        **entries,
        "baselines": sa.and_(BASELINES.c.created < results, is_replaced),
        "notifications": sa.or_(NOTIFICATIONS.c.sent < results, NOTIFICATIONS.c.given_up < results),
        "commands": COMMANDS.c.done < results,
        "quarantine": QUARANTINE.c.stored < results,
        "alert_history": sa.and_(ALERT_HISTORY.c.time < audit, sa.not_(is_of_active_alert)),
        "audit": AUDIT.c.time < audit,
        "sessions": SESSIONS.c.expires < results,
        "cursors": sa.and_(CURSORS.c.updated < boots, _is_finished()),
    }


def _is_finished() -> sa.ColumnElement[bool]:
    """Return the condition for the progress of boots that the analysis has left behind.

    The stored state is that of a later boot, which is analysed only after all frames of the boots before it, as its box
    states their number; and no frame of the boot waits.
    """
    is_left = sa.exists().where(SNAPSHOTS.c.vehicle == CURSORS.c.vehicle, SNAPSHOTS.c.boot > CURSORS.c.boot)
    waits = sa.exists().where(FRAMES.c.vehicle == CURSORS.c.vehicle, FRAMES.c.boot == CURSORS.c.boot)
    return sa.and_(CURSORS.c.contiguous == CURSORS.c.done, is_left, sa.not_(waits))


@cache
def _old_rows() -> Mapping[str, sa.Select[Any]]:
    """Return the query for the keys of rows to delete of each table, which takes longer to build than to run."""
    return {
        name: sa.select(*METADATA.tables[name].primary_key.columns).where(condition).limit(_BATCH)
        for name, condition in conditions().items()
    }


def _delete_some(database: Database, name: str, old: sa.Select[Any], ages: Ages) -> int:
    """Delete some rows of a table in one transaction, and return their number."""
    table = METADATA.tables[name]
    keys = table.primary_key.columns
    with database.writing() as connection:
        rows = [tuple(row) for row in connection.execute(old, asdict(ages))]
        if rows:
            connection.execute(sa.delete(table).where(sa.tuple_(*keys).in_(rows)))
        if rows and table is CURSORS:
            put = database.insert(FORGOTTEN)
            is_later = put.excluded.boot > FORGOTTEN.c.boot
            put = put.on_conflict_do_update(index_elements=["vehicle"], set_=dict(put.excluded), where=is_later)
            connection.execute(put, [{"vehicle": vehicle, "boot": boot} for vehicle, boot in rows])
    return len(rows)


@dataclass(frozen=True, slots=True)
class Counted:
    """Rows of a table.

    Parameters
    ----------
    table
        Name of the table.
    rows
        Number of rows, at most `MAX_COUNTED`.
    is_more
        Whether there are more.
    stay
        Retention: a key of the site file, or the reason why they are not deleted by age.
    """

    table: str
    rows: int
    is_more: bool
    stay: str


@dataclass(frozen=True, slots=True)
class Contents:
    """Contents of a store.

    Parameters
    ----------
    tables
        Rows of each table, by name.
    oldest
        Time at which the oldest result was stored, UTC ns; None: there is none.
    database
        Program and version of the database.
    schema
        Version of the schema.
    """

    tables: tuple[Counted, ...]
    oldest: int | None
    database: str
    schema: str


def contents_of(database: Database) -> Contents:
    """Return the contents of a store."""
    with database.reading() as connection:
        oldest = [
            connection.scalar(sa.select(sa.func.min(table.c.stored)).where(table.c.stored > 0))
            for table in (OBSERVATIONS, MODES, FINDINGS)
        ]
        return Contents(
            tuple(_count(connection, table) for _, table in sorted(METADATA.tables.items())),
            min((time for time in oldest if time is not None), default=None),
            _name(connection),
            str(connection.scalar(sa.select(SCHEMA.c.version))),
        )


def n_windows_since(database: Database, time: int) -> int:
    """Return the number of windows analysed since a time (UTC ns), at most `MAX_COUNTED`."""
    rows = sa.select(sa.literal(1)).select_from(OBSERVATIONS).where(OBSERVATIONS.c.stored >= time).limit(MAX_COUNTED)
    with database.reading() as connection:
        return connection.scalar(sa.select(sa.func.count()).select_from(rows.subquery())) or 0


def _count(connection: sa.Connection, table: sa.Table) -> Counted:
    """Return the number of rows of a table."""
    rows = sa.select(sa.literal(1)).select_from(table).limit(MAX_COUNTED + 1)
    n_rows = connection.scalar(sa.select(sa.func.count()).select_from(rows.subquery())) or 0
    stay = KEPT.get(table.name) or AGE_KEYS.get(table.name, "keep.results_days")
    return Counted(table.name, min(n_rows, MAX_COUNTED), n_rows > MAX_COUNTED, stay)


def _name(connection: sa.Connection) -> str:
    """Return program and version of a database."""
    version = connection.dialect.server_version_info or ()
    name = {"sqlite": "SQLite", "postgresql": "PostgreSQL"}[connection.dialect.name]
    return f"{name} {'.'.join(map(str, version))}".strip()


@dataclass(frozen=True, slots=True)
class _Day:
    """Files of a vehicle and day: time of change of the folder (None: just now), oldest start, bytes."""

    changed: int | None
    oldest: int
    size: int


class Retention:
    """Deletes old files of an archive; the contents of a folder are remembered until it changes.

    Parameters
    ----------
    folder
        Folder of the archive, as `write_archive` writes it.

    Notes
    -----
    The time of a folder changes with every file that is added or removed by any program. So a pass costs one system
    call for each vehicle and day, and one for each file only in folders that changed or lose a file. Nothing of this is
    stored: the first pass after a restart examines every file.
    """

    def __init__(self, folder: Path | str) -> None:
        self._folder = Path(folder)
        self._days: dict[str, _Day] = {}

    def prune(self, *, before: int, max_bytes: int | None = None) -> int:
        """Delete files whose samples begin before a time, then the oldest ones down to a total size.

        Parameters
        ----------
        before
            Time before which samples are deleted, UTC ns.
        max_bytes
            Largest size that may remain [bytes]; None for any.

        Returns
        -------
        int
            Number of files deleted.

        Raises
        ------
        StoreError
            If a file cannot be deleted.
        """
        with reported(self._folder, StoreError):
            self._look()
            remaining, n_deleted = sum(day.size for day in self._days.values()), 0
            # A folder stands for its oldest file, and only what comes first is opened: most never are.
            waiting: list[tuple[int, str, int | None]]
            waiting = [(day.oldest, path, None) for path, day in self._days.items()]
            heapify(waiting)
            while waiting and (waiting[0][0] < before or (max_bytes is not None and remaining > max_bytes)):
                _, path, size = heappop(waiting)
                if size is None:
                    for file in _files(path):
                        heappush(waiting, file)
                    continue
                Path(path).unlink(missing_ok=True)
                with suppress(OSError):  # other files are in it
                    Path(path).parent.rmdir()
                remaining -= size
                n_deleted += 1
        return n_deleted

    def _look(self) -> None:
        """Examine the folders of days that are new or changed."""
        days, settled = {}, time.time_ns() - _SETTLED
        for path, changed in _day_folders(self._folder):
            day = self._days.get(path)
            if day is None or day.changed != changed:
                files = _files(path)
                oldest = min((begin for begin, _, _ in files), default=_NEVER)
                day = _Day(changed if changed < settled else None, oldest, sum(size for _, _, size in files))
            days[path] = day
        self._days = days


def _day_folders(folder: Path) -> Iterator[tuple[str, int]]:
    """Yield the folders of vehicles and days with their times of change."""
    for vehicle in os.scandir(folder) if folder.is_dir() else ():
        for day in os.scandir(vehicle.path) if vehicle.is_dir() else ():
            if day.is_dir():
                yield day.path, day.stat().st_mtime_ns


def _files(folder: str) -> list[tuple[int, str, int]]:
    """Return start, path and size of the files of a day."""
    files = [(file.stat(), file.path) for file in os.scandir(folder) if file.name.endswith((".parquet", ".part"))]
    return [(facts.st_mtime_ns, path, facts.st_size) for facts, path in files]
