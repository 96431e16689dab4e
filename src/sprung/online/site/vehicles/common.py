"""What the pages of a vehicle share: the vehicle or window that is asked for, and how values are written."""

from collections.abc import Sequence
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import Depends, Request, Response

from sprung.errors import ParameterError
from sprung.online.monitor import histories
from sprung.online.site.rendering import page
from sprung.online.site.shared import Place, Shared, VehicleName
from sprung.online.store import Entry, VehicleRow
from sprung.state import PartState

#: Half widths of the axis of changes [%], the smallest one that holds all intervals is used.
_AXES = (5, 10, 20, 30, 50, 100)
#: Width of the axis of changes in its picture.
_WIDTH = 240
#: Pages of a vehicle.
_TABS = {
    "": "Overview",
    "/diagrams": "Spectra and diagrams",
    "/windows": "Windows",
    "/data": "Data quality",
    "/baseline": "Baseline",
}


def require_vehicle(context: Shared, vehicle: VehicleName) -> VehicleRow:
    """Return a vehicle as it described itself.

    Raises
    ------
    ParameterError
        If it is unknown.
    """
    return histories.require_vehicle(context.store, vehicle)


KnownVehicle = Annotated[VehicleRow, Depends(require_vehicle)]


def require_window(context: Shared, row: KnownVehicle, boot: Place, number: Place) -> Entry:
    """Return a stored window.

    Raises
    ------
    ParameterError
        If the vehicle or the window is unknown.
    """
    vehicle = row.vehicle
    entry = context.store.results.observation(vehicle, boot, number)
    if entry is None:
        raise ParameterError(f"unknown window {boot}/{number} of {vehicle}: it was never analysed or is no longer kept")
    return entry


KnownWindow = Annotated[Entry, Depends(require_window)]


def path_of(vehicle: str) -> str:
    """Return the path of the pages of a vehicle."""
    return f"/vehicles/{quote(vehicle, safe='')}"


def vehicle_page(request: Request, template: str, vehicle: str, *, tab: str, **values: Any) -> Response:
    """Return a page about a vehicle."""
    return page(
        request,
        template,
        vehicle=vehicle,
        path=path_of(vehicle),
        minutes=f"{request.app.state.context.site.watch.window_minutes:g} minutes",
        tab=tab,
        tabs=_TABS.items(),
        width=_WIDTH,
        x=_x,
        **values,
    )


def axis_of(parts: Sequence[PartState]) -> int:
    """Return half the width of the axis that shows all changes with their intervals [%]."""
    reach = max((100 * abs(end) for part in parts for end in (*part.interval, part.change)), default=0.0)
    return next((half for half in _AXES if reach <= half), _AXES[-1])


def _x(change: float, axis: int) -> float:
    """Return the place of a change on the axis, within its ends."""
    return round(_WIDTH / 2 * (1 + max(-1.0, min(1.0, 100 * change / axis))), 1)
