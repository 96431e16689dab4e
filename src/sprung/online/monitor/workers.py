"""Processes of analysis, and how vehicles are shared among them."""

import math
import multiprocessing
import os
import pickle
import queue
import signal
import threading
from collections import deque
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg

from sprung.diagnosis import Baseline
from sprung.errors import SprungError
from sprung.online.monitor.engine import StateError, VehicleMonitor
from sprung.online.monitor.events import Observed
from sprung.online.monitor.jobs import Failure, Limits, Opening, Outcome, analyse, failed, open_monitor

#: Largest answer of a process [bytes]: the samples of a window, and more than any results.
_MAX_BYTES = 1 << 30
_CONTEXT = multiprocessing.get_context("spawn")


class Lost(NamedTuple):
    """Answer in place of a process that is lost: why."""

    reason: str


#: Answer of a process to each request: an outcome, None if there is none, or that the process is lost.
Answer = Outcome | Lost | None


class WorkerProcess:
    """A process that monitors vehicles.

    Parameters
    ----------
    limits
        Limits of its jobs.
    notify
        Function called, in another thread, when there is an answer.
    """

    def __init__(self, limits: Limits, notify: Callable[[], object]) -> None:
        self._connection, there = _CONTEXT.Pipe()
        self._progress = _CONTEXT.RawValue("q", 0)
        self._process = _CONTEXT.Process(target=work, args=(there, self._progress, limits), daemon=True)
        self._process.start()
        there.close()
        self._requests: queue.SimpleQueue[object] = queue.SimpleQueue()
        self._answers: queue.SimpleQueue[Answer] = queue.SimpleQueue()
        self._notify = notify
        threading.Thread(target=self._carry, name=f"courier of {self.pid}", daemon=True).start()

    @property
    def pid(self) -> int | None:
        """Number of the process."""
        return self._process.pid

    @property
    def is_alive(self) -> bool:
        """Whether the process runs."""
        return self._process.is_alive()

    @property
    def seconds(self) -> float:
        """Processor time of the process so far [s]; 0 if it is unknown."""
        try:
            fields = Path(f"/proc/{self.pid}/stat").read_text(encoding="utf-8", errors="replace").rpartition(")")[2]
        except OSError:
            return 0.0
        return sum(map(int, fields.split()[11:13])) / os.sysconf("SC_CLK_TCK")

    @property
    def n_consumed(self) -> int:
        """Number of frames of the present job that are consumed."""
        return int(self._progress.value)

    def send(self, request: object) -> None:
        """Send a request; it is answered once."""
        self._requests.put(request)

    def answers(self) -> list[Answer]:
        """Return the answers that have arrived, the first of which says that the process has started."""
        return [self._answers.get_nowait() for _ in range(self._answers.qsize())]  # nobody else takes them

    def kill(self) -> None:
        """End the process at once."""
        self._process.kill()
        self._process.join()
        self._requests.put(None)

    def join(self, timeout: float) -> None:
        """Wait for the process to end after the request None, then end it."""
        self._process.join(timeout)
        self.kill()

    def _carry(self) -> None:
        """Carry answers and requests, one after the other."""
        while True:
            message = received(self._connection)
            self._answers.put(message)
            self._notify()
            if isinstance(message, Lost):
                break
            request = self._requests.get()
            with suppress(OSError):  # a process that is dead shows in its answer
                self._connection.send(request)
            if request is None:
                break
        self._connection.close()


def received(connection: Connection) -> Answer:
    """Return the next answer of a process; `Lost` if it is too large, truncated or not an outcome."""
    try:
        message = pickle.loads(connection.recv_bytes(_MAX_BYTES))
    except EOFError:
        return Lost("the process of its analysis died")
    except Exception as error:  # a truncated answer may raise anything
        return Lost(f"the process of its analysis gave an unreadable answer ({type(error).__name__})")
    if message is None or isinstance(message, Outcome):
        return message
    return Lost("the process of its analysis gave an answer that is not an outcome")


