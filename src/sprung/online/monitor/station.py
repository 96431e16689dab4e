"""The monitor: link, store, workers and alerts together, in one loop, and its figures for Prometheus."""

import logging
import os
import socket
import time
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import partial

from sprung.link import UPWARDS, VERSION, Every, Key, Link, message, topic
from sprung.online.monitor.alert_book import Context
from sprung.online.monitor.dispatch import Dispatch
from sprung.online.monitor.events import Observed
from sprung.online.monitor.failures import CircuitBreaker, Heartbeats, Loop
from sprung.online.monitor.housekeeping import Housekeeping
from sprung.online.monitor.intake import MONITOR, Intake
from sprung.online.monitor.ledger import LakeWriter, Ledger
from sprung.online.monitor.message_queue import OVERLOAD, MessageQueue, Refusals, vehicle_of
from sprung.online.monitor.notifier import NotificationService, senders_of
from sprung.online.monitor.site import Site
from sprung.online.monitor.workers import Workers
from sprung.online.store import ReservationLostError, Store, StoreError
from sprung.state import VehicleStatus

#: Name, kind and meaning of every figure.
FIGURES = {
    "sprung_vehicles": ("gauge", "Vehicles known."),
    "sprung_frames_total": ("counter", "Frames received and stored, including duplicates."),
    "sprung_messages_total": ("counter", "Messages received."),
    "sprung_message_age_seconds": ("gauge", "Time since the last message arrived."),
    "sprung_messages_refused_total": ("counter", "Messages refused, for any reason."),
    "sprung_refusals_total": ("counter", "Messages refused, by vehicle and reason."),
    "sprung_queue_bytes": ("gauge", "Bytes of messages waiting for intake."),
    "sprung_frames_lost_total": ("counter", "Frames that boxes had to drop."),
    "sprung_vehicle_frames_lost_total": ("counter", "Frames that the box of a vehicle had to drop."),
    "sprung_windows_total": ("counter", "Windows analysed."),
    "sprung_window_age_seconds": ("gauge", "Time since the last window was analysed."),
    "sprung_identifications_total": ("counter", "Identifications of modes."),
    "sprung_analysis_cpu_seconds_total": ("counter", "Processor time of the jobs of workers."),
    "sprung_failures_total": ("counter", "Jobs of workers that failed."),
    "sprung_frames_quarantined_total": (
        "counter",
        "Frames whose analysis fails or needs too much memory.",
    ),
    "sprung_states_quarantined_total": ("counter", "Saved states that could not be used."),
    "sprung_vehicles_waiting": ("gauge", "Vehicles that could not be opened and are retried later."),
    "sprung_vehicles_slow": ("gauge", "Vehicles that share the process for slow ones."),
    "sprung_workers_replaced_total": ("counter", "Processes that died or took too long."),
    "sprung_alerts_active": ("gauge", "Active alerts."),
    "sprung_notifications_sent_total": ("counter", "Notifications sent, counted per sender."),
    "sprung_notifications_given_up_total": ("counter", "Notifications given up, counted per sender."),
    "sprung_backlog_frames": ("gauge", "Frames stored and not yet analysed."),
    "sprung_backlog_age_seconds": ("gauge", "Age of the oldest frame waiting to be analysed."),
    "sprung_boxes_free_bytes": ("gauge", "Free disk space of the box that has the least."),
    "sprung_lake_windows_total": ("counter", "Windows written to the lake."),
    "sprung_lake_windows_waiting": ("gauge", "Windows waiting to be written to the lake."),
    "sprung_lake_failures_total": ("counter", "Failed attempts to write to the lake or to tidy it."),
    "sprung_link_connected": ("gauge", "1 while connected to the broker."),
    "sprung_active": ("gauge", "1 while this monitor works on the store, 0 while it stands by."),
    "sprung_store_bytes": ("gauge", "Size of the store."),
    "sprung_store_writable": ("gauge", "1 while the store can be written."),
    "sprung_heartbeat_age_seconds": ("gauge", "Time since each loop of the monitor last ran."),
}


