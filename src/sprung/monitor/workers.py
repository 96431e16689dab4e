"""Worker processes: each monitors some of the vehicles; one that hangs or dies is replaced."""

import multiprocessing
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from multiprocessing.connection import Connection, wait
from typing import Any, NamedTuple

from sprung._checks import required
from sprung.diagnosis import TypeBaseline
from sprung.errors import SprungError
from sprung.link import decode, frame_block
from sprung.monitor.engine import Event, MonitorSettings, Observed, VehicleMonitor
from sprung.vehicles import vehicle_from_text


class VehicleStatus(NamedTuple):
    """Progress of the monitoring of a vehicle.

    Parameters
    ----------
    share
        Part of the present window that has arrived, 0 to 1.
    n_learnt, n_needed
        Number of windows usable for the baseline so far, and needed; equal where nothing is being learnt.
    note
        Reason why the vehicle cannot be assessed at present; empty if it can.
    is_learning
        Whether windows are collected for a baseline.
    window
        Length of a window [s]; 0: unknown.
    until
        Time after the last sample, UTC ns; None before the first.
    repeated
        Duration of the samples that arrived last and were analysed before [s]; 0 after new ones.
    """

    share: float = 0.0
    n_learnt: int = 0
    n_needed: int = 0
    note: str = ""
    is_learning: bool = False
    window: float = 0.0
    until: int | None = None
    repeated: float = 0.0

    @property
    def in_words(self) -> str:
        """What is learnt so far and what the last samples were good for; empty where nothing needs to be said."""
        parts = [f"learning: {self.n_learnt} of {self.n_needed} windows"] if self.is_learning else []
        if self.note:
            parts.append(f"last window: {self.note}")
        if self.is_learning and self.share:
            length = self.window / 60
            parts.append(f"{self.share * length:.1f} of the {length:g} min of the next window have arrived")
        if self.repeated:
            parts.append(f"the last {self.repeated / 60:.1f} min were analysed before and do not count again")
        return "; ".join(parts)


@dataclass(frozen=True, eq=False, slots=True)
class Opening:
    """Description, state and settings with which a worker opens a vehicle.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    description
        Text of its vehicle file.
    quantities
        Quantity of each channel, by name.
    state
        State to continue from, in CBOR; None: start from scratch.
    settings
        Settings of a vehicle that starts from scratch.
    type_baseline
        Baseline of the vehicle's type; None: that of the state, if it has one.
    """

    vehicle: str
    description: str
    quantities: Mapping[str, str]
    state: bytes | None
    settings: MonitorSettings
    type_baseline: TypeBaseline | None = None


@dataclass(frozen=True, eq=False, slots=True)
class Outcome:
    """Outcome of a job.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    n_consumed
        Number of frames consumed: all, or up to the one that completed a window.
    events
        Events in order of time.
    state
        State in CBOR, after a complete window, a request for a new baseline or a job without frames; None otherwise.
    status
        Status after the job.
    error
        Reason of a failure; empty if there was none.
    n_thinned
        Number of identifications of modes that were left out.
    """

    vehicle: str
    n_consumed: int
    events: tuple[Event, ...]
    state: bytes | None
    status: VehicleStatus
    error: str = ""
    n_thinned: int = 0


@dataclass(slots=True)
class _Worker:
    """A process, the connection to it, and its present job."""

    process: Any
    connection: Connection
    vehicles: set[str]
    busy_with: str | None = None
    since: float = 0.0


class Workers:
    """Processes that monitor vehicles.

    Parameters
    ----------
    count
        Number of processes.
    limit
        Longest time of a job [s].
    clock
        Present time [s] of any clock that only goes forward.

    Notes
    -----
    A vehicle stays with one process, which keeps its `VehicleMonitor`. A process that dies, or takes longer than the
    limit, is replaced; its vehicles must be opened again.

    While `skips_modes` is set, jobs leave out the identifications within windows.
    """

    skips_modes = False

    def __init__(self, count: int, *, limit: float, clock: Callable[[], float]) -> None:
        self._context = multiprocessing.get_context("spawn")
        self._limit, self._clock = limit, clock
        self._workers = [self._start() for _ in range(count)]

    @property
    def pids(self) -> list[int]:
        """Numbers of the processes."""
        return [worker.process.pid for worker in self._workers]

    @property
    def is_busy(self) -> bool:
        """Whether no process can take a job."""
        return all(worker.busy_with is not None for worker in self._workers)

    def is_open(self, vehicle: str) -> bool:
        """Return whether a process has the vehicle open."""
        return any(vehicle in worker.vehicles for worker in self._workers)

    def open(self, opening: Opening) -> None:
        """Give a vehicle to the process with the fewest."""
        self.close_vehicle(opening.vehicle)
        worker = min(self._workers, key=lambda worker: len(worker.vehicles))
        worker.vehicles.add(opening.vehicle)
        self._send(worker, ("open", opening))

    def close_vehicle(self, vehicle: str) -> None:
        """Take a vehicle from its process."""
        for worker in self._workers:
            if vehicle in worker.vehicles:
                worker.vehicles.discard(vehicle)
                self._send(worker, ("close", vehicle))

    def is_free(self, vehicle: str) -> bool:
        """Return whether the process of a vehicle can take a job."""
        return any(vehicle in worker.vehicles and worker.busy_with is None for worker in self._workers)

    def submit(self, vehicle: str, frames: Sequence[bytes], *, learn: str = "") -> None:
        """Start a job.

        Parameters
        ----------
        vehicle
            Name of the vehicle, which a process has.
        frames
            Frames in order; none, to get the state.
        learn
            Reason to learn a new baseline from these frames on; empty: the baseline stays.
        """
        worker = next(worker for worker in self._workers if vehicle in worker.vehicles)
        worker.busy_with, worker.since = vehicle, self._clock()
        self._send(worker, ("work", vehicle, list(frames), learn, self.skips_modes))

    def outcomes(self, *, timeout: float = 0.0) -> list[Outcome]:
        """Return the available outcomes, waiting up to a time [s] for the first."""
        outcomes = []
        ready = wait([worker.connection for worker in self._workers], timeout=timeout)
        for worker in list(self._workers):
            if worker.connection in ready:
                outcomes.append(self._receive(worker))
            elif worker.busy_with is not None and self._clock() - worker.since > self._limit:
                outcomes.append(self._replace(worker, f"its analysis took longer than {self._limit:g} s"))
        return [outcome for outcome in outcomes if outcome is not None]

    def close(self) -> None:
        """Stop all processes."""
        for worker in self._workers:
            self._send(worker, None)
        for worker in self._workers:
            worker.process.join(2.0)
            if worker.process.is_alive():
                worker.process.kill()
                worker.process.join()

    def _receive(self, worker: _Worker) -> Outcome | None:
        """Return the outcome that a process sent; replace the process if it is dead."""
        try:
            outcome: Outcome = worker.connection.recv()
        except (EOFError, OSError):
            return self._replace(worker, "the process of its analysis died")
        worker.busy_with = None
        return outcome

    def _replace(self, worker: _Worker, reason: str) -> Outcome | None:
        """Replace a process, and return a failed outcome of its job, if it had one."""
        worker.process.kill()
        worker.process.join()
        worker.connection.close()
        vehicle = worker.busy_with
        self._workers[self._workers.index(worker)] = self._start()
        return None if vehicle is None else Outcome(vehicle, 0, (), None, VehicleStatus(), reason)

    def _start(self) -> _Worker:
        """Start a process."""
        here, there = self._context.Pipe()
        process = self._context.Process(target=_work, args=(there,), daemon=True)
        process.start()
        there.close()
        return _Worker(process, here, set())

    def _send(self, worker: _Worker, message: object) -> None:
        """Send to a process; one that is dead shows when outcomes are next collected."""
        try:
            worker.connection.send(message)
        except (BrokenPipeError, OSError):
            return


