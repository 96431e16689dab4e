"""The command `sprung replay`."""

import tempfile
import time
from pathlib import Path
from typing import Annotated

import typer

from sprung.cli.files import Channels, Files, SamplingRate, VehicleFile, names
from sprung.cli.printing import console, notes
from sprung.cli.progress import progress_bar
from sprung.errors import DataError

VehicleId = Annotated[str, typer.Option(metavar="ID", help="Name of the vehicle.", show_default=False)]
BrokerUrl = Annotated[
    str,
    typer.Option(
        metavar="URL", help="Broker: mqtt://HOST:PORT, or mqtts://HOST:PORT?ca=F&cert=F&key=F.", show_default=False
    ),
]


def replay(
    files: Files,
    *,
    vehicle_id: VehicleId,
    vehicle: VehicleFile,
    broker: BrokerUrl = "mqtt://127.0.0.1:1883",
    pace: Annotated[
        float | None,
        typer.Option(metavar="X", help="Speed of the replay, times real time.", show_default="no limit"),
    ] = None,
    channels: Channels = None,
    sampling_rate: SamplingRate = None,
    spool: Annotated[
        Path | None,
        typer.Option(
            metavar="DIR",
            help="Folder that keeps frames until they are acknowledged; run again, it continues.",
            show_default=False,
        ),
    ] = None,
    patience: Annotated[
        float, typer.Option(metavar="SECONDS", help="Longest wait for the last acknowledgement.", min=0)
    ] = 60.0,
) -> None:
    """Send recordings to a monitor as a vehicle would, and wait until they are acknowledged."""
    from sprung._checks import check_number
    from sprung.box import Box, BoxSettings, after, from_files, paced
    from sprung.link import Address, Spool
    from sprung.vehicles import read_vehicle, vehicle_text
    from sprung.vehicles.sensor_layout import quantities_of

    if pace is not None:
        check_number("--pace", pace, above=0)
    description = read_vehicle(vehicle)
    settings = BoxSettings(vehicle_id, vehicle_text(description))
    with tempfile.TemporaryDirectory(prefix="sprung-") as scratch:
        box = Box(
            settings,
            Spool(spool or Path(scratch), boot_from=time.time_ns() // 10**6, is_synced=spool is not None),
            Address.parse(broker),
            quantities=lambda block: quantities_of(block, description.sensor),
        )
        try:
            resumed = box.resume_time()
            box.open(timeout=10.0)
            source = from_files(files, start=time.time_ns(), sampling_rate=sampling_rate, channels=names(channels))
            sent = 0.0
            with progress_bar() as report:
                for block in paced(after(source, resumed), pace, clock=time.monotonic, sleep=time.sleep):
                    box.take(block)
                    box.step()
                    sent += block.duration
                    report(f"{sent / 60:.1f} min sent", 0.5)
                report("waiting for acknowledgements", 0.9)
                is_acknowledged = box.drain(timeout=patience)
                waiting = box.n_waiting
        finally:
            box.close()
    if not is_acknowledged:
        raise DataError(
            f"{waiting} frames not acknowledged after {patience:g} s: check that a monitor runs at {broker}"
        )
    console().print(notes([f"{sent / 60:.1f} min of {vehicle_id} sent and acknowledged"]))
