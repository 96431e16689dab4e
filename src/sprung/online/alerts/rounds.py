"""Effects of a window on alerts: it reports a cause, or finds it absent; a round covers all causes of a vehicle."""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import replace

from sprung.errors import ParameterError
from sprung.online.alerts.alerts import Alert, AlertSettings, Report, Transition, is_of_suspension, severity_step
from sprung.online.alerts.people import shelf_ended


def reported(alert: Alert | None, report: Report, settings: AlertSettings, now: int) -> Transition:
    """Apply a report of a cause to its alert.

    Parameters
    ----------
    alert
        Alert of this vehicle and cause; None before its first report.
    report
        Report of a window.
    settings
        Settings, of which `raise_after` and `renotify_after` are used.
    now
        Present time, UTC ns.

    Returns
    -------
    Transition
        "pending" during hold-off, "raised" at its end, "updated" while active.

    Raises
    ------
    ParameterError
        If alert and report are of different vehicles or causes.

    Notes
    -----
    A recurrence raises the same alert again, counted and unacknowledged. An active alert is notified again if its
    severity rises a step above the worst so far, which also withdraws the acknowledgement; or as a reminder, if nobody
    acknowledged it for `renotify_after`. A shelved one changes in the same way without notifications.

    Examples
    --------
    >>> from sprung.online.alerts import AlertSettings, Report
    >>> report = Report("bus-17", "front_left.spring", 700, "front-left spring 20 % softer")
    >>> held = reported(None, report, AlertSettings(raise_after=2), now=0)
    >>> risen = reported(held.alert, report, AlertSettings(raise_after=2), now=600)
    >>> held.what, risen.what, risen.is_notified
    ('pending', 'raised', True)
    """
    if alert is None:
        alert = _unheard(report, now)
    if (alert.vehicle, alert.cause) != (report.vehicle, report.cause):
        raise ParameterError(
            f"report of {report.vehicle} {report.cause} does not belong to the alert of {alert.vehicle} {alert.cause}: "
            "give the alert of the same vehicle and cause"
        )
    if alert.is_active:
        return _updated(alert, report, settings, now)
    if alert.streak + 1 < settings.raise_after:
        # A cleared alert keeps its contents until it recurs.
        held = alert if alert.count else _with(alert, report)
        return Transition(replace(held, streak=alert.streak + 1, updated=now), "pending")
    risen = replace(
        _with(alert, report),
        is_active=True,
        is_acknowledged=False,
        raised=now,
        updated=now,
        cleared=None,
        count=alert.count + 1,
        streak=0,
        worst=report.severity,
        notified=None if alert.is_shelved else now,
    )
    return Transition(risen, "raised", is_notified=not alert.is_shelved)


def absent(alert: Alert, settings: AlertSettings, now: int) -> Transition:
    """Apply the absence of a cause that a window checked for.

    Returns
    -------
    Transition
        "pending" while the alert is about to clear or a hold-off ends without an alert, "cleared" after `clear_after`
        consecutive windows, "none" if there was nothing to clear.

    Examples
    --------
    >>> from sprung.online.alerts import AlertSettings, Report
    >>> settings = AlertSettings(clear_after=2)
    >>> alert = reported(None, Report("bus-17", "front_left.spring", 700, "softer"), settings, now=0).alert
    >>> first = absent(alert, settings, now=600)
    >>> first.what, absent(first.alert, settings, now=1200).what
    ('pending', 'cleared')
    """
    if not alert.is_active:
        if not alert.streak:
            return Transition(alert, "none")
        return Transition(replace(alert, streak=0, updated=now), "pending")
    if alert.streak + 1 < settings.clear_after:
        return Transition(replace(alert, streak=alert.streak + 1, updated=now), "pending")
    gone = replace(alert, is_active=False, streak=0, updated=now, cleared=now)
    return Transition(gone, "cleared", is_notified=not alert.is_shelved)


