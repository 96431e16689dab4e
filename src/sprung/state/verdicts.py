"""The verdicts on a vehicle and on its parts."""

from enum import StrEnum


class Verdict(StrEnum):
    """What matters most about a vehicle; of a part one of the first three."""

    CHANGE = "change"
    NO_CHANGE_DETECTED = "no_change_detected"
    INCONCLUSIVE = "inconclusive"
    FAULT = "fault"  # an active alert that is not of the suspension: a sensor, lost frames
    LEARNING = "learning"
    WAITING = "waiting"  # nothing analysed yet
    STALE = "stale"  # data too old for a statement about the present
