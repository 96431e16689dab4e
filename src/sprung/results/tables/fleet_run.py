"""Tables of a run over the archive of a fleet."""

from collections.abc import Mapping, Sequence
from datetime import UTC, datetime
from typing import Any

from sprung._display import counted
from sprung.results.tables.table import Table, in_words

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


def fleet_run_in_words(document: Mapping[str, Any]) -> list[str]:
    """Return what a run has done, and why windows have no result, one sentence each.

    Examples
    --------
    >>> reasons = [{"reason": "the vehicle stood still", "windows": 3}]
    >>> run = {"analysed": {"windows": 12}, "vehicles_assessed": 4, "analysis_time": 61.0, "reasons": reasons}
    >>> fleet_run_in_words(run)
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
        f"{document['windows']} windows in the lake",
        ("step", "windows to analyse", "CPU s/window", "core hours"),
        rows,
        ends_in_words=False,
        caption=f"cost measured on {document['measured_on']}",
    )


def fleet_plan_in_words(document: Mapping[str, Any]) -> list[str]:
    """Return the estimate of a plan, and what is missing, one sentence each.

    Examples
    --------
    >>> plan = {"vehicles": 40, "core_hours": 16.0, "cores": 8, "without_vehicle_file": 12}
    >>> for sentence in fleet_plan_in_words(plan):
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
    """Return the cells of a finding."""
    part = "several parts, or one that the model lacks"
    size = ""
    if row["change"] is not None:
        part = in_words(f"{row['corner']}.{row['component']}")
        size = f"{100 * row['change']:+.0f} ({100 * row['lower']:+.0f} to {100 * row['upper']:+.0f})"
    since = f"{datetime.fromtimestamp(row['since'], UTC):%Y-%m-%d %H:%M}"
    return (row["vehicle"], part, size, since, row["severity"])
