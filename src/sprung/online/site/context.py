"""Context that requests share: the store, the settings, and the running monitor."""

import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from ipaddress import ip_address
from typing import Annotated

from fastapi import Depends, Request

from sprung.online.monitor import Site
from sprung.online.site.diagrams import DiagramDesk
from sprung.online.site.guard import Attempts
from sprung.online.site.live import Feed
from sprung.online.site.runs import RunResults
from sprung.online.store import Store

#: Time for which the state of a parked vehicle counts as its present one, ns.
_PARKED = 86400 * 10**9


@dataclass(frozen=True, eq=False)
class Context:
    """Context that requests share.

    Parameters
    ----------
    store
        Store of the monitor.
    site
        Settings of the monitor.
    figures
        Function that returns those figures of the running monitor that need no store.
    troubles
        Function that returns a sentence about each problem of the monitor; it needs no store.
    clock
        Present time, UTC ns.
    timer
        Present time [s] of a monotonic clock.
    feed
        Changes of the store, as they happen.
    attempts
        Limits of attempts to log in.
    diagrams
        Diagrams of windows, computed one at a time.
    runs
        Results of runs over the fleet.
    """

    store: Store
    site: Site
    figures: Callable[[], Mapping[str, float]]
    troubles: Callable[[], list[str]]
    clock: Callable[[], int] = time.time_ns
    timer: Callable[[], float] = time.monotonic
    feed: Feed = field(init=False)
    attempts: Attempts = field(init=False)
    diagrams: DiagramDesk = field(default_factory=DiagramDesk)
    runs: RunResults = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "feed", Feed(self.store))
        object.__setattr__(self, "attempts", Attempts(self.timer))
        object.__setattr__(self, "runs", RunResults(self.site.keep.results, self.timer))

    @property
    def is_secure(self) -> bool:
        """Whether browsers reach this server by TLS."""
        return self.site.web.certificate is not None or self.site.web.behind_proxy

    @property
    def is_private(self) -> bool:
        """Whether only programs of this machine reach this server."""
        return is_loopback(self.site.http_address[0]) and not self.site.web.behind_proxy

    @property
    def is_open(self) -> bool:
        """Whether no log-in is needed: this machine alone is served, and there are no accounts."""
        return is_loopback(self.site.http_address[0]) and not self.store.accounts.n_accounts()

    @property
    def silent_before(self) -> int:
        """Time, UTC ns, before which the last message of a silent vehicle came."""
        return self.clock() - round(60e9 * self.site.alerts.silent_after_minutes)

    def is_old(self, last_seen: int, *, is_parked: bool) -> bool:
        """Return whether the last message of a vehicle [UTC ns] is too old for a statement about its present state."""
        return last_seen < (self.clock() - _PARKED if is_parked else self.silent_before)


def is_loopback(host: str) -> bool:
    """Return whether a host is this machine alone."""
    try:
        return host == "localhost" or ip_address(host).is_loopback
    except ValueError:
        return False


def context_of(request: Request) -> Context:
    """Return the context that requests share."""
    context: Context = request.app.state.context
    return context


def known_vehicles(context: Context) -> Callable[[Collection[str]], Collection[str]]:
    """Return a function that selects the vehicles that the monitor knows."""
    return lambda names: {name for name in names if context.store.inbox.vehicle(name) is not None}


Shared = Annotated[Context, Depends(context_of)]
