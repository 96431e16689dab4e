"""From windows and a baseline to findings in plain words: health assessment and advisory generation of ISO 13374."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from sprung.diagnosis.baseline import Baseline, nominal_baseline
from sprung.diagnosis.changes import Candidate, Detection, detect, own_covariance
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.sensors import SensorFault

#: Severities by the size of a change that is sure (the end of its interval nearest to 0), with the numbers of
#: OPC 10000-110 (1 to 1000) and what to do.
SEVERITIES = (
    (0.4, "critical", 900, "inspect before the next drive"),
    (0.2, "high", 700, "inspect before the next 500 km"),
    (0.1, "medium", 500, "inspect at the next service"),
    (0.0, "low", 300, "keep watching"),
)
#: A runner-up that is less likely by this in ln is not worth a word.
_CLOSE = 3.0
#: Share of what something else explains that a part must explain to be named in its place.
_MOSTLY = 0.8
#: Misfit up to which values can be compared with the vehicle file itself.
_TRUSTED = 0.15
#: Relative change at which a part is due, for forecasts.
_LIMIT = 0.3
#: Percentage points below which the ends of an interval are told with a decimal.
_NARROW = 2.0
#: Times beyond this count from 1970 [s].
_DATED = 1e8


@dataclass(frozen=True, slots=True)
class Trend:
    """How a change goes on after its onset.

    Parameters
    ----------
    per_hour, interval
        Relative change per hour of the windows' clock, and its 95 % interval.
    hours_to_limit
        After the last window until the change is 30 %: earliest and latest, 0 where it is; None where there is no trend
        towards it.
    """

    per_hour: float
    interval: tuple[float, float]
    hours_to_limit: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class Finding:
    """One change of a suspension.

    Parameters
    ----------
    corner
        "front_left", "front" for both sides of an axle, "all" for all corners; "vehicle" for something else.
    component
        "spring", "damper" or "tyre"; "unmodelled".
    change, interval
        Relative, -0.2 is a loss of a fifth; 95 %. None for something else, which has no one size.
    score
        Size over its standard deviation; None for something else.
    severity, severity_number, advice
        See `SEVERITIES`.
    since, since_interval
        Begin of the first changed window [s], and from when to when that may be, 95 % of its posterior.
    runner_up
        What else it may be, where that is not far less likely; empty otherwise.
    trend
        How it goes on.
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
        return f"{text}, since {_when(self.since)}; {self.advice}"

    @property
    def _what(self) -> str:
        """The parts in words."""
        if self.corner == "all":
            return f"all {self.component}s"
        if "_" not in self.corner:
            return f"both {self.corner} {self.component}s"
        return f"{self.corner.replace('_', '-')} {self.component}"


@dataclass(frozen=True, eq=False, slots=True)
class Diagnosis:
    """What a vehicle's windows say.

    Parameters
    ----------
    findings
        Of the suspension; empty where it is healthy.
    sensor_faults
        By channel.
    detection
        The test behind the findings; None where no window can tell.
    observations
        All windows.
    notes
        What a reader should know, one sentence each.
    baseline
        What the windows were compared with; None where no window can tell.
    false_alarms
        Rate of false alarms per vehicle and day.
    """

    findings: tuple[Finding, ...]
    sensor_faults: tuple[SensorFault, ...]
    detection: Detection | None
    observations: tuple[Observation, ...]
    notes: tuple[str, ...]
    baseline: Baseline | None = None
    false_alarms: float = 1e-3

    @property
    def is_healthy(self) -> bool:
        """Whether a window could tell, and nothing was found in suspension and sensors."""
        return self.detection is not None and not self.findings and not self.sensor_faults

    def to_dict(self) -> dict[str, Any]:
        """Return the JSON object `sprung.diagnosis/1`."""
        return {
            "schema": "sprung.diagnosis/1",
            "vehicle": None if self.baseline is None else self.baseline.vehicle,
            "baseline": None if self.baseline is None else self.baseline.version,
            "false_alarms": self.false_alarms,
            "healthy": self.is_healthy,
            "findings": [_plain(finding) for finding in self.findings],
            "sensor_faults": [
                {"channel": fault.channel, "kind": fault.kind, "detail": fault.detail} for fault in self.sensor_faults
            ],
            "windows": [one.to_dict() for one in self.observations],
            "detection": None
            if self.detection is None
            else {
                "times": self.detection.times.tolist(),
                "evidence": self.detection.evidence.tolist(),
                "e_value": self.detection.e_value,
                "threshold": self.detection.threshold,
                "first_alert": self.detection.first_alert,
                "hypotheses": [
                    {
                        "name": one.hypothesis.name,
                        "kind": one.hypothesis.scope,
                        "log_evidence": one.log_evidence,
                        "explained": one.explained,
                        "change": one.change,
                        "interval": _listed(one.interval),
                        "score": one.score,
                        "onset": one.onset,
                        "onset_interval": list(one.onset_interval),
                    }
                    for one in self.detection.candidates
                ],
            },
            "notes": list(self.notes),
        }


