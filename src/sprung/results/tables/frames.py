"""Values as pandas data frames: one row for each mode, part, window or sample, units in the names of the columns."""

from collections.abc import Iterable, Mapping
from functools import singledispatch
from typing import Any

import numpy as np

from sprung._checks import data_frame_of, required
from sprung.calibration import Calibration
from sprung.diagnosis import Baseline, Diagnosis, Finding, Findings, Observation, Observations
from sprung.diagnosis.observation import CONDITION_UNITS
from sprung.errors import ParameterError
from sprung.identification import Identification
from sprung.identification.stabilisation import StabilisationDiagram
from sprung.identification.tracking import TrackedModes
from sprung.likelihood import CornerFit
from sprung.modal import Modes, PoleStatus
from sprung.recording import Recording
from sprung.signals.inspection import Inspection

_Columns = Mapping[str, Any]


def data_frame(value: object) -> Any:
    """Return a value as a pandas.DataFrame.

    Parameters
    ----------
    value
        Recording, modes, or a result.

    Raises
    ------
    MissingPackageError
        If pandas is not installed.
    ParameterError
        If a value of this type has no rows.
    """
    frame = data_frame_of(columns_of(value))
    if isinstance(value, Recording):
        frame.index = _times(value)
    return frame


@singledispatch
def columns_of(value: object) -> _Columns:
    """Return the columns of a value by their names, which have the unit in brackets.

    Raises
    ------
    ParameterError
        If a value of this type has no rows.
    """
    raise ParameterError(f"a {type(value).__name__} has no rows: pass a recording, modes or a result")


@columns_of.register
def _of_recording(recording: Recording) -> _Columns:
    units = (f" [{channel.unit}]" if channel.unit else "" for channel in recording.channels)
    return {name + unit: row for name, unit, row in zip(recording.names, units, recording.samples, strict=True)}


def _times(recording: Recording) -> Any:
    """Return the time of every sample: UTC where the start is known, otherwise seconds; gaps count."""
    pandas = required("pandas", purpose="a data frame", extra="notebook")
    waits = np.zeros(recording.n_samples)
    for gap in recording.gaps:
        waits[gap.index] = gap.duration
    seconds = np.arange(recording.n_samples) / recording.sampling_rate + np.cumsum(waits)
    if recording.start is None:
        return pandas.Index(seconds, name="time [s]")
    stamps = recording.start + np.round(1e9 * seconds).astype(np.int64)
    return pandas.DatetimeIndex(stamps.astype("datetime64[ns]"), tz="UTC", name="time")


@columns_of.register
def _of_modes(modes: Modes) -> _Columns:
    return {
        "natural_frequency [Hz]": modes.natural_frequency,
        "natural_frequency_std [Hz]": modes.natural_frequency_std,
        "damping_ratio [-]": modes.damping_ratio,
        "damping_ratio_std [-]": modes.damping_ratio_std,
        "stable_rate [-]": modes.stable_rate,
        "mpc [-]": modes.mpc,
        "label": modes.labels,
        **{f"mode_shape {name} [-]": modes.mode_shapes[:, k] for k, name in enumerate(modes.channels)},
    }


@columns_of.register
def _of_identification(identification: Identification) -> _Columns:
    return {**columns_of(identification.modes), "source": identification.sources}


@columns_of.register
def _of_diagram(diagram: StabilisationDiagram) -> _Columns:
    return {
        "rung": np.asarray(diagram.poles.ladder)[diagram.poles.rungs],
        "natural_frequency [Hz]": diagram.poles.natural_frequency,
        "damping_ratio [-]": diagram.poles.damping_ratio,
        "alignment": diagram.alignments,
        "status": [PoleStatus(status).name.lower() for status in diagram.status],
    }


@columns_of.register
def _of_corners(fit: CornerFit) -> _Columns:
    return {
        "corner": [component.corner for component in fit.components],
        "component": [component.kind for component in fit.components],
        "value [N/m, N s/m]": fit.values,
        "std [N/m, N s/m]": fit.values * fit.log_ratios_std,
        "relative_to_nominal [-]": fit.values / fit.nominal,
        "is_identifiable": fit.is_identifiable,
    }


@columns_of.register
def _of_baseline(baseline: Baseline) -> _Columns:
    return {
        "corner": [component.corner for component in baseline.components],
        "component": [component.kind for component in baseline.components],
        "mean_change_from_nominal [-]": np.expm1(baseline.mean),
        "std_of_a_window [-]": np.sqrt(np.diag(baseline.covariance)),
    }


@columns_of.register
def _of_diagnosis(diagnosis: Diagnosis) -> _Columns:
    return columns_of(Findings(diagnosis.findings))


@columns_of.register
def _of_finding(finding: Finding) -> _Columns:
    return columns_of(Findings((finding,)))


