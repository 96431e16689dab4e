"""From windows of driving to findings: sensor checks, baseline, change tests, localisation, advice."""

from sprung.diagnosis.baseline import Baseline, baseline_from_dict, learn, nominal_baseline
from sprung.diagnosis.changes import Candidate, Detection, Hypothesis, detect, false_discoveries
from sprung.diagnosis.evidence import ModeChange, mode_changes
from sprung.diagnosis.findings import SEVERITIES, Diagnosis, Finding, Trend, diagnose, trend
from sprung.diagnosis.observation import Observation, observation_from_dict, observe, observe_window, windows
from sprung.diagnosis.residuals import (
    FEWEST as FEWEST_RESIDUALS,
)
from sprung.diagnosis.residuals import (
    VEHICLE_RATE,
    ResidualReference,
    ResidualTest,
    compare_residuals,
    learn_residuals,
    outputs_at,
    second_opinion,
)
from sprung.diagnosis.sensors import KINDS, SensorFault, sensor_faults

__all__ = [
    "FEWEST_RESIDUALS",
    "KINDS",
    "SEVERITIES",
    "VEHICLE_RATE",
    "Baseline",
    "Candidate",
    "Detection",
    "Diagnosis",
    "Finding",
    "Hypothesis",
    "ModeChange",
    "Observation",
    "ResidualReference",
    "ResidualTest",
    "SensorFault",
    "Trend",
    "baseline_from_dict",
    "compare_residuals",
    "detect",
    "diagnose",
    "false_discoveries",
    "learn",
    "learn_residuals",
    "mode_changes",
    "nominal_baseline",
    "observation_from_dict",
    "observe",
    "observe_window",
    "outputs_at",
    "second_opinion",
    "sensor_faults",
    "trend",
    "windows",
]