def assess(
    alerts: Mapping[str, Alert],
    reports: Iterable[Report],
    *,
    looked_for: Callable[[str], bool],
    is_inhibited: bool,
    settings: AlertSettings,
    now: int,
) -> list[Transition]:
    """Apply one round of a vehicle to its alerts: the causes that its window reported, and those found absent.

    Parameters
    ----------
    alerts
        Alerts of the vehicle by cause.
    reports
        Reports of this round; of several on one cause only the most severe counts.
    looked_for
        Function that returns whether the round checked for a cause; other causes are not absent.
    is_inhibited
        Whether alerts of the suspension are neither raised, changed nor cleared, as with bad data.
    settings
        Hold-off, hysteresis and reminders.
    now
        Present time, UTC ns.

    Returns
    -------
    list of Transition
        Transitions in the order in which they happened, without any "none". Ends of shelving come first, so that one
        cause can occur twice.

    Raises
    ------
    ParameterError
        If the alerts and reports are of more than one vehicle.

    Examples
    --------
    >>> from sprung.online.alerts import AlertSettings, Report
    >>> settings = AlertSettings(clear_after=1)
    >>> alert = reported(None, Report("bus-17", "front_left.spring", 700, "softer"), settings, now=0).alert
    >>> dead = Report("bus-17", "sensor:acc_fl", 600, "acc_fl is dead")
    >>> round_of = {"looked_for": lambda cause: True, "is_inhibited": False, "settings": settings, "now": 600}
    >>> transitions = assess({alert.cause: alert}, [dead], **round_of)
    >>> [(transition.alert.cause, transition.what) for transition in transitions]
    [('sensor:acc_fl', 'raised'), ('front_left.spring', 'cleared')]
    """
    by_cause: dict[str, Report] = {}
    for report in reports:
        if report.cause not in by_cause or report.severity > by_cause[report.cause].severity:
            by_cause[report.cause] = report
    vehicles = sorted({alert.vehicle for alert in alerts.values()} | {report.vehicle for report in by_cause.values()})
    if len(vehicles) > 1:
        raise ParameterError(f"a round covers one vehicle, this one {', '.join(vehicles)}: assess each separately")
    ended = [shelf_ended(alert, now) for alert in alerts.values()]
    present = {transition.alert.cause: transition.alert for transition in ended}
    transitions = list(ended)
    for cause in dict.fromkeys((*by_cause, *present)):
        if is_inhibited and is_of_suspension(cause):
            continue
        if cause in by_cause:
            transitions.append(reported(present.get(cause), by_cause[cause], settings, now))
        elif looked_for(cause):
            transitions.append(absent(present[cause], settings, now))
    return [transition for transition in transitions if transition.what != "none"]


def _updated(alert: Alert, report: Report, settings: AlertSettings, now: int) -> Transition:
    """Apply a report to an active alert."""
    worst = max(alert.worst, alert.severity)
    is_worse = severity_step(report.severity) > severity_step(worst)
    is_acknowledged = alert.is_acknowledged and not is_worse
    last = alert.raised if alert.notified is None else alert.notified
    is_due = not is_acknowledged and settings.renotify_after is not None and now - last >= settings.renotify_after
    is_notified = (is_worse or is_due) and not alert.is_shelved
    changed = replace(
        _with(alert, report),
        is_acknowledged=is_acknowledged,
        updated=now,
        streak=0,
        worst=max(worst, report.severity),
        notified=now if is_notified else alert.notified,
    )
    return Transition(changed, "updated", is_notified=is_notified)


def _with(alert: Alert, report: Report) -> Alert:
    """Return the alert with the contents of a report."""
    return replace(alert, severity=report.severity, text=report.text, evidence=report.evidence)


def _unheard(report: Report, now: int) -> Alert:
    """Return the alert of a cause before its first report."""
    return Alert(
        vehicle=report.vehicle,
        cause=report.cause,
        severity=report.severity,
        text=report.text,
        is_active=False,
        is_acknowledged=True,
        shelved_until=None,
        raised=now,
        updated=now,
        cleared=None,
        count=0,
        assignee=None,
        streak=0,
        evidence=report.evidence,
    )
