"""Results of a vehicle for other programs: `sprung.report/1`, and tables as CSV, Parquet and JSON files in pieces."""

import csv
import io
import json
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from datetime import UTC, datetime
from itertools import chain
from typing import Any, Literal, TypeAlias, TypeVar, get_args

import numpy as np

from sprung._checks import check_one_of
from sprung.diagnosis.observation import CONDITION_UNITS
from sprung.online.monitor.histories import AlertHistory, VehicleHistory, alerts_of, require_vehicle
from sprung.online.store import Entry, Store
from sprung.results.documents import ReportDocument
from sprung.results.tables.wording import Period

What: TypeAlias = Literal["windows", "modes", "findings", "alerts"]
FileFormat: TypeAlias = Literal["csv", "parquet", "json"]
#: What can be exported, and how.
WHATS: tuple[str, ...] = get_args(What)
FORMATS: tuple[str, ...] = get_args(FileFormat)
#: Media types of the formats.
MEDIA_TYPES = {"csv": "text/csv", "parquet": "application/vnd.apache.parquet", "json": "application/json"}

#: Kind of the values of a column: text, time [UTC ns], number, whole number.
Kind: TypeAlias = Literal["text", "time", "number", "integer"]
#: Kinds of the columns by name. A name ends in the unit of its values, which the stored values of that name lack.
Columns: TypeAlias = dict[str, Kind]
Row: TypeAlias = Mapping[str, Any]
Rows: TypeAlias = Iterator[list[Row]]

#: Beginnings of cells that spreadsheets would take for formulas.
_FORMULAS = ("=", "+", "-", "@", "\t", "\r")
#: Units in the names of columns.
_UNITS = {
    "": "",
    "m/s": "_m_per_s",
    "m/s^2": "_m_per_s2",
    "rad/s": "_rad_per_s",
    "°C": "_deg_c",
    "m^3": "_m3",
    "kg": "_kg",
    "kg m": "_kg_m",
    "kg m^2": "_kg_m2",
}
#: Columns of whole numbers and of texts; times end in _utc, and all others are numbers.
_INTEGERS = {"boot", "window", "mode", "alert", "severity_number", "times_raised"}
_TEXTS = {
    *("vehicle", "is_conclusive", "reason", "sensor_faults", "label", "corner", "component", "severity", "advice"),
    *("runner_up", "sentence", "cause", "state", "assignee", "verdict", "verdict_part", "verdict_action", "verdict_by"),
}
_OF_WINDOW = ("vehicle", "boot", "window", "start_utc")
_CHANGE = ("change_percent", "change_low_percent", "change_high_percent")
_OF_MODE = (
    *(*_OF_WINDOW, "mode", "label", "natural_frequency_hz", "natural_frequency_std_hz"),
    *("damping_ratio", "damping_ratio_std", "mpc", "stable_rate"),
)
_OF_FINDING = (
    *(*_OF_WINDOW, "corner", "component", *_CHANGE, "score", "severity", "severity_number", "advice", "since_utc"),
    *("since_earliest_utc", "since_latest_utc", "runner_up", "trend_percent_per_hour", "sentence"),
)
_OF_ALERT = (
    *("alert", "vehicle", "cause", "severity_number", "severity", "state", "raised_utc", "cleared_utc"),
    *("times_raised", "assignee", "shelved_until_utc", *_CHANGE, "detectable_percent", "sentence"),
    *("verdict", "verdict_part", "verdict_action", "verdict_by", "verdict_utc"),
)


T = TypeVar("T")
K = TypeVar("K", bound=Hashable)


def report_document(history: VehicleHistory, *, now: int) -> ReportDocument:
    """Return the report of a vehicle and period as `sprung.report/1`, written at a time (UTC ns)."""
    state, windows = history.state, history.windows
    usable = [window for window in windows if window.is_conclusive]
    changes = () if state.baseline is None else state.parts
    modes = grouped((label, values) for window in usable for label, values in window.modes.items())
    conditions = grouped(
        (name, value) for window in windows for name, value in window.conditions.items() if np.isfinite(value)
    )
    faults = grouped(
        (fault, time)
        for time, window in zip(history.times.tolist(), windows, strict=True)
        for fault in dict.fromkeys((fault.channel, fault.kind) for fault in window.sensor_faults)
    )
    sizes = ("change", "interval", "interval_with_common", "detectable")
    return ReportDocument.model_validate(
        {
            "schema": "sprung.report/1",
            "vehicle": history.vehicle.vehicle,
            "since": history.period.since,
            "until": history.period.until,
            "written": now,
            "verdict": state.verdict,
            "sentence": state.sentence,
            "windows": len(windows),
            "usable": len(usable),
            "baseline": state.baseline,
            "changes": [{"component": part.part, **{name: getattr(part, name) for name in sizes}} for part in changes],
            "changes_since": None if state.baseline is None else state.since,
            "modes": {
                label: {
                    "windows": len(values),
                    "natural_frequency": _range([frequency for frequency, _ in values]),
                    "damping_ratio": _range([ratio for _, ratio in values]),
                }
                for label, values in modes.items()
            },
            "conditions": {name: _range(values) for name, values in conditions.items()},
            "sensor_faults": [
                {"channel": channel, "kind": kind, "windows": len(times), "first": times[0], "last": times[-1]}
                for (channel, kind), times in faults.items()
            ],
            "reasons": dict(Counter(window.reason for window in windows if window.reason).most_common()),
            "alerts": [
                {
                    "alert": each.alert,
                    "cleared": each.alert.cleared,
                    "evidence": each.alert.evidence,
                    "history": each.history,
                    "verdicts": each.verdicts,
                }
                for each in history.alerts
            ],
        }
    )