def diagnose(
    observations: Iterable[Observation],
    baseline: Baseline | None = None,
    *,
    vehicle: str = "",
    false_alarms: float = 1e-3,
    windows_per_day: float = 48.0,
    known: Sequence[float] = (),
) -> Diagnosis:
    """Diagnose a vehicle.

    Parameters
    ----------
    observations
        Windows in the order of time.
    baseline
        What is normal; None: the vehicle file and left against right, with wide limits.
    vehicle
        Its name.
    false_alarms
        Rate of false alarms per vehicle and day.
    windows_per_day
        Windows in a day of driving.
    known
        Evidence after the first windows that could tell, from an earlier diagnosis: not computed again.
    """
    every = tuple(observations)
    telling = [one for one in every if one.is_conclusive]
    notes = list(_refusals(every))
    faults: dict[tuple[str, str], SensorFault] = {}
    for one in every:
        for fault in one.sensor_faults:
            faults.setdefault((fault.channel, fault.kind), fault)
    detection = normal = None
    if telling:
        normal = baseline or nominal_baseline(telling[0].components, vehicle=vehicle)
        if baseline is None:
            notes.append("no baseline: compared with the vehicle file and left with right, with wide limits")
        # A window in which sensors failed is no witness: what they did to it is unknown.
        sound = [one for one in telling if not one.sensor_faults]
        notes += _unwatched(telling, sound)
        if baseline is None:
            trusted = [one for one in sound if one.conditions.get("model_error", 0.0) <= _TRUSTED]
            if len(trusted) < len(sound):
                notes.append(
                    f"{len(sound) - len(trusted)} of {len(sound)} windows are explained too badly to be compared with "
                    "the vehicle file: learn a baseline"
                )
            sound = trusted
        notes += [*normal.notes, *_unmet(normal, sound)]
        detection = detect(normal, sound, false_alarms=false_alarms, windows_per_day=windows_per_day, known=known)
    findings: tuple[Finding, ...] = ()
    if detection is not None and normal is not None:
        if detection.is_alert:
            findings = (_finding(detection, sound, normal),)
        notes += _left(detection)
    return Diagnosis(findings, tuple(faults.values()), detection, every, tuple(notes), normal, false_alarms)


def _unwatched(telling: Sequence[Observation], sound: Sequence[Observation]) -> list[str]:
    """Say that windows in which sensors fail say nothing of the suspension."""
    if len(sound) == len(telling):
        return []
    causes = {f"{fault.channel} is {fault.kind.replace('_', ' ')}" for one in telling for fault in one.sensor_faults}
    return [
        f"{len(telling) - len(sound)} of {len(telling)} windows say nothing of the suspension, as "
        f"{', '.join(sorted(causes))}: it is not watched until that is mended"
    ]


def _left(detection: Detection) -> list[str]:
    """Say what the named part does not explain, and that an alarm is over."""
    if not detection.is_alert:
        if detection.first_alert is None:
            return []
        return [f"an alarm stood from the window at {_when(detection.first_alert)} on, and is over"]
    first, named = detection.candidates[0], _best_two(detection)[0]
    if first.log_evidence - named.log_evidence < detection.threshold:
        return []
    return [
        f"the {_words(named)} explains {100 * named.explained / first.explained:.0f} % of what has changed: the rest "
        "may be another part, or what the vehicle file lacks"
    ]


def _finding(detection: Detection, observations: Sequence[Observation], baseline: Baseline) -> Finding:
    """Return the best hypothesis as a finding."""
    best, second = _best_two(detection)
    if best.interval is None:
        level = SEVERITIES[2]
    else:
        sure = min(map(abs, best.interval)) if best.interval[0] * best.interval[1] > 0 else 0.0
        level = next(level for level in SEVERITIES if sure >= level[0])
    close = best.log_evidence - second.log_evidence < _CLOSE and second.hypothesis.scope != "else"
    return Finding(
        corner=best.hypothesis.corner,
        component=best.hypothesis.component,
        change=best.change,
        interval=best.interval,
        score=best.score,
        severity=level[1],
        severity_number=level[2],
        advice=level[3],
        since=best.onset,
        since_interval=best.onset_interval,
        runner_up=_words(second) if close else "",
        trend=trend(best, observations, baseline, since=best.onset),
    )


def _best_two(detection: Detection) -> tuple[Candidate, Candidate]:
    """Return the hypothesis to name and the next best.

    A part that explains nearly all is named, though something else explains a little more: with much evidence, every
    error of the vehicle file does.
    """
    first, *others = detection.candidates
    named = next(one for one in detection.candidates if one.hypothesis.scope != "else")
    is_enough = named.explained >= _MOSTLY * first.explained and named.log_evidence >= detection.threshold
    if first.hypothesis.scope != "else" or not is_enough:
        return first, others[0]
    return named, next(one for one in others if one.hypothesis.scope != "else" and one is not named)


