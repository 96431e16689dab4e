"""Baselines and diagnoses of vehicles from the rows of their windows, one vehicle or type at a time."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import pyarrow as pa

from sprung.diagnosis import (
    LEARNING_WINDOWS,
    Baseline,
    Observation,
    diagnose,
    false_discoveries,
    learn,
    learn_type,
    mode_changes,
)
from sprung.documents import (
    baseline_document,
    baseline_from_document,
    diagnosis_document,
    observation_from_document,
    type_baseline_document,
    type_baseline_from_document,
)
from sprung.errors import SprungError
from sprung.fleet.results import SCHEMAS
from sprung.monitor.states import restored_statistics
from sprung.vehicles import vehicle_from_text

#: Overlap of windows that does not count [ns]: clocks of loggers jitter.
_OVERLAP = 10**9
#: Columns of diagnoses that come from all windows of a vehicle, or from all vehicles.
_OF_FLEET = ("n_windows", "n_sound", "is_discovery")
#: Rows of an assessment: a diagnosis with its findings, and the baseline of the vehicle.
SCHEMA = pa.schema(
    [
        *(SCHEMAS["diagnoses"].field(name) for name in SCHEMAS["diagnoses"].names if name not in _OF_FLEET),
        pa.field("n_learnt", pa.int64()),  # windows of the baseline; null where there is none
        pa.field("learnt_until", pa.int64()),
        pa.field("baseline", pa.string()),
    ]
)


@dataclass(frozen=True, slots=True)
class AssessmentSettings:
    """Settings of baselines and diagnoses.

    Parameters
    ----------
    learning_windows
        Number of sound windows that a baseline is learnt from, at least 2: the first ones of a vehicle.
    most_windows
        Number of last windows that a diagnosis is made of.
    false_alarms, windows_per_day
        Rate of false alarms of a sound vehicle per day of driving, and windows in such a day.
    """

    learning_windows: int = LEARNING_WINDOWS
    most_windows: int = 96
    false_alarms: float = 1e-3
    windows_per_day: float = 48.0


@dataclass(frozen=True, slots=True)
class Windows:
    """Windows of a vehicle in the order of time, without those that overlap earlier ones.

    Parameters
    ----------
    rows
        Rows of the table of windows.
    n_left_out
        Number of windows that overlap earlier ones.
    """

    rows: tuple[Mapping[str, Any], ...]
    n_left_out: int

    @classmethod
    def of(cls, rows: Sequence[Mapping[str, Any]]) -> "Windows":
        """Return the windows of rows in any order; the result does not depend on it."""
        kept: list[Mapping[str, Any]] = []
        end = None
        for row in sorted(rows, key=lambda row: (row["start"], -row["duration"], row["digest"])):
            if end is None or row["start"] >= end - _OVERLAP:
                kept.append(row)
                end = row["start"] + round(row["duration"] * 1e9)
        return cls(tuple(kept), len(rows) - len(kept))

    def learning(self, count: int) -> list[Mapping[str, Any]]:
        """Return the first sound windows, if there are enough of them."""
        sound = [row for row in self.rows if row["is_sound"]]
        return sound[:count] if len(sound) >= count else []


def assess(rows: Sequence[Mapping[str, Any]], settings: AssessmentSettings) -> dict[str, Any]:
    """Return the assessment of a vehicle from its own windows.

    Parameters
    ----------
    rows
        Rows of the table of windows, in any order, of one vehicle and vehicle file: its first ones, as many as a
        baseline needs, and the last ones; with the columns `type`, `vehicle_text`, `type_baseline` and `state`.
    settings
        Settings of baseline and diagnosis.

    Notes
    -----
    The baseline is learnt from the first sound windows, and the windows after these are compared with it. A vehicle
    with too few is compared with its type, where that is known, or left with right: `type_baseline` is the document of
    its type, or empty.
    """
    windows = Windows.of(rows)
    first = rows[0]
    outcome: dict[str, Any] = {
        "vehicle": first["vehicle"],
        "type": first["type"],
        "vehicle_file": first["vehicle_file"],
        "n_left_out": windows.n_left_out,
        "state": first["state"],
        "verdict": "inconclusive",
        "reason": "",
    }
    try:
        return outcome | _assessed(windows, settings)
    except SprungError as error:
        return outcome | {"reason": str(error)}
    except Exception as error:  # whatever a vehicle makes of it, the others go on
        return outcome | {"reason": f"{type(error).__name__}: {error}"}


def type_of(rows: Sequence[Mapping[str, Any]], settings: AssessmentSettings) -> dict[str, Any] | None:
    """Return the baseline of a type as a row of the table of types; None where it cannot be learnt.

    Parameters
    ----------
    rows
        Rows of the table of windows of several vehicles of the type, with the columns `type` and `type_name`.
    settings
        Settings of baselines: each vehicle takes part with the windows of its own baseline.
    """
    by_vehicle: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        by_vehicle.setdefault(row["vehicle"], []).append(row)
    learning = {
        vehicle: [replace(_observation(row), vehicle="") for row in Windows.of(own).learning(settings.learning_windows)]
        for vehicle, own in sorted(by_vehicle.items())
    }
    try:
        learnt = learn_type({vehicle: own for vehicle, own in learning.items() if own}, name=rows[0]["type_name"])
    except SprungError:
        return None
    return {
        "type": rows[0]["type"],
        "name": learnt.name,
        "n_vehicles": learnt.n_vehicles,
        "n_windows": learnt.n_windows,
        "document": json.dumps(type_baseline_document(learnt).as_json()),
    }


def assessed_vehicles(table: pa.Table, *, settings: AssessmentSettings) -> pa.Table:
    """Return the assessment of a vehicle as a table of one row; parameters as for `assess`."""
    return pa.Table.from_pylist([assess(table.to_pylist(), settings)], schema=SCHEMA)


def learnt_types(table: pa.Table, *, settings: AssessmentSettings) -> pa.Table:
    """Return the baseline of a type as a table of one row, or none; parameters as for `type_of`."""
    learnt = type_of(table.to_pylist(), settings)
    return pa.Table.from_pylist([] if learnt is None else [learnt], schema=SCHEMAS["types"])


def discoveries(table: pa.Table, *, rate: float, n_vehicles: int) -> pa.Table:
    """Return the vehicles that have changed at a rate of false discoveries in the fleet, as a table of names.

    Parameters
    ----------
    table
        Columns `vehicle` and `e_value` of the vehicles whose e-value could be among the discoveries: at least 1 / rate.
    rate
        Expected share of sound vehicles among the discoveries.
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


