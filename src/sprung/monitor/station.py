"""The monitor: link, store, workers and alerts together, for as long as it is wanted."""

import json
import logging
import queue
import time
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

from sprung.errors import SprungError
from sprung.link import UPWARDS, Link, checked_map, message
from sprung.monitor.alert_book import AlertBook, Postman, senders_of
from sprung.monitor.engine import Identified, Observed
from sprung.monitor.intake import MONITOR, Intake
from sprung.monitor.received import received
from sprung.monitor.serving import Serving
from sprung.monitor.site import Site
from sprung.monitor.streams import Stream, Waiting
from sprung.monitor.upkeep import Outage, Posting, Upkeep
from sprung.monitor.workers import Opening, Outcome, Workers
from sprung.storage import Progress, Store, StoreError, write_archive

LOG = logging.getLogger("sprung.monitor")

#: Messages that are taken in at once, that may wait, and frames of one job.
_BATCH, _MOST_WAITING, _JOB = 2000, 50_000, 300
#: Seconds between looks: at trouble and notifications, and at the disk.
_LOOK, _SWEEP = 1.0, 60.0
#: Failures after which the frames of a job are left out.
_STRIKES = 2
#: Waits after the store could not write [s].
_REFUSED = 2.0


class Station:
    """Watches all vehicles that send.

    Parameters
    ----------
    site
        Settings.
    store
        Open.
    connect
        Returns a link with these topics, taker of messages and will; such as `partial(Link, address, name)`.
    workers
        That watch the vehicles.
    clock
        UTC ns.
    """

    def __init__(
        self,
        site: Site,
        store: Store,
        *,
        connect: Callable[..., Link],
        workers: Workers,
        clock: Callable[[], int] = time.time_ns,
    ) -> None:
        self._site, self._store, self._clock = site, store, clock
        self._messages: queue.SimpleQueue[tuple[str, bytes]] = queue.SimpleQueue()
        self._link = connect(
            topics=[f"sprung/v1/+/{what}" for what in UPWARDS],
            on_message=self._arrived,
            will=(f"sprung/v1/{MONITOR}/state", message({0: 1, "is_dead": True})),
        )
        self._intake = Intake(store, self._link.publish)
        self._alerts = AlertBook(store, site.alerts.settings)
        self._upkeep = Upkeep(site, store, alerts=self._alerts, publish=self._link.publish, clock=clock)
        self._outage = Outage(self._link, clock)
        self._posting = Posting(Postman(store, senders_of(site.send, LOG, self._link.publish)), clock)
        self._workers = workers
        self._serving: Serving | None = None
        self._streams: dict[str, Stream] = {}
        self._jobs: dict[str, list[Waiting]] = {}
        self._progress: dict[str, tuple[float, int, int, str]] = {}
        self._strikes: dict[str, int] = {}
        self._learning: dict[str, tuple[int, str]] = {}
        self._counts = {"windows": 0, "identifications": 0, "failures": 0}
        self._trouble = ""
        self._is_resting = False
        self._next_look = self._next_sweep = self._wait_until = 0.0

    @property
    def progress(self) -> Mapping[str, tuple[float, int, int, str]]:
        """Of each vehicle: share of the present window, windows that taught and are needed, what stands in the way."""
        return self._progress

    @property
    def http_port(self) -> int | None:
        """Where it answers; None where it does not."""
        return None if self._serving is None else self._serving.port

    @property
    def alerts(self) -> AlertBook:
        """For people's acts."""
        return self._alerts

    def open(self, *, timeout: float = 0.0) -> None:
        """Begin to watch: go on from the store, start workers, connect."""
        self._serving = Serving(self._site.http_address, figures=self.figures, troubles=self.troubles)
        now = self._clock()
        for notice in self._store.notices:
            LOG.warning(notice)
            self._alerts.trouble(MONITOR, "monitor:store", notice, now=now)
        last = [row for row in self._store.requests.audited(limit=1000) if row.who == MONITOR]
        if last and last[-1].act == "started":
            self._alerts.trouble(
                MONITOR, "monitor", "the monitor stopped without a word and was started again", now=now
            )
        self._store.requests.audit(MONITOR, "started", "monitor", now=now)
        for (vehicle, boot), cursor in self._store.inbox.cursors().items():
            stream = self._streams.setdefault(vehicle, Stream())
            stream.arrived(boot, cursor.contiguous)
            stream.dispatched[boot] = cursor.done
            if cursor.done < cursor.contiguous:
                self._intake.mixed.add(vehicle)  # until it shows that it only sends samples
        self._serving.open()
        self._posting.open()
        self._link.open(timeout=timeout)
        LOG.info("watching", extra={"vehicles": len(self._streams)})

    def run(self, is_done: Callable[[], bool]) -> None:
        """Watch until it is done."""
        while not is_done():
            self.step()

    def step(self) -> None:
        """Do what is due, and wait a little where nothing is."""
        now = time.monotonic()
        # While the store cannot write, work would be done in vain, and again.
        is_writable = now >= self._wait_until
        took = self._take() if is_writable else 0
        gave = self._given() if is_writable else 0
        outcomes = self._workers.outcomes(timeout=0.0 if took else 0.05)
        for outcome in outcomes:
            self._settle(outcome)
        if now >= self._next_look:
            self._next_look = now + _LOOK
            self._outage.look()
            self._guarded(self._look)
        if now >= self._next_sweep:
            self._next_sweep = now + _SWEEP
            self._guarded(self._sweep)
        self._is_resting = not (took or gave or outcomes)
        if self._is_resting:
            time.sleep(0.005)

    def close(self) -> None:
        """Stop in good order."""
        self._posting.close()
        self._link.close()
        self._workers.close()
        if self._serving is not None:
            self._serving.close()
        if self._serving is not None:
            self._guarded(lambda: self._store.requests.audit(MONITOR, "stopped", "monitor", now=self._clock()))
            LOG.info("stopped")

    def is_idle(self) -> bool:
        """Tell whether everything that came is worked up, but for what waits for earlier frames or a description."""
        return self._is_resting and self._messages.empty() and not self._jobs

    def figures(self) -> dict[str, float]:
        """Return the figures of `FIGURES`."""
        counts = self._intake.counts
        backlog = sum(
            stream.contiguous[boot] - stream.dispatched.get(boot, -1)
            for stream in list(self._streams.values())
            for boot in list(stream.contiguous)
        )
        return {
            "sprung_vehicles": len(self._streams),
            "sprung_frames_total": counts["frames"],
            "sprung_messages_total": counts["messages"],
            "sprung_messages_refused_total": counts["refused"],
            "sprung_frames_lost_total": counts["lost"],
            "sprung_windows_total": self._counts["windows"],
            "sprung_identifications_total": self._counts["identifications"],
            "sprung_failures_total": self._counts["failures"],
            "sprung_alerts_active": len(self._store.alerts.find(is_active=True)),
            "sprung_backlog_frames": backlog,
            **({"sprung_boxes_free_bytes": min(self._intake.health.values())} if self._intake.health else {}),
            "sprung_link_connected": float(self._link.is_connected),
            "sprung_store_bytes": self._store.size(),
            "sprung_store_writable": float(not self._trouble),
        }

    def troubles(self) -> list[str]:
        """Return what is wrong with the monitor itself."""
        found = [] if self._link.is_connected else [self._link.problem or "the broker has not answered yet"]
        return [*found, self._trouble] if self._trouble else found

    def _arrived(self, name: str, payload: bytes) -> None:
        """Keep a message for the next step; what is too much comes again, as it is not acknowledged."""
        if self._messages.qsize() < _MOST_WAITING:
            self._messages.put((name, payload))

    def _take(self) -> int:
        """Store what has come."""
        batch: list[tuple[str, bytes]] = []
        while len(batch) < _BATCH:
            try:
                batch.append(self._messages.get_nowait())
            except queue.Empty:
                break
        if not batch:
            return 0
        try:
            arrived, described = self._intake.take(batch, now=self._clock())
        except StoreError as error:
            self._refused(error)
            return 0
        self._trouble = ""
        for (vehicle, boot), contiguous in arrived.items():
            self._streams.setdefault(vehicle, Stream()).arrived(boot, contiguous)
        for vehicle in described:
            LOG.info("described", extra={"vehicle": vehicle})
            self._workers.close_vehicle(vehicle)
        return len(batch)

    def _has_more(self, vehicle: str) -> bool:
        """Tell whether frames of a vehicle wait."""
        stream = self._streams[vehicle]
        return any(stream.dispatched.get(boot, -1) < last for boot, last in stream.contiguous.items())

    def _given(self) -> int:
        """Give frames to workers, unless the store stands in the way."""
        try:
            return self._dispatch()
        except StoreError as error:
            self._refused(error)
            return 0

    def _dispatch(self) -> int:
        """Give frames to workers, in turn: whoever was served last comes last."""
        workers, given = self._workers, 0
        for vehicle, stream in list(self._streams.items()):
            if workers.is_busy:
                break
            if vehicle in self._jobs or not (self._has_more(vehicle) or vehicle in self._learning):
                continue
            if not workers.is_open(vehicle) and not self._opened(vehicle):
                continue
            if not workers.is_free(vehicle):
                continue
            waiting = stream.next_frames(partial(self._pending, vehicle), _JOB)
            is_save = False
            if vehicle in self._intake.mixed:
                waiting, is_save = self._samples_first(vehicle, waiting)
            learn = self._learning.get(vehicle)
            if waiting or learn or is_save:
                self._jobs[vehicle] = waiting
                workers.submit(vehicle, [payload for _, _, payload in waiting], learn=learn[1] if learn else "")
                self._streams[vehicle] = self._streams.pop(vehicle)
                given += 1
        return given

    def _samples_first(self, vehicle: str, waiting: list[Waiting]) -> tuple[list[Waiting], bool]:
        """Store what a box has identified itself; return the samples up to the next of that, and whether to save first.

        What is stored takes the frames before it out of the inbox: the worker's state must hold them.
        """
        documents = [checked_map(payload) for _, _, payload in waiting]
        kinds = [document.get(16, "raw") for document in documents]
        if not kinds or kinds[0] == "raw":
            return waiting[: next((k for k, kind in enumerate(kinds) if kind != "raw"), len(kinds))], False
        (boot, seq, _), document = waiting[0], documents[0]
        stream = self._streams[vehicle]
        if stream.dispatched.get(boot, -1) > stream.done.get(boot, -1):
            return [], True
        found = received(kinds[0], document, self._site.archive, vehicle)
        modes = () if found is None else ((document["number"], document[4], found),)
        self._store.results.commit(Progress(vehicle, boot, done_seq=seq, delete_through_seq=seq, modes=modes))
        stream.dispatched[boot] = stream.done[boot] = seq
        return [], False

    def _pending(self, vehicle: str, boot: int, after: int, limit: int) -> list[tuple[int, int, bytes]]:
        """Return frames of a vehicle that wait in the store."""
        return self._store.inbox.pending(vehicle, boot, after=after, limit=limit)

    def _opened(self, vehicle: str) -> bool:
        """Give a vehicle to a worker, as the store has it; tell whether its description is known."""
        row = self._store.inbox.vehicle(vehicle)
        if row is None:
            return False
        snapshot = self._store.results.snapshot(vehicle)
        stream = self._streams[vehicle]
        stream.done = {boot: self._store.inbox.cursor(vehicle, boot).done for boot in stream.contiguous}
        stream.dispatched = dict(stream.done)
        if snapshot is not None:
            for boot, contiguous in stream.contiguous.items():
                if boot < snapshot.boot:
                    stream.dispatched[boot] = contiguous
            self._guarded(partial(self._finished, vehicle, snapshot.boot))
        quantities = dict(row.channels)
        state = None if snapshot is None else snapshot.document
        self._workers.open(Opening(vehicle, row.description, quantities, state, self._site.watch.settings))
        return True

    def _settle(self, outcome: Outcome) -> None:
        """Store what a job came to."""
        vehicle, waiting = outcome.vehicle, self._jobs.pop(outcome.vehicle, [])
        if outcome.error:
            self._failed(vehicle, waiting, outcome.error)
            return
        if not self._workers.is_open(vehicle):
            return  # described anew meanwhile: its frames are worked up again from what is stored
        taken = waiting[: outcome.n_consumed]
        try:
            self._commit(outcome, taken)
        except StoreError as error:
            # The worker is ahead of the store: go back to what is stored.
            self._workers.close_vehicle(vehicle)
            self._refused(error)
            return
        if outcome.state is not None:
            self._strikes.pop(vehicle, None)  # not before: a window that fails begins with jobs that do not
        self._progress[vehicle] = outcome.progress
        stream = self._streams[vehicle]
        if taken:
            stream.dispatched[taken[-1][0]] = taken[-1][1]

    def _commit(self, outcome: Outcome, taken: Sequence[Waiting]) -> None:
        """Store the events of a job; a window's in one transaction with the state after it."""
        vehicle, now = outcome.vehicle, self._clock()
        stream = self._streams[vehicle]
        boot = taken[-1][0] if taken else max((one for one, last in stream.dispatched.items() if last >= 0), default=0)
        modes = [_modes(event) for event in outcome.events if isinstance(event, Identified)]
        windows = [event for event in outcome.events if isinstance(event, Observed)]
        self._counts["identifications"] += len(modes)
        self._counts["windows"] += len(windows)
        seq = taken[-1][1] if taken else stream.dispatched.get(boot, -1)
        is_stored = outcome.state is not None
        if not (modes or is_stored):
            return
        for event in windows:
            self._archived(vehicle, boot, event)
        self._store.results.commit(
            Progress(
                vehicle,
                boot,
                done_seq=seq if is_stored else -1,
                delete_through_seq=seq if is_stored else -1,
                observations=tuple((w.number, w.recording.start or 0, w.observation.to_dict()) for w in windows),
                modes=tuple(modes),
                findings=tuple(
                    (w.number, w.recording.start or 0, finding)
                    for w in windows
                    if w.diagnosis is not None
                    for finding in w.diagnosis.to_dict()["findings"]
                ),
                baselines=tuple(
                    (w.baseline.version, now, w.baseline.reason, w.baseline.to_dict())
                    for w in windows
                    if w.baseline is not None
                ),
                snapshot=outcome.state,
            )
        )
        if is_stored:
            stream.done[boot] = seq
            self._finished(vehicle, boot)
        for event in windows:
            self._alerts.window(vehicle, event, now=now)
        if vehicle in self._learning and is_stored:
            self._store.requests.command_done(self._learning.pop(vehicle)[0], now)

    def _finished(self, vehicle: str, boot: int) -> None:
        """Remove the frames of boots before the one of the stored state, which holds what was in them."""
        stream = self._streams[vehicle]
        for older, last in stream.finished(boot):
            self._store.results.commit(Progress(vehicle, older, done_seq=last, delete_through_seq=last))
            stream.done[older] = last

    def _archived(self, vehicle: str, boot: int, event: Observed) -> None:
        """Keep the samples of a window for a while; that they cannot be kept stops nothing."""
        folder, recording = self._site.archive, event.recording
        if folder is None:
            return
        try:
            write_archive(
                folder,
                vehicle,
                boot,
                event.number,
                recording.start or 0,
                samples=recording.samples,
                channels=recording.names,
                sampling_rate=recording.sampling_rate,
            )
        except (SprungError, OSError) as error:
            LOG.warning("samples were not kept", extra={"vehicle": vehicle, "reason": str(error)})

    def _failed(self, vehicle: str, waiting: Sequence[Waiting], why: str) -> None:
        """Try a job again from what is stored; leave its frames out where it fails again and again."""
        self._counts["failures"] += 1
        strikes = self._strikes[vehicle] = self._strikes.get(vehicle, 0) + 1
        LOG.error("analysis failed", extra={"vehicle": vehicle, "reason": why, "strikes": strikes})
        self._workers.close_vehicle(vehicle)
        if strikes < _STRIKES or not waiting:
            return
        now = self._clock()
        boot, seq, _ = waiting[-1]
        stream = self._streams[vehicle]
        text = f"{seq - stream.done.get(boot, -1)} frames were left out: {why}"
        try:
            self._store.results.commit(Progress(vehicle, boot, done_seq=seq, delete_through_seq=seq))
            self._alerts.trouble(vehicle, "monitor:analysis", text, now=now)
        except StoreError as error:
            self._refused(error)
            return
        stream.dispatched[boot] = stream.done[boot] = seq
        self._strikes.pop(vehicle)

    def _look(self) -> None:
        """See to silent vehicles, shelves and people's acts."""
        self._learning = {**self._upkeep.look(self._intake.parked, self._intake.answers), **self._learning}

    def _sweep(self) -> None:
        """See to the disk."""
        self._trouble = self._upkeep.sweep()
        if self._trouble:
            self._wait_until = time.monotonic() + _SWEEP

    def _guarded(self, act: Callable[[], None]) -> None:
        """Do something that needs the store, and go on without where it cannot write."""
        try:
            act()
        except StoreError as error:
            self._refused(error)

    def _refused(self, error: StoreError) -> None:
        """Take note that the store cannot write, and give it time."""
        if str(error) != self._trouble:
            LOG.error(str(error))
        self._trouble = str(error)
        self._wait_until = time.monotonic() + _REFUSED


def _modes(event: Identified) -> tuple[int, int, dict[str, Any]]:
    """Return number, time and document of an identification."""
    document = {"modes": list(event.modes), "reason": event.reason}
    return event.number, event.start or 0, json.loads(json.dumps(document))
