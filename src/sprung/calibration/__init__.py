"""Calibration: what belongs to a vehicle, learnt from healthy drives."""

from sprung.calibration.completion import CalibrationSettings, calibrate
from sprung.calibration.results import CalibratedNumber, Calibration

__all__ = ["CalibratedNumber", "Calibration", "CalibrationSettings", "calibrate"]
