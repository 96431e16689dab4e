"""A vehicle: main result, parts seen from above, trends, modes, windows, data quality and baseline."""

from collections.abc import Sequence
from enum import StrEnum
from typing import Annotated, Any
from urllib.parse import quote, urlencode

from fastapi import APIRouter, Query, Request, Response
from fastapi.responses import RedirectResponse

from sprung.errors import ParameterError
from sprung.modal import INTERVAL_95
from sprung.online.monitor import operations
from sprung.online.monitor.vehicle_states import observations_of
from sprung.online.site import vehicle_data, views
from sprung.online.site.access import Viewer
from sprung.online.site.api import Time, VehicleName
from sprung.online.site.api_vehicles import Place
from sprung.online.site.context import Context, Shared
from sprung.online.site.pages.forms import EngineerForm
from sprung.online.site.pages.rendering import page
from sprung.online.site.people import Person, Role
from sprung.online.site.vehicle_models import PartChange
from sprung.online.store import Entry
from sprung.state import PartState, VehicleState
from sprung.vehicles import Component

router = APIRouter()

_DAY = 86400 * 10**9
#: Digits of a version, less than which a number needs.
_MOST_DIGITS = 10
#: Windows in the list on the first page, and on a page of the list of all.
_FEW, _MANY = 6, 50
#: Half widths of the axis of changes [%], the smallest one that holds all intervals is used.
_AXES = (5, 10, 20, 30, 50, 100)
#: Width of the axis of changes in its picture, and percentage points below which intervals have a decimal.
_WIDTH, _NARROW = 240, 2.0
#: Digits of powers.
_RAISED = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
#: Pages of a vehicle.
_TABS = (
    ("", "Overview"),
    ("/diagrams", "Spectra and diagrams"),
    ("/windows", "Windows"),
    ("/data", "Data quality"),
    ("/baseline", "Baseline"),
)
#: Values of `notice` after a request to learn, and to return to an earlier baseline.
_RELEARN, _ROLLED_BACK = "learn", "rollback"


class Range(StrEnum):
    """Range of time of the trends."""

    DAY = "24h"
    WEEK = "7d"
    MONTH = "30d"
    ALL = "all"

    def since(self, now: int) -> int | None:
        """Return its beginning, UTC ns; None: the first window."""
        days = {"24h": 1, "7d": 7, "30d": 30}.get(self)
        return None if days is None else now - days * _DAY


@router.get("/vehicles/{vehicle}")
def overview(
    request: Request,
    context: Shared,
    _: Viewer,
    vehicle: VehicleName,
    *,
    wanted: Annotated[Range, Query(alias="range")] = Range.WEEK,
    corner: Annotated[str, Query(max_length=64)] = "",
) -> Response:
    """Show a vehicle."""
    detail, state = views.vehicle_detail(context, vehicle)
    store = context.store
    quality = vehicle_data.data_quality(store, vehicle)
    corners = list(dict.fromkeys(part.corner for part in state.parts))
    shown = corner if corner in corners else _worst_corner(state)
    since = wanted.since(context.clock())
    where = urlencode({} if since is None else {"since": since})
    return vehicle_page(
        request,
        "vehicle.html",
        context,
        vehicle,
        tab="",
        detail=detail,
        state_of=state,
        plan=_plan(state.parts),
        axis=_axis(state.parts),
        width=_WIDTH,
        quality=quality,
        n_good=sum(channel.is_good for channel in quality.channels),
        body=vehicle_data.last_body_modes(store, vehicle),
        wanted=wanted.value,
        ranges=[each.value for each in Range],
        corners=corners,
        corner=shown,
        steps_of={part.corner: part.step for part in state.parts if part.step},
        trends=f"/api/v1/vehicles/{quote(vehicle, safe='')}/trends?{where}",
        windows=_windows(store.results.observations(vehicle, limit=_FEW)),
        link=lambda **new: "?" + urlencode({"range": wanted.value, "corner": shown} | new),
    )


@router.get("/vehicles/{vehicle}/windows")
def windows(request: Request, context: Shared, _: Viewer, vehicle: VehicleName, *, until: Time = None) -> Response:
    """Show the windows of a vehicle, the newest first."""
    vehicle_data.require_vehicle(context.store, vehicle)
    entries = context.store.results.observations(vehicle, until=until, limit=_MANY + 1)
    found = views.window_page(entries, limit=_MANY)
    return vehicle_page(
        request,
        "vehicle-windows.html",
        context,
        vehicle,
        tab="/windows",
        windows=_windows(entries[-_MANY:]),
        following=found.next,
        until=until,
    )


@router.get("/vehicles/{vehicle}/windows/{boot}/{number}")
def window(request: Request, context: Shared, _: Viewer, vehicle: VehicleName, boot: Place, number: Place) -> Response:
    """Show a window of a vehicle."""
    detail = vehicle_data.window_detail(context.store, vehicle, boot, number)
    return vehicle_page(
        request,
        "vehicle-window.html",
        context,
        vehicle,
        tab="/windows",
        window=detail,
        axis=_axis(detail.parts),
        width=_WIDTH,
    )