def work(connection: Connection, progress: Any, limits: Limits) -> None:
    """Monitor vehicles, in a process of its own, until None is received."""
    monitors: dict[str, tuple[VehicleMonitor, dict[str, str]]] = {}

    def report(n_consumed: int) -> None:
        progress.value = n_consumed

    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to this process, too: the monitor ends it
    with suppress(EOFError, OSError):  # the monitor is gone; its successor continues from the store
        _start_libraries()
        connection.send(None)
        while (request := connection.recv()) is not None:
            report(0)
            connection.send(answer(request, monitors, limits=limits, report=report))


def _start_libraries() -> None:
    """Let the linear algebra allocate its buffers: without memory later, it would end the process."""
    for library in (np.linalg, scipy.linalg):
        library.svd(np.eye(200) @ np.eye(200))


def answer(
    request: Any,
    monitors: dict[str, tuple[VehicleMonitor, dict[str, str]]],
    *,
    limits: Limits | None = None,
    report: Callable[[int], None] = lambda n_consumed: None,
) -> Outcome | None:
    """Return the answer to a request: an outcome, or None if there is none.

    Parameters
    ----------
    request
        "open" with an opening, "close" with a vehicle, or "work" with vehicle, frames, and reason to learn or
        baseline to return to.
    monitors
        Open vehicles, which the request may change.
    limits, report
        As for `analyse`.
    """
    kind, *parts = request
    if kind == "open":
        opening: Opening = parts[0]
        try:
            monitors[opening.vehicle] = open_monitor(opening)
        except Exception as error:  # a state may be anything
            failure = Failure.STATE if isinstance(error, StateError) else Failure.VEHICLE
            reason = str(error) if isinstance(error, SprungError) else f"{type(error).__name__}: {error}"
            return failed(opening.vehicle, reason, failure)
    elif kind == "close":
        monitors.pop(parts[0], None)
    elif parts[0] in monitors:  # otherwise it could not be opened, which was the answer then
        vehicle, frames, learn = parts
        return analyse(
            vehicle,
            monitors[vehicle],
            frames,
            learn=learn,
            limits=limits,
            report=report,
        )
    return None


# Shares of the limit of a job, in processor time: vehicles are not blamed for a computer that is too slow for all.
#: Share after which a vehicle that is not slow is stopped.
_FIRST = 1 / 6
#: Share above which a vehicle is slow.
_SLOW = 1 / 18
#: Share after which a job ends with the frame at hand.
_SLICE = 1 / 36
#: Number of windows without a slow job after which a slow vehicle returns to the others.
_QUICK_WINDOWS = 3
#: Longest time in which a process starts [s].
_STARTING = 120.0


class _Task(NamedTuple):
    """A request that is not answered yet; a process starts with one of no vehicle."""

    kind: str
    vehicle: str = ""
    has_state: bool = False


@dataclass(slots=True)
class _Worker:
    """A process, its vehicles, and its unanswered requests, the first of which is under way."""

    process: WorkerProcess
    since: float
    seconds: float = 0.0
    is_for_slow: bool = False
    vehicles: set[str] = field(default_factory=set)
    tasks: deque[_Task] = field(default_factory=lambda: deque([_Task("start")]))


