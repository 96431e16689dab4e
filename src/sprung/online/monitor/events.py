"""Settings of the monitoring of one vehicle, and the events that its samples lead to."""

from dataclasses import dataclass
from typing import Any

from sprung._checks import check_number
from sprung.diagnosis import LEARNING_WINDOWS, Baseline, Diagnosis, Observation
from sprung.recording import Recording


@dataclass(frozen=True, slots=True)
class MonitorSettings:
    """Settings of the monitoring of one vehicle.

    Parameters
    ----------
    window
        Length of a window [s], 60 to 7200.
    identify_every
        Time between identifications of modes [s]; 0: none.
    method
        Identification method: "cov", "acs" or "coss".
    learning_windows
        Number of conclusive windows that a baseline is learnt from, at least 2.
    false_alarms, hours_per_day
        Rate of false alarms per vehicle and day of driving, and hours of driving in a day.
    max_windows
        Largest number of most recent windows in a diagnosis, at least `learning_windows`.
    calibrate
        Whether the vehicle file is calibrated on the first windows of learning; None: if it is imperfect.

    Raises
    ------
    ParameterError
        If a setting is out of range.
    """

    window: float = 600.0
    identify_every: float = 120.0
    method: str = "cov"
    learning_windows: int = LEARNING_WINDOWS
    false_alarms: float = 1e-3
    hours_per_day: float = 8.0
    max_windows: int = 96
    calibrate: bool | None = None

    def __post_init__(self) -> None:
        check_number("window", self.window, at_least=60, at_most=7200)
        check_number("identify_every", self.identify_every, at_least=0)
        check_number("learning_windows", self.learning_windows, at_least=2)
        check_number("false_alarms", self.false_alarms, above=0)
        check_number("hours_per_day", self.hours_per_day, above=0, at_most=24)
        check_number("max_windows", self.max_windows, at_least=self.learning_windows)


@dataclass(frozen=True, eq=False, slots=True)
class Identified:
    """Modes of the window so far.

    Parameters
    ----------
    number
        Number of the identification since the first block, from 0.
    start
        Start of the window, UTC ns; None if unknown.
    modes
        One object for each mode, as in `sprung.identification/1`; empty if none was identified.
    reason
        Reason why none was identified; empty otherwise.
    """

    number: int
    start: int | None
    modes: tuple[dict[str, Any], ...]
    reason: str = ""


@dataclass(frozen=True, eq=False, slots=True)
class Observed:
    """A complete window.

    Parameters
    ----------
    number
        Number of the window since the first block, from 0.
    recording
        Samples of the window.
    observation
        Estimates and conditions of the window.
    diagnosis
        Diagnosis of the windows since the baseline; while it is being learnt, of these windows against the vehicle's
        type, or None if that is unknown.
    baseline
        Baseline learnt with this window as its last one; None otherwise.
    """

    number: int
    recording: Recording
    observation: Observation
    diagnosis: Diagnosis | None
    baseline: Baseline | None


@dataclass(frozen=True, eq=False, slots=True)
class Restored:
    """A return to an earlier baseline.

    Parameters
    ----------
    baseline
        Baseline in use from the next samples on, as a new version.
    """

    baseline: Baseline


#: Events that samples lead to.
Event = Identified | Observed
