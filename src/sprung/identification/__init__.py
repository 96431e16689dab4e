"""Modal identification: Cov-SSI, ACS-Cov-SSI and CoSS-SSI; pLSCF and FDD as second opinions; picking by hand."""

from sprung.identification.ladders import BlockRowLadder, OrderLadder
from sprung.identification.levels import LevelTrends
from sprung.identification.methods import (
    METHOD_NAMES,
    METHODS,
    SUBSPACE_METHODS,
    RunningSummary,
    acs_ssi,
    coss_ssi,
    cov_ssi,
    enhanced_fdd,
    modes_of_summary,
    poly_lscf,
    summarise,
)
from sprung.identification.picking import pick_modes
from sprung.identification.planning import rate_for_body
from sprung.identification.results import CorrelationSummary, Identification, RovingSetups, SetUp, SubsetModes
from sprung.identification.settings import IdentificationSettings, Plan, PreparationPlan, as_in_thesis
from sprung.identification.setups import identify_setups

__all__ = [
    "METHODS",
    "METHOD_NAMES",
    "SUBSPACE_METHODS",
    "BlockRowLadder",
    "CorrelationSummary",
    "Identification",
    "IdentificationSettings",
    "LevelTrends",
    "OrderLadder",
    "Plan",
    "PreparationPlan",
    "RovingSetups",
    "RunningSummary",
    "SetUp",
    "SubsetModes",
    "acs_ssi",
    "as_in_thesis",
    "coss_ssi",
    "cov_ssi",
    "enhanced_fdd",
    "identify_setups",
    "modes_of_summary",
    "pick_modes",
    "poly_lscf",
    "rate_for_body",
    "summarise",
]
