"""Context that requests share: the store, the settings, and the running monitor."""

import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from ipaddress import ip_address
from typing import Annotated

from fastapi import Depends, Request

from sprung.online.monitor import Site
from sprung.online.store import Store


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
    """

    store: Store
    site: Site
    figures: Callable[[], Mapping[str, float]]
    troubles: Callable[[], list[str]]
    clock: Callable[[], int] = time.time_ns
    timer: Callable[[], float] = time.monotonic

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


Shared = Annotated[Context, Depends(context_of)]
