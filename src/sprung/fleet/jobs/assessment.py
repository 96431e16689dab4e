"""Baselines and diagnoses of vehicles from the rows of their windows, one vehicle or type at a time."""

import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, fields, replace
from hashlib import blake2b
from typing import Any

import numpy as np
import pyarrow as pa

from sprung.diagnosis import (
    LEARNING_WINDOWS,
    Observation,
    diagnose,
    false_discoveries,
    learn,
    learn_type,
    mode_changes,
)
from sprung.diagnosis.scatter import LASTING, pooled
from sprung.errors import SprungError
from sprung.fleet.jobs.results import SCHEMAS
from sprung.results.documents import (
    baseline_document,
    baseline_from_document,
    diagnosis_document,
    observation_from_document,
    restored_statistics,
    type_baseline_document,
    type_baseline_from_document,
)
from sprung.vehicles import vehicle_from_text

#: Overlap of windows that does not count [ns]: clocks of loggers jitter.
_OVERLAP = 10**9
_ARROW = {str: pa.string(), int: pa.int64(), int | None: pa.int64(), list[float] | None: pa.list_(pa.float64())}


@dataclass(frozen=True, slots=True)
class WindowRow:
    """What an assessment takes of a row of the table of windows; the keys alone have no document and residuals."""

    vehicle: str
    start: int
    digest: str
    duration: float
    is_valid: bool
    reason: str = ""
    has_result: bool = True
    document: str = ""
    residuals: Mapping[str, Any] | None = None

    @classmethod
    def of(cls, row: Mapping[str, Any]) -> "WindowRow":
        """Return a row with further columns as such a row."""
        return cls(**{field.name: row[field.name] for field in fields(cls) if field.name in row})

    def observation(self, name: str) -> Observation:
        """Return the observation of the window, under the name of its vehicle file."""
        observation = observation_from_document(json.loads(self.document))
        return replace(observation, vehicle=name, residuals=restored_statistics(self.residuals))


@dataclass(frozen=True, slots=True)
class Outline:
    """What is known of a vehicle without the results of its windows: which of them an assessment needs."""

    vehicle: str
    type: str
    type_name: str
    vehicle_file: str
    vehicle_text: str
    state: str  # digest of its windows and the settings
    n_windows: int
    n_valid: int
    n_left_out: int  # windows that overlap earlier ones
    learning: str  # digest of the windows of the baseline; empty where they are too few
    learn_until: int | None  # start of the last of them, UTC ns
    since: int | None  # start of the first window to compare with the baseline, UTC ns; None where there is none
    since_alone: int | None  # the same for a vehicle without a baseline
    lack: str  # why there is no baseline
    failure: str  # why a window has no result


@dataclass(frozen=True, slots=True)
class Compared(Outline):
    """A vehicle with what it is compared with, each empty where there is none; `since` is that of the comparison."""

    baseline: str  # sprung.baseline/1 of the vehicle
    type_baseline: str  # sprung.type_baseline/1 of its type
    weights: list[float] | None  # of the scatter of parts that the baselines of its type show together
    type_state: str
    no_baseline: str  # why it could not be learnt


OUTLINE = pa.schema([(field.name, _ARROW[field.type]) for field in fields(Outline)])  # type: ignore[index]
COMPARED = pa.schema([(field.name, _ARROW[field.type]) for field in fields(Compared)])  # type: ignore[index]
#: Baselines as they are learnt; one without a document could not be, and `reason` states why.
LEARNT = pa.schema([*SCHEMAS["baselines"], ("reason", pa.string())])
#: What the baseline of a vehicle shows of the scatter of parts, and what all of a type show together.
WEIGHTS = pa.schema([("vehicle", pa.string()), ("type", pa.string()), ("weights", pa.list_(pa.float64()))])
SCATTER = pa.schema([("type", pa.string()), ("weights", pa.list_(pa.float64())), ("scatter_state", pa.string())])
#: Assessments: diagnoses without what only all vehicles together state.
SCHEMA = pa.schema([field for field in SCHEMAS["diagnoses"] if field.name != "is_discovery"])


