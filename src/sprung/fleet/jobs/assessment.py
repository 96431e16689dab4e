"""Baselines and diagnoses of vehicles from the rows of their windows, one vehicle or type at a time."""

import json
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from hashlib import blake2b
from typing import Any

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
_TEXT, _COUNT = pa.string(), pa.int64()
#: What is known of a vehicle without the results of its windows: which of them an assessment needs.
OUTLINE = pa.schema(
    [
        ("vehicle", _TEXT),
        ("type", _TEXT),
        ("type_name", _TEXT),
        ("vehicle_file", _TEXT),
        ("vehicle_text", _TEXT),
        ("state", _TEXT),
        ("n_windows", _COUNT),
        ("n_sound", _COUNT),
        ("n_left_out", _COUNT),  # windows that overlap earlier ones
        ("learning", _TEXT),  # digest of the windows of the baseline; empty where they are too few
        ("learn_until", _COUNT),  # start of the last of them, UTC ns
        ("since", _COUNT),  # start of the first window to compare with the baseline, UTC ns; null where there is none
        ("since_alone", _COUNT),  # the same for a vehicle without a baseline
        ("lack", _TEXT),  # why there is no baseline
        ("failure", _TEXT),  # why a window has no result
    ]
)
#: Baselines as they are learnt; one without a document could not be, and `reason` states why.
LEARNT = pa.schema([*SCHEMAS["baselines"], ("reason", _TEXT)])
#: Assessments: diagnoses without what only all vehicles together state.
SCHEMA = pa.schema([field for field in SCHEMAS["diagnoses"] if field.name != "is_discovery"])


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


def outline(
    vehicle: Mapping[str, Any], keys: Sequence[Mapping[str, Any]], settings: AssessmentSettings
) -> dict[str, Any]:
    """Return which windows of a vehicle its assessment needs, as a row of `OUTLINE`.

    Parameters
    ----------
    vehicle
        Row of the vehicle: `vehicle`, `type`, `type_name`, `vehicle_file`, `vehicle_text` and `state`.
    keys
        All windows of the vehicle, in any order, with the columns `start`, `duration`, `digest`, `is_sound`,
        `has_result` and `reason`.
    settings
        Settings of baseline and diagnosis.

    Notes
    -----
    The baseline is learnt from the first sound windows, and the last ones after these are compared with it. A vehicle
    with too few is compared with its type, where that is known, or left with right.
    """
    windows = Windows.of(keys)
    learning = windows.learning(settings.learning_windows) if vehicle["vehicle_file"] else []
    until = learning[-1]["start"] if learning else None
    results = [row for row in windows.rows if row["has_result"]] if vehicle["vehicle_file"] else []
    alone = results[-settings.most_windows :]
    compared = [row for row in results if until is not None and row["start"] > until][-settings.most_windows :]
    n_sound = sum(bool(row["is_sound"]) for row in windows.rows)
    lack = "" if learning else f"{n_sound} of the {settings.learning_windows} sound windows that a baseline needs"
    failures = [row["reason"] for row in windows.rows if not row["has_result"]]
    return {
        **{name: vehicle[name] for name in ("vehicle", "type", "type_name", "vehicle_file", "vehicle_text", "state")},
        "n_windows": len(keys),
        "n_sound": sum(bool(row["is_sound"]) for row in keys),
        "n_left_out": windows.n_left_out,
        "learning": _digest(vehicle["vehicle_file"], learning) if learning else "",
        "learn_until": until,
        "since": compared[0]["start"] if compared else None,
        "since_alone": alone[0]["start"] if alone else None,
        "lack": lack if vehicle["vehicle_file"] else "",
        "failure": _commonest(failures),
    }


def learnt(
    vehicle: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], settings: AssessmentSettings
) -> dict[str, Any]:
    """Return the baseline of a vehicle, as a row of `LEARNT`.

    Parameters
    ----------
    vehicle
        Row of `OUTLINE`.
    rows
        Rows of the table of windows, in any order: all of the vehicle up to `learn_until`.
    settings
        Settings of the baseline.
    """
    outcome = {
        **{name: vehicle[name] for name in ("vehicle", "type", "vehicle_file")},
        "until": vehicle["learn_until"],
        "state": vehicle["learning"],
        "document": "",
        "reason": "",
    }
    learning = Windows.of(rows).learning(settings.learning_windows)
    least = max(2, settings.learning_windows // 2)
    try:
        baseline = learn([_observation(row, vehicle["type_name"]) for row in learning], min_windows=least)
    except SprungError as error:
        return outcome | {"reason": f"no baseline: {error}"}
    except Exception as error:  # whatever a vehicle makes of it, the others go on
        return outcome | {"reason": f"no baseline: {type(error).__name__}: {error}"}
    document = json.dumps(baseline_document(baseline).as_json())
    return outcome | {"n_windows": baseline.n_windows, "document": document}


def assess(
    vehicle: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], settings: AssessmentSettings
) -> dict[str, Any]:
    """Return the assessment of a vehicle, as a row of `SCHEMA`.

    Parameters
    ----------
    vehicle
        Row of `OUTLINE`, with the documents `baseline` of the vehicle and `type_baseline` of its type, each empty where
        there is none, the reason `no_baseline`, and `type_state`; `since` is `since_alone` where there is no baseline.
    rows
        Rows of the table of windows, in any order: all of the vehicle from `since` on.
    settings
        Settings of the diagnosis.
    """
    names = ("vehicle", "type", "vehicle_file", "n_windows", "n_sound", "n_left_out", "state", "type_state")
    reason = vehicle["no_baseline"] or vehicle["lack"]
    outcome = {name: vehicle[name] for name in names} | {"verdict": "inconclusive", "reason": reason}
    if vehicle["since"] is None:
        none = "no window after those of the baseline" if vehicle["baseline"] else vehicle["failure"]
        return outcome | {"reason": none}
    try:
        return outcome | _assessed(vehicle, reason, Windows.of(rows), settings)
    except SprungError as error:
        return outcome | {"reason": str(error)}
    except Exception as error:  # whatever a vehicle makes of it, the others go on
        return outcome | {"reason": f"{type(error).__name__}: {error}"}


