"""Streams of a fleet on Spark: frames of vehicles as windows, assessed batch by batch."""

from sprung.fleet.streams.batches import (
    STREAM_SETTINGS,
    StreamBatch,
    StreamSettings,
    messages_in_folder,
    messages_in_kafka,
    stream,
    windows_of_lake,
    windows_of_messages,
)

__all__ = [
    "STREAM_SETTINGS",
    "StreamBatch",
    "StreamSettings",
    "messages_in_folder",
    "messages_in_kafka",
    "stream",
    "windows_of_lake",
    "windows_of_messages",
]
