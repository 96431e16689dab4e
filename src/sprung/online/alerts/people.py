"""Operator actions on alerts: acknowledge, shelve, assign, comment. Only the end of shelving notifies."""

from dataclasses import replace

from sprung.errors import ParameterError
from sprung.online.alerts.alerts import Alert, Transition


def acknowledged(alert: Alert, who: str, now: int, comment: str = "") -> Transition:
    """Acknowledge an alert; a cleared one returns to normal.

    Parameters
    ----------
    alert
        Alert that is active or cleared, and not acknowledged since.
    who
        Name of the operator.
    now
        Present time, UTC ns.
    comment
        Comment for the history.

    Returns
    -------
    Transition
        Alert afterwards, and the entry of its history.

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


def shelved(alert: Alert, who: str, until: int, now: int, comment: str = "") -> Transition:
    """Shelve an alert until a time [UTC ns], so that nobody is notified; shelving again moves that time.

    Returns
    -------
    Transition
        Alert afterwards, and the entry of its history.

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


def unshelved(alert: Alert, who: str, now: int, comment: str = "") -> Transition:
    """End the shelving of an alert before its time; an active one notifies as at the end of its shelving.

    Returns
    -------
    Transition
        Alert afterwards, and the entry of its history.

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


def shelf_ended(alert: Alert, now: int) -> Transition:
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


def assigned(alert: Alert, who: str, assignee: str | None, now: int, comment: str = "") -> Transition:
    """Assign an alert to somebody, or to nobody (None).

    Returns
    -------
    Transition
        Alert afterwards, and the entry of its history.

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


def commented(alert: Alert, who: str, now: int, comment: str) -> Transition:
    """Add a comment to the history of an alert.

    Returns
    -------
    Transition
        Alert afterwards, and the entry of its history.

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


def closed(alert: Alert, who: str, now: int, comment: str = "") -> Transition:
    """Clear an active alert whose cause was removed, such as by a repair; the next report raises it again.

    Returns
    -------
    Transition
        Alert afterwards, and the entry of its history.

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


def _off_shelf(alert: Alert, now: int, who: str = "", comment: str = "") -> Transition:
    """End the shelving of an alert, and notify if it is active."""
    notified = now if alert.is_active else alert.notified
    back = replace(alert, shelved_until=None, updated=now, notified=notified)
    return Transition(back, "unshelved", who, comment, is_notified=alert.is_active)


def _name(alert: Alert) -> str:
    """Name an alert in a message."""
    return f"alert {alert.cause!r} of {alert.vehicle!r}"


def _check_who(alert: Alert, who: str, act: str) -> None:
    """Refuse an action without an operator."""
    if not who.strip():
        raise ParameterError(f"who is empty: name the operator who wants to {act} {_name(alert)}")
