"""Requests of operators to the running monitor, and the audit trail."""

from typing import Any

from sqlalchemy import select, update

from sprung.online.store.database import Database
from sprung.online.store.rows import AuditRow, CommandRow
from sprung.online.store.schema import AUDIT, COMMANDS


class Requests:
    """Requests and the audit trail, which keeps everything for as long as the site file states.

    Parameters
    ----------
    database
        Database of the store.
    """

    def __init__(self, database: Database) -> None:
        self._database = database

    def audit(self, who: str, act: str, subject: str, detail: Any = None, *, now: int) -> None:
        """Record who did what to what; `detail` is anything that JSON can hold."""
        with self._database.writing() as connection:
            row = {"time": now, "who": who, "act": act, "subject": subject, "detail": detail}
            connection.execute(AUDIT.insert(), row)

    def audited(self, *, act: str | None = None, before: int | None = None, limit: int | None = None) -> list[AuditRow]:
        """Return the record in order.

        Parameters
        ----------
        act
            Name of an action; None: all actions.
        before
            Number of an entry, which is left out with all later ones; None: no entry is.
        limit
            Largest number of entries, of which the last are returned; None: no limit.
        """
        query = select(AUDIT).order_by(AUDIT.c.id.desc()).limit(limit)
        if act is not None:
            query = query.where(AUDIT.c.act == act)
        if before is not None:
            query = query.where(AUDIT.c.id < before)
        with self._database.reading() as connection:
            rows = connection.execute(query).mappings().all()
            return [AuditRow(**row) for row in reversed(rows)]

    def add_command(self, who: str, vehicle: str, act: str, detail: Any = None, *, now: int) -> int:
        """Store a request to the running monitor, with an entry in the audit trail, and return its number."""
        row = {"created": now, "who": who, "vehicle": vehicle, "act": act, "detail": detail}
        record = {"time": now, "who": who, "act": act, "subject": vehicle, "detail": detail}
        with self._database.writing() as connection:
            connection.execute(AUDIT.insert(), record)
            return int(connection.execute(COMMANDS.insert().values(row).returning(COMMANDS.c.id)).scalar_one())

    def open_commands(self) -> list[CommandRow]:
        """Return open requests, the oldest first."""
        query = select(COMMANDS).where(COMMANDS.c.done.is_(None)).order_by(COMMANDS.c.id)
        with self._database.reading() as connection:
            return [CommandRow(**row) for row in connection.execute(query).mappings()]

    def commands_of(self, vehicle: str) -> list[CommandRow]:
        """Return the requests about a vehicle, open and done, the oldest first."""
        query = select(COMMANDS).where(COMMANDS.c.vehicle == vehicle).order_by(COMMANDS.c.id)
        with self._database.reading() as connection:
            return [CommandRow(**row) for row in connection.execute(query).mappings()]

    def command(self, command_id: int) -> CommandRow | None:
        """Return a request, open or done; None if the number is unknown."""
        with self._database.reading() as connection:
            row = connection.execute(select(COMMANDS).where(COMMANDS.c.id == command_id)).mappings().first()
            return None if row is None else CommandRow(**row)

    def command_done(self, command_id: int, now: int, *, detail: Any = None) -> None:
        """Store that a request was completed; `detail` replaces that of the request, if given."""
        statement = update(COMMANDS).where(COMMANDS.c.id == command_id, COMMANDS.c.done.is_(None))
        with self._database.writing() as connection:
            connection.execute(statement.values(done=now, **({} if detail is None else {"detail": detail})))
