"""Lakes: windows of samples of many vehicles as one table in the Delta format, for engines that analyse fleets."""

from sprung.lake.lake import Lake, LakeFacts, VehicleFacts
from sprung.lake.outbox import Outbox
from sprung.lake.table import AddedFile, Table, absolute_location, file_name
from sprung.lake.windows import SCHEMA, LakeWindow, recording_of, window_of_recording

__all__ = [
    "SCHEMA",
    "AddedFile",
    "Lake",
    "LakeFacts",
    "LakeWindow",
    "Outbox",
    "Table",
    "VehicleFacts",
    "absolute_location",
    "file_name",
    "recording_of",
    "window_of_recording",
]
