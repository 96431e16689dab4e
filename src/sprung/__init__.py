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
    "calibration": "Calibration CalibrationSettings DataSheet calibrate described",
    "diagnosis": (
        "Baseline Diagnosis Finding Observation SensorFault TypeBaseline detectable diagnose learn learn_type observe "
        "rank_fleet windows"
    ),
    "documents": (
        "CornersDocument DiagnosisDocument Document IdentificationDocument TrackingDocument TruthDocument json_schema "
        "read_baseline read_corners read_diagnosis read_document read_identification read_inspections read_truth "
        "write_baseline write_corners write_diagnosis write_document write_identification write_inspections write_truth"
    ),
    "errors": "DataError FormatError IdentificationError MissingPackageError ParameterError SprungError",
    "formats": "read read_blocks write",
    "identification": (
        "BlockRowLadder Identification IdentificationSettings acs_ssi as_in_thesis coss_ssi cov_ssi enhanced_fdd "
        "identify_setups pick_modes poly_lscf"
    ),
    "identification.tracking": "track_modes",
    "identification.tracks": "Jump Track TrackedModes TrackingSettings",
    "identification.stabilisation": "THESIS_CRITERIA StabilisationDiagram StabilityCriteria",
    "likelihood": "CornerFit CornerSettings fit_corners",
    "modal": "Modes mac",
    "recording": "Channel Gap Recording",
    "signals.cepstrum": "Comb Exponential ShortPass",
    "signals.harmonics": "Harmonic",
    "signals.inspection": "Inspection inspect",
    "signals.spectrum": "SpectralMatrix",
    "simulation": (
        "Deviations DriveSettings Driving PartScatter Payload RailDrive RigRun RoadConditions RoadDrive SensorErrors "
        "SimulatedDrive SuspensionConditions Wear WheelOrders simulate simulate_drive usual_excitation"
    ),
    "vehicles": (
        "Chain Component Fault Quarter Structure Vehicle parse_fault read_description read_vehicle structure "
        "write_vehicle"
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
