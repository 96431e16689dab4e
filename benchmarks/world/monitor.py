"""The real stations on a real store, step by step: no threads, no processes, and faults at every statement."""

import sqlite3
from collections import defaultdict
from collections.abc import Callable
from contextlib import AbstractContextManager, suppress
from functools import cache, partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any
from unittest.mock import patch

from analysis import InlineWorkers
from chance import Chance, Crash
from checker import Checker
from network import Broker, SimulatedLink
from vehicle import BEGUN

from sprung.online.alerts import Message, SendError
from sprung.online.monitor import Site, Station, housekeeping, station
from sprung.online.monitor.notifier import NotificationService
from sprung.online.store import ReservationLostError, Store, StoreError, database, open_store

SENDERS = ("mail", "webhook")
_STATEMENT_FAULTS = {
    "store full": (sqlite3.SQLITE_FULL, "database or disk is full"),
    "store busy": (sqlite3.SQLITE_BUSY, "database is locked"),
    "store read-only": (sqlite3.SQLITE_READONLY, "attempt to write a readonly database"),
    "store fails to read or write": (sqlite3.SQLITE_IOERR, "disk I/O error"),
}


#: Engines of each monitor are kept, as they keep compiled statements; when a store is closed, they close their
#: connections.
_ENGINES: dict[str, Callable[..., Any]] = defaultdict(lambda: cache(database._engine))


class Unthreaded:
    """Stands for a thread or server of the station: the world does its work, step by step."""

    is_open, port = True, 0

    def __init__(self, *_: object, **__: object) -> None: ...

    def open(self) -> None: ...

    def close(self) -> None: ...


class Unhurried(NotificationService):
    """Notifiers without threads: the world lets them send."""

    def open(self) -> None:
        self.resume()


class Prompt(housekeeping.Advice):
    """Advice on inspections without a thread."""

    def step(self) -> None:
        if self._ranking.is_due:
            self._ranking.start()
            self._rank()


class People:
    """A sender whose messages the checker counts; it refuses some, and fails after others."""

    shows_pictures = False

    def __init__(self, name: str, chance: Chance, checker: Checker) -> None:
        self.name, self._chance, self._checker = name, chance, checker

    def send(self, message: Message) -> None:
        if self._chance.happens("sender refuses", self.name):
            raise SendError(f"{self.name} does not answer")
        self._checker.delivered(self.name, message)
        if self._chance.happens("sender takes a message and fails", self.name):
            self._checker.excuse(self.name, message)
            raise SendError(f"{self.name} did not confirm")
        if self._chance.happens("monitor killed as it sends", self.name):
            raise Crash("kill")


class Reservations:
    """The advisory lock of a database server: one session holds it, until it releases it or the server ends it."""

    def __init__(self) -> None:
        self.holder: Session | None = None


class Session:
    """What a monitor takes for the reservation of a store that a server keeps, as `sprung.online.store.Reservation`."""

    def __init__(self, store: Store, reservations: Reservations, chance: Chance) -> None:
        self._store, self._reservations, self._chance = store, reservations, chance

    def take(self, monitor: str) -> bool:
        self._reservations.holder = self._reservations.holder or self
        return self._reservations.holder is self

    def check(self, _transaction: object = None) -> None:
        if self._reservations.holder is self and self._chance.happens("reservation lost", "session"):
            self._reservations.holder = None
        if self._reservations.holder is not self:
            raise ReservationLostError("the session has ended")

    def fenced(self) -> AbstractContextManager[None]:
        return self._store.checked(self.check)

    def release(self) -> None:
        if self._reservations.holder is self:
            self._reservations.holder = None


