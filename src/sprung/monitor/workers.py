"""Worker processes: each watches some of the vehicles, and a slow or poisoned one is stopped, not waited for."""

import multiprocessing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any

from sprung._checks import required
from sprung.errors import SprungError
from sprung.link import decode, frame_block
from sprung.monitor.engine import Event, MonitorSettings, Observed, VehicleMonitor
from sprung.vehicles import vehicle_from_text


@dataclass(frozen=True, eq=False, slots=True)
class Opening:
    """What a worker needs to watch a vehicle.

    Parameters
    ----------
    vehicle
        Its name.
    description
        Its file.
    quantities
        Of its channels.
    state
        To go on from, in CBOR; None: from the beginning.
    settings
        Of a vehicle that begins.
    """

    vehicle: str
    description: str
    quantities: Mapping[str, str]
    state: bytes | None
    settings: MonitorSettings


@dataclass(frozen=True, eq=False, slots=True)
class Outcome:
    """What a job came to.

    Parameters
    ----------
    vehicle
        Its name.
    n_consumed
        Frames that were taken in: all, or up to the one that completed a window.
    events
        In order.
    state
        After a window that was completed, a new learning or no frames, in CBOR; None otherwise.
    progress
        Share of the present window, windows that taught and are needed, and what stands in the way.
    error
        Why it failed; empty where it did not.
    """

    vehicle: str
    n_consumed: int
    events: tuple[Event, ...]
    state: bytes | None
    progress: tuple[float, int, int, str]
    error: str = ""


@dataclass(slots=True)
class _Worker:
    """A process, the connection to it, and the job it is at."""

    process: Any
    connection: Connection
    vehicles: set[str]
    busy_with: str | None = None
    since: float = 0.0


class Workers:
    """Processes that watch vehicles.

    Parameters
    ----------
    count
        Of processes.
    limit
        Time that a job may take [s].
    clock
        Any clock [s].

    Notes
    -----
    A vehicle stays with one process, which keeps its `VehicleMonitor`. A process that dies, or takes longer than the
    limit, is replaced; its vehicles must be opened again.
    """

    def __init__(self, count: int, *, limit: float, clock: Callable[[], float]) -> None:
        self._context = multiprocessing.get_context("spawn")
        self._limit, self._clock = limit, clock
        self._workers = [self._started() for _ in range(count)]

    @property
    def pids(self) -> list[int]:
        """Of the processes."""
        return [worker.process.pid for worker in self._workers]

    @property
    def is_busy(self) -> bool:
        """Whether no process can take a job."""
        return all(worker.busy_with is not None for worker in self._workers)

    def is_open(self, vehicle: str) -> bool:
        """Tell whether a process watches a vehicle."""
        return any(vehicle in worker.vehicles for worker in self._workers)

    def open(self, opening: Opening) -> None:
        """Give a vehicle to the process with the fewest."""
        self.close_vehicle(opening.vehicle)
        worker = min(self._workers, key=lambda one: len(one.vehicles))
        worker.vehicles.add(opening.vehicle)
        self._send(worker, ("open", opening))

    def close_vehicle(self, vehicle: str) -> None:
        """Take a vehicle from its process."""
        for worker in self._workers:
            if vehicle in worker.vehicles:
                worker.vehicles.discard(vehicle)
                self._send(worker, ("close", vehicle))

    def is_free(self, vehicle: str) -> bool:
        """Tell whether the process of a vehicle can take a job."""
        return any(vehicle in worker.vehicles and worker.busy_with is None for worker in self._workers)

    def submit(self, vehicle: str, frames: Sequence[bytes], *, learn: str = "") -> None:
        """Give frames to the process of a vehicle, or none to have its state; `learn`: reason to learn again first."""
        worker = next(one for one in self._workers if vehicle in one.vehicles)
        worker.busy_with, worker.since = vehicle, self._clock()
        self._send(worker, ("work", vehicle, list(frames), learn))

    def outcomes(self, *, timeout: float = 0.0) -> list[Outcome]:
        """Return what is done by now, waiting for the first up to a time [s]."""
        found = []
        ready = wait([worker.connection for worker in self._workers], timeout=timeout)
        for worker in list(self._workers):
            if worker.connection in ready:
                found.append(self._received(worker))
            elif worker.busy_with is not None and self._clock() - worker.since > self._limit:
                found.append(self._replaced(worker, f"its analysis took longer than {self._limit:g} s"))
        return [one for one in found if one is not None]

    def close(self) -> None:
        """Stop all processes."""
        for worker in self._workers:
            self._send(worker, None)
        for worker in self._workers:
            worker.process.join(2.0)
            if worker.process.is_alive():
                worker.process.kill()
                worker.process.join()

    def _received(self, worker: _Worker) -> Outcome | None:
        """Return what a process sent; replace it where it is dead."""
        try:
            outcome: Outcome = worker.connection.recv()
        except (EOFError, OSError):
            return self._replaced(worker, "the process of its analysis died")
        worker.busy_with = None
        return outcome

    def _replaced(self, worker: _Worker, why: str) -> Outcome | None:
        """Start another process in place of one, and blame the vehicle it was at."""
        worker.process.kill()
        worker.process.join()
        worker.connection.close()
        blamed = worker.busy_with
        self._workers[self._workers.index(worker)] = self._started()
        return None if blamed is None else Outcome(blamed, 0, (), None, (0.0, 0, 0, ""), why)

    def _started(self) -> _Worker:
        """Return a new process."""
        here, there = self._context.Pipe()
        process = self._context.Process(target=_work, args=(there,), daemon=True)
        process.start()
        there.close()
        return _Worker(process, here, set())

    def _send(self, worker: _Worker, message: object) -> None:
        """Send to a process; one that is dead is found out at the next look."""
        try:
            worker.connection.send(message)
        except (BrokenPipeError, OSError):
            return


