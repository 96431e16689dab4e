"""A vehicle: main result, and springs, dampers and tyres against the reference."""

from typing import Annotated, Literal
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field

from sprung.online.monitor.histories import mileage_of, observations_of
from sprung.online.site.accounts import Viewer
from sprung.online.site.fleet import FleetVehicle, state_seen
from sprung.online.site.guard import policy
from sprung.online.site.rendering import axis_of, path_of, plotly_styles, vehicle_page
from sprung.online.site.shared import LIMITS, Answer, Context, KnownVehicle, Shared
from sprung.online.site.vehicles.baselines import BaselineEntry
from sprung.online.site.vehicles.trends import last_body_modes
from sprung.online.site.vehicles.windows import data_quality
from sprung.online.store import VehicleRow
from sprung.online.store.schema import DAY
from sprung.results.documents.monitoring import AlertEntry
from sprung.state import PartState, VehicleState, Verdict
from sprung.vehicles import Component

api = APIRouter(tags=["vehicles"])
pages = APIRouter(include_in_schema=False)

#: Ranges of time of the trends [days]; None: from the first window.
_RANGES = {"24h": 1, "7d": 7, "30d": 30, "all": None}


class VehicleDetail(Answer):
    """A vehicle: its place in the fleet, active alerts, baselines and open requests."""

    summary: FleetVehicle
    channels: tuple[str, ...]
    first_seen: int
    configuration: str
    alerts: tuple[AlertEntry, ...]
    baselines: tuple[BaselineEntry, ...]
    windows: int
    mileage: float | None = Field(description="by odometer, or as last stated, and driven since [km]; null: unknown")


class Changes(Answer):
    """Verdict on a vehicle, and changes of all parts, averaged over windows; baseline null: the vehicle file."""

    verdict: Verdict
    sentence: str
    reference: str
    baseline: int | None
    n_windows: int
    since: int | None
    until: int | None
    parts: tuple[PartState, ...]
    notes: tuple[str, ...]


@api.get("/vehicles/{vehicle}")
def vehicle_detail(context: Shared, _: Viewer, known: KnownVehicle) -> VehicleDetail:
    """A vehicle."""
    return _detail_and_state(context, known)[0]


@api.get("/vehicles/{vehicle}/changes")
def changes(context: Shared, _: Viewer, known: KnownVehicle) -> Changes:
    """Changes of springs, dampers and tyres against the baseline, with 95 % intervals."""
    return Changes.model_validate(_detail_and_state(context, known)[1])


@pages.get("/vehicles/{vehicle}")
def show(
    request: Request,
    context: Shared,
    person: Viewer,
    known: KnownVehicle,
    *,
    wanted: Annotated[Literal["24h", "7d", "30d", "all"], Query(alias="range")] = "all",
    corner: Annotated[str, Query(max_length=64)] = "",
) -> Response:
    """Show a vehicle."""
    detail, state = _detail_and_state(context, known)
    vehicle = known.vehicle
    quality = data_quality(context, person, known)
    named = [part for part in state.parts if part.alert is not None]
    worst = max(named or state.parts[:1], key=lambda part: abs(part.change), default=None)
    corners = list(dict.fromkeys(part.corner for part in state.parts))
    shown = corner if corner in corners or worst is None else worst.corner
    days = _RANGES[wanted]
    since = {} if days is None else {"since": context.clock() - days * DAY}
    answer = vehicle_page(
        request,
        "vehicle.html",
        vehicle,
        tab="",
        detail=detail,
        state_of=state,
        plan=_plan(state.parts),
        axis=axis_of(state.parts),
        quality=quality,
        body=last_body_modes(context.store, vehicle),
        wanted=wanted,
        ranges=list(_RANGES),
        corners=corners,
        corner=shown,
        steps_of={part.corner: part.step for part in state.parts if part.step},
        trends=f"/api/v1{path_of(vehicle)}/trends?{urlencode(since)}",
        windows=observations_of(context.store.results.observations(vehicle, limit=LIMITS.few_windows)),
        link=lambda **new: "?" + urlencode({"range": wanted, "corner": shown} | new),
    )
    answer.headers["content-security-policy"] = policy(*plotly_styles())
    return answer


def _detail_and_state(context: Context, known: VehicleRow) -> tuple[VehicleDetail, VehicleState]:
    """Return what is known about a vehicle, and its state."""
    store = context.store
    vehicle = known.vehicle
    active = store.alerts.find(vehicle=vehicle, is_active=True)
    baselines = store.results.baselines(vehicle)
    state = state_seen(context, vehicle, known, active)
    version = baselines[-1].version if baselines else None
    detail = VehicleDetail(
        summary=FleetVehicle.of(state, channels=len(known.channels), is_parked=known.is_parked, baseline=version),
        channels=tuple(dict(known.channels)),
        first_seen=known.first_seen,
        configuration=known.configuration,
        alerts=tuple(AlertEntry(**alert.as_entry()) for alert in state.alerts),
        baselines=tuple(map(BaselineEntry.of, reversed(baselines))),
        windows=store.results.n_observations(vehicle),
        mileage=mileage_of(store, vehicle, limit=LIMITS.max_windows),
    )
    return detail, state


def _plan(parts: tuple[PartState, ...]) -> list[dict[str, list[PartState]]]:
    """Return the parts by axle from front to rear, and there by side."""
    axles: dict[str, dict[str, list[PartState]]] = {}
    for part in parts:
        component = Component.parse(part.part)
        if component.side is not None:
            axles.setdefault(component.axle, {"left": [], "right": []})[component.side].append(part)
    return list(axles.values())
