"""The online monitor: vehicles in, modes, diagnoses and alerts out, for months."""

from sprung.online.monitor.alert_book import AlertBook
from sprung.online.monitor.broker import EmbeddedBroker
from sprung.online.monitor.engine import Event, Identified, MonitorSettings, Observed, VehicleMonitor
from sprung.online.monitor.figures import FIGURES
from sprung.online.monitor.intake import MONITOR, Intake
from sprung.online.monitor.jobs import Failure, Opening, Outcome
from sprung.online.monitor.postman import PostOffice
from sprung.online.monitor.site import Site, embedded_port, read_site
from sprung.online.monitor.station import Station
from sprung.online.monitor.streams import Stream
from sprung.online.monitor.workers import Workers
from sprung.state import VehicleStatus

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
    "embedded_port",
    "read_site",
]
