"""From a vehicle to the monitor: frames, topics, a spool on disk, MQTT.

`sprung.link.summaries` (correlations on the wire) is imported only where needed, as it depends on identification.
"""

from sprung.link.blocks import Block, FrameBlock, frame_block, joined
from sprung.link.credentials import LOCAL_USER, SecretError, common_name, find_secret, keep_secret, valid_until
from sprung.link.frame import (
    CLIPPED,
    MISSING,
    PACKED,
    RAW,
    STUCK,
    TIME_KEPT,
    TIME_SET,
    TIME_UNKNOWN,
    Frame,
    check_frame,
    decode,
    encode,
    quantised,
)
from sprung.link.losses import MAX_LOSSES, Loss, losses_in, span_of
from sprung.link.messages import (
    DOWNWARDS,
    ROOT,
    UPWARDS,
    VERSION,
    Header,
    Key,
    VersionError,
    check_vehicle,
    checked_map,
    message,
    parse_topic,
    topic,
)
from sprung.link.mqtt import Address, Link, LinkError
from sprung.link.sending import Every, Sending
from sprung.link.spool import Spool, SpoolError

__all__ = [
    "CLIPPED",
    "DOWNWARDS",
    "LOCAL_USER",
    "MAX_LOSSES",
    "MISSING",
    "PACKED",
    "RAW",
    "ROOT",
    "STUCK",
    "TIME_KEPT",
    "TIME_SET",
    "TIME_UNKNOWN",
    "UPWARDS",
    "VERSION",
    "Address",
    "Block",
    "Every",
    "Frame",
    "FrameBlock",
    "Header",
    "Key",
    "Link",
    "LinkError",
    "Loss",
    "SecretError",
    "Sending",
    "Spool",
    "SpoolError",
    "VersionError",
    "check_frame",
    "check_vehicle",
    "checked_map",
    "common_name",
    "decode",
    "encode",
    "find_secret",
    "frame_block",
    "joined",
    "keep_secret",
    "losses_in",
    "message",
    "parse_topic",
    "quantised",
    "span_of",
    "topic",
    "valid_until",
]
