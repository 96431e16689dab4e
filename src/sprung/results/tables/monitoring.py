"""Tables of a monitor's alerts and vehicles, from their documents."""

from collections.abc import Mapping
from typing import Any

from sprung.results.tables.table import Table
from sprung.results.tables.wording import format_age, format_time

#: Events of the notification of an alert, in words.
_DELIVERIES = {"undelivered": "not delivered", "delivered": "delivered", "abandoned": "abandoned"}


def alerts_table(document: Mapping[str, Any]) -> Table:
    """Return the table of the alerts in a `sprung.alerts/1`.

    Examples
    --------
    >>> alert = {"number": 3, "vehicle": "bus-17", "state": "unacknowledged", "shelved_until": None, "severity": 700}
    >>> alert |= {"raised": 1_790_000_000_000_000_000, "assignee": "bert", "text": "rear-left damper 40 % weaker"}
    >>> table = alerts_table({"alerts": [alert]})
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    number | vehicle | state | raised (UTC) | severity | assigned to | alert
    3 | bus-17 | unacknowledged | 2026-09-21 14:13 | 700 | bert | rear-left damper 40 % weaker
    """
    rows = tuple(
        (
            str(alert["number"]),
            alert["vehicle"],
            _describe_state(alert["state"], alert["shelved_until"]),
            format_time(alert["raised"]),
            str(alert["severity"]),
            alert["assignee"] or "",
            alert["text"],
        )
        for alert in document["alerts"]
    )
    columns = ("number", "vehicle", "state", "raised (UTC)", "severity", "assigned to", "alert")
    return Table("", columns, rows, n_words=3)


def alert_history_table(document: Mapping[str, Any]) -> Table:
    """Return the table of what happened to an alert, from a `sprung.alert-history/1`.

    Examples
    --------
    >>> raised = {"time": 1_790_000_000_000_000_000, "what": "raised", "who": "", "comment": ""}
    >>> assigned = raised | {"what": "assigned", "who": "anna", "comment": "on lift 2", "assignee": "bert"}
    >>> history = [entry | {"shelved_until": None} for entry in (raised, assigned)]
    >>> table = alert_history_table({"history": history})
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row[:3]))
    time (UTC) | event | by
    2026-09-21 14:13 | raised | the monitor
    2026-09-21 14:13 | assigned to bert | anna
    """
    rows = tuple(
        (format_time(entry["time"]), _describe_event(entry), entry["who"] or "the monitor", entry["comment"])
        for entry in document["history"]
    )
    return Table("", ("time (UTC)", "event", "by", "comment"), rows, n_words=3)


def quarantine_table(document: Mapping[str, Any]) -> Table:
    """Return the table of what was quarantined, from a `sprung.quarantine/1`.

    Examples
    --------
    >>> entry = {"vehicle": "bus-17", "kind": "raw", "first": 4, "last": 6, "boot": 1}
    >>> time = 1_790_000_000_000_000_000
    >>> entry |= {"begin": time, "stored": time, "reason": "inconsistent frame", "again": None}
    >>> table = quarantine_table({"quarantined": [entry]})
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    vehicle | what | samples from (UTC) | quarantined (UTC) | reason
    bus-17 | frames 4 to 6 of boot 1 | 2026-09-21 14:13 | 2026-09-21 14:13 | inconsistent frame
    """
    is_analysed = any(entry["again"] is not None for entry in document["quarantined"])
    rows = tuple(
        (
            entry["vehicle"],
            _describe_part(entry),
            format_time(entry["begin"]),
            format_time(entry["stored"]),
            entry["reason"],
            *([entry["again"] or ""] if is_analysed else []),
        )
        for entry in document["quarantined"]
    )
    columns = ("vehicle", "what", "samples from (UTC)", "quarantined (UTC)", "reason")
    again = ("by this version",) if is_analysed else ()
    return Table("", (*columns, *again), rows, n_words=len(columns) + len(again))


