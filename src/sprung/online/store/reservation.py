"""Reservation of a store for the one monitor that works on it; others stand by."""

import fcntl
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any

from sqlalchemy import Connection, text
from sqlalchemy.exc import DBAPIError

from sprung.online.store.database import Database, words_of
from sprung.online.store.schema import ReservationLostError, StoreError

#: Number of the advisory lock of the monitor that works.
MONITOR_LOCK = 0x737072756E68
#: Number of the lock that each of its transactions shares.
_TRANSACTIONS = 0x737072756E69
#: The server ends a session 20 s after its machine has vanished.
_KEEPALIVES = {"tcp_keepalives_idle": "5", "tcp_keepalives_interval": "5", "tcp_keepalives_count": "3"}
_IS_HELD = text("SELECT EXISTS (SELECT 1 FROM pg_locks WHERE locktype = 'advisory' AND granted AND pid = :pid)")


class Reservation:
    """Right to work on a store: a locked file next to a file, a lock of a connection of its own on PostgreSQL.

    Parameters
    ----------
    database
        Database of the store.

    Notes
    -----
    PostgreSQL releases the lock when the connection ends, however it ends, so that a lost connection is a lost
    reservation. A transaction of the monitor shares a second lock from before it checks the first until it ends;
    whoever takes over waits for that lock once, and so for all transactions that passed the check.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._file: IO[str] | None = None
        self._connection: Any = None
        self._pid = 0

    def take(self, monitor: str) -> bool:
        """Return whether the store could be reserved; False: another monitor works on PostgreSQL.

        Raises
        ------
        StoreError
            If another monitor uses a file, or the store does not answer.
        """
        if self._database.path is not None:
            self._file = self._file or _locked(self._database.path, monitor)
            return True
        if self._connection is None:
            self._connection = self._connected()
        try:
            self._ask("SELECT set_config('application_name', %s, false)", monitor)
            if not self._ask("SELECT pg_try_advisory_lock(%s)", MONITOR_LOCK):
                return False
            self._ask("SELECT pg_advisory_lock(%s)", _TRANSACTIONS)
            self._ask("SELECT pg_advisory_unlock(%s)", _TRANSACTIONS)
            self._pid = self._connection.info.backend_pid
        except ReservationLostError as error:
            raise StoreError(str(error)) from None
        return True

    def check(self) -> None:
        """Raise `ReservationLostError` if the connection that holds the lock is lost."""
        if self._database.path is None:
            self._ask("SELECT %s", 1)

    @contextmanager
    def fenced(self) -> Iterator[None]:
        """Begin every transaction that this thread writes in the context with a check; `ReservationLostError`: none."""
        with self._database.checked(None if self._database.path is not None else self._check_transaction):
            yield

    def release(self) -> None:
        """Let another monitor work on the store."""
        if self._file is not None:
            self._file.close()
            self._file = None
        if self._connection is not None:
            with suppress(self._database.engine.dialect.loaded_dbapi.Error):
                self._connection.execute("SELECT pg_advisory_unlock_all()")
            self._connection.close()
            self._connection = None

    def _check_transaction(self, connection: Connection) -> None:
        """Refuse to write without the lock; otherwise a successor waits for the transaction."""
        connection.execute(text("SELECT pg_advisory_xact_lock_shared(:lock)"), {"lock": _TRANSACTIONS})
        if not connection.scalar(_IS_HELD, {"pid": self._pid}):
            raise ReservationLostError("the connection that reserved the store was lost: nothing more is stored")

    def _connected(self) -> Any:
        """Return a connection that commits at once, and that the server ends soon after its machine has vanished."""
        try:
            pooled = self._database.engine.raw_connection()
        except DBAPIError as error:
            raise StoreError(words_of(error.orig)) from error
        connection: Any = pooled.dbapi_connection
        pooled.detach()
        connection.autocommit = True
        for name, value in _KEEPALIVES.items():
            connection.execute(f"SET {name} = {value}")
        return connection

    def _ask(self, query: str, value: int | str) -> Any:
        """Return what the server answers on the connection that holds the lock."""
        try:
            return self._connection.execute(query, (value,)).fetchone()[0]
        except self._database.engine.dialect.loaded_dbapi.Error as error:
            self.release()
            raise ReservationLostError(f"the connection that reserved the store was lost ({error})") from error


def _locked(store: Path, monitor: str) -> IO[str]:
    """Return the locked file next to a store, with the name of the monitor in it."""
    path = store.with_name(f"{store.name}.lock")
    try:
        file = path.open("a+", encoding="utf-8")
    except OSError as error:
        raise StoreError(f"{path} cannot be written ({error.strerror}): make its folder writable") from None
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except OSError:
        with file:
            file.seek(0)
            holder = file.read().strip() or "its name is unknown"
        raise StoreError(
            f"the store {store} is used by another monitor ({holder}): stop that one first, or let both use PostgreSQL"
        ) from None
    file.truncate(0)
    file.write(f"{monitor} since {datetime.now(UTC):%Y-%m-%d %H:%M:%S} UTC\n")
    file.flush()
    return file