@router.get("/vehicles/{vehicle}/data")
def data(request: Request, context: Shared, _: Viewer, vehicle: VehicleName) -> Response:
    """Show the data quality of each channel of a vehicle."""
    quality = vehicle_data.data_quality(context.store, vehicle)
    return vehicle_page(
        request,
        "vehicle-data.html",
        context,
        vehicle,
        tab="/data",
        quality=quality,
        bad=[channel.channel for channel in quality.channels if not channel.is_good],
        is_silent=quality.last_seen < context.silent_before and not quality.is_parked,
    )


@router.get("/vehicles/{vehicle}/baseline")
def baseline(
    request: Request,
    context: Shared,
    person: Viewer,
    vehicle: VehicleName,
    *,
    notice: Annotated[str, Query(max_length=20)] = "",
    version: Annotated[int, Query(ge=0, lt=2**31)] = 0,
) -> Response:
    """Show learning and baselines of a vehicle."""
    sentences = {
        _RELEARN: f"{vehicle} will learn a new baseline from its next usable windows.",
        _ROLLED_BACK: f"{vehicle} will return to the earlier baseline before its next window.",
    }
    return _baseline(request, context, person, vehicle, notice=sentences.get(notice, ""), wanted=version)


@router.post("/vehicles/{vehicle}/baseline")
def learn(request: Request, context: Shared, form: EngineerForm, vehicle: VehicleName) -> Response:
    """Learn a new baseline from the next windows."""
    reason = form.text("reason")
    try:
        operations.relearn(context.store, vehicle, reason=reason, who=form.person.name, now=context.clock())
    except ParameterError as error:
        if context.store.inbox.vehicle(vehicle) is None:
            raise
        sentence = str(error) if reason else "Give a reason, such as new dampers: it is stored with the baseline."
        return _baseline(request, context, form.person, vehicle, trouble=sentence, status=422)
    return RedirectResponse(f"/vehicles/{quote(vehicle, safe='')}/baseline?notice={_RELEARN}", 303)


@router.post("/vehicles/{vehicle}/baseline/rollback")
def roll_back(request: Request, context: Shared, form: EngineerForm, vehicle: VehicleName) -> Response:
    """Return to an earlier baseline."""
    reason, number = form.text("reason"), form.text("version")
    version = int(number) if number.isascii() and number.isdecimal() and len(number) < _MOST_DIGITS else 0
    try:
        operations.roll_back(
            context.store, vehicle, version=version, reason=reason, who=form.person.name, now=context.clock()
        )
    except ParameterError as error:
        if context.store.inbox.vehicle(vehicle) is None:
            raise
        sentence = str(error) if reason else "Give a reason, such as learnt with a broken spring."
        return _baseline(request, context, form.person, vehicle, refused=sentence, wanted=version, status=422)
    return RedirectResponse(f"/vehicles/{quote(vehicle, safe='')}/baseline?notice={_ROLLED_BACK}", 303)


def _baseline(
    request: Request,
    context: Context,
    person: Person,
    vehicle: str,
    *,
    notice: str = "",
    trouble: str = "",
    refused: str = "",
    wanted: int = 0,
    status: int = 200,
) -> Response:
    """Return the page of the baselines."""
    return vehicle_page(
        request,
        "vehicle-baseline.html",
        context,
        vehicle,
        tab="/baseline",
        status=status,
        notice=notice,
        trouble=trouble,
        refused=refused,
        wanted=wanted,
        baseline=vehicle_data.baseline_detail(context.store, vehicle),
        may_learn=person.role.includes(Role.ENGINEER),
    )


def vehicle_page(
    request: Request, template: str, context: Context, vehicle: str, *, tab: str, **values: Any
) -> Response:
    """Return a page about a vehicle."""
    return page(
        request,
        template,
        vehicle=vehicle,
        path=f"/vehicles/{quote(vehicle, safe='')}",
        minutes=f"{context.site.watch.window_minutes:g} minutes",
        tab=tab,
        tabs=_TABS,
        signed=_signed,
        span=_span,
        mode_span=_mode_span,
        x=_x,
        three_digits=_three_digits,
        **values,
    )


def _worst_corner(state: VehicleState) -> str:
    """Return the corner with the largest change that an alert names, or the first one."""
    named = [part for part in state.parts if part.alert is not None]
    worst = max(named or state.parts[:1], key=lambda part: abs(part.change), default=None)
    return "" if worst is None else worst.corner


def _plan(parts: tuple[PartState, ...]) -> list[dict[str, list[PartState]]]:
    """Return the parts by axle from front to rear, and there by side."""
    axles: dict[str, dict[str, list[PartState]]] = {}
    for part in parts:
        component = Component.parse(part.part)
        if component.side is not None:
            axles.setdefault(component.axle, {"left": [], "right": []})[component.side].append(part)
    return list(axles.values())


def _axis(parts: Sequence[PartState | PartChange]) -> int:
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


def _windows(entries: list[Entry]) -> list[dict[str, Any]]:
    """Return what a list shows of windows, the newest first."""
    rows = []
    for entry, observation in reversed(observations_of(entries)):
        conditions = observation.conditions
        faults = ", ".join(f"{fault.channel} {fault.kind.replace('_', ' ')}" for fault in observation.sensor_faults)
        rows.append(
            {
                "place": f"{entry.boot}/{entry.number}",
                "t0": entry.t0,
                "speed": conditions.get("speed"),
                "payload": conditions.get("payload"),
                "modes": observation.modes,
                "remark": observation.reason or faults,
                "is_conclusive": observation.is_conclusive,
            }
        )
    return rows
