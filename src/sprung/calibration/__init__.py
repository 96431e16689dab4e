"""Calibration: what belongs to a vehicle, from its data sheet and from healthy drives."""

from sprung.calibration.completion import (
    CalibrationSettings,
    calibrate,
    calibrated_if_imperfect,
    chosen_windows,
    is_imperfect,
)
from sprung.calibration.data_sheet import DataSheet, described, tyre_stiffness
from sprung.calibration.results import CalibratedNumber, Calibration

__all__ = [
    "CalibratedNumber",
    "Calibration",
    "CalibrationSettings",
    "DataSheet",
    "calibrate",
    "calibrated_if_imperfect",
    "chosen_windows",
    "described",
    "is_imperfect",
    "tyre_stiffness",
]
