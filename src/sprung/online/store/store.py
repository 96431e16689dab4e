"""The store, and how it is opened."""

import sqlite3
from contextlib import closing, suppress
from datetime import UTC, datetime
from pathlib import Path
from typing import Self

from sqlalchemy import URL, Connection, func, inspect, make_url, select
from sqlalchemy.exc import ArgumentError

from sprung.errors import ParameterError
from sprung.online.store.alerts import Alerts
from sprung.online.store.database import PATIENCE, Database, Reservation
from sprung.online.store.fleet import Fleet
from sprung.online.store.inbox import Inbox, Quarantine
from sprung.online.store.people import Accounts, Requests, Verdicts
from sprung.online.store.results import Results
from sprung.online.store.retention import Ages, delete_older
from sprung.online.store.schema import METADATA, SCHEMA, SCHEMA_VERSION, VEHICLES, StoreError

# Number of the lock on PostgreSQL while tables are created: any, but the same in every program.
_CREATING = 0x737072756E67
# How files of SQLite begin and are usually called: one of such a name that begins otherwise is damaged.
_SQLITE, _ENDINGS = b"SQLite format 3\0", {".sqlite", ".sqlite3", ".db"}
# The header or a page makes no sense, or the disk cannot read it.
_DAMAGED = {
    sqlite3.SQLITE_CORRUPT,
    sqlite3.SQLITE_NOTADB,
    sqlite3.SQLITE_IOERR_READ,
    sqlite3.SQLITE_IOERR_SHORT_READ,
    sqlite3.SQLITE_IOERR_CORRUPTFS,
}


class Store(Database):
    """Results and state of the monitor; each method is one transaction, from any thread. Made by `open_store`.

    Methods that are called within `together` are one transaction.

    Parameters
    ----------
    url
        Address of the database.
    notices
        Sentences about problems found when it was opened.

    Attributes
    ----------
    inbox
        Vehicles and their frames that wait for analysis.
    results
        Observations, modes, findings, baselines and snapshots.
    quarantine
        Frames and states that could not be used.
    alerts
        Alerts with their history, and notifications.
    requests
        Commands for the monitor, and the audit trail.
    reservation
        Right of one monitor to work on the store.
    fleet
        The fleet in order of urgency, for people.
    accounts
        People and programs that may use the interface.
    verdicts
        Verdicts of the workshop on alerts.
    """

    def __init__(self, url: URL, *, notices: tuple[str, ...] = ()) -> None:
        super().__init__(url, notices=notices)
        self.inbox = Inbox(self)
        self.results = Results(self)
        self.quarantine = Quarantine(self)
        self.alerts = Alerts(self)
        self.requests = Requests(self)
        self.reservation = Reservation(self)
        self.fleet = Fleet(self)
        self.accounts = Accounts(self)
        self.verdicts = Verdicts(self)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    @property
    def folder(self) -> Path | None:
        """Folder of the SQLite file; None with a server."""
        return None if self.path is None else self.path.parent

    def close(self) -> None:
        """Close all connections, and let another monitor work on the store."""
        self.reservation.release()
        super().close()

    def delete_older(
        self, before: int, *, audit_before: int | None = None, boots_before: int | None = None, limit: int = 10**9
    ) -> int:
        """Delete what is older than a time, by the rules of `sprung.online.store.retention`.

        Parameters
        ----------
        before
            Time, UTC ns, before which results, notifications and requests are deleted. Results count from when they
            were stored or from their t0, whichever is later, so that those of an old recording that is replayed stay.
        audit_before
            The same for the audit trail and the history of alerts; None: `before`.
        boots_before
            The same for the progress of finished starts of boxes; None: `before`.
        limit
            Number of rows at which to stop; the rest is deleted the next time.

        Returns
        -------
        int
            Number of rows deleted. A file of SQLite keeps its size and reuses the space.

        Notes
        -----
        Rows are deleted in batches, so that no transaction keeps other writers waiting for long.
        """
        ages = Ages(
            before,
            audit=before if audit_before is None else audit_before,
            boots=before if boots_before is None else boots_before,
        )
        return delete_older(self, ages, limit=limit)


def open_store(url: str) -> Store:
    """Open a store, and create it if needed.

    Parameters
    ----------
    url
        ``sqlite:///folder/file.sqlite`` (four slashes before an absolute path) or ``postgresql://user@host/database``.

    Raises
    ------
    ParameterError
        If the address is neither of these.
    StoreError
        If the store cannot be opened, can be read by other users, or has the tables of another version.

    Notes
    -----
    A SQLite file is made for its owner alone, and refused if others can read it.

    A damaged SQLite file is renamed to ``<name>.corrupt-<time>``, which `Store.notices` reports.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> with TemporaryDirectory() as folder, open_store(f"sqlite:///{folder}/sprung.sqlite") as store:
    ...     store.inbox.put_vehicle("bus-17", configuration="", description="", channels=[["acc_fl", "m/s^2"]], now=0)
    ...     store.inbox.vehicle("bus-17").channels
    [['acc_fl', 'm/s^2']]
    """
    address = check_address(url)
    is_file = address.get_backend_name() == "sqlite"
    store = Store(address, notices=_prepare(Path(address.database or "")) if is_file else ())
    try:
        with store.writing() as connection:
            _create_tables(connection)
    except BaseException:
        store.close()
        raise
    return store


