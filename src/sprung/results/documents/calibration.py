"""The document of a calibration, `sprung.calibration/1`."""

from pathlib import Path
from typing import Literal

from pydantic import Field

from sprung._arrays import Real
from sprung._checks import check_type
from sprung.calibration import CalibratedNumber, Calibration
from sprung.results.documents.document import Document, checked, read_fields, write_document


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

    Examples
    --------
    >>> import numpy as np
    >>> from sprung.calibration import CalibratedNumber, Calibration
    >>> from sprung.vehicles import read_vehicle
    >>> place = CalibratedNumber("acc_fl.x", "sensors", "m", 1.22, 1.3, 0.01, 0.1, is_identifiable=True)
    >>> vehicle, f, misfit = read_vehicle("zafira"), np.linspace(1, 20, 39), np.full((1, 39), 0.5)
    >>> misfits = {"misfit_before": misfit, "misfit_after": misfit / 5}
    >>> errors = {"model_errors_before": (0.3,), "model_errors_after": (0.04,), "evidence_gain": 120.0}
    >>> rest = {**misfits, **errors, "n_segments": (200,), "notes": ()}
    >>> calibration = Calibration(vehicle, (place,), ("bounce",), f, **rest)
    >>> document = calibration_document(calibration)
    >>> document.schema_name, document.evidence_gain, [(number.name, number.value) for number in document.learnt]
    ('sprung.calibration/1', 120.0, [('acc_fl.x', 1.3)])
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

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import sprung
    >>> import numpy as np
    >>> from sprung.calibration import CalibratedNumber, Calibration
    >>> from sprung.vehicles import read_vehicle
    >>> place = CalibratedNumber("acc_fl.x", "sensors", "m", 1.22, 1.3, 0.01, 0.1, is_identifiable=True)
    >>> vehicle, f, misfit = read_vehicle("zafira"), np.linspace(1, 20, 39), np.full((1, 39), 0.5)
    >>> misfits = {"misfit_before": misfit, "misfit_after": misfit / 5}
    >>> errors = {"model_errors_before": (0.3,), "model_errors_after": (0.04,), "evidence_gain": 120.0}
    >>> rest = {**misfits, **errors, "n_segments": (200,), "notes": ()}
    >>> calibration = Calibration(vehicle, (place,), ("bounce",), f, **rest)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "zafira.json")
    ...     write_calibration(calibration, path)
    ...     again = sprung.read_calibration(path)
    >>> again.learnt[0].name, again.learnt[0].value
    ('acc_fl.x', 1.3)
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

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import sprung
    >>> import numpy as np
    >>> from sprung.calibration import CalibratedNumber, Calibration
    >>> from sprung.vehicles import read_vehicle
    >>> place = CalibratedNumber("acc_fl.x", "sensors", "m", 1.22, 1.3, 0.01, 0.1, is_identifiable=True)
    >>> vehicle, f, misfit = read_vehicle("zafira"), np.linspace(1, 20, 39), np.full((1, 39), 0.5)
    >>> misfits = {"misfit_before": misfit, "misfit_after": misfit / 5}
    >>> errors = {"model_errors_before": (0.3,), "model_errors_after": (0.04,), "evidence_gain": 120.0}
    >>> rest = {**misfits, **errors, "n_segments": (200,), "notes": ()}
    >>> calibration = Calibration(vehicle, (place,), ("bounce",), f, **rest)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "zafira.json")
    ...     sprung.write_calibration(calibration, path)
    ...     again = read_calibration(path)
    >>> again.model_errors_before, again.model_errors_after
    ((0.3,), (0.04,))
    """
    return checked(CalibrationDocument, read_fields(path), source=str(path))
