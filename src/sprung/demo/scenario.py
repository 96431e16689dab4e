"""Three cars and their monitor: a spring softens, a sensor dies, and both raise alerts."""

import multiprocessing
import socket
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path

from sprung.alerting import Alert
from sprung.demo.fleet import PIECE, Member, drive_fleet
from sprung.errors import DataError
from sprung.link import Link
from sprung.monitor import Site, Station, VehicleStatus, Workers, alert_of
from sprung.monitor.broker import open_broker
from sprung.storage import Store, open_store
from sprung.vehicles import read_vehicle

#: Windows of ten minutes from which baselines are learnt, and after which the faults begin.
_LEARNING, _AFTER = 4, 5
#: The fleet: a healthy car, one with a soft spring, one with a dead sensor.
HEALTHY = Member("car-1", 1)
SOFT = Member("car-2", 2, fault="front_left.spring=-0.25", after=_AFTER)
DEAD = Member("car-3", 3, dead_channel="acc_rr", after=_AFTER)
FLEET = (HEALTHY, SOFT, DEAD)
_EXPECTED = ((SOFT.name, "front_left.spring"), (DEAD.name, f"sensor:{DEAD.dead_channel}"))
#: Time between looks at the alerts, and for which both alerts must have been active in the end [s].
_LOOK, _SETTLED = 0.25, 10.0


@dataclass(frozen=True, slots=True)
class CarState:
    """What the monitor shows of a car.

    Parameters
    ----------
    name
        Name of the car.
    status
        How far its monitoring is.
    state
        Its alerts in words; else what the monitor does or has found so far.
    """

    name: str
    status: VehicleStatus
    state: str


def run_demo(
    *,
    pace: float,
    limit: float,
    on_progress: Callable[[float, Sequence[CarState]], None] = lambda seconds, cars: None,
) -> list[str]:
    """Let the fleet drive and monitor it until both faults have raised alerts, and no other has.

    Parameters
    ----------
    pace
        Speed of the drives, times real time.
    limit
        Longest run [s].
    on_progress
        Callback that receives the time since the start [s] and the state of each car.

    Returns
    -------
    list of str
        What the monitor found, next to what was simulated.

    Raises
    ------
    DataError
        Where an alert is missing in the end, or another one was raised.
    """
    complete_since: float | None = None
    begun = time.monotonic()
    with _monitored(pace) as (station, store):
        for seconds in _looks(station, begun, limit):
            alerts = [alert_of(row) for row in store.alerts.find(is_active=True)]
            on_progress(seconds, [_state(station, member.name, alerts) for member in FLEET])
            if _is_complete(alerts):
                complete_since = seconds if complete_since is None else complete_since
                if seconds - complete_since > _SETTLED:
                    return _sentences(alerts, complete_since)
    raise DataError(f"no alerts of the spring and the sensor within {limit / 60:g} min: try a lower --pace")


@contextmanager
def _monitored(pace: float) -> Iterator[tuple[Station, Store]]:
    """Yield the monitor and its store while the fleet drives in a process of its own."""
    with tempfile.TemporaryDirectory(prefix="sprung-demo-") as scratch:
        folder = Path(scratch)
        site = Site.model_validate(
            {
                "store": f"sqlite:///{folder}/sprung.sqlite",
                "http": "127.0.0.1:0",
                "watch": {"learning_windows": _LEARNING, "identify_every_minutes": 5.0},
                "keep": {"raw_days": 0.0},
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
            try:
                station.open(timeout=10.0)
                driving.start()
                yield station, store
            finally:
                if driving.pid is not None:
                    driving.kill()
                station.close()


def _looks(station: Station, begun: float, limit: float) -> Iterator[float]:
    """Run the monitor, and yield the time since the start now and then."""
    looked = 0.0
    while (now := time.monotonic()) - begun < limit:
        station.step()
        if now - looked >= _LOOK:
            looked = now
            yield now - begun


def _state(station: Station, name: str, alerts: Sequence[Alert]) -> CarState:
    """Return what the monitor shows of a car."""
    status = station.statuses.get(name, VehicleStatus())
    state = "; ".join(alert.text for alert in alerts if alert.vehicle == name) or status.note
    if not state:
        state = "no change detected" if 0 < status.n_needed == status.n_learnt else "learning"
    return CarState(name, status, state)


def _is_complete(alerts: Sequence[Alert]) -> bool:
    """Whether both faults have raised alerts; then any other alert is an error."""
    causes = {(alert.vehicle, alert.cause) for alert in alerts}
    if not causes.issuperset(_EXPECTED):
        return False
    if others := sorted(causes.difference(_EXPECTED)):
        raise DataError(f"unexpected alert: {' '.join(others[0])}")
    return True


def _sentences(alerts: Sequence[Alert], seconds: float) -> list[str]:
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
