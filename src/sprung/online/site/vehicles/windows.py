"""Windows of a vehicle: the list, one with conditions, parts, modes, findings and faults, and the quality of data."""

from collections import Counter
from collections.abc import Sequence
from math import isfinite
from typing import Any, Literal

from fastapi import APIRouter, Request, Response
from pydantic import Field

from sprung.diagnosis import Observation
from sprung.diagnosis.observation import CONDITION_UNITS
from sprung.errors import FormatError
from sprung.likelihood.plate_test import PLATE
from sprung.modal import INTERVAL_95
from sprung.online.monitor.histories import observations_of, reference_of
from sprung.online.site.accounts import Viewer
from sprung.online.site.rendering import axis_of, vehicle_page
from sprung.online.site.shared import LIMITS, Answer, KnownVehicle, KnownWindow, Limit, Shared, Time, VehicleName
from sprung.online.site.vehicles.trends import ModeValue, body_modes_in
from sprung.online.store import Entry, Store
from sprung.results.documents import observation_from_document
from sprung.state import PartState
from sprung.vehicles.channel_faults import MISSING
from sprung.vehicles.labels import MOTIONS

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


class WindowEntry(Answer):
    """A window: its place, time and document."""

    boot: int
    number: int
    t0: int
    document: dict[str, Any]


class WindowPage(Answer):
    """Windows in order of time."""

    windows: tuple[WindowEntry, ...]
    next: int | None = Field(description="value of `until` for the page before; null before the first")


class Condition(Answer):
    """A condition of driving."""

    name: str
    value: float
    unit: str


class InspectedCorner(Answer):
    """Phase shift of a corner on the plate of a suspension tester [degrees], with its 95 % interval."""

    corner: str
    phase_shift: float
    low: float
    high: float
    verdict: Literal["fails", "near the limit", "passes"]


class WindowDetail(Answer):
    """A window: conditions, parts, modes, findings and sensor faults."""

    vehicle: str
    window: WindowEntry
    reason: str | None = Field(description="why it is inconclusive; null if it is conclusive")
    conditions: tuple[Condition, ...] = ()
    inspection: tuple[InspectedCorner, ...] = Field((), description="corners near the limit of 35 degrees or below")
    reference: str
    parts: tuple[PartState, ...] = ()
    modes: tuple[ModeValue, ...] = ()
    findings: tuple[str, ...]
    sensor_faults: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    before: str | None = Field(description="BOOT/NUMBER of the window before")
    after: str | None


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


@api.get("/vehicles/{vehicle}/windows")
def windows(
    context: Shared, _: Viewer, vehicle: VehicleName, *, since: Time = None, until: Time = None, limit: Limit = 100
) -> WindowPage:
    """Observations of windows in order of time, the last before `until`."""
    return _page(context.store.results.observations(vehicle, since=since, until=until, limit=limit + 1), limit)


@api.get("/vehicles/{vehicle}/modes")
def modes(
    context: Shared, _: Viewer, vehicle: VehicleName, *, since: Time = None, until: Time = None, limit: Limit = 100
) -> WindowPage:
    """Identified modes in order of time, the last before `until`."""
    return _page(context.store.results.modes(vehicle, since=since, until=until, limit=limit + 1), limit)


@api.get("/vehicles/{vehicle}/findings")
def findings(
    context: Shared, _: Viewer, vehicle: VehicleName, *, since: Time = None, until: Time = None, limit: Limit = 100
) -> WindowPage:
    """Findings in order of time, the last before `until`."""
    return _page(context.store.results.findings(vehicle, since=since, until=until, limit=limit + 1), limit)


