"""Modal identification: Cov-SSI, ACS-Cov-SSI and CoSS-SSI."""

from sprung.identification.ladders import BlockRowLadder, OrderLadder
from sprung.identification.methods import METHODS, acs_ssi, coss_ssi, cov_ssi, modes_of_summary, summarise
from sprung.identification.results import CorrelationSummary, Identification, RovingSetups, SetUp, SubsetModes
from sprung.identification.settings import IdentificationSettings, Plan, PreparationPlan, as_in_thesis
from sprung.identification.setups import identify_setups

__all__ = [
    "METHODS",
    "BlockRowLadder",
    "CorrelationSummary",
    "Identification",
    "IdentificationSettings",
    "OrderLadder",
    "Plan",
    "PreparationPlan",
    "RovingSetups",
    "SetUp",
    "SubsetModes",
    "acs_ssi",
    "as_in_thesis",
    "coss_ssi",
    "cov_ssi",
    "identify_setups",
    "modes_of_summary",
    "summarise",
]
