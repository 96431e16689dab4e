"""Contents of a store: rows of each table, its oldest results, its schema and its database."""

from dataclasses import dataclass

from sqlalchemy import Connection, Table, func, literal, select

from sprung.online.store.database import Database
from sprung.online.store.retention import KEPT
from sprung.online.store.schema import FINDINGS, METADATA, MODES, OBSERVATIONS, SCHEMA

#: Number of rows at which counting ends, so that a large store answers soon, too.
MAX_COUNTED = 1_000_000
#: Key of the site file by which rows of a table are deleted; those of the others stay, see `KEPT`.
AGE_KEYS = {
    **dict.fromkeys(
        (
            "observations",
            "modes",
            "findings",
            "baselines",
            "notifications",
            "commands",
            "quarantine",
            "sessions",
        ),
        "keep.results_days",
    ),
    **dict.fromkeys(("alert_history", "audit"), "keep.audit_days"),
    "cursors": "keep.boots_days",
}


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
            connection.scalar(select(func.min(table.c.stored)).where(table.c.stored > 0))
            for table in (OBSERVATIONS, MODES, FINDINGS)
        ]
        return Contents(
            tuple(_count(connection, table) for _, table in sorted(METADATA.tables.items())),
            min((time for time in oldest if time is not None), default=None),
            _name(connection),
            str(connection.scalar(select(SCHEMA.c.version))),
        )


def n_windows_since(database: Database, time: int) -> int:
    """Return the number of windows analysed since a time (UTC ns), at most `MAX_COUNTED`."""
    rows = select(literal(1)).select_from(OBSERVATIONS).where(OBSERVATIONS.c.stored >= time).limit(MAX_COUNTED)
    with database.reading() as connection:
        return connection.scalar(select(func.count()).select_from(rows.subquery())) or 0


def _count(connection: Connection, table: Table) -> Counted:
    """Return the number of rows of a table."""
    rows = select(literal(1)).select_from(table).limit(MAX_COUNTED + 1)
    n_rows = connection.scalar(select(func.count()).select_from(rows.subquery())) or 0
    stay = AGE_KEYS.get(table.name) or KEPT[table.name]
    return Counted(table.name, min(n_rows, MAX_COUNTED), n_rows > MAX_COUNTED, stay)


def _name(connection: Connection) -> str:
    """Return program and version of a database."""
    version = connection.dialect.server_version_info or ()
    name = {"sqlite": "SQLite", "postgresql": "PostgreSQL"}[connection.dialect.name]
    return f"{name} {'.'.join(map(str, version))}".strip()
