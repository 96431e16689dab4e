"""A database that words its errors, recovers from them, and is reserved for the one monitor that works."""

import fcntl
import os
import shutil
import sqlite3
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import IO, Any, TypeVar

from sqlalchemy import (
    URL,
    ColumnElement,
    Connection,
    Engine,
    Select,
    Table,
    create_engine,
    delete,
    event,
    func,
    select,
    text,
)
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.exc import DataError, DBAPIError, IntegrityError, StatementError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from sprung.online.store.schema import SNAPSHOTS, RefusedError, ReservationLostError, StoreError

T = TypeVar("T")

#: Longest time that a process waits for another one that writes [s].
PATIENCE = 10.0
#: Time after which PostgreSQL ends the transaction of a program that has stopped within it [ms].
_MAX_IDLE = 15_000
#: Bytes free on its disk below which a store counts as full.
MIN_FREE = 1 << 20

_CANNOT_WRITE = {sqlite3.SQLITE_FULL, sqlite3.SQLITE_READONLY, sqlite3.SQLITE_IOERR, sqlite3.SQLITE_CANTOPEN}
# https://www.postgresql.org/docs/15/errcodes-appendix.html: disk_full, io_error, read_only_sql_transaction
_CANNOT_WRITE_STATES = {"53100", "58030", "25006"}


class Database:
    """Transactions on SQLite or PostgreSQL.

    Parameters
    ----------
    url
        Address of the database.
    notices
        Sentences about problems found when it was opened.
    """

    def __init__(self, url: URL, *, notices: tuple[str, ...] = ()) -> None:
        self.engine = _engine(url)
        #: Path of the SQLite file; None with a server.
        self.path = Path(url.database or "") if url.get_backend_name() == "sqlite" else None
        self._writer = self.engine.execution_options(is_writing=True)
        self._whole = _Whole()
        self.notices = notices

    def reading(self) -> AbstractContextManager[Connection]:
        """Return a transaction that reads."""
        joined = self._whole.connection
        return _transaction(self.engine) if joined is None else nullcontext(joined)

    def writing(self) -> AbstractContextManager[Connection]:
        """Return a transaction that writes; other writers wait until it ends."""
        whole = self._whole
        if whole.stack is None:
            return self._checked()
        if whole.connection is None:
            whole.connection = whole.stack.enter_context(self._checked())
        return nullcontext(whole.connection)

    def rows(self, kind: Callable[..., T], query: Select[Any], values: Mapping[str, Any] | None = None) -> list[T]:
        """Return the rows of a query as values of a kind."""
        with self.reading() as connection:
            return [kind(**row) for row in connection.execute(query, values).mappings()]

    def row(self, kind: Callable[..., T], query: Select[Any], values: Mapping[str, Any] | None = None) -> T | None:
        """Return the first row of a query as a value of a kind; None if there is none."""
        with self.reading() as connection:
            row = connection.execute(query, values).mappings().first()
        return None if row is None else kind(**row)

    def scalar(self, query: Select[Any], values: Mapping[str, Any] | None = None) -> Any:
        """Return the first column of the first row of a query; None if there is none."""
        with self.reading() as connection:
            return connection.scalar(query, values)

    def scalars(self, query: Select[Any], values: Mapping[str, Any] | None = None) -> list[Any]:
        """Return the first column of a query."""
        with self.reading() as connection:
            return list(connection.scalars(query, values))

    def add(self, table: Table, values: Mapping[str, Any]) -> int:
        """Store a row, which the store numbers, and return its number."""
        new = {name: value for name, value in values.items() if name != "id"}
        with self.writing() as connection:
            return int(connection.execute(table.insert().values(new).returning(table.c.id)).scalar_one())

    def remove(self, table: Table, *conditions: ColumnElement[bool]) -> bool:
        """Remove rows, and return whether there were any."""
        with self.writing() as connection:
            return connection.execute(delete(table).where(*conditions)).rowcount > 0

    @contextmanager
    def together(self) -> Iterator[None]:
        """Make one transaction of all that this thread writes in the context, from the first write on.

        Within another such context it is part of that one.

        Raises
        ------
        StoreError
            If the database cannot write; nothing is stored then.
        """
        if self._whole.stack is not None:
            yield
            return
        with ExitStack() as stack:
            self._whole.stack = stack
            try:
                yield
            finally:
                self._whole.stack = self._whole.connection = None

    @contextmanager
    def checked(self, check: Callable[[Connection], None] | None) -> Iterator[None]:
        """Begin every transaction that this thread writes in the context with a check, which may refuse it."""
        before, self._whole.check = self._whole.check, check
        try:
            yield
        finally:
            self._whole.check = before

    @contextmanager
    def _checked(self) -> Iterator[Connection]:
        """Return a transaction that writes, checked first."""
        check = self._whole.check
        with _transaction(self._writer) as connection:
            if check is not None:
                check(connection)
            yield connection

    def insert(self, table: Table) -> sqlite.Insert | postgresql.Insert:
        """Return an INSERT that supports a clause for existing rows."""
        return postgresql.insert(table) if self.path is None else sqlite.insert(table)

    def size(self) -> int:
        """Return the size of the store on disk [bytes]."""
        if self.path is not None:
            files = (self.path.with_name(self.path.name + ending) for ending in ("", "-wal", "-shm"))
            return sum(file.stat().st_size for file in files if file.exists())
        return int(self.scalar(select(func.pg_database_size(func.current_database()))) or 0)

    def free(self) -> int | None:
        """Return the free space on the disk of the store [bytes]; None with a server."""
        return None if self.path is None else shutil.disk_usage(self.path.parent).free

    def check(self) -> None:
        """Write and roll back.

        Raises
        ------
        StoreError
            If the store cannot write, or its disk has less than 1 MiB left.

        Notes
        -----
        SQLite writes nothing to its disk before the commit; free space and permission are checked there.
        """
        free = self.free()
        if free is not None and free < MIN_FREE:
            raise StoreError(_cannot_write(f"its disk has {free} bytes left"))
        if self.path is not None and not (os.access(self.path, os.W_OK) and os.access(self.path.parent, os.W_OK)):
            raise StoreError(_cannot_write(f"{self.path} is read-only"))
        with self.writing() as connection:
            values = {"vehicle": "", "boot": 0, "seq": 0, "document": bytes(1 << 16)}
            connection.execute(self.insert(SNAPSHOTS).values(values).on_conflict_do_nothing())
            connection.rollback()

    def close(self) -> None:
        """Close all connections."""
        self.engine.dispose()


