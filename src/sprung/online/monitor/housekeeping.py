"""Periodic housekeeping: silent vehicles, shelves and certificates that expire, operator commands, retention, disks."""

import logging
from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from threading import Thread

from sprung.errors import ParameterError, SprungError
from sprung.link import VERSION, Address, Every, Key, Link, message, topic, valid_until
from sprung.online.monitor.alert_book import Context
from sprung.online.monitor.dispatch import Dispatch
from sprung.online.monitor.failures import CircuitBreaker
from sprung.online.monitor.histories import LEARN, ROLL_BACK
from sprung.online.monitor.intake import MONITOR, Intake
from sprung.online.monitor.ledger import LakeWriter
from sprung.online.monitor.notifier import NotificationService
from sprung.online.monitor.operations import ranking_document
from sprung.online.monitor.site import Site, embedded_port
from sprung.online.store import CommandRow, Retention, Store
from sprung.results.tables import describe_next_inspection
from sprung.results.tables.wording import format_time

LOG = logging.getLogger("sprung.monitor")

#: Time between checks of vehicles and commands [s].
_LOOK = 1.0
#: Time between sweeps of the disk [s].
_SWEEP = 60.0
#: Time between deletions of old rows [s].
_TIDY = 3600.0
#: Time between rankings of the fleet for advice on inspections [s], and largest fleet that is ranked.
_RANK = 3600.0
_MAX_RANKED = 200
#: Longest wait for a ranking when the monitor stops [s].
_PATIENCE = 10.0
#: Largest number of old rows that a sweep deletes, as intake pauses meanwhile.
_MAX_ROWS = 10_000
#: Cause of the alert about certificates that expire.
CERTIFICATE = "monitor:certificate"
#: Cause of the alert about a lake that cannot be written.
LAKE = "monitor:lake"
#: Shortest time before samples are requested again [s].
_ASK = 10.0
#: Time between warnings that the broker cannot be reached [s].
_REMIND = 600.0
#: Time without a change after which the alert about lost frames clears [ns].
_CALM = 3600 * 10**9


