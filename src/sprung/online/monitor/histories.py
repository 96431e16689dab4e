"""What the store holds of a vehicle, as values: its state, its history, and what the analysis continues from."""

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Real
from sprung.diagnosis import Baseline, Diagnosis, Observation
from sprung.errors import FormatError, ParameterError, SprungError
from sprung.online.monitor.assessment import History
from sprung.online.monitor.events import MonitorSettings
from sprung.online.monitor.jobs import Opening, open_monitor
from sprung.online.monitor.site import Site
from sprung.online.store import (
    BaselineRow,
    Entry,
    HistoryRow,
    QuarantineRow,
    Store,
    VehicleRow,
    VerdictRow,
)
from sprung.online.store.schema import DAY
from sprung.results.documents import baseline_from_document, observation_from_document
from sprung.results.tables.wording import Period
from sprung.state import (
    LAST_WINDOWS,
    WINDOWS_SINCE_ONSET,
    AlertState,
    AssessedWindow,
    Conclusion,
    Reference,
    VehicleState,
    VehicleStatus,
    state_of,
)

#: Requests that change the baseline of a vehicle: learn a new one, and return to an earlier one.
LEARN = "learn"
#: Entry of the audit trail that states the mileage of a vehicle [km].
MILEAGE = "mileage"
ROLL_BACK = "roll back"
#: Age of the last message of a parked vehicle after which it says nothing about the present [ns].
_PARKED = DAY
#: Windows without an alert that are looked through, of which some are inconclusive.
_LOOKED_THROUGH = 2 * LAST_WINDOWS
#: Largest number of windows, and of findings, the last ones of a period: ten minutes each, 69 days.
_MAX_WINDOWS = 10_000


def require_vehicle(store: Store, vehicle: str) -> VehicleRow:
    """Return a vehicle as it described itself.

    Raises
    ------
    ParameterError
        If the vehicle is unknown.
    """
    row = store.inbox.vehicle(vehicle)
    if row is None:
        raise ParameterError(f"unknown vehicle {vehicle!r}: see the list of vehicles (sprung vehicles)")
    return row