def _assessed(windows: Windows, settings: AssessmentSettings) -> dict[str, Any]:
    """Return baseline, verdict and what led to it."""
    if not windows.rows[0]["vehicle_file"]:
        return {"reason": windows.rows[0]["reason"]}
    learning = windows.learning(settings.learning_windows)
    baseline, reason = _baseline(learning, len([row for row in windows.rows if row["is_sound"]]), settings)
    outcome: dict[str, Any] = {"reason": reason}
    after = windows.rows
    if baseline is not None:
        last = learning[-1]["start"]
        after = tuple(row for row in windows.rows if row["start"] > last)
        document = json.dumps(baseline_document(baseline).as_json())
        outcome |= {"n_learnt": baseline.n_windows, "learnt_until": last, "baseline": document}
    after = tuple(row for row in after if row["document"])[-settings.most_windows :]
    if not after:
        failures = [row["reason"] for row in windows.rows if not row["document"]]
        none = "no window after those of the baseline" if baseline is not None else _commonest(failures)
        return outcome | {"reason": none}
    observations = [_observation(row) for row in after]
    of_type = windows.rows[0]["type_baseline"]
    known = type_baseline_from_document(json.loads(of_type)) if of_type and baseline is None else None
    if known is not None and not any(window.components == known.components for window in observations):
        known = None
    diagnosis = diagnose(
        observations,
        baseline,
        type_baseline=known,
        false_alarms=settings.false_alarms,
        windows_per_day=settings.windows_per_day,
    )
    vehicle = vehicle_from_text(windows.rows[0]["vehicle_text"], source="the vehicle file")
    changes = [
        change
        for finding in diagnosis.findings
        for change in mode_changes(vehicle, finding, baseline, observations=observations)
    ]
    worst = max(diagnosis.findings, key=lambda finding: finding.severity_number, default=None)
    verdict = diagnosis.verdict
    return outcome | {
        "since": after[0]["start"],
        "until": after[-1]["start"],
        "verdict": verdict,
        "healthy": diagnosis.is_healthy,
        "severity": None if worst is None else worst.severity,
        "e_value": None if diagnosis.detection is None else diagnosis.detection.e_value,
        "reason": "; ".join(filter(None, (reason, *(diagnosis.doubts if verdict == "inconclusive" else ())))),
        "document": json.dumps(diagnosis_document(diagnosis, modes=changes).as_json()),
    }


def _baseline(
    learning: Sequence[Mapping[str, Any]], n_sound: int, settings: AssessmentSettings
) -> tuple[Baseline | None, str]:
    """Return the baseline of a vehicle, and why there is none."""
    if not learning:
        return None, f"{n_sound} of the {settings.learning_windows} sound windows that a baseline needs"
    try:
        learnt = learn([_observation(row) for row in learning], least_windows=max(2, settings.learning_windows // 2))
    except SprungError as error:
        return None, f"no baseline: {error}"
    return baseline_from_document(baseline_document(learnt).as_json()), ""


def _observation(row: Mapping[str, Any]) -> Observation:
    """Return the observation of a row."""
    document = json.loads(row["document"])
    observation = observation_from_document(document)
    name = row.get("type_name") or ""
    return replace(observation, vehicle=name, residuals=restored_statistics(row["residuals"]))


def _commonest(reasons: Sequence[str]) -> str:
    """Return the commonest reason."""
    return max(sorted(set(reasons)), key=list(reasons).count, default="")
