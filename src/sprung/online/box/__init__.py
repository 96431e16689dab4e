"""The box on the vehicle: sources of samples, spool, frames.

`sprung.online.box.onboard` (identification on the vehicle) is imported only where it is needed: a box is much
smaller without it.
"""

from sprung.formats.can import can_database
from sprung.online.box.box import Box, BoxSettings
from sprung.online.box.can import can_bus, from_can
from sprung.online.box.mqtt_source import from_mqtt
from sprung.online.box.resampling import Regular
from sprung.online.box.running import Listener, SourceSettings, open_source
from sprung.online.box.sources import (
    after,
    blocks_of,
    from_files,
    from_folder,
    from_lines,
    from_simulator,
    paced,
)

__all__ = [
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
