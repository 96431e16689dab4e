"""The command `sprung box`."""

import logging
import signal
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.baseline import VehicleFile, vehicle_of
from sprung.cli.files import SamplingRate, names
from sprung.cli.logs import log_to
from sprung.cli.replay import BrokerUrl, VehicleId
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.box import Box
    from sprung.box.onboard import OnBoard
    from sprung.recording import Recording
    from sprung.vehicles import Vehicle

_SOURCES = "files, folder:DIR, stdin, can:INTERFACE:CHANNEL:DATABASE.dbc, mqtt:URL#TOPIC or simulator"
LOG = logging.getLogger("sprung.box")


def box(
    files: Annotated[list[Path] | None, typer.Argument(metavar="FILE...", show_default=False)] = None,
    *,
    vehicle_id: VehicleId,
    vehicle: VehicleFile,
    broker: BrokerUrl = "mqtt://127.0.0.1:1883",
    source: Annotated[str, typer.Option(metavar="SOURCE", help=f"Where samples come from: {_SOURCES}.")] = "files",
    spool: Annotated[Path, typer.Option(metavar="DIR", help="Folder for frames that wait.")] = Path("sprung-spool"),
    spool_megabytes: Annotated[float, typer.Option(metavar="MB", help="Room for them; the oldest go first.")] = 256.0,
    channels: Annotated[
        str | None, typer.Option(metavar="A,B,..", help="Channels or signals to send.", show_default=False)
    ] = None,
    sampling_rate: SamplingRate = None,
    pace: Annotated[
        float | None,
        typer.Option(metavar="X", help="Files: times as fast as recorded; without it: at once.", show_default=False),
    ] = None,
    on_board: Annotated[
        bool,
        typer.Option(
            "--on-board",
            help="Identify on the vehicle: send correlations and modes, keep samples for when they are asked for.",
        ),
    ] = False,
    ring_megabytes: Annotated[float, typer.Option(metavar="MB", help="Room for those samples.")] = 1024.0,
    log_format: Annotated[str, typer.Option("--log", metavar="text|json", help="Form of the log.")] = "text",
) -> None:
    """Send a vehicle's samples to a monitor: from the sensors, through a spool on disk, until it has them.

    Runs until its source ends and all is acknowledged, or until it is stopped; started again, it goes on where it was.
    """
    from sprung.box import Box, BoxSettings, after, paced
    from sprung.link import Address, Spool
    from sprung.vehicles import vehicle_text
    from sprung.vehicles.sensor_layout import quantities_of

    log_to(log_format)
    description = vehicle_of(vehicle)
    stopping = threading.Event()
    for number in (signal.SIGINT, signal.SIGTERM):
        # In a thread: the signal may come while this one holds the lock of the event, and would wait for itself.
        signal.signal(number, lambda *_: threading.Thread(target=stopping.set).start())
    kept = Spool(spool, most_bytes=round(1e6 * spool_megabytes), boot_from=time.time_ns() // 10**6)
    one = Box(
        BoxSettings(vehicle_id, vehicle_text(description)),
        kept,
        Address.parse(broker),
        quantities=lambda block: quantities_of(block, description.sensor),
        on_board=_on_board(description, spool / "ring", ring_megabytes) if on_board else None,
    )
    is_replayed = source in {"files", "simulator"}
    blocks = _blocks(
        source,
        files or [],
        vehicle=description,
        channels=names(channels),
        sampling_rate=sampling_rate,
        start=_beginning(spool / "begun") if is_replayed else time.time_ns(),
        done=spool / "done",
        stopping=stopping,
    )
    if is_replayed:
        blocks = after(blocks, one.resume_time())
    speed = {"files": pace, "simulator": 1.0}.get(source)
    taken = 0.0
    try:
        one.open()
        looking = threading.Thread(target=_look, args=(one, stopping), daemon=True)
        looking.start()
        for block in paced(blocks, speed, clock=time.monotonic, sleep=partial(_waited, stopping)):
            if stopping.is_set():
                break
            one.take(block)
            taken += block.duration
        while not stopping.is_set() and not one.drain(timeout=1.0):
            pass
        if not stopping.is_set():
            said = f"{kept.next_seq} frames, {taken / 3600:.2f} hours in this run"
            LOG.info(f"the source has ended, and all of {vehicle_id} is with the monitor: {said}")
    finally:
        stopping.set()
        one.close()


def _on_board(vehicle: "Vehicle", folder: Path, megabytes: float) -> "OnBoard":
    """Return what identifies on the vehicle."""
    from sprung.box.onboard import Answers, OnBoard
    from sprung.link import Spool

    ring = Spool(folder, most_bytes=round(1e6 * megabytes))
    return OnBoard(vehicle, ring, answers=Answers(folder / "answers.json"))


def _beginning(path: Path) -> int:
    """Return when a replayed source began, UTC ns; kept, so that a restarted box goes on in the same time."""
    if not path.exists():
        part = path.with_name(f"{path.name}.part")
        part.write_text(str(time.time_ns()), encoding="ascii")
        part.rename(path)
    return int(path.read_text(encoding="ascii"))


def _waited(stopping: threading.Event, seconds: float) -> None:
    """Wait for a time, or until it is over."""
    stopping.wait(seconds)


def _look(one: "Box", stopping: threading.Event) -> None:
    """See to the link while samples come in, and say what stands in the way."""
    said = ""
    while not stopping.wait(0.05):
        one.step()
        if one.problem != said:
            said = one.problem
            LOG.warning(said or "all is well again")


def _blocks(
    source: str,
    files: list[Path],
    *,
    vehicle: "Vehicle",
    channels: Sequence[str] | None,
    sampling_rate: float | None,
    start: int,
    done: Path,
    stopping: threading.Event,
) -> "Iterator[Recording]":
    """Return the blocks of a source."""
    from sprung.box import can_bus, can_database, from_can, from_files, from_folder, from_lines, from_mqtt

    kind, _, rest = source.partition(":")
    if kind == "files" and files:
        return from_files(files, start=start, sampling_rate=sampling_rate, channels=channels)
    if kind == "simulator":
        from sprung.box import from_simulator as simulated
        from sprung.simulation import DriveSettings

        return simulated(vehicle, lambda number: DriveSettings("road", snr=50.0, road="BCD"[number % 3]), start=start)
    if kind == "folder" and rest:

        def finish(name: str, said: str) -> None:
            if said:
                LOG.warning(f"{name} was not read to its end: {said}")
            else:
                LOG.info(f"read {name}")
            with done.open("a", encoding="utf-8") as file:
                file.write(name + "\n")

        known = done.read_text(encoding="utf-8").splitlines() if done.exists() else ()
        return from_folder(
            Path(rest),
            start=time.time_ns,
            is_done=stopping.is_set,
            sleep=partial(_waited, stopping),
            done=finish,
            known=known,
            sampling_rate=sampling_rate,
            channels=channels,
        )
    if kind in {"stdin", "can", "mqtt"} and sampling_rate is None:
        raise ParameterError(f"--source {kind} needs --sampling-rate HZ: values come one by one")
    rate = sampling_rate or 0.0
    if kind == "stdin":
        return from_lines(sys.stdin, sampling_rate=rate, start=time.time_ns)
    if kind in {"can", "mqtt"} and channels is None:
        raise ParameterError(f"--source {kind} needs --channels A,B,..: the names of what to send")
    wanted = channels or []
    if kind == "can" and rest.count(":") == 2:
        interface, channel, database = rest.split(":")
        messages = can_bus(interface, channel)
        return from_can(messages, can_database(database), names=wanted, sampling_rate=rate, on_problem=LOG.warning)
    if kind == "mqtt" and "#" in rest:
        address, _, topic = rest.partition("#")
        return from_mqtt(
            address, [topic], names=wanted, sampling_rate=rate, is_done=stopping.is_set, on_problem=LOG.warning
        )
    raise ParameterError(f"--source {source!r} is none of {_SOURCES}" + ("" if files else ": give files or a source"))
