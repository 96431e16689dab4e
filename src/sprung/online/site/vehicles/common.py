"""What the pages of a vehicle share: the vehicle or window that is asked for, and how values are written."""

from collections.abc import Sequence
from typing import Annotated, Any
from urllib.parse import quote

from fastapi import Depends, Request, Response

from sprung.diagnosis import INTERVAL_95
from sprung.errors import ParameterError
from sprung.online.site.rendering import page
from sprung.online.site.shared import Context, Place, Shared, VehicleName
from sprung.online.store import Entry, VehicleRow
from sprung.state import PartState

#: Half widths of the axis of changes [%], the smallest one that holds all intervals is used.
_AXES = (5, 10, 20, 30, 50, 100)
#: Width of the axis of changes in its picture.
_WIDTH = 240
#: Width below which intervals have a decimal [percentage points].
_NARROW = 2.0
#: Digits of powers.
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
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
    row = context.store.inbox.vehicle(vehicle)
    if row is None:
        raise ParameterError(f"unknown vehicle {vehicle!r}: the fleet lists the known ones")
    return row


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


def vehicle_page(
    request: Request, template: str, context: Context, vehicle: str, *, tab: str, **values: Any
) -> Response:
    """Return a page about a vehicle."""
    return page(
        request,
        template,
        vehicle=vehicle,
        path=path_of(vehicle),
        minutes=f"{context.site.watch.window_minutes:g} minutes",
        tab=tab,
        tabs=_TABS.items(),
        width=_WIDTH,
        signed=_signed,
        span=_span,
        mode_span=_mode_span,
        x=_x,
        three_digits=_three_digits,
        **values,
    )


def axis_of(parts: Sequence[PartState]) -> int:
    """Return half the width of the axis that shows all changes with their intervals [%]."""
    reach = max((100 * abs(end) for part in parts for end in (*part.interval, part.change)), default=0.0)
    return next((half for half in _AXES if reach <= half), _AXES[-1])


def _x(change: float, axis: int) -> float:
    """Return the place of a change on the axis, within its ends."""
    return round(_WIDTH / 2 * (1 + max(-1.0, min(1.0, 100 * change / axis))), 1)


def _signed(change: float, interval: tuple[float, float]) -> str:
    """Return a change [%] with its sign, and as many digits as its interval deserves."""
    digits = 1 if 100 * abs(interval[1] - interval[0]) < _NARROW else 0
    value = round(100 * change, digits)
    return f"{value:+.{digits}f}".replace("-", "−") if value else f"{0:.{digits}f}"


def _span(interval: tuple[float, float]) -> str:
    """Return the ends of an interval of a change [%]."""
    return f"{_signed(interval[0], interval)} to {_signed(interval[1], interval)}"


def _mode_span(value: float, std: float | None, factor: float = 1.0) -> str:
    """Return a value of a mode with its 95 % interval, in three digits."""
    text = f"{factor * value:#.3g}"
    if std is None:
        return text
    digits = len(text.partition(".")[2])
    low, high = (f"{factor * (value + half):.{digits}f}" for half in (-INTERVAL_95 * std, INTERVAL_95 * std))
    return f"{text} ({low} to {high})"


def _three_digits(value: float) -> str:
    """Return a value in three digits, a small or large one with its power of ten."""
    mantissa, _, exponent = f"{value:.3g}".partition("e")
    power = f" · 10{str(int(exponent)).translate(_RAISED)}" if exponent else ""
    return mantissa.replace("-", "−") + power
