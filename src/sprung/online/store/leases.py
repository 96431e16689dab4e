"""Leases: which monitor is responsible for which vehicles, and the refusal of writes after it has lost them.

Vehicles are spread over a fixed number of shards. On PostgreSQL a monitor holds shards for as long as it is heard from;
on SQLite there is one monitor, which locks a file next to the store.
"""

import fcntl
import hashlib
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import lru_cache, partial
from pathlib import Path
from typing import IO, NamedTuple

from sqlalchemy import BigInteger, Connection, Text, cast, delete, func, or_, select, update

from sprung.online.store.database import Database
from sprung.online.store.schema import LEASES, MONITORS, LeaseLostError, StoreError

#: Number of shards, the same for all programs that use a store.
N_SHARDS = 256
# Not now(), which is constant within a transaction.
_NOW = select(cast(func.extract("epoch", func.clock_timestamp()) * 1_000_000_000, BigInteger))


@lru_cache(maxsize=1 << 16)
def shard_of(vehicle: str) -> int:
    """Return the shard of a vehicle, from 0 to `N_SHARDS` - 1, the same on every machine and for ever."""
    return int.from_bytes(hashlib.blake2b(vehicle.encode(), digest_size=8).digest()) % N_SHARDS


class Lease(NamedTuple):
    """Right of a monitor to write about the vehicles of a shard, until the epoch of the shard moves on."""

    shard: int
    epoch: int


@dataclass(frozen=True, slots=True)
class Holding:
    """Shards of a monitor, and the other monitors.

    Parameters
    ----------
    epochs
        Epoch of each shard that the monitor holds.
    monitors
        Names of the monitors that are heard from.
    dead
        Monitors that were not heard from for too long, first reported by this call.
    """

    epochs: dict[int, int]
    monitors: tuple[str, ...]
    dead: tuple[str, ...]


@dataclass(frozen=True, slots=True)
class Holder:
    """A monitor that shares a store.

    Parameters
    ----------
    monitor
        Name of the monitor.
    seen
        Time when it was last heard from, UTC ns by the clock of the database.
    shards
        Number of shards that it holds.
    """

    monitor: str
    seen: int
    shards: int


class Leases:
    """Leases of the monitors on the shards of a store.

    Parameters
    ----------
    database
        Database of the store.

    Notes
    -----
    The clock of the database decides who is heard from; those of the machines are never compared. The epoch of a shard
    rises whenever its holder changes. A transaction about a vehicle locks the lease of its shard for as long as it
    lasts, so that a shard is passed on only between transactions, and refuses to write if the epoch is another one.
    """

    def __init__(self, database: Database) -> None:
        self._database = database
        self._file: IO[str] | None = None

    @property
    def is_shared(self) -> bool:
        """Whether several monitors may use the store."""
        return self._database.path is None

    def lock(self, monitor: str) -> None:
        """Reserve a file of SQLite for a monitor, until `unlock` or the end of the process, however it ends.

        Raises
        ------
        StoreError
            If another monitor uses it, or the file for the lock cannot be written.
        """
        if self._database.path is not None:
            self._file = _locked(self._database.path, monitor)

    def unlock(self) -> None:
        """Let another monitor use the file."""
        if self._file is not None:
            self._file.close()
            self._file = None

    def renew(self, monitor: str, *, patience: float) -> Holding:
        """Record that a monitor runs, and return what it holds: take shards of dead ones, give up more than its share.

        Parameters
        ----------
        monitor
            Name of the monitor, which no other ever had.
        patience
            Time without a sign of life after which a monitor counts as dead [s].

        Raises
        ------
        StoreError
            If the store does not answer.
        """
        with self._database.writing() as connection:
            now = connection.scalar(_NOW) or 0
            alive = now - round(1e9 * patience)
            row = self._database.insert(MONITORS).values(monitor=monitor, seen=now)
            connection.execute(row.on_conflict_do_update(index_elements=["monitor"], set_={"seen": now}))
            dead = _bury(connection, alive)
            living = select(MONITORS.c.monitor).where(MONITORS.c.seen >= alive)
            monitors = tuple(connection.scalars(living.order_by(MONITORS.c.monitor)))
            share = -(-N_SHARDS // max(len(monitors), 1))
            of_own = select(LEASES.c.shard).where(LEASES.c.holder == monitor).order_by(LEASES.c.shard)
            own = list(connection.scalars(of_own))
            is_free = or_(LEASES.c.holder.is_(None), LEASES.c.holder.not_in(living))
            # A row that a stopped monitor has locked is skipped until the database ends its transaction.
            free = select(LEASES.c.shard).where(is_free).order_by(LEASES.c.shard).limit(max(share - len(own), 0))
            _pass_on(connection, list(connection.scalars(free.with_for_update(skip_locked=True))), to=monitor)
            _pass_on(connection, own[share:], to=None)
            held = select(LEASES.c.shard, LEASES.c.epoch).where(LEASES.c.holder == monitor)
            return Holding({row.shard: row.epoch for row in connection.execute(held)}, monitors, tuple(dead))

    def holders(self) -> list[Holder]:
        """Return the monitors that share the store, by name; none on a file, which has one monitor."""
        shards = select(func.count()).where(LEASES.c.holder == MONITORS.c.monitor).scalar_subquery()
        query = select(MONITORS.c.monitor, MONITORS.c.seen, shards).order_by(MONITORS.c.monitor)
        with self._database.reading() as connection:
            return [Holder(*row) for row in connection.execute(query)]

    def release(self, monitor: str) -> None:
        """Give up all shards of a monitor, which stops cleanly."""
        with self._database.writing() as connection:
            own = list(connection.scalars(select(LEASES.c.shard).where(LEASES.c.holder == monitor)))
            _pass_on(connection, own, to=None)
            connection.execute(delete(MONITORS).where(MONITORS.c.monitor == monitor))

    @contextmanager
    def fence(self, *leases: Lease) -> Iterator[None]:
        """Refuse what this thread writes in the context if one of the leases has moved on; none: anybody may write.

        Raises
        ------
        LeaseLostError
            From the transactions in the context; nothing of them is stored.
        """
        with self._database.checked(partial(_check, leases=frozenset(leases)) if leases else None):
            yield


def _check(connection: Connection, leases: frozenset[Lease]) -> None:
    """Refuse to write if one of the leases has moved on; otherwise they stay until the end of the transaction."""
    shards = [lease.shard for lease in leases]
    present = select(LEASES.c.shard, LEASES.c.epoch).where(LEASES.c.shard.in_(shards)).order_by(LEASES.c.shard)
    rows = connection.execute(present.with_for_update(read=True))
    lost = sorted(shard for shard, _ in leases.difference(Lease(row.shard, row.epoch) for row in rows))
    if lost:
        numbers = ", ".join(map(str, lost))
        raise LeaseLostError(f"another monitor has taken over shard {numbers}: its vehicles are left to that one")


def _bury(connection: Connection, alive: int) -> list[str]:
    """Remove monitors that were not heard from since a time, and return their names."""
    silent = select(MONITORS.c.monitor).where(MONITORS.c.seen < alive).with_for_update(skip_locked=True)
    dead = list(connection.scalars(silent))
    if dead:
        connection.execute(delete(MONITORS).where(MONITORS.c.monitor.in_(dead)))
    return dead


def _pass_on(connection: Connection, shards: list[int], *, to: str | None) -> None:
    """Give shards to a monitor, or release them."""
    if shards:
        passed = update(LEASES).where(LEASES.c.shard.in_(shards))
        connection.execute(passed.values(holder=cast(to, Text), epoch=LEASES.c.epoch + 1))


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
