"""Frames to workers, the vehicle that has waited longest first, and the outcomes of their jobs."""

import logging
import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from sprung.diagnosis import Baseline
from sprung.errors import ParameterError
from sprung.online.monitor.engine import MonitorSettings, Observed
from sprung.online.monitor.failures import Backoff, FailureCounts
from sprung.online.monitor.fleets import VehicleTypes, type_of_others
from sprung.online.monitor.histories import ROLL_BACK, history_of, restored_baseline
from sprung.online.monitor.jobs import Failure, Opening, Outcome
from sprung.online.monitor.ledger import Ledger
from sprung.online.monitor.states import History
from sprung.online.monitor.streams import Handover, Queue, Stream
from sprung.online.monitor.workers import Workers
from sprung.online.store import (
    CommandRow,
    Cursor,
    RefusedError,
    Store,
    StoredFrame,
    StoreError,
)
from sprung.state import VehicleStatus

LOG = logging.getLogger("sprung.monitor")

#: Largest number of frames of one job.
_JOB = 300


class Dispatch:
    """Gives the frames of each vehicle to workers, in order, and stores the results.

    Parameters
    ----------
    store
        Store of frames, descriptions and states.
    workers
        Processes that analyse.
    ledger
        Stores results.
    settings
        Settings of vehicles that start from scratch.
    timer
        Present time [s] of a monotonic clock.
    clock
        Present time, UTC ns.

    Notes
    -----
    A vehicle has at most one job. If the job fails, the vehicle is opened again from the stored state. A frame on which
    it fails twice is set aside; if a later frame fails before a state is stored, it is the window that cannot be
    analysed, and its frames are set aside. A state that cannot be used is set aside, too: the vehicle starts again from
    the results in the store. A vehicle that cannot be opened for another reason waits, longer after each attempt.

    The next job is that of the vehicle whose oldest frame has waited longest since it arrived or, so that one vehicle
    with hours of frames does not hold up the others, since its last job.

    Frames are handed over from memory as they are stored; only others are read from the store.
    """

    def __init__(
        self,
        store: Store,
        workers: Workers,
        ledger: Ledger,
        settings: MonitorSettings,
        *,
        timer: Callable[[], float] = time.monotonic,
        clock: Callable[[], int] = time.time_ns,
    ) -> None:
        self._store = store
        self._workers = workers
        self._ledger = ledger
        self._settings = settings
        self._clock = clock
        self._handover = Handover()
        self._queue = Queue()
        self._types = VehicleTypes(store)
        self._waiting_since: dict[str, int] = {}
        self._job_since: dict[str, int] = {}
        self._descriptions: dict[str, tuple[str, list[Any]]] = {}
        self._streams: dict[str, Stream] = {}
        self._jobs: dict[str, Sequence[StoredFrame]] = {}
        self._learning: dict[str, CommandRow] = {}
        self._failure_counts = FailureCounts()
        self._backoff = Backoff(timer)
        self._learnt: dict[str, CommandRow | None] = {}
        self._statuses: dict[str, VehicleStatus] = {}
        self._n_failures = 0
        self._seconds = 0.0

    @property
    def statuses(self) -> Mapping[str, VehicleStatus]:
        """Status of each vehicle after its last job."""
        return self._statuses

    @property
    def is_idle(self) -> bool:
        """Whether no job is under way."""
        return not self._jobs

    @property
    def figures(self) -> dict[str, float]:
        """Figures of `sprung.online.monitor.figures.FIGURES` about vehicles, jobs and their results."""
        return {
            **self._ledger.figures,
            **self._workers.figures,
            "sprung_vehicles": len(self._streams),
            "sprung_backlog_frames": self._backlog,
            "sprung_backlog_age_seconds": self._age,
            "sprung_failures_total": self._n_failures,
            "sprung_analysis_cpu_seconds_total": self._seconds,
            "sprung_vehicles_waiting": self._backoff.n_waiting,
        }

    def follow(self) -> None:
        """Read from the store how far frames have arrived: at the start, and after the store failed.

        Raises
        ------
        StoreError
            If the store cannot be used.
        """
        for (vehicle, boot), cursor in self._store.inbox.cursors().items():
            stream = self._streams.setdefault(vehicle, Stream())
            if boot not in stream.contiguous:
                stream.dispatched[boot] = cursor.done
            self.add(vehicle, boot, cursor.contiguous)

    def close(self) -> None:
        """Stop the workers."""
        self._workers.close()

    def add(self, vehicle: str, boot: int, contiguous: int) -> None:
        """Record that the frames of a boot arrived up to a sequence number."""
        stream = self._streams.setdefault(vehicle, Stream())
        stream.arrived(boot, contiguous)
        if stream.has_waiting:
            self._waiting_since.setdefault(vehicle, self._clock())
        self._enqueue(vehicle)

    def hold(self, frames: Sequence[StoredFrame]) -> None:
        """Hold frames that have just been stored, without repeats, so that they need not be read back."""
        self._handover.hold(frames)

    def awaited(self, vehicle: str) -> dict[int, int]:
        """Return the boots of a vehicle of which later ones wait for more frames, and how many frames they had."""
        return self._streams[vehicle].awaited if vehicle in self._streams else {}

    def describe(self, vehicle: str) -> None:
        """Record that a vehicle sent a description: if it is new, frames are analysed again from the stored state."""
        row = self._store.inbox.vehicle(vehicle)
        if row is not None and self._descriptions.get(vehicle) != (row.description, row.channels):
            LOG.info("vehicle described", extra={"vehicle": vehicle})
            self._descriptions[vehicle] = (row.description, row.channels)
            self._types.forget()
            self._workers.close_vehicle(vehicle)
            self._backoff.succeed(vehicle)
            self._enqueue(vehicle)

    def relearn(self, command: CommandRow) -> None:
        """Let a vehicle change its baseline before its next frames; requests for one vehicle are queued."""
        self._learning.setdefault(command.vehicle, command)
        if command.vehicle in self._streams:
            self._enqueue(command.vehicle)

    def give(self) -> int:
        """Give frames to workers, longest waiting vehicle first, and return the number of jobs and reports.

        Raises
        ------
        StoreError
            If the store cannot be used.
        """
        n_given = 0
        for vehicle in self._queue:
            if self._workers.is_busy:
                break
            n_given += self._give(vehicle)
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
        vehicle = outcome.vehicle
        frames = self._jobs.pop(vehicle, ())
        since = self._job_since.pop(vehicle, None)
        if since is not None and outcome.n_consumed < len(frames):
            self._waiting_since[vehicle] = since
        if outcome.error:
            self._fail(outcome, frames)
        elif self._workers.is_open(vehicle):  # otherwise it got a new description meanwhile
            try:
                self._commit(outcome, frames[: outcome.n_consumed])
            except RefusedError as error:
                place = max(outcome.n_consumed - 1, 0)
                self._fail(replace(outcome, n_consumed=place, error=str(error), failure=Failure.FRAME), frames)

    @property
    def _backlog(self) -> int:
        """Number of frames that wait for a worker."""
        return sum(stream.backlog for stream in list(self._streams.values()))

    @property
    def _age(self) -> float:
        """Time since the oldest frame that waits for a worker arrived [s], or a little longer; 0 if none waits."""
        return max(0.0, (self._clock() - min(self._waiting_since.copy().values(), default=self._clock())) / 1e9)

    def _enqueue(self, vehicle: str) -> None:
        """Let a vehicle wait for a worker if there is anything to give."""
        if vehicle in self._jobs or vehicle not in self._streams:
            return
        if self._streams[vehicle].has_waiting:
            self._waiting_since.setdefault(vehicle, self._clock())
        else:
            self._waiting_since.pop(vehicle, None)
            if vehicle not in self._learning:
                return
        self._queue.add(vehicle, self._clock())

    def _defer(self, vehicle: str) -> None:
        """Let a vehicle wait for something else: earlier frames, or its description."""
        self._queue.remove(vehicle)
        self._waiting_since.pop(vehicle, None)
        self._handover.forget(vehicle)

    def _pending(self, vehicle: str, boot: int, *, after: int, limit: int) -> list[StoredFrame]:
        """Return frames of a vehicle that follow a sequence number: those in memory, or else in the store."""
        until = self._streams[vehicle].contiguous[boot]
        held = self._handover.following(vehicle, boot, after=after, until=until, limit=limit)
        return held or self._store.inbox.pending(vehicle, boot, after=after, limit=limit)

    def _give(self, vehicle: str) -> bool:
        """Give the next frames of a vehicle to its worker, or store the next report of its box."""
        stream, workers = self._streams[vehicle], self._workers
        if not self._backoff.is_due(vehicle):
            if vehicle in self._waiting_since:
                self._waiting_since[vehicle] = self._clock()  # for itself, not for a worker
            return False
        if not workers.is_free(vehicle):
            return False
        if not (workers.is_open(vehicle) or self._open(vehicle)):
            self._defer(vehicle)
            return False
        frames = stream.next_frames(partial(self._pending, vehicle), _JOB)
        if frames and frames[0].kind != "raw":
            return self._give_report(stream, frames[0])
        if not frames and vehicle not in self._learning:
            self._defer(vehicle)
            return False
        n_samples = next((k for k, frame in enumerate(frames) if frame.kind != "raw"), len(frames))
        self._submit(vehicle, frames[:n_samples])
        return True

    def _give_report(self, stream: Stream, report: StoredFrame) -> bool:
        """Store a report of a box; first the state of the worker, which holds the frames before it."""
        if stream.dispatched.get(report.boot, -1) > stream.done.get(report.boot, -1):
            self._submit(report.vehicle, [])
        else:
            try:
                self._ledger.store_report(report)
            except RefusedError as error:
                vehicle, boot, seq = report.vehicle, report.boot, report.seq
                self._ledger.set_frames_aside(vehicle, boot, seq, seq, reason=str(error))
                self._ledger.complete(vehicle, boot, seq)
            stream.complete(report.boot, report.seq)
            self._handover.release(report.vehicle, report.boot, report.seq)
            self._queue.remove(report.vehicle)
            self._enqueue(report.vehicle)
        return True

    def _submit(self, vehicle: str, frames: Sequence[StoredFrame]) -> None:
        """Start a job, which without frames returns the state."""
        command = self._learning.get(vehicle)
        self._jobs[vehicle], self._learnt[vehicle] = frames, command
        self._workers.submit(vehicle, [frame.payload for frame in frames], learn=self._baseline_wanted(command))
        self._queue.remove(vehicle)
        if len(frames) >= self._streams[vehicle].backlog:  # what arrives from here on waits from then
            self._job_since[vehicle] = self._waiting_since.pop(vehicle, self._clock())

    def _baseline_wanted(self, command: CommandRow | None) -> str | Baseline:
        """Return the reason to learn, or the baseline to return to; empty if the baseline stays."""
        if command is None:
            return ""
        if command.act != ROLL_BACK:
            return str(command.detail or "maintenance")
        try:
            return restored_baseline(self._store, command.vehicle, **command.detail)
        except ParameterError as error:
            LOG.warning("baseline stays", extra={"vehicle": command.vehicle, "reason": str(error)})
            return ""

    def _open(self, vehicle: str) -> bool:
        """Give a vehicle to a worker with its stored state; return whether its description is known."""
        row = self._store.inbox.vehicle(vehicle)
        if row is None:
            return False
        snapshot = self._store.results.snapshot(vehicle)
        stream = self._streams[vehicle]
        known = self._store.inbox.cursors(vehicle=vehicle)
        cursors = {boot: known.get((vehicle, boot), Cursor()) for boot in stream.contiguous}
        stream.rewind(cursors)
        state, history = None, History()
        if snapshot is not None:
            state = snapshot.document
        else:
            history = history_of(self._store, vehicle, max_windows=self._settings.most_windows)
        is_learning = self._is_learning(vehicle, has_state=snapshot is not None)
        of_type = type_of_others(self._store, vehicle, types=self._types) if is_learning else None
        self._workers.open(
            Opening(vehicle, row.description, dict(row.channels), state, self._settings, of_type, history)
        )
        self._descriptions[vehicle] = (row.description, row.channels)
        return True

    def _is_learning(self, vehicle: str, *, has_state: bool) -> bool:
        """Return whether a vehicle learns a baseline, as far as is known."""
        status = self._statuses.get(vehicle)
        if status is not None:
            return status.is_learning
        stored = self._store.results.status(vehicle) if has_state else None
        return stored is None or bool(stored.get("is_learning", True))

    def _commit(self, outcome: Outcome, taken: Sequence[StoredFrame]) -> None:
        """Store the results of a job, and the progress of its vehicle."""
        vehicle = outcome.vehicle
        stream = self._streams[vehicle]
        boot, seq = (taken[-1].boot, taken[-1].seq) if taken else stream.position
        command, covered = self._learnt.get(vehicle), stream.covered(boot)
        with self._store.together():  # a window and its alerts are stored together or not at all
            is_saved = self._ledger.commit(outcome, boot, seq)
            if is_saved:
                for other, last in covered:
                    self._ledger.complete(vehicle, other, last)
                self._ledger.update_alerts(vehicle, outcome.events)
                if command is not None:
                    self._ledger.finish_learning(command.id)
        if is_saved:
            stream.done.update(covered)
            stream.done[boot] = seq
            if command is not None:
                self._learning.pop(vehicle, None)
            self._failure_counts.forget(vehicle)  # not before: a window that fails begins with jobs that succeed
            self._backoff.succeed(vehicle)
        self._statuses[vehicle] = outcome.status
        if taken:
            stream.dispatched[boot] = seq
            self._handover.release(vehicle, boot, seq)
        is_window = any(isinstance(event, Observed) for event in outcome.events)
        # Opened again, from the state just stored, with the baseline of its type as it is now, or in another process.
        is_learning = is_window and outcome.status.is_learning and self._types.has_type(vehicle)
        if is_learning or (outcome.state is not None and self._workers.is_misplaced(vehicle)):
            self._workers.close_vehicle(vehicle)

    def _fail(self, outcome: Outcome, frames: Sequence[StoredFrame]) -> None:
        """Leave out what a job failed on, if it failed there repeatedly; the vehicle is opened again after a while."""
        vehicle, reason = outcome.vehicle, outcome.error
        if outcome.failure is Failure.QUOTA and frames:
            last = frames[max(outcome.n_consumed, 1) - 1]
            self._ledger.set_frames_aside(vehicle, last.boot, frames[0].seq, last.seq, reason=reason)
            self._handover.forget(vehicle)
            self._streams[vehicle].dispatched[last.boot] = last.seq
            return
        self._n_failures += 1
        LOG.warning("analysis failed", extra={"vehicle": vehicle, "reason": reason})
        self._workers.close_vehicle(vehicle)
        number = self._backoff.fail(vehicle)
        if outcome.failure is Failure.STATE and self._ledger.set_state_aside(vehicle, reason=reason):
            self._backoff.succeed(vehicle)
        elif outcome.failure is Failure.FRAME and frames:
            self._count_failure(vehicle, frames[min(outcome.n_consumed, len(frames) - 1)], reason)
        elif number > 1:
            self._ledger.warn(vehicle, "monitor:opening", f"frames wait, as the vehicle cannot be opened: {reason}")

    def _count_failure(self, vehicle: str, frame: StoredFrame, reason: str) -> None:
        """Set a frame aside on which jobs failed repeatedly, or the window in which one was set aside before."""
        first = self._failure_counts.add(
            vehicle, frame.boot, frame.seq, done=self._streams[vehicle].done.get(frame.boot, -1)
        )
        if first is None:
            return
        self._ledger.set_frames_aside(vehicle, frame.boot, first, frame.seq, reason=reason)
        self._failure_counts.leave_out(vehicle)  # not before: the store may have refused
        self._handover.forget(vehicle)
        self._backoff.succeed(vehicle)
