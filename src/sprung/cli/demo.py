"""The command `sprung demo`."""

import logging
import multiprocessing
import socket
import tempfile
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.printing import console, notes
from sprung.errors import DataError

if TYPE_CHECKING:
    from rich.table import Table

    from sprung.alerting import Alert
    from sprung.box.fleet import Member
    from sprung.monitor import Station
    from sprung.storage import Store

_LEARNING, _AFTER = 4, 5


def demo(
    *,
    pace: Annotated[float, typer.Option(metavar="X", help="Speed, times real time.", min=1, max=120)] = 60.0,
    minutes: Annotated[float, typer.Option(metavar="M", help="Longest run in minutes.", min=0.1)] = 5.0,
) -> None:
    """Monitor a small simulated fleet over the real link: a spring softens, a sensor dies, and both raise alerts.

    Three cars drive at sixty times real time and send frames by MQTT to a monitor in this terminal, which learns
    baselines from their first four windows of ten minutes. Then one car loses a quarter of its front-left spring
    stiffness, and a sensor of another dies.
    """
    from rich.live import Live

    from sprung.box.fleet import Member, drive_fleet
    from sprung.link import Address, Link
    from sprung.monitor import EmbeddedBroker, Site, Station, Workers
    from sprung.storage import open_store
    from sprung.vehicles import read_vehicle

    fleet = [
        Member("car-1", 1),
        Member("car-2", 2, fault="front_left.spring=-0.25", after=_AFTER),
        Member("car-3", 3, dead_channel="acc_rr", after=_AFTER),
    ]
    screen = console()
    logging.getLogger("sprung").addHandler(logging.NullHandler())
    with tempfile.TemporaryDirectory(prefix="sprung-demo-") as scratch:
        folder = Path(scratch)
        port = _free_port()
        broker = EmbeddedBroker(port=port)
        broker.open()
        address = Address("127.0.0.1", port, version="3")
        site = Site.model_validate(
            {
                "store": f"sqlite:///{folder}/sprung.sqlite",
                "http": "127.0.0.1:0",
                "watch": {"learning_windows": _LEARNING, "identify_every_minutes": 5.0},
                "keep": {"raw_days": 0.0},
            }
        )
        store = open_store(site.store)
        workers = Workers(2, limit=60.0, clock=time.monotonic)
        station = Station(site, store, connect=partial(Link, address, "sprung-demo"), workers=workers)
        driving = multiprocessing.get_context("spawn").Process(
            target=drive_fleet,
            args=(address, read_vehicle("zafira"), fleet),
            kwargs={"folder": folder / "boxes", "pace": pace},
            daemon=True,
        )
        begun = time.monotonic()
        try:
            station.open(timeout=10.0)
            driving.start()
            with Live(console=screen, auto_refresh=False, transient=not screen.is_terminal) as live:
                show = live.update if screen.is_terminal else None
                seen = _watch(station, store, fleet, show=show, begun=begun, limit=60 * minutes)
        finally:
            driving.kill()
            station.close()
            store.close()
            broker.close()
    took = time.monotonic() - begun
    if seen is None:
        raise DataError(f"no alerts of the spring and the sensor within {minutes:g} min: try a lower --pace")
    spring, sensor = seen
    screen.print(
        notes(
            [
                f"after {took:.0f} s: {spring.vehicle}: {spring.text}",
                f"true: {fleet[1].fault} from {_AFTER * 10} min on",
                f"{sensor.vehicle}: {sensor.text}; no alert of its suspension",
                "car-1 is healthy: no alert",
            ]
        )
    )


def _watch(
    station: "Station", store: "Store", fleet: "list[Member]", *, show: "object", begun: float, limit: float
) -> "tuple[Alert, Alert] | None":
    """Run the monitor until both alerts have been active for another window; None where that takes too long."""
    from sprung.monitor import alert_of

    shown = complete_at = 0.0
    while (now := time.monotonic()) - begun < limit:
        station.step()
        if now - shown < 0.25:
            continue
        shown = now
        alerts = {(row.vehicle, row.cause): alert_of(row) for row in store.alerts.find(is_active=True)}
        if callable(show):
            show(_table(station, fleet, list(alerts.values()), now - begun), refresh=True)
        spring = alerts.get((fleet[1].name, "front_left.spring"))
        sensor = alerts.get((fleet[2].name, f"sensor:{fleet[2].dead_channel}"))
        if spring is not None and sensor is not None:
            complete_at = complete_at or now
            others = alerts.keys() - {(spring.vehicle, spring.cause), (sensor.vehicle, sensor.cause)}
            if others:
                raise DataError(f"unexpected alert: {' '.join(sorted(others)[0])}")
            if now - complete_at > 10.0:
                return spring, sensor
    return None


def _table(station: "Station", fleet: "list[Member]", alerts: "list[Alert]", seconds: float) -> "Table":
    """Return a table of the fleet."""
    from rich.progress_bar import ProgressBar
    from rich.table import Table

    from sprung.monitor import VehicleStatus

    table = Table(title=f"{seconds:.0f} s: {len(fleet)} cars", title_justify="left", expand=False)
    for heading in ("vehicle", "window", "baseline", "state"):
        table.add_column(heading)
    by_vehicle = {name: [alert for alert in alerts if alert.vehicle == name] for name in (one.name for one in fleet)}
    for name, own in by_vehicle.items():
        status = station.statuses.get(name, VehicleStatus())
        state = "; ".join(alert.text for alert in own) or status.note
        if not state:
            state = "no change detected" if 0 < status.n_needed == status.n_learnt else "learning"
        learnt = f"{status.n_learnt} of {status.n_needed}"
        table.add_row(name, ProgressBar(100, 100 * status.share, width=20), learnt, state)
    return table


def _free_port() -> int:
    """Return a free port."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        return int(probe.getsockname()[1])