class Housekeeping:
    """Periodic work that no message of a vehicle triggers.

    Parameters
    ----------
    context
        Settings, store, alerts and clocks.
    intake
        Intake, for parked vehicles and the answers of boxes.
    link
        Connection to the broker.
    breaker
        Circuit breaker that stops intake while the store cannot write.
    notifications
        Senders of notifications.
    dispatch
        Analysis, for requests for a new or an earlier baseline.
    lake
        Lake writer; None: no lake.
    """

    def __init__(
        self,
        context: Context,
        *,
        intake: Intake,
        link: Link,
        breaker: CircuitBreaker,
        notifications: NotificationService,
        dispatch: Dispatch,
        lake: LakeWriter | None,
    ) -> None:
        self._site = context.site
        self._store = context.store
        self._alerts = context.alerts
        self._clock = context.clock
        self._intake = intake
        self._link = link
        self._breaker = breaker
        self._notifications = notifications
        self._dispatch = dispatch
        self._lake = lake
        self._begun = context.clock()
        folders = context.site.archive, context.site.correlations
        self._archives = [Retention(folder) for folder in folders if folder is not None]
        self._asking: dict[int, Every] = {}
        self._looking = Every(_LOOK, context.timer)
        self._sweeping = Every(_SWEEP, context.timer)
        self._tidying = Every(_TIDY, context.timer)
        self._reminding = Every(_REMIND, context.timer)
        #: Advice on inspections.
        self.advice = Advice(context.store, context.timer)

    def open(self) -> None:
        """Record the start; raise alerts about a damaged store and a monitor that did not stop cleanly."""
        now = self._clock()
        for notice in self._store.notices:
            LOG.warning(notice)
            self._alerts.report(MONITOR, "monitor:store", notice, now=now)
        own = [row for row in self._store.requests.audited(limit=1000) if row.who == MONITOR]
        if own and own[-1].act == "started":
            sentence = "the monitor stopped unexpectedly and was restarted, or another one took over"
            self._alerts.report(MONITOR, "monitor", sentence, now=now)
        self._intake.recall_parked()
        self._store.requests.audit(MONITOR, "started", MONITOR, now=now)

    def close(self) -> None:
        """Record the stop."""
        self.advice.close()
        self._breaker.call(lambda: self._store.requests.audit(MONITOR, "stopped", MONITOR, now=self._clock()))

    def step(self) -> None:
        """Do what is due."""
        if self._looking.is_due:
            self._looking.start()
            self._look_at_link()
            self._breaker.call(self._look)
            self.advice.step()
        if self._sweeping.is_due:
            self._sweeping.start()
            self._breaker.call(self._sweep)

    def _look(self) -> None:
        """Update shelved alerts and alerts of silent vehicles, and carry out commands."""
        now = self._clock()
        self._alerts.end_shelves(now=now)
        self._update_own("monitor:notifications", self._notifications.lasting_problem, now)
        last_seen = self._store.inbox.last_seen()
        self._update_silence(last_seen, now)
        for command in self._store.requests.open_commands():
            self._carry_out(command, last_seen.get(command.vehicle, 0), now)

    def _carry_out(self, command: CommandRow, last_seen: int, now: int) -> None:
        """Carry out a command for a vehicle."""
        if command.act == "raw":
            self._request_samples(command, last_seen, now)
        elif command.act in {LEARN, ROLL_BACK}:
            self._dispatch.relearn(command)
        else:
            LOG.warning("unknown command", extra={"act": command.act})
            self._store.requests.command_done(command.id, now)

    def _update_own(self, cause: str, problem: str, now: int) -> None:
        """Raise an alert about a problem of the monitor, or clear it if there is none."""
        if problem:
            self._alerts.report(MONITOR, cause, problem, now=now)
        else:
            self._alerts.clear(MONITOR, cause, now=now)

    def _update_silence(self, last_seen: dict[str, int], now: int) -> None:
        """Raise an alert for each vehicle that has become silent; clear what has ended."""
        patience = round(60e9 * self._site.alerts.silent_after_minutes)
        rows = self._store.alerts.find(is_active=True)
        for row in rows:
            if row.cause == "lost" and now - row.updated >= _CALM:
                self._alerts.clear(row.vehicle, "lost", now=now)
        active = {row.vehicle for row in rows if row.cause == "silent"}
        for vehicle, seen in last_seen.items():
            is_silent = now - max(seen, self._begun) > patience and not self._intake.is_parked(vehicle)
            if is_silent and vehicle not in active:
                since = datetime.fromtimestamp(seen / 1e9, tz=UTC)
                sentence = f"{vehicle} has sent nothing since {since:%Y-%m-%d %H:%M} UTC"
                self._alerts.report(vehicle, "silent", sentence, now=now)
            elif vehicle in active and not is_silent:
                self._alerts.clear(vehicle, "silent", now=now)

    def _request_samples(self, command: CommandRow, last_seen: int, now: int) -> None:
        """Request samples from a box, again whenever it was seen since, until all that it announced have arrived."""
        vehicle, inbox = command.vehicle, self._store.inbox
        answer = self._intake.answer(vehicle, command.id)
        if answer is not None and inbox.cursor(vehicle, answer["boot"]).contiguous >= answer["last"]:
            self._store.requests.command_done(command.id, now, detail={"asked": command.detail, **answer})
            self._asking.pop(command.id, None)
            LOG.info("request for samples completed", extra={"vehicle": vehicle, **answer})
            return
        timer = self._asking.setdefault(command.id, Every(_ASK, lambda: self._clock() / 1e9))
        is_first = timer.started is None
        if is_first or (timer.is_due and last_seen / 1e9 > (timer.started or 0.0)):
            request = {Key.VERSION: VERSION, "do": "raw", "number": command.id, **command.detail}
            if self._link.publish(topic(vehicle, "cmd"), message(request)):
                timer.start()

    def _sweep(self) -> None:
        """Delete what is old, and stop intake while disk space is short."""
        now = self._clock()
        keep = self._site.keep
        most = round(1e9 * keep.raw_gigabytes)
        for archive in self._archives:  # before anything else: a store on a full disk cannot even delete
            archive.prune(before=keep.before(keep.raw_days, now), max_bytes=most)
        self._check_certificates(now)
        self._update_own(LAKE, "" if self._lake is None else self._lake.problem, now)
        self._tidy(now)
        free = self._store.free()
        # The vehicles of which most waits are refused first.
        self._intake.quotas.narrow(is_short=free is not None and free < 2e6 * keep.free_megabytes)
        if free is not None and free < 1e6 * keep.free_megabytes:
            sentence = f"intake is stopped, as only {free / 1e6:.0f} MB are free on the disk of the store: free space"
            self._breaker.set_shortage(sentence)
            self._alerts.report(MONITOR, "monitor:disk", sentence, now=now)
            return
        self._store.check()
        self._breaker.set_shortage("")
        self._breaker.succeed()
        for cause in ("monitor:disk", "monitor"):
            self._alerts.clear(MONITOR, cause, now=now)

    def _check_certificates(self, now: int) -> None:
        """Raise an alert about certificates of this monitor that expire soon, or clear it where there are none."""
        problems = [problem for each in certificates_of(self._site) if (problem := each.problem_at(now))]
        self._update_own(CERTIFICATE, "; ".join(problems), now)

    def _tidy(self, now: int) -> None:
        """Delete old rows, once an hour, or again at the next sweep if many are left."""
        if not self._tidying.is_due:
            return
        keep = self._site.keep
        n_deleted = self._store.delete_older(
            keep.before(keep.results_days, now),
            audit_before=keep.before(keep.audit_days, now),
            boots_before=keep.before(keep.boots_days, now),
            limit=_MAX_ROWS,
        )
        if n_deleted < _MAX_ROWS:
            self._tidying.start()

    def _look_at_link(self) -> None:
        """Log that the broker cannot be reached: immediately, every ten minutes, and once it is back."""
        if self._link.is_connected:
            if self._reminding.started is not None:
                LOG.info("connected to broker")
            self._reminding.reset()
        elif self._link.problem and self._reminding.is_due:
            LOG.warning(self._link.problem)
            self._reminding.start()


