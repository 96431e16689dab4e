"""Windows of a vehicle: the list, and one with its conditions, parts, modes, findings and sensor faults."""

from collections.abc import Sequence
from math import isfinite
from typing import Any

from fastapi import APIRouter, Request, Response
from pydantic import Field

from sprung.diagnosis import Observation
from sprung.diagnosis.observation import CONDITION_UNITS
from sprung.errors import FormatError
from sprung.online.monitor.histories import observations_of, reference_of
from sprung.online.site.access import Viewer
from sprung.online.site.shared import LIMITS, Answer, Limit, Shared, Time, VehicleName
from sprung.online.site.vehicles.common import KnownVehicle, KnownWindow, axis_of, vehicle_page
from sprung.online.site.vehicles.trends import ModeValue, body_modes_in
from sprung.online.store import Entry, Store
from sprung.results.documents import observation_from_document
from sprung.state import PartState
from sprung.vehicles.labels import MOTIONS

api = APIRouter(tags=["vehicles"])
pages = APIRouter(include_in_schema=False)


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


class WindowDetail(Answer):
    """A window: conditions, parts, modes, findings and sensor faults."""

    vehicle: str
    window: WindowEntry
    reason: str | None = Field(description="why it is inconclusive; null if it is conclusive")
    conditions: tuple[Condition, ...] = ()
    reference: str
    parts: tuple[PartState, ...] = ()
    modes: tuple[ModeValue, ...] = ()
    findings: tuple[str, ...]
    sensor_faults: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()
    before: str | None = Field(description="BOOT/NUMBER of the window before")
    after: str | None


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
        parts=reference.parts([observation], limits={}) if reference.accepts(observation) else (),
        modes=_modes(store, entry, observation),
        sensor_faults=tuple(faults),
        notes=(*reference.notes, *observation.notes),
        **common,
    )


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
