"""A process that analyses, and the courier that talks with it, so that nothing waits for a process that hangs."""

import multiprocessing
import os
import pickle
import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import scipy.linalg

from sprung.errors import SprungError
from sprung.online.monitor.engine import StateError, VehicleMonitor
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

    with suppress(EOFError, KeyboardInterrupt, OSError):  # the monitor is gone; its successor continues from the store
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
