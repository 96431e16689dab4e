"""The box on the vehicle: sources of samples, spool, frames.

`sprung.box.onboard` (identification on the vehicle) is imported only where it is needed: a box is much
smaller without it.
"""

from sprung.box.box import Box, BoxSettings
from sprung.box.can import can_bus, from_can
from sprung.box.folder import from_folder
from sprung.box.mqtt_source import from_mqtt
from sprung.box.opening import SOURCES, Listener, SourceSettings, open_source
from sprung.box.resampling import Regular
from sprung.box.sources import after, blocks_of, from_files, from_simulator, paced
from sprung.box.standard_input import from_lines
from sprung.formats.can import can_database

__all__ = [
    "SOURCES",
    "Box",
    "BoxSettings",
    "Listener",
    "Regular",
    "SourceSettings",
    "after",
    "blocks_of",
    "can_bus",
    "can_database",
    "from_can",
    "from_files",
    "from_folder",
    "from_lines",
    "from_mqtt",
    "from_simulator",
    "open_source",
    "paced",
]
