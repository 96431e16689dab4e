"""The commands `sprung monitor` and `sprung demo`."""

import logging
import os
import socket
import time
from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung._display import counted
from sprung.cli.options import option
from sprung.cli.output import LogFormat, console, log_to, show, stop_on_signals

if TYPE_CHECKING:
    from threading import Event

    from rich.table import Table

    from sprung.link import Address
    from sprung.online.demo import CarState
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
    """Monitor vehicles until stopped. Receives frames by MQTT, and keeps modes, diagnoses and alerts in a store.

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
    server = Server(Context(store, settings, figures=station.figures, problems=station.problems, advice=station.advice))
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


def start_in_words(
    site: "Site", broker: "Address", *, http: tuple[str, int], n_vehicles: int, has_accounts: bool = False
) -> list[str]:
    """Return sentences about a monitor that has just started.

    Parameters
    ----------
    site
        Settings of the monitor.
    broker
        Address of its broker.
    http
        Host and port of its pages.
    n_vehicles
        Number of vehicles in the store.
    has_accounts
        Whether people log in.
    """
    from sprung.online.monitor import Site, embedded_port
    from sprung.online.store import check_address

    is_embedded = embedded_port(site.broker) is not None
    store = check_address(site.store).render_as_string(hide_password=True).replace("+psycopg", "")
    scheme = "http" if site.web.certificate is None else "https"
    page = f"{scheme}://{f'[{http[0]}]' if ':' in http[0] else http[0]}:{http[1]}"
    log_in = (
        "" if has_accounts else "; no log-in is needed on this machine until there is an account (sprung accounts add)"
    )
    where = f" --store {store}" if site.store != Site().store else ""
    return [
        f"boxes reach this monitor at {broker}{' (embedded, for programs of this user only)' if is_embedded else ''}",
        f"pages: {page}/{log_in}",
        f"interface: {page}/api, health: {page}/health, figures for Prometheus: {page}/metrics",
        f"store: {store}; {_samples(site)}",
        _recipients(site),
        f"next: sprung vehicles{where} shows the progress of {n_vehicles} known vehicle{'s'[: n_vehicles != 1]}"
        if n_vehicles
        else "next: connect a box (sprung box --help), or replay a recording: sprung replay FILE --vehicle-id ID "
        f"--vehicle V.toml --broker {broker}; then sprung vehicles{where} shows the progress",
    ]


def _samples(site: "Site") -> str:
    """Return where samples are kept, and how long."""
    if site.archive is None:
        return "samples are not kept"
    return f"samples of the last {site.keep.raw_days:g} days in {site.archive}"


def _recipients(site: "Site") -> str:
    """Return who is notified of alerts."""
    mails = [address for mail in site.send.mail for address in mail.recipients]
    numbers = (("webhook", len(site.send.webhook)), ("apprise service", len(site.send.apprise)))
    if not mails and not any(number for _, number in numbers):
        return "alerts go to this log and to MQTT only: add [[send.mail]] or [[send.webhook]] to the site file"
    parts = [f"mail to {', '.join(mails)}"] if mails else []
    parts += [counted(number, name) for name, number in numbers if number]
    return f"alerts go to this log, to MQTT, and by {' and '.join(parts)}: test it with sprung monitor --test-senders"


def _test_senders(site: "Site") -> None:
    """Send test messages, and print the outcome of each."""
    from sprung.online.monitor.notifier import try_senders

    outcomes = try_senders(site.send, now=time.time_ns())
    show([f"{name}: {f'failed: {reason}' if reason else 'sent'}" for name, reason in outcomes.items()])
    if any(outcomes.values()):
        raise typer.Exit(1)


def demo(
    *,
    pace: Annotated[float, option("X", "Speed, as a multiple of real time.", min=1, max=120)] = 60.0,
    minutes: Annotated[float, option("M", "Longest time to find both faults, in minutes.", min=0.1)] = 5.0,
    once: Annotated[
        bool, typer.Option("--once", help="End after the findings, as without a terminal; default: serve until Ctrl-C.")
    ] = False,
) -> None:
    """Monitor a small simulated fleet on web pages. A spring softens, a sensor dies, and both raise alerts.

    Three cars send frames by MQTT to a monitor in this terminal, which learns baselines from their first 40 minutes.

    Then one loses a quarter of its front-left spring stiffness, and a sensor of another dies.
    """
    from rich.live import Live

    from sprung.online.demo import open_demo

    logging.getLogger("sprung").addHandler(logging.NullHandler())
    screen = console()
    is_kept = screen.is_terminal and not once
    stopping = stop_on_signals(within=_GRACE)
    with open_demo(pace=pace) as demonstration:
        screen.print(f"pages of this monitor: {demonstration.page}", style="bold", soft_wrap=True)
        with Live(console=screen, auto_refresh=False, transient=not screen.is_terminal) as live:

            def report(seconds: float, cars: "Sequence[CarState]") -> None:
                if screen.is_terminal:
                    live.update(_grid(seconds, cars), refresh=True)

            sentences = demonstration.find_faults(60 * minutes, is_stopped=stopping.is_set, on_progress=report)
        show(sentences or ["stopped before both faults were found"])
        if not sentences:
            raise typer.Exit(130)
        if is_kept:
            words = f"the fleet keeps driving, see {demonstration.page}; Ctrl-C ends it"
            screen.print(words, style="bold", soft_wrap=True)
            demonstration.run(stopping.is_set)


def _grid(seconds: float, cars: "Sequence[CarState]") -> "Table":
    """Return a table of the fleet."""
    from rich.progress_bar import ProgressBar
    from rich.table import Table

    table = Table(title=f"{seconds:.0f} s: {len(cars)} cars", title_justify="left", expand=False)
    for heading in ("vehicle", "window", "baseline windows", "state"):
        table.add_column(heading)
    for car in cars:
        progress = ProgressBar(100, 100 * car.status.share, width=20)
        table.add_row(car.name, progress, f"{car.status.n_learnt} of {car.status.n_needed}", car.state)
    return table
