"""Values as columns of data frames, and as the parts that notebooks show."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from sprung._checks import data_frame_of, required
from sprung.calibration import Calibration
from sprung.diagnosis import Baseline, Diagnosis, Finding, Findings, Observation, Observations
from sprung.diagnosis.observation import CONDITION_UNITS
from sprung.identification import Identification
from sprung.identification.stabilisation import StabilisationDiagram
from sprung.identification.tracking import TrackedModes
from sprung.likelihood import CornerFit
from sprung.modal import Modes, PoleStatus
from sprung.recording import Recording
from sprung.results.tables.corners import (
    calibration_in_words,
    calibration_table,
    components_table,
    fitted_modes_table,
    payload_in_words,
)
from sprung.results.tables.diagnosis import (
    baseline_in_words,
    baseline_table,
    diagnosis_in_words,
    diagnosis_tables,
    findings_table,
    observations_table,
)
from sprung.results.tables.identification import (
    identification_in_words,
    identification_tables,
    modes_table,
    tracks_in_words,
    tracks_table,
)
from sprung.results.tables.recordings import inspection_in_words, inspection_table
from sprung.results.tables.table import Table
from sprung.signals.inspection import Inspection, inspect

_Columns = Mapping[str, Any]


def data_frame(value: object, columns: _Columns) -> Any:
    """Return the columns of a value as a pandas.DataFrame; the index of a recording is its time."""
    frame = data_frame_of(columns)
    if isinstance(value, Recording):
        frame.index = _times(value)
    return frame


def recording_columns(recording: Recording) -> _Columns:
    """Return the columns of a recording: one for each channel."""
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


def modes_columns(modes: Modes) -> _Columns:
    """Return the columns of modes."""
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


def identification_columns(identification: Identification) -> _Columns:
    """Return the columns of an identification."""
    return {**modes_columns(identification.modes), "source": identification.sources}


def diagram_columns(diagram: StabilisationDiagram) -> _Columns:
    """Return the columns of a stabilisation diagram."""
    return {
        "rung": np.asarray(diagram.poles.ladder)[diagram.poles.rungs],
        "natural_frequency [Hz]": diagram.poles.natural_frequency,
        "damping_ratio [-]": diagram.poles.damping_ratio,
        "alignment": diagram.alignments,
        "status": [PoleStatus(status).name.lower() for status in diagram.status],
    }


def corners_columns(fit: CornerFit) -> _Columns:
    """Return the columns of a fit of the corners."""
    return {
        "corner": [component.corner for component in fit.components],
        "component": [component.kind for component in fit.components],
        "value [N/m, N s/m]": fit.values,
        "std [N/m, N s/m]": fit.values * fit.log_ratios_std,
        "relative_to_nominal [-]": fit.values / fit.nominal,
        "is_identifiable": fit.is_identifiable,
    }


def baseline_columns(baseline: Baseline) -> _Columns:
    """Return the columns of a baseline."""
    return {
        "corner": [component.corner for component in baseline.components],
        "component": [component.kind for component in baseline.components],
        "mean_change_from_nominal [-]": np.expm1(baseline.mean),
        "std_of_a_window [-]": np.sqrt(np.diag(baseline.covariance)),
    }


def diagnosis_columns(diagnosis: Diagnosis) -> _Columns:
    """Return the columns of a diagnosis."""
    return findings_columns(Findings(diagnosis.findings))


def finding_columns(finding: Finding) -> _Columns:
    """Return the columns of a finding."""
    return findings_columns(Findings((finding,)))


def findings_columns(findings: Findings) -> _Columns:
    """Return the columns of findings."""
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


def observation_columns(observation: Observation) -> _Columns:
    """Return the columns of the observation of a window."""
    return observations_columns(Observations((observation,)))


def observations_columns(observations: Observations) -> _Columns:
    """Return the columns of observations of windows."""
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


def tracks_columns(tracked: TrackedModes) -> _Columns:
    """Return the columns of tracked modes."""
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


def inspection_columns(inspection: Inspection) -> _Columns:
    """Return the columns of an inspection."""
    names = ("name", "quantity", "unit", "n_values", "mean", "rms", "standard_deviation", "minimum", "maximum")
    shares = {f"{name} [-]": [getattr(facts, name) for facts in inspection.channels] for name in ("clipped", "stuck")}
    facts = {name: [getattr(facts, name) for facts in inspection.channels] for name in names}
    return {**facts, **shares, "is_dead": [channel.is_dead for channel in inspection.channels]}


def calibration_columns(calibration: Calibration) -> _Columns:
    """Return the columns of a calibration."""
    names = ("name", "group", "unit", "nominal_value", "value", "std", "prior_std", "is_identifiable")
    return {name: [getattr(number, name) for number in calibration.learnt] for name in names}


def _numbers(values: Iterable[float | None]) -> list[float]:
    """Return numbers, NaN for those that are unknown."""
    return [np.nan if value is None else float(value) for value in values]


#: Tables, lists of sentences, and headings.
Parts = Sequence[Table | Sequence[str] | str]


def as_html(parts: Parts) -> str:
    """Return headings, tables and lists of sentences as HTML."""
    return "\n".join(_block(part) for part in parts if part)


def recording_parts(recording: Recording) -> Parts:
    """Return the tables and sentences of a recording."""
    return [*inspection_parts(inspect(recording)), recording.history]


def inspection_parts(inspection: Inspection) -> Parts:
    """Return the tables and sentences of an inspection."""
    return [inspection_in_words(inspection), inspection_table(inspection)]


def modes_parts(modes: Modes) -> Parts:
    """Return the tables and sentences of modes."""
    return [modes_table(modes)]


def identification_parts(identification: Identification) -> Parts:
    """Return the tables and sentences of an identification."""
    return [
        identification_in_words(identification),
        *identification_tables(identification),
        identification.notes,
    ]


def diagram_parts(diagram: StabilisationDiagram) -> Parts:
    """Return the tables and sentences of a stabilisation diagram."""
    counts = {status: int((diagram.status == status).sum()) for status in PoleStatus}
    rows = tuple((str(count), status.sentence) for status, count in counts.items() if count)
    return [Table("Stabilisation diagram", ("poles", "status"), rows, n_words=0)]


def tracks_parts(tracked: TrackedModes) -> Parts:
    """Return the tables and sentences of tracked modes."""
    return [tracks_in_words(tracked), tracks_table(tracked, has_times=tracked.has_times)]


def corners_parts(fit: CornerFit) -> Parts:
    """Return the tables and sentences of a fit of the corners."""
    return [components_table(fit), fitted_modes_table(fit), [*payload_in_words(fit), *fit.notes]]


def baseline_parts(baseline: Baseline) -> Parts:
    """Return the tables and sentences of a baseline."""
    words = baseline_in_words(baseline, n_windows=baseline.n_windows + baseline.n_refused)
    return [baseline_table(baseline), words]


def diagnosis_parts(diagnosis: Diagnosis) -> Parts:
    """Return the tables and sentences of a diagnosis."""
    return [diagnosis_in_words(diagnosis), *diagnosis_tables(diagnosis, ()), diagnosis.notes]


def finding_parts(finding: Finding) -> Parts:
    """Return the tables and sentences of a finding."""
    return [findings_table((finding,))]


def findings_parts(findings: Findings) -> Parts:
    """Return the tables and sentences of findings."""
    return [findings_table(findings)] if findings else ["no findings"]


def observation_parts(observation: Observation) -> Parts:
    """Return the tables and sentences of the observation of a window."""
    return [observations_table((observation,))]


def observations_parts(observations: Observations) -> Parts:
    """Return the tables and sentences of observations of windows."""
    return [observations_table(observations)] if observations else ["no windows"]


def calibration_parts(calibration: Calibration) -> Parts:
    """Return the tables and sentences of a calibration."""
    return [calibration_table(calibration), calibration_in_words(calibration)]


def _block(part: Table | Sequence[str] | str) -> str:
    """Return a heading, a table or a list of sentences in HTML."""
    if isinstance(part, str):
        return f"<p><strong>{_text(part)}</strong></p>"
    if isinstance(part, Table):
        return _table(part)
    items = "".join(f"<li>{_text(sentence)}</li>" for sentence in part)
    return f"<ul>{items}</ul>"


def _table(table: Table) -> str:
    """Return a table in HTML, numbers to the right."""
    align = {k: "left" if table.has_words(k) else "right" for k in table.shown}
    head = "".join(f'<th style="text-align: {align[k]}">{_text(table.columns[k])}</th>' for k in table.shown)
    rows = "".join(
        "<tr>" + "".join(f'<td style="text-align: {align[k]}">{_text(row[k])}</td>' for k in table.shown) + "</tr>"
        for row in table.rows
    )
    title = f"<caption>{_text(table.title)}</caption>" if table.title else ""
    below = f"<p><small>{_text(table.caption)}</small></p>" if table.caption else ""
    return f"<table>{title}<thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>{below}"


def _text(text: str) -> str:
    """Return a text escaped as HTML, with its line breaks."""
    return escape(text).replace("\n", "<br>")
