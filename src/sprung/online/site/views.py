"""Contents of pages and interface, from the store: values, no markup."""

from collections.abc import Sequence

from sprung.errors import ParameterError
from sprung.online.alerts import STEPS
from sprung.online.monitor.histories import alert_state, vehicle_state
from sprung.online.site.context import Context
from sprung.online.site.models import (
    AlertDetail,
    BaselineEntry,
    FleetPage,
    FleetVehicle,
    VehicleDetail,
    VerdictEntry,
    WindowEntry,
    WindowPage,
)
from sprung.online.store import AlertRow, Entry, FleetFilter, FleetRow, Place
from sprung.results.documents.monitoring import AlertEntry, HistoryEntry
from sprung.state import VehicleState

#: Pattern of the place after which a page of the fleet begins.
CURSOR = r"^[0-9]{1,4}~[0-9]{1,4}[.][0-9]{1,20}~.{1,64}$"

#: Beginning of the causes of alerts about sensors.
_SENSOR = "sensor:"


def fleet_filter(
    context: Context,
    *,
    text: str = "",
    step: Sequence[str] = (),
    assignee: str | None = None,
    is_unacknowledged: bool = False,
    is_learning: bool = False,
    is_silent: bool = False,
) -> FleetFilter:
    """Return the filter for names of steps; any other name than those of steps is that of no alert."""
    steps = [STEPS.index(name) if name in STEPS else -1 for name in step]
    return FleetFilter(
        text, steps, assignee, is_unacknowledged, is_learning, context.silent_before if is_silent else None
    )


def fleet_page(context: Context, wanted: FleetFilter, *, cursor: str | None, limit: int) -> FleetPage:
    """Return vehicles in order of urgency, from a cursor on."""
    store = context.store
    rows = store.fleet.page(wanted, after=None if cursor is None else _place(cursor), limit=limit + 1)
    shown = rows[:limit]
    alerts = store.alerts.of_vehicles([row.place.vehicle for row in shown])
    states = [state_of_row(context, row, alerts.get(row.place.vehicle, [])) for row in shown]
    vehicles = tuple(map(_fleet_vehicle, shown, states))
    return FleetPage(vehicles=vehicles, next=_cursor(shown[-1].place) if len(rows) > limit else None)


def vehicle_detail(context: Context, vehicle: str) -> tuple[VehicleDetail, VehicleState]:
    """Return what is known about a vehicle, and its state.

    Raises
    ------
    ParameterError
        If it is unknown.
    """
    store = context.store
    known = store.inbox.vehicle(vehicle)
    if known is None:
        raise ParameterError(f"unknown vehicle {vehicle!r}: the fleet lists the known ones")
    active = store.alerts.find(vehicle=vehicle, is_active=True)
    baselines = store.results.baselines(vehicle)
    row = FleetRow(
        Place(max((alert.severity for alert in active), default=0), 0.0, vehicle),
        known.last_seen,
        known.is_parked,
        baselines[-1].version if baselines else None,
        store.results.status(vehicle),
        len(known.channels),
    )
    state = state_of_row(context, row, active)
    detail = VehicleDetail(
        summary=_fleet_vehicle(row, state),
        channels=tuple(dict(known.channels)),
        first_seen=known.first_seen,
        configuration=known.configuration,
        alerts=tuple(AlertEntry(**alert.as_entry()) for alert in state.alerts),
        baselines=tuple(
            BaselineEntry(
                version=each.version,
                created=each.created,
                reason=each.reason,
                windows=each.document.get("n_windows"),
            )
            for each in reversed(baselines)
        ),
        windows=store.results.n_observations(vehicle),
    )
    return detail, state


def window_page(entries: list[Entry], *, limit: int) -> WindowPage:
    """Return windows in order of time, of one more than `limit` the newest."""
    shown = entries[-limit:]
    windows = tuple(
        WindowEntry(boot=entry.boot, number=entry.number, t0=entry.t0, document=entry.document) for entry in shown
    )
    return WindowPage(windows=windows, next=shown[0].t0 - 1 if len(entries) > limit else None)


def alert_detail(context: Context, number: int) -> AlertDetail:
    """Return an alert with its evidence, history and verdicts.

    Raises
    ------
    ParameterError
        If no alert has that number.
    """
    store = context.store
    row = store.alerts.row(number)
    if row is None:
        raise ParameterError(f"unknown alert {number}: see the list of alerts")
    state = alert_state(row)
    return AlertDetail(
        alert=AlertEntry(**state.as_entry()),
        evidence=dict(state.evidence),
        history=tuple(HistoryEntry.model_validate(each, from_attributes=True) for each in store.alerts.history(number)),
        verdicts=tuple(VerdictEntry.model_validate(each) for each in store.verdicts.all(alerts=[number])),
    )


def state_of_row(context: Context, row: FleetRow, active: list[AlertRow]) -> VehicleState:
    """Return the state of a vehicle of the fleet."""
    return vehicle_state(
        context.store,
        row.place.vehicle,
        now=context.clock(),
        silent_after=context.site.alerts.silent_after_minutes,
        last_seen=row.last_seen,
        is_parked=row.is_parked,
        alerts=[alert_state(each) for each in active],
    )


def _fleet_vehicle(row: FleetRow, state: VehicleState) -> FleetVehicle:
    """Return a vehicle in the fleet."""
    worst = state.worst
    sensors = (alert.cause for alert in state.alerts if alert.cause.startswith(_SENSOR))
    return FleetVehicle(
        vehicle=state.vehicle,
        verdict=state.verdict,
        severity=state.severity,
        step=state.step,
        alert=None if worst is None else worst.number,
        sentence=state.sentence,
        since=None if worst is None else worst.raised,
        health_index=state.health_index,
        channels=row.n_channels,
        failing=tuple(cause.removeprefix(_SENSOR) for cause in sensors),
        has_lost=any(alert.cause == "lost" for alert in state.alerts),
        last_seen=state.last_seen,
        is_parked=row.is_parked,
        is_old=state.is_old,
        windows_learnt=state.windows_learnt,
        windows_needed=state.windows_needed,
        baseline=row.baseline,
        assignee=None if worst is None else worst.assignee,
        alert_state=None if worst is None else worst.state,
    )


def _cursor(place: Place) -> str:
    """Return the text of a place."""
    return f"{place.severity}~{place.impact!r}~{place.vehicle}"


def _place(cursor: str) -> Place:
    """Return the place of a text.

    Raises
    ------
    ParameterError
        If it is no cursor.
    """
    severity, _, rest = cursor.partition("~")
    impact, _, vehicle = rest.partition("~")
    try:
        return Place(int(severity), float(impact), vehicle)
    except ValueError:
        raise ParameterError(f"cursor {cursor!r} is not one of this list: omit it for the first page") from None
