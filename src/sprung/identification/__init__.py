"""Modal identification: Cov-SSI, ACS-Cov-SSI and CoSS-SSI."""

from sprung.identification.ladders import BlockRowLadder, OrderLadder
from sprung.identification.methods import METHODS, acs_ssi, coss_ssi, cov_ssi, modes_of_summary, summarise
from sprung.identification.results import CorrelationSummary, Identification, SubsetModes
from sprung.identification.settings import IdentificationSettings, Plan, PreparationPlan, as_in_thesis
from sprung.identification.trends import LevelTrends

__all__ = [
    "METHODS",
    "BlockRowLadder",
    "CorrelationSummary",
    "Identification",
    "IdentificationSettings",
    "LevelTrends",
    "OrderLadder",
    "Plan",
    "PreparationPlan",
    "SubsetModes",
    "acs_ssi",
    "as_in_thesis",
    "coss_ssi",
    "cov_ssi",
    "modes_of_summary",
    "summarise",
]
