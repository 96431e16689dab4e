"""A database that words its errors in one sentence, and recovers from them."""

import os
import shutil
import sqlite3
import threading
from collections.abc import Callable, Iterator, Mapping
from contextlib import AbstractContextManager, ExitStack, contextmanager, nullcontext
from pathlib import Path
from typing import Any, TypeVar

from sqlalchemy import URL, ColumnElement, Connection, Engine, Select, Table, create_engine, delete, event, func, select
from sqlalchemy.dialects import postgresql, sqlite
from sqlalchemy.exc import DataError, DBAPIError, IntegrityError, StatementError
from sqlalchemy.exc import TimeoutError as PoolTimeoutError

from sprung.online.store.schema import SNAPSHOTS, RefusedError, StoreError

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
