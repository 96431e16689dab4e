"""Modal identification: Cov-SSI, ACS-Cov-SSI and CoSS-SSI."""

from sprung.identification.methods import (
    METHODS,
    CorrelationSummary,
    Identification,
    SubsetModes,
    acs_ssi,
    coss_ssi,
    cov_ssi,
    modes_of_summary,
    summarise,
)
from sprung.identification.settings import IdentificationSettings, Plan

__all__ = [
    "METHODS",
    "CorrelationSummary",
    "Identification",
    "IdentificationSettings",
    "Plan",
    "SubsetModes",
    "acs_ssi",
    "coss_ssi",
    "cov_ssi",
    "modes_of_summary",
    "summarise",
]