@columns_of.register
def _of_findings(findings: Findings) -> _Columns:
    intervals = [finding.interval or (np.nan, np.nan) for finding in findings]
    return {
        "corner": [finding.corner for finding in findings],
        "component": [finding.component for finding in findings],
        "change [-]": _numbers(finding.change for finding in findings),
        "change_low [-]": _numbers(low for low, _ in intervals),
        "change_high [-]": _numbers(high for _, high in intervals),
        "score [-]": _numbers(finding.score for finding in findings),
        "severity": [finding.severity for finding in findings],
        "since [s]": _numbers(finding.since for finding in findings),
        "since_earliest [s]": _numbers(finding.since_interval[0] for finding in findings),
        "since_latest [s]": _numbers(finding.since_interval[1] for finding in findings),
        "trend [1/h]": _numbers(None if finding.trend is None else finding.trend.per_hour for finding in findings),
        "advice": [finding.advice for finding in findings],
    }


@columns_of.register
def _of_observation(observation: Observation) -> _Columns:
    return columns_of(Observations((observation,)))


@columns_of.register
def _of_observations(observations: Observations) -> _Columns:
    conditions = list(dict.fromkeys(name for window in observations for name in window.conditions))
    labels = list(dict.fromkeys(label for window in observations for label in window.modes))
    parts = list(dict.fromkeys(part for window in observations for part in window.components))
    unknown = (np.nan, np.nan)
    changes = [dict(zip(window.components, np.expm1(window.log_ratios), strict=True)) for window in observations]
    deviations = [
        dict(zip(window.components, np.sqrt(np.diag(window.covariance)), strict=True)) for window in observations
    ]
    columns: dict[str, Any] = {
        "time [s]": _numbers(window.time for window in observations),
        "vehicle": [window.vehicle for window in observations],
        "is_conclusive": [window.is_conclusive for window in observations],
        "reason": [window.reason for window in observations],
        "sensor_faults": [", ".join(f"{f.channel} {f.kind}" for f in window.sensor_faults) for window in observations],
    }
    for name in conditions:
        columns[f"{name} [{CONDITION_UNITS.get(name, '-')}]"] = _numbers(
            window.conditions.get(name) for window in observations
        )
    for label in labels:
        modes = [window.modes.get(label, unknown) for window in observations]
        columns[f"{label} natural_frequency [Hz]"] = _numbers(mode[0] for mode in modes)
        columns[f"{label} damping_ratio [-]"] = _numbers(mode[1] for mode in modes)
    for part in parts:
        columns[f"{part} change_from_nominal [-]"] = _numbers(own.get(part) for own in changes)
        columns[f"{part} std [-]"] = _numbers(own.get(part) for own in deviations)
    return columns


@columns_of.register
def _of_tracks(tracked: TrackedModes) -> _Columns:
    unit = "s" if tracked.has_times else "windows"
    points = [(number, track, k) for number, track in enumerate(tracked.tracks, start=1) for k in range(len(track))]
    likeness = {number: track.likeness for number, track in enumerate(tracked.tracks, start=1)}
    return {
        "track": [number for number, _, _ in points],
        "label": [track.label for _, track, _ in points],
        "window": [int(track.windows[k]) for _, track, k in points],
        f"time [{unit}]": _numbers(track.times[k] for _, track, k in points),
        "natural_frequency [Hz]": _numbers(track.modes.natural_frequency[k] for _, track, k in points),
        "natural_frequency_std [Hz]": _numbers(track.modes.natural_frequency_std[k] for _, track, k in points),
        "damping_ratio [-]": _numbers(track.modes.damping_ratio[k] for _, track, k in points),
        "damping_ratio_std [-]": _numbers(track.modes.damping_ratio_std[k] for _, track, k in points),
        "mac [-]": _numbers(likeness[number][k] for number, _, k in points),
    }


@columns_of.register
def _of_inspection(inspection: Inspection) -> _Columns:
    names = ("name", "quantity", "unit", "n_values", "mean", "rms", "standard_deviation", "minimum", "maximum")
    shares = {f"{name} [-]": [getattr(facts, name) for facts in inspection.channels] for name in ("clipped", "stuck")}
    facts = {name: [getattr(facts, name) for facts in inspection.channels] for name in names}
    return {**facts, **shares, "is_dead": [channel.is_dead for channel in inspection.channels]}


@columns_of.register
def _of_calibration(calibration: Calibration) -> _Columns:
    names = ("name", "group", "unit", "given", "value", "std", "prior_std", "is_identifiable")
    return {name: [getattr(number, name) for number in calibration.learnt] for name in names}


def _numbers(values: Iterable[float | None]) -> list[float]:
    """Return numbers, NaN for those that are unknown."""
    return [np.nan if value is None else float(value) for value in values]
