"""Fleets, runs over an archive, lakes and what the monitor knows of vehicles as tables and sentences."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from sprung._display import counted
from sprung.diagnosis import TypeBaseline
from sprung.results.tables.wording import Table, format_age, format_name, format_time

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


def fleet_tables(document: Mapping[str, Any]) -> list[Table]:
    """Return the table of each type in a `sprung.fleet/1`, the most deviating vehicles first.

    Examples
    --------
    >>> healthy = {"vehicle": "car-1", "windows": 3, "p_value": 0.4, "deviates": False}
    >>> soft = {"vehicle": "car-2", "windows": 3, "p_value": 1e-6, "deviates": True, "part": "front_left.spring"}
    >>> soft |= {"change": -0.3, "interval": (-0.33, -0.27)}
    >>> (table,) = fleet_tables({"rate": 0.05, "types": [{"name": "zafira", "vehicles": [soft, healthy]}]})
    >>> table.title
    'vehicles of the type zafira'
    >>> for row in table.rows:
    ...     print(" | ".join(row))
    car-2 | 3 | 1e-06 | -30 (-33 to -27) | deviates: front left spring
    car-1 | 3 | 0.4 |  | no deviation detected
    """
    caption = (
        f"p: probability of such evidence from a healthy vehicle; at most {100 * document['rate']:.3g} % "
        "of the vehicles reported to deviate are expected to be healthy"
    )
    columns = ("vehicle", "windows", "p", "change [%]", "verdict")
    return [
        Table(
            f"vehicles of the type {ranking['name']}" if ranking["name"] else "",
            columns,
            tuple(map(_row, ranking["vehicles"])),
            caption=caption,
        )
        for ranking in document["types"]
    ]


def describe_next_inspection(ranking: Mapping[str, Any]) -> str:
    """Return which vehicle of a type in a `sprung.fleet/1` to inspect next, and why; empty: none.

    Examples
    --------
    >>> best = {"vehicle": "bus-088", "probability": 0.36, "part": "rear_left.damper", "change": None}
    >>> describe_next_inspection({"name": "bus", "inspect_next": best})
    'to learn most about the type bus, inspect bus-088 next: with 36 % probability it deviates'
    """
    best = ranking.get("inspect_next")
    if best is None:
        return ""
    part = "" if best["change"] is None else f", most likely {format_name(best['part'])} {100 * best['change']:+z.0f} %"
    return (
        f"to learn most about the type {ranking['name']}, inspect {best['vehicle']} next: with "
        f"{100 * best['probability']:.0f} % probability it deviates{part}"
    )


def describe_type(type_baseline: TypeBaseline) -> str:
    """Return a sentence on the numbers of vehicles and windows that the baseline of a type was learnt from.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((8, 3, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> fleet = {
    ...     f"car-{n}": [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(of_car)]
    ...     for n, of_car in enumerate(values)
    ... }
    >>> describe_type(sprung.learn_type(fleet, name="zafira"))
    'baseline of the type zafira: learnt from 24 windows of 8 vehicles'
    """
    vehicles = counted(type_baseline.n_vehicles, "vehicle")
    return (
        f"baseline of the type {type_baseline.name}: learnt from {counted(type_baseline.n_windows, 'window')} of "
        f"{vehicles}"
    )


def _row(entry: Mapping[str, Any]) -> tuple[str, ...]:
    """Return the cells of a vehicle; the change is empty if no deviation was detected."""
    if not entry["deviates"]:
        return (entry["vehicle"], str(entry["windows"]), f"{entry['p_value']:.2g}", "", "no deviation detected")
    size = ""
    if entry["change"] is not None:
        low, high = entry["interval"]
        size = f"{100 * entry['change']:+z.0f} ({100 * low:+z.0f} to {100 * high:+z.0f})"
    what = "several parts, or one that the model lacks" if entry["change"] is None else format_name(entry["part"])
    return (entry["vehicle"], str(entry["windows"]), f"{entry['p_value']:.2g}", size, f"deviates: {what}")


_STEPS = {"identifications": "modes", "corners": "corners", "windows": "conditions and parts of windows"}
_VERDICTS = {
    "change": "change",
    "no_change_detected": "no change detected",
    "inconclusive": "inconclusive",
}


def fleet_run_tables(document: Mapping[str, Any]) -> list[Table]:
    """Return the tables of a `sprung.fleet-run/1`: windows, vehicles by verdict, and changed vehicles.

    Examples
    --------
    >>> counts = {"identifications": 0, "corners": 0, "windows": 48}
    >>> run = {"analysed": {"windows": 12}, "windows": counts, "without_result": counts | {"windows": 3}}
    >>> run |= {"verdicts": {"no_change_detected": 3, "inconclusive": 1}, "findings": []}
    >>> for table in fleet_run_tables(run):
    ...     print(table.title, table.rows)
    windows (('conditions and parts of windows', '12', '48', '3'),)
    vehicles (('no change detected', '3'), ('inconclusive', '1'))
    """
    windows = tuple(
        (
            _STEPS[name],
            str(document["analysed"].get(name, 0)),
            str(document["windows"][name]),
            str(document["without_result"][name]),
        )
        for name in _STEPS
        if document["windows"][name]
    )
    verdicts = tuple(
        (words, str(document["verdicts"][verdict]))
        for verdict, words in _VERDICTS.items()
        if verdict in document["verdicts"]
    )
    tables = [
        Table("windows", ("table", "new", "total", "without result"), windows, ends_in_words=False),
        Table("vehicles", ("verdict", "vehicles"), verdicts, ends_in_words=False),
        Table(
            "changed vehicles, the greatest evidence first",
            ("vehicle", "part", "change [%]", "since (UTC)", "severity"),
            tuple(map(_finding, document["findings"])),
            n_words=2,
        ),
    ]
    return [table for table in tables if table.rows]


def describe_fleet_run(document: Mapping[str, Any]) -> list[str]:
    """Return what a run has done, and why windows have no result, one sentence each.

    Examples
    --------
    >>> reasons = [{"reason": "the vehicle stood still", "windows": 3}]
    >>> run = {"analysed": {"windows": 12}, "vehicles_assessed": 4, "analysis_time": 61.0, "reasons": reasons}
    >>> describe_fleet_run(run)
    ['12 windows analysed and 4 vehicles assessed in 61 s', '3 windows: the vehicle stood still']
    """
    new = max(document["analysed"].values(), default=0)
    assessed = counted(document["vehicles_assessed"], "vehicle")
    words = [f"{counted(new, 'window')} analysed and {assessed} assessed in {document['analysis_time']:.0f} s"]
    if not new and not document["vehicles_assessed"]:
        words = ["all windows have results: the lake has no new ones"]
    reasons: Sequence[Mapping[str, Any]] = document["reasons"]
    return [*words, *(f"{counted(entry['windows'], 'window')}: {entry['reason']}" for entry in reasons)]


def fleet_plan_table(document: Mapping[str, Any]) -> Table:
    """Return the table of a `sprung.fleet-plan/1`.

    Examples
    --------
    >>> plan = {"windows": 5000, "new": {"corners": 1800}, "seconds_per_window": {"corners": 2.0}}
    >>> table = fleet_plan_table(plan | {"measured_on": "3 windows of the lake"})
    >>> table.title
    '5000 windows in the lake'
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    step | windows to analyse | CPU s/window | core hours
    corners | 1800 | 2.00 | 1.00
    """
    rows = tuple(
        (
            step,
            str(count),
            f"{document['seconds_per_window'][step]:.2f}",
            f"{count * document['seconds_per_window'][step] / 3600:.2f}",
        )
        for step, count in document["new"].items()
    )
    return Table(
        f"{counted(document['windows'], 'window')} in the lake",
        ("step", "windows to analyse", "CPU s/window", "core hours"),
        rows,
        ends_in_words=False,
        caption=f"cost measured on {document['measured_on']}",
    )


def describe_fleet_plan(document: Mapping[str, Any]) -> list[str]:
    """Return the estimate of a plan, and what is missing, one sentence each.

    Examples
    --------
    >>> plan = {"vehicles": 40, "core_hours": 16.0, "cores": 8, "without_vehicle_file": 12}
    >>> for sentence in describe_fleet_plan(plan):
    ...     print(sentence)
    40 vehicles, 16.00 core hours: about 2.0 h on 8 cores
    12 windows of vehicles without a usable vehicle file: they are recorded with this reason
    """
    hours = document["core_hours"]
    cores = counted(document["cores"], "core")
    time = (
        f"{hours / document['cores']:.1f} h"
        if hours > document["cores"]
        else f"{60 * hours / document['cores']:.0f} min"
    )
    words = [f"{counted(document['vehicles'], 'vehicle')}, {hours:.2f} core hours: about {time} on {cores}"]
    if document["without_vehicle_file"]:
        without = counted(document["without_vehicle_file"], "window")
        words.append(f"{without} of vehicles without a usable vehicle file: they are recorded with this reason")
    return words


def _finding(row: Mapping[str, Any]) -> tuple[str, ...]:
    part = "several parts, or one that the model lacks"
    size = ""
    if row["change"] is not None:
        part = format_name(f"{row['corner']}.{row['component']}")
        size = f"{100 * row['change']:+z.0f} ({100 * row['lower']:+z.0f} to {100 * row['upper']:+z.0f})"
    since = f"{datetime.fromtimestamp(row['since'], UTC):%Y-%m-%d %H:%M}"
    return (row["vehicle"], part, size, since, row["severity"])


def describe_lake(document: Mapping[str, Any]) -> list[str]:
    """Return what a `sprung.lake/1` holds, and what was done to it, in sentences.

    Examples
    --------
    >>> contents = {"windows": 144, "files": 3, "bytes": 21_000_000, "vehicles": [{"vehicle": "bus-17"}]}
    >>> contents |= {"first": "2026-11-20", "last": "2026-11-21", "compacted": None, "removed": 12}
    >>> describe_lake(contents)
    ['144 windows of 1 vehicle in 3 files, 21 MB, 2026-11-20 to 2026-11-21', 'deleted 12 windows']
    """
    size = f"{counted(document['windows'], 'window')} of {counted(len(document['vehicles']), 'vehicle')}"
    period = "" if document["first"] is None else f", {document['first']} to {document['last']}"
    sentences = [f"{size} in {counted(document['files'], 'file')}, {document['bytes'] / 1e6:.4g} MB{period}"]
    if document["compacted"] is not None:
        sentences.append(f"compacted {counted(document['compacted'], 'date')}")
    if document["removed"] is not None:
        sentences.append(f"deleted {counted(document['removed'], 'window')}")
    return sentences


def lake_table(document: Mapping[str, Any]) -> Table:
    """Return the vehicles in a `sprung.lake/1`.

    Examples
    --------
    >>> first = 1_790_000_000_000_000_000
    >>> vehicle = {"vehicle": "bus-17", "windows": 144, "first": first, "last": first + 3_600_000_000_000}
    >>> table = lake_table({"vehicles": [vehicle]})
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    vehicle | windows | first (UTC) | last (UTC)
    bus-17 | 144 | 2026-09-21 14:13 | 2026-09-21 15:13
    """
    rows = (
        (own["vehicle"], str(own["windows"]), format_time(own["first"]), format_time(own["last"]))
        for own in document["vehicles"]
    )
    return Table("", ("vehicle", "windows", "first (UTC)", "last (UTC)"), tuple(rows))


def lake_import_table(document: Mapping[str, Any]) -> Table:
    """Return what a `sprung.lake-import/1` states of each vehicle.

    Examples
    --------
    >>> vehicle = {"vehicle": "bus-17", "files": 2, "added": 10, "known": 4}
    >>> table = lake_import_table({"vehicles": [vehicle]})
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    vehicle | files | windows added | already present
    bus-17 | 2 | 10 | 4
    """
    names = ("files", "added", "known")
    rows = ((own["vehicle"], *(str(own[name]) for name in names)) for own in document["vehicles"])
    return Table("", ("vehicle", "files", "windows added", "already present"), tuple(rows), ends_in_words=False)
