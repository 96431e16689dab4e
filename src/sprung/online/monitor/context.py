"""What the parts of a running monitor share."""

import time
from collections.abc import Callable
from dataclasses import dataclass, field

from sprung.online.monitor.alert_book import AlertBook
from sprung.online.monitor.site import Site
from sprung.online.store import Store


@dataclass(frozen=True, eq=False, slots=True)
class Context:
    """Settings, store, alerts and clocks of a monitor.

    Parameters
    ----------
    site
        Settings.
    store
        Open store.
    clock
        Present time, UTC ns.
    timer
        Present time [s] of a monotonic clock.
    """

    site: Site
    store: Store
    clock: Callable[[], int] = time.time_ns
    timer: Callable[[], float] = time.monotonic
    alerts: AlertBook = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "alerts", AlertBook(self.store, self.site.alerts.settings))