def trend(
    candidate: Candidate, observations: Sequence[Observation], baseline: Baseline, *, since: float
) -> Trend | None:
    """Return how a change goes on after its onset; None with fewer than four windows, or without one size.

    Notes
    -----
    A line through the sizes of single windows by weighted least squares; no trend where 0 lies within its interval. The
    limit is met where the ends of the line's interval meet it.
    """
    names = baseline.components
    d = np.array([float(name in candidate.hypothesis.parts(names)) for name in names])
    later = [one for one in observations if one.time >= since and one.components == names]
    if len(later) < 4 or not d.any():
        return None
    hours = np.array([one.time for one in later]) / 3600
    informations = [np.linalg.inv(own_covariance(baseline, one)) for one in later]
    weights = np.array([d @ information @ d for information in informations])
    sizes = [d @ information @ baseline.residual(one) for information, one in zip(informations, later, strict=True)]
    sizes = np.array(sizes) / weights
    away = hours - np.average(hours, weights=weights)
    mean = float(np.average(sizes, weights=weights))
    slope = float(np.sum(weights * away * sizes) / np.sum(weights * away**2))
    scatter = max(1.0, float(np.sum(weights * (sizes - mean - slope * away) ** 2)) / (len(later) - 2))
    deviation = float(np.sqrt(scatter / np.sum(weights * away**2)))
    interval = (slope - 1.96 * deviation, slope + 1.96 * deviation)
    limit: tuple[float, float] | None = None
    now = mean + slope * away[-1]
    if interval[0] * interval[1] > 0 and now * slope > 0:
        left = abs(np.log1p(np.copysign(_LIMIT, slope))) - abs(now)
        doubt = 1.96 * float(np.sqrt(scatter / np.sum(weights) + (deviation * away[-1]) ** 2))
        fast, slow = max(map(abs, interval)), min(map(abs, interval))
        limit = (max(0.0, left - doubt) / fast, max(0.0, left + doubt) / slow)
    low, high = map(float, np.expm1(interval))
    return Trend(float(np.expm1(slope)), (low, high), limit)


def _when(time: float) -> str:
    """Return a time in words: minutes since the first window, or a date where it counts from 1970."""
    if time < _DATED:
        return f"{time / 60:.0f} min"
    return f"{datetime.fromtimestamp(time, tz=UTC):%Y-%m-%d %H:%M} UTC"


def _words(candidate: Candidate) -> str:
    """Return a hypothesis in words."""
    hypothesis = candidate.hypothesis
    return f"{hypothesis.corner.replace('_', '-')} {hypothesis.component} by {100 * (candidate.change or 0.0):+.0f} %"


def _refusals(observations: Sequence[Observation]) -> list[str]:
    """Say how many windows cannot tell, and why."""
    reasons = [one.reason for one in observations if not one.is_conclusive]
    return [
        f"{reasons.count(reason)} of {len(observations)} windows cannot tell: {reason}"
        for reason in dict.fromkeys(reasons)
    ]


def _unmet(baseline: Baseline, observations: Sequence[Observation]) -> list[str]:
    """Say which conditions the baseline never met."""
    found = []
    for name, (low, high) in baseline.ranges.items():
        scale = np.log if name == "level" else float
        room = 0.5 * (scale(high) - scale(low))
        outside = [
            one
            for one in observations
            if name in one.conditions and not scale(low) - room <= scale(one.conditions[name]) <= scale(high) + room
        ]
        if outside:
            found.append(
                f"{len(outside)} of {len(observations)} windows have a {name} far from what the baseline met "
                f"({low:.3g} to {high:.3g}): learn it again with such drives"
            )
    return found


def _listed(interval: tuple[float, float] | None) -> list[float] | None:
    """Return an interval as JSON has it."""
    return None if interval is None else list(interval)


def _plain(finding: Finding) -> dict[str, Any]:
    """Return a finding as plain values."""
    return {
        "corner": finding.corner,
        "component": finding.component,
        "change": finding.change,
        "interval": _listed(finding.interval),
        "score": finding.score,
        "severity": finding.severity,
        "severity_number": finding.severity_number,
        "advice": finding.advice,
        "since": finding.since,
        "since_interval": list(finding.since_interval),
        "runner_up": finding.runner_up,
        "trend": None
        if finding.trend is None
        else {
            "per_hour": finding.trend.per_hour,
            "interval": list(finding.trend.interval),
            "hours_to_limit": _listed(finding.trend.hours_to_limit),
        },
        "sentence": finding.sentence,
    }
