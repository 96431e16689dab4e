"""Data quality of a vehicle: what the checks found on each channel over the last windows."""

from collections import Counter
from collections.abc import Sequence

from fastapi import APIRouter, Request, Response
from pydantic import Field

from sprung.diagnosis import Observation
from sprung.diagnosis.channel_faults import MISSING
from sprung.online.monitor.histories import observations_of
from sprung.online.site.access import Viewer
from sprung.online.site.shared import LIMITS, Answer, Shared
from sprung.online.site.vehicles.common import KnownVehicle, vehicle_page

api = APIRouter(tags=["vehicles"])
pages = APIRouter(include_in_schema=False)

#: Checks of a channel as a table shows them, with the kinds of faults that each finds.
CHECKS = {
    "signal": ("dead", "stuck", MISSING),
    "clipping": ("clipped",),
    "noise": ("noisy", "spiking", "hum"),
    "offset": ("drifting",),
    "fit to the other sensors": ("inverted", "swapped", "wrong_gain"),
    "time": ("time_shifted",),
}


class ChannelCheck(Answer):
    """Result of the checks of one kind on a channel."""

    name: str
    n_faults: int = Field(description="windows with such a fault")
    last: int | None = Field(description="start of the last of them")
    text: str = Field(description="that fault in words")
    is_present: bool = Field(description="whether the last window has it")


class ChannelQuality(Answer):
    """Data quality of a channel."""

    channel: str
    quantity: str
    checks: tuple[ChannelCheck, ...]
    is_good: bool = Field(description="whether the last window has no fault of it")


class DataQuality(Answer):
    """Data quality of a vehicle over its last windows; unknown values are omitted."""

    since: int | None
    until: int | None
    last_seen: int
    is_parked: bool
    n_windows: int
    n_inconclusive: int
    reasons: tuple[tuple[str, int], ...] = Field(description="why windows are inconclusive, with their number")
    lost_frames: int
    unanalysed_frames: int = Field(description="quarantined because their analysis failed")
    channels: tuple[ChannelQuality, ...]
    notes: tuple[str, ...]


@api.get("/vehicles/{vehicle}/data-quality")
def data_quality(context: Shared, _: Viewer, row: KnownVehicle) -> DataQuality:
    """Data quality of each channel over the last windows."""
    store = context.store
    vehicle = row.vehicle
    read = observations_of(store.results.observations(vehicle, limit=LIMITS.quality_windows))
    windows = [(entry.t0, window) for entry, window in read]
    absent = {fault.channel: "" for _, window in windows for fault in window.sensor_faults}
    channels = [_channel_quality(name, quantity, windows) for name, quantity in (absent | dict(row.channels)).items()]
    return DataQuality(
        since=windows[0][0] if windows else None,
        until=windows[-1][0] if windows else None,
        last_seen=row.last_seen,
        is_parked=row.is_parked,
        n_windows=len(windows),
        n_inconclusive=sum(not window.is_conclusive for _, window in windows),
        reasons=tuple(Counter(window.reason for _, window in windows if window.reason).most_common()),
        lost_frames=sum(cursor.lost for cursor in store.inbox.cursors(vehicle=vehicle).values()),
        unanalysed_frames=sum(each.kind != "state" for each in store.quarantine.find(vehicle)),
        channels=tuple(
            sorted(channels, key=lambda each: (each.is_good, -sum(check.n_faults for check in each.checks)))
        ),
        notes=windows[-1][1].notes if windows else (),
    )


@pages.get("/vehicles/{vehicle}/data")
def show(request: Request, context: Shared, person: Viewer, row: KnownVehicle) -> Response:
    """Show the data quality of each channel of a vehicle."""
    quality = data_quality(context, person, row)
    return vehicle_page(
        request,
        "vehicle-data.html",
        row.vehicle,
        tab="/data",
        quality=quality,
        is_silent=quality.last_seen < context.silent_before and not quality.is_parked,
    )


def _channel_quality(name: str, quantity: str, windows: Sequence[tuple[int, Observation]]) -> ChannelQuality:
    """Return what the checks found on a channel."""
    checks = []
    for check, kinds in CHECKS.items():
        met = [
            (time, f"{fault.kind.replace('_', ' ')}: {fault.detail}".rstrip(": "))
            for time, window in windows
            for fault in window.sensor_faults
            if fault.channel == name and fault.kind in kinds
        ]
        last, text = met[-1] if met else (None, "")
        n_faults = len({time for time, _ in met})
        is_present = bool(met) and last == windows[-1][0]
        checks.append(ChannelCheck(name=check, n_faults=n_faults, last=last, text=text, is_present=is_present))
    is_good = not any(check.is_present for check in checks)
    return ChannelQuality(channel=name, quantity=quantity, checks=tuple(checks), is_good=is_good)