@dataclass(frozen=True, slots=True)
class AssessmentSettings:
    """Settings of baselines and diagnoses.

    Parameters
    ----------
    learning_windows
        Number of valid windows that a baseline is learnt from, at least 2: the first ones of a vehicle.
    max_windows
        Number of last windows that a diagnosis is made of.
    false_alarms, windows_per_day
        Rate of false alarms of a healthy vehicle per day of driving, and windows in such a day.
    """

    learning_windows: int = LEARNING_WINDOWS
    max_windows: int = 96
    false_alarms: float = 1e-3
    windows_per_day: float = 48.0


def without_overlaps(rows: Sequence[WindowRow]) -> list[WindowRow]:
    """Return windows in the order of time, without those that overlap earlier ones, whatever their order was."""
    kept: list[WindowRow] = []
    end = None
    for row in sorted(rows, key=lambda row: (row.start, -row.duration, row.digest)):
        if end is None or row.start >= end - _OVERLAP:
            kept.append(row)
            end = row.start + round(row.duration * 1e9)
    return kept


def _learning(windows: Sequence[WindowRow], count: int) -> list[WindowRow]:
    """Return the first valid windows, if there are enough of them."""
    valid = [row for row in windows if row.is_valid]
    return valid[:count] if len(valid) >= count else []


def outline(vehicle: Mapping[str, str], keys: Sequence[WindowRow], settings: AssessmentSettings) -> Outline:
    """Return which windows of a vehicle its assessment needs.

    Parameters
    ----------
    vehicle
        The first fields of an `Outline`, `vehicle` to `state`.
    keys
        All windows of the vehicle, in any order.
    settings
        Settings of baseline and diagnosis.

    Notes
    -----
    The baseline is learnt from the first valid windows, and the last ones after these are compared with it. A vehicle
    with too few is compared with its type, where that is known, or left with right.
    """
    windows = without_overlaps(keys)
    has_file = bool(vehicle["vehicle_file"])
    learning = _learning(windows, settings.learning_windows) if has_file else []
    until = learning[-1].start if learning else None
    results = [row for row in windows if row.has_result] if has_file else []
    alone = results[-settings.max_windows :]
    compared = [row for row in results if until is not None and row.start > until][-settings.max_windows :]
    n_valid = sum(row.is_valid for row in windows)
    lack = f"{n_valid} of the {settings.learning_windows} valid windows that a baseline needs"
    failures = [row.reason for row in windows if not row.has_result]
    return Outline(
        **vehicle,
        n_windows=len(keys),
        n_valid=sum(row.is_valid for row in keys),
        n_left_out=len(keys) - len(windows),
        learning=_digest(vehicle["vehicle_file"], learning) if learning else "",
        learn_until=until,
        since=compared[0].start if compared else None,
        since_alone=alone[0].start if alone else None,
        lack=lack if has_file and not learning else "",
        failure=max(sorted(set(failures)), key=failures.count, default=""),
    )


