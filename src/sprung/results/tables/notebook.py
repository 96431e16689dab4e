"""Values as notebooks show them: the tables and sentences of the command line, in HTML."""

from collections.abc import Sequence
from functools import singledispatch
from html import escape

from sprung.calibration import Calibration
from sprung.diagnosis import Baseline, Diagnosis, Finding, Findings, Observation, Observations
from sprung.errors import ParameterError
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
_Parts = Sequence[Table | Sequence[str] | str]


def as_html(value: object) -> str:
    """Return a value as HTML: the tables and sentences that the command line shows.

    Parameters
    ----------
    value
        Recording, modes, or a result.

    Raises
    ------
    ParameterError
        If a value of this type has no tables.
    """
    return "\n".join(_block(part) for part in parts_of(value) if part)


@singledispatch
def parts_of(value: object) -> _Parts:
    """Return the headings, tables and lists of sentences of a value.

    Raises
    ------
    ParameterError
        If a value of this type has none.
    """
    raise ParameterError(f"a {type(value).__name__} has no tables: pass a recording, modes or a result")


@parts_of.register
def _of_recording(recording: Recording) -> _Parts:
    return [*parts_of(inspect(recording)), recording.history]


@parts_of.register
def _of_inspection(inspection: Inspection) -> _Parts:
    return [inspection_in_words(inspection), inspection_table(inspection)]


@parts_of.register
def _of_modes(modes: Modes) -> _Parts:
    return [modes_table(modes)]


@parts_of.register
def _of_identification(identification: Identification) -> _Parts:
    return [
        identification_in_words(identification),
        *identification_tables(identification),
        identification.notes,
    ]


@parts_of.register
def _of_diagram(diagram: StabilisationDiagram) -> _Parts:
    counts = {status: int((diagram.status == status).sum()) for status in PoleStatus}
    rows = tuple((str(count), status.sentence) for status, count in counts.items() if count)
    return [Table("Stabilisation diagram", ("poles", "status"), rows, n_words=0)]


@parts_of.register
def _of_tracks(tracked: TrackedModes) -> _Parts:
    return [tracks_in_words(tracked), tracks_table(tracked, has_times=tracked.has_times)]


@parts_of.register
def _of_corners(fit: CornerFit) -> _Parts:
    return [components_table(fit), fitted_modes_table(fit), [*payload_in_words(fit), *fit.notes]]


@parts_of.register
def _of_baseline(baseline: Baseline) -> _Parts:
    words = baseline_in_words(baseline, n_windows=baseline.n_windows + baseline.n_refused)
    return [baseline_table(baseline), words]


@parts_of.register
def _of_diagnosis(diagnosis: Diagnosis) -> _Parts:
    return [diagnosis_in_words(diagnosis), *diagnosis_tables(diagnosis, ()), diagnosis.notes]


@parts_of.register
def _of_finding(finding: Finding) -> _Parts:
    return [findings_table((finding,))]


@parts_of.register
def _of_findings(findings: Findings) -> _Parts:
    return [findings_table(findings)] if findings else ["no findings"]


@parts_of.register
def _of_observation(observation: Observation) -> _Parts:
    return [observations_table((observation,))]


@parts_of.register
def _of_observations(observations: Observations) -> _Parts:
    return [observations_table(observations)] if observations else ["no windows"]


@parts_of.register
def _of_calibration(calibration: Calibration) -> _Parts:
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
