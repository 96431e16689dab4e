"""Findings in plain words: advisory generation of ISO 13374."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Literal

from sprung._display import Drawable, Savable, Tabular, counted, in_short, listed
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.changes import Detection
from sprung.diagnosis.observation import Observation, Observations
from sprung.diagnosis.residuals import ResidualTest
from sprung.diagnosis.sensors import SensorFault
from sprung.diagnosis.trends import Trend
from sprung.vehicles import Component

#: Verdicts of a diagnosis.
Verdict = Literal["change", "no_change_detected", "inconclusive"]

#: Severities by the certain size of a change (the end of its interval nearest to 0), with the numbers of
#: OPC 10000-110 (1 to 1000) and what to do.
SEVERITIES = (
    (0.4, "critical", 900, "inspect before the next drive"),
    (0.2, "high", 700, "inspect before the next 500 km"),
    (0.1, "medium", 500, "inspect at the next service"),
    (0.0, "low", 300, "continue monitoring"),
)
#: Percentage points below which the ends of an interval are stated with a decimal.
_NARROW = 2.0
#: Times above this are counted from 1970 [s].
_DATED = 1e8


@dataclass(frozen=True, slots=True)
class Finding(Tabular):
    """One change of a suspension.

    Parameters
    ----------
    corner
        "front_left", "front" for both sides of an axle, "all" for all corners; "vehicle" for an unmodelled change.
    component
        "spring", "damper" or "tyre"; "unmodelled".
    change, interval
        Relative change after the last window, -0.2 for a loss of a fifth, and its 95 % interval; None for an unmodelled
        change, which has no single size.
    score
        Size over its standard deviation; None for an unmodelled change.
    severity, severity_number, advice
        Severity in a word and as a number (1 to 1000), and what to do, see `SEVERITIES`.
    since, since_interval
        Start of the first changed window [s], and earliest and latest one, 95 % of its posterior.
    runner_up
        Second hypothesis in words, unless it is far less likely; empty otherwise.
    trend
        Course of the change after its onset; None with too few windows.
    """

    corner: str
    component: str
    change: float | None
    interval: tuple[float, float] | None
    score: float | None
    severity: str
    severity_number: int
    advice: str
    since: float
    since_interval: tuple[float, float]
    runner_up: str
    trend: Trend | None

    def __repr__(self) -> str:
        """Return the finding in plain words."""
        return in_short(f"Finding ({self.severity}): {self.sentence}")

    @property
    def hypothesis(self) -> str:
        """Name of its `Hypothesis`."""
        return self.component if self.component == "unmodelled" else f"{self.corner}.{self.component}"

    @property
    def sentence(self) -> str:
        """The finding in plain words."""
        if self.change is None or self.interval is None:
            return f"the suspension differs from the baseline in a way that no single part explains: {self.advice}"
        softer, stiffer = ("weaker", "stronger") if self.component == "damper" else ("softer", "stiffer")
        low, high = sorted((100 * end for end in self.interval), key=abs)
        digits = 0 if abs(high - low) >= _NARROW else 1
        if low * high > 0:
            span = f"{abs(low):.{digits}f} to {abs(high):.{digits}f} %"
        else:
            span = f"{min(low, high):+.{digits}f} to {max(low, high):+.{digits}f} %"
        word = softer if self.change < 0 else stiffer
        text = f"{self._what} {100 * abs(self.change):.{digits}f} % ({span}) {word}"
        if self.runner_up:
            text += f" (or {self.runner_up})"
        return f"{text}, since {time_in_words(self.since)}; {self.advice}"

    @property
    def _what(self) -> str:
        """The parts in words."""
        if self.corner == "all":
            return f"all {self.component}s"
        if "_" not in self.corner:
            return f"both {self.corner} {self.component}s"
        return f"{self.corner.replace('_', '-')} {self.component}"


class Findings(tuple[Finding, ...], Tabular):
    """Findings of a diagnosis."""

    def __repr__(self) -> str:
        """Return the findings in plain words."""
        return (
            in_short(*(repr(finding) for finding in self[:2]), listed(repr(one) for one in self[2:])) or "no findings"
        )


@dataclass(frozen=True, eq=False, slots=True)
class Diagnosis(Tabular, Savable, Drawable):
    """Diagnosis of a vehicle from its windows.

    Parameters
    ----------
    findings
        Changes of the suspension; empty where none was detected.
    sensor_faults
        Faults of sensors, each kind of each channel once.
    detection
        Change test behind the findings; None if no window could be compared with the baseline.
    observations
        All windows.
    notes
        Remarks on the basis of the diagnosis, one sentence each.
    baseline
        Baseline that the windows were compared with; None if no window was conclusive.
    false_alarms
        Rate of false alarms per vehicle and day.
    residual_tests
        Subspace residual test of each window that has one, by the time of the window [s]: a second opinion without the
        vehicle's model.
    doubts
        Reasons why a change may have gone undetected, one sentence each: with any of them, a diagnosis without findings
        is inconclusive.
    """

    findings: tuple[Finding, ...]
    sensor_faults: tuple[SensorFault, ...]
    detection: Detection | None
    observations: tuple[Observation, ...]
    notes: tuple[str, ...]
    baseline: Baseline | None = None
    false_alarms: float = 1e-3
    residual_tests: Mapping[float, ResidualTest] = field(default_factory=dict)
    doubts: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        object.__setattr__(self, "findings", Findings(self.findings))
        object.__setattr__(self, "observations", Observations(self.observations))

    def __repr__(self) -> str:
        """Return the verdict with the findings, the doubts or what would have been found."""
        windows = f"{counted(len(self.observations), 'window')}"
        faults = listed(f"{fault.channel} {fault.kind.replace('_', ' ')}" for fault in self.sensor_faults)
        reasons = [*(finding.sentence for finding in self.findings), *self.doubts, *self.notes]
        head = f"Diagnosis of {windows}: {self.verdict.replace('_', ' ')}"
        return in_short(f"{head}; sensor faults: {faults}" if faults else head, *reasons[:2])

    @property
    def verdict(self) -> Verdict:
        """Whether the suspension has changed.

        "change" with findings; "inconclusive" without them if no window could be compared, or a change may have gone
        undetected (see `doubts`); "no_change_detected" otherwise.
        """
        if self.findings:
            return "change"
        return "inconclusive" if self.detection is None or self.doubts else "no_change_detected"

    @property
    def is_healthy(self) -> bool | None:
        """Whether no change was detected and no sensor fails; None if the verdict is inconclusive."""
        if self.verdict == "inconclusive":
            return None
        return self.verdict == "no_change_detected" and not self.sensor_faults

    @property
    def detectable(self) -> dict[Component, float]:
        """Smallest relative loss of each component that would have been found with 95 % power; empty if unknown."""
        return {} if self.detection is None else self.detection.detectable


def detectable_in_words(detectable: Mapping[Component, float]) -> str:
    """Return a clause about the smallest changes that would have been found; empty if they are unknown.

    Examples
    --------
    >>> from sprung.vehicles import Component
    >>> detectable_in_words({Component("front_left", "spring"): 0.07, Component("rear_left", "damper"): 0.12})
    'a change of 7 to 12 % of any part would have been found'
    """
    if not detectable:
        return ""
    low, high = (100 * limit(detectable.values()) for limit in (min, max))
    span = f"{high:.0f}" if round(low) == round(high) else f"{low:.0f} to {high:.0f}"
    return f"a change of {span} % of any part would have been found"


def time_in_words(time: float) -> str:
    """Return a time [s] in words: minutes since the first window, or a date if it counts from 1970."""
    if time < _DATED:
        return f"{time / 60:.0f} min"
    return f"{datetime.fromtimestamp(time, tz=UTC):%Y-%m-%d %H:%M} UTC"
