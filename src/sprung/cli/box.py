"""The command `sprung box`."""

import logging
import signal
import threading
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.files import SamplingRate, VehicleFile, names
from sprung.cli.logs import LogFormat, log_to
from sprung.cli.replay import BrokerUrl, VehicleId

if TYPE_CHECKING:
    from sprung.box import Box
    from sprung.box.onboard import OnBoard
    from sprung.vehicles import Vehicle

LOG = logging.getLogger("sprung.box")


def box(
    files: Annotated[
        list[Path] | None, typer.Argument(metavar="FILE", help="Recordings to replay.", show_default=False)
    ] = None,
    *,
    vehicle_id: VehicleId,
    vehicle: VehicleFile,
    broker: BrokerUrl = "mqtt://127.0.0.1:1883",
    source: Annotated[
        str,
        typer.Option(
            metavar="SOURCE",
            help="Source of samples: files, folder:DIR, stdin, can:INTERFACE:CHANNEL:DATABASE.dbc, mqtt:URL#TOPIC or "
            "simulator.",
        ),
    ] = "files",
    spool: Annotated[Path, typer.Option(metavar="DIR", help="Folder of frames that are not acknowledged.")] = Path(
        "sprung-spool"
    ),
    spool_megabytes: Annotated[
        float, typer.Option(metavar="MB", help="Largest size of the spool; the oldest frames are dropped first.")
    ] = 256.0,
    channels: Annotated[
        str | None, typer.Option(metavar="A,B,..", help="Channels or signals to send.", show_default=False)
    ] = None,
    sampling_rate: SamplingRate = None,
    pace: Annotated[
        float | None,
        typer.Option(metavar="X", help="Speed of a replay of files, times real time.", show_default="no limit"),
    ] = None,
    on_board: Annotated[
        bool,
        typer.Option(
            "--on-board",
            help="Identify on the vehicle: send correlations and modes, and keep samples until they are requested.",
        ),
    ] = False,
    ring_megabytes: Annotated[
        float, typer.Option(metavar="MB", help="Largest size of the samples kept with --on-board.")
    ] = 1024.0,
    log_format: LogFormat = "text",
) -> None:
    """Send a vehicle's samples to a monitor, from a source through a spool on disk.

    Runs until the source ends and everything is acknowledged, or until it is stopped. Started again, it continues where
    it was.
    """
    from sprung.box import Box, BoxSettings, Listener, SourceSettings, open_source
    from sprung.link import Address, Spool
    from sprung.vehicles import read_vehicle, vehicle_text
    from sprung.vehicles.sensor_layout import quantities_of

    log_to(log_format)
    description = read_vehicle(vehicle)
    stopping = _stop_on_signals()
    kept = Spool(spool, most_bytes=round(1e6 * spool_megabytes), boot_from=time.time_ns() // 10**6)
    running = Box(
        BoxSettings(vehicle_id, vehicle_text(description)),
        kept,
        Address.parse(broker),
        quantities=lambda block: quantities_of(block, description.sensor),
        on_board=_on_board(description, spool / "ring", ring_megabytes) if on_board else None,
    )
    settings = SourceSettings(
        vehicle=description,
        folder=spool,
        files=files or [],
        channels=names(channels),
        sampling_rate=sampling_rate,
        pace=pace,
        resume=running.resume_time(),
    )
    blocks = open_source(source, settings, Listener(stopping, LOG.warning, lambda name: LOG.info(f"read {name}")))
    taken = 0.0
    try:
        running.open()
        threading.Thread(target=_step, args=(running, stopping), daemon=True).start()
        for block in blocks:
            if stopping.is_set():
                break
            running.take(block)
            taken += block.duration
        while not stopping.is_set() and not running.drain(timeout=1.0):
            pass
        if not stopping.is_set():
            run = f"{kept.next_seq} frames, {taken / 3600:.2f} hours in this run"
            LOG.info(f"source finished; all frames of {vehicle_id} acknowledged: {run}")
    finally:
        stopping.set()
        running.close()


def _stop_on_signals() -> threading.Event:
    """Return an event that SIGINT and SIGTERM set."""
    stopping = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        # In a thread: the signal may come while this one holds the lock of the event, and would wait for itself.
        signal.signal(number, lambda *_: threading.Thread(target=stopping.set).start())
    return stopping


def _on_board(vehicle: "Vehicle", folder: Path, megabytes: float) -> "OnBoard":
    """Return identification on the vehicle, with a ring of samples in a folder."""
    from sprung.box.onboard import Answers, OnBoard
    from sprung.link import Spool

    ring = Spool(folder, most_bytes=round(1e6 * megabytes))
    return OnBoard(vehicle, ring, answers=Answers(folder / "answers.json"))


def _step(box: "Box", stopping: threading.Event) -> None:
    """Send while samples come in, and log each new problem."""
    problem = ""
    while not stopping.wait(0.05):
        box.step()
        if box.problem != problem:
            problem = box.problem
            if problem:
                LOG.warning(problem)
            else:
                LOG.info("connection restored")