def grouped(pairs: Iterable[tuple[K, T]]) -> dict[K, list[T]]:
    """Return the values of each key, in order."""
    groups: dict[K, list[T]] = {}
    for key, value in pairs:
        groups.setdefault(key, []).append(value)
    return groups


def _range(values: Sequence[float]) -> Mapping[str, float]:
    """Return lowest, median and highest value."""
    return dict(zip(("low", "median", "high"), np.quantile(values, (0.0, 0.5, 1.0)).tolist(), strict=True))


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
    require_vehicle(store, vehicle)
    columns, rows = _table(store, vehicle, what, period or Period())
    if file_format == "csv":
        return _csv_pieces(columns, rows)
    if file_format == "parquet":
        return _parquet_pieces(columns, rows)
    return _json_pieces(columns, rows, head={"schema": "sprung.export/1", "vehicle": vehicle, "what": what})


def _table(store: Store, vehicle: str, what: str, period: Period) -> tuple[Columns, Rows]:
    """Return kinds of columns, and rows in pieces; the columns of windows are those of all windows of the period."""
    if what == "alerts":
        return _columns(_OF_ALERT), iter([[_alert(alert) for alert in alerts_of(store, vehicle, period)]])

    def pieces(kind: Literal["observations", "modes", "findings"]) -> Iterator[list[Entry]]:
        return store.results.pieces(kind, vehicle, since=period.since, until=period.until)

    def rows(kind: Literal["observations", "modes", "findings"], of: Callable[[Entry], list[Row]]) -> Rows:
        return (list(chain.from_iterable(map(of, piece))) for piece in pieces(kind))

    if what == "modes":
        return _columns(_OF_MODE), rows("modes", _modes)
    if what == "findings":
        return _columns(_OF_FINDING), rows("findings", _finding)
    names: dict[str, dict[str, None]] = {"conditions": {}, "components": {}, "modes": {}}
    for entry in chain.from_iterable(pieces("observations")):
        for kind, known in names.items():
            known.update(dict.fromkeys(entry.document.get(kind) or ()))
    columns = [*_OF_WINDOW, "is_conclusive", "reason", "sensor_faults", *map(_condition, names["conditions"])]
    for component in (name.replace(".", "_") for name in names["components"]):
        columns += [f"{component}_ln_ratio", f"{component}_ln_ratio_std"]
    for label in names["modes"]:
        columns += [f"{label}_natural_frequency_hz", f"{label}_damping_ratio"]
    return _columns(columns), rows("observations", _window)


def _columns(names: Iterable[str]) -> Columns:
    """Return columns with their kinds."""
    return {name: _kind(name) for name in names}


def _kind(name: str) -> Kind:
    """Return the kind of the values of a column."""
    if name.endswith("_utc"):
        return "time"
    if name in _INTEGERS:
        return "integer"
    return "text" if name in _TEXTS else "number"


def _window(entry: Entry) -> list[Row]:
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
        plain = component.replace(".", "_")
        row |= {f"{plain}_ln_ratio": ratio, f"{plain}_ln_ratio_std": deviation}
    for label, (frequency, damping) in (document.get("modes") or {}).items():
        row |= {f"{label}_natural_frequency_hz": frequency, f"{label}_damping_ratio": damping}
    return [row]


def _modes(entry: Entry) -> list[Row]:
    """Return the rows of the modes of a window."""
    modes = enumerate(entry.document.get("modes") or (), start=1)
    return [_in_units({**mode, **_place(entry), "mode": number}, _OF_MODE) for number, mode in modes]


def _finding(entry: Entry) -> list[Row]:
    """Return the row of a finding."""
    found = entry.document
    low, high = found.get("interval") or (None, None)
    times = {"since": found.get("since")}
    times["since_earliest"], times["since_latest"] = found.get("since_interval") or (None, None)
    values = {
        **found,
        **_place(entry),
        "change_low": low,
        "change_high": high,
        "trend_per_hour": (found.get("trend") or {}).get("per_hour"),
        **{name: None if time is None else round(1e9 * time) for name, time in times.items()},
    }
    return [_in_units(values, _OF_FINDING)]


