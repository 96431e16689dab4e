"""Frames to workers, the vehicle that has waited longest first, and the outcomes of their jobs."""

import logging
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any

from sprung.diagnosis import Baseline
from sprung.errors import ParameterError
from sprung.link.windows import FrameOrder
from sprung.online.monitor.alert_book import Context
from sprung.online.monitor.events import Observed
from sprung.online.monitor.failures import Failures
from sprung.online.monitor.fleets import VehicleTypes, type_of_others
from sprung.online.monitor.histories import ROLL_BACK, history_of, restored_baseline
from sprung.online.monitor.jobs import Failure, Opening, Outcome
from sprung.online.monitor.ledger import Ledger
from sprung.online.monitor.workers import Workers
from sprung.online.store import CommandRow, Cursor, RefusedError, StoredFrame, StoreError
from sprung.state import VehicleStatus

#: Largest size of the frames that are held, and of those of one vehicle [bytes].
_HELD = 1 << 26
_HELD_OF_ONE = 1 << 21


class FrameCache:
    """Frames that the store has; bounded in size.

    Parameters
    ----------
    max_bytes
        Largest size of all payloads [bytes]; frames beyond it are read from the store.

    Notes
    -----
    Of several frames with one number the first counts, as in the store.
    """

    def __init__(self, max_bytes: int = _HELD) -> None:
        self._most = max_bytes
        self._frames: dict[str, dict[tuple[int, int], StoredFrame]] = {}
        self._sizes: dict[str, int] = {}
        self._size = 0

    @property
    def n_bytes(self) -> int:
        """Size of all payloads held."""
        return self._size

    def hold(self, frames: Iterable[StoredFrame]) -> None:
        """Hold frames that the store has."""
        for frame in frames:
            size, place = len(frame.payload), (frame.boot, frame.seq)
            own = self._sizes.get(frame.vehicle, 0) + size
            held = self._frames.setdefault(frame.vehicle, {})
            if place not in held and self._size + size <= self._most and own <= _HELD_OF_ONE:
                held[place] = frame
                self._sizes[frame.vehicle] = own
                self._size += size

    def following(self, vehicle: str, boot: int, *, after: int, until: int, limit: int) -> list[StoredFrame]:
        """Return the unbroken run of frames that follows a sequence number, as far as it is held."""
        held = self._frames.get(vehicle, {})
        run: list[StoredFrame] = []
        while len(run) < limit and after < until and (boot, after + 1) in held:
            after += 1
            run.append(held[boot, after])
        return run

    def release(self, vehicle: str, boot: int, seq: int) -> None:
        """Forget the frames of a boot up to a sequence number, and of all boots before."""
        held = self._frames.get(vehicle, {})
        for place in [place for place in held if place <= (boot, seq)]:
            size = len(held.pop(place).payload)
            self._sizes[vehicle] -= size
            self._size -= size
        if not held:
            self.forget(vehicle)

    def forget(self, vehicle: str) -> None:
        """Forget the frames of a vehicle, which the store has."""
        self._frames.pop(vehicle, None)
        self._size -= self._sizes.pop(vehicle, 0)


LOG = logging.getLogger("sprung.monitor")

#: Largest number of frames of one job.
_JOB = 300