def _create_tables(connection: Connection) -> None:
    """Create the tables in an empty database, and refuse those of another version."""
    if connection.dialect.name == "postgresql":
        connection.execute(select(func.pg_advisory_xact_lock(_CREATING)))
    tables = inspect(connection)
    if tables.has_table(SCHEMA.name):
        version = connection.scalar(select(SCHEMA.c.version))
        if version == SCHEMA_VERSION:
            return
    elif tables.has_table(VEHICLES.name):
        version = None
    else:
        METADATA.create_all(connection)
        connection.execute(SCHEMA.insert().values(version=SCHEMA_VERSION))
        return
    raise StoreError(
        f"the store has the schema {version or 'of a trial version'}, and this program uses {SCHEMA_VERSION}: "
        f"install the sprung that wrote it, or open another store"
    )


def check_address(url: str) -> URL:
    """Return the parts of the address of a store, or raise what is wrong with it.

    Raises
    ------
    ParameterError
        If the address is not that of a store.

    Examples
    --------
    >>> check_address("sqlite:///sprung-data/sprung.sqlite").database
    'sprung-data/sprung.sqlite'
    >>> check_address("postgresql://sprung@depot/fleet").drivername
    'postgresql+psycopg'
    """
    try:
        address = make_url(url)
    except ArgumentError:
        raise ParameterError(f"{url!r} is not the address of a store: {_FORMS}") from None
    if address.drivername == "postgresql":
        address = address.set(drivername="postgresql+psycopg")
    hidden = address.render_as_string(hide_password=True)
    if address.drivername not in {"sqlite", "postgresql+psycopg"}:
        raise ParameterError(f"{hidden!r} is an address of neither SQLite nor PostgreSQL: {_FORMS}")
    if address.drivername == "sqlite" and address.database in {None, "", ":memory:"}:
        raise ParameterError(f"{hidden!r} names no file, and a store must outlast its program: {_FORMS}")
    return address


_FORMS = "write sqlite:///folder/file.sqlite or postgresql://user@host/database"


def _prepare(path: Path) -> tuple[str, ...]:
    """Make a file of SQLite for its owner alone, or rename it if it is damaged, and return notices."""
    try:
        path.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
        with suppress(FileExistsError):
            path.touch(mode=0o600, exist_ok=False)
            return ()
        _check_is_store(path)
        if path.stat().st_mode & 0o077:
            raise StoreError(
                f"other users of this machine can read or write the store {path}, which holds hashes of passwords and "
                f"tokens: make it private with chmod -R go= {path.parent}"
            )
        damage = _damage(path)
        if damage is None:
            return ()
        notice = _renamed(path, damage)
        path.touch(mode=0o600)
        return (notice,)
    except (OSError, sqlite3.Error) as error:
        raise StoreError(
            f"the store {path} cannot be opened ({error}): check that its folder and disk can be written"
        ) from error


def _check_is_store(path: Path) -> None:
    """Refuse a file that is not a store by name and content: no recording may be quarantined."""
    with path.open("rb") as file:
        begin = file.read(len(_SQLITE))
    if begin and begin != _SQLITE and path.suffix not in _ENDINGS:
        raise ParameterError(f"{path} is not a store but another file: give a new name, such as {path.stem}.sqlite")


def _damage(path: Path) -> str | None:
    """Return what is wrong inside a file of SQLite."""
    with closing(sqlite3.connect(path, timeout=PATIENCE)) as connection:
        try:
            (found,) = connection.execute("PRAGMA quick_check(1)").fetchone()
        except sqlite3.DatabaseError as error:
            code = getattr(error, "sqlite_errorcode", 0)
            if code not in _DAMAGED and code & 0xFF not in _DAMAGED:
                raise
            return str(error)
    return None if found == "ok" else " ".join(str(found).split())


def _renamed(path: Path, damage: str) -> str:
    """Rename a damaged file, its log first, and return the sentence about it."""
    kept = path.with_name(f"{path.name}.corrupt-{datetime.now(UTC):%Y%m%dT%H%M%S}")
    for ending in ("-wal", "-shm", ""):
        part = path.with_name(path.name + ending)
        if part.exists():
            part.rename(kept.with_name(kept.name + ending))
    return f"the store {path} was damaged ({damage}): it is kept as {kept.name}, and a new one was created"