def _alert(each: AlertHistory) -> Row:
    """Return the row of an alert with its last verdict."""
    alert = each.alert
    low, high = alert.interval or (None, None)
    names = ("vehicle", "cause", "state", "raised", "cleared", "assignee", "shelved_until", "change", "sentence")
    values = {
        **{name: getattr(alert, name) for name in names},
        "alert": alert.number,
        "severity_number": alert.severity,
        "severity": alert.step,
        "times_raised": alert.count,
        "change_low": low,
        "change_high": high,
        "detectable": alert.detectable.get(alert.cause),
    }
    for given in each.verdicts[-1:]:
        values |= {f"verdict_{name}": getattr(given, name) for name in ("part", "action")}
        values |= {"verdict": given.verdict, "verdict_by": given.who, "verdict_utc": given.time}
    return _in_units({"verdict_utc": None, **values}, _OF_ALERT)


def _in_units(values: Mapping[str, Any], columns: Iterable[str]) -> Row:
    """Return the values of columns in the units of their names, from values without units."""
    row = {}
    for name in columns:
        bare = name.replace("_percent", "").removesuffix("_utc").removesuffix("_hz")
        value = values.get(name if name in values else bare)
        row[name] = 100 * value if "_percent" in name and value is not None else value
    return row


def _place(entry: Entry) -> dict[str, Any]:
    """Return where a document belongs."""
    return {"vehicle": entry.vehicle, "boot": entry.boot, "window": entry.number, "start_utc": entry.t0}


def _condition(name: str) -> str:
    """Return the column of a condition."""
    return f"{name}{_UNITS[CONDITION_UNITS.get(name, '')]}"


def iso_time(time: int) -> str:
    """Return a time (UTC ns) in the form of ISO 8601, to the nanosecond.

    Examples
    --------
    >>> iso_time(1_000_000_001)
    '1970-01-01T00:00:01.000000001Z'
    """
    seconds, rest = divmod(time, 10**9)
    return f"{datetime.fromtimestamp(seconds, tz=UTC):%Y-%m-%dT%H:%M:%S}.{rest:09d}Z"


def _csv_pieces(columns: Columns, rows: Rows) -> Iterator[bytes]:
    """Yield a CSV file in pieces; an apostrophe precedes text that a spreadsheet would take for a formula."""
    buffer = io.BytesIO()
    writer = csv.writer(io.TextIOWrapper(buffer, "utf-8", newline="", write_through=True), lineterminator="\r\n")
    writer.writerow([_cell(name, "text") for name in columns])
    yield _emptied(buffer)
    for piece in rows:
        writer.writerows([_cell(row.get(name), kind) for name, kind in columns.items()] for row in piece)
        yield _emptied(buffer)


def _cell(value: Any, kind: Kind) -> Any:
    """Return a cell of a CSV file: no text begins like a formula."""
    if value is None:
        return ""
    if kind == "text":
        return f"'{value}" if str(value).startswith(_FORMULAS) else str(value)
    return iso_time(value) if kind == "time" else value


def _json_pieces(columns: Columns, rows: Rows, *, head: Mapping[str, str]) -> Iterator[bytes]:
    """Yield a JSON document in pieces: `head`, the names of the `columns`, and the `rows` as objects."""
    begin = json.dumps({**head, "columns": list(columns)})[:-1]
    yield f'{begin}, "rows": ['.encode()
    before = "\n"
    for piece in rows:
        texts = []
        for row in piece:
            is_time = {name: kind == "time" and row.get(name) is not None for name, kind in columns.items()}
            values = {name: iso_time(row[name]) if is_time[name] else row.get(name) for name in columns}
            texts.append(before + json.dumps(values, allow_nan=False))
            before = ",\n"
        yield "".join(texts).encode()
    yield b"\n]}\n"


def _parquet_pieces(columns: Columns, rows: Rows) -> Iterator[bytes]:
    """Yield a Parquet file in pieces, a row group each."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    types = {"text": pa.string(), "time": pa.timestamp("ns", "UTC"), "number": pa.float64(), "integer": pa.int64()}
    schema = pa.schema([(name, types[kind]) for name, kind in columns.items()])
    buffer = io.BytesIO()
    with pq.ParquetWriter(pa.PythonFile(buffer, mode="w"), schema, compression="zstd") as writer:
        for piece in rows:
            if piece:
                arrays = [pa.array([row.get(field.name) for row in piece], type=field.type) for field in schema]
                writer.write_table(pa.Table.from_arrays(arrays, schema=schema))
            yield _emptied(buffer)
    yield _emptied(buffer)


def _emptied(buffer: io.BytesIO) -> bytes:
    """Return the contents of a buffer, and empty it."""
    content = buffer.getvalue()
    buffer.seek(0)
    buffer.truncate()
    return content
