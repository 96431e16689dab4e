"""From events of vehicles to alerts in the store, and from there to people."""

import json
from collections.abc import Callable, Iterable, Sequence
from dataclasses import asdict, replace
from logging import Logger

from sprung.alerting import (
    Alert,
    AlertSettings,
    Backoff,
    LogSender,
    Message,
    PublishSender,
    Report,
    Sender,
    Transition,
    absent,
    assess,
    deliver,
    is_of_suspension,
    message_of,
    reported,
    shelf_ended,
)
from sprung.diagnosis import Diagnosis, SensorFault
from sprung.monitor.engine import Observed
from sprung.monitor.site import Send
from sprung.storage import AlertRow, Store

#: Severity of a sensor that fails, of a silent vehicle, and of trouble with the monitor itself.
_SENSOR, _SILENT, _MONITOR = 400, 300, 800
#: Attempts after which a message is given up.
_MOST_ATTEMPTS = 20
_INNER = ("streak", "worst", "notified", "evidence")


class AlertBook:
    """Keeps the alerts of all vehicles in the store.

    Parameters
    ----------
    store
        With the alerts.
    settings
        When they rise and clear.
    """

    def __init__(self, store: Store, settings: AlertSettings) -> None:
        self._store, self._settings = store, settings

    def window(self, vehicle: str, event: Observed, *, now: int) -> None:
        """Heed what a window of a vehicle found."""
        sensors = event.observation.sensor_faults
        reports = [_of_sensor(vehicle, fault) for fault in _one_each(sensors)]
        if event.diagnosis is not None:
            reports += _of_diagnosis(vehicle, event.diagnosis)
        is_sound = event.observation.is_conclusive and not sensors
        transitions = assess(
            self._known(vehicle),
            reports,
            looked_for=lambda cause: (
                cause.startswith("sensor:") or (is_of_suspension(cause) and event.diagnosis is not None)
            ),
            is_inhibited=not is_sound,
            settings=self._settings,
            now=now,
        )
        for transition in transitions:
            self._keep(transition, now)

    def trouble(self, vehicle: str, cause: str, text: str, *, now: int) -> None:
        """Report trouble with the watching itself: cause "silent", or one that begins with "monitor"."""
        severity = _SILENT if cause == "silent" else _MONITOR
        known = self._known(vehicle).get(cause)
        if known is not None and known.is_active and known.text == text:
            return
        self._keep(reported(known, Report(vehicle, cause, severity, text), self._at_once, now), now)

    def over(self, vehicle: str, cause: str, *, now: int) -> None:
        """Report that trouble with the watching is over."""
        known = self._known(vehicle).get(cause)
        if known is not None and known.is_active:
            self._keep(absent(known, self._at_once, now), now)

    def shelves(self, *, now: int) -> None:
        """End what was shelved until now."""
        for row in self._store.alerts.find():
            if row.shelved_until is not None and row.shelved_until <= now:
                self._keep(shelf_ended(alert_of(row), now), now)

    def act(self, alert: Alert, act: Callable[[Alert], Transition], *, now: int) -> None:
        """Keep what a person did to an alert."""
        self._keep(act(alert), now)

    @property
    def _at_once(self) -> AlertSettings:
        """Neither hold-off nor hysteresis."""
        return replace(self._settings, raise_after=1, clear_after=1)

    def _known(self, vehicle: str) -> dict[str, Alert]:
        """Return the alerts of a vehicle by cause."""
        return {row.cause: alert_of(row) for row in self._store.alerts.find(vehicle=vehicle)}

    def _keep(self, transition: Transition, now: int) -> None:
        """Store what became of an alert, and what people are to be told."""
        if transition.what == "none":
            return
        notify = asdict(message_of(transition.alert, transition)) if transition.is_notified else None
        history = (transition.what, transition.who, transition.comment)
        self._store.alerts.put(row_of(transition.alert), history=history, notify=notify, now=now)


class Postman:
    """Sends what people are to be told, again and again until it is through.

    Parameters
    ----------
    store
        With the notifications.
    senders
        Each has its own try.
    """

    def __init__(self, store: Store, senders: Sequence[Sender]) -> None:
        self._store, self._senders = store, senders
        self._backoff = Backoff()
        self._next: dict[int, int] = {}
        self._through: dict[int, set[str]] = {}

    def send(self, *, now: int) -> None:
        """Send what is due."""
        for row in self._store.alerts.due_notifications(100):
            if self._next.get(row.id, 0) > now:
                continue
            done = self._through.setdefault(row.id, set())
            waiting = [sender for sender in self._senders if sender.name not in done]
            errors = deliver(Message(**row.document), waiting)
            done |= {sender.name for sender in waiting} - errors.keys()
            if errors and row.attempts + 1 < _MOST_ATTEMPTS:
                self._store.alerts.notification_failed(row.id, "; ".join(errors.values()))
                self._next[row.id] = self._backoff.next_attempt(row.attempts + 1, now)
            else:
                self._store.alerts.notification_sent(row.id, now)
                self._next.pop(row.id, None)
                self._through.pop(row.id, None)


def senders_of(send: Send, log: Logger, publish: Callable[[str, bytes], object]) -> list[Sender]:
    """Return who is told: the log, the topic, and those of the site file."""
    senders: list[Sender] = [LogSender(log), PublishSender(publish)]
    senders += [hook.as_sender(f"webhook {number}") for number, hook in enumerate(send.webhook, start=1)]
    senders += [mail.as_sender(f"mail {number}") for number, mail in enumerate(send.mail, start=1)]
    return senders


def alert_of(row: AlertRow) -> Alert:
    """Return the alert of a row."""
    fields = {name: value for name, value in asdict(row).items() if name not in {"id", "document"}}
    return Alert(**fields, **row.document)


def row_of(alert: Alert) -> AlertRow:
    """Return the row of an alert."""
    fields = asdict(alert)
    inner = {name: fields.pop(name) for name in _INNER}
    return AlertRow(**fields, document=json.loads(json.dumps(inner, default=str)))


def _one_each(faults: Iterable[SensorFault]) -> list[SensorFault]:
    """Return the first fault of each channel."""
    return list({fault.channel: fault for fault in reversed(list(faults))}.values())


def _of_sensor(vehicle: str, fault: SensorFault) -> Report:
    """Report a sensor."""
    text = f"sensor {fault.channel} is {fault.kind.replace('_', ' ')}: {fault.detail}"
    return Report(vehicle, f"sensor:{fault.channel}", _SENSOR, text, {"kind": fault.kind})


def _of_diagnosis(vehicle: str, diagnosis: Diagnosis) -> list[Report]:
    """Report the findings."""
    return [
        Report(
            vehicle,
            f"{finding.corner}.{finding.component}",
            finding.severity_number,
            finding.sentence,
            plain,
        )
        for finding, plain in zip(diagnosis.findings, diagnosis.to_dict()["findings"], strict=True)
    ]
