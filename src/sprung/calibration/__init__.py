"""Calibration: what belongs to a vehicle, learnt from healthy drives."""

from sprung.calibration.completion import CalibrationSettings, calibrate
from sprung.calibration.results import Calibration, LearntNumber

__all__ = ["Calibration", "CalibrationSettings", "LearntNumber", "calibrate"]
