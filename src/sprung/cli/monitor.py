"""The command `sprung monitor`."""

import os
import signal
import threading
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.logs import LogFormat, log_to

if TYPE_CHECKING:
    from sprung.link import Address
    from sprung.monitor import EmbeddedBroker

Broker = Annotated[
    str | None,
    typer.Option(
        metavar="URL|embedded",
        help="Broker: mqtt://HOST:PORT, mqtts://HOST:PORT?ca=F&cert=F&key=F, or embedded: one for this machine only.",
        show_default="embedded",
    ),
]
StoreUrl = Annotated[
    str | None,
    typer.Option(
        metavar="URL",
        help="Store: sqlite:///FILE or postgresql://USER@HOST/NAME.",
        show_default="sqlite:///sprung-data/sprung.sqlite",
    ),
]


def monitor(
    *,
    site: Annotated[
        Path | None, typer.Option(metavar="SITE.toml", help="Site file with the settings.", show_default=False)
    ] = None,
    broker: Broker = None,
    store: StoreUrl = None,
    http: Annotated[
        str | None,
        typer.Option(metavar="HOST:PORT", help="Address of /metrics and /health.", show_default="127.0.0.1:8737"),
    ] = None,
    log_format: LogFormat = "text",
) -> None:
    """Monitor vehicles until stopped: frames come by MQTT; modes, diagnoses and alerts go into a store.

    Without options it runs a broker for this machine at port 1883, and keeps results in ./sprung-data.
    """
    from sprung.link import Link
    from sprung.monitor import Site, Station, Workers, read_site
    from sprung.storage import open_store

    log_to(log_format)
    given = {"broker": broker, "store": store, "http": http}
    settings = (Site() if site is None else read_site(site)).model_copy(
        update={name: value for name, value in given.items() if value is not None}
    )
    with open_store(settings.store) as opened:
        url, embedded = connected(settings.broker)
        workers = Workers(settings.watch.workers, limit=settings.watch.seconds_per_job, clock=time.monotonic)
        station = Station(
            settings, opened, connect=partial(Link, url, f"sprung-monitor-{os.getpid()}"), workers=workers
        )
        stopping = threading.Event()
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: stopping.set())
        try:
            station.open()
            station.run(stopping.is_set)
        finally:
            station.close()
            if embedded is not None:
                embedded.close()


def connected(broker: str) -> "tuple[Address, EmbeddedBroker | None]":
    """Return the address of a broker, and the broker itself where it is embedded ("embedded" or "embedded:PORT")."""
    from sprung.link import Address
    from sprung.monitor import EmbeddedBroker, embedded_port

    port = embedded_port(broker)
    if port is None:
        return Address.parse(broker), None
    embedded = EmbeddedBroker(port=port)
    embedded.open()
    return Address("127.0.0.1", port, version="3"), embedded
