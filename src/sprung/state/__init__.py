"""How a vehicle is, as one value: pages, reports, messages, commands, interface and exports render it."""

from sprung.state.alerts import AlertState, time_of
from sprung.state.reference import PartState, Reference, interval_95
from sprung.state.vehicles import (
    LAST_WINDOWS,
    TIME_ROUNDING,
    WINDOWS_SINCE_ONSET,
    VehicleState,
    VehicleStatus,
    progress_in_words,
    state_of,
)
from sprung.state.verdicts import Verdict

__all__ = [
    "LAST_WINDOWS",
    "TIME_ROUNDING",
    "WINDOWS_SINCE_ONSET",
    "AlertState",
    "PartState",
    "Reference",
    "VehicleState",
    "VehicleStatus",
    "Verdict",
    "interval_95",
    "progress_in_words",
    "state_of",
    "time_of",
]
