"""Tables of baselines and diagnoses."""

import math
from collections.abc import Mapping, Sequence

import numpy as np

from sprung._display import counted
from sprung.diagnosis import (
    Baseline,
    Detection,
    Diagnosis,
    Finding,
    ModeChange,
    Observation,
    PhaseShift,
    Trend,
    detectable,
    detectable_in_words,
)
from sprung.diagnosis.baseline import CONDITIONS
from sprung.diagnosis.findings import format_time
from sprung.diagnosis.observation import CONDITION_UNITS
from sprung.results.tables.wording import Table, format_name
from sprung.vehicles import Component

#: Hypotheses in the table.
_SHOWN = 5
#: Numbers of further windows for which a baseline states the smallest detectable losses.
_FURTHER = (6, 12)


def baseline_table(baseline: Baseline) -> Table:
    """Return the table of mean and scatter of each component, and of its smallest detectable loss.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((12, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> table = baseline_table(sprung.learn(windows))
    >>> for row in (table.columns, table.rows[1]):
    ...     print(" | ".join(row))
    component | mean from nominal [%] | std of a window [%] | loss detectable in 6 / 12 windows [%]
    front left damper | -0.3 | 2.6 | 11 / 9
    """
    deviations = np.sqrt(np.diag(baseline.covariance))
    losses = [detectable(baseline, n_windows=count) for count in _FURTHER]
    rows = tuple(
        (
            format_name(str(component)),
            f"{100 * np.expm1(mean):+z.1f}",
            f"{100 * deviation:.1f}",
            " / ".join(f"{100 * loss[component]:.0f}" for loss in losses),
        )
        for component, mean, deviation in zip(baseline.components, baseline.mean, deviations, strict=True)
    )
    counts = " / ".join(map(str, _FURTHER))
    columns = (
        "component",
        "mean from nominal [%]",
        "std of a window [%]",
        f"loss detectable in {counts} windows [%]",
    )
    return Table("Baseline", columns, rows, ends_in_words=False)


def describe_baseline(baseline: Baseline, *, n_windows: int | None = None) -> list[str]:
    """Return version, conditions and notes of a baseline in sentences.

    Parameters
    ----------
    baseline
        Baseline.
    n_windows
        Number of windows that it could be learnt from; None: those of the baseline, and those that it refused.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((12, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> describe_baseline(sprung.learn(windows), n_windows=12)[0]
    'version 1 (first learning): learnt from 12 of 12 windows'
    """
    seen = baseline.n_windows + baseline.n_refused if n_windows is None else n_windows
    learnt = f"learnt from {baseline.n_windows} of {counted(seen, 'window')}"
    sentences = [f"version {baseline.version} ({baseline.reason}): {learnt}"]
    if baseline.ranges:
        ranges = ", ".join(
            f"{name.replace('_', ' ')} {low:.3g} to {high:.3g} {CONDITION_UNITS.get(name, '')}".rstrip()
            for name, (low, high) in baseline.ranges.items()
            if name in CONDITIONS
        )
        sentences.append(f"conditions: {ranges}")
    return [*sentences, *baseline.notes]


def describe_diagnosis(diagnosis: Diagnosis) -> list[str]:
    """Return verdict, findings and sensor faults of a diagnosis in sentences, with evidence and threshold.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> diagnosis = sprung.diagnose(windows[8:], sprung.learn(windows[:8]))
    >>> for sentence in describe_diagnosis(diagnosis):
    ...     print(sentence)
    front-left spring 30 % (27 to 32 %) softer, since 80 min; inspect before the next 500 km
    no trend detected: -10.6 to +4.1 % per hour of driving
    ln evidence 91.0; alarm threshold 10.8; a change of 8 to 11 % of any part would have been found
    """
    sentences = [
        line
        for finding in diagnosis.findings
        for line in (finding.sentence, describe_trend(finding.trend, finding.phase_shift))
    ]
    sentences = sentences or [describe_verdict(diagnosis)]
    sentences += [f"sensor {fault.statement}: {fault.detail}" for fault in diagnosis.sensor_faults]
    if diagnosis.detection is None:
        return sentences
    is_beside = any(finding.is_on_bump_stop or finding.run_out for finding in diagnosis.findings)
    of_parts = " of sizes of parts" if is_beside else ""
    numbers = f"ln evidence{of_parts} {diagnosis.detection.evidence[-1]:.1f}"
    numbers += f"; alarm threshold {diagnosis.detection.threshold:.1f}"
    if diagnosis.findings:
        numbers += f"; {detectable_in_words(diagnosis.detectable)}"
    return [*sentences, numbers]


