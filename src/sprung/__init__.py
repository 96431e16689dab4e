"""Sprung: suspension monitoring from sensors on the body.

Examples
--------
>>> import sprung
>>> run = sprung.read("run.csv")  # doctest: +SKIP
>>> print(sprung.cov_ssi(run))  # doctest: +SKIP
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sprung.diagnosis import Baseline, Diagnosis, Observation, diagnose, learn, observe, windows
    from sprung.errors import (
        DataError,
        FormatError,
        IdentificationError,
        MissingPackageError,
        ParameterError,
        SprungError,
    )
    from sprung.formats import read, read_blocks, write
    from sprung.identification import Identification, IdentificationSettings, acs_ssi, coss_ssi, cov_ssi
    from sprung.identification.stabilisation import THESIS_CRITERIA, StabilityCriteria
    from sprung.likelihood import CornerFit, CornerSettings, fit_corners
    from sprung.modal import Modes
    from sprung.recording import Channel, Gap, Recording
    from sprung.signals.cepstrum import Comb, Exponential, ShortPass
    from sprung.signals.inspection import Inspection, inspect
    from sprung.simulation import DriveSettings, simulate, simulate_drive
    from sprung.vehicles import read_vehicle, write_vehicle

__version__ = "0.1.0"

__all__ = [
    "THESIS_CRITERIA",
    "Baseline",
    "Channel",
    "Comb",
    "CornerFit",
    "CornerSettings",
    "DataError",
    "Diagnosis",
    "DriveSettings",
    "Exponential",
    "FormatError",
    "Gap",
    "Identification",
    "IdentificationError",
    "IdentificationSettings",
    "Inspection",
    "MissingPackageError",
    "Modes",
    "Observation",
    "ParameterError",
    "Recording",
    "ShortPass",
    "SprungError",
    "StabilityCriteria",
    "acs_ssi",
    "coss_ssi",
    "cov_ssi",
    "diagnose",
    "fit_corners",
    "inspect",
    "learn",
    "observe",
    "read",
    "read_blocks",
    "read_vehicle",
    "simulate",
    "simulate_drive",
    "windows",
    "write",
    "write_vehicle",
]

# Where each name lives; its module is imported when the name is first used, so that `import sprung` costs nothing.
_HOMES = {
    "signals.cepstrum": ("Comb", "Exponential", "ShortPass"),
    "diagnosis": ("Baseline", "Diagnosis", "Observation", "diagnose", "learn", "observe", "windows"),
    "errors": (
        "DataError",
        "FormatError",
        "IdentificationError",
        "MissingPackageError",
        "ParameterError",
        "SprungError",
    ),
    "formats": ("read", "read_blocks", "write"),
    "identification": ("Identification", "IdentificationSettings", "acs_ssi", "coss_ssi", "cov_ssi"),
    "signals.inspection": ("Inspection", "inspect"),
    "likelihood": ("CornerFit", "CornerSettings", "fit_corners"),
    "modal": ("Modes",),
    "recording": ("Channel", "Gap", "Recording"),
    "simulation": ("DriveSettings", "simulate", "simulate_drive"),
    "identification.stabilisation": ("THESIS_CRITERIA", "StabilityCriteria"),
    "vehicles": ("read_vehicle", "write_vehicle"),
}


def __getattr__(name: str) -> Any:
    """Import the module that has `name`, and keep the name."""
    for home, names in _HOMES.items():
        if name in names:
            value = getattr(import_module(f"sprung.{home}"), name)
            globals()[name] = value
            return value
    raise AttributeError(f"module 'sprung' has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