def vehicle_state(
    store: Store,
    vehicle: str,
    *,
    now: int,
    silent_after: float = Site().alerts.silent_after_minutes,
    last_seen: int = 0,
    is_parked: bool = False,
    alerts: Sequence[AlertState] | None = None,
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
    if alerts is None:
        alerts = store.alerts.find(vehicle=vehicle, is_active=True)
    stored = store.results.status(vehicle)
    limit = WINDOWS_SINCE_ONSET if any(alert.is_of_suspension for alert in alerts) else _LOOKED_THROUGH
    entries = store.results.observations(vehicle, since=period.since, until=period.until, limit=limit)
    return state_of(
        vehicle,
        [AssessedWindow(entry.t0, window, _conclusion(entry)) for entry, window in observations_of(entries)],
        reference_of(store.results.baselines(vehicle) if baselines is None else baselines),
        alerts,
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


def _conclusion(entry: Entry) -> Conclusion | None:
    """Return what the diagnosis after a window says; None without one."""
    stored = entry.document.get("conclusion")
    return None if stored is None else Conclusion(**stored)


@dataclass(frozen=True, eq=False, slots=True)
class AlertHistory:
    """An alert with what happened to it.

    Parameters
    ----------
    alert
        Alert as it is now.
    history
        Its events, the oldest first.
    verdicts
        Findings of the workshop, oldest first.
    """

    alert: AlertState
    history: tuple[HistoryRow, ...]
    verdicts: tuple[VerdictRow, ...]

    @property
    def spans(self) -> list[tuple[int, int | None]]:
        """Begin and end (UTC ns; None: still active) of each time that its cause lasted, as far as its history goes.

        The last one begins at the onset, where the evidence has it: samples may be older than the alert by any time.
        """
        spans: list[tuple[int, int | None]] = []
        for event in self.history:
            is_open = bool(spans) and spans[-1][1] is None
            if event.what == "raised" and not is_open:
                spans.append((event.time, None))
            elif event.what == "cleared" and is_open:
                spans[-1] = (spans[-1][0], event.time)
        spans = spans or [(self.alert.raised, None if self.alert.is_active else self.alert.cleared)]
        begin, end = spans.pop()
        return [*spans, (min(begin, self.alert.onset or begin), end)]

    def is_active_at(self, time: int | None) -> bool:
        """Return whether it was active at a time, UTC ns; None: now."""
        if time is None:
            return self.alert.is_active
        return any(begin <= time and (end is None or end > time) for begin, end in self.spans)


class Deviations(NamedTuple):
    """Deviation of windows from their baselines.

    Parameters
    ----------
    baseline
        Last baseline.
    times
        Start of each window, UTC ns, shape (windows,).
    log_ratios, std
        ln(value / baseline) under the conditions of each window, and its standard deviation, shape (windows,
        components).
    """

    baseline: Baseline
    times: NDArray[np.int64]
    log_ratios: Real
    std: Real


@dataclass(frozen=True, eq=False, slots=True)
class VehicleHistory:
    """Stored results of a vehicle and period.

    Parameters
    ----------
    vehicle
        The vehicle as it described itself.
    period
        Period.
    times
        Start of each window, UTC ns, shape (windows,).
    windows
        Windows, the last 10,000 of the period.
    n_earlier, n_unreadable
        Number of windows before these, and of those whose documents cannot be read.
    findings
        Findings after each window.
    modes
        Last identified modes; None without any.
    baselines
        Baselines of the vehicle up to the end of the period; each with None if its document cannot be read.
    alerts
        Alerts that were active in the period, the most severe first.
    state
        State at the end of the period.
    status
        Progress of the analysis; None before the first.
    quarantined
        Frames and states of the vehicle that were quarantined in the period.
    diagnosis
        Present diagnosis, where the period reaches to it; None without one.
    """

    vehicle: VehicleRow
    period: Period
    times: NDArray[np.int64]
    windows: tuple[Observation, ...]
    n_earlier: int
    n_unreadable: int
    findings: tuple[Entry, ...]
    modes: Entry | None
    baselines: tuple[tuple[BaselineRow, Baseline | None], ...]
    alerts: tuple[AlertHistory, ...]
    state: VehicleState
    status: VehicleStatus | None
    quarantined: tuple[QuarantineRow, ...]
    diagnosis: Diagnosis | None

    @property
    def baseline(self) -> Baseline | None:
        """Last baseline of the period; None if there is none that can be read."""
        return next((baseline for _, baseline in reversed(self.baselines) if baseline is not None), None)

    def baseline_of(self, window: Observation) -> Baseline | None:
        """Return the baseline that a window is compared with: the last one whose learning had begun, or the first."""
        readable = [baseline for _, baseline in self.baselines if baseline is not None]
        begun = [
            baseline
            for baseline in readable
            if not baseline.learning_times or min(baseline.learning_times) <= window.time
        ]
        return begun[-1] if begun else readable[0] if readable else None

    def deviations(self) -> Deviations | None:
        """Return the deviation of each comparable window from its baseline; None without any."""
        last = self.baseline
        if last is None:
            return None
        kept, rows = [], []
        for number, window in enumerate(self.windows):
            baseline = self.baseline_of(window)
            if baseline is not None and baseline.components == last.components and baseline.accepts(window):
                kept.append(number)
                rows.append((baseline.residual(window), np.sqrt(np.diag(window.covariance))))
        if not kept:
            return None
        values = np.array(rows)
        return Deviations(last, self.times[kept], values[:, 0], values[:, 1])


def read_history(store: Store, vehicle: str, period: Period, *, now: int) -> VehicleHistory:
    """Return the stored results of a vehicle and period.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    period
        Period.
    now
        Present time, UTC ns.

    Raises
    ------
    ParameterError
        If the vehicle is unknown.
    StoreError
        If the store cannot be read.
    """
    row, results, until = require_vehicle(store, vehicle), store.results, period.until
    windows: deque[tuple[int, Observation]] = deque(maxlen=_MAX_WINDOWS)
    n_stored = n_read = 0
    for piece in results.pieces("observations", vehicle, since=period.since, until=until):
        read = [(entry.t0, window) for entry, window in observations_of(piece)]
        windows.extend(read)
        n_stored += len(piece)
        n_read += len(read)
    status = results.status(vehicle)
    baselines = [
        (each, baseline)
        for each, baseline in ((each, _read_baseline(each)) for each in results.baselines(vehicle))
        if until is None
        or (1e9 * min(baseline.learning_times) if baseline and baseline.learning_times else each.created) <= until
    ]
    alerts = alerts_of(store, vehicle, period)
    state = vehicle_state(
        store,
        vehicle,
        now=now,
        last_seen=row.last_seen,
        is_parked=row.is_parked,
        alerts=[each.alert for each in alerts if each.is_active_at(until)],
        baselines=[each for each, _ in baselines],
        period=period,
    )
    return VehicleHistory(
        vehicle=row,
        period=period,
        times=np.array([time for time, _ in windows], dtype=np.int64),
        windows=tuple(window for _, window in windows),
        n_earlier=n_read - len(windows),
        n_unreadable=n_stored - n_read,
        findings=tuple(results.findings(vehicle, since=period.since, until=until, limit=_MAX_WINDOWS)),
        modes=next(iter(results.modes(vehicle, since=period.since, until=until, limit=1)), None),
        baselines=tuple(baselines),
        alerts=tuple(alerts),
        state=state,
        status=None if status is None else VehicleStatus(**status),
        quarantined=tuple(each for each in store.quarantine.find(vehicle) if period.overlaps(each.stored, each.stored)),
        diagnosis=_present(store, vehicle) if until is None or until >= row.last_seen else None,
    )


def _read_baseline(row: BaselineRow) -> Baseline | None:
    """Return a stored baseline; None if another program wrote it in another form."""
    try:
        return baseline_from_document(row.document)
    except FormatError:
        return None


def _present(store: Store, vehicle: str) -> Diagnosis | None:
    """Return the present diagnosis, where the state can be read."""
    try:
        present = assessed(store, vehicle)
    except (SprungError, ValueError, OSError):
        return None
    return None if present is None else present[0]


def alerts_of(store: Store, vehicle: str, period: Period) -> list[AlertHistory]:
    """Return the alerts of a vehicle that were active in a period, the most severe first."""
    states = [alert for alert in store.alerts.find(vehicle=vehicle) if alert.count]
    verdicts = store.verdicts.all(alerts=[alert.number for alert in states])
    alerts = [
        AlertHistory(
            alert,
            tuple(store.alerts.history(alert.number)),
            tuple(verdict for verdict in verdicts if verdict.alert == alert.number),
        )
        for alert in states
    ]
    return [alert for alert in alerts if any(period.overlaps(begin, end) for begin, end in alert.spans)]


def assessed(store: Store, vehicle: str) -> tuple[Diagnosis, Baseline | None] | None:
    """Return the last diagnosis of a vehicle and its baseline; None without a change test."""
    row, snapshot = store.inbox.vehicle(vehicle), store.results.snapshot(vehicle)
    if row is None or snapshot is None:
        return None
    opening = Opening(vehicle, row.description, dict(row.channels), snapshot.document, MonitorSettings())
    monitor, _ = open_monitor(opening)
    if monitor.diagnosis is None or monitor.diagnosis.detection is None:
        return None
    return monitor.diagnosis, None if monitor.is_learning else monitor.baseline


def history_of(store: Store, vehicle: str, *, max_windows: int) -> History:
    """Return the stored results of a vehicle, with a limited number of last windows since its baseline.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    max_windows
        Largest number of windows.

    Raises
    ------
    StoreError
        If the store cannot be read.
    """
    results = store.results
    n_windows, n_identified = results.n_numbered(vehicle)
    if not n_windows:  # modes before the first window are identified again, with the same numbers
        return History()
    baselines = results.baselines(vehicle)
    if not baselines:
        return History(n_windows=n_windows, n_identified=n_identified)
    baseline = baselines[-1].document
    learning_times = max(baseline.get("learning_times") or [float("inf")])
    documents = [entry.document for entry in results.observations(vehicle, limit=max_windows)]
    status = results.status(vehicle) or {}
    requests = reversed(store.requests.audited(act=LEARN, limit=1000))
    reason = next((str(row.detail) for row in requests if row.subject == vehicle and row.detail), "maintenance")
    return History(
        baseline,
        tuple(document for document in documents if document["time"] > learning_times),
        n_windows,
        n_identified,
        reason if status.get("is_learning") else "",
    )


def driven_since(store: Store, vehicle: str, time: int, *, limit: int) -> float | None:
    """Return the way driven since a time [UTC ns] in windows that state a speed [m]; None without any."""
    entries = store.results.observations(vehicle, since=time, limit=limit)
    length = float((store.results.status(vehicle) or {}).get("window") or MonitorSettings().window)
    speeds = [window.conditions["speed"] for _, window in observations_of(entries) if "speed" in window.conditions]
    return length * sum(speeds) if speeds else None


def odometer_of(store: Store, vehicle: str, *, limit: int) -> tuple[int, float] | None:
    """Return the last window [UTC ns] with a reading of the odometer, and the reading [km]; None without any."""
    read = observations_of(store.results.observations(vehicle, limit=limit))
    readings = [(entry.t0, window.conditions["mileage"]) for entry, window in read if "mileage" in window.conditions]
    return readings[-1] if readings else None


def mileage_of(store: Store, vehicle: str, *, limit: int) -> float | None:
    """Return the mileage of a vehicle [km]; None if it is unknown.

    It is the last reading of the odometer, else that stated last; and the way since in windows.
    """
    reading = odometer_of(store, vehicle, limit=limit)
    if reading is not None:
        time, mileage = reading
        return mileage + (driven_since(store, vehicle, time + 1, limit=limit) or 0.0) / 1000
    stated = [row for row in store.requests.audited(act=MILEAGE) if row.subject == vehicle]
    if not stated:
        return None
    return float(stated[-1].detail) + (driven_since(store, vehicle, stated[-1].time, limit=limit) or 0.0) / 1000


def restored_baseline(store: Store, vehicle: str, *, version: int, reason: str) -> Baseline:
    """Return an earlier baseline of a vehicle as its next version.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    version
        Version of the earlier baseline.
    reason
        Reason for using it again.

    Raises
    ------
    ParameterError
        If the vehicle has no such baseline, or it cannot be read.
    """
    rows = store.results.baselines(vehicle)
    document = next((row.document for row in rows if row.version == version), None)
    if document is None:
        known = ", ".join(str(row.version) for row in rows) or "none"
        raise ParameterError(f"{vehicle} has no baseline {version}: it has {known}")
    try:
        baseline = baseline_from_document(document)
    except FormatError as error:
        raise ParameterError(f"baseline {version} of {vehicle} cannot be read ({error}): learn a new one") from None
    return replace(baseline, version=rows[-1].version + 1, reason=f"baseline {version} again: {reason}")