def _work(connection: Connection) -> None:
    """Monitor vehicles, in a process of its own, until None is received."""
    monitors: dict[str, tuple[VehicleMonitor, dict[str, str]]] = {}
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
                monitors[opening.vehicle] = open_monitor(opening)
            except SprungError as error:
                refused[opening.vehicle] = str(error)
        elif message[0] == "close":
            monitors.pop(message[1], None)
        else:
            _, vehicle, frames, learn, skips_modes = message
            opened, refusal = monitors.get(vehicle), refused.get(vehicle, "")
            outcome = analyse(vehicle, opened, frames, learn=learn, refusal=refusal, skips_modes=skips_modes)
            try:
                connection.send(outcome)
            except OSError:
                return  # the monitor is gone; its successor continues from the store


def open_monitor(opening: Opening) -> tuple[VehicleMonitor, dict[str, str]]:
    """Return the monitor of a vehicle, and the quantities of its channels.

    Raises
    ------
    SprungError
        If description or state cannot be used.
    """
    vehicle = vehicle_from_text(opening.description, source=f"the vehicle file of {opening.vehicle}")
    if opening.state is None:
        fresh = VehicleMonitor(vehicle, settings=opening.settings, type_baseline=opening.type_baseline)
        return fresh, dict(opening.quantities)
    state = _cbor().loads(opening.state)
    monitor = VehicleMonitor.from_state(vehicle, state, type_baseline=opening.type_baseline)
    return monitor, dict(opening.quantities)


def analyse(
    vehicle: str,
    opened: tuple[VehicleMonitor, dict[str, str]] | None,
    frames: Sequence[bytes],
    *,
    learn: str = "",
    refusal: str = "",
    skips_modes: bool = False,
) -> Outcome:
    """Return the outcome of a job.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    opened
        Monitor of the vehicle and quantities of its channels, from `open_monitor`; None if it could not be opened.
    frames
        Frames in order.
    learn
        As for `Workers.submit`.
    refusal
        Reason why the vehicle could not be opened.
    skips_modes
        Whether to leave out the identifications of modes within windows.
    """
    if opened is None:
        return Outcome(vehicle, 0, (), None, VehicleStatus(note=refusal), refusal or "the vehicle is not open")
    monitor, quantities = opened
    events: list[Event] = []
    consumed, is_changed = 0, bool(learn) or not frames
    before = monitor.n_thinned
    try:
        if learn:
            monitor.learn_again(learn)
        for payload in frames:
            events += monitor.update(frame_block(decode(payload), quantities), skips_modes=skips_modes)
            consumed += 1
            is_changed = is_changed or monitor.repeated > 0  # nothing else would ever remove these frames
            if any(isinstance(event, Observed) for event in events):
                is_changed = True
                break
    except Exception as error:  # an error in one vehicle must not stop the others
        reason = str(error) if isinstance(error, SprungError) else f"{type(error).__name__}: {error}"
        return Outcome(vehicle, consumed, (), None, VehicleStatus(), reason)
    status = VehicleStatus(
        monitor.buffered,
        *monitor.learning,
        monitor.note,
        monitor.is_learning,
        monitor.settings.window,
        monitor.until,
        monitor.repeated,
    )
    state = _cbor().dumps(monitor.state()) if is_changed else None
    return Outcome(vehicle, consumed, tuple(events), state, status, n_thinned=monitor.n_thinned - before)


def _cbor() -> Any:
    """Return the package that encodes states."""
    return required("cbor2", purpose="the state of a vehicle", extra="online")
