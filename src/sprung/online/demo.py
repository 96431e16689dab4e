"""The demonstration: a small simulated fleet, its monitor and the pages."""

import multiprocessing
import signal
import socket
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

import numpy as np

from sprung.errors import DataError, ParameterError
from sprung.link import Address, Link, Spool
from sprung.online.box import blocks_of
from sprung.online.box.running import box_of
from sprung.online.monitor import Site, Station, VehicleStatus, Workers
from sprung.online.monitor.broker import open_broker
from sprung.online.monitor.histories import vehicle_state
from sprung.online.site import Context, Server
from sprung.online.store import Store, open_store
from sprung.recording import Recording
from sprung.simulation import RoadConditions, RoadDrive, simulate_drive
from sprung.state import AlertState
from sprung.vehicles import Vehicle, parse_fault, read_vehicle

__all__ = ["CarState", "Demonstration", "Member", "drive_fleet", "open_demo"]

#: Length of a piece of a drive, and of a block [s].
PIECE, _BLOCK = 600.0, 5.0
#: Time from the start of the drives to that of the program [ns].
_AGO = 3 * 3600 * 10**9


@dataclass(frozen=True, slots=True)
class Member:
    """A vehicle of the fleet.

    Parameters
    ----------
    name
        Name of the vehicle.
    seed
        Seed of its drives.
    fault
        Fault, such as "front_left.spring=-0.25"; empty: none.
    dead_channel
        Sensor that dies; empty: none.
    after
        Number of pieces of ten minutes before the fault.
    """

    name: str
    seed: int
    fault: str = ""
    dead_channel: str = ""
    after: int = 4


def drives(car: Vehicle, member: Member, start: int) -> Iterator[Recording]:
    """Yield the blocks of the endless drive of a member from a time (UTC ns) on; `car` is the healthy vehicle."""
    number = 0
    while True:
        is_bad = number >= member.after
        faults = (parse_fault(member.fault),) if is_bad and member.fault else ()
        settings = RoadDrive(
            duration=PIECE,
            snr=50.0,
            road=RoadConditions("BCD"[(member.seed + number) % 3]),
            faults=faults,
            n_stops=number % 2,
        )
        run = simulate_drive(car, settings, seed=[member.seed, number]).recording
        if is_bad and member.dead_channel:
            samples = np.array(run.samples)
            samples[run.index(member.dead_channel)] = 0.0
            run = replace(run, samples=samples)
        yield from blocks_of(replace(run, start=start), length=_BLOCK)
        start += round(run.duration * 1e9)
        number += 1


