"""How a vehicle is, as one value: pages, reports, messages, commands, interface and exports render it."""

from sprung.state.alerts import (
    SENSOR_WEIGHT,
    STEP_SIZE,
    STEPS,
    WATCHING,
    AlertState,
    health_index,
    is_of_suspension,
    severity_step,
    time_of,
)
from sprung.state.vehicles import (
    LAST_WINDOWS,
    TIME_ROUNDING,
    WINDOWS_SINCE_ONSET,
    PartState,
    Reference,
    VehicleState,
    VehicleStatus,
    Verdict,
    interval_95,
    progress_in_words,
    state_of,
)

__all__ = [
    "LAST_WINDOWS",
    "SENSOR_WEIGHT",
    "STEPS",
    "STEP_SIZE",
    "TIME_ROUNDING",
    "WATCHING",
    "WINDOWS_SINCE_ONSET",
    "AlertState",
    "PartState",
    "Reference",
    "VehicleState",
    "VehicleStatus",
    "Verdict",
    "health_index",
    "interval_95",
    "is_of_suspension",
    "progress_in_words",
    "severity_step",
    "state_of",
    "time_of",
]
