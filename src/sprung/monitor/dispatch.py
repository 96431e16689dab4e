"""Frames to workers, vehicle by vehicle in turn, and the outcomes of their jobs."""

import logging
from collections.abc import Mapping, Sequence
from functools import partial

from sprung.monitor.engine import MonitorSettings, Observed
from sprung.monitor.fleets import has_type, type_of_others
from sprung.monitor.ledger import Ledger
from sprung.monitor.streams import Stream
from sprung.monitor.workers import Opening, Outcome, VehicleStatus, Workers
from sprung.storage import CommandRow, Cursor, Store, StoredFrame, StoreError

LOG = logging.getLogger("sprung.monitor")

#: Largest number of frames of one job.
_JOB = 300
#: Failures after which the frames of a job are excluded.
_STRIKES = 2


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

    Notes
    -----
    A vehicle has at most one job. If the job fails, the vehicle is opened again from the stored state; if it fails
    twice in a row, the frames are excluded.
    """

    def __init__(self, store: Store, workers: Workers, ledger: Ledger, settings: MonitorSettings) -> None:
        self._store, self._workers, self._ledger, self._settings = store, workers, ledger, settings
        self._streams: dict[str, Stream] = {}
        self._jobs: dict[str, Sequence[StoredFrame]] = {}
        self._learning: dict[str, CommandRow] = {}
        self._learnt: dict[str, CommandRow | None] = {}
        self._strikes: dict[str, int] = {}
        self._statuses: dict[str, VehicleStatus] = {}
        self._n_failures = 0

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
        """Figures of `sprung.monitor.serving.FIGURES` about vehicles, jobs and their results."""
        return {
            **self._ledger.figures,
            "sprung_vehicles": len(self._streams),
            "sprung_backlog_frames": sum(stream.backlog for stream in list(self._streams.values())),
            "sprung_failures_total": self._n_failures,
        }

    def open(self) -> None:
        """Continue from the stored states."""
        for (vehicle, boot), cursor in self._store.inbox.cursors().items():
            self.add(vehicle, boot, cursor.contiguous)
            stream = self._streams[vehicle]
            stream.dispatched[boot] = cursor.done

    def close(self) -> None:
        """Stop the workers."""
        self._workers.close()

    def add(self, vehicle: str, boot: int, contiguous: int) -> None:
        """Record that the frames of a boot arrived up to a sequence number."""
        self._streams.setdefault(vehicle, Stream()).arrived(boot, contiguous)

    def describe(self, vehicle: str) -> None:
        """Record that a vehicle has a new description: its frames are analysed again from the stored state."""
        LOG.info("vehicle described", extra={"vehicle": vehicle})
        self._workers.close_vehicle(vehicle)

    def relearn(self, command: CommandRow) -> None:
        """Let a vehicle learn a new baseline before its next frames; requests for one vehicle are queued."""
        self._learning.setdefault(command.vehicle, command)

    def give(self) -> int:
        """Give frames to workers, least recently served vehicle first, and return the number of jobs and reports.

        Raises
        ------
        StoreError
            If the store cannot be used.
        """
        n_given = 0
        for vehicle in list(self._streams):
            if self._workers.is_busy:
                break
            n_given += self._give(vehicle)
        return n_given

    def collect(self, *, timeout: float) -> list[Outcome]:
        """Return the available outcomes, waiting up to a time [s] for the first."""
        return self._workers.outcomes(timeout=timeout)

    def settle(self, outcome: Outcome) -> None:
        """Store the outcome of a job.

        Raises
        ------
        StoreError
            If the store cannot write: the vehicle continues from the stored state.
        """
        vehicle = outcome.vehicle
        frames = self._jobs.pop(vehicle, ())
        if outcome.error:
            self._fail(vehicle, frames, outcome.error)
        elif self._workers.is_open(vehicle):  # otherwise it got a new description meanwhile
            try:
                self._commit(outcome, frames[: outcome.n_consumed])
            except StoreError:
                # The worker is ahead of the store.
                self._workers.close_vehicle(vehicle)
                raise

    def _give(self, vehicle: str) -> bool:
        """Give the next frames of a vehicle to its worker, or store the next report of its box."""
        stream, workers = self._streams[vehicle], self._workers
        if vehicle in self._jobs or not (stream.has_waiting or vehicle in self._learning):
            return False
        if not (workers.is_open(vehicle) or self._open(vehicle)) or not workers.is_free(vehicle):
            return False
        frames = stream.next_frames(partial(self._store.inbox.pending, vehicle), _JOB)
        if frames and frames[0].kind != "raw":
            return self._give_report(stream, frames[0])
        if not frames and vehicle not in self._learning:
            return False
        n_samples = next((k for k, frame in enumerate(frames) if frame.kind != "raw"), len(frames))
        self._submit(vehicle, frames[:n_samples])
        return True

    def _give_report(self, stream: Stream, report: StoredFrame) -> bool:
        """Store a report of a box; first the state of the worker, which holds the frames before it."""
        if stream.dispatched.get(report.boot, -1) > stream.done.get(report.boot, -1):
            self._submit(report.vehicle, [])
        else:
            self._ledger.store_report(report)
            stream.complete(report.boot, report.seq)
        return True

    def _submit(self, vehicle: str, frames: Sequence[StoredFrame]) -> None:
        """Start a job, which without frames returns the state. The vehicle moves to the end of the queue."""
        learn = self._learning.get(vehicle)
        reason = "" if learn is None else str(learn.detail or "maintenance")
        self._jobs[vehicle], self._learnt[vehicle] = frames, learn
        self._workers.submit(vehicle, [frame.payload for frame in frames], learn=reason)
        self._streams[vehicle] = self._streams.pop(vehicle)

    def _open(self, vehicle: str) -> bool:
        """Give a vehicle to a worker with its stored state; return whether its description is known."""
        row = self._store.inbox.vehicle(vehicle)
        if row is None:
            return False
        snapshot = self._store.results.snapshot(vehicle)
        stream = self._streams[vehicle]
        cursors: dict[int, Cursor] = {boot: self._store.inbox.cursor(vehicle, boot) for boot in stream.contiguous}
        stream.rewind(cursors, -1 if snapshot is None else snapshot.boot)
        if snapshot is not None:
            self._finish_boots(vehicle, snapshot.boot)
        state = None if snapshot is None else snapshot.document
        status = self._statuses.get(vehicle)
        of_type = type_of_others(self._store, vehicle) if status is None or status.is_learning else None
        self._workers.open(Opening(vehicle, row.description, dict(row.channels), state, self._settings, of_type))
        return True

    def _commit(self, outcome: Outcome, taken: Sequence[StoredFrame]) -> None:
        """Store the results of a job, and the progress of its vehicle."""
        vehicle = outcome.vehicle
        stream = self._streams[vehicle]
        boot, seq = (taken[-1].boot, taken[-1].seq) if taken else stream.position
        command = self._learnt.get(vehicle)
        with self._store.together():  # no window is stored without what it says to people, whatever happens
            is_saved = self._ledger.commit(outcome, boot, seq)
            if is_saved:
                self._ledger.update_alerts(vehicle, outcome.events)
                if command is not None:
                    self._ledger.finish_learning(command.id)
        if is_saved:
            stream.done[boot] = seq
            if command is not None:
                self._learning.pop(vehicle, None)
            self._finish_boots(vehicle, boot)
            self._strikes.pop(vehicle, None)  # not before: a window that fails begins with jobs that do not
        self._statuses[vehicle] = outcome.status
        if taken:
            stream.dispatched[boot] = seq
        is_window = any(isinstance(event, Observed) for event in outcome.events)
        if is_window and outcome.status.is_learning and has_type(self._store, vehicle):
            # Opened again, from the state just stored, with the baseline of its type as it is now.
            self._workers.close_vehicle(vehicle)

    def _finish_boots(self, vehicle: str, boot: int) -> None:
        """Remove the frames of boots before that of the stored state, which covers them."""
        stream = self._streams[vehicle]
        for older, last in stream.finished(boot):
            self._ledger.complete(vehicle, older, last)
            stream.done[older] = last

    def _fail(self, vehicle: str, frames: Sequence[StoredFrame], reason: str) -> None:
        """Retry a job from the stored state; exclude its frames if it fails again."""
        self._n_failures += 1
        strikes = self._strikes[vehicle] = self._strikes.get(vehicle, 0) + 1
        LOG.error("analysis failed", extra={"vehicle": vehicle, "reason": reason, "strikes": strikes})
        self._workers.close_vehicle(vehicle)
        if strikes < _STRIKES or not frames:
            return
        boot, seq = frames[-1].boot, frames[-1].seq
        stream = self._streams[vehicle]
        n_frames = seq - stream.done.get(boot, -1)
        self._ledger.exclude(vehicle, boot, seq, n_frames=n_frames, reason=reason)
        stream.complete(boot, seq)
        self._strikes.pop(vehicle)
