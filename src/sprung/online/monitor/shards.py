"""The vehicles that this monitor is responsible for, among several monitors on one store."""

import os
import secrets
import socket
from collections.abc import Callable, Collection
from contextlib import AbstractContextManager
from dataclasses import dataclass

from sprung.link import Every
from sprung.online.store import Holding, Lease, LeaseLostError, Store, shard_of

#: Time between renewals, and the shortest time after which a monitor counts as dead [s].
_RENEW = 2.0


@dataclass(frozen=True, slots=True)
class Change:
    """Shards that a monitor has just gained and lost, monitors that have died, and whether the set of them changed."""

    gained: Collection[int] = ()
    lost: Collection[int] = ()
    dead: tuple[str, ...] = ()
    is_other_crew: bool = False


class Shards:
    """Shards of this monitor: on a file all of them, on a server its share of them for as long as it renews them.

    Parameters
    ----------
    store
        Store with the leases.
    patience
        Time without a sign of life after which a monitor counts as dead [s].
    timer
        Present time [s] of a monotonic clock.
    name
        Name of this monitor in words, which its process and a random number make unique.
    """

    def __init__(self, store: Store, *, patience: float, timer: Callable[[], float], name: str = "") -> None:
        self._leases, self._patience = store.leases, patience
        self._name = name or f"{socket.gethostname()}, process {os.getpid()}, start {secrets.token_hex(4)}"
        self._holding = Holding({}, (), ())
        self._renewing, self._expiring = Every(_RENEW, timer), Every(patience, timer)

    @property
    def is_shared(self) -> bool:
        """Whether there may be other monitors."""
        return self._leases.is_shared

    @property
    def is_first(self) -> bool:
        """Whether this monitor does what is to be done once for all vehicles: the holder of the first shard.

        No transaction can refuse what it sends, so it stops if it has not renewed its leases for too long.
        """
        return not self.is_shared or (0 in self._holding.epochs and not self._expiring.is_due)

    @property
    def held(self) -> Collection[int]:
        """Shards of this monitor on a server."""
        return self._holding.epochs.keys()

    @property
    def name(self) -> str:
        """Name of this monitor, which no other ever had."""
        return self._name

    @property
    def monitors(self) -> Collection[str]:
        """Names of the monitors that run, this one included."""
        return {self._name, *self._holding.monitors}

    def open(self) -> None:
        """Reserve a file for this monitor.

        Raises
        ------
        StoreError
            If another monitor uses the file.
        """
        self._leases.lock(self._name)

    def renew(self) -> Change:
        """Renew the leases if it is time, and return what has changed.

        Raises
        ------
        StoreError
            If the store does not answer.
        """
        if not self.is_shared or not self._renewing.is_due:
            return Change()
        self._renewing.start()
        # Taken before the query, as the database counts from its arrival.
        self._expiring.start()
        before, self._holding = self._holding, self._leases.renew(self._name, patience=self._patience)
        # A shard of another epoch was held by another monitor meanwhile: what is open of it is out of date.
        kept = before.epochs.items() & self._holding.epochs.items()
        gained, lost = (dict(holding.epochs.items() - kept) for holding in (self._holding, before))
        is_other_crew = before.monitors != self._holding.monitors
        return Change(gained.keys(), lost.keys(), self._holding.dead, is_other_crew)

    def holds(self, vehicle: str) -> bool:
        """Return whether this monitor is responsible for a vehicle, as far as it knows: the store decides."""
        return not self.is_shared or shard_of(vehicle) in self._holding.epochs

    def fence(self, *vehicles: str) -> AbstractContextManager[None]:
        """Return a context that refuses to write about vehicles after a shard of theirs was lost.

        Raises
        ------
        LeaseLostError
            If it was lost before, or from a transaction in the context.
        """
        if not self.is_shared:
            return self._leases.fence()
        for vehicle in vehicles:
            if not self.holds(vehicle):
                raise LeaseLostError(f"{vehicle} was taken over by another monitor")
        shards = map(shard_of, vehicles)
        return self._leases.fence(*(Lease(shard, self._holding.epochs[shard]) for shard in shards))

    def close(self) -> None:
        """Let others take over at once.

        Raises
        ------
        StoreError
            If the store does not answer: they take over later.
        """
        if self._renewing.started is not None:
            self._leases.release(self._name)
        self._holding = Holding({}, (), ())
        self._leases.unlock()