class Advice:
    """Which vehicle of each type to inspect next, worked out once an hour in a thread of its own.

    Parameters
    ----------
    store
        Store of the monitor.
    timer
        Present time [s] of a monotonic clock.
    """

    def __init__(self, store: Store, timer: Callable[[], float]) -> None:
        self._store = store
        self._ranking = Every(_RANK, timer)
        self._thread: Thread | None = None
        #: A sentence on each type of which some vehicle is to be inspected; none before the first ranking has ended.
        self.sentences: tuple[str, ...] = ()

    def step(self) -> None:
        """Begin to rank the fleet where that is due."""
        if self._ranking.is_due and (self._thread is None or not self._thread.is_alive()):
            self._ranking.start()
            self._thread = Thread(target=self._rank, name="advice", daemon=True)
            self._thread.start()

    def close(self) -> None:
        """Wait for a ranking that has begun."""
        if self._thread is not None:
            self._thread.join(_PATIENCE)

    def _rank(self) -> None:
        """Rank the fleet; what fails keeps the advice of before."""
        try:
            if self._store.inbox.n_vehicles() > _MAX_RANKED:
                self.sentences = ("the command sprung vehicles rank states which vehicle to inspect next",)
                return
            types = ranking_document(self._store)["types"]
            self.sentences = tuple(filter(None, map(describe_next_inspection, types)))
        except SprungError as error:
            LOG.warning("the fleet cannot be ranked: %s", error)


#: Time before the expiry of a certificate from which on it is reported [ns].
_WARN = 30 * 86400 * 10**9


@dataclass(frozen=True, slots=True)
class Certificate:
    """A certificate in a file.

    Parameters
    ----------
    purpose
        Purpose of the certificate.
    path
        File that contains it.
    expires
        Time until which it is valid, UTC ns; None if the file cannot be read.
    problem
        Reason why the file cannot be read; None if it can.
    """

    purpose: str
    path: str
    expires: int | None
    problem: str | None = None

    def problem_at(self, now: int) -> str | None:
        """Return what is wrong with it at a time (UTC ns) and what to do; None if nothing is."""
        if self.expires is None:
            return f"{self.purpose}: {self.problem}"
        if self.expires - now >= _WARN:
            return None
        verb = "has expired" if self.expires <= now else "expires"
        end = format_time(self.expires)
        return f"the {self.purpose} {self.path} {verb} at {end} UTC: renew it, then restart the monitor"


def certificates_of(site: Site) -> list[Certificate]:
    """Return the certificates that a site file names: of the pages, and of the connection to the broker."""
    files = {"certificate of the pages": site.web.certificate or ""}
    if embedded_port(site.broker) is None:
        address = Address.parse(site.broker)
        files |= {"certificate at the broker": address.cert, "certificate of the broker's authority": address.ca}
    return [_read(path, purpose) for purpose, path in files.items() if path]


def _read(path: str, purpose: str) -> Certificate:
    """Return the certificate in a file."""
    try:
        return Certificate(purpose, path, valid_until(path))
    except ParameterError as error:
        return Certificate(purpose, path, None, str(error))
