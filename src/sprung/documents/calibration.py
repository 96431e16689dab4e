"""The document of a calibration, `sprung.calibration/1`."""

from pathlib import Path
from typing import Literal

from pydantic import Field

from sprung._arrays import Real
from sprung._checks import check_type
from sprung.calibration import CalibratedNumber, Calibration
from sprung.documents.document import Document, checked, read_fields, write_document


class CalibrationDocument(Document):
    """Results of a calibration from drives; the vehicle file itself is written next to it."""

    schema_name: Literal["sprung.calibration/1"] = Field(alias="schema")
    vehicle: str
    learnt: tuple[CalibratedNumber, ...]
    coordinates: tuple[str, ...]
    frequencies: Real
    misfit_before: Real
    misfit_after: Real
    model_errors_before: tuple[float, ...]
    model_errors_after: tuple[float, ...]
    evidence_gain: float
    n_segments: tuple[int, ...]
    notes: tuple[str, ...]


def calibration_document(calibration: Calibration) -> CalibrationDocument:
    """Return a calibration as `sprung.calibration/1`.

    Parameters
    ----------
    calibration
        Vehicle completed from drives.
    """
    names = [name for name in CalibrationDocument.model_fields if name not in {"schema_name", "vehicle"}]
    fields = {name: getattr(calibration, name) for name in names}
    return CalibrationDocument.model_validate(
        {"schema": "sprung.calibration/1", "vehicle": calibration.vehicle.name, **fields}
    )


def write_calibration(calibration: Calibration, path: str | Path) -> None:
    """Write a calibration as a JSON file, `sprung.calibration/1`; `write_vehicle` writes the completed vehicle file.

    Parameters
    ----------
    calibration
        Vehicle completed from drives.
    path
        File to write; an existing one is replaced.
    """
    check_type("calibration", calibration, Calibration, advice="sprung.calibrate(recordings, vehicle)")
    write_document(calibration_document(calibration), path)


def read_calibration(path: str | Path) -> CalibrationDocument:
    """Read a calibration from a JSON file.

    Parameters
    ----------
    path
        File that `write_calibration` or `sprung calibrate --json` wrote.

    Raises
    ------
    ParameterError
        If the file cannot be read.
    FormatError
        If it contains something else.
    """
    return checked(CalibrationDocument, read_fields(path), source=str(path))