class Workers:
    """Processes that monitor vehicles.

    Parameters
    ----------
    count
        Number of processes; one more is started for slow vehicles when there are any.
    limit
        Longest time of a job [s].
    clock
        Present time [s] of a monotonic clock.
    vehicle_bytes
        Largest size of the samples of a window, and of the state, of one vehicle [bytes].
    job_bytes
        Largest memory that a job may take in addition to what its process holds [bytes].
    start
        Function of the limits of jobs, and of a function to call when there is an answer, that starts a process.

    Notes
    -----
    A vehicle stays with one process, which keeps its `VehicleMonitor`. A process that dies, or hangs, is replaced; its
    vehicles must be opened again, which other processes can do at once.

    A vehicle whose job lost its process is slow, and so is one whose job took more than an eighteenth of the limit of
    processor time. Slow vehicles share a process of their own, so that only they wait for each other. Among the others
    a job is stopped after a sixth of the limit of processor time, too; it is tried again in full among the slow ones.
    After three windows without a slow job a vehicle returns.
    """

    def __init__(
        self,
        count: int,
        *,
        limit: float,
        clock: Callable[[], float],
        vehicle_bytes: float = math.inf,
        job_bytes: float = math.inf,
        start: Callable[[Limits, Callable[[], object]], WorkerProcess] = WorkerProcess,
    ) -> None:
        self._limit = limit
        self._clock = clock
        self._start_process = start
        self._limits = Limits(_SLICE * limit, vehicle_bytes, job_bytes)
        self._answered = threading.Event()
        self._slow: dict[str, int] = {}
        self._heaviest: dict[str, float] = {}
        self._n_replaced = 0
        self._workers = [self._start() for _ in range(count)]

    @property
    def pids(self) -> list[int | None]:
        """Numbers of the processes."""
        return [worker.process.pid for worker in self._workers]

    @property
    def figures(self) -> dict[str, float]:
        """Figures of `sprung.online.monitor.station.FIGURES` about processes and slow vehicles."""
        return {"sprung_vehicles_slow": len(self._slow), "sprung_workers_replaced_total": self._n_replaced}

    @property
    def is_busy(self) -> bool:
        """Whether no process can take a job."""
        has_room = self._slow and not any(worker.is_for_slow for worker in self._workers)
        return not has_room and all(worker.tasks for worker in self._workers)

    def is_open(self, vehicle: str) -> bool:
        """Return whether a process has the vehicle open."""
        return self._of(vehicle) is not None

    def is_free(self, vehicle: str) -> bool:
        """Return whether a process can take a job of a vehicle: its own, or any that could open it."""
        worker = self._of(vehicle)
        if worker is not None:
            return not worker.tasks
        able = self._able(vehicle)
        return not all(worker.tasks for worker in able) or (self._is_slow(vehicle) and not able)

    def is_misplaced(self, vehicle: str) -> bool:
        """Return whether an open vehicle belongs to another process, as it is slow now or no longer."""
        worker = self._of(vehicle)
        return worker is not None and worker.is_for_slow != self._is_slow(vehicle)

    def open(self, opening: Opening) -> None:
        """Give a vehicle to an idle process if there is one, and among these to the one with the fewest vehicles."""
        vehicle = opening.vehicle
        self.close_vehicle(vehicle)
        if not self._is_slow(vehicle):
            self._slow.pop(vehicle, None)
        elif not self._able(vehicle):
            self._workers.append(self._start(is_for_slow=True))
        worker = min(self._able(vehicle), key=lambda worker: (bool(worker.tasks), len(worker.vehicles)))
        worker.vehicles.add(vehicle)
        self._send(worker, _Task("open", vehicle, opening.state is not None), ("open", opening))

    def close_vehicle(self, vehicle: str) -> None:
        """Take a vehicle from its process."""
        worker = self._of(vehicle)
        if worker is not None:
            worker.vehicles.discard(vehicle)
            self._send(worker, _Task("close", vehicle), ("close", vehicle))

    def submit(self, vehicle: str, frames: Sequence[bytes], *, learn: str | Baseline = "") -> None:
        """Start a job.

        Parameters
        ----------
        vehicle
            Name of a vehicle that a process has open.
        frames
            Frames in order; none, to get the state.
        learn
            Reason to learn a new baseline from these frames on, or an earlier baseline to return to; empty: the
            baseline stays.
        """
        worker = next(worker for worker in self._workers if vehicle in worker.vehicles)
        self._send(worker, _Task("work", vehicle), ("work", vehicle, list(frames), learn))

    def outcomes(self, *, timeout: float = 0.0) -> list[Outcome]:
        """Return the available outcomes, waiting up to a time [s] for the first."""
        self._answered.wait(timeout)
        self._answered.clear()
        outcomes: list[Outcome] = []
        for worker in list(self._workers):
            for answer in worker.process.answers():
                outcomes += self._take(worker, answer)
            if worker in self._workers:
                outcomes += self._check(worker)
        return outcomes

    def close(self) -> None:
        """Stop all processes."""
        for worker in self._workers:
            worker.process.send(None)
        for worker in self._workers:
            worker.process.join(2.0)

    def _of(self, vehicle: str) -> _Worker | None:
        """Return the worker that has a vehicle open."""
        return next((worker for worker in self._workers if vehicle in worker.vehicles), None)

    def _able(self, vehicle: str) -> list[_Worker]:
        """Return the workers that may open a vehicle."""
        is_slow = self._is_slow(vehicle)
        return [worker for worker in self._workers if worker.is_for_slow == is_slow]

    def _is_slow(self, vehicle: str) -> bool:
        return self._slow.get(vehicle, _QUICK_WINDOWS) < _QUICK_WINDOWS

    def _take(self, worker: _Worker, answer: Answer) -> list[Outcome]:
        """Return the outcome in an answer to the request under way."""
        if isinstance(answer, Lost):
            return self._replace(worker, answer.reason)
        task = worker.tasks.popleft()
        self._begin(worker)
        if answer is None:
            return []
        if task.kind == "open":
            worker.vehicles.discard(task.vehicle)
        else:
            self._note_time(answer)
        return [answer]

    def _note_time(self, outcome: Outcome) -> None:
        """Decide after a window whether its vehicle is slow."""
        vehicle = outcome.vehicle
        heaviest = max(outcome.seconds, self._heaviest.pop(vehicle, 0.0))
        if not any(isinstance(event, Observed) for event in outcome.events):
            self._heaviest[vehicle] = heaviest
        elif heaviest > _SLOW * self._limit:
            self._slow[vehicle] = 0
        elif vehicle in self._slow:
            self._slow[vehicle] += 1

    def _check(self, worker: _Worker) -> list[Outcome]:
        """Replace a process whose request takes too long, or that died without one."""
        if not worker.tasks:
            return [] if worker.process.is_alive else self._replace(worker, "")
        limit, first = self._limit, _FIRST * self._limit
        if worker.tasks[0].kind == "start":
            limit = _STARTING
        elapsed = self._clock() - worker.since
        if elapsed > limit:
            return self._replace(worker, f"its analysis took longer than {limit:g} s")
        if elapsed > first and not worker.is_for_slow and worker.process.seconds - worker.seconds > first:
            return self._replace(worker, f"its analysis took longer than {first:g} s of processor time")
        return []

    def _replace(self, worker: _Worker, reason: str) -> list[Outcome]:
        """Replace a process; return failed outcomes of the vehicles that it was asked for, the one at fault first."""
        worker.process.kill()
        self._n_replaced += 1
        self._workers[self._workers.index(worker)] = self._start(is_for_slow=worker.is_for_slow)
        is_started = bool(worker.tasks) and worker.tasks[0].kind != "start"
        asked = [task for task in worker.tasks if task.kind in {"open", "work"}]
        outcomes: dict[str, Outcome] = {}
        for task in asked:
            if task.vehicle not in outcomes:
                is_guilty = is_started and not outcomes
                outcomes[task.vehicle] = self._failed(task, worker.process.n_consumed, reason, is_guilty=is_guilty)
        return list(outcomes.values())

    def _failed(self, task: _Task, n_consumed: int, reason: str, *, is_guilty: bool) -> Outcome:
        """Return the failed outcome of a request whose process is lost; the guilty vehicle is slow from now on."""
        if not is_guilty:
            return failed(task.vehicle, "the process of its analysis was lost", Failure.VEHICLE)
        is_first = not self._is_slow(task.vehicle)
        self._slow[task.vehicle] = 0
        if task.kind == "work":
            return failed(task.vehicle, reason, Failure.FRAME, n_consumed=n_consumed)
        failure = Failure.STATE if task.has_state and not is_first else Failure.VEHICLE
        return failed(task.vehicle, f"while it was opened: {reason}", failure)

    def _start(self, *, is_for_slow: bool = False) -> _Worker:
        """Start a process."""
        return _Worker(self._start_process(self._limits, self._answered.set), self._clock(), is_for_slow=is_for_slow)

    def _begin(self, worker: _Worker) -> None:
        """Count the time of the next request from now on."""
        worker.since, worker.seconds = self._clock(), worker.process.seconds

    def _send(self, worker: _Worker, task: _Task, request: object) -> None:
        """Send a request."""
        if not worker.tasks:
            self._begin(worker)
        worker.tasks.append(task)
        worker.process.send(request)
