"""From windows of driving to findings: sensor checks, baseline, change tests, localisation, advice."""

from sprung.diagnosis.assessment import (
    RankedVehicle,
    compare,
    diagnose,
    diagnosis_of,
    doubt_about,
    max_undetected,
    rank_fleet,
)
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.changes import (
    Candidate,
    ChangeDetector,
    Detection,
    Size,
    detect,
    false_discoveries,
)
from sprung.diagnosis.channel_faults import SensorFault
from sprung.diagnosis.detectability import detectable
from sprung.diagnosis.findings import (
    SEVERITIES,
    Diagnosis,
    Finding,
    Findings,
    ModeChange,
    Verdict,
    detectable_in_words,
    mode_changes,
)
from sprung.diagnosis.hypotheses import Hypothesis
from sprung.diagnosis.learning import LEARNING_WINDOWS, learn
from sprung.diagnosis.observation import (
    Observation,
    Observations,
    observe,
    observe_window,
    windows,
    with_missing_as_faults,
)
from sprung.diagnosis.residuals import (
    ResidualReference,
    ResidualStatistics,
    ResidualTest,
    learn_reference,
    residual_statistics,
    residual_test,
)
from sprung.diagnosis.sensors import sensor_faults
from sprung.diagnosis.trends import Trend, trend
from sprung.diagnosis.type_baselines import TypeBaseline, nominal_type
from sprung.diagnosis.type_comparison import compare_with_type
from sprung.diagnosis.type_learning import learn_type

__all__ = [
    "LEARNING_WINDOWS",
    "SEVERITIES",
    "Baseline",
    "Candidate",
    "ChangeDetector",
    "Detection",
    "Diagnosis",
    "Finding",
    "Findings",
    "Hypothesis",
    "ModeChange",
    "Observation",
    "Observations",
    "RankedVehicle",
    "ResidualReference",
    "ResidualStatistics",
    "ResidualTest",
    "SensorFault",
    "Size",
    "Trend",
    "TypeBaseline",
    "Verdict",
    "compare",
    "compare_with_type",
    "detect",
    "detectable",
    "detectable_in_words",
    "diagnose",
    "diagnosis_of",
    "doubt_about",
    "false_discoveries",
    "learn",
    "learn_reference",
    "learn_type",
    "max_undetected",
    "mode_changes",
    "nominal_type",
    "observe",
    "observe_window",
    "rank_fleet",
    "residual_statistics",
    "residual_test",
    "sensor_faults",
    "trend",
    "windows",
    "with_missing_as_faults",
]
