"""The online monitor: vehicles in, modes, diagnoses and alerts out, for months."""

from sprung.online.monitor.engine import VehicleMonitor
from sprung.online.monitor.events import Identified, MonitorSettings, Observed
from sprung.online.monitor.intake import MONITOR
from sprung.online.monitor.site import Site, embedded_port, read_site
from sprung.online.monitor.station import FIGURES, Station
from sprung.online.monitor.workers import Workers
from sprung.state import VehicleStatus

__all__ = [
    "FIGURES",
    "MONITOR",
    "Identified",
    "MonitorSettings",
    "Observed",
    "Site",
    "Station",
    "VehicleMonitor",
    "VehicleStatus",
    "Workers",
    "embedded_port",
    "read_site",
]
