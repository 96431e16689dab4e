"""Windows, modes, findings and alerts of a vehicle as tables for other programs: CSV, Parquet and JSON, in pieces."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from itertools import chain
from typing import Any, Literal, TypeAlias, get_args

import numpy as np

from sprung._checks import check_one_of
from sprung.diagnosis.observation import CONDITION_UNITS
from sprung.errors import ParameterError
from sprung.online.monitor.table_files import Columns, Row, Rows, csv_pieces, json_pieces, parquet_pieces
from sprung.online.monitor.vehicle_history import AlertHistory, alerts_of
from sprung.online.store import Entry, Store
from sprung.results.periods import Period

What: TypeAlias = Literal["windows", "modes", "findings", "alerts"]
FileFormat: TypeAlias = Literal["csv", "parquet", "json"]
#: What can be exported, and how.
WHATS: tuple[str, ...] = get_args(What)
FORMATS: tuple[str, ...] = get_args(FileFormat)
#: Media types of the formats.
MEDIA_TYPES = {"csv": "text/csv", "parquet": "application/vnd.apache.parquet", "json": "application/json"}

#: Units in the names of columns.
_UNITS = {
    "": "",
    "m/s": "_m_per_s",
    "rad/s": "_rad_per_s",
    "°C": "_deg_c",
    "m^3": "_m3",
    "kg": "_kg",
    "kg m": "_kg_m",
    "kg m^2": "_kg_m2",
}
_OF_WINDOW: Columns = {"vehicle": "text", "boot": "integer", "window": "integer", "start_utc": "time"}
_OF_MODE: Columns = {
    **_OF_WINDOW,
    "mode": "integer",
    "label": "text",
    "natural_frequency_hz": "number",
    "natural_frequency_std_hz": "number",
    "damping_ratio": "number",
    "damping_ratio_std": "number",
    "mpc": "number",
    "stable_rate": "number",
}
_OF_FINDING: Columns = {
    **_OF_WINDOW,
    "corner": "text",
    "component": "text",
    "change_percent": "number",
    "change_low_percent": "number",
    "change_high_percent": "number",
    "score": "number",
    "severity": "text",
    "severity_number": "integer",
    "advice": "text",
    "since_utc": "time",
    "since_earliest_utc": "time",
    "since_latest_utc": "time",
    "runner_up": "text",
    "trend_percent_per_hour": "number",
    "sentence": "text",
}
_OF_ALERT: Columns = {
    "alert": "integer",
    "vehicle": "text",
    "cause": "text",
    "severity_number": "integer",
    "severity": "text",
    "state": "text",
    "raised_utc": "time",
    "cleared_utc": "time",
    "times_raised": "integer",
    "assignee": "text",
    "shelved_until_utc": "time",
    "change_percent": "number",
    "change_low_percent": "number",
    "change_high_percent": "number",
    "detectable_percent": "number",
    "sentence": "text",
    "verdict": "text",
    "verdict_part": "text",
    "verdict_action": "text",
    "verdict_by": "text",
    "verdict_utc": "time",
}


def export(
    store: Store, vehicle: str, what: str, *, file_format: str = "csv", period: Period | None = None
) -> Iterator[bytes]:
    """Return an iterator over the pieces of a file with the stored results of a vehicle and period.

    Parameters
    ----------
    store
        Store of the monitor.
    vehicle
        Name of the vehicle.
    what
        "windows": conditions, components and body modes, a row for each window; "modes": identified modes, a row for
        each; "findings": changes found, a row for each in each window; "alerts": a row for each, with the last verdict.
    file_format
        "csv", "parquet" or "json" (`sprung.export/1`).
    period
        Period of the windows, or in which alerts were active; None: everything.

    Raises
    ------
    ParameterError
        If the vehicle, `what` or the format is unknown.
    StoreError
        If the store cannot be read, also while the pieces are taken.

    Notes
    -----
    Columns have their units in their names; times are ISO 8601 in UTC, and time stamps in Parquet. In CSV, a text that
    a spreadsheet would take for a formula has an apostrophe in front. Components are in terms of the vehicle file:
    `..._ln_ratio` is ln(value / nominal value), `..._ln_ratio_std` its standard deviation.
    """
    check_one_of("what", what, WHATS)
    check_one_of("format", file_format, FORMATS)
    if store.inbox.vehicle(vehicle) is None:
        raise ParameterError(f"unknown vehicle {vehicle!r}: sprung vehicles lists the known ones")
    columns, rows = _TABLES[what](store, vehicle, period or Period())
    if file_format == "csv":
        return csv_pieces(columns, rows)
    if file_format == "parquet":
        return parquet_pieces(columns, rows)
    return json_pieces(columns, rows, head={"schema": "sprung.export/1", "vehicle": vehicle, "what": what})


def _windows(store: Store, vehicle: str, period: Period) -> tuple[Columns, Rows]:
    """Return the table of windows, whose columns are those of all windows of the period."""

    def pieces() -> Iterator[list[Entry]]:
        return store.results.pieces("observations", vehicle, since=period.since, until=period.until)

    components: dict[str, None] = {}
    conditions: dict[str, None] = {}
    labels: dict[str, None] = {}
    for entry in chain.from_iterable(pieces()):
        components.update(dict.fromkeys(entry.document.get("components") or ()))
        conditions.update(dict.fromkeys(entry.document.get("conditions") or ()))
        labels.update(dict.fromkeys(entry.document.get("modes") or ()))
    columns: Columns = {**_OF_WINDOW, "is_conclusive": "text", "reason": "text", "sensor_faults": "text"}
    columns |= {_condition(name): "number" for name in conditions}
    for component in components:
        columns |= {f"{_plain(component)}_ln_ratio": "number", f"{_plain(component)}_ln_ratio_std": "number"}
    for label in labels:
        columns |= {f"{label}_natural_frequency_hz": "number", f"{label}_damping_ratio": "number"}
    return columns, (list(map(_window, piece)) for piece in pieces())


def _window(entry: Entry) -> Row:
    """Return the row of a window."""
    document = entry.document
    faults = document.get("sensor_faults") or ()
    row = {
        **_place(entry),
        "is_conclusive": "no" if document.get("reason") else "yes",
        "reason": document.get("reason", ""),
        "sensor_faults": "; ".join(f"{fault['channel']} {fault['kind']}" for fault in faults),
        **{_condition(name): value for name, value in (document.get("conditions") or {}).items()},
    }
    ratios = document.get("log_ratios") or ()
    deviations = np.sqrt(np.diag(document["covariance"])).tolist() if ratios else ()
    for component, ratio, deviation in zip(document.get("components") or (), ratios, deviations, strict=False):
        row |= {f"{_plain(component)}_ln_ratio": ratio, f"{_plain(component)}_ln_ratio_std": deviation}
    for label, (frequency, damping) in (document.get("modes") or {}).items():
        row |= {f"{label}_natural_frequency_hz": frequency, f"{label}_damping_ratio": damping}
    return row


def _modes(store: Store, vehicle: str, period: Period) -> tuple[Columns, Rows]:
    """Return the table of identified modes."""
    pieces = store.results.pieces("modes", vehicle, since=period.since, until=period.until)
    return _OF_MODE, (list(chain.from_iterable(map(_modes_of, piece))) for piece in pieces)


def _modes_of(entry: Entry) -> list[Row]:
    """Return the rows of the modes of a window."""
    names = ("label", "damping_ratio", "damping_ratio_std", "mpc", "stable_rate")
    return [
        {
            **_place(entry),
            "mode": number,
            "natural_frequency_hz": mode.get("natural_frequency"),
            "natural_frequency_std_hz": mode.get("natural_frequency_std"),
            **{name: mode.get(name) for name in names},
        }
        for number, mode in enumerate(entry.document.get("modes") or (), start=1)
    ]


def _findings(store: Store, vehicle: str, period: Period) -> tuple[Columns, Rows]:
    """Return the table of findings."""
    pieces = store.results.pieces("findings", vehicle, since=period.since, until=period.until)
    return _OF_FINDING, (list(map(_finding, piece)) for piece in pieces)


def _finding(entry: Entry) -> Row:
    """Return the row of a finding."""
    document = entry.document
    names = ("corner", "component", "score", "severity", "severity_number", "advice", "runner_up", "sentence")
    earliest, latest = document.get("since_interval") or (None, None)
    trend = document.get("trend") or {}
    return {
        **_place(entry),
        **{name: document.get(name) for name in names},
        **_change(document.get("change"), document.get("interval")),
        "since_utc": _nanoseconds(document.get("since")),
        "since_earliest_utc": _nanoseconds(earliest),
        "since_latest_utc": _nanoseconds(latest),
        "trend_percent_per_hour": _percent(trend.get("per_hour")),
    }


def _alerts(store: Store, vehicle: str, period: Period) -> tuple[Columns, Rows]:
    """Return the table of alerts that were active in a period, and their last verdicts."""
    return _OF_ALERT, iter([list(map(_alert, alerts_of(store, vehicle, period)))])


def _alert(alert: AlertHistory) -> Row:
    """Return the row of an alert."""
    state = alert.state
    verdict = alert.verdicts[-1] if alert.verdicts else None
    given = (
        {}
        if verdict is None
        else {
            "verdict": verdict.verdict,
            "verdict_part": verdict.part,
            "verdict_action": verdict.action,
            "verdict_by": verdict.who,
            "verdict_utc": verdict.time,
        }
    )
    return {
        "alert": state.number,
        "vehicle": state.vehicle,
        "cause": state.cause,
        "severity_number": state.severity,
        "severity": state.step,
        "state": state.state,
        "raised_utc": state.raised,
        "cleared_utc": state.cleared,
        "times_raised": state.count,
        "assignee": state.assignee,
        "shelved_until_utc": state.shelved_until,
        **_change(state.change, state.interval),
        "detectable_percent": _percent(state.detectable.get(state.cause)),
        "sentence": state.sentence,
        **given,
    }


_TABLES: Mapping[str, Callable[[Store, str, Period], tuple[Columns, Rows]]] = {
    "windows": _windows,
    "modes": _modes,
    "findings": _findings,
    "alerts": _alerts,
}


def _place(entry: Entry) -> dict[str, Any]:
    """Return where a document belongs."""
    return {"vehicle": entry.vehicle, "boot": entry.boot, "window": entry.number, "start_utc": entry.t0}


def _change(change: float | None, interval: Sequence[float] | None) -> dict[str, float | None]:
    """Return size and interval of a change [%]."""
    low, high = interval or (None, None)
    return {
        "change_percent": _percent(change),
        "change_low_percent": _percent(low),
        "change_high_percent": _percent(high),
    }


def _percent(ratio: float | None) -> float | None:
    """Return a ratio in percent."""
    return None if ratio is None else 100 * ratio


def _nanoseconds(time: float | None) -> int | None:
    """Return a time [s] in UTC ns."""
    return None if time is None else round(1e9 * time)


def _condition(name: str) -> str:
    """Return the column of a condition."""
    return f"{name}{_UNITS[CONDITION_UNITS.get(name, '')]}"


def _plain(component: str) -> str:
    """Return the name of a component without its dot."""
    return component.replace(".", "_")
