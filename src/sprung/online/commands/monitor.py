"""The command `sprung monitor`."""

import logging
import os
import socket
import time
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.logs import LogFormat, log_to
from sprung.cli.options import option
from sprung.cli.output import show
from sprung.cli.stopping import stop_on_signals

if TYPE_CHECKING:
    from threading import Event

    from sprung.link import Address
    from sprung.online.monitor import Site
    from sprung.online.store import Store

LOG = logging.getLogger("sprung.monitor")

#: Longest time from a signal to the end [s].
_GRACE = 10.0


def monitor(
    *,
    site: Annotated[Path | None, option("SITE.toml", "Site file with the settings.")] = None,
    broker: Annotated[
        str | None,
        option(
            "URL|embedded",
            "Broker: mqtt://HOST:PORT, mqtts://HOST:PORT?ca=F&cert=F&key=F, or embedded, for this machine only.",
            show_default="embedded",
        ),
    ] = None,
    store: Annotated[
        str | None,
        option(
            "URL",
            "Store: sqlite:///FILE or postgresql://USER@HOST/NAME.",
            show_default="sqlite:///sprung-data/sprung.sqlite",
        ),
    ] = None,
    http: Annotated[
        str | None,
        option("HOST:PORT", "Address of the pages, /metrics and /health.", show_default="127.0.0.1:8737"),
    ] = None,
    test_senders: Annotated[
        bool,
        typer.Option("--test-senders", help="Send a test message through each sender, and report the results."),
    ] = False,
    log_format: LogFormat = "text",
) -> None:
    """Monitor vehicles until stopped: receive frames by MQTT, and keep modes, diagnoses and alerts in a store.

    Without options it runs a broker for this machine on port 1883, and keeps results in ./sprung-data. SIGTERM stops it
    within 10 s, cleanly unless its store does not answer.

    With --test-senders it monitors nothing, and exits with status 1 if a message was not sent.
    """
    from sprung.online.monitor import Site, read_site
    from sprung.online.monitor.broker import open_broker
    from sprung.online.store import ReservationLostError, open_store

    log_to(log_format)
    os.umask(0o077)  # files for this user alone
    given = {"broker": broker, "store": store, "http": http}
    settings = (Site() if site is None else read_site(site)).model_copy(
        update={name: value for name, value in given.items() if value is not None}
    )
    if test_senders:
        _test_senders(settings)
        return
    with open_store(settings.store) as opened, open_broker(settings.broker) as address:
        stopping = stop_on_signals(within=_GRACE)
        while not stopping.is_set():
            try:
                _monitor(settings, opened, address, stopping)
            except ReservationLostError as error:
                LOG.error(str(error))


def _monitor(settings: "Site", store: "Store", address: "Address", stopping: "Event") -> None:
    """Monitor until stopped, or until the store is no longer reserved for this monitor."""
    from sprung.link import Link
    from sprung.online.monitor import Station, Workers
    from sprung.online.monitor.guidance import start_in_words
    from sprung.online.site import Context, Server

    watch = settings.watch
    workers = Workers(
        watch.workers,
        limit=watch.seconds_per_job,
        clock=time.monotonic,
        vehicle_bytes=1e6 * watch.megabytes_per_vehicle,
        job_bytes=1e6 * watch.megabytes_per_job,
    )
    connect = partial(Link, address, f"sprung-monitor-{socket.gethostname()}-{os.getpid()}")
    station = Station(settings, store, connect=connect, workers=workers)
    server = Server(Context(store, settings, figures=station.figures, troubles=station.troubles))
    try:
        server.open()
        station.open()
        has_accounts = store.accounts.n_accounts() > 0
        for sentence in start_in_words(
            settings, address, http=server.address, n_vehicles=station.n_vehicles, has_accounts=has_accounts
        ):
            LOG.info(sentence)
        station.run(stopping.is_set)
    finally:
        server.close()
        station.close()


def _test_senders(site: "Site") -> None:
    """Send test messages, and print the outcome of each."""
    from sprung.online.monitor.postman import try_senders

    outcomes = try_senders(site.send, now=time.time_ns())
    show([f"{name}: {f'failed: {reason}' if reason else 'sent'}" for name, reason in outcomes.items()])
    if any(outcomes.values()):
        raise typer.Exit(1)
