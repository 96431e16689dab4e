"""The online monitor: vehicles in, modes, diagnoses and alerts out, for months."""

from sprung.monitor.alert_book import AlertBook, alert_of, row_of
from sprung.monitor.broker import EmbeddedBroker
from sprung.monitor.engine import Event, Identified, MonitorSettings, Observed, VehicleMonitor
from sprung.monitor.figures import FIGURES
from sprung.monitor.intake import MONITOR, Intake
from sprung.monitor.jobs import Failure, Opening, Outcome, VehicleStatus
from sprung.monitor.postman import PostOffice
from sprung.monitor.site import Site, embedded_port, read_site
from sprung.monitor.station import Station
from sprung.monitor.streams import Stream
from sprung.monitor.workers import Workers

__all__ = [
    "FIGURES",
    "MONITOR",
    "AlertBook",
    "EmbeddedBroker",
    "Event",
    "Failure",
    "Identified",
    "Intake",
    "MonitorSettings",
    "Observed",
    "Opening",
    "Outcome",
    "PostOffice",
    "Site",
    "Station",
    "Stream",
    "VehicleMonitor",
    "VehicleStatus",
    "Workers",
    "alert_of",
    "embedded_port",
    "read_site",
    "row_of",
]