@dataclass(slots=True)
class _Vehicle:
    """Progress of the analysis of a vehicle. Times are UTC ns.

    Parameters
    ----------
    order
        Which of its frames are next.
    done
        Sequence number up to which the store has the frames as analysed, by boot.
    description
        Vehicle file and channels that it was opened with.
    waiting_since
        Time since which its frames wait for a worker; None: none does.
    job
        Frames of the job under way; None: there is none.
    job_since
        Time since which they waited, where all that waited were given.
    request
        Open request for a new or an earlier baseline.
    request_of_job
        That of the job under way.
    status
        Status after the last job.
    failures
        Failures of its analysis.
    """

    order: FrameOrder = field(default_factory=FrameOrder)
    done: dict[int, int] = field(default_factory=dict)
    description: tuple[str, list[Any]] | None = None
    waiting_since: int | None = None
    job: Sequence[StoredFrame] | None = None
    job_since: int | None = None
    request: CommandRow | None = None
    request_of_job: CommandRow | None = None
    status: VehicleStatus | None = None
    failures: Failures = field(default_factory=Failures)

    @property
    def position(self) -> tuple[int, int]:
        """Newest boot of which frames were given to a worker, and the last of them; boot 0 and -1 before the first."""
        dispatched = self.order.dispatched
        boot = max((boot for boot, last in dispatched.items() if last >= 0), default=0)
        return boot, dispatched.get(boot, -1)

    def rewind(self, cursors: Mapping[int, Cursor]) -> None:
        """Continue from the stored cursors."""
        self.done = {boot: cursors[boot].done for boot in self.order.contiguous}
        self.order.dispatched = dict(self.done)

    def covered(self, boot: int) -> dict[int, int]:
        """Return the last frames, by boot other than this, that the present state covers and the store does not."""
        dispatched = self.order.dispatched.items()
        return {other: last for other, last in dispatched if other != boot and last > self.done.get(other, -1)}