def _work(connection: Connection) -> None:
    """Watch vehicles, in a process of its own, until told to stop."""
    watched: dict[str, tuple[VehicleMonitor, dict[str, str]]] = {}
    refused: dict[str, str] = {}
    while True:
        try:
            message = connection.recv()
        except (EOFError, KeyboardInterrupt):
            return
        if message is None:
            return
        if message[0] == "open":
            opening: Opening = message[1]
            refused.pop(opening.vehicle, None)
            try:
                watched[opening.vehicle] = _opened(opening)
            except SprungError as error:
                refused[opening.vehicle] = str(error)
        elif message[0] == "close":
            watched.pop(message[1], None)
        else:
            _, vehicle, frames, learn = message
            outcome = _worked(vehicle, watched.get(vehicle), frames, learn, refused.get(vehicle, ""))
            try:
                connection.send(outcome)
            except OSError:
                return  # the monitor is gone: whoever comes after it works from the store


def _opened(opening: Opening) -> tuple[VehicleMonitor, dict[str, str]]:
    """Return the monitor of a vehicle."""
    vehicle = vehicle_from_text(opening.description, source=f"the vehicle file of {opening.vehicle}")
    if opening.state is None:
        return VehicleMonitor(vehicle, settings=opening.settings), dict(opening.quantities)
    return VehicleMonitor.from_state(vehicle, _cbor().loads(opening.state)), dict(opening.quantities)


def _worked(
    vehicle: str, pair: tuple[VehicleMonitor, dict[str, str]] | None, frames: Sequence[bytes], learn: str, refusal: str
) -> Outcome:
    """Return what frames come to."""
    if pair is None:
        return Outcome(vehicle, 0, (), None, (0.0, 0, 0, refusal), refusal or "it is not watched")
    monitor, quantities = pair
    events: list[Event] = []
    consumed, is_changed = 0, bool(learn) or not frames
    try:
        if learn:
            monitor.learn_again(learn)
        for payload in frames:
            events += monitor.update(frame_block(decode(payload), quantities))
            consumed += 1
            if any(isinstance(event, Observed) for event in events):
                is_changed = True
                break
    except Exception as error:  # a vehicle's trouble must not stop the others
        return Outcome(vehicle, consumed, (), None, (0.0, 0, 0, ""), f"{type(error).__name__}: {error}")
    progress = (monitor.buffered, *monitor.learning, monitor.note)
    return Outcome(vehicle, consumed, tuple(events), _cbor().dumps(monitor.state()) if is_changed else None, progress)


def _cbor() -> Any:
    """Return the package that writes states."""
    return required("cbor2", purpose="the state of a vehicle", extra="online")