def type_of(
    kind: Mapping[str, Any], rows: Sequence[Mapping[str, Any]], settings: AssessmentSettings
) -> dict[str, Any] | None:
    """Return the baseline of a type as a row of the table of types; None where it cannot be learnt.

    Parameters
    ----------
    kind
        Row of the type: `type`, `name` and `state`.
    rows
        Rows of the table of windows of several vehicles of the type, in any order.
    settings
        Settings of baselines: each vehicle takes part with the windows of its own baseline.
    """
    by_vehicle: dict[str, list[Mapping[str, Any]]] = {}
    for row in rows:
        by_vehicle.setdefault(row["vehicle"], []).append(row)
    learning = {
        vehicle: [_observation(row, "") for row in Windows.of(own).learning(settings.learning_windows)]
        for vehicle, own in sorted(by_vehicle.items())
    }
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


def outlines(vehicles: pa.Table, keys: pa.Table, *, settings: AssessmentSettings) -> pa.Table:
    """Return the outline of the vehicle of a table of one row, as such a table; parameters as for `outline`."""
    rows = [outline(vehicle, keys.to_pylist(), settings) for vehicle in vehicles.to_pylist()]
    return pa.Table.from_pylist(rows, schema=OUTLINE)


def baselines(vehicles: pa.Table, rows: pa.Table, *, settings: AssessmentSettings) -> pa.Table:
    """Return the baseline of the vehicle of a table of one row, as such a table; parameters as for `learnt`."""
    found = [learnt(vehicle, rows.to_pylist(), settings) for vehicle in vehicles.to_pylist()]
    return pa.Table.from_pylist(found, schema=LEARNT)


def assessments(vehicles: pa.Table, rows: pa.Table, *, settings: AssessmentSettings) -> pa.Table:
    """Return the assessment of the vehicle of a table of one row, as such a table; parameters as for `assess`."""
    found = [assess(vehicle, rows.to_pylist(), settings) for vehicle in vehicles.to_pylist()]
    return pa.Table.from_pylist(found, schema=SCHEMA)


def types(kinds: pa.Table, rows: pa.Table, *, settings: AssessmentSettings) -> pa.Table:
    """Return the baseline of the type of a table of one row, as such a table or none; parameters as for `type_of`."""
    found = [type_of(kind, rows.to_pylist(), settings) for kind in kinds.to_pylist()]
    return pa.Table.from_pylist([row for row in found if row], schema=SCHEMAS["types"])


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


def _assessed(
    vehicle: Mapping[str, Any], reason: str, windows: Windows, settings: AssessmentSettings
) -> dict[str, Any]:
    """Return verdict, diagnosis and what led to it."""
    own, of_type = vehicle["baseline"], vehicle["type_baseline"]
    baseline = baseline_from_document(json.loads(own)) if own else None
    known = type_baseline_from_document(json.loads(of_type)) if of_type and baseline is None else None
    compared = [row for row in windows.rows if row["document"]][-settings.most_windows :]
    observations = [_observation(row, vehicle["type_name"]) for row in compared]
    if known is not None and not any(window.components == known.components for window in observations):
        known = None
    diagnosis = diagnose(
        observations,
        baseline,
        type_baseline=known,
        false_alarms=settings.false_alarms,
        windows_per_day=settings.windows_per_day,
    )
    description = vehicle_from_text(vehicle["vehicle_text"], source="the vehicle file")
    changes = [
        change
        for finding in diagnosis.findings
        for change in mode_changes(description, finding, baseline, observations=observations)
    ]
    worst = max(diagnosis.findings, key=lambda finding: finding.severity_number, default=None)
    verdict = diagnosis.verdict
    return {
        "since": compared[0]["start"],
        "until": compared[-1]["start"],
        "verdict": verdict,
        "healthy": diagnosis.is_healthy,
        "severity": None if worst is None else worst.severity,
        "e_value": None if diagnosis.detection is None else diagnosis.detection.e_value,
        "reason": "; ".join(filter(None, (reason, *(diagnosis.doubts if verdict == "inconclusive" else ())))),
        "document": json.dumps(diagnosis_document(diagnosis, modes=changes).as_json()),
    }


def _observation(row: Mapping[str, Any], name: str) -> Observation:
    """Return the observation of a row, under the name of its vehicle file."""
    observation = observation_from_document(json.loads(row["document"]))
    return replace(observation, vehicle=name, residuals=restored_statistics(row["residuals"]))


def _digest(vehicle_file: str, rows: Sequence[Mapping[str, Any]]) -> str:
    """Return a digest of windows."""
    text = repr((vehicle_file, [(row["start"], row["digest"]) for row in rows]))
    return blake2b(text.encode(), digest_size=8).hexdigest()


def _commonest(reasons: Sequence[str]) -> str:
    """Return the commonest reason."""
    return max(sorted(set(reasons)), key=list(reasons).count, default="")