class Dispatch:
    """Gives the frames of each vehicle to workers, in order, and stores the results.

    Parameters
    ----------
    context
        Store, settings of vehicles that start from scratch, and clocks.
    workers
        Processes that analyse.
    ledger
        Stores results.

    Notes
    -----
    A vehicle has at most one job. If the job fails, the vehicle is opened again from the stored state. A frame on which
    it fails twice is quarantined; if a later frame fails before a state is stored, it is the window that cannot be
    analysed, and its frames are quarantined. So is a state that cannot be used: the vehicle starts again from the
    results in the store. A vehicle that cannot be opened for another reason waits, longer after each attempt.

    The next job is that of the vehicle whose oldest frame has waited longest since it arrived or, so that one vehicle
    with hours of frames does not hold up the others, since its last job.

    Frames are handed over from memory as they are stored; only others are read from the store.
    """

    def __init__(self, context: Context, workers: Workers, ledger: Ledger) -> None:
        self._store = context.store
        self._settings = context.site.watch.settings
        self._clock = context.clock
        self._timer = context.timer
        self._workers = workers
        self._ledger = ledger
        self._cache = FrameCache()
        self._types = VehicleTypes(context.store)
        self._vehicles: dict[str, _Vehicle] = {}
        self._queue: dict[str, int] = {}  # time since which each vehicle is in it
        self._n_jobs = 0
        self._n_failures = 0
        self._seconds = 0.0

    @property
    def statuses(self) -> Mapping[str, VehicleStatus]:
        """Status of each vehicle after its last job."""
        return {name: known.status for name, known in list(self._vehicles.items()) if known.status is not None}

    @property
    def is_idle(self) -> bool:
        """Whether no job is under way."""
        return not self._n_jobs

    @property
    def figures(self) -> dict[str, float]:
        """Figures of `sprung.online.monitor.station.FIGURES` about vehicles, jobs and their results."""
        vehicles = list(self._vehicles.values())  # figures are read in another thread
        now = self._clock()
        waiting = [known.waiting_since for known in vehicles if known.waiting_since is not None]
        return {
            **self._ledger.figures,
            **self._workers.figures,
            "sprung_vehicles": sum(bool(known.order.contiguous) for known in vehicles),
            "sprung_backlog_frames": sum(known.order.backlog for known in vehicles),
            "sprung_backlog_age_seconds": max(0.0, (now - min(waiting, default=now)) / 1e9),
            "sprung_failures_total": self._n_failures,
            "sprung_analysis_cpu_seconds_total": self._seconds,
            "sprung_vehicles_waiting": sum(known.failures.in_row > 1 for known in vehicles),
        }

    def follow(self) -> None:
        """Read from the store how far frames have arrived: at the start, and after the store failed.

        Raises
        ------
        StoreError
            If the store cannot be used.
        """
        for (vehicle, boot), cursor in self._store.inbox.cursors().items():
            order = self._of(vehicle).order
            if boot not in order.contiguous:
                order.dispatched[boot] = cursor.done
            self.add(vehicle, boot, cursor.contiguous)

    def close(self) -> None:
        """Stop the workers."""
        self._workers.close()

    def add(self, vehicle: str, boot: int, contiguous: int) -> None:
        """Record that the frames of a boot arrived up to a sequence number."""
        known = self._of(vehicle)
        known.order.arrived(boot, contiguous)
        if known.order.has_waiting and known.waiting_since is None:
            known.waiting_since = self._clock()
        self._enqueue(vehicle)

    def hold(self, frames: Sequence[StoredFrame]) -> None:
        """Hold frames that have just been stored, without repeats, so that they need not be read back."""
        self._cache.hold(frames)

    def awaited(self, vehicle: str) -> dict[int, int]:
        """Return the boots of a vehicle of which later ones wait for more frames, and how many frames they had."""
        return self._vehicles[vehicle].order.awaited if vehicle in self._vehicles else {}

    def describe(self, vehicle: str) -> None:
        """Record that a vehicle sent a description: if it is new, frames are analysed again from the stored state."""
        row = self._store.inbox.vehicle(vehicle)
        known = self._of(vehicle)
        if row is not None and known.description != (row.description, row.channels):
            LOG.info("vehicle described", extra={"vehicle": vehicle})
            known.description = (row.description, row.channels)
            self._types.forget()
            self._workers.close_vehicle(vehicle)
            known.failures.succeed()
            self._enqueue(vehicle)

    def relearn(self, request: CommandRow) -> None:
        """Let a vehicle change its baseline before its next frames; requests for one vehicle are queued."""
        known = self._of(request.vehicle)
        known.request = known.request or request
        self._enqueue(request.vehicle)

    def give(self) -> int:
        """Give frames to workers, longest waiting vehicle first, and return the number of jobs and reports.

        Raises
        ------
        StoreError
            If the store cannot be used.
        """
        n_given = 0
        for vehicle in sorted(self._queue, key=self._queue.__getitem__):  # of equal times, the first to arrive
            if self._workers.is_busy:
                break
            n_given += self._give(vehicle, self._vehicles[vehicle])
        return n_given

    def collect(self, *, timeout: float) -> list[Outcome]:
        """Return the available outcomes, waiting up to a time [s] for the first."""
        return self._workers.outcomes(timeout=timeout)

    def flush(self) -> None:
        """Store the results that wait to be stored together.

        Raises
        ------
        StoreError
            If the store cannot write.
        """
        self._ledger.flush()

    def settle(self, outcome: Outcome) -> None:
        """Store the outcome of a job.

        Raises
        ------
        StoreError
            If the store cannot write: the vehicle continues from the stored state.
        """
        self._seconds += outcome.seconds
        try:
            self._settle(outcome)
        except StoreError:
            # The worker is ahead of the store.
            self._workers.close_vehicle(outcome.vehicle)
            raise
        finally:
            self._enqueue(outcome.vehicle)

    def _settle(self, outcome: Outcome) -> None:
        """Store the outcome of a job."""
        vehicle, known = outcome.vehicle, self._of(outcome.vehicle)
        frames = known.job or ()
        if outcome.n_consumed < len(frames) and known.job_since is not None:
            known.waiting_since = known.job_since
        self._n_jobs -= known.job is not None
        known.job = None
        known.job_since = None
        if outcome.error:
            self._fail(outcome, known, frames)
        elif self._workers.is_open(vehicle):  # otherwise it got a new description meanwhile
            try:
                self._commit(outcome, known, frames[: outcome.n_consumed])
            except RefusedError as error:
                place = max(outcome.n_consumed - 1, 0)
                refused = replace(outcome, n_consumed=place, error=str(error), failure=Failure.FRAME)
                self._fail(refused, known, frames)

    def _of(self, vehicle: str) -> _Vehicle:
        """Return the progress of a vehicle."""
        return self._vehicles.setdefault(vehicle, _Vehicle())

    def _enqueue(self, vehicle: str) -> None:
        """Let a vehicle wait for a worker if there is anything to give."""
        known = self._of(vehicle)
        if known.job is not None or not known.order.contiguous:
            return
        if not known.order.has_waiting:
            known.waiting_since = None
        elif known.waiting_since is None:
            known.waiting_since = self._clock()
        if known.order.has_waiting or known.request is not None:
            self._queue.setdefault(vehicle, self._clock())

    def _defer(self, vehicle: str, known: _Vehicle) -> None:
        """Let a vehicle wait for something else: earlier frames, or its description."""
        self._queue.pop(vehicle, None)
        known.waiting_since = None
        self._cache.forget(vehicle)

    def _pending(self, vehicle: str, boot: int, *, after: int, limit: int) -> list[StoredFrame]:
        """Return frames of a vehicle that follow a sequence number: those in memory, or else in the store."""
        until = self._vehicles[vehicle].order.contiguous[boot]
        held = self._cache.following(vehicle, boot, after=after, until=until, limit=limit)
        return held or self._store.inbox.pending(vehicle, boot, after=after, limit=limit)

    def _give(self, vehicle: str, known: _Vehicle) -> bool:
        """Give the next frames of a vehicle to its worker, or store the next report of its box."""
        if self._timer() < known.failures.retry_at:
            if known.waiting_since is not None:
                known.waiting_since = self._clock()  # for itself, not for a worker
            return False
        if not self._workers.is_free(vehicle):
            return False
        if not (self._workers.is_open(vehicle) or self._open(vehicle, known)):
            self._defer(vehicle, known)
            return False
        frames = known.order.next_frames(partial(self._pending, vehicle), _JOB)
        if frames and frames[0].kind != "raw":
            self._give_report(known, frames[0])
        elif frames or known.request is not None:
            n_samples = next((k for k, frame in enumerate(frames) if frame.kind != "raw"), len(frames))
            self._submit(vehicle, known, frames[:n_samples])
        else:
            self._defer(vehicle, known)
            return False
        return True

    def _give_report(self, known: _Vehicle, report: StoredFrame) -> None:
        """Store a report of a box; first the state of the worker, which holds the frames before it."""
        vehicle, boot, seq = report.vehicle, report.boot, report.seq
        if known.order.dispatched.get(boot, -1) > known.done.get(boot, -1):
            self._submit(vehicle, known, [])
            return
        try:
            self._ledger.store_report(report)
        except RefusedError as error:
            self._ledger.quarantine_frames(vehicle, boot, seq, seq, reason=str(error))
            self._ledger.complete(vehicle, boot, seq)
        known.order.dispatched[boot] = seq
        known.done[boot] = seq
        self._cache.release(vehicle, boot, seq)
        self._queue.pop(vehicle, None)
        self._enqueue(vehicle)

    def _submit(self, vehicle: str, known: _Vehicle, frames: Sequence[StoredFrame]) -> None:
        """Start a job, which without frames returns the state."""
        self._n_jobs += 1
        known.job = frames
        known.request_of_job = known.request
        baseline = self._wanted_baseline(known.request)
        self._workers.submit(vehicle, [frame.payload for frame in frames], learn=baseline)
        self._queue.pop(vehicle, None)
        if len(frames) >= known.order.backlog:  # what arrives from here on waits from then
            known.job_since = known.waiting_since or self._clock()
            known.waiting_since = None

    def _wanted_baseline(self, request: CommandRow | None) -> str | Baseline:
        """Return the reason to learn, or the baseline to return to; empty if the baseline stays."""
        if request is None:
            return ""
        if request.act != ROLL_BACK:
            return str(request.detail or "maintenance")
        try:
            return restored_baseline(self._store, request.vehicle, **request.detail)
        except ParameterError as error:
            LOG.warning("baseline stays", extra={"vehicle": request.vehicle, "reason": str(error)})
            return ""

    def _open(self, vehicle: str, known: _Vehicle) -> bool:
        """Give a vehicle to a worker with its stored state; return whether its description is known."""
        row = self._store.inbox.vehicle(vehicle)
        if row is None:
            return False
        snapshot = self._store.results.snapshot(vehicle)
        cursors = self._store.inbox.cursors(vehicle=vehicle)
        known.rewind({boot: cursors.get((vehicle, boot), Cursor()) for boot in known.order.contiguous})
        opening = Opening(vehicle, row.description, dict(row.channels), None, self._settings)
        if snapshot is not None:
            opening = replace(opening, state=snapshot.document)
        else:
            history = history_of(self._store, vehicle, max_windows=self._settings.max_windows)
            opening = replace(opening, history=history)
        if self._is_learning(vehicle, known, has_state=snapshot is not None):
            opening = replace(opening, type_baseline=type_of_others(self._store, vehicle, types=self._types))
        self._workers.open(opening)
        self._ledger.reopen(vehicle)
        known.description = (row.description, row.channels)
        return True

    def _is_learning(self, vehicle: str, known: _Vehicle, *, has_state: bool) -> bool:
        """Return whether a vehicle learns a baseline, as far as is known."""
        if known.status is not None:
            return known.status.is_learning
        stored = self._store.results.status(vehicle) if has_state else None
        return stored is None or bool(stored.get("is_learning", True))

    def _commit(self, outcome: Outcome, known: _Vehicle, taken: Sequence[StoredFrame]) -> None:
        """Store the results of a job, and the progress of its vehicle."""
        vehicle, request = outcome.vehicle, known.request_of_job
        boot, seq = (taken[-1].boot, taken[-1].seq) if taken else known.position
        covered = known.covered(boot)
        with self._store.together():  # a window and its alerts are stored together or not at all
            is_saved = self._ledger.commit(outcome, boot, seq)
            if is_saved:
                for other, last in covered.items():
                    self._ledger.complete(vehicle, other, last)
                self._ledger.update_alerts(vehicle, outcome.events)
                if request is not None:
                    self._store.requests.command_done(request.id, self._clock())
        if is_saved:
            known.done |= covered | {boot: seq}
            if request is not None:
                known.request = None
            known.failures.forget_frames()  # not before: a window that fails begins with jobs that succeed
            known.failures.succeed()
        known.status = outcome.status
        if taken:
            known.order.dispatched[boot] = seq
            self._cache.release(vehicle, boot, seq)
        is_window = any(isinstance(event, Observed) for event in outcome.events)
        # Opened again, from the state just stored, with the baseline of its type as it is now, or in another process.
        is_learning = is_window and outcome.status.is_learning and self._types.has_type(vehicle)
        if is_learning or (outcome.state is not None and self._workers.is_misplaced(vehicle)):
            self._workers.close_vehicle(vehicle)

    def _fail(self, outcome: Outcome, known: _Vehicle, frames: Sequence[StoredFrame]) -> None:
        """Leave out what a job failed on, if it failed there repeatedly; the vehicle is opened again after a while."""
        vehicle, reason = outcome.vehicle, outcome.error
        if outcome.failure is Failure.QUOTA and frames:
            last = frames[max(outcome.n_consumed, 1) - 1]
            self._ledger.quarantine_frames(vehicle, last.boot, frames[0].seq, last.seq, reason=reason)
            self._cache.forget(vehicle)
            known.order.dispatched[last.boot] = last.seq
            return
        self._n_failures += 1
        LOG.warning("analysis failed", extra={"vehicle": vehicle, "reason": reason})
        self._workers.close_vehicle(vehicle)
        n_failures = known.failures.fail(self._timer())
        if outcome.failure is Failure.STATE and self._ledger.quarantine_state(vehicle, reason=reason):
            known.failures.succeed()
        elif outcome.failure is Failure.FRAME and frames:
            frame = frames[min(outcome.n_consumed, len(frames) - 1)]
            first = known.failures.fail_on(frame.boot, frame.seq, done=known.done.get(frame.boot, -1))
            if first is not None:
                self._ledger.quarantine_frames(vehicle, frame.boot, first, frame.seq, reason=reason)
                known.failures.leave_out()  # not before: the store may have refused
                self._cache.forget(vehicle)
                known.failures.succeed()
        elif n_failures > 1:
            self._ledger.warn(vehicle, "monitor:opening", f"frames wait, as the vehicle cannot be opened: {reason}")
