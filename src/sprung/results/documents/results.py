"""Any result as its published document."""

from functools import singledispatch
from os import PathLike
from pathlib import Path

from sprung.calibration import Calibration
from sprung.diagnosis import Baseline, Diagnosis, TypeBaseline
from sprung.errors import ParameterError
from sprung.identification import Identification
from sprung.identification.tracking import TrackedModes
from sprung.likelihood import CornerFit
from sprung.results.documents.baseline import baseline_document
from sprung.results.documents.calibration import calibration_document
from sprung.results.documents.corners import corners_document
from sprung.results.documents.diagnosis import diagnosis_document
from sprung.results.documents.document import Document, write_document
from sprung.results.documents.identification import identification_document
from sprung.results.documents.recordings import inspection_document
from sprung.results.documents.tracking import tracking_document
from sprung.results.documents.type_baseline import type_baseline_document
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

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((12, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> baseline = sprung.learn(windows)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "car.json")
    ...     save(baseline, path)
    ...     again = sprung.read_document(path)
    >>> again.schema_name
    'sprung.baseline/1'
    """
    write_document(document_of(result), Path(path))


@singledispatch
def document_of(result: object) -> Document:
    """Return the published document of a result.

    Raises
    ------
    ParameterError
        If a value of this type has none.

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.recording import Channel, Recording
    >>> tone = 3 * np.sqrt(2) * np.sin(2 * np.pi * 7 * np.arange(4000) / 100)
    >>> run = Recording(tone[None], 100.0, (Channel("acc", "acceleration"),))
    >>> import sprung
    >>> document_of(sprung.inspect(run)).schema_name
    'sprung.info/1'
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
