"""What happens to alerts: windows report causes or find them absent, people acknowledge, shelve, assign and comment.

Of what people do only the end of shelving and the closing of an alert notify.
"""

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from fnmatch import fnmatchcase
from typing import Any, Literal

from sprung._checks import check_number
from sprung.errors import ParameterError
from sprung.state import is_of_suspension, severity_step
from sprung.state.alerts import AlertState, check_alert

#: Changes of an alert. "pending": only the count of reports changed; "none": no change.
Change = Literal[
    "raised",
    "updated",
    "cleared",
    "acknowledged",
    "shelved",
    "unshelved",
    "assigned",
    "commented",
    "pending",
    "none",
]


@dataclass(frozen=True, slots=True)
class AlertSettings:
    """Delays after which alerts are raised, cleared and notified again.

    Parameters
    ----------
    raise_after
        Hold-off: consecutive reports before an alert is active, at least 1.
    clear_after
        Hysteresis: consecutive windows without a report before it clears, at least 1.
    renotify_after
        Time after which an active, unacknowledged alert is notified again [ns]; None: never.
    limits
        Soft and hard limit of the certain change by kind of part or by part: the alert is high from the first on, and
        critical from the second; parts without limits have the severity of their finding.
    vehicle_limits
        Such limits of vehicles by name, or by a pattern such as "bus-0*".

    Raises
    ------
    ParameterError
        If a number is below 1, or a time is not above 0.
    """

    raise_after: int = 1
    clear_after: int = 3
    renotify_after: int | None = None
    limits: Mapping[str, Sequence[float]] = field(default_factory=dict, hash=False)
    vehicle_limits: Mapping[str, Mapping[str, Sequence[float]]] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        check_number("raise_after", self.raise_after, at_least=1, advice="1 raises at the first report")
        check_number("clear_after", self.clear_after, at_least=1, advice="1 clears at the first window without it")
        if self.renotify_after is not None:
            check_number("renotify_after", self.renotify_after, above=0, advice="None never notifies again")

    def limits_of(self, vehicle: str, *parts: str) -> Sequence[float] | None:
        """Return the limits of the first of `parts` that is known: of the vehicle, else of all; None without any."""
        own = [table for name, table in self.vehicle_limits.items() if fnmatchcase(vehicle, name)]
        return next((table[part] for table in (*own, self.limits) for part in parts if part in table), None)


@dataclass(frozen=True, slots=True)
class Report:
    """Report of one window on one cause.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    cause
        Identifier of the cause, the same every time: "front_left.spring", "sensor:acc_fl", "silent", "monitor".
    severity
        Severity, 1 to 1000, as in OPC 10000-110.
    text
        Sentence for people.
    evidence
        Plain values behind the report, such as numbers, intervals and addresses of windows.
    """

    vehicle: str
    cause: str
    severity: int
    text: str
    evidence: dict[str, Any] = field(default_factory=dict, hash=False)

    def __post_init__(self) -> None:
        check_alert(self.vehicle, self.cause, self.severity)


@dataclass(frozen=True, slots=True)
class Transition:
    """An alert after an event, and the event.

    Parameters
    ----------
    alert
        Alert after the event; equal to the one before if `what` is "none".
    what
        Event, see `Change`.
    who
        Name of the operator; empty if a window caused the event.
    comment
        Comment of the operator.
    is_notified
        Whether a notification is due.
    """

    alert: AlertState
    what: Change
    who: str = ""
    comment: str = ""
    is_notified: bool = False


