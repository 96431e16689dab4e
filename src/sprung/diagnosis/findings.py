"""Findings in plain words: advisory generation of ISO 13374."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from typing import Literal

import numpy as np

from sprung._arrays import Real
from sprung._display import Drawable, Savable, Tabular, counted, in_short, listed
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.changes import Detection
from sprung.diagnosis.observation import Observation, Observations
from sprung.diagnosis.residuals import ResidualTest
from sprung.diagnosis.trends import PhaseShift, Trend
from sprung.likelihood.plate_test import PLATE
from sprung.modal import INTERVAL_95, mac, unit_shapes
from sprung.vehicles import Component, Vehicle, structure
from sprung.vehicles.channel_faults import SensorFault
from sprung.vehicles.labels import MOTIONS
from sprung.vehicles.lateral import LATERAL_PARTS

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
#: Least unsprung mass of a corner with another wheel, over that before: a compact spare wheel takes off a fifth.
LIGHTEST_WHEEL = 0.7
#: Change of one tyre from which another wheel may be the reason: the motion shows its stiffness over that mass.
STIFFER_TYRE = 0.3
#: Change of an anti-roll bar that must be detectable for its loss to be found: all of it reads as 82 % (`log_of_bars`).
LOST_BAR = 0.8
#: Change of a spring, damper or tyre that must be detectable for "no change detected" to be said.
MAX_UNDETECTED = 0.2
#: Kinds of parts that motion may hardly show, and whose hidden change raises no doubt about the others: what is said of
#: a vehicle without changes names them. Vertical motion of a bogie needs no longitudinal spring, and steering little.
MAY_HIDE = ("anti_roll", "longitudinal_spring", "primary_longitudinal_spring")
#: What else at a corner reads as a large change of a part: kind, least change and name, in words for cars, rails and
#: rigs. The motion of the body does not separate them.
LOOK_ALIKES = (
    ("damper", -0.5, "its mount"),
    ("damper", 0.2, "friction beside it"),
    ("tyre", STIFFER_TYRE, f"another wheel, up to {100 * (1 - LIGHTEST_WHEEL):.0f} % lighter"),
    ("spring", 0.15, "a soft one on its bump stop"),
    ("anti_roll", -0.3, "a soft spring of that axle on its bump stop"),
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
        "spring", "damper" or "tyre"; "anti_roll" of "front_axle"; "wheel", one of a rail vehicle that is out of round;
        "unmodelled".
    change, interval
        Relative change after the last window, -0.2 for a loss of a fifth, and its 95 % interval; None for an unmodelled
        change, which has no single size, for a spring that lets its corner down on its bump stop, and for a wheel.
    score
        Size over its standard deviation; None without a size.
    severity, severity_number, advice
        Severity in a word and as a number (1 to 1000), and what to do, see `SEVERITIES`.
    since, since_interval
        Start of the first changed window [s], and earliest and latest one, 95 % of its posterior.
    runner_up
        Second hypothesis in words, unless it is far less likely; empty otherwise.
    trend
        Course of the change after its onset; None with too few windows.
    phase_shift
        What a suspension tester would measure at a weaker damper; None where that is far above its limit or unknown.
    run_out
        Run-out of a wheel, ends of its 95 % interval, and the largest in the baseline [m, RMS]; None of other parts.
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
    phase_shift: PhaseShift | None = None
    run_out: tuple[float, float, float, float] | None = None

    def __repr__(self) -> str:
        """Return the finding in plain words."""
        return in_short(f"Finding ({self.severity}): {self.sentence}")

    @property
    def hypothesis(self) -> str:
        """Name of its `Hypothesis`."""
        return self.component if self.component == "unmodelled" else f"{self.corner}.{self.component}"

    @property
    def is_on_bump_stop(self) -> bool:
        """Whether a spring lets its corner down on its bump stop, which a test of its own has found."""
        return self.component == "spring" and self.change is None

    @property
    def sentence(self) -> str:
        """The finding in plain words."""
        if self.is_on_bump_stop:
            corner = self.corner.replace("_", "-")
            return (
                f"{corner} corner meets its bump stop more than before: its spring has sagged or is broken (or only "
                f"that corner is overloaded), since {format_time(self.since)}; {self.advice}"
            )
        if self.run_out is not None:
            size, least, most, before = (f"{1e3 * value:.2f}" for value in self.run_out)
            known = f"up to {before} in the baseline" if self.run_out[-1] else "none seen in the baseline"
            others = f" (or {self.runner_up})" if self.runner_up else ""
            return (
                f"{self._what} out of round{others}: run-out {size} mm RMS ({least} to {most}; {known}), since "
                f"{format_time(self.since)}; {self.advice}"
            )
        if self.change is None or self.interval is None:
            return f"the suspension differs from the baseline in a way that no single part explains: {self.advice}"
        softer, stiffer = ("weaker", "stronger") if self.component.endswith("damper") else ("softer", "stiffer")
        if self.component == "conicity":
            softer, stiffer = "lower", "higher"
        low, high = sorted((100 * end for end in self.interval), key=abs)
        digits = 0 if abs(high - low) >= _NARROW else 1
        if low * high > 0:
            span = f"{abs(low):.{digits}f} to {abs(high):.{digits}f} %"
        else:
            span = f"{min(low, high):+.{digits}f} to {max(low, high):+.{digits}f} %"
        word = softer if self.change < 0 else stiffer
        text = f"{self._what} {100 * abs(self.change):.{digits}f} % ({span}) {word}"
        alike = (
            name
            for kind, least, name in LOOK_ALIKES
            if kind == self.component and self.change / least >= 1 and "_" in self.corner
        )
        if others := " or ".join(filter(None, (*alike, self.runner_up))):
            text += f" (or {others})"
        if self.phase_shift is not None:
            phase, (low, high) = self.phase_shift.degrees, self.phase_shift.interval
            span = f"{max(low, 0.0):.0f} to {high:.0f}; limit {PLATE.phase_limit:.0f}"
            text += f", phase shift at inspection {phase:.0f} degrees ({span})"
        return f"{text}, since {format_time(self.since)}; {self.advice}"

    @property
    def _what(self) -> str:
        """The parts in words."""
        part, corner = self.component.replace("_", " "), self.corner.replace("_", "-")
        if self.component == "anti_roll":
            return f"{self.corner.removesuffix('_axle')} anti-roll bar or a link of it"
        if self.component == "conicity":
            return "equivalent conicity of the wheelsets"
        if self.corner == "all" or self.component in LATERAL_PARTS:
            return f"{self.corner} {part}s"
        return f"{corner} {part}" if Component(self.corner, self.component).side else f"both {corner} {part}s"


def out_of_round(
    windows: Sequence[Observation], baseline: Baseline, *, grown: float = 1.5, certain: float = 3.0
) -> tuple[Finding, ...]:
    """Return a finding about the wheel with the largest new run-out; its runner-up names wheels that may be it instead.

    Parameters
    ----------
    windows
        Windows compared, in the order of time.
    baseline
        Normal state before the change.
    grown, certain
        In most windows since the first such one, the run-out less `certain` standard deviations is above `grown` times
        the largest of the baseline.
    """
    since: dict[str, tuple[float, list[float]]] = {}
    for wheel in dict.fromkeys(wheel for window in windows for wheel in window.run_outs):
        each = [(window.time, *window.run_outs.get(wheel, (0.0, 0.0))) for window in windows]
        limit = grown * baseline.run_outs.get(wheel, 0.0)
        uneven = [(time, value, std) for time, value, std in each if value - certain * std > limit]
        if uneven and 2 * len(uneven) > sum(time >= uneven[0][0] for time, *_ in each):
            since[wheel] = uneven[0][0], np.median([own for _, *own in uneven], axis=0).tolist()
    if not since or baseline.n_windows == 0:
        return ()
    worst = max(since, key=lambda wheel: since[wheel][1][0])
    onset, (value, std) = since[worst]
    alike = [name for name, (_, (size, _)) in since.items() if name != worst and size > value - certain * std]
    words = " or ".join(f"{wheel.replace('_', '-')} wheel" for wheel in alike)
    size = value, max(value - INTERVAL_95 * std, 0.0), value + INTERVAL_95 * std, baseline.run_outs.get(worst, 0.0)
    last = max((window.time for window in windows if window.time < onset), default=onset)
    return (
        Finding(worst, "wheel", None, None, None, *SEVERITIES[2][1:], onset, (last, onset), words, None, run_out=size),
    )


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
        Change test behind the findings, in which the hypothesis that they name has their sizes, those after the last
        window; None if no window could be compared with the baseline.
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


def max_undetected(part: Component) -> float:
    """Return the change of a part that must be detectable for "no change detected" to be said of it."""
    return LOST_BAR if part.kind == "anti_roll" else MAX_UNDETECTED


def detectable_in_words(detectable: Mapping[Component, float]) -> str:
    """Return a clause about the smallest changes that would have been found; empty if they are unknown.

    Examples
    --------
    >>> from sprung.vehicles import Component
    >>> detectable_in_words({Component("front_left", "spring"): 0.07, Component("rear_left", "damper"): 0.12})
    'a change of 7 to 12 % of any part would have been found'
    >>> detectable_in_words({Component("front_left", "spring"): 0.07, Component("rear_axle", "anti_roll"): 0.9})
    'a change of 7 % of any other part would have been found, the loss of the rear-axle anti-roll bar would not'
    >>> detectable_in_words({Component("front", "spring"): 0.07, Component("front", "longitudinal_spring"): 0.5})
    'a change of 7 % of any other part would have been found, one of 20 % of a longitudinal spring would not'
    """
    known = {part: least for part, least in detectable.items() if part.kind != "conicity"}
    hidden = {part for part, least in known.items() if part.kind in MAY_HIDE and least > max_undetected(part)}
    parts = [least for part, least in known.items() if part not in hidden]
    if not parts:
        return ""
    low, high = (100 * limit(parts) for limit in (min, max))
    span = f"{high:.0f}" if round(low) == round(high) else f"{low:.0f} to {high:.0f}"
    if not hidden:
        return f"a change of {span} % of any part would have been found"
    bars = " or ".join(part.corner.replace("_", "-") for part in known if part in hidden and part.kind == "anti_roll")
    missed = [f"the loss of the {bars} anti-roll bar"] if bars else []
    if any(part.kind != "anti_roll" for part in hidden):
        missed.append(f"one of {100 * MAX_UNDETECTED:.0f} % of a longitudinal spring")
    return f"a change of {span} % of any other part would have been found, {' or '.join(missed)} would not"


def format_time(time: float) -> str:
    """Return a time [s] in words: minutes since the first window, or a date if it counts from 1970."""
    if time < _DATED:
        return f"{time / 60:.0f} min"
    return f"{datetime.fromtimestamp(time, tz=UTC):%Y-%m-%d %H:%M} UTC"


@dataclass(frozen=True, eq=False, slots=True)
class ModeChange:
    """A mode of the body before and after a change, as the finding implies: computed, not measured.

    Parameters
    ----------
    label
        "bounce", "pitch" or "roll".
    frequency, damping
        Natural frequency [Hz] and damping ratio, before and after.
    mac
        Modal assurance criterion of the two shapes, 0 to 1.
    channels
        Channels of the shapes.
    shapes
        Moduli of the shapes before and after, shape (2, channels), 1 at the largest channel of each.
    measured_before, measured_since
        Natural frequency [Hz] and damping ratio of the vehicle as fitted to each window, median over the windows before
        the onset and since then; None without such windows.
    """

    label: str
    frequency: tuple[float, float]
    damping: tuple[float, float]
    mac: float
    channels: tuple[str, ...]
    shapes: Real
    measured_before: tuple[float, float] | None = None
    measured_since: tuple[float, float] | None = None


def mode_changes(
    vehicle: Vehicle, finding: Finding, baseline: Baseline | None = None, *, observations: Sequence[Observation] = ()
) -> tuple[ModeChange, ...]:
    """Return the changes of the body's modes that a finding implies.

    Parameters
    ----------
    vehicle
        Vehicle as its file describes it.
    finding
        Change of one part, of both sides of an axle or of all corners; an unmodelled one changes no mode.
    baseline
        Normal state before the change; None: the vehicle file.
    observations
        Windows of the diagnosis, for the measured modes.

    Returns
    -------
    tuple of ModeChange
        Bounce, pitch and roll, as far as the vehicle has them.

    Notes
    -----
    Exact modes of the vehicle with the baseline's components, and with the finding's change applied to them: they
    illustrate the finding and are not evidence for it. The measured modes also vary with the payload.

    Examples
    --------
    A front-left spring that has lost 30 % of its stiffness lowers the frequencies of all modes of the body:

    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> (finding,) = sprung.diagnose(windows[8:], sprung.learn(windows[:8])).findings
    >>> changes = mode_changes(sprung.read_vehicle("zafira"), finding)
    >>> [(change.label, change.frequency[1] < change.frequency[0]) for change in changes]
    [('bounce', True), ('pitch', True), ('roll', True)]
    """
    if finding.change is None:
        return ()
    nominal = structure(vehicle)
    parts = nominal.components()  # without the conicity
    means = () if baseline is None else zip(baseline.components, np.exp(baseline.mean).tolist(), strict=True)
    before = {component: factor for component, factor in means if component in parts}
    after = dict(before)
    for component in parts:
        if component.kind == finding.component and finding.corner in {component.corner, component.axle, "all"}:
            after[component] = before.get(component, 1.0) * (1 + finding.change)
    if after == before:
        return ()
    healthy, changed = (nominal.changed(factors).modes() for factors in (before, after))
    valid = [window for window in observations if window.is_valid]
    earlier = [window for window in valid if window.time < finding.since]
    later = [window for window in valid if window.time >= finding.since]
    changes = []
    for label in (label for label in MOTIONS if label in healthy.labels):
        row = healthy.labels.index(label)
        likeness = mac(healthy.mode_shapes[row : row + 1], changed.mode_shapes)[0]
        distance = np.abs(np.log(changed.natural_frequency / healthy.natural_frequency[row]))
        match = int(np.argmax(likeness - distance))
        changes.append(
            ModeChange(
                label=label,
                frequency=(float(healthy.natural_frequency[row]), float(changed.natural_frequency[match])),
                damping=(float(healthy.damping_ratio[row]), float(changed.damping_ratio[match])),
                mac=float(likeness[match]),
                channels=tuple(healthy.channels),
                shapes=np.abs(unit_shapes(np.array([healthy.mode_shapes[row], changed.mode_shapes[match]]))),
                measured_before=_measured(earlier, label),
                measured_since=_measured(later, label),
            )
        )
    return tuple(changes)


def _measured(observations: Sequence[Observation], label: str) -> tuple[float, float] | None:
    """Return the median frequency and damping of a mode over windows."""
    modes = [observation.modes[label] for observation in observations if label in observation.modes]
    if not modes:
        return None
    frequency, damping = np.median(modes, axis=0)
    return float(frequency), float(damping)
