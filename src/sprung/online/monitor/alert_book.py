"""From windows of vehicles, and problems of monitoring, to alerts in the store."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, field, replace
from typing import Any

from sprung._display import counted
from sprung.diagnosis import SEVERITIES, Diagnosis, Finding, detectable_in_words
from sprung.online.alerts import AlertSettings, Report, Transition, absent, assess, message_of, reported, shelf_ended
from sprung.online.monitor.assessment import describe_fault
from sprung.online.monitor.events import Observed
from sprung.online.monitor.site import Site
from sprung.online.store import Store
from sprung.results.documents import detectable_document, detection_document, finding_document
from sprung.results.tables.wording import format_span
from sprung.state import AlertState, is_of_suspension

#: Severity of a failing sensor.
_SENSOR = 400
#: Severity of a silent vehicle.
_SILENT = 300
#: Severity of lost frames.
_LOST = 500
#: Severity of a problem of the monitor itself.
_MONITOR = 800
#: Largest number of boots of a vehicle whose lost frames are remembered.
_MAX_BOOTS = 100
#: Last windows of the change test that an alert keeps.
_MAX_WINDOWS = 40
#: Likeliest hypotheses of the change test that an alert keeps.
_MAX_HYPOTHESES = 5
#: Fields of a message that a notification in the store lacks.
_OF_SENDING = frozenset({"picture", "key"})


class AlertBook:
    """Keeps the alerts of all vehicles in the store.

    Parameters
    ----------
    store
        Store of the alerts.
    settings
        Hold-off, hysteresis and reminders.
    """

    def __init__(self, store: Store, settings: AlertSettings) -> None:
        self._store = store
        self._settings = settings

    def take_window(self, vehicle: str, event: Observed, *, now: int) -> None:
        """Raise, update and clear alerts according to a window."""
        sensors = event.observation.sensor_faults
        reports = [
            Report(vehicle, f"sensor:{fault.channel}", _SENSOR, describe_fault(fault), {"kind": fault.kind})
            for fault in {fault.channel: fault for fault in reversed(sensors)}.values()  # the first of each channel
        ]
        if event.diagnosis is not None:
            reports += _of_diagnosis(vehicle, event.diagnosis, self._settings)
        is_valid = event.observation.is_conclusive and not sensors
        with self._store.alerts.locked_of(vehicle) as known:
            transitions = assess(
                {alert.cause: alert for alert in known},
                reports,
                looked_for=lambda cause: (
                    cause.startswith("sensor:") or (is_of_suspension(cause) and event.diagnosis is not None)
                ),
                is_inhibited=not is_valid,
                settings=self._settings,
                now=now,
            )
            for transition in transitions:
                self.put(transition, now=now)

    def report(self, vehicle: str, cause: str, text: str, *, now: int) -> None:
        """Raise an alert about monitoring itself, without hold-off: cause "silent", or "monitor..."."""
        severity = _SILENT if cause == "silent" else _MONITOR
        known = self._known(vehicle).get(cause)
        if known is not None and known.is_active and known.text == text:
            return
        with self._store.alerts.locked(vehicle, cause) as known:
            self.put(reported(known, Report(vehicle, cause, severity, text), self._at_once, now), now=now)

    def report_lost(self, vehicle: str, counts: Mapping[int, int], *, begin: int = 0, end: int = 0, now: int) -> None:
        """Raise or update the alert about lost frames of a vehicle, "lost".

        Parameters
        ----------
        vehicle
            Name of the vehicle.
        counts
            Number of frames lost so far, by boot; those in the alert already are not counted again.
        begin, end
            Times of the first sample and after the last one that were lost, UTC ns; 0 if unknown.
        now
            Present time, UTC ns.
        """
        with self._store.alerts.locked(vehicle, "lost") as known:
            before = {} if known is None else known.evidence
            by_boot = {int(boot): count for boot, count in before.get("boots", {}).items()}
            n_new = sum(max(0, count - by_boot.get(boot, 0)) for boot, count in counts.items())
            if not n_new:
                return
            present = before if known is not None and known.is_active else {"frames": 0, "from": 0, "to": 0}
            n_frames = n_new + present["frames"]
            begin, end = min(filter(None, (begin, present["from"])), default=0), max(end, present["to"])
            when = f", {format_span(begin, end)}," if begin else ""
            is_one = n_frames == 1
            sentence = (
                f"{counted(n_frames, 'frame')} of {vehicle}{when} {'is' if is_one else 'are'} lost, as its box had to"
                f" drop {'it before it was' if is_one else 'them before they were'} stored here: "
                "give its spool more space, and check its connection and the store of the monitor"
            )
            boots = dict(sorted((by_boot | dict(counts)).items())[-_MAX_BOOTS:])
            numbers = {str(boot): count for boot, count in boots.items()}
            evidence = {"frames": n_frames, "from": begin, "to": end, "boots": numbers}
            self.put(reported(known, Report(vehicle, "lost", _LOST, sentence, evidence), self._at_once, now), now=now)

    def clear(self, vehicle: str, cause: str, *, now: int) -> None:
        """Clear an alert about monitoring itself, if it is active, without hysteresis."""
        known = self._known(vehicle).get(cause)
        if known is None or not known.is_active:
            return
        with self._store.alerts.locked(vehicle, cause) as present:
            if present is not None and present.is_active:
                self.put(absent(present, self._at_once, now), now=now)

    def end_shelves(self, *, now: int) -> None:
        """End the shelving of alerts whose time has come."""
        for alert in self._store.alerts.shelved(until=now):
            with self._store.alerts.locked(alert.vehicle, alert.cause) as present:
                if present is not None:
                    self.put(shelf_ended(present, now), now=now)

    def put(self, transition: Transition, *, now: int) -> None:
        """Store the new state of an alert, and the notification about it, if there is one."""
        if transition.what == "none":
            return
        notify = None
        if transition.is_notified:  # picture and key come when it is sent
            notify = {name: value for name, value in asdict(message_of(transition)).items() if name not in _OF_SENDING}
        history = (transition.what, transition.who, transition.comment)
        self._store.alerts.put(transition.alert, history=history, notify=notify, now=now)

    @property
    def _at_once(self) -> AlertSettings:
        """Settings without hold-off and hysteresis."""
        return replace(self._settings, raise_after=1, clear_after=1)

    def _known(self, vehicle: str) -> dict[str, AlertState]:
        """Return the alerts of a vehicle by cause."""
        return {alert.cause: alert for alert in self._store.alerts.find(vehicle=vehicle)}


def _limited(finding: Finding, known: Sequence[float] | None) -> Finding:
    """Return a finding with the severity by its soft and hard limit, if there are any."""
    if known is None or finding.interval is None:
        return finding
    (soft, hard), (low, high) = known, finding.interval
    certain = min(abs(low), abs(high)) if low * high > 0 else 0.0
    critical, warning, *_, least = SEVERITIES
    _, severity, number, advice = critical if certain >= hard else warning if certain >= soft else least
    return replace(finding, severity=severity, severity_number=number, advice=advice)


def _of_diagnosis(vehicle: str, diagnosis: Diagnosis, settings: AlertSettings) -> list[Report]:
    """Return the reports of the findings of a diagnosis, with the change test behind them."""
    test: dict[str, Any] = {"detectable": detectable_document(diagnosis.detectable)}
    if diagnosis.detection is not None:
        test["detection"] = detection_document(
            diagnosis.detection, max_windows=_MAX_WINDOWS, max_hypotheses=_MAX_HYPOTHESES
        )
    limit = detectable_in_words(diagnosis.detectable)
    return [
        Report(
            vehicle,
            f"{finding.corner}.{finding.component}",
            finding.severity_number,
            f"{finding.sentence}; {limit}" if limit else finding.sentence,
            {**finding_document(finding), **test},
        )
        for found in diagnosis.findings
        for finding in (_limited(found, settings.limits_of(vehicle, found.hypothesis, found.component)),)
    ]


@dataclass(frozen=True, eq=False, slots=True)
class Context:
    """Settings, store, alerts and clocks of a monitor.

    Parameters
    ----------
    site
        Settings.
    store
        Open store.
    clock
        Present time, UTC ns.
    timer
        Present time [s] of a monotonic clock.
    """

    site: Site
    store: Store
    clock: Callable[[], int] = time.time_ns
    timer: Callable[[], float] = time.monotonic
    alerts: AlertBook = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "alerts", AlertBook(self.store, self.site.alerts.settings))
