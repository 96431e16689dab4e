"""Any result as its published document."""

from functools import singledispatch
from os import PathLike
from pathlib import Path

from sprung.calibration import Calibration
from sprung.diagnosis import Baseline, Diagnosis, TypeBaseline
from sprung.documents.baseline import baseline_document
from sprung.documents.calibration import calibration_document
from sprung.documents.corners import corners_document
from sprung.documents.diagnosis import diagnosis_document
from sprung.documents.document import Document, write_document
from sprung.documents.identification import identification_document
from sprung.documents.recordings import inspection_document
from sprung.documents.tracking import tracking_document
from sprung.documents.type_baseline import type_baseline_document
from sprung.errors import ParameterError
from sprung.identification import Identification
from sprung.identification.tracks import TrackedModes
from sprung.likelihood import CornerFit
from sprung.signals.inspection import Inspection


def save(result: object, path: str | PathLike[str]) -> None:
    """Write a result as its published JSON document.

    Parameters
    ----------
    result
        Result of any analysis, or a document.
    path
        File to write; an existing one is replaced.

    Raises
    ------
    ParameterError
        If a value of this type has no document.
    """
    write_document(document_of(result), Path(path))


@singledispatch
def document_of(result: object) -> Document:
    """Return the published document of a result.

    Raises
    ------
    ParameterError
        If a value of this type has none.
    """
    raise ParameterError(f"a {type(result).__name__} has no document: pass a result, such as sprung.cov_ssi(recording)")


document_of.register(Baseline, baseline_document)
document_of.register(Calibration, calibration_document)
document_of.register(CornerFit, corners_document)
document_of.register(Diagnosis, diagnosis_document)
document_of.register(Identification, identification_document)
document_of.register(TypeBaseline, type_baseline_document)


@document_of.register
def _of_document(document: Document) -> Document:
    return document


@document_of.register
def _of_inspection(inspection: Inspection) -> Document:
    return inspection_document({"": inspection})


@document_of.register
def _of_tracks(tracked: TrackedModes) -> Document:
    return tracking_document(tracked, has_times=tracked.has_times)
