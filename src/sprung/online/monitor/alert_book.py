"""From windows of vehicles, and problems of monitoring, to alerts in the store."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict, replace
from typing import Any

from sprung._display import counted
from sprung.diagnosis import Diagnosis, SensorFault, detectable_in_words
from sprung.online.alerts import AlertSettings, Report, Transition, absent, assess, message_of, reported, shelf_ended
from sprung.online.monitor.assessment import describe_fault
from sprung.online.monitor.events import Observed
from sprung.online.store import Store
from sprung.results.documents import detectable_document, detection_document, finding_document
from sprung.results.tables import span_in_words
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
        reports = [_of_sensor(vehicle, fault) for fault in _first_of_each_channel(sensors)]
        if event.diagnosis is not None:
            reports += _of_diagnosis(vehicle, event.diagnosis)
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
            self._add_lost(known, vehicle, counts, begin=begin, end=end, now=now)

    def _add_lost(
        self, known: AlertState | None, vehicle: str, counts: Mapping[int, int], *, begin: int, end: int, now: int
    ) -> None:
        """Raise or update the alert `known` about lost frames, if more are lost than it counts."""
        before = {} if known is None else known.evidence
        by_boot = {int(boot): count for boot, count in before.get("boots", {}).items()}
        n_new = sum(max(0, count - by_boot.get(boot, 0)) for boot, count in counts.items())
        if not n_new:
            return
        is_active = known is not None and known.is_active
        n_frames = n_new + (before["frames"] if is_active else 0)
        begins = [time for time in (begin, before["from"] if is_active else 0) if time]
        span = {"from": min(begins, default=0), "to": max(end, before["to"] if is_active else 0)}
        when = f", {span_in_words(span['from'], span['to'])}," if span["from"] else ""
        is_one = n_frames == 1
        sentence = (
            f"{counted(n_frames, 'frame')} of {vehicle}{when} {'is' if is_one else 'are'} lost, as its box had to drop "
            f"{'it before it was' if is_one else 'them before they were'} stored here: "
            "give its spool more space, and check its connection and the store of the monitor"
        )
        boots = dict(sorted((by_boot | dict(counts)).items())[-_MAX_BOOTS:])
        evidence = {"frames": n_frames, **span, "boots": {str(boot): count for boot, count in boots.items()}}
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
        notify = _notification(transition) if transition.is_notified else None
        history = (transition.what, transition.who, transition.comment)
        self._store.alerts.put(transition.alert, history=history, notify=notify, now=now)

    @property
    def _at_once(self) -> AlertSettings:
        """Settings without hold-off and hysteresis."""
        return replace(self._settings, raise_after=1, clear_after=1)

    def _known(self, vehicle: str) -> dict[str, AlertState]:
        """Return the alerts of a vehicle by cause."""
        return {alert.cause: alert for alert in self._store.alerts.find(vehicle=vehicle)}


def _notification(transition: Transition) -> dict[str, Any]:
    """Return the notification about an event as the store keeps it: picture and key come when it is sent."""
    fields = asdict(message_of(transition))
    del fields["picture"], fields["key"]
    return fields


def _first_of_each_channel(faults: Iterable[SensorFault]) -> list[SensorFault]:
    """Return the first fault of each channel."""
    return list({fault.channel: fault for fault in reversed(list(faults))}.values())


def _of_sensor(vehicle: str, fault: SensorFault) -> Report:
    """Return the report of a sensor fault."""
    return Report(vehicle, f"sensor:{fault.channel}", _SENSOR, describe_fault(fault), {"kind": fault.kind})


def _of_diagnosis(vehicle: str, diagnosis: Diagnosis) -> list[Report]:
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
        for finding in diagnosis.findings
    ]