@api.get("/vehicles/{vehicle}/windows/{boot}/{number}")
def window(context: Shared, _: Viewer, entry: KnownWindow) -> WindowDetail:
    """A window: conditions, parts, modes, findings and sensor faults."""
    store = context.store
    vehicle = entry.vehicle
    reference = reference_of(store.results.baselines(vehicle))
    last = store.results.observations(vehicle, until=entry.t0 - 1, limit=1)
    following = store.results.first_observation(vehicle, after=entry.t0)
    common: dict[str, Any] = {
        "vehicle": vehicle,
        "window": entry,
        "reference": reference.in_words,
        "findings": [
            str(each.document.get("sentence", ""))
            for each in store.results.findings_of(vehicle, entry.boot, entry.number)
        ],
        "before": f"{last[0].boot}/{last[0].number}" if last else None,
        "after": None if following is None else f"{following.boot}/{following.number}",
    }
    try:
        observation = observation_from_document(entry.document)
    except FormatError as error:
        return WindowDetail(reason=f"the stored window cannot be read: {error}", **common)
    faults = [f"{each.channel} is {each.kind.replace('_', ' ')}: {each.detail}" for each in observation.sensor_faults]
    return WindowDetail(
        reason=observation.reason or None,
        conditions=tuple(
            Condition(name=name, value=value, unit=CONDITION_UNITS.get(name, ""))
            if name not in {"standing", "model_error"}
            else Condition(name=name, value=100 * value, unit="%")
            for name, value in observation.conditions.items()
            if isfinite(value)
        ),
        inspection=tuple(_inspected(*each) for each in observation.phase_shifts.items()),
        parts=reference.parts([observation], limits={}) if reference.accepts(observation) else (),
        modes=_modes(store, entry, observation),
        sensor_faults=tuple(faults),
        notes=(*reference.notes, *observation.notes),
        **common,
    )


def _inspected(corner: str, estimate: tuple[float, float]) -> InspectedCorner:
    """Return a phase shift and its standard deviation with interval and verdict."""
    degrees, half = estimate[0], INTERVAL_95 * estimate[1]
    low, high = max(0.0, degrees - half), degrees + half
    limit = PLATE.phase_limit
    verdict: Literal["fails", "near the limit", "passes"] = "fails" if high < limit else "near the limit"
    if low >= limit:
        verdict = "passes"
    return InspectedCorner(corner=corner, phase_shift=degrees, low=low, high=high, verdict=verdict)


@pages.get("/vehicles/{vehicle}/windows")
def show(request: Request, context: Shared, _: Viewer, row: KnownVehicle, *, until: Time = None) -> Response:
    """Show the windows of a vehicle, the newest first."""
    entries = context.store.results.observations(row.vehicle, until=until, limit=LIMITS.page_windows + 1)
    return vehicle_page(
        request,
        "vehicle-windows.html",
        row.vehicle,
        tab="/windows",
        windows=observations_of(entries[-LIMITS.page_windows :]),
        following=_page(entries, LIMITS.page_windows).next,
        until=until,
    )


@pages.get("/vehicles/{vehicle}/windows/{boot}/{number}")
def show_window(request: Request, context: Shared, person: Viewer, entry: KnownWindow) -> Response:
    """Show a window of a vehicle."""
    detail = window(context, person, entry)
    axis = axis_of(detail.parts)
    return vehicle_page(request, "vehicle-window.html", entry.vehicle, tab="/windows", window=detail, axis=axis)


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
def show_quality(request: Request, context: Shared, person: Viewer, row: KnownVehicle) -> Response:
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


def _page(entries: Sequence[Entry], limit: int) -> WindowPage:
    """Return windows in order of time, of one more than `limit` the newest."""
    shown = tuple(map(WindowEntry.model_validate, entries[-limit:]))
    return WindowPage(windows=shown, next=shown[0].t0 - 1 if len(entries) > limit else None)


def _modes(store: Store, entry: Entry, observation: Observation) -> tuple[ModeValue, ...]:
    """Return the modes of the body that were identified in a window; those of the fitted vehicle where none were."""
    identified = store.results.last_modes(entry.vehicle, since=entry.t0, until=entry.t0)
    own = [body_modes_in(each.document) for each in identified if each.boot == entry.boot]
    if own and own[-1]:
        return tuple(own[-1][label] for label in MOTIONS if label in own[-1])
    return tuple(
        ModeValue(label=label, natural_frequency=frequency, damping_ratio=ratio)
        for label, (frequency, ratio) in observation.modes.items()
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