def describe_verdict(diagnosis: Diagnosis) -> str:
    """Return the verdict of a diagnosis without findings in one sentence."""
    if diagnosis.detection is None:
        return "inconclusive: no window was usable"
    doubt = next(iter(diagnosis.doubts), "")
    if doubt and diagnosis.detection.is_alert:  # a difference is seen, and attributed to something else
        return f"inconclusive: {doubt}"
    return describe_no_change(diagnosis.detectable, doubt)


def describe_no_change(detectable: Mapping[Component, float], doubt: str) -> str:
    """Return a verdict without findings in one sentence.

    Parameters
    ----------
    detectable
        Smallest relative loss of each part that would have been found.
    doubt
        Why a change may have gone undetected; empty for no reason.

    Examples
    --------
    >>> from sprung.vehicles import Component
    >>> describe_no_change({Component("front_left", "spring"): 0.07}, "")
    'no change detected; a change of 7 % of any part would have been found'
    """
    if doubt:
        return f"inconclusive: no change detected, but {doubt}"
    return f"no change detected; {detectable_in_words(detectable)}"


def why_unusable(diagnosis: Diagnosis, baseline: Baseline | None) -> str:
    """Return why no window of a diagnosis was usable.

    Parameters
    ----------
    diagnosis
        Diagnosis without a window to compare.
    baseline
        Baseline that its windows were compared with; None: the vehicle file.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> nothing = np.zeros(0)
    >>> window = sprung.Observation(0.0, (), nothing, np.zeros((0, 0)), {}, {}, (), reason="the vehicle stood still")
    >>> why_unusable(sprung.diagnose([window]), None)
    'the vehicle stood still'
    """
    reasons = [observation.reason for observation in diagnosis.observations if not observation.is_conclusive]
    if reasons:
        return reasons[0]
    if baseline is not None and diagnosis.observations:
        return "their components differ from those of the baseline: fit the same ones, or learn again"
    return diagnosis.notes[0] if diagnosis.notes else "there are no windows"


def diagnosis_tables(diagnosis: Diagnosis, changes: Sequence[ModeChange] = ()) -> list[Table]:
    """Return all tables of a diagnosis that have rows.

    Parameters
    ----------
    diagnosis
        Diagnosis.
    changes
        Modes before and after its findings.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> diagnosis = sprung.diagnose(windows[8:], sprung.learn(windows[:8]))
    >>> changes = sprung.diagnosis.mode_changes(sprung.read_vehicle("zafira"), diagnosis.findings[0])
    >>> [table.title for table in diagnosis_tables(diagnosis, changes)]
    ['Hypotheses of a change, best first', 'Body modes as the finding implies and as measured']
    """
    tables = [] if diagnosis.detection is None else [hypotheses_table(diagnosis.detection)]
    return [*tables, mode_changes_table(changes)] if changes else tables


def findings_table(value: Sequence[Finding] | Finding) -> Table:
    """Return the table of findings: part, size, onset, severity and advice.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> diagnosis = sprung.diagnose(windows[8:], sprung.learn(windows[:8]))
    >>> table = findings_table(diagnosis.findings)
    >>> for row in (table.columns, *table.rows):
    ...     print(" | ".join(row))
    part | change [%] | 95 % interval [%] | since | severity | advice
    front left spring | -29.6 | -32.0 to -27.1 | 80 min | high | inspect before the next 500 km
    """
    findings = (value,) if isinstance(value, Finding) else value
    rows = tuple(
        (
            format_name(finding.hypothesis),
            "" if finding.change is None else f"{100 * finding.change:+z.1f}",
            "" if finding.interval is None else " to ".join(f"{100 * end:+z.1f}" for end in finding.interval),
            format_time(finding.since),
            finding.severity,
            finding.advice,
        )
        for finding in findings
    )
    return Table("Findings", ("part", "change [%]", "95 % interval [%]", "since", "severity", "advice"), rows)


def observations_table(value: Sequence[Observation] | Observation) -> Table:
    """Return the table of windows: conditions, body modes, quality of the fit, faults of sensors.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> part, conditions = (sprung.Component("front_left", "spring"),), {"speed": 15.0, "payload": 40.0}
    >>> window = sprung.Observation(600.0, part, np.zeros(1), np.eye(1), conditions, {"bounce": (1.4, 0.25)}, ())
    >>> table = observations_table([window])
    >>> dict(zip(table.columns, table.rows[0]))
    {'start': '10 min', 'speed [m/s]': '15', 'model error [%]': '', 'bounce': '1.40 Hz, 25.0 %', 'remarks': ''}
    """
    observations = (value,) if isinstance(value, Observation) else value
    labels = list(dict.fromkeys(label for window in observations for label in window.modes))
    columns = ("start", "speed [m/s]", "model error [%]", *labels, "remarks")
    rows = tuple(
        (
            format_time(window.time),
            _condition(window, "speed"),
            _condition(window, "model_error", factor=100.0),
            *(_format_mode(window.modes.get(label)) for label in labels),
            "; ".join(
                [
                    *([f"inconclusive: {window.reason}"] if window.reason else []),
                    *(f"{fault.channel} {format_name(fault.kind)}" for fault in window.sensor_faults),
                ]
            ),
        )
        for window in observations
    )
    return Table("Windows", columns, rows)


