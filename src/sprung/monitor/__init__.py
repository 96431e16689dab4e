"""The online monitor: vehicles in, modes, diagnoses and alerts out, for months."""

from sprung.monitor.alarms import Alarms, Postman, alert_of, row_of
from sprung.monitor.blocks import Block, FrameBlock, frame_block, joined
from sprung.monitor.broker import EmbeddedBroker
from sprung.monitor.engine import Event, Identified, MonitorSettings, Observed, VehicleMonitor, mode_documents
from sprung.monitor.intake import MONITOR, Intake
from sprung.monitor.serving import FIGURES, Serving, exposition
from sprung.monitor.site import Site, embedded_port, read_site
from sprung.monitor.station import Station
from sprung.monitor.streams import Stream
from sprung.monitor.summaries import summary_document, summary_from_document
from sprung.monitor.workers import Opening, Outcome, Workers

__all__ = [
    "FIGURES",
    "MONITOR",
    "Alarms",
    "Block",
    "EmbeddedBroker",
    "Event",
    "FrameBlock",
    "Identified",
    "Intake",
    "MonitorSettings",
    "Observed",
    "Opening",
    "Outcome",
    "Postman",
    "Serving",
    "Site",
    "Station",
    "Stream",
    "VehicleMonitor",
    "Workers",
    "alert_of",
    "embedded_port",
    "exposition",
    "frame_block",
    "joined",
    "mode_documents",
    "read_site",
    "row_of",
    "summary_document",
    "summary_from_document",
]
