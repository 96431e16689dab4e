"""Archives of a fleet on Spark: the analyses of one window or vehicle, applied to all of them."""

from sprung.fleet.jobs.plan import Plan
from sprung.fleet.jobs.results import Results
from sprung.fleet.jobs.runs import FleetRun, FleetSettings, explain, run
from sprung.fleet.jobs.session import spark_session
from sprung.fleet.jobs.summaries import Cost, Summary, summarise

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