class Tables:
    """Tables of a subject in a database."""

    def __init__(self, database: Database) -> None:
        self._database = database


class _Whole(threading.local):
    """The transaction of a thread that others of it join, and the check of those that it begins."""

    stack: ExitStack | None = None
    connection: Connection | None = None
    check: Callable[[Connection], None] | None = None


def _engine(url: URL) -> Engine:
    """Return the engine for a database; SQLite syncs each commit, and its writers queue."""
    if url.get_backend_name() == "postgresql":
        from sprung.online.store.postgresql import connected

        server = create_engine(url, pool_pre_ping=True, pool_timeout=PATIENCE)
        event.listen(server, "do_connect", lambda dialect, record, given, settings: connected(*given, **settings))

        @event.listens_for(server, "connect")
        def limit(connection: Any, _: Any) -> None:
            connection.execute(f"SET idle_in_transaction_session_timeout = {_MAX_IDLE}")
            connection.commit()

        return server
    engine = create_engine(url, connect_args={"timeout": PATIENCE})

    @event.listens_for(engine, "connect")
    def prepare(connection: sqlite3.Connection, _: Any) -> None:
        connection.isolation_level = None  # transactions begin below, also before DDL and SELECT
        for setting in ("journal_mode=WAL", "synchronous=FULL", "foreign_keys=ON"):
            connection.execute(f"PRAGMA {setting}").close()

    @event.listens_for(engine, "begin")
    def begin(connection: Connection) -> None:
        # A transaction that reads and then writes fails immediately if another one wrote in between: lock first.
        is_writing = connection.get_execution_options().get("is_writing")
        connection.exec_driver_sql("BEGIN IMMEDIATE" if is_writing else "BEGIN")

    return engine


@contextmanager
def _transaction(engine: Engine) -> Iterator[Connection]:
    """Commit at the end, or roll back and raise any error as StoreError, those of the values as RefusedError."""
    try:
        with engine.connect() as connection:
            try:
                with connection.begin():
                    yield connection
            except (DataError, IntegrityError):
                raise
            except DBAPIError:
                connection.invalidate()
                if engine.dialect.name == "sqlite":
                    # It keeps using files that were opened on a read-only disk: reopen them next time.
                    engine.dispose()
                raise
    except DBAPIError as error:
        # SQLSTATE classes 22 (data exception) and 23 (integrity constraint violation), and those of SQLite
        kind = RefusedError if isinstance(error, DataError | IntegrityError) else StoreError
        raise kind(words_of(error.orig)) from error
    except PoolTimeoutError as error:
        raise StoreError(f"the store is busy (no connection was free for {PATIENCE:g} s): try again later") from error
    except (StatementError, UnicodeError, OverflowError) as error:
        raise RefusedError(f"the store cannot hold this: {getattr(error, 'orig', None) or error}") from error


def words_of(error: BaseException | None) -> str:
    """Return the cause of an error of a database and its remedy."""
    cause = str(error).strip().partition("\n")[0]
    code = getattr(error, "sqlite_errorcode", 0) & 0xFF
    state = getattr(error, "sqlstate", None) or ""
    if code in _CANNOT_WRITE or state in _CANNOT_WRITE_STATES:
        return _cannot_write(cause)
    if code in {sqlite3.SQLITE_BUSY, sqlite3.SQLITE_LOCKED} or state == "55P03":  # lock_not_available
        return f"the store is busy ({cause}): end the program that has held it for more than {PATIENCE:g} s"
    if code in {sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB}:
        return f"the store is damaged ({cause}): restart, which renames it and creates a new one"
    # 08: connection_exception, 57: operator_intervention; none where no server answered
    if not code and (not state or state[:2] in {"08", "57"}):
        return f"the store does not answer ({cause}): check that its database runs and can be reached"
    return f"the store refuses this: {cause}"


def _cannot_write(cause: str) -> str:
    """Return the sentence for a disk that is full or read-only."""
    return f"the store cannot write ({cause}): free space on its disk or make it writable, then it continues"


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
