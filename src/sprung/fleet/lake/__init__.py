"""Lakes: windows of samples of many vehicles as one table in the Delta format, for engines that analyse fleets."""

from sprung.fleet.lake.lake import Lake, LakeFacts, Outbox, VehicleFacts
from sprung.fleet.lake.table import AddedFile, Table, absolute_location, file_name
from sprung.fleet.lake.windows import SCHEMA, LakeWindow, recording_of, window_of_recording

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
