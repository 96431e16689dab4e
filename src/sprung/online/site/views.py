"""Contents of pages and interface, from the store: values, no markup."""

from collections.abc import Sequence

from sprung.errors import ParameterError
from sprung.online.alerts import STEPS, health_index, severity_step, state_name
from sprung.online.monitor import VehicleStatus, alert_of
from sprung.online.monitor.desk import alert_entry
from sprung.online.site.context import Context
from sprung.online.site.models import (
    AlertDetail,
    BaselineEntry,
    FleetPage,
    FleetVehicle,
    VehicleDetail,
    VehicleState,
    VerdictEntry,
    WindowEntry,
    WindowPage,
)
from sprung.online.store import AlertRow, Entry, FleetFilter, FleetRow, Place
from sprung.results.documents.monitoring import AlertEntry, HistoryEntry

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
    vehicles = tuple(_fleet_vehicle(context, row, alerts.get(row.place.vehicle, [])) for row in shown)
    return FleetPage(vehicles=vehicles, next=_cursor(shown[-1].place) if len(rows) > limit else None)


def vehicle_detail(context: Context, vehicle: str) -> VehicleDetail:
    """Return what is known about a vehicle.

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
    return VehicleDetail(
        summary=_fleet_vehicle(context, row, active),
        channels=tuple(dict(known.channels)),
        first_seen=known.first_seen,
        configuration=known.configuration,
        alerts=tuple(_alert(alert) for alert in active),
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
    return AlertDetail(
        alert=_alert(row),
        evidence=alert_of(row).evidence,
        history=tuple(HistoryEntry.model_validate(each, from_attributes=True) for each in store.alerts.history(number)),
        verdicts=tuple(VerdictEntry.model_validate(each) for each in store.verdicts.all(alerts=[number])),
    )


def _alert(row: AlertRow) -> AlertEntry:
    """Return an alert as in `sprung.alerts/1`."""
    return AlertEntry(**alert_entry(row))


def _fleet_vehicle(context: Context, row: FleetRow, active: list[AlertRow]) -> FleetVehicle:
    """Return a vehicle in the fleet; old data never look healthy."""
    status = None if row.status is None else VehicleStatus(**row.status)
    is_old = context.is_old(row.last_seen, is_parked=row.is_parked)
    worst = max(active, key=lambda alert: (alert.severity, -alert.raised), default=None)
    state, sentence = _state(row, status, worst, is_old=is_old)
    is_known = not is_old and row.baseline is not None and (status is None or not (status.note or status.is_learning))
    return FleetVehicle(
        vehicle=row.place.vehicle,
        state=state,
        severity=0 if worst is None else worst.severity,
        step=None if worst is None else STEPS[severity_step(worst.severity)],
        alert=None if worst is None else worst.id,
        sentence=sentence,
        since=None if worst is None else worst.raised,
        health_index=health_index(map(alert_of, active)) if is_known else None,
        channels=row.n_channels,
        failing=tuple(alert.cause.removeprefix(_SENSOR) for alert in active if alert.cause.startswith(_SENSOR)),
        has_lost=any(alert.cause == "lost" for alert in active),
        last_seen=row.last_seen,
        is_parked=row.is_parked,
        is_old=is_old,
        learnt=None if status is None else status.n_learnt,
        needed=None if status is None else status.n_needed,
        baseline=row.baseline,
        assignee=None if worst is None else worst.assignee,
        alert_state=None if worst is None else state_name(alert_of(worst)),
    )


def _state(
    row: FleetRow, status: VehicleStatus | None, worst: AlertRow | None, *, is_old: bool
) -> tuple[VehicleState, str]:
    """Return what matters most about a vehicle, in a word and in a sentence."""
    if worst is not None:
        return "silent" if worst.cause == "silent" else "alert", worst.text
    if is_old and not row.is_parked:
        return "silent", f"{row.place.vehicle} sends no data"
    if status is None:
        return "waiting", "no samples analysed yet"
    state: VehicleState = "inconclusive" if status.note else "no change detected"
    sentence = status.in_words or "no change detected"
    if is_old:
        return "parked", f"parked; until then {sentence}"
    return "learning" if status.is_learning else state, sentence


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
