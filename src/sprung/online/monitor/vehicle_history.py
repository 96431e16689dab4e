"""Stored results of a vehicle and period, as values."""

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Real
from sprung.diagnosis import Baseline, Diagnosis, Observation
from sprung.errors import FormatError, ParameterError, SprungError
from sprung.online.monitor.pictures import assessed
from sprung.online.monitor.vehicle_states import alert_state, vehicle_state
from sprung.online.store import AlertRow, AsideRow, BaselineRow, Entry, HistoryRow, Store, VehicleRow, VerdictRow
from sprung.results.documents import baseline_from_document, observation_from_document
from sprung.results.periods import Period
from sprung.state import AlertState, VehicleState, VehicleStatus

#: Largest number of windows, and of findings, the last ones of a period: ten minutes each, 69 days.
_MOST = 10_000


@dataclass(frozen=True, slots=True)
class AlertHistory:
    """An alert with what happened to it.

    Parameters
    ----------
    row
        Alert as it is now.
    events
        Its history, oldest event first.
    verdicts
        Findings of the workshop, oldest first.
    """

    row: AlertRow
    events: tuple[HistoryRow, ...]
    verdicts: tuple[VerdictRow, ...]

    @property
    def state(self) -> AlertState:
        """Alert as it is now, with the facts of its finding."""
        return alert_state(self.row)

    @property
    def spans(self) -> list[tuple[int, int | None]]:
        """Begin and end (UTC ns; None: still active) of each time that its cause lasted, as far as its history goes.

        The last one begins at the onset, where the evidence has it: samples may be older than the alert by any time.
        """
        spans: list[tuple[int, int | None]] = []
        for event in self.events:
            is_open = bool(spans) and spans[-1][1] is None
            if event.what == "raised" and not is_open:
                spans.append((event.time, None))
            elif event.what == "cleared" and is_open:
                spans[-1] = (spans[-1][0], event.time)
        spans = spans or [(self.row.raised, None if self.row.is_active else self.row.cleared)]
        onset = self.state.onset
        begin, end = spans.pop()
        return [*spans, (begin if onset is None else min(begin, onset), end)]

    def is_active_at(self, time: int | None) -> bool:
        """Return whether it was active at a time, UTC ns; None: now."""
        if time is None:
            return self.row.is_active
        return any(begin <= time and (end is None or end > time) for begin, end in self.spans)


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
    aside
        Frames and states of the vehicle that were set aside in the period.
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
    aside: tuple[AsideRow, ...]
    diagnosis: Diagnosis | None

    @property
    def baseline(self) -> Baseline | None:
        """Last baseline of the period; None if there is none that can be read."""
        return next((baseline for _, baseline in reversed(self.baselines) if baseline is not None), None)

    def baseline_of(self, window: Observation) -> Baseline | None:
        """Return the baseline that a window is compared with: the last one whose learning had begun, or the first."""
        readable = [baseline for _, baseline in self.baselines if baseline is not None]
        begun = [one for one in readable if not one.learning_times or min(one.learning_times) <= window.time]
        return begun[-1] if begun else readable[0] if readable else None

    def deviations(self) -> "Deviations | None":
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


@dataclass(frozen=True, eq=False, slots=True)
class Deviations:
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
    row = store.inbox.vehicle(vehicle)
    if row is None:
        raise ParameterError(f"unknown vehicle {vehicle!r}: sprung vehicles lists the known ones")
    results = store.results
    windows: deque[tuple[int, Observation]] = deque(maxlen=_MOST)
    n_read = n_unreadable = 0
    for piece in results.pieces("observations", vehicle, since=period.since, until=period.until):
        for entry in piece:
            try:
                windows.append((entry.t0, observation_from_document(entry.document)))
                n_read += 1
            except FormatError:
                n_unreadable += 1
    status = results.status(vehicle)
    baselines, alerts = _baselines(store, vehicle, period), alerts_of(store, vehicle, period)
    state = vehicle_state(
        store,
        vehicle,
        now=now,
        last_seen=row.last_seen,
        is_parked=row.is_parked,
        alerts=[alert.row for alert in alerts if alert.is_active_at(period.until)],
        baselines=[each for each, _ in baselines],
        period=period,
    )
    last = results.modes(vehicle, since=period.since, until=period.until, limit=1)
    return VehicleHistory(
        row,
        period,
        np.array([time for time, _ in windows], dtype=np.int64),
        tuple(window for _, window in windows),
        n_read - len(windows),
        n_unreadable,
        tuple(results.findings(vehicle, since=period.since, until=period.until, limit=_MOST)),
        last[0] if last else None,
        tuple(baselines),
        tuple(alerts),
        state,
        None if status is None else VehicleStatus(**status),
        tuple(each for each in store.aside.find(vehicle) if period.overlaps(each.stored, each.stored)),
        _present(store, vehicle, period, row),
    )


def _baselines(store: Store, vehicle: str, period: Period) -> list[tuple[BaselineRow, Baseline | None]]:
    """Return the baselines whose learning had begun before the end of a period."""
    read = [(row, _read_baseline(row.document)) for row in store.results.baselines(vehicle)]
    until = period.until
    return [
        (row, baseline)
        for row, baseline in read
        if until is None
        or (1e9 * min(baseline.learning_times) if baseline and baseline.learning_times else row.created) <= until
    ]


def _read_baseline(document: Mapping[str, object]) -> Baseline | None:
    """Return the baseline of a document; None if another program wrote it in another form."""
    try:
        return baseline_from_document(document)
    except FormatError:
        return None


def alerts_of(store: Store, vehicle: str, period: Period) -> list[AlertHistory]:
    """Return the alerts of a vehicle that were active in a period, the most severe first."""
    rows = [row for row in store.alerts.find(vehicle=vehicle) if row.count and row.id is not None]
    verdicts = store.verdicts.all(alerts=[row.id for row in rows if row.id is not None])
    alerts = [
        AlertHistory(
            row,
            tuple(store.alerts.history(row.id or 0)),
            tuple(verdict for verdict in verdicts if verdict.alert == row.id),
        )
        for row in rows
    ]
    return [alert for alert in alerts if any(period.overlaps(begin, end) for begin, end in alert.spans)]


def _present(store: Store, vehicle: str, period: Period, row: VehicleRow) -> Diagnosis | None:
    """Return the present diagnosis, where a period reaches to it and the state can be read."""
    if period.until is not None and period.until < row.last_seen:
        return None
    try:
        present = assessed(store, vehicle)
    except (SprungError, ValueError, OSError):
        return None
    return None if present is None else present[0]
