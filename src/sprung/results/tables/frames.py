"""Values as columns of data frames, and headings, tables and sentences as HTML."""

from collections.abc import Iterable, Mapping, Sequence
from html import escape
from typing import Any

import numpy as np

from sprung._checks import data_frame_of, required
from sprung.bounce_tests import Bounce
from sprung.calibration import Calibration
from sprung.diagnosis import Baseline, Diagnosis, Finding, Findings, Observation, Observations
from sprung.diagnosis.observation import CONDITION_UNITS
from sprung.identification import Identification
from sprung.identification.stabilisation import StabilisationDiagram
from sprung.identification.tracking import TrackedModes
from sprung.likelihood import CornerFit
from sprung.modal import Modes, PoleStatus
from sprung.recording import Recording
from sprung.results.tables.wording import Table
from sprung.signals.inspection import Inspection

_Columns = Mapping[str, Any]
_MODES = ("natural_frequency [Hz]", "natural_frequency_std [Hz]", "damping_ratio [-]", "damping_ratio_std [-]")


def _fields(value: object, columns: Iterable[str]) -> dict[str, Any]:
    """Return attributes of a value as columns, whose names have the unit in brackets."""
    return {column: getattr(value, column.partition(" ")[0]) for column in columns}


def _items(values: Sequence[object], columns: Iterable[str]) -> dict[str, list[Any]]:
    """Return an attribute of all values in each column."""
    return {column: [getattr(value, column.partition(" ")[0]) for value in values] for column in columns}


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
    shapes = {f"mode_shape {name} [-]": modes.mode_shapes[:, k] for k, name in enumerate(modes.channels)}
    return {**_fields(modes, _MODES), **_fields(modes, ("stable_rate [-]", "mpc [-]")), "label": modes.labels, **shapes}


def bounce_columns(bounce: Bounce) -> _Columns:
    """Return the columns of the modes of bounce tests."""
    return {**_fields(bounce.modes, _MODES), "label": bounce.modes.labels}


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
        **_components(fit),
        "value [N/m, N s/m]": fit.values,
        "std [N/m, N s/m]": fit.values * fit.log_ratios_std,
        "relative_to_nominal [-]": fit.values / fit.nominal,
        "is_identifiable": fit.is_identifiable,
    }


def baseline_columns(baseline: Baseline) -> _Columns:
    """Return the columns of a baseline."""
    return {
        **_components(baseline),
        "mean_change_from_nominal [-]": np.expm1(baseline.mean),
        "std_of_a_window [-]": np.sqrt(np.diag(baseline.covariance)),
    }


def _components(value: CornerFit | Baseline) -> dict[str, list[str]]:
    return {
        "corner": [component.corner for component in value.components],
        "component": [component.kind for component in value.components],
    }


def findings_columns(value: Findings | Finding | Diagnosis) -> _Columns:
    """Return the columns of findings: all of them, one, or those of a diagnosis."""
    findings = value.findings if isinstance(value, Diagnosis) else (value,) if isinstance(value, Finding) else value
    intervals = [finding.interval or (np.nan, np.nan) for finding in findings]
    return {
        **_items(findings, ("corner", "component")),
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


def observations_columns(value: Observations | Observation) -> _Columns:
    """Return the columns of observations of windows, or of one."""
    observations = (value,) if isinstance(value, Observation) else value
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
        **_items(observations, ("vehicle", "is_conclusive", "reason")),
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
    tracks = [(number, track) for number, track in enumerate(tracked.tracks, start=1)]
    points = [(number, track) for number, track in tracks for _ in range(len(track))]

    def joined(values: Iterable[Any]) -> Any:
        return np.concatenate([np.zeros(0), *map(np.asarray, values)])

    return {
        "track": [number for number, _ in points],
        "label": [track.label for _, track in points],
        "window": joined(track.windows for _, track in tracks).astype(int),
        f"time [{'s' if tracked.has_times else 'windows'}]": joined(track.times for _, track in tracks),
        **{name: joined(_fields(track.modes, (name,))[name] for _, track in tracks) for name in _MODES},
        "mac [-]": joined(track.likeness for _, track in tracks),
    }


def inspection_columns(inspection: Inspection) -> _Columns:
    """Return the columns of an inspection."""
    names = ("name", "quantity", "unit", "n_values", "mean", "rms", "standard_deviation", "minimum", "maximum")
    return _items(inspection.channels, (*names, "clipped [-]", "stuck [-]", "is_dead"))


def calibration_columns(calibration: Calibration) -> _Columns:
    """Return the columns of a calibration."""
    names = ("name", "group", "unit", "nominal_value", "value", "std", "prior_std", "is_identifiable")
    return _items(calibration.learnt, names)


def _numbers(values: Iterable[float | None]) -> list[float]:
    """Return numbers, NaN for those that are unknown."""
    return [np.nan if value is None else float(value) for value in values]


def as_html(parts: Iterable[Any]) -> str:
    """Return headings (texts), tables, lists of tables and sentences, and tuples of all these as HTML."""
    blocks: list[Table | Sequence[str] | str] = []
    for part in parts:
        if isinstance(part, list):
            blocks += [
                *(each for each in part if isinstance(each, Table)),
                [each for each in part if isinstance(each, str)],
            ]
        else:
            blocks += part if isinstance(part, tuple) else (part,)
    return "\n".join(_block(block) for block in blocks if block)


def _block(part: Table | Sequence[str] | str) -> str:
    """Return a heading, a table or a list of sentences in HTML."""
    if isinstance(part, str):
        return f"<p><strong>{_text(part)}</strong></p>"
    if isinstance(part, Table) and part.title and not part.rows:
        return f"<p><strong>no {_text(part.title.lower())}</strong></p>"
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