def learnt(vehicle: Outline, rows: Sequence[WindowRow], settings: AssessmentSettings) -> dict[str, Any]:
    """Return the baseline of a vehicle, as a row of `LEARNT`.

    Parameters
    ----------
    vehicle
        The vehicle.
    rows
        Windows with results, in any order: all of the vehicle up to `learn_until`.
    settings
        Settings of the baseline.
    """
    outcome = {
        "vehicle": vehicle.vehicle,
        "type": vehicle.type,
        "vehicle_file": vehicle.vehicle_file,
        "until": vehicle.learn_until,
        "state": vehicle.learning,
        "document": "",
        "reason": "",
    }
    learning = _learning(without_overlaps(rows), settings.learning_windows)
    least = max(2, settings.learning_windows // 2)
    try:
        baseline = learn([row.observation(vehicle.type_name) for row in learning], min_windows=least)
    except Exception as error:  # whatever a vehicle makes of it, the others go on
        return outcome | {"reason": f"no baseline: {_sentence(error)}"}
    document = json.dumps(baseline_document(baseline).as_json())
    return outcome | {"n_windows": baseline.n_windows, "document": document}


def assess(vehicle: Compared, rows: Sequence[WindowRow], settings: AssessmentSettings) -> dict[str, Any]:
    """Return the assessment of a vehicle, as a row of `SCHEMA`.

    Parameters
    ----------
    vehicle
        The vehicle, with `since` of the comparison that is made.
    rows
        Windows with results, in any order: all of the vehicle from `since` on.
    settings
        Settings of the diagnosis.
    """
    names = ("vehicle", "type", "vehicle_file", "n_windows", "n_valid", "n_left_out", "state", "type_state")
    reason = vehicle.no_baseline or vehicle.lack
    outcome = {name: getattr(vehicle, name) for name in names} | {"verdict": "inconclusive", "reason": reason}
    if vehicle.since is None:
        none = "no window after those of the baseline" if vehicle.baseline else vehicle.failure
        return outcome | {"reason": none}
    try:
        return outcome | _assessed(vehicle, reason, without_overlaps(rows), settings)
    except Exception as error:  # whatever a vehicle makes of it, the others go on
        return outcome | {"reason": _sentence(error)}


def type_of(kind: Mapping[str, str], rows: Sequence[WindowRow], settings: AssessmentSettings) -> dict[str, Any] | None:
    """Return the baseline of a type as a row of the table of types; None where it cannot be learnt.

    Parameters
    ----------
    kind
        `type`, `name` and `state` of the type.
    rows
        Windows with results of several vehicles of the type, in any order.
    settings
        Settings of baselines: each vehicle takes part with the windows of its own baseline.
    """
    learning = {}
    for vehicle in sorted({row.vehicle for row in rows}):
        own = without_overlaps([row for row in rows if row.vehicle == vehicle])
        learning[vehicle] = [row.observation("") for row in _learning(own, settings.learning_windows)]
    try:
        of_type = learn_type({vehicle: own for vehicle, own in learning.items() if own}, name=kind["name"])
    except SprungError:
        return None
    return {
        "type": kind["type"],
        "name": of_type.name,
        "n_vehicles": of_type.n_vehicles,
        "n_windows": of_type.n_windows,
        "document": json.dumps(type_baseline_document(of_type).as_json()),
        "state": kind["state"],
    }


def weights_of(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
    """Yield what each baseline that can be read shows of the scatter of parts, as rows of `WEIGHTS`."""
    for batch in batches:
        rows = []
        for row in batch.to_pylist():
            with suppress(Exception):  # its own vehicle states the reason
                baseline = baseline_from_document(json.loads(row["document"]))
                rows.append(row | {"weights": baseline.weights.ravel().tolist()})
        yield pa.RecordBatch.from_pylist(rows, schema=WEIGHTS)


def common_scatter(table: pa.Table) -> pa.Table:
    """Return what the baselines of a type show together of the scatter of parts, as a row of `SCATTER`.

    Parameters
    ----------
    table
        Rows of `WEIGHTS` of one type, in any order.

    Notes
    -----
    As by `sprung.rank_fleet`. Vehicles are assessed again where this changes: ln p / p0 of each probability p, with p0
    before any window, is rounded to a tenth and not below that from which on it counts as the least, so that one
    baseline more of many changes nothing.
    """
    rows = sorted(table.to_pylist(), key=lambda row: row["vehicle"])
    prior = LASTING.prior
    odds = np.log(np.maximum(pooled(np.reshape(row["weights"], prior.shape) for row in rows) / prior, 1e-300))
    weights = prior * np.exp(np.round(np.maximum(odds, np.log(LASTING.rare / LASTING.caution)), 1))
    weights /= np.sum(weights)
    state = blake2b(repr(weights.tolist()).encode(), digest_size=6).hexdigest()
    row = {"type": rows[0]["type"], "weights": weights.ravel().tolist(), "scatter_state": state}
    return pa.Table.from_pylist([row], schema=SCATTER)


def discoveries(table: pa.Table, *, rate: float, n_vehicles: int) -> pa.Table:
    """Return the vehicles that have changed at a rate of false discoveries in the fleet, as a table of names.

    Parameters
    ----------
    table
        Columns `vehicle` and `e_value` of the vehicles whose e-value could be among the discoveries: at least 1 / rate.
    rate
        Expected share of healthy vehicles among the discoveries.
    n_vehicles
        Number of vehicles that were compared.

    Notes
    -----
    e-BH of n vehicles looks for the largest k whose k-th e-value is at least n / (k rate), so that values below
    1 / rate never count: that of the m others at the rate `rate` m / n is the same.
    """
    values = table["e_value"].to_pylist()
    chosen = false_discoveries(values, rate=rate * len(values) / n_vehicles) if values else []
    return pa.table(
        {"vehicle": [table["vehicle"][k].as_py() for k in chosen]}, schema=pa.schema([("vehicle", "string")])
    )


def findings_of(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
    """Yield the findings of diagnoses as rows of the table of findings."""
    for batch in batches:
        rows = [
            {
                "vehicle": row["vehicle"],
                **{name: finding[name] for name in ("corner", "component", "change", "since", "score", "severity")},
                "lower": None if finding["interval"] is None else finding["interval"][0],
                "upper": None if finding["interval"] is None else finding["interval"][1],
                "is_discovery": row["is_discovery"],
            }
            for row in batch.to_pylist()
            if row["document"]
            for finding in json.loads(row["document"])["findings"]
        ]
        yield pa.RecordBatch.from_pylist(rows, schema=SCHEMAS["findings"])


def _assessed(
    vehicle: Compared, reason: str, windows: Sequence[WindowRow], settings: AssessmentSettings
) -> dict[str, Any]:
    """Return verdict, diagnosis and what led to it."""
    own, of_type = vehicle.baseline, vehicle.type_baseline
    baseline = baseline_from_document(json.loads(own)) if own else None
    if baseline is not None and vehicle.weights is not None:
        baseline = replace(baseline, weights=np.reshape(vehicle.weights, baseline.weights.shape))
    known = type_baseline_from_document(json.loads(of_type)) if of_type and baseline is None else None
    compared = [row for row in windows if row.document][-settings.max_windows :]
    observations = [row.observation(vehicle.type_name) for row in compared]
    if known is not None and not any(window.components == known.components for window in observations):
        known = None
    diagnosis = diagnose(
        observations,
        baseline,
        type_baseline=known,
        false_alarms=settings.false_alarms,
        windows_per_day=settings.windows_per_day,
    )
    description = vehicle_from_text(vehicle.vehicle_text, source="the vehicle file")
    changes = [
        change
        for finding in diagnosis.findings
        for change in mode_changes(description, finding, baseline, observations=observations)
    ]
    worst = max(diagnosis.findings, key=lambda finding: finding.severity_number, default=None)
    verdict = diagnosis.verdict
    return {
        "since": compared[0].start,
        "until": compared[-1].start,
        "verdict": verdict,
        "severity": None if worst is None else worst.severity,
        "e_value": None if diagnosis.detection is None else diagnosis.detection.e_value,
        "reason": "; ".join(filter(None, (reason, *(diagnosis.doubts if verdict == "inconclusive" else ())))),
        "document": json.dumps(diagnosis_document(diagnosis, modes=changes).as_json()),
    }


def _digest(vehicle_file: str, rows: Sequence[WindowRow]) -> str:
    text = repr((vehicle_file, [(row.start, row.digest) for row in rows]))
    return blake2b(text.encode(), digest_size=8).hexdigest()


def _sentence(error: Exception) -> str:
    return str(error) if isinstance(error, SprungError) else f"{type(error).__name__}: {error}"