def _condition(window: Observation, name: str, *, factor: float = 1.0) -> str:
    """Return a condition of a window; empty if it is unknown."""
    value = window.conditions.get(name, math.nan)
    return f"{factor * value:.3g}" if math.isfinite(value) else ""


def hypotheses_table(detection: Detection) -> Table:
    """Return the table of the best hypotheses of a change test.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> diagnosis = sprung.diagnose(windows[8:], sprung.learn(windows[:8]))
    >>> table = hypotheses_table(diagnosis.detection)
    >>> for row in (table.columns, table.rows[0]):
    ...     print(" | ".join(row))
    hypothesis | ln evidence | change [%] | 95 % interval [%]
    front left spring | 92.0 | -29.6 | -32.0 to -27.1
    """
    rows = tuple(
        (
            format_name(candidate.hypothesis.name).replace("all ", "every ").replace("+", ", "),
            f"{candidate.log_evidence:.1f}",
            ", ".join(f"{100 * size.change:+z.1f}" for size in candidate.sizes),
            ", ".join(" to ".join(f"{100 * end:+z.1f}" for end in size.interval) for size in candidate.sizes),
        )
        for candidate in detection.candidates[:_SHOWN]
    )
    columns = ("hypothesis", "ln evidence", "change [%]", "95 % interval [%]")
    return Table("Hypotheses of a change, best first", columns, rows, ends_in_words=False)


def mode_changes_table(changes: Sequence[ModeChange]) -> Table:
    """Return the table of the body modes before and after a change.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> diagnosis = sprung.diagnose(windows[8:], sprung.learn(windows[:8]))
    >>> changes = sprung.diagnosis.mode_changes(sprung.read_vehicle("zafira"), diagnosis.findings[0])
    >>> table = mode_changes_table(changes)
    >>> for row in (table.columns, table.rows[0]):
    ...     print(" | ".join(row[:4]))
    mode | frequency [Hz] | damping [%] | MAC
    bounce | 1.52 -> 1.43 | 16.2 -> 18.4 | 0.924
    """
    columns = ("mode", "frequency [Hz]", "damping [%]", "MAC", "measured before", "measured since")
    rows = tuple(
        (
            format_name(change.label),
            " -> ".join(f"{frequency:#.3g}" for frequency in change.frequency),
            " -> ".join(f"{100 * ratio:#.3g}" for ratio in change.damping),
            f"{change.mac:.3f}",
            _format_mode(change.measured_before),
            _format_mode(change.measured_since),
        )
        for change in changes
    )
    return Table("Body modes as the finding implies and as measured", columns, rows, ends_in_words=False)


def describe_trend(trend: Trend | None, phase: PhaseShift | None = None) -> str:
    """Return a sentence about how a change develops, and when a damper reaches the limit of the suspension test.

    Examples
    --------
    >>> from sprung.diagnosis import Trend
    >>> describe_trend(Trend(per_hour=-0.02, interval=(-0.03, -0.01), hours_to_limit=(2.0, 6.0)))
    'trend: -2.0 % (-3.0 to -1.0) per hour of driving, 30 % in 2.0 to 6.0 hours'
    >>> describe_trend(Trend(per_hour=0.01, interval=(-0.01, 0.03), hours_to_limit=None))
    'no trend detected: -1.0 to +3.0 % per hour of driving'
    """
    if phase is not None and phase.hours_to_limit is not None:
        soonest, latest = phase.hours_to_limit
        due = f"in {soonest:.1f} to {latest:.1f} hours" if latest else "by now"
        return f"{describe_trend(trend)}; it fails the suspension test {due} at this rate"
    if trend is None:
        return "trend not estimated: it needs a single part and at least four windows since the onset"
    low, high = (f"{100 * end:+z.1f}" for end in trend.interval)
    if trend.interval[0] * trend.interval[1] <= 0:
        return f"no trend detected: {low} to {high} % per hour of driving"
    text = f"trend: {100 * trend.per_hour:+z.1f} % ({low} to {high}) per hour of driving"
    if trend.hours_to_limit is None:
        return text
    soonest, latest = trend.hours_to_limit
    return f"{text}, 30 % {f'in {soonest:.1f} to {latest:.1f} hours' if latest else 'is reached'}"


def _format_mode(mode: tuple[float, float] | None) -> str:
    """Return frequency and damping ratio of a mode; empty if it is unknown."""
    return "" if mode is None else f"{mode[0]:#.3g} Hz, {100 * mode[1]:#.3g} %"
