"""Archives and streams of a fleet on Spark: the analyses of one window or vehicle, applied to all of them."""

from sprung.fleet.plan import Plan
from sprung.fleet.results import Results
from sprung.fleet.runs import FleetRun, FleetSettings, explain, run
from sprung.fleet.session import spark_session
from sprung.fleet.sources import messages_in_folder, messages_in_kafka, windows_of_lake, windows_of_messages
from sprung.fleet.streams import STREAM_SETTINGS, StreamBatch, StreamSettings, stream
from sprung.fleet.summaries import Cost, Summary, summarise

__all__ = [
    "STREAM_SETTINGS",
    "Cost",
    "FleetRun",
    "FleetSettings",
    "Plan",
    "Results",
    "StreamBatch",
    "StreamSettings",
    "Summary",
    "explain",
    "messages_in_folder",
    "messages_in_kafka",
    "run",
    "spark_session",
    "stream",
    "summarise",
    "windows_of_lake",
    "windows_of_messages",
]
