"""The monitor: link, store, workers and alerts together, in one loop."""

import logging
import queue
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from functools import partial

from sprung.link import UPWARDS, VERSION, Key, Link, message, topic
from sprung.monitor.alert_book import AlertBook
from sprung.monitor.desk import alert_in_words
from sprung.monitor.dispatch import Dispatch
from sprung.monitor.gate import Gate
from sprung.monitor.intake import MONITOR, Intake
from sprung.monitor.ledger import Ledger
from sprung.monitor.pictures import alert_picture
from sprung.monitor.postman import Posting, Postman, senders_of
from sprung.monitor.serving import Serving
from sprung.monitor.site import Site
from sprung.monitor.upkeep import Upkeep
from sprung.monitor.workers import VehicleStatus, Workers
from sprung.storage import Store

LOG = logging.getLogger("sprung.monitor")

#: Largest number of messages taken in together, and of messages that may wait.
_BATCH, _MOST_WAITING = 2000, 50_000


class Station:
    """Monitors all vehicles that send.

    Parameters
    ----------
    site
        Settings.
    store
        Open store.
    connect
        Function of topics, message handler and will that returns a link, such as `partial(Link, address, name)`.
    workers
        Processes that analyse.
    clock
        Present time, UTC ns.
    timer
        Present time [s] of any clock that only goes forward.
    sleep
        Function that waits for a time [s].
    """

    def __init__(
        self,
        site: Site,
        store: Store,
        *,
        connect: Callable[..., Link],
        workers: Workers,
        clock: Callable[[], int] = time.time_ns,
        timer: Callable[[], float] = time.monotonic,
        sleep: Callable[[float], None] = time.sleep,
    ) -> None:
        self._site, self._clock, self._sleep = site, clock, sleep
        self._messages: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
        self._link = connect(
            topics=[topic("+", what) for what in UPWARDS],
            on_message=self.receive,
            will=(topic(MONITOR, "state"), message({Key.VERSION: VERSION, "is_dead": True})),
        )
        alerts = AlertBook(store, site.alerts.settings)
        self._gate = Gate(timer)
        self._intake = Intake(store, self._link.publish)
        ledger = Ledger(site, store, alerts=alerts, clock=clock)
        self._dispatch = Dispatch(store, workers, ledger, site.watch.settings)
        self._upkeep = Upkeep(
            site,
            store,
            alerts=alerts,
            intake=self._intake,
            link=self._link,
            gate=self._gate,
            relearn=self._dispatch.relearn,
            clock=clock,
            timer=timer,
        )
        self._postman = Postman(
            store,
            senders_of(site.send, self._link.publish),
            link=site.alert_url,
            picture=partial(alert_picture, store) if site.send.mail else _no_picture,
        )
        self._posting = Posting(self._postman, clock)
        self._serving = Serving(
            site.http_address, figures=self.figures, troubles=self.troubles, alert=partial(alert_in_words, store)
        )
        self._is_resting = False

    @property
    def statuses(self) -> Mapping[str, VehicleStatus]:
        """Status of each vehicle after its last job."""
        return self._dispatch.statuses

    @property
    def http_address(self) -> tuple[str, int]:
        """Host and port at which the open station answers."""
        host, port = self._site.http_address
        return host, self._serving.port or port

    @property
    def n_vehicles(self) -> int:
        """Number of vehicles that have sent."""
        return int(self._dispatch.figures["sprung_vehicles"])

    @property
    def is_idle(self) -> bool:
        """Whether all received frames are analysed, except those that wait for earlier frames or a description."""
        return self._is_resting and self._messages.empty() and self._dispatch.is_idle

    def open(self, *, timeout: float = 0.0) -> None:
        """Continue from the store, and connect; `timeout` as for `Link.open`."""
        self._serving.open()
        self._upkeep.open()
        self._dispatch.open()
        self._posting.open()
        self._link.open(timeout=timeout)
        LOG.info("monitoring", extra={"vehicles": self.n_vehicles})

    def run(self, is_done: Callable[[], bool]) -> None:
        """Monitor until `is_done` returns True."""
        while not is_done():
            self.step()

    def step(self) -> None:
        """Do what is due; wait for 5 ms if nothing is."""
        n_taken = n_given = 0
        if self._gate.is_open:
            n_taken = self._take()
            n_given = self._gate.guard(self._dispatch.give) or 0
        outcomes = self._dispatch.collect(timeout=0.0 if n_taken else 0.05)
        for outcome in outcomes:
            self._gate.guard(partial(self._dispatch.settle, outcome))
        self._upkeep.step()
        self._is_resting = not (n_taken or n_given or outcomes)
        if self._is_resting:
            self._sleep(0.005)

    def close(self) -> None:
        """Stop in good order."""
        self._posting.close()
        self._link.close()
        self._dispatch.close()
        if self._serving.is_open:
            self._serving.close()
            self._upkeep.close()
            LOG.info("stopped")

    def receive(self, name: str, payload: bytes) -> None:
        """Queue a message for the next step; beyond the limit it is dropped, and sent again as unacknowledged."""
        if self._messages.qsize() < _MOST_WAITING:
            self._messages.put((name, payload))

    def figures(self) -> dict[str, float]:
        """Return the figures of `FIGURES`."""
        return {
            **self._intake.figures,
            **self._dispatch.figures,
            "sprung_link_connected": float(self._link.is_connected),
            "sprung_store_writable": float(not self._gate.trouble),
        }

    def troubles(self) -> list[str]:
        """Return sentences about problems of the monitor itself."""
        broker = "" if self._link.is_connected else self._link.problem or "the broker has not answered yet"
        return [sentence for sentence in (broker, self._gate.trouble, *self._postman.troubles) if sentence]

    def _take(self) -> int:
        """Store the messages received, and return their number."""
        batch: list[tuple[str, bytes]] = []
        with suppress(queue.Empty):
            while len(batch) < _BATCH:
                batch.append(self._messages.get_nowait())
        if not batch:
            return 0
        taken = self._gate.guard(partial(self._intake.take, batch, now=self._clock()))
        if taken is None:
            return 0
        self._gate.succeed()
        for (vehicle, boot), contiguous in taken.arrived.items():
            self._dispatch.add(vehicle, boot, contiguous)
        for vehicle in taken.described:
            self._dispatch.describe(vehicle)
        return len(batch)


def _no_picture(_vehicle: str, _cause: str) -> bytes:
    """Return no picture: only mail shows one, and drawing takes seconds."""
    return b""
