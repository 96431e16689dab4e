"""The command `sprung replay`."""

import tempfile
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from sprung.cli.checks import may_lack_sensors
from sprung.cli.options import AllowMissing, Files, VehicleFile, option
from sprung.cli.output import progress_bar, show
from sprung.cli.reading import reads_files

if TYPE_CHECKING:
    from sprung.formats import ReadSettings

VehicleId = Annotated[str, option("ID", "Name of the vehicle.", show_default=False)]
BrokerUrl = Annotated[str, option("URL", "Broker: mqtt://HOST:PORT, or mqtts://HOST:PORT with ?ca=F&cert=F&key=F.")]


@reads_files
def replay(
    files: Files,
    *,
    vehicle_id: VehicleId,
    vehicle: VehicleFile,
    broker: BrokerUrl = "mqtt://127.0.0.1:1883",
    pace: Annotated[
        float | None, option("X", "Speed of the replay, as a multiple of real time.", show_default="no limit")
    ] = None,
    reading: "ReadSettings",
    allow_missing: AllowMissing = False,
    start: Annotated[
        str | None,
        option("TIME", "Start of files without times, such as 2026-11-21T08:30 (UTC).", show_default="they end now"),
    ] = None,
    spool: Annotated[
        Path | None, option("DIR", "Folder that keeps frames until they are acknowledged; a second run continues.")
    ] = None,
    patience: Annotated[float, option("SECONDS", "Longest wait for the last acknowledgement.", min=0)] = 60.0,
) -> None:
    """Send recordings to a monitor as a vehicle would, and wait until they are acknowledged.

    Samples keep the times of the recording. The monitor skips what it has already analysed.
    """
    from sprung._checks import check_number
    from sprung.link import Address, Spool, check_vehicle
    from sprung.online.box import after, from_files
    from sprung.online.box.recorded import replay_times
    from sprung.online.box.running import box_of
    from sprung.online.box.running import replay as send
    from sprung.results.tables import span_in_words
    from sprung.vehicles import read_vehicle

    if pace is not None:
        check_number("--pace", pace, above=0)
    check_vehicle(vehicle_id)
    description = read_vehicle(vehicle)
    may_lack = may_lack_sensors(description.sensor, allow_missing=allow_missing, channels=reading.channels)
    address = Address.parse(broker)
    with tempfile.TemporaryDirectory(prefix="sprung-") as scratch:
        frames = Spool(spool or Path(scratch), boot_from=time.time_ns() // 10**6, is_synced=spool is not None)
        times = replay_times(files, now=time.time_ns(), start=start, settings=reading)
        box = box_of(vehicle_id, description, frames, address, time_status=times.status, allow_missing=may_lack)
        try:
            resumed = box.resume_time()
            box.open(timeout=10.0)
            recorded = from_files(files, start=times.start, settings=reading)
            with progress_bar() as report:
                sent = send(box, after(recorded, resumed), pace=pace, patience=patience, on_progress=report)
        finally:
            box.close()
    span = "" if sent.begin is None or sent.end is None else f" ({span_in_words(sent.begin, sent.end)})"
    show([*times.in_words, f"{sent.duration / 60:.1f} min of {vehicle_id}{span} sent and acknowledged"])
