"""The command `sprung box`."""

import logging
import os
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.checks import may_lack_sensors, names
from sprung.cli.logs import LogFormat, log_to
from sprung.cli.options import AllowMissing, SamplingRate, VehicleFile, option
from sprung.cli.stopping import stop_on_signals
from sprung.online.commands.replay import BrokerUrl, VehicleId

if TYPE_CHECKING:
    from sprung.online.box.onboard import OnBoard
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
        option(
            "SOURCE",
            "Source of samples: files, folder:DIR, stdin, can:INTERFACE:CHANNEL:FILE.dbc, mqtt:URL#TOPIC or simulator.",
        ),
    ] = "files",
    spool: Annotated[Path, option("DIR", "Folder of frames not yet acknowledged.")] = Path("sprung-spool"),
    spool_megabytes: Annotated[
        float, option("MB", "Maximum size of the spool; the oldest frames are dropped first.")
    ] = 256.0,
    frame_seconds: Annotated[
        float, option("S", "Length of a frame, and the most that a power cut loses.", min=0, max=60)
    ] = 10.0,
    channels: Annotated[str | None, option("A,B,..", "Channels or signals to send.")] = None,
    sampling_rate: SamplingRate = None,
    allow_missing: AllowMissing = False,
    pace: Annotated[
        float | None, option("X", "Speed of a replay of files, as a multiple of real time.", show_default="no limit")
    ] = None,
    on_board: Annotated[
        bool,
        typer.Option(
            "--on-board",
            help="Identify on the vehicle: send correlations and modes, and keep samples until they are requested.",
        ),
    ] = False,
    ring_megabytes: Annotated[float, option("MB", "Maximum size of the samples kept with --on-board.")] = 1024.0,
    log_format: LogFormat = "text",
) -> None:
    """Send a vehicle's samples to a monitor, from a source through a spool on disk.

    Runs until the source ends and everything is acknowledged, or until it is stopped.

    After a restart it continues where it stopped.
    """
    from sprung.link import Address, Spool
    from sprung.online.box import Listener, SourceSettings, open_source
    from sprung.online.box.running import box_of, send_live
    from sprung.vehicles import read_vehicle

    log_to(log_format)
    os.umask(0o077)  # files for this user alone
    description = read_vehicle(vehicle)
    may_lack = may_lack_sensors(description.sensor, allow_missing=allow_missing, channels=names(channels))
    stopping = stop_on_signals()
    frames = Spool(spool, most_bytes=round(1e6 * spool_megabytes), boot_from=time.time_ns() // 10**6)
    ring = _on_board(description, spool / "ring", ring_megabytes) if on_board else None
    running = box_of(
        vehicle_id,
        description,
        frames,
        Address.parse(broker),
        on_board=ring,
        allow_missing=may_lack,
        frame_seconds=frame_seconds,
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
    sent = send_live(running, blocks, stopping=stopping, on_problem=_log_problem)
    if sent is not None:
        run = f"{frames.next_seq} frames, {sent / 3600:.2f} hours in this run"
        LOG.info(f"source finished; all frames of {vehicle_id} acknowledged: {run}")


def _on_board(vehicle: "Vehicle", folder: Path, megabytes: float) -> "OnBoard":
    """Return the identification on board, which needs more of the package than a box that only sends."""
    from sprung.online.box.onboard import on_board_in

    return on_board_in(folder, vehicle, most_bytes=round(1e6 * megabytes))


def _log_problem(problem: str) -> None:
    """Log a problem with the link, or that it is over."""
    if problem:
        LOG.warning(problem)
    else:
        LOG.info("connection restored")
