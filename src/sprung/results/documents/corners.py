"""Documents of fits: of a vehicle, `sprung.corners/1`, and of a calibration, `sprung.calibration/1`."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any, Literal

import numpy as np
from pydantic import Field

from sprung._arrays import Real
from sprung._checks import check_type, data_frame_of
from sprung._display import in_short, listed
from sprung.calibration import CalibratedNumber, Calibration
from sprung.likelihood import CornerFit
from sprung.likelihood.plate_test import PlateTest, plate_tests
from sprung.likelihood.wheels import RunOut, run_out
from sprung.results.documents.document import (
    Document,
    Estimate,
    Number,
    Pair,
    checked,
    read_fields,
    write_document,
)
from sprung.results.documents.modes import FittedMode, fitted_modes

#: Decimals of the correlation of estimates.
_DECIMALS = 4


class ComponentEstimate(Document):
    """A fitted spring, damper or tyre; `from_modes` only where the modes were identified as well."""

    value: float
    std: Number
    relative_to_nominal: float
    is_identifiable: bool
    from_modes: float | None = None


class FitQuality(Document):
    """Quality of the fit to the spectra, and correlation of the estimates."""

    model_error: Number
    n_segments: int
    n_rejected: int
    band: Pair
    parameters: tuple[str, ...]
    correlation: Real


class PlateTestDocument(Document):
    """What a suspension tester would measure at a corner: phase shift [degrees], adhesion 0 to 1, damping, friction."""

    phase_shift: float
    phase_shift_std: float
    adhesion: float
    adhesion_std: float
    damping_ratio: float
    damping_ratio_std: float
    wheel_damping_ratio: float
    wheel_damping_ratio_std: float
    viscous_damping: float
    viscous_damping_std: float
    friction: float
    friction_std: float
    is_friction_identifiable: bool
    asymmetry: Number


class WheelsDocument(Document):
    """Wheels that are not round: distance of a turn [m], and RMS of the run-out of each wheel [m]."""

    circumference: float
    run_out: dict[str, Estimate]


class CornersDocument(Document):
    """A fit of springs, dampers and tyres as stored in a file: without the model and the spectra it was fitted to."""

    schema_name: Literal["sprung.corners/1"] = Field(alias="schema")
    corners: dict[str, dict[str, ComponentEstimate]]
    modes: tuple[FittedMode, ...]
    channels: tuple[str, ...]
    road: dict[str, Number]
    payload: dict[str, Estimate]
    sensors: dict[str, Estimate]
    fit: FitQuality
    inspection: dict[str, PlateTestDocument] = Field(default_factory=dict)
    wheels: WheelsDocument | None = None
    notes: tuple[str, ...]

    def __repr__(self) -> str:
        """Return the quality of the fit, and the changes from nominal."""
        changes = (
            f"{corner}.{kind} {100 * (part.relative_to_nominal - 1):+z.1f} %"
            for corner, parts in self.corners.items()
            for kind, part in parts.items()
            if part.is_identifiable
        )
        head = f"CornersDocument from {self.fit.n_segments} segments, model error {100 * self.fit.model_error:.2g} %"
        return in_short(head, f"from nominal: {listed(changes)}", *self.notes[:1])

    def to_dataframe(self) -> Any:
        """Return the components as a pandas.DataFrame, as `CornerFit.to_dataframe`.

        Raises
        ------
        MissingPackageError
            If pandas is not installed.
        """
        parts = [(corner, kind, part) for corner, own in self.corners.items() for kind, part in own.items()]
        return data_frame_of(
            {
                "corner": [corner for corner, _, _ in parts],
                "component": [kind for _, kind, _ in parts],
                "value [N/m, N s/m]": [part.value for _, _, part in parts],
                "std [N/m, N s/m]": [part.std for _, _, part in parts],
                "relative_to_nominal [-]": [part.relative_to_nominal for _, _, part in parts],
                "is_identifiable": [part.is_identifiable for _, _, part in parts],
            }
        )


def corners_document(fit: CornerFit, *, inspection: Mapping[str, PlateTest] | None = None) -> CornersDocument:
    """Return a fit of springs, dampers and tyres as `sprung.corners/1`.

    Parameters
    ----------
    fit
        Fitted vehicle.
    inspection
        Figures of a suspension tester; None: those of the fit alone.

    Examples
    --------
    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=30.0, sampling_rate=60.0, snr=50.0), seed=1)
    >>> fit = fit_corners(drive.recording, vehicle)
    >>> document = corners_document(fit)
    >>> document.schema_name, list(document.corners)
    ('sprung.corners/1', ['front_left', 'front_right', 'rear_left', 'rear_right'])
    """
    check_type("fit", fit, CornerFit)
    modes = fit.modes()
    frequencies = fit.model.spectra.frequencies
    return CornersDocument.model_validate(
        {
            "schema": "sprung.corners/1",
            "corners": _corners(fit),
            "modes": fitted_modes(modes, fit.modes_std()),
            "channels": modes.channels,
            "road": fit.inputs,
            "payload": fit.payload,
            "sensors": fit.sensors,
            "fit": {
                "model_error": fit.model_error,
                "n_segments": fit.n_segments,
                "n_rejected": fit.n_rejected,
                "band": (frequencies[0], frequencies[-1]),
                "parameters": fit.model.names[: len(fit.components)],
                "correlation": _correlation(fit),
            },
            "inspection": plate_tests(fit) if inspection is None else inspection,
            "notes": fit.notes,
        }
        | ({} if (wheels := run_out(fit)) is None else {"wheels": _wheels(wheels)})
    )


def _wheels(found: RunOut) -> dict[str, Any]:
    """Return the fields of the wheels that are not round."""
    each = zip(found.wheels, found.values.tolist(), found.stds.tolist(), strict=True)
    return {
        "circumference": found.circumference,
        "run_out": {name: {"value": value, "std": std} for name, value, std in each},
    }


def write_corners(fit: CornerFit, path: str | Path) -> None:
    """Write a fit of springs, dampers and tyres as a JSON file, `sprung.corners/1`.

    Parameters
    ----------
    fit
        Fitted vehicle.
    path
        File to write; an existing one is replaced.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> import sprung
    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=30.0, sampling_rate=60.0, snr=50.0), seed=1)
    >>> fit = fit_corners(drive.recording, vehicle)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "corners.json")
    ...     write_corners(fit, path)
    ...     again = sprung.read_corners(path)
    >>> again.fit.n_segments == fit.n_segments, list(again.corners)
    (True, ['front_left', 'front_right', 'rear_left', 'rear_right'])
    """
    write_document(corners_document(fit), path)


def read_corners(path: str | Path) -> CornersDocument:
    """Read a fit of springs, dampers and tyres from a JSON file.

    Parameters
    ----------
    path
        File that `write_corners` or `sprung corners --json` wrote.

    Returns
    -------
    CornersDocument
        Estimates, modes, inputs and notes. The model and the spectra of a `CornerFit` are not in the file.

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
    >>> from sprung.likelihood import fit_corners
    >>> from sprung.simulation import RoadDrive, simulate_drive
    >>> from sprung.vehicles import read_vehicle
    >>> vehicle = read_vehicle("zafira")
    >>> drive = simulate_drive(vehicle, RoadDrive(duration=30.0, sampling_rate=60.0, snr=50.0), seed=1)
    >>> fit = fit_corners(drive.recording, vehicle)
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "corners.json")
    ...     sprung.write_corners(fit, path)
    ...     again = read_corners(path)
    >>> [mode.label for mode in again.modes][:3]
    ['bounce', 'pitch', 'roll']
    """
    return checked(CornersDocument, read_fields(path), source=str(path))


def _corners(fit: CornerFit) -> dict[str, dict[str, dict[str, Any]]]:
    corners: dict[str, dict[str, dict[str, Any]]] = {}
    for row, component in enumerate(fit.components):
        value, nominal = fit.values[row], fit.nominal[row]
        estimate = {
            "value": value,
            "std": value * fit.log_ratios_std[row],
            "relative_to_nominal": value / nominal,
            "is_identifiable": bool(fit.is_identifiable[row]),
        }
        if fit.from_modes is not None:
            estimate["from_modes"] = nominal * np.exp(fit.from_modes[row])
        corners.setdefault(component.corner, {})[component.kind] = estimate
    return corners


def _correlation(fit: CornerFit) -> Real:
    count = len(fit.components)
    deviations = np.sqrt(np.diag(fit.covariance))[:count]
    return (fit.covariance[:count, :count] / np.outer(deviations, deviations)).round(_DECIMALS)


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
    return CalibrationDocument.of(calibration, vehicle=calibration.vehicle.name)


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
