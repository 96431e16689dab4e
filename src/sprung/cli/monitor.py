"""The command `sprung monitor`."""

import os
import signal
import threading
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.logs import log_to

if TYPE_CHECKING:
    from sprung.link import Address
    from sprung.monitor import EmbeddedBroker

Broker = Annotated[
    str | None,
    typer.Option(
        metavar="URL|embedded",
        help="mqtt://HOST:PORT, mqtts://HOST:PORT?ca=F&cert=F&key=F, or embedded: one for this machine.",
        show_default=False,
    ),
]
StoreUrl = Annotated[
    str | None,
    typer.Option(metavar="URL", help="sqlite:///FILE or postgresql://USER@HOST/NAME.", show_default=False),
]


def monitor(
    *,
    site: Annotated[Path | None, typer.Option(metavar="SITE.toml", help="Settings.", show_default=False)] = None,
    broker: Broker = None,
    store: StoreUrl = None,
    http: Annotated[
        str | None, typer.Option(metavar="HOST:PORT", help="For /metrics and /health.", show_default=False)
    ] = None,
    log_format: Annotated[str, typer.Option("--log", metavar="text|json", help="Form of the log.")] = "text",
) -> None:
    """Watch vehicles until stopped: frames in by MQTT, modes, diagnoses and alerts into a store.

    Without any option: a broker for this machine at port 1883, and results in ./sprung-data.
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
    """Return the address of a broker, begun here where it is embedded ("embedded" or "embedded:PORT")."""
    from sprung.link import Address
    from sprung.monitor import EmbeddedBroker, embedded_port

    port = embedded_port(broker)
    if port is None:
        return Address.parse(broker), None
    begun = EmbeddedBroker(port=port)
    begun.open()
    return Address("127.0.0.1", port, version="3"), begun
