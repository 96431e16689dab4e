"""Values as notebooks show them: the tables and sentences of the command line, in HTML."""

from collections.abc import Sequence
from html import escape

from sprung.calibration import Calibration
from sprung.diagnosis import Baseline, Diagnosis, Finding, Findings, Observation, Observations
from sprung.identification import Identification
from sprung.identification.stabilisation import StabilisationDiagram
from sprung.identification.tracking import TrackedModes
from sprung.likelihood import CornerFit
from sprung.modal import Modes, PoleStatus
from sprung.recording import Recording
from sprung.results.tables.calibration import calibration_in_words, calibration_table
from sprung.results.tables.corners import components_table, fitted_modes_table, payload_in_words
from sprung.results.tables.diagnosis import (
    baseline_in_words,
    baseline_table,
    diagnosis_in_words,
    diagnosis_tables,
    findings_table,
    observations_table,
)
from sprung.results.tables.identification import identification_in_words, identification_tables, modes_table
from sprung.results.tables.inspection import inspection_in_words, inspection_table
from sprung.results.tables.table import Table
from sprung.results.tables.tracking import tracks_in_words, tracks_table
from sprung.signals.inspection import Inspection, inspect

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
