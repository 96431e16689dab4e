"""Sprung: suspension monitoring from sensors on the body.

Examples
--------
>>> import sprung
>>> run = sprung.read("run.csv")  # doctest: +SKIP
>>> print(sprung.cov_ssi(run))  # doctest: +SKIP
"""

from pkgutil import resolve_name

__version__ = "0.1.0"

# Public names by module. A module is imported when one of its names is first used, so that `import sprung` stays cheap;
# the types of the names are in `__init__.pyi`.
_NAMES = {
    "calibration": "CalibratedNumber Calibration CalibrationSettings DataSheet calibrate described",
    "diagnosis": (
        "Baseline Candidate Detection Diagnosis Finding Findings Hypothesis Observation Observations "
        "RankedVehicle ResidualReference ResidualStatistics ResidualTest SensorFault Size Trend TypeBaseline "
        "detectable diagnose learn learn_type observe rank_fleet windows"
    ),
    "results.documents": (
        "CalibrationDocument CornersDocument DiagnosisDocument Document IdentificationDocument InspectionDocument "
        "TrackingDocument TruthDocument json_schema read_baseline read_calibration read_corners read_diagnosis "
        "read_document read_identification read_inspections read_tracking read_truth read_type_baseline "
        "write_baseline write_calibration write_corners write_diagnosis write_document write_identification "
        "write_inspections write_tracking write_truth write_type_baseline"
    ),
    "errors": "DataError FormatError IdentificationError MissingPackageError ParameterError SprungError",
    "excitation": "Excitation Potholes SpeedChanges SpeedProfile",
    "formats": "read read_blocks write",
    "identification": (
        "BlockRowLadder Identification IdentificationSettings LevelTrends OrderLadder RovingSetups SetUp "
        "SubsetModes acs_ssi as_in_thesis coss_ssi cov_ssi enhanced_fdd identify_setups pick_modes poly_lscf"
    ),
    "identification.band_fits": "BandFit",
    "identification.plscf": "PolynomialLadder",
    "identification.refinement": "Refinement",
    "identification.settings": "Plan PreparationPlan",
    "identification.stabilisation": "StabilisationDiagram StabilityCriteria THESIS_CRITERIA",
    "identification.tracking": "Jump Track TrackTrend TrackedModes TrackedValue TrackingSettings track_modes",
    "likelihood": "CornerFit CornerSettings fit_corners",
    "likelihood.speed_delay": "SpeedDelay",
    "modal": "Modes PoleStatus Poles mac",
    "recording": "Channel Gap Recording",
    "signals.cepstrum": "Comb Exponential Lifter ShortPass",
    "signals.harmonics": "Harmonic",
    "signals.inspection": "ChannelFacts Inspection inspect",
    "signals.spectrum": "SpectralMatrix",
    "simulation": (
        "Deviations DriveSettings Driving PartScatter Payload RailDrive RigRun RoadConditions RoadDrive "
        "SensorErrors SimulatedDrive SuspensionConditions Wear WheelOrders simulate simulate_drive "
        "usual_excitation"
    ),
    "vehicles": (
        "Axle Body Chain Component ExactModes Fault FlexibleMode MountedMass Quarter Sensor Structure Vehicle "
        "parse_fault read_description read_vehicle structure write_vehicle"
    ),
}
_PLACES = {name: f"sprung.{home}:{name}" for home, names in _NAMES.items() for name in names.split()}
_PLACES["plotting"] = "sprung.plotting"

__all__ = list(_PLACES)


def __getattr__(name: str) -> object:
    if name not in _PLACES:
        raise AttributeError(f"module 'sprung' has no attribute {name!r}")
    value: object = resolve_name(_PLACES[name])
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