def labelled(name: str, **labels: str) -> str:
    """Return the name of a figure with labels, whose values have neither quotes, backslashes nor line ends."""
    return name + "{" + ",".join(f'{label}="{value}"' for label, value in labels.items()) + "}"


LOG = logging.getLogger("sprung.monitor")

#: Largest number of messages taken in together.
_BATCH = 2000
#: Largest size of these messages [bytes].
_BATCH_BYTES = 16 << 20
#: Longest time to read them [s].
_BATCH_SECONDS = 0.25
#: Time between checks for vehicles that send too much [s].
_EXAMINE = 60.0
#: Largest number of alerts about such vehicles.
_MAX_ALERTS = 20
#: Longest time of a pass of the loop [s].
_STILL = 15.0
#: Longest time of a pass of a thread that sends notifications [s].
_STILL_POST = 300.0
#: Longest time of a job besides its limit [s].
_LATE = 60.0
#: Time between attempts to take over, and between checks of the reservation [s].
_TAKE_OVER = 2.0
_CHECK = 1.0
#: Longest time for which results wait to be stored together [s].
_FLUSH = 1.0


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
        Present time [s] of a monotonic clock.
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
        context = Context(site, store, clock, timer)
        self._store = store
        self._alerts = context.alerts
        self._clock = clock
        self._timer = timer
        self._sleep = sleep
        self._name = f"{socket.gethostname()}, process {os.getpid()}"
        self._messages = MessageQueue()
        self._refusals = Refusals()
        self._link = connect(
            topics=[topic("+", what) for what in UPWARDS],
            on_message=self.receive,
            will=(topic(MONITOR, "state"), message({Key.VERSION: VERSION, "is_dead": True})),
        )
        senders = senders_of(site.send, self._link.publish)
        self._heartbeats = Heartbeats(loops_of(site.watch.seconds_per_job, [one.name for one in senders]), timer)
        self._breaker = CircuitBreaker(timer)
        self._intake = Intake(context, self._link.publish, refusals=self._refusals)
        self._lake = None if site.keep.lake is None else LakeWriter(context, site.keep.lake)
        self._dispatch = Dispatch(context, workers, Ledger(context, lake=self._lake))
        self._notifications = NotificationService(context, senders, on_heartbeat=self._heartbeats.on_heartbeat)
        self._housekeeping = Housekeeping(
            context,
            intake=self._intake,
            link=self._link,
            breaker=self._breaker,
            notifications=self._notifications,
            dispatch=self._dispatch,
            lake=self._lake,
        )
        self._taking_over = Every(_TAKE_OVER, timer)
        self._checking = Every(_CHECK, timer)
        self._examining = Every(_EXAMINE, timer)
        self._flushing = Every(_FLUSH, timer)
        self._last_message: float | None = None
        self._last_window: float | None = None
        self._overloaded: set[str] = set()
        self._is_followed = False
        self._is_resting = False
        self._is_active = False

    @property
    def statuses(self) -> Mapping[str, VehicleStatus]:
        """Status of each vehicle after its last job."""
        return self._dispatch.statuses

    def advice(self) -> tuple[str, ...]:
        """Return the advice on inspections, at most an hour old."""
        return self._housekeeping.advice.sentences

    @property
    def n_vehicles(self) -> int:
        """Number of vehicles that have sent."""
        return int(self._dispatch.figures["sprung_vehicles"])

    @property
    def is_idle(self) -> bool:
        """Whether all received frames are analysed, except those that wait for earlier frames or a description."""
        return self._is_resting and self._messages.is_empty and self._dispatch.is_idle

    def open(self, *, timeout: float = 0.0) -> None:
        """Continue from the store, and connect; stand by while another monitor works on it, on PostgreSQL.

        Parameters
        ----------
        timeout
            As for `Link.open`.

        Raises
        ------
        StoreError
            If another monitor uses the store, and it is a file.
        """
        self._taking_over.start()
        if not self._store.reservation.take(self._name):
            LOG.info("standing by: another monitor works on the store")
            return
        with self._store.reservation.fenced():
            self._begin(timeout)

    def _begin(self, timeout: float) -> None:
        """Begin to work on the store."""
        self._housekeeping.open()
        self._follow()
        self._notifications.open()
        if self._lake is not None:
            self._lake.open()
        self._link.open(timeout=timeout)
        self._is_active = True
        self._heartbeats.on_heartbeat("station")
        LOG.info("monitoring", extra={"vehicles": self.n_vehicles})

    def run(self, is_done: Callable[[], bool]) -> None:
        """Monitor until `is_done` returns True."""
        while not is_done():
            self.step()

    def step(self) -> None:
        """Do what is due; wait for 5 ms if nothing is. While another monitor works, try to take over.

        Raises
        ------
        ReservationLostError
            If the store is no longer reserved for this monitor, which must end: others may have taken over.
        """
        self._heartbeats.on_heartbeat("station")
        if self._is_active:
            if self._checking.is_due:
                self._checking.start()
                self._store.reservation.check()
            with self._store.reservation.fenced():
                self._work()
            return
        for loop in self._heartbeats.ages:
            self._heartbeats.on_heartbeat(loop)  # none of them runs
        if self._taking_over.is_due:
            try:
                self.open()
            except StoreError as error:
                self._store.reservation.release()
                LOG.warning(str(error))
        self._sleep(0.2)

    def _work(self) -> None:
        """Do what is due as the monitor that works."""
        n_taken = n_given = 0
        if self._breaker.allows_work:
            if not self._is_followed:
                self._breaker.call(self._follow)
            n_taken = self._take()
            n_given = self._breaker.call(self._dispatch.give) or 0
        outcomes = self._dispatch.collect(timeout=0.0 if n_taken else 0.05)
        for outcome in outcomes:
            self._breaker.call(partial(self._dispatch.settle, outcome))
            if any(isinstance(event, Observed) for event in outcome.events):
                self._last_window = self._timer()
        if outcomes or self._dispatch.is_idle:
            self._heartbeats.on_heartbeat("analysis")
        self._housekeeping.step()
        if self._examining.is_due:
            self._examining.start()
            self._breaker.call(self._examine)
        self._is_resting = not (n_taken or n_given or outcomes)
        if self._is_resting or self._flushing.is_due:
            self._flushing.start()
            self._breaker.call(self._dispatch.flush)
        if self._is_resting:
            self._sleep(0.005)

    def close(self) -> None:
        """Stop cleanly."""
        self._notifications.close()
        if self._lake is not None:
            self._lake.close()
        self._link.close()
        if self._is_active:
            self._is_active = False
            with suppress(ReservationLostError), self._store.reservation.fenced():
                self._breaker.call(self._dispatch.flush)
                self._housekeeping.close()
            self._store.reservation.release()
            LOG.info("stopped")
        self._dispatch.close()

    def receive(self, name: str, payload: bytes) -> None:
        """Queue a message for the next step; beyond the limit it is dropped, and sent again as unacknowledged."""
        self._last_message = self._timer()
        if not self._messages.put(name, payload):
            vehicle = vehicle_of(name)
            self._refusals.add(vehicle, OVERLOAD)
            if vehicle and len(self._overloaded) < _MAX_ALERTS:
                self._overloaded.add(vehicle)

    def figures(self) -> dict[str, float]:
        """Return the figures of `FIGURES` that need no store."""
        ages, refusals = self._heartbeats.ages, self._refusals.counts
        last = {"sprung_message_age_seconds": self._last_message, "sprung_window_age_seconds": self._last_window}
        now = self._timer()
        return {
            **self._intake.figures,
            **self._dispatch.figures,
            **self._notifications.figures,
            **({} if self._lake is None else self._lake.figures),
            **{name: now - time for name, time in last.items() if time is not None},
            "sprung_queue_bytes": self._messages.n_bytes,
            "sprung_link_connected": float(self._link.is_connected),
            "sprung_active": float(self._is_active),
            "sprung_store_writable": float(not self._breaker.problem),
            **{labelled("sprung_heartbeat_age_seconds", loop=loop): age for loop, age in ages.items()},
            **{
                labelled("sprung_refusals_total", vehicle=vehicle, reason=reason): n_messages
                for (vehicle, reason), n_messages in refusals.items()
            },
        }

    def problems(self) -> list[str]:
        """Return sentences about problems of the monitor itself; one that stands by has none."""
        if not self._is_active and self._taking_over.started is not None:
            return []
        broker = "" if self._link.is_connected else self._link.problem or "the broker has not answered yet"
        inner = (*self._heartbeats.problems, *self._notifications.problems)
        return [sentence for sentence in (broker, self._breaker.problem, *inner) if sentence]

    def _follow(self) -> None:
        """Find the frames in the store."""
        self._dispatch.follow()
        self._is_followed = True

    def _take(self) -> int:
        """Store the messages received, and return their number."""
        if self._messages.is_empty:
            return 0
        taken = self._breaker.call(partial(self._intake.take, self._batch(), now=self._clock()))
        if taken is None:
            # The store may have frames all the same, if it failed after a commit, and a box may have no more of them.
            self._is_followed = False
            return 0
        if taken.arrived or taken.described:
            self._breaker.succeed()
        self._dispatch.hold(taken.frames)
        for (vehicle, boot), contiguous in taken.arrived.items():
            self._dispatch.add(vehicle, boot, contiguous)
        for vehicle, held in taken.held.items():
            self._give_up(vehicle, held)
        for vehicle, checksum in taken.described.items():
            self._breaker.call(partial(self._describe, vehicle, checksum))
        return taken.n_messages

    def _give_up(self, vehicle: str, held: Collection[int]) -> None:
        """Give up what boots wait for, if it is of a boot that their box no longer names: its disk has lost it."""
        awaited = self._dispatch.awaited(vehicle)
        ends = {boot: end for boot, end in awaited.items() if boot not in held and boot < max(held, default=-1)}
        if ends:
            lost = self._breaker.call(partial(self._intake.declare_lost, vehicle, ends, now=self._clock())) or {}
            for (_, boot), contiguous in lost.items():
                self._dispatch.add(vehicle, boot, contiguous)

    def _describe(self, vehicle: str, checksum: int) -> None:
        """Analyse a vehicle by its stored description, and let its box know."""
        self._dispatch.describe(vehicle)
        self._intake.confirm(vehicle, checksum)

    def _batch(self) -> Iterator[tuple[str, bytes]]:
        """Yield messages, vehicle by vehicle in turn, while their number, their bytes and the time allow it."""
        n_bytes, begun = 0, self._timer()
        for _ in range(_BATCH):
            message = self._messages.take()
            if message is None:
                return
            yield message
            n_bytes += len(message[1])
            if n_bytes > _BATCH_BYTES or self._timer() - begun > _BATCH_SECONDS:
                return

    def _examine(self) -> None:
        """Raise an alert for each vehicle that sent more than could wait since the last check; clear the others."""
        now = self._clock()
        names, self._overloaded = self._overloaded, set()
        overloaded = {name: f"{name} sends more than the monitor takes in: messages are refused" for name in names}
        overloaded |= self._intake.quotas.take_full()
        for vehicle in sorted(overloaded)[:_MAX_ALERTS]:
            self._alerts.report(vehicle, "monitor:intake", overloaded[vehicle], now=now)
        for row in self._store.alerts.find(is_active=True):
            if row.cause == "monitor:intake" and row.vehicle not in overloaded:
                self._alerts.clear(row.vehicle, row.cause, now=now)


def loops_of(seconds_per_job: float, senders: Sequence[str]) -> dict[str, Loop]:
    """Return the loops that must keep running, by name.

    Parameters
    ----------
    seconds_per_job
        Longest time of a job [s].
    senders
        Names of the senders of notifications.
    """
    return {
        "station": Loop(
            _STILL,
            "the main loop of the monitor has stopped: check its store and disk, restart it if it does not resume",
        ),
        "analysis": Loop(seconds_per_job + _LATE, "no analysis job finishes: restart the monitor"),
        **{
            f"post {sender}": Loop(_STILL_POST, f"notifications wait for {sender}, which does not answer: check it")
            for sender in senders
        },
    }
