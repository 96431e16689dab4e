"""Stores that are filled from inside, and clients of their pages: the only imports that know where things stand."""

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from starlette.testclient import TestClient
from tests.conftest import until
from tests.golden.commands import NOW
from tests.golden.freezing import DIGITS
from tests.golden.recordings import disturbed
from tests.journeys import depot
from tests.journeys.conftest import FIGURES
from tests.online.monitor import history_store
from tests.online.monitor.conftest import Bench, frames
from tests.online.site.conftest import PASSWORD
from tests.online.site.conftest import fill as fill_three
from tests.online.site.test_pages import put_hostile_texts

from sprung.online.monitor import Site, operations
from sprung.online.site import Context, add_account, add_token, application
from sprung.online.store import Store, open_store
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import parse_fault, read_vehicle

#: Minutes of a window of the monitor that is fed with drives, and samples per second of these.
_WINDOW, _RATE = 10, 100.0


def _nothing(store: Store, folder: Path) -> dict[str, Any]:
    """Leave the store of a new monitor as it is."""
    return {}


def _three(store: Store, folder: Path) -> dict[str, Any]:
    """Three vehicles, people, tokens and their acts."""
    fill_three(store)
    for name, role in (("anna", "viewer"), ("eve", "engineer"), ("ada", "admin")):
        add_account(store, name, role, PASSWORD, who="test", now=NOW)
    add_token(store, "dashboard", "viewer", days=30, who="ada", now=NOW)
    operations.acknowledge(store, 1, who="eve", comment="seen", now=NOW)
    operations.relearn(store, "bus-3", reason="new dampers", who="eve", now=NOW)
    return {"name": "Depot South"}


def _hostile(store: Store, folder: Path) -> dict[str, Any]:
    """Texts of vehicles and people that want to be markup."""
    fill_three(store)
    return put_hostile_texts(store)


def _history(store: Store, folder: Path) -> dict[str, Any]:
    """Two months of a vehicle."""
    history_store.fill(store)
    return {}


def _depot(store: Store, folder: Path) -> dict[str, Any]:
    """Many vehicles with alerts of all kinds."""
    depot.fill(store, now=NOW)
    return {"name": "Depot North"}


def _station(store: Store, folder: Path) -> dict[str, Any]:
    """What a monitor finds in the frames of three drives: two teach, the third has a soft spring."""
    store.close()
    car = read_vehicle("zafira")
    runs = []
    for number, fault in enumerate((None, None, "front_left.spring=-0.3")):
        faults = () if fault is None else (parse_fault(fault),)
        run = simulate_drive(car, RoadDrive(snr=50.0, faults=faults, sampling_rate=_RATE), seed=number).recording
        runs.append(disturbed(replace(run, start=NOW + number * 600 * 10**9, history=())))
    watch = {"learning_windows": 2, "window_minutes": _WINDOW, "identify_every_minutes": 5}
    bench = Bench(folder, car, runs[0], watch=watch)
    bench.describe()
    bench.send([payload for k, run in enumerate(runs) for payload in frames(run, first=600 * k)])
    until(lambda: not bench.store.alerts.n_open(), timeout=60, what="delivery of the alert")  # by a thread of its own
    bench.close()
    return {"watch": watch}


@dataclass(frozen=True)
class _Kind:
    """How a store is filled, which of it is looked at, its present time, whether it holds documents, stable digits."""

    fill: Callable[[Store, Path], dict[str, Any]]
    vehicles: tuple[str, ...] = ()
    alerts: int = 0
    now: int = NOW
    is_real: bool = True
    digits: int = DIGITS


_SOME = (depot.SOFT, depot.DEAD, depot.SILENT, depot.LEARNING)
STORES = {
    "empty": _Kind(_nothing),
    "three": _Kind(_three, ("bus-1", "bus-2", "bus-3"), 2, is_real=False),
    "hostile": _Kind(_hostile, ("bus-1", "bus-3"), 4, is_real=False),
    "history": _Kind(_history, (history_store.VEHICLE,), 2),
    "depot": _Kind(_depot, _SOME, 5),
    "station": _Kind(_station, ("car-1",), 1, now=NOW + 1800 * 10**9, digits=4),
}


@dataclass(frozen=True)
class Opened:
    """A filled store: its folder, which of it is looked at, its present time, whether it holds documents, its pages."""

    folder: Path
    vehicles: tuple[str, ...]
    alerts: tuple[int, ...]
    windows: Mapping[str, tuple[int, int]]
    now: int
    is_real: bool
    digits: int
    client: TestClient


@contextmanager
def opened(name: str, folder: Path) -> Iterator[Opened]:
    """Yield a filled store."""
    kind, url = STORES[name], f"sqlite:///{folder}/store.sqlite"
    store = open_store(url)
    fields = kind.fill(store, folder)
    store.close()
    with open_store(url) as store:
        _, secret = add_token(store, "golden", "admin", days=None, who="test", now=NOW)
        site = Site.model_validate(fields)
        context = Context(store, site, figures=lambda: FIGURES, problems=list, clock=lambda: kind.now)
        last = {vehicle: store.results.observations(vehicle, limit=1) for vehicle in kind.vehicles}
        windows = {vehicle: (rows[0].boot, rows[0].number) for vehicle, rows in last.items() if rows}
        numbers = sorted(row.number for row in store.alerts.find(is_active=True) if row.vehicle in kind.vehicles)
        headers = {"Authorization": f"Bearer {secret}"}
        with TestClient(application(context), base_url="http://127.0.0.1:8737", headers=headers) as client:
            yield Opened(
                folder,
                kind.vehicles,
                tuple(numbers[: kind.alerts]),
                windows,
                kind.now,
                kind.is_real,
                kind.digits,
                client,
            )
