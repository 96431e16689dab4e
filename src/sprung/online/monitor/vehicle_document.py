"""The report of a vehicle and period as a document, `sprung.report/1`."""

from collections import Counter
from collections.abc import Iterable, Sequence

import numpy as np

from sprung.diagnosis import Baseline, Observation, detectable
from sprung.online.alerts import is_of_suspension
from sprung.online.monitor.alert_book import alert_of
from sprung.online.monitor.desk import alert_entry
from sprung.online.monitor.vehicle_history import AlertHistory, VehicleHistory
from sprung.results.documents import ReportDocument
from sprung.results.documents.vehicles import BodyModeEntry, ChangeEntry, FaultEntry, RangeEntry, ReportedAlert
from sprung.results.tables import counted, time_in_words

#: Number of windows in which losses are detectable; half width of a 95 % interval in standard deviations.
N_WINDOWS, _HALF_WIDTH = 12, 1.96
#: Loss that must be detectable for a conclusive result, as in a diagnosis.
_MOST_UNDETECTED = 0.2


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
    changes_since, changes = _changes(history)
    baseline = history.baseline
    return ReportDocument.model_validate(
        {
            "schema": "sprung.report/1",
            "vehicle": history.vehicle.vehicle,
            "since": history.period.since,
            "until": history.period.until,
            "written": now,
            "sentence": _sentence(history, usable, changes),
            "windows": len(history.windows),
            "usable": len(usable),
            "baseline": None if baseline is None else baseline.version,
            "changes": changes,
            "changes_since": changes_since,
            "modes": _modes(usable),
            "conditions": _conditions(history.windows),
            "sensor_faults": _faults(history),
            "reasons": dict(Counter(window.reason for window in history.windows if window.reason).most_common()),
            "alerts": tuple(map(_alert, history.alerts)),
        }
    )


def _sentence(history: VehicleHistory, usable: Sequence[Observation], changes: Sequence[ChangeEntry]) -> str:
    """Return the main result in words."""
    active = sorted(history.active, key=lambda alert: not is_of_suspension(alert.row.cause))
    if active:
        first, *others = (alert.row.text for alert in active)
        more = (
            f" {counted(len(others), 'further alert')} {'is' if len(others) == 1 else 'are'} active." if others else ""
        )
        none = "" if history.windows else " The store contains no window of this period."
        return f"{_capital(first)}.{more}{none}"
    past = f" {counted(len(history.alerts), 'alert')} of this period ended." if history.alerts else ""
    last = f" The last window began at {time_in_words(int(history.times[-1]))} UTC." if history.windows else ""
    return f"{_result(history, len(usable), changes)}{past}{last}"


def _result(history: VehicleHistory, n_usable: int, changes: Sequence[ChangeEntry]) -> str:
    """Return the result of a period without an active alert, in a sentence."""
    status, is_present = history.status, history.period.until is None
    if not history.windows:
        return "Inconclusive: the store contains no window of this period."
    if history.baseline is None or (is_present and status is not None and status.is_learning):
        progress = "" if status is None else f": {status.n_learnt} of {status.n_needed} windows collected"
        return f"Learning{progress}; there is no baseline to compare with yet."
    doubt = _doubt(n_usable, changes)
    if doubt:
        return f"Inconclusive: no change detected, but {doubt}."
    losses = [100 * change.detectable for change in changes if change.detectable is not None]
    limits = f"a loss of {min(losses):.0f} to {max(losses):.0f} % of any part would have been found"
    return f"No change detected in {counted(n_usable, 'usable window')}; {limits} in {N_WINDOWS} windows."


def _doubt(n_usable: int, changes: Sequence[ChangeEntry]) -> str:
    """Return why a change may have remained undetected; empty for no reason."""
    if not changes:
        return "no window can be compared with the baseline"
    if n_usable < N_WINDOWS:
        return f"it takes {N_WINDOWS} usable windows, and the period has {n_usable}"
    loss = max((change.detectable or np.inf for change in changes), default=np.inf)
    return f"a loss of {100 * loss:.0f} % of some part may have remained undetected" if loss > _MOST_UNDETECTED else ""


def _changes(history: VehicleHistory) -> tuple[int | None, tuple[ChangeEntry, ...]]:
    """Return the start of the first window of the mean changes, and the changes by component."""
    mean, baseline = history.mean_change(), history.baseline
    if mean is None or baseline is None:
        return None, ()
    since, deviation = mean
    losses = _detectable(history, baseline)
    change = np.expm1(deviation.log_ratios)
    own, whole = (
        np.expm1([deviation.log_ratios - _HALF_WIDTH * std, deviation.log_ratios + _HALF_WIDTH * std]).T.tolist()
        for std in (deviation.std_by_chance, deviation.std)
    )
    return since, tuple(
        ChangeEntry(
            component=str(component),
            change=float(change[k]),
            interval_by_chance=own[k],
            interval=whole[k],
            detectable=losses.get(str(component)),
        )
        for k, component in enumerate(deviation.components)
    )


def _detectable(history: VehicleHistory, baseline: Baseline) -> dict[str, float]:
    """Return the smallest detectable loss of each component as the stored baseline states it, or as it follows."""
    for row, own in history.baselines:
        stated = row.document.get("detectable", {}).get(str(N_WINDOWS))
        if own is baseline and stated:
            return dict(stated)
    return {str(part): loss for part, loss in detectable(baseline, n_windows=N_WINDOWS).items()}


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
        "alert": alert_entry(alert.row),
        "cleared": alert.row.cleared,
        "evidence": alert_of(alert.row).evidence,
        "history": alert.events,
        "verdicts": alert.verdicts,
    }
    return ReportedAlert.model_validate(fields)


def _capital(text: str) -> str:
    """Return text with a capital letter, without a full stop."""
    return (text[:1].upper() + text[1:]).rstrip(".")
