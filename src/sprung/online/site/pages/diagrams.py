"""Spectra with fit, stabilisation diagram and subsets by level of a window, as far as its samples are kept."""

from collections import Counter
from typing import Any
from urllib.parse import quote

from fastapi import APIRouter, Request, Response
from fastapi.responses import RedirectResponse

from sprung.online.site import diagram_views, vehicle_data
from sprung.online.site.access import Viewer
from sprung.online.site.api import VehicleName
from sprung.online.site.api_vehicles import Place
from sprung.online.site.busy import BusyError
from sprung.online.site.context import Shared
from sprung.online.site.diagrams import NoSamplesError
from sprung.online.site.pages.vehicles import vehicle_page

router = APIRouter()

_TAB = "/diagrams"


@router.get("/vehicles/{vehicle}/diagrams")
def last(request: Request, context: Shared, _: Viewer, vehicle: VehicleName) -> Response:
    """Show the diagrams of the last window whose samples are kept."""
    entry = diagram_views.last_window_with_samples(context, vehicle)
    if entry is not None:
        path = f"/vehicles/{quote(vehicle, safe='')}/windows/{entry.boot}/{entry.number}/diagrams"
        return RedirectResponse(path, 303)
    keep = context.site.keep
    return vehicle_page(
        request,
        "vehicle-diagrams.html",
        context,
        vehicle,
        tab=_TAB,
        window=None,
        n_windows=context.store.results.n_observations(vehicle),
        is_kept=context.site.archive is not None,
        days=keep.raw_days,
    )


@router.get("/vehicles/{vehicle}/windows/{boot}/{number}/diagrams")
def diagrams(
    request: Request,
    context: Shared,
    _: Viewer,
    vehicle: VehicleName,
    boot: Place,
    number: Place,
    *,
    again: bool = False,
) -> Response:
    """Show the diagrams of a window, or that they are being computed."""
    detail = vehicle_data.window_detail(context.store, vehicle, boot, number)
    shown: dict[str, Any] = {"diagrams": None, "pictures": (), "counts": (), "busy": "", "trouble": "", "failed": False}
    try:
        computed = diagram_views.computed_diagrams(context, vehicle, boot, number, again=again)
        shown["failed"] = bool(computed.error)
        entry = vehicle_data.require_window(context.store, vehicle, boot, number)
        values = diagram_views.shown_diagrams(entry, computed)
        poles = Counter(status for each in values.stabilisation.poles for status in each.status)
        shown |= {"diagrams": values, "pictures": tuple(computed.pictures), "counts": poles.most_common()}
    except BusyError as error:
        shown["busy"] = str(error)
    except NoSamplesError as error:
        shown["trouble"] = str(error)
    return vehicle_page(request, "vehicle-diagrams.html", context, vehicle, tab=_TAB, window=detail, **shown)