class Monitor:
    """A monitor, which is killed and starts again on the same store.

    Parameters
    ----------
    name
        Name of the monitor.
    path
        File of the store.
    broker
        Broker of its link.
    chance
        Decides what fails.
    checker
        Knows all messages to people.
    reservations
        Which monitor works on the store; None: there is no other.
    """

    def __init__(
        self,
        name: str,
        path: Path,
        *,
        broker: Broker,
        chance: Chance,
        checker: Checker,
        reservations: Reservations | None,
    ) -> None:
        self.name, self._path, self._broker, self._chance, self._checker = name, path, broker, chance, checker
        self._reservations = reservations
        self._station: Station | None = None
        self._store: Store | None = None
        self.free = 10**12

    @property
    def is_on(self) -> bool:
        """Whether the monitor runs."""
        return self._station is not None

    @property
    def station(self) -> Station:
        """The station of the running monitor."""
        assert self._station is not None
        return self._station

    def start(self) -> None:
        """Start on the store as it is."""
        self._guarded(self._start)

    def step(self) -> None:
        """Let the station do what is due."""
        if self._station is not None:
            self._guarded(self._station.step)

    def post(self) -> None:
        """Let the notifiers send what is due."""
        if self._station is not None:
            self._guarded(partial(self._post, self._station))

    def kill(self) -> None:
        """End the monitor at once."""
        self._chance.note("killed", self.name)
        self._checker.monitor_ended(self.name)
        self.end()

    def end(self) -> None:
        """Forget the process."""
        for link in list(self._broker.links):
            if link.name == self.name:
                link.close()
        if self._store is not None:
            faultless(self._store)
            self._store.close()  # releases its reservation
        self._station = self._store = None

    def _start(self) -> None:
        url = f"sqlite:///{self._path}"
        self._store = opened(url, self.name)
        vars(self._store)["free"] = lambda: self.free
        faulty(self._store, self._chance)
        if self._reservations is not None:
            vars(self._store)["reservation"] = Session(self._store, self._reservations, self._chance)
        self._station = new_station(
            self._store,
            url,
            connect=partial(SimulatedLink, self._broker, self.name),
            workers=InlineWorkers(self._chance, on_failed=partial(self._checker.failed, self.name)),
            senders=[People(name, self._chance, self._checker) for name in SENDERS],
            now=lambda: self._chance.now,
            clock=lambda: self._chance.clock(self.name),
        )
        self._station.open()

    def _post(self, running: Station) -> None:
        for sender in SENDERS:
            running._heartbeats.on_heartbeat(f"post {sender}")
        if running._is_active:
            with suppress(StoreError), running._store.reservation.fenced():  # as the thread that does this otherwise
                running._notifications.send()

    def _guarded(self, act: Callable[[], None]) -> None:
        """Do something that may end the monitor."""
        try:
            act()
        except (Crash, StoreError) as end:  # a store that cannot be used at the start ends the program
            self._chance.note(f"ends: {end}", self.name)
            self.kill()
        except ReservationLostError:
            self._chance.note("stops working", self.name)
            self._guarded(self.station.close)
            self.kill()
        self._checker.look()


def new_station(
    store: Store,
    url: str,
    *,
    connect: Callable[..., Any],
    workers: Any,
    senders: list[Any],
    now: Callable[[], float],
    clock: Callable[[], float] | None = None,
) -> Station:
    """Return a station without threads."""
    with (
        patch.object(station, "NotificationService", Unhurried),
        patch.object(housekeeping, "Advice", Prompt),
        patch.object(station, "senders_of", lambda *_: senders),
    ):
        return Station(
            site(url),
            store,
            connect=connect,
            workers=workers,
            clock=lambda: BEGUN + round(1e9 * (clock or now)()),
            timer=now,
            sleep=lambda _seconds: None,
        )


@cache
def site(url: str) -> Site:
    """Return the settings: no archive, a disk that is checked, alerts at the first window."""
    return Site.model_validate({"store": url, "keep": {"raw_days": 0}, "alerts": {"silent_after_minutes": 0.5}})


def opened(url: str, monitor: str = "") -> Store:
    """Return a store, with the engine of a monitor."""
    with patch.object(database, "_engine", _ENGINES[monitor]):
        return open_store(url)


@cache
def empty_store() -> bytes:
    """Return the content of a new store."""
    with TemporaryDirectory() as folder:
        path = Path(folder) / "store.sqlite"
        open_store(f"sqlite:///{path}").close()
        return path.read_bytes()


def faulty(store: Store, chance: Chance) -> None:
    """Let statements and commits of a store fail, or end the process, as chance has it."""
    dialect = store.engine.dialect
    execute, execute_many, commit = dialect.do_execute, dialect.do_executemany, dialect.do_commit

    def fail(name: str) -> None:
        code, text = _STATEMENT_FAULTS[name]
        error = sqlite3.OperationalError(text)
        error.sqlite_errorcode = code
        raise error

    def check(statement: str) -> None:
        what = statement.split(None, 1)[0]
        if chance.happens("monitor killed at a statement", what):
            raise Crash("kill")
        for name in _STATEMENT_FAULTS:
            if chance.happens(name, what):
                fail(name)

    def do_execute(cursor: Any, statement: str, parameters: Any, context: Any = None) -> None:
        check(statement)
        execute(cursor, statement, parameters, context)

    def do_executemany(cursor: Any, statement: str, parameters: Any, context: Any = None) -> None:
        check(statement)
        execute_many(cursor, statement, parameters, context)

    def do_commit(connection: Any) -> None:
        if not connection.dbapi_connection.in_transaction:
            commit(connection)
            return
        if chance.happens("monitor killed at a commit", "COMMIT"):
            raise Crash("kill")
        commit(connection)
        if chance.happens("monitor killed after a commit", "COMMIT"):
            raise Crash("kill")
        if chance.happens("commit done but reported as failed", "COMMIT"):
            fail("store fails to read or write")

    vars(dialect).update(do_execute=do_execute, do_executemany=do_executemany, do_commit=do_commit)


def faultless(store: Store) -> None:
    """Let statements and commits of a store succeed again."""
    dialect = store.engine.dialect
    for name in ("do_execute", "do_executemany", "do_commit"):
        vars(dialect).pop(name, None)
