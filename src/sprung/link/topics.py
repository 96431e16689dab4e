"""Topics of the link: sprung/v1/{vehicle}/{what}."""

from sprung.errors import FormatError
from sprung.link.messages import VEHICLE

ROOT = "sprung/v1"
#: Kinds of messages from a vehicle, and to it.
UPWARDS = ("raw", "corr", "modes", "event", "health", "meta", "state")
DOWNWARDS = ("ack", "cmd")


def topic(vehicle: str, what: str) -> str:
    """Return the topic of a vehicle's messages.

    Examples
    --------
    >>> topic("bus-17", "raw")
    'sprung/v1/bus-17/raw'
    """
    return f"{ROOT}/{vehicle}/{what}"


def parse_topic(name: str) -> tuple[str, str]:
    """Return vehicle and kind of message of a topic.

    Raises
    ------
    FormatError
        If it is not a topic of this version.

    Examples
    --------
    >>> parse_topic("sprung/v1/bus-17/raw")
    ('bus-17', 'raw')
    """
    parts = name.split("/")
    if len(parts) != 4 or "/".join(parts[:2]) != ROOT or not VEHICLE.fullmatch(parts[2]):
        raise FormatError(f"{name[:120]!r} is not a topic of this version: it must be {ROOT}/VEHICLE/WHAT")
    return parts[2], parts[3]
