"""The fault of a sensor."""

from dataclasses import dataclass

#: Kinds of faults that the checks find, each a word of `SensorFault.kind`.
KINDS = (
    "dead",
    "stuck",
    "clipped",
    "spiking",
    "noisy",
    "drifting",
    "inverted",
    "swapped",
    "wrong_gain",
    "time_shifted",
    "hum",
)
#: Kind of a sensor whose channel the samples lack, which only the monitor takes for a fault.
MISSING = "missing"


@dataclass(frozen=True, slots=True)
class SensorFault:
    """A fault of a channel.

    Parameters
    ----------
    channel
        Name of the channel.
    kind
        One of `KINDS`, or `MISSING`.
    detail
        Size of the fault, in words.
    """

    channel: str
    kind: str
    detail: str