def reported(alert: AlertState | None, report: Report, settings: AlertSettings, now: int) -> Transition:
    """Apply a report of a cause to its alert.

    Parameters
    ----------
    alert
        AlertState of this vehicle and cause; None before its first report.
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
        alert = AlertState(
            report.vehicle,
            report.cause,
            report.severity,
            report.text,
            now,
            is_active=False,
            is_acknowledged=True,
            count=0,
            evidence=report.evidence,
            updated=now,
        )
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


def absent(alert: AlertState, settings: AlertSettings, now: int) -> Transition:
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
    alerts: Mapping[str, AlertState],
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


def _updated(alert: AlertState, report: Report, settings: AlertSettings, now: int) -> Transition:
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


def _with(alert: AlertState, report: Report) -> AlertState:
    """Return the alert with the contents of a report."""
    return replace(alert, severity=report.severity, text=report.text, evidence=report.evidence)


def acknowledged(alert: AlertState, who: str, now: int, comment: str = "") -> Transition:
    """Acknowledge an alert; a cleared one returns to normal.

    Parameters
    ----------
    alert
        AlertState that is active or cleared, and not acknowledged since.
    who
        Name of the operator.
    now
        Present time, UTC ns.
    comment
        Comment for the history.

    Returns
    -------
    Transition
        AlertState afterwards, and the entry of its history.

    Raises
    ------
    ParameterError
        If it is acknowledged already, or was never active.

    Examples
    --------
    >>> from sprung.online.alerts import AlertSettings, Report, reported
    >>> alert = reported(None, Report("bus-17", "front_left.spring", 700, "softer"), AlertSettings(), now=0).alert
    >>> event = acknowledged(alert, "Ada", now=60, comment="ordered a spring")
    >>> event.what, event.who, event.comment, event.alert.is_acknowledged
    ('acknowledged', 'Ada', 'ordered a spring', True)
    """
    _check_who(alert, who, "acknowledge")
    if not alert.count:
        raise ParameterError(f"{_name(alert)} was never active: there is nothing to acknowledge")
    if alert.is_acknowledged:
        raise ParameterError(f"{_name(alert)} is acknowledged already: comment on it instead")
    return Transition(replace(alert, is_acknowledged=True, updated=now), "acknowledged", who, comment)


def shelved(alert: AlertState, who: str, until: int, now: int, comment: str = "") -> Transition:
    """Shelve an alert until a time [UTC ns], so that nobody is notified; shelving again moves that time.

    Returns
    -------
    Transition
        AlertState afterwards, and the entry of its history.

    Raises
    ------
    ParameterError
        If `until` is not after `now`.

    Examples
    --------
    >>> from sprung.online.alerts import AlertSettings, Report, reported
    >>> alert = reported(None, Report("bus-17", "front_left.spring", 700, "softer"), AlertSettings(), now=0).alert
    >>> event = shelved(alert, "Ada", until=3600 * 10**9, now=60)
    >>> event.what, event.alert.is_shelved, event.alert.shelved_until
    ('shelved', True, 3600000000000)
    """
    _check_who(alert, who, "shelve")
    if until <= now:
        raise ParameterError(
            f"until={until} is not after now ({now}), both in UTC ns: shelve {_name(alert)} until a later time"
        )
    return Transition(replace(alert, shelved_until=until, updated=now), "shelved", who, comment)


def unshelved(alert: AlertState, who: str, now: int, comment: str = "") -> Transition:
    """End the shelving of an alert before its time; an active one notifies as at the end of its shelving.

    Returns
    -------
    Transition
        AlertState afterwards, and the entry of its history.

    Raises
    ------
    ParameterError
        If it is not shelved.

    Examples
    --------
    >>> from sprung.online.alerts import AlertSettings, Report, reported
    >>> alert = reported(None, Report("bus-17", "front_left.spring", 700, "softer"), AlertSettings(), now=0).alert
    >>> alert = shelved(alert, "Ada", until=3600 * 10**9, now=60).alert
    >>> event = unshelved(alert, "Ada", now=120)
    >>> event.what, event.alert.is_shelved, event.is_notified
    ('unshelved', False, True)
    """
    _check_who(alert, who, "unshelve")
    if not alert.is_shelved:
        raise ParameterError(f"{_name(alert)} is not shelved: only shelved alerts can be unshelved")
    return _off_shelf(alert, now, who, comment)


def shelf_ended(alert: AlertState, now: int) -> Transition:
    """End the shelving of an alert at its time; an active one notifies, even if it was acknowledged.

    Returns
    -------
    Transition
        "unshelved", or "none" if it is not shelved or its time has not come.

    Examples
    --------
    >>> from sprung.online.alerts import AlertSettings, Report, reported
    >>> alert = reported(None, Report("bus-17", "front_left.spring", 700, "softer"), AlertSettings(), now=0).alert
    >>> alert = shelved(alert, "Ada", until=3600, now=60).alert
    >>> shelf_ended(alert, now=3599).what, shelf_ended(alert, now=3600).what
    ('none', 'unshelved')
    """
    if alert.shelved_until is None or now < alert.shelved_until:
        return Transition(alert, "none")
    return _off_shelf(alert, now)


def assigned(alert: AlertState, who: str, assignee: str | None, now: int, comment: str = "") -> Transition:
    """Assign an alert to somebody, or to nobody (None).

    Returns
    -------
    Transition
        AlertState afterwards, and the entry of its history.

    Raises
    ------
    ParameterError
        If the alert already has that assignee, or the name is empty.

    Examples
    --------
    >>> from sprung.online.alerts import AlertSettings, Report, reported
    >>> alert = reported(None, Report("bus-17", "front_left.spring", 700, "softer"), AlertSettings(), now=0).alert
    >>> event = assigned(alert, "Ada", "Grace", now=60)
    >>> event.what, event.alert.assignee
    ('assigned', 'Grace')
    """
    _check_who(alert, who, "assign")
    if assignee is not None and not assignee.strip():
        raise ParameterError(f"assignee of {_name(alert)} is empty: give a name, or None for nobody")
    if assignee == alert.assignee:
        raise ParameterError(f"{_name(alert)} is assigned to {assignee or 'nobody'} already: name somebody else")
    return Transition(replace(alert, assignee=assignee, updated=now), "assigned", who, comment)


def commented(alert: AlertState, who: str, now: int, comment: str) -> Transition:
    """Add a comment to the history of an alert.

    Returns
    -------
    Transition
        AlertState afterwards, and the entry of its history.

    Raises
    ------
    ParameterError
        If the comment is empty.

    Examples
    --------
    >>> from sprung.online.alerts import AlertSettings, Report, reported
    >>> alert = reported(None, Report("bus-17", "front_left.spring", 700, "softer"), AlertSettings(), now=0).alert
    >>> event = commented(alert, "Ada", now=60, comment="spring measured: 18 % softer")
    >>> event.what, event.who, event.comment
    ('commented', 'Ada', 'spring measured: 18 % softer')
    """
    _check_who(alert, who, "comment on")
    if not comment.strip():
        raise ParameterError(f"comment on {_name(alert)} is empty: write a comment")
    return Transition(replace(alert, updated=now), "commented", who, comment)


def closed(alert: AlertState, who: str, now: int, comment: str = "") -> Transition:
    """Clear an active alert whose cause was removed, such as by a repair; the next report raises it again.

    Returns
    -------
    Transition
        AlertState afterwards, and the entry of its history.

    Raises
    ------
    ParameterError
        If it is not active.

    Examples
    --------
    >>> from sprung.online.alerts import AlertSettings, Report, reported
    >>> alert = reported(None, Report("bus-17", "front_left.spring", 700, "softer"), AlertSettings(), now=0).alert
    >>> event = closed(alert, "Ada", now=60, comment="new spring")
    >>> event.what, event.alert.is_active, event.alert.is_acknowledged
    ('cleared', False, True)
    """
    _check_who(alert, who, "close")
    if not alert.is_active:
        raise ParameterError(f"{_name(alert)} is not active: there is nothing to close")
    gone = replace(alert, is_active=False, is_acknowledged=True, shelved_until=None, streak=0, cleared=now, updated=now)
    return Transition(gone, "cleared", who, comment, is_notified=not alert.is_shelved)


def _off_shelf(alert: AlertState, now: int, who: str = "", comment: str = "") -> Transition:
    """End the shelving of an alert, and notify if it is active."""
    notified = now if alert.is_active else alert.notified
    back = replace(alert, shelved_until=None, updated=now, notified=notified)
    return Transition(back, "unshelved", who, comment, is_notified=alert.is_active)


def _name(alert: AlertState) -> str:
    """Name an alert in a message."""
    return f"alert {alert.cause!r} of {alert.vehicle!r}"


def _check_who(alert: AlertState, who: str, act: str) -> None:
    """Refuse an action without an operator."""
    if not who.strip():
        raise ParameterError(f"who is empty: name the operator who wants to {act} {_name(alert)}")