def drive_fleet(address: Address, car: Vehicle, members: Sequence[Member], *, folder: Path, pace: float) -> None:
    """Drive a fleet of identical cars until the process is stopped.

    The drives began three hours ago. They continue at a pace until they have reached the present, then in real time.

    Parameters
    ----------
    address
        Address of the broker.
    car
        Vehicle without a fault.
    members
        Vehicles of the fleet.
    folder
        Folder of the spools.
    pace
        Speed of the drives, as a multiple of real time.

    Examples
    --------
    >>> from pathlib import Path
    >>> from sprung.link import Address
    >>> from sprung.vehicles import parse_fault, read_vehicle
    >>> members = [Member("car-1", 1), Member("car-2", 2, fault="front_left.spring=-0.25")]
    >>> parse_fault(members[1].fault).change
    -0.25
    >>> address = Address.parse("mqtt://127.0.0.1:1883")
    >>> drive_fleet(address, read_vehicle("zafira"), members, folder=Path("boxes"), pace=100.0)  # doctest: +SKIP
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # a terminal sends it to this process, too: its parent ends it
    begun = time.time_ns() - _AGO
    boxes, sources = [], []
    for member in members:
        boxes.append(box_of(member.name, car, Spool(folder / member.name, is_synced=False), address))
        boxes[-1].open()
        sources.append(drives(car, member, begun))
    clock, driven = time.monotonic(), 0.0
    while True:
        for box, source in zip(boxes, sources, strict=True):
            box.take(next(source))
            box.step()
        driven += _BLOCK
        while (ahead := clock + waiting_time(driven, pace) - time.monotonic()) > 0:
            for box in boxes:
                box.step()
            time.sleep(min(ahead, 0.02))


def waiting_time(driven: float, pace: float) -> float:
    """Return the time [s] from the start of the program to the end of a drive.

    Parameters
    ----------
    driven
        Length of the drive [s], which began three hours before the program.
    pace
        Speed of the drive, as a multiple of real time, until it has reached the present; more than 1.
    """
    ago = _AGO / 1e9
    return max(driven / pace, driven - ago)


#: Windows of ten minutes from which baselines are learnt, and after which the faults begin.
_LEARNING, _AFTER = 4, 4
#: The fleet: a healthy car, one with a soft spring, one with a dead sensor.
HEALTHY = Member("car-1", 1)
SOFT = Member("car-2", 2, fault="front_left.spring=-0.25", after=_AFTER)
DEAD = Member("car-3", 3, dead_channel="acc_rr", after=_AFTER)
FLEET = (HEALTHY, SOFT, DEAD)
_EXPECTED = ((SOFT.name, "front_left.spring"), (DEAD.name, f"sensor:{DEAD.dead_channel}"))
#: Time between checks of the alerts, and for which both alerts must have been active at the end [s].
_LOOK, _SETTLED = 1.0, 10.0


@dataclass(frozen=True, slots=True)
class CarState:
    """State of a car at the monitor.

    Parameters
    ----------
    name
        Name of the car.
    status
        Progress of its monitoring.
    state
        How it is, in a sentence.
    """

    name: str
    status: VehicleStatus
    state: str


class Demonstration:
    """A fleet that drives, and the monitor of it with its pages.

    Parameters
    ----------
    station
        Open monitor.
    store
        Store of the monitor.
    address
        Host and port of the pages.
    """

    def __init__(self, station: Station, store: Store, *, address: tuple[str, int]) -> None:
        self._station, self._store = station, store
        self._begun = time.monotonic()
        #: Address of the pages.
        self.page = "http://{}:{}".format(*address)

    def find_faults(
        self,
        limit: float,
        *,
        is_stopped: Callable[[], bool] = lambda: False,
        on_progress: Callable[[float, Sequence[CarState]], None] = lambda seconds, cars: None,
    ) -> list[str]:
        """Monitor until both faults have raised alerts, and no other has.

        Parameters
        ----------
        limit
            Longest run [s].
        is_stopped
            Function that returns whether the run is to end before.
        on_progress
            Callback that receives the time since the start [s] and the state of each car.

        Returns
        -------
        list of str
            What the monitor found, next to what was simulated; nothing if the run was stopped.

        Raises
        ------
        DataError
            If an alert is missing at the end, or another one was raised.
        """
        complete_since: float | None = None
        for seconds in self._looks(limit, is_stopped):
            alerts = self._store.alerts.find(is_active=True)
            on_progress(seconds, [self._car(member.name) for member in FLEET])
            if _is_complete(alerts):
                complete_since = seconds if complete_since is None else complete_since
                if seconds - complete_since > _SETTLED:
                    return _sentences(alerts, complete_since)
        if is_stopped():
            return []
        raise DataError(f"no alerts of the spring and the sensor within {limit / 60:g} min: try a lower --pace")

    def run(self, is_stopped: Callable[[], bool]) -> None:
        """Monitor, and serve the pages, until `is_stopped` returns True."""
        self._station.run(is_stopped)

    def _car(self, name: str) -> CarState:
        """Return the state of a car."""
        now = time.time_ns()
        state = vehicle_state(self._store, name, now=now, last_seen=now)
        return CarState(name, self._station.statuses.get(name, VehicleStatus()), state.sentence)

    def _looks(self, limit: float, is_stopped: Callable[[], bool]) -> Iterator[float]:
        """Run the monitor, and yield the time since the start at intervals."""
        looked = 0.0
        while (now := time.monotonic()) - self._begun < limit and not is_stopped():
            self._station.step()
            if now - looked >= _LOOK:
                looked = now
                yield now - self._begun


@contextmanager
def open_demo(*, pace: float) -> Iterator[Demonstration]:
    """Yield the monitor of a fleet that drives in a process of its own.

    Parameters
    ----------
    pace
        Speed of the drives, as a multiple of real time, until they have reached the present.

    Examples
    --------
    >>> context = open_demo(pace=1000.0)
    >>> with context as demonstration:  # doctest: +SKIP
    ...     demonstration.find_faults(limit=300.0)[-1]
    'car-1: no alert (simulated: healthy)'
    """
    with tempfile.TemporaryDirectory(prefix="sprung-demo-") as scratch:
        folder = Path(scratch)
        site = Site.model_validate(
            {
                "name": "Demonstration",
                "store": f"sqlite:///{folder}/sprung.sqlite",
                "watch": {"learning_windows": _LEARNING, "identify_every_minutes": 5.0},
                "keep": {"raw_days": 2.0},
            }
        )
        with open_broker(f"embedded:{_free_port()}") as address, open_store(site.store) as store:
            workers = Workers(2, limit=60.0, clock=time.monotonic)
            station = Station(site, store, connect=partial(Link, address, "sprung-demo"), workers=workers)
            driving = multiprocessing.get_context("spawn").Process(
                target=drive_fleet,
                args=(address, read_vehicle("zafira"), FLEET),
                kwargs={"folder": folder / "boxes", "pace": pace},
                daemon=True,
            )
            server = None
            try:
                server = _open_server(site, store, station)
                station.open(timeout=10.0)
                driving.start()
                yield Demonstration(station, store, address=server.address)
            finally:
                if driving.pid is not None:
                    driving.kill()
                    driving.join()
                if server is not None:
                    server.close()
                station.close()


def _open_server(site: Site, store: Store, station: Station) -> Server:
    """Return the server of the pages, at the address of the site, or at a free port where that is taken."""
    try:
        return _serving(site, store, station)
    except ParameterError:
        return _serving(site.model_copy(update={"http": "127.0.0.1:0"}), store, station)


def _serving(site: Site, store: Store, station: Station) -> Server:
    """Return a server of the pages that answers."""
    server = Server(Context(store, site, figures=station.figures, problems=station.problems, advice=station.advice))
    server.open()
    return server


def _is_complete(alerts: Sequence[AlertState]) -> bool:
    """Whether both faults have raised alerts; then any other alert is an error."""
    causes = {(alert.vehicle, alert.cause) for alert in alerts}
    if not causes.issuperset(_EXPECTED):
        return False
    if others := sorted(causes.difference(_EXPECTED)):
        raise DataError(f"unexpected alert: {' '.join(others[0])}")
    return True


def _sentences(alerts: Sequence[AlertState], seconds: float) -> list[str]:
    """Return what was found next to what was simulated."""
    texts = {alert.vehicle: alert.text for alert in alerts}
    minutes = _AFTER * PIECE / 60
    return [
        f"both alerts raised after {seconds:.0f} s, and no other",
        f"{SOFT.name}: {texts[SOFT.name]} (simulated: {SOFT.fault} from {minutes:.0f} min on)",
        f"{DEAD.name}: {texts[DEAD.name]} (simulated: dead from {minutes:.0f} min on); no alert of its suspension",
        f"{HEALTHY.name}: no alert (simulated: healthy)",
    ]


def _free_port() -> int:
    """Return a free port."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
