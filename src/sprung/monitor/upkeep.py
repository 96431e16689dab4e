"""What a monitor sees to now and then: silent vehicles, shelves, people's acts, messages, old results, the disk."""

import logging
import threading
from collections.abc import Callable, Container
from datetime import UTC, datetime

from sprung.link import message, topic
from sprung.monitor.alarms import Alarms, Postman
from sprung.monitor.intake import MONITOR
from sprung.monitor.site import Site
from sprung.storage import Store, StoreError, prune_archive

LOG = logging.getLogger("sprung.monitor")

#: Seconds between looks at what people are to be told.
_POST = 1.0


class Upkeep:
    """Sees to what no message of a vehicle brings about.

    Parameters
    ----------
    site
        Settings.
    store
        Open.
    alarms
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
        alarms: Alarms,
        publish: Callable[[str, bytes], bool],
        clock: Callable[[], int],
    ) -> None:
        self._site, self._store, self._alarms = site, store, alarms
        self._publish, self._clock = publish, clock
        self._begun = clock()

    def look(self, parked: Container[str]) -> dict[str, tuple[int, str]]:
        """See to silent vehicles, shelves and people's acts.

        Parameters
        ----------
        parked
            Vehicles that said goodbye.

        Returns
        -------
        dict
            Vehicles that are to learn again: number of the request and reason.
        """
        now = self._clock()
        self._alarms.shelves(now=now)
        patience = round(60e9 * self._site.alerts.silent_after_minutes)
        known = {row.vehicle for row in self._store.alerts(is_active=True) if row.cause == "silent"}
        for vehicle, last_seen in self._store.last_seen().items():
            is_silent = now - max(last_seen, self._begun) > patience and vehicle not in parked
            if is_silent and vehicle not in known:
                since = datetime.fromtimestamp(last_seen / 1e9, tz=UTC)
                text = f"{vehicle} has sent nothing since {since:%Y-%m-%d %H:%M} UTC"
                self._alarms.trouble(vehicle, "silent", text, now=now)
            elif vehicle in known and not is_silent:
                self._alarms.over(vehicle, "silent", now=now)
        learning = {}
        for command in self._store.open_commands():
            if command.act == "raw":
                wish = message({0: 1, "do": "raw", **command.detail})
                if self._publish(topic(command.vehicle, "cmd"), wish):
                    self._store.command_done(command.id, now)
            elif command.act == "learn":
                learning[command.vehicle] = (command.id, str(command.detail or "maintenance"))
            else:
                LOG.warning("an act that is not known", extra={"act": command.act})
                self._store.command_done(command.id, now)
        return learning

    def sweep(self) -> str:
        """Remove what is old, and return what is wrong with the disk: nothing may be taken in then."""
        now = self._clock()
        self._store.delete_older(self._site.keep.results_before(now))
        if self._site.archive is not None:
            most = round(1e9 * self._site.keep.raw_gigabytes)
            for folder in (self._site.archive, self._site.archive.with_name("correlations")):
                prune_archive(folder, before=self._site.keep.raw_before(now), most_bytes=most)
        free = self._store.free()
        if free is not None and free < 1e6 * self._site.keep.free_megabytes:
            text = f"only {free / 1e6:.0f} MB are free on the disk of the store: nothing is taken in before"
            self._alarms.trouble(MONITOR, "monitor:disk", text, now=now)
            return text
        self._store.check()
        for cause in ("monitor:disk", "monitor"):
            self._alarms.over(MONITOR, cause, now=now)
        return ""


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
