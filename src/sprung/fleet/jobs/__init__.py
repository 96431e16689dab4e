"""Archives of a fleet on Spark: the analyses of one window or vehicle, applied to all of them."""

from sprung.fleet.jobs.plan import Cost, FleetSettings, Plan
from sprung.fleet.jobs.results import Results
from sprung.fleet.jobs.runs import FleetRun, Summary, explain, run, summarise
from sprung.fleet.jobs.spark import spark_session

__all__ = [
    "Cost",
    "FleetRun",
    "FleetSettings",
    "Plan",
    "Results",
    "Summary",
    "explain",
    "run",
    "spark_session",
    "summarise",
]
