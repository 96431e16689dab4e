"""Calibration: a vehicle file from a data sheet, completed from healthy drives."""

from sprung.calibration.completion import (
    CALIBRATION_WINDOWS,
    CalibratedNumber,
    Calibration,
    CalibrationSettings,
    calibrate,
    calibrated,
    calibrated_if_imperfect,
    chosen_windows,
    is_imperfect,
    usable_spectra,
)
from sprung.calibration.data_sheet import DataSheet, described, tyre_stiffness
from sprung.calibration.joint import WindowSpectra, window_layouts

__all__ = [
    "CALIBRATION_WINDOWS",
    "CalibratedNumber",
    "Calibration",
    "CalibrationSettings",
    "DataSheet",
    "WindowSpectra",
    "calibrate",
    "calibrated",
    "calibrated_if_imperfect",
    "chosen_windows",
    "described",
    "is_imperfect",
    "tyre_stiffness",
    "usable_spectra",
    "window_layouts",
]
