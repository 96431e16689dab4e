"""The report of a vehicle and period as a document, `sprung.report/1`."""

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from sprung.diagnosis import Observation
from sprung.online.monitor.vehicle_history import AlertHistory, VehicleHistory
from sprung.results.documents import ReportDocument
from sprung.results.documents.monitoring import BodyModeEntry, ChangeEntry, FaultEntry, RangeEntry, ReportedAlert
from sprung.state import PartState


def report_document(history: VehicleHistory, *, now: int) -> ReportDocument:
    """Return the report of a vehicle and period as `sprung.report/1`.

    Parameters
    ----------
    history
        Stored results of the vehicle and period.
    now
        Present time, UTC ns.
    """
    usable = [window for window in history.windows if window.is_conclusive]
    state = history.state
    is_compared = state.baseline is not None
    return ReportDocument.model_validate(
        {
            "schema": "sprung.report/1",
            "vehicle": history.vehicle.vehicle,
            "since": history.period.since,
            "until": history.period.until,
            "written": now,
            "verdict": state.verdict,
            "sentence": state.sentence,
            "windows": len(history.windows),
            "usable": len(usable),
            "baseline": state.baseline,
            "changes": tuple(map(_change, state.parts)) if is_compared else (),
            "changes_since": state.since if is_compared else None,
            "modes": _modes(usable),
            "conditions": _conditions(history.windows),
            "sensor_faults": _faults(history),
            "reasons": dict(Counter(window.reason for window in history.windows if window.reason).most_common()),
            "alerts": tuple(map(_alert, history.alerts)),
        }
    )


def _change(part: PartState) -> ChangeEntry:
    """Return the change of a component."""
    return ChangeEntry(
        component=part.part,
        change=part.change,
        interval=part.interval,
        interval_with_common=part.interval_with_common,
        detectable=part.detectable,
    )


def _modes(usable: Sequence[Observation]) -> dict[str, BodyModeEntry]:
    """Return the body modes over the windows."""
    modes: dict[str, list[tuple[float, float]]] = {}
    for window in usable:
        for label, values in window.modes.items():
            modes.setdefault(label, []).append(values)
    return {
        label: BodyModeEntry(
            windows=len(values),
            natural_frequency=_range(frequency for frequency, _ in values),
            damping_ratio=_range(ratio for _, ratio in values),
        )
        for label, values in modes.items()
    }


def _conditions(windows: Iterable[Observation]) -> dict[str, RangeEntry]:
    """Return the range of each condition that the windows met."""
    met: dict[str, list[float]] = {}
    for window in windows:
        for name, value in window.conditions.items():
            if np.isfinite(value):
                met.setdefault(name, []).append(value)
    return {name: _range(values) for name, values in met.items()}


def _range(values: Iterable[float]) -> RangeEntry:
    """Return lowest, median and highest value."""
    low, median, high = np.quantile(np.fromiter(values, dtype=np.float64), (0.0, 0.5, 1.0)).tolist()
    return RangeEntry(low=low, median=median, high=high)


def _faults(history: VehicleHistory) -> tuple[FaultEntry, ...]:
    """Return each kind of fault of each channel with its windows."""
    faults: dict[tuple[str, str], list[int]] = {}
    for time, window in zip(history.times.tolist(), history.windows, strict=True):
        for channel, kind in dict.fromkeys((fault.channel, fault.kind) for fault in window.sensor_faults):
            faults.setdefault((channel, kind), []).append(time)
    return tuple(
        FaultEntry(channel=channel, kind=kind, windows=len(times), first=times[0], last=times[-1])
        for (channel, kind), times in faults.items()
    )


def _alert(alert: AlertHistory) -> ReportedAlert:
    """Return an alert with its evidence, history and verdicts."""
    fields = {
        "alert": alert.state.as_entry(),
        "cleared": alert.row.cleared,
        "evidence": alert.state.evidence,
        "history": alert.events,
        "verdicts": alert.verdicts,
    }
    return ReportedAlert.model_validate(fields)