def _describe_part(entry: Mapping[str, Any]) -> str:
    """Return which frames, or that it is a state."""
    kind, first, last = entry["kind"], entry["first"], entry["last"]
    if kind == "state":
        return f"state after frame {first} of boot {entry['boot']}"
    frames = f"frame {first}" if first == last else f"frames {first} to {last}"
    return f"{frames} of boot {entry['boot']}" + ("" if kind == "raw" else f" ({kind})")


def vehicles_table(document: Mapping[str, Any], *, now: int) -> Table:
    """Return the table of the vehicles in a `sprung.vehicles/1`; `now` (UTC ns) is the time that ages count from.

    Examples
    --------
    >>> now = 1_790_000_000_000_000_000
    >>> vehicle = {"vehicle": "bus-17", "windows": 9, "baseline": 2, "health_index": 87.4}
    >>> vehicle |= {"last_seen": now - 600_000_000_000, "data_until": None, "summary": "Sensor acc_fl is dead."}
    >>> table = vehicles_table({"vehicles": [vehicle]}, now=now)
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    vehicle | windows | baseline | health (of 100) | last message | data until (UTC) | state
    bus-17 | 9 | version 2 | 87 | 10 min ago |  | Sensor acc_fl is dead.
    """
    rows = tuple(
        (
            vehicle["vehicle"],
            str(vehicle["windows"]),
            "none" if vehicle["baseline"] is None else f"version {vehicle['baseline']}",
            "unknown" if vehicle["health_index"] is None else f"{vehicle['health_index']:.0f}",
            format_age(vehicle["last_seen"], now=now),
            "" if vehicle["data_until"] is None else _time_and_age(vehicle["data_until"], now=now),
            vehicle["summary"],
        )
        for vehicle in document["vehicles"]
    )
    columns = ("vehicle", "windows", "baseline", "health (of 100)", "last message", "data until (UTC)", "state")
    return Table("", columns, rows)


def _time_and_age(time: int, *, now: int) -> str:
    """Return a time, in a second line its age."""
    return f"{format_time(time)}\n{format_age(time, now=now)}"


def _describe_event(entry: Mapping[str, Any]) -> str:
    """Return what happened to an alert."""
    if entry["what"] == "assigned":
        return f"assigned to {entry['assignee'] or 'nobody'}"
    if entry["what"] in _DELIVERIES:
        return f"notification {_DELIVERIES[entry['what']]}"
    return _describe_state(entry["what"], entry["shelved_until"])


def _describe_state(state: str, shelved_until: int | None) -> str:
    """Return a state or event; for shelving, with its end."""
    is_shelf = state == "shelved" and shelved_until is not None
    return f"shelved until {format_time(shelved_until or 0)} UTC" if is_shelf else state


def accounts_table(document: Mapping[str, Any]) -> Table:
    """Return accounts of `sprung.accounts/1` as a table.

    Examples
    --------
    >>> account = {"name": "anna", "role": "operator", "created": 1_790_000_000_000_000_000}
    >>> table = accounts_table({"accounts": [account]})
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    name | role | created (UTC)
    anna | operator | 2026-09-21 14:13
    """
    rows = tuple((entry["name"], entry["role"], format_time(entry["created"])) for entry in document["accounts"])
    return Table("", ("name", "role", "created (UTC)"), rows, n_words=2)


def tokens_table(document: Mapping[str, Any]) -> Table:
    """Return tokens of `sprung.tokens/1` as a table.

    Examples
    --------
    >>> token = {"number": 1, "name": "backup", "role": "viewer", "created_by": "anna"}
    >>> token |= {"created": 1_790_000_000_000_000_000, "expires": None}
    >>> table = tokens_table({"tokens": [token]})
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    number | name | role | created (UTC) | by | expires (UTC)
    1 | backup | viewer | 2026-09-21 14:13 | anna | never
    """
    rows = tuple(
        (
            str(entry["number"]),
            entry["name"],
            entry["role"],
            format_time(entry["created"]),
            entry["created_by"],
            "never" if entry["expires"] is None else format_time(entry["expires"]),
        )
        for entry in document["tokens"]
    )
    return Table("", ("number", "name", "role", "created (UTC)", "by", "expires (UTC)"), rows, n_words=5)
