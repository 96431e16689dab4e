"""States of vehicles and alerts from the store, see `sprung.state`."""

from collections.abc import Iterable, Sequence

from sprung.diagnosis import Observation
from sprung.errors import FormatError
from sprung.online.monitor.alert_book import alert_of
from sprung.online.monitor.site import Site
from sprung.online.store import AlertRow, BaselineRow, Entry, Store
from sprung.results.documents import baseline_from_document, observation_from_document
from sprung.results.periods import Period
from sprung.state import (
    LAST_WINDOWS,
    WINDOWS_SINCE_ONSET,
    AlertState,
    Reference,
    VehicleState,
    VehicleStatus,
    is_of_suspension,
    state_of,
)

#: Age of the last message of a parked vehicle after which it says nothing about the present [ns].
_PARKED = 86400 * 10**9
#: Windows without an alert that are looked through, of which some are inconclusive.
_LOOKED_THROUGH = 2 * LAST_WINDOWS


def alert_state(row: AlertRow) -> AlertState:
    """Return the state of a stored alert."""
    return alert_of(row).as_state(row.id or 0)


def vehicle_state(
    store: Store,
    vehicle: str,
    *,
    now: int,
    silent_after: float = Site().alerts.silent_after_minutes,
    last_seen: int = 0,
    is_parked: bool = False,
    alerts: Iterable[AlertRow] | None = None,
    baselines: Sequence[BaselineRow] | None = None,
    period: Period | None = None,
) -> VehicleState:
    """Return the state of a vehicle.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    now
        Present time, UTC ns.
    silent_after
        Time without messages after which a vehicle is silent [min].
    last_seen, is_parked
        Time of its last message, UTC ns, and whether it was shut down properly.
    alerts
        Its active alerts, where they are known already.
    baselines
        Its baselines, where they are known already.
    period
        Period of the windows; one with an end is about that time and not about the present.
    """
    period = period or Period()
    is_past = period.until is not None
    rows = list(store.alerts.find(vehicle=vehicle, is_active=True) if alerts is None else alerts)
    stored = store.results.status(vehicle)
    limit = WINDOWS_SINCE_ONSET if any(is_of_suspension(row.cause) for row in rows) else _LOOKED_THROUGH
    entries = store.results.observations(vehicle, since=period.since, until=period.until, limit=limit)
    return state_of(
        vehicle,
        [(entry.t0, window) for entry, window in observations_of(entries)],
        reference_of(store.results.baselines(vehicle) if baselines is None else baselines),
        [alert_state(row) for row in rows],
        status=None if stored is None else VehicleStatus(**stored),
        is_past=is_past,
        n_on_board=0 if entries else sum(bool(row.document.get("is_on_board")) for row in store.results.modes(vehicle)),
        last_seen=last_seen,
        is_old=not is_past and last_seen < now - (_PARKED if is_parked else round(60e9 * silent_after)),
        is_parked=is_parked,
    )


def reference_of(baselines: Sequence[BaselineRow]) -> Reference:
    """Return what the windows of a vehicle are compared with: the last of its baselines."""
    if not baselines:
        return Reference(None, notes=("no baseline yet: values are relative to the vehicle file, and not assessed",))
    document = baselines[-1].document
    try:
        baseline = baseline_from_document(document)
    except FormatError as error:
        reason = f"the baseline cannot be read: {error}"
        return Reference(None, notes=(f"{reason}; values are relative to the vehicle file",), absence=reason)
    limits = {int(count): losses for count, losses in document.get("detectable", {}).items()}
    return Reference(baseline, limits, baseline.notes)


def observations_of(entries: Iterable[Entry]) -> list[tuple[Entry, Observation]]:
    """Return the observations of windows; those that cannot be read are left out."""
    read = []
    for entry in entries:
        try:
            read.append((entry, observation_from_document(entry.document)))
        except FormatError:
            continue
    return read
