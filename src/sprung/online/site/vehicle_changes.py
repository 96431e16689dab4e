"""Corner values of a vehicle against its baseline, from the store: of the last windows, and of one."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field

import numpy as np

from sprung._arrays import Real
from sprung._display import counted
from sprung.diagnosis import INTERVAL_95, Baseline, Hypothesis, Observation, detectable_in_words
from sprung.diagnosis.deviations import mean_deviation, usual_std
from sprung.errors import FormatError
from sprung.online.alerts import STEPS, is_of_suspension, severity_step
from sprung.online.monitor import alert_of
from sprung.online.site.models import FleetVehicle
from sprung.online.site.vehicle_models import Changes, PartChange, PartState
from sprung.online.store import AlertRow, Entry, Store
from sprung.results.documents import baseline_from_document, observation_from_document
from sprung.vehicles import Component

#: Largest number of windows that are averaged, and fewest windows without a finding that are looked through.
_MOST_WINDOWS, _LOOKED_THROUGH = 48, 12
#: Relative loss that must be detectable, or a part is inconclusive; as in the verdict of a diagnosis.
_MOST_DETECTABLE = 0.2
_SECOND = 10**9
#: More than the rounding of seconds since 1970 in double precision, and less than any time between windows [ns].
TIME_ROUNDING = 1000


@dataclass(frozen=True, eq=False)
class Reference:
    """Reference with which the windows of a vehicle are compared.

    Parameters
    ----------
    baseline
        Present baseline; None: the values of the vehicle file.
    detectable
        Smallest detectable losses by number of windows with the change.
    notes
        Limits of the comparison, one sentence each.
    """

    baseline: Baseline | None
    detectable: dict[int, dict[str, float]] = field(default_factory=dict)
    notes: tuple[str, ...] = ()

    @property
    def in_words(self) -> str:
        """Name of the reference."""
        return "the vehicle file" if self.baseline is None else f"baseline {self.baseline.version}"

    def limits(self, n_windows: int) -> dict[str, float]:
        """Return the smallest losses detectable in a number of windows; empty if unknown."""
        known = [count for count in self.detectable if count <= n_windows]
        return self.detectable[max(known)] if known else {}

    def accepts(self, observation: Observation) -> bool:
        """Return whether a window can be compared."""
        if self.baseline is None:
            return observation.is_conclusive
        is_of_its_file = not self.baseline.vehicle_file or observation.time > max(self.baseline.taught, default=0.0)
        return is_of_its_file and self.baseline.accepts(observation)

    def deviation(self, windows: Sequence[Observation]) -> tuple[Real, Real, Real]:
        """Return the mean deviation of windows, its standard deviation, and the part of it by chance, ln values."""
        if self.baseline is not None:
            mean = mean_deviation(self.baseline, windows)
            return mean.log_ratios, mean.std, mean.std_by_chance
        std = np.sqrt(np.diag(np.mean([window.covariance for window in windows], axis=0) / len(windows)))
        return np.mean([window.log_ratios for window in windows], axis=0), std, std

    def band(self) -> Real | None:
        """Return the ends of the range of 95 % of usual windows, relative, shape (2, components); None: unknown."""
        if self.baseline is None:
            return None
        half = INTERVAL_95 * usual_std(self.baseline)
        return np.expm1([-half, half])


def reference_of(store: Store, vehicle: str) -> Reference:
    """Return what the windows of a vehicle are compared with."""
    rows = store.results.baselines(vehicle)
    if not rows:
        return Reference(None, notes=("no baseline yet: values are relative to the vehicle file, and not assessed",))
    try:
        baseline = baseline_from_document(rows[-1].document)
    except FormatError as error:
        return Reference(None, notes=(f"the baseline cannot be read, and values are not assessed: {error}",))
    limits = {int(count): losses for count, losses in rows[-1].document.get("detectable", {}).items()}
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


def changes(store: Store, vehicle: str) -> Changes:
    """Return the changes of all parts of a vehicle: since the onset of an active finding, or of its last windows.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.

    Notes
    -----
    A part that an active alert names has the size and the interval of its finding, as the alert states them.
    """
    reference = reference_of(store, vehicle)
    alerts = [row for row in store.alerts.find(vehicle=vehicle, is_active=True) if is_of_suspension(row.cause)]
    windows = _last_windows(store, vehicle, reference, alerts)
    if not windows:
        return Changes(
            reference=reference.in_words,
            baseline=None if reference.baseline is None else reference.baseline.version,
            n_windows=0,
            since=None,
            until=None,
            parts=(),
            notes=reference.notes,
        )
    observations = [observation for _, observation in windows]
    n_since_learning = _n_since_learning(store, vehicle, reference)
    return Changes(
        reference=reference.in_words,
        baseline=None if reference.baseline is None else reference.baseline.version,
        n_windows=len(windows),
        since=windows[0][0].t0,
        until=windows[-1][0].t0,
        parts=part_changes(reference, observations, alerts, limits=reference.limits(n_since_learning)),
        notes=reference.notes,
    )


def part_changes(
    reference: Reference,
    windows: Sequence[Observation],
    alerts: Sequence[AlertRow],
    *,
    limits: dict[str, float],
) -> tuple[PartChange, ...]:
    """Return the changes of all parts in windows, and the alerts that name them.

    Parameters
    ----------
    reference
        Reference of the windows.
    windows
        Windows that the reference accepts, at least one.
    alerts
        Active alerts of the suspension.
    limits
        Smallest detectable loss of each part; a part without one is inconclusive.
    """
    components = windows[0].components
    alike = [window for window in windows if window.components == components]
    mean, *stds = reference.deviation(alike)
    ends, near = (np.expm1(mean + INTERVAL_95 * np.outer([-1, 1], std)).T.tolist() for std in stds)
    named = _named(alerts, components)
    parts = []
    for row, component in enumerate(components):
        alert, limit = named.get(component), limits.get(str(component))
        change, interval, by_chance = float(np.expm1(mean[row])), tuple(ends[row]), tuple(near[row])
        stated = None if alert is None else _stated(alert)
        if stated is not None:
            change, interval = stated
            by_chance = interval
        parts.append(
            PartChange(
                part=str(component),
                corner=component.corner,
                kind=component.kind,
                change=change,
                interval=interval,
                by_chance=by_chance,
                detectable=limit,
                state=_state(alert, limit),
                alert=None if alert is None else alert.id,
                step=None if alert is None else STEPS[severity_step(alert.severity)],
            )
        )
    return tuple(parts)


def sentence_of(store: Store, summary: FleetVehicle, seen: Changes) -> str:
    """Return the main result for a vehicle, in a sentence.

    Parameters
    ----------
    store
        Store of the monitor.
    summary
        Place of the vehicle in the fleet.
    seen
        Changes of its parts.
    """
    if summary.alert is not None:
        row = store.alerts.row(summary.alert)
        stated = None if row is None else alert_of(row).evidence.get("sentence")
        return _as_sentence(stated or summary.sentence, summary.vehicle)
    if summary.state == "no change detected":
        since = f" in the last {counted(seen.n_windows, 'window')}" if seen.n_windows else ""
        limit = detectable_in_words(
            {Component.parse(each.part): each.detectable for each in seen.parts if each.detectable is not None}
        )
        return f"No change detected{since}{f'; {limit}' if limit else ''}."
    if summary.state == "inconclusive":
        return f"Inconclusive: {summary.sentence.rstrip('.')}."
    return _as_sentence(summary.sentence, summary.vehicle)


def _as_sentence(text: str, vehicle: str) -> str:
    """Return a text that begins with a capital, or the name of a vehicle as it is, and ends with a full stop."""
    first = text[:1] if text.startswith(vehicle) else text[:1].upper()
    return f"{first}{text[1:].rstrip('.')}."


def _last_windows(
    store: Store, vehicle: str, reference: Reference, alerts: Sequence[AlertRow]
) -> list[tuple[Entry, Observation]]:
    """Return the last windows that can be compared: since the onset of the worst finding, or the last ones.

    An alert may be in the store before its windows are.
    """
    worst = max(alerts, key=lambda alert: alert.severity, default=None)
    since = None if worst is None else alert_of(worst).evidence.get("since")
    if since is not None:
        begin = round(since * _SECOND) - TIME_ROUNDING
        if found := _comparable(store, vehicle, reference, since=begin, limit=_MOST_WINDOWS):
            return found
    return _comparable(store, vehicle, reference, since=None, limit=_LOOKED_THROUGH)


def _comparable(
    store: Store, vehicle: str, reference: Reference, *, since: int | None, limit: int
) -> list[tuple[Entry, Observation]]:
    """Return the last windows from a time on that can be compared, with the components of the last one."""
    read = observations_of(store.results.observations(vehicle, since=since, limit=limit))
    accepted = [(entry, window) for entry, window in read if reference.accepts(window)]
    return [(entry, window) for entry, window in accepted if window.components == accepted[-1][1].components]


def _n_since_learning(store: Store, vehicle: str, reference: Reference) -> int:
    """Return the number of windows that the baseline was not learnt from, as far as they count."""
    if reference.baseline is None or not reference.detectable:
        return 0
    taught = max(reference.baseline.taught, default=0.0)
    begin = round(taught * _SECOND) + TIME_ROUNDING
    most = 2 * max(reference.detectable)  # some may be inconclusive
    read = observations_of(store.results.observations(vehicle, since=begin, limit=most))
    return sum(reference.accepts(window) for _, window in read)


def _named(alerts: Sequence[AlertRow], components: tuple[Component, ...]) -> dict[Component, AlertRow]:
    """Return the most severe alert that names each part."""
    named: dict[Component, AlertRow] = {}
    for alert in sorted(alerts, key=lambda row: row.severity):
        corner, dot, kind = alert.cause.partition(".")
        if dot:
            named |= dict.fromkeys(Hypothesis("", corner, kind).parts(components), alert)
    return named


def _stated(alert: AlertRow) -> tuple[float, tuple[float, float]] | None:
    """Return size and interval of the finding of an alert; None if it states none."""
    evidence = alert_of(alert).evidence
    size, ends = evidence.get("change"), evidence.get("interval")
    if size is None or ends is None:
        return None
    low, high = sorted(map(float, ends))
    return float(size), (low, high)


def _state(alert: AlertRow | None, limit: float | None) -> PartState:
    """Return what is known of a part."""
    if alert is not None:
        return "change"
    return "no change detected" if limit is not None and limit <= _MOST_DETECTABLE else "inconclusive"
