"""The commands `sprung box` and `sprung replay`: samples to a monitor."""

import logging
import os
import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer

from sprung._display import counted
from sprung.cli.options import AllowMissing, Files, Reading, SamplingRate, VehicleFile, names, option, shares_options
from sprung.cli.output import LogFormat, log_to, progress_bar, show, stop_on_signals

LOG = logging.getLogger("sprung.box")

VehicleId = Annotated[str, option("ID", "Name of the vehicle.", show_default=False)]
BrokerUrl = Annotated[str, option("URL", "Broker: mqtt://HOST:PORT, or mqtts://HOST:PORT with ?ca=F&cert=F&key=F.")]


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
    """Send a vehicle's samples to a monitor. From a source, through a spool on disk.

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
    may_lack = Reading(channels).may_lack(description, allow_missing=allow_missing)
    stopping = stop_on_signals()
    frames = Spool(spool, max_bytes=round(1e6 * spool_megabytes), boot_from=time.time_ns() // 10**6)
    ring = None
    if on_board:  # which needs more of the package than a box that only sends
        from sprung.online.box.onboard import on_board_in

        ring = on_board_in(spool / "ring", description, max_bytes=round(1e6 * ring_megabytes))
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
        run = f"{counted(frames.next_seq, 'frame')}, {sent / 3600:.2f} hours in this run"
        LOG.info(f"source finished; all frames of {vehicle_id} acknowledged: {run}")


def _log_problem(problem: str) -> None:
    """Log a problem with the link, or that it is over."""
    if problem:
        LOG.warning(problem)
    else:
        LOG.info("connection restored")


@shares_options
def replay(
    files: Files,
    *,
    vehicle_id: VehicleId,
    vehicle: VehicleFile,
    broker: BrokerUrl = "mqtt://127.0.0.1:1883",
    pace: Annotated[
        float | None, option("X", "Speed of the replay, as a multiple of real time.", show_default="no limit")
    ] = None,
    allow_missing: AllowMissing = False,
    start: Annotated[
        str | None,
        option("TIME", "Start of files without times, such as 2026-11-21T08:30 (UTC).", show_default="they end now"),
    ] = None,
    spool: Annotated[
        Path | None, option("DIR", "Folder that keeps frames until they are acknowledged; a second run continues.")
    ] = None,
    patience: Annotated[float, option("SECONDS", "Longest wait for the last acknowledgement.", min=0)] = 60.0,
    reading: Reading,
) -> None:
    """Send recordings to a monitor as a vehicle would. Waits until they are acknowledged.

    Samples keep the times of the recording. The monitor skips what it has already analysed.
    """
    from sprung._checks import check_number
    from sprung.link import Address, Spool, check_vehicle
    from sprung.online.box import after, from_files
    from sprung.online.box.running import box_of
    from sprung.online.box.running import replay as send
    from sprung.online.box.sources import replay_times
    from sprung.results.tables.wording import format_span
    from sprung.vehicles import read_vehicle

    if pace is not None:
        check_number("--pace", pace, above=0)
    check_vehicle(vehicle_id)
    description = read_vehicle(vehicle)
    may_lack = reading.may_lack(description, allow_missing=allow_missing)
    address = Address.parse(broker)
    with tempfile.TemporaryDirectory(prefix="sprung-") as scratch:
        frames = Spool(spool or Path(scratch), boot_from=time.time_ns() // 10**6, is_synced=spool is not None)
        times = replay_times(files, now=time.time_ns(), start=start, settings=reading.settings)
        box = box_of(vehicle_id, description, frames, address, time_status=times.status, allow_missing=may_lack)
        try:
            resumed = box.resume_time()
            box.open(timeout=10.0)
            recorded = from_files(files, start=times.start, settings=reading.settings)
            with progress_bar() as report:
                sent = send(box, after(recorded, resumed), pace=pace, patience=patience, on_progress=report)
        finally:
            box.close()
    span = "" if sent.begin is None or sent.end is None else f" ({format_span(sent.begin, sent.end)})"
    show([*times.notes, f"{sent.duration / 60:.1f} min of {vehicle_id}{span} sent and acknowledged"])
