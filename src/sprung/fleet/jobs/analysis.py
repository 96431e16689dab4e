"""The analysis of one window of a lake: what `sprung identify`, `corners` and `diagnose` make of it, as rows."""

import json
import time
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from typing import Any

from sprung.diagnosis import Observation, observe_window
from sprung.diagnosis.observation import fit_drive
from sprung.errors import SprungError
from sprung.fleet.jobs.results import OF_STEP
from sprung.fleet.lake import recording_of
from sprung.identification import METHODS, IdentificationSettings
from sprung.results.documents import (
    Document,
    corners_document,
    identification_document,
    observation_document,
    stored_statistics,
)
from sprung.results.documents.document import plain
from sprung.vehicles import Vehicle, vehicle_from_text

#: Results of a window: rows by table, and seconds by table.
Analysed = tuple[dict[str, dict[str, Any]], dict[str, float]]


@dataclass(frozen=True, slots=True)
class WindowSettings:
    """Settings of the analysis of windows.

    Parameters
    ----------
    method
        Method of identification, a key of `sprung.identification.METHODS`.
    allow_missing
        Whether windows may lack sensors of the vehicle file.
    seconds
        Longest time that a step may take on a window [s].
    """

    method: str = "cov"
    allow_missing: bool = False
    seconds: float = 600.0


@dataclass(frozen=True, slots=True)
class Work:
    """What is to be done with a window.

    Parameters
    ----------
    vehicle_text
        Text of the vehicle file; empty where there is none.
    vehicle_file, reason
        Digest of that text, and why it cannot be used; both empty otherwise.
    steps
        Steps to take: keys of `OF_STEP`.
    has_segments
        Whether a baseline may be learnt from the window, which needs more of its statistics.
    """

    vehicle_text: str
    vehicle_file: str = ""
    reason: str = ""
    steps: Collection[str] = field(default_factory=lambda: tuple(OF_STEP))
    has_segments: bool = False


def analyse(row: Mapping[str, Any], work: Work, settings: WindowSettings) -> Analysed:
    """Return the results of a window, by table.

    Parameters
    ----------
    row
        Row of a lake.
    work
        What is to be done with it.
    settings
        Settings of the analysis.

    Notes
    -----
    A window that cannot be analysed is a row with its reason, whatever the error is: one window never ends a run.
    """
    results: dict[str, dict[str, Any]] = {}
    seconds: dict[str, float] = {}
    for step in sorted(work.steps):
        begin = time.process_time()
        result, reason = _attempted(lambda step=step: _STEPS[step](row, work, settings), work.reason)  # type: ignore[misc]
        results[OF_STEP[step]] = _row(row, work.vehicle_file, reason) | result
        seconds[OF_STEP[step]] = time.process_time() - begin
    return results, seconds


def failed(row: Mapping[str, Any], work: Work, reason: str) -> dict[str, dict[str, Any]]:
    """Return the results of a window that could not be analysed, by table."""
    return {OF_STEP[step]: _row(row, work.vehicle_file, reason) for step in work.steps}


def _attempted(step: Callable[[], dict[str, Any]], reason: str) -> tuple[dict[str, Any], str]:
    """Return the result of a step and why there is none."""
    if reason:
        return {}, reason
    try:
        result = step()
    except SprungError as error:
        return {}, str(error)
    except Exception as error:  # whatever a window makes of a step, the others go on
        return {}, f"{type(error).__name__}: {error}"
    return result, str(result.pop("reason", ""))


def _identify(row: Mapping[str, Any], work: Work, settings: WindowSettings) -> dict[str, Any]:
    """Return the modes of a window, as `sprung identify` finds them."""
    chosen = IdentificationSettings(allow_missing=settings.allow_missing)
    vehicle = _vehicle(work.vehicle_text)
    identification = METHODS[settings.method](recording_of(row), settings=chosen, vehicle=vehicle)
    document = identification_document(identification, vehicle=vehicle)
    names = ("label", "natural_frequency", "natural_frequency_std", "damping_ratio", "damping_ratio_std")
    modes = document.as_json()["modes"]
    return {"modes": [{name: mode.get(name) for name in names} for mode in modes], "document": _text(document)}


def _corners(row: Mapping[str, Any], work: Work, settings: WindowSettings) -> dict[str, Any]:
    """Return the springs, dampers and tyres in a window, as `sprung corners` estimates them."""
    fit = fit_drive(recording_of(row), _vehicle(work.vehicle_text), allow_missing=settings.allow_missing)
    document = corners_document(fit)
    names = ("value", "std", "relative_to_nominal", "is_identifiable")
    components = [
        {"corner": corner, "component": kind, **{name: part.get(name) for name in names}}
        for corner, parts in document.as_json()["corners"].items()
        for kind, part in parts.items()
    ]
    return {"components": components, "model_error": document.fit.model_error, "document": _text(document)}


def _observe(row: Mapping[str, Any], work: Work, settings: WindowSettings) -> dict[str, Any]:
    """Return the observation of a window, as `sprung diagnose` makes it."""
    observation = observe_window(
        recording_of(row),
        _vehicle(work.vehicle_text),
        time=row["start"] / 1e9,
        allow_missing=settings.allow_missing,
    )
    return observed(observation, has_segments=work.has_segments)


def observed(observation: Observation, *, has_segments: bool) -> dict[str, Any]:
    """Return the columns of an observation in the table of windows."""
    residuals = observation.residuals
    if residuals is not None and not has_segments:
        residuals = residuals.without_segments()
    return {
        "reason": observation.reason,
        "is_sound": observation.is_conclusive and not observation.sensor_faults,
        "conditions": sorted((name, float(value)) for name, value in observation.conditions.items()),
        "sensor_faults": [{"channel": fault.channel, "kind": fault.kind} for fault in observation.sensor_faults],
        "document": json.dumps(observation_document(observation)),
        "residuals": stored_statistics(residuals),
    }


_STEPS: dict[str, Callable[[Mapping[str, Any], Work, WindowSettings], dict[str, Any]]] = {
    "identify": _identify,
    "corners": _corners,
    "observe": _observe,
}


def _row(row: Mapping[str, Any], vehicle_file: str, reason: str) -> dict[str, Any]:
    """Return the columns that the tables of windows have in common."""
    return {
        **{name: row[name] for name in ("date", "vehicle", "start", "digest", "duration")},
        "vehicle_file": vehicle_file,
        "reason": reason,
        "is_sound": False,
    }


@lru_cache(maxsize=64)
def _vehicle(text: str) -> Vehicle:
    """Return the vehicle of the text of its file."""
    return vehicle_from_text(text, source="the vehicle file")


def _text(document: Document) -> str:
    """Return a document as one line of JSON."""
    return json.dumps(plain(document.as_json()))
