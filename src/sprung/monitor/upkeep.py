"""What a monitor sees to now and then: silent vehicles, shelves, people's acts, messages, old results, the disk."""

import logging
import threading
from collections.abc import Callable, Container, Mapping
from datetime import UTC, datetime
from typing import Any

from sprung.link import Link, message, topic
from sprung.monitor.alert_book import AlertBook, Postman
from sprung.monitor.intake import MONITOR
from sprung.monitor.site import Site
from sprung.storage import CommandRow, Retention, Store, StoreError

LOG = logging.getLogger("sprung.monitor")

#: Seconds between looks at what people are to be told.
_POST = 1.0
#: Least time before a box is asked for samples again, and between reminders that the broker is away [ns].
_AGAIN, _REMIND = 10 * 10**9, 600 * 10**9


class Upkeep:
    """Sees to what no message of a vehicle brings about.

    Parameters
    ----------
    site
        Settings.
    store
        Open.
    alerts
        Where trouble goes.
    publish
        Sends topic and payload; tells whether there was a connection.
    clock
        UTC ns.
    """

    def __init__(
        self,
        site: Site,
        store: Store,
        *,
        alerts: AlertBook,
        publish: Callable[[str, bytes], bool],
        clock: Callable[[], int],
    ) -> None:
        self._site, self._store, self._alerts = site, store, alerts
        self._publish, self._clock = publish, clock
        self._begun = clock()
        folder = site.archive
        self._archives = [] if folder is None else [Retention(folder), Retention(folder.with_name("correlations"))]
        self._asked: dict[int, int] = {}

    def look(
        self, parked: Container[str], answers: Mapping[tuple[str, int], dict[str, Any]]
    ) -> dict[str, tuple[int, str]]:
        """See to silent vehicles, shelves and people's acts.

        Parameters
        ----------
        parked
            Vehicles that said goodbye.
        answers
            What boxes say they sent, by vehicle and number of the request.

        Returns
        -------
        dict
            Vehicles that are to learn again: number of the request and reason.
        """
        now = self._clock()
        self._alerts.shelves(now=now)
        patience = round(60e9 * self._site.alerts.silent_after_minutes)
        known = {row.vehicle for row in self._store.alerts.find(is_active=True) if row.cause == "silent"}
        heard = self._store.inbox.last_seen()
        for vehicle, last_seen in heard.items():
            is_silent = now - max(last_seen, self._begun) > patience and vehicle not in parked
            if is_silent and vehicle not in known:
                since = datetime.fromtimestamp(last_seen / 1e9, tz=UTC)
                text = f"{vehicle} has sent nothing since {since:%Y-%m-%d %H:%M} UTC"
                self._alerts.trouble(vehicle, "silent", text, now=now)
            elif vehicle in known and not is_silent:
                self._alerts.over(vehicle, "silent", now=now)
        learning = {}
        for command in self._store.requests.open_commands():
            if command.act == "raw":
                self._see_to(command, answers.get((command.vehicle, command.id)), heard.get(command.vehicle, 0), now)
            elif command.act == "learn":
                learning[command.vehicle] = (command.id, str(command.detail or "maintenance"))
            else:
                LOG.warning("an act that is not known", extra={"act": command.act})
                self._store.requests.command_done(command.id, now)
        return learning

    def _see_to(self, command: CommandRow, answer: dict[str, Any] | None, heard: int, now: int) -> None:
        """Ask a box for samples, and again when it is heard after that, until all that it says it sent has come."""
        if (
            answer is not None
            and self._store.inbox.cursor(command.vehicle, answer["boot"]).contiguous >= answer["last"]
        ):
            self._store.requests.command_done(command.id, now, detail={"asked": command.detail, **answer})
            self._asked.pop(command.id, None)
            LOG.info("a request for samples is done", extra={"vehicle": command.vehicle, **answer})
            return
        asked = self._asked.get(command.id)
        if asked is None or (heard > asked and now - asked >= _AGAIN):
            wish = message({0: 1, "do": "raw", "number": command.id, **command.detail})
            if self._publish(topic(command.vehicle, "cmd"), wish):
                self._asked[command.id] = now

    def sweep(self) -> str:
        """Remove what is old, and return what is wrong with the disk: nothing may be taken in then."""
        now = self._clock()
        most = round(1e9 * self._site.keep.raw_gigabytes)
        for archive in self._archives:  # first of all: a store on a full disk cannot even delete
            archive.prune(before=self._site.keep.raw_before(now), most_bytes=most)
        self._store.delete_older(self._site.keep.results_before(now))
        free = self._store.free()
        if free is not None and free < 1e6 * self._site.keep.free_megabytes:
            text = f"only {free / 1e6:.0f} MB are free on the disk of the store: nothing is taken in before"
            self._alerts.trouble(MONITOR, "monitor:disk", text, now=now)
            return text
        self._store.check()
        for cause in ("monitor:disk", "monitor"):
            self._alerts.over(MONITOR, cause, now=now)
        return ""


class Outage:
    """Says in the log that the broker is away: at once, every ten minutes, and when it is back.

    Parameters
    ----------
    link
        To the broker.
    clock
        UTC ns.
    """

    def __init__(self, link: Link, clock: Callable[[], int]) -> None:
        self._link, self._clock = link, clock
        self._said: int | None = None

    def look(self) -> None:
        """See whether there is something to say."""
        now = self._clock()
        if self._link.is_connected:
            if self._said is not None:
                LOG.info("the broker has let the monitor in")
            self._said = None
        elif self._link.problem and (self._said is None or now - self._said >= _REMIND):
            LOG.warning(self._link.problem)
            self._said = now


class Posting:
    """Sends messages in a thread of its own: a slow server keeps nobody else waiting.

    Parameters
    ----------
    postman
        With the messages.
    clock
        UTC ns.
    """

    def __init__(self, postman: Postman, clock: Callable[[], int]) -> None:
        self._postman, self._clock = postman, clock
        self._stopping = threading.Event()
        self._thread = threading.Thread(target=self._run, name="post", daemon=True)

    def open(self) -> None:
        """Begin to send."""
        self._thread.start()

    def close(self) -> None:
        """Stop; what is not sent stays in the store."""
        self._stopping.set()
        if self._thread.is_alive():
            self._thread.join(5.0)

    def _run(self) -> None:
        """Send what is due, until stopped."""
        while not self._stopping.wait(_POST):
            try:
                self._postman.send(now=self._clock())
            except StoreError as error:
                LOG.warning("messages wait", extra={"reason": str(error)})
