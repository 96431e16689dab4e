"""From windows and a baseline to a diagnosis: health assessment of ISO 13374; ranking of a fleet."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from operator import itemgetter

import numpy as np
from scipy.special import entr

from sprung._arrays import Real
from sprung._checks import check_each, check_number, check_type
from sprung._display import counted
from sprung.diagnosis.baseline import CONDITIONS, Baseline, of_one_type, vehicle_of
from sprung.diagnosis.baseline import SETTINGS as BASELINE
from sprung.diagnosis.changes import Candidate, ChangeDetector, Detection, detect, false_discoveries
from sprung.diagnosis.findings import (
    LIGHTEST_WHEEL,
    MAX_UNDETECTED,
    MAY_HIDE,
    SEVERITIES,
    STIFFER_TYRE,
    Diagnosis,
    Finding,
    format_time,
    out_of_round,
)
from sprung.diagnosis.hypotheses import Hypothesis
from sprung.diagnosis.learning import learn
from sprung.diagnosis.loads import Stops, in_doubt, on_bump_stop, stop_notes, stops_of
from sprung.diagnosis.observation import LAYOUT_CONDITIONS, Observation
from sprung.diagnosis.residuals import RESIDUALS, ResidualTest, residual_test
from sprung.diagnosis.trends import PhaseShift, current_sizes, phase_shift, trend
from sprung.diagnosis.type_baselines import MIN_VEHICLES, TypeBaseline, nominal_type
from sprung.diagnosis.type_comparison import TypeComparison, compare_with_type
from sprung.diagnosis.type_learning import Fleet, usable_windows
from sprung.errors import DataError, ParameterError
from sprung.likelihood.plate_test import PLATE
from sprung.vehicles import Component
from sprung.vehicles.channel_faults import SensorFault
from sprung.vehicles.structure import DAMPERS


@dataclass(frozen=True, slots=True)
class NamingRules:
    """When a part is named, and a window comparable."""

    #: Difference of ln evidence above which the runner-up is not named.
    close: float = 3.0
    #: Largest value of a part, over its normal one, of a runner-up that is named: friction six times as high reads as a
    #: damper of 1.8, a spare wheel as a tyre of 1.6. Where data say little about a part, evidence sets no such limit.
    largest: float = 3.0
    #: Share of what an unmodelled change explains that a part must explain to be named in its place.
    mostly: float = 0.8
    #: The same of a pair, which is the best of many: two healthy parts explained 0.8 of a soft spring on its bump stop.
    mostly_of_pair: float = 0.9
    #: Apparent change of another part for a unit change of one (both ln), by nonlinearity and errors of the file:
    #: standard deviation.
    leak: float = 0.1
    #: The same for a unit change of a damper, as friction and valves are not linear: with six times the friction of one
    #: strut of a multibody car, the damper behind it read 0.3 to 0.5 times that change softer.
    leak_of_damper: float = 0.2
    #: Number of standard deviations, of this and of chance, by which the second part of a pair must change.
    clearly: float = 3.0
    #: Share of what the best part explains alone that a pair must add to it.
    more: float = 0.2
    #: Margin around the range of a condition in the baseline within which a window is comparable, over that range.
    room: float = 0.5
    #: Smallest margin, in units of the condition.
    min_room: float = 0.2
    #: Smallest number of windows of the first set of a comparison: their scatter is then widened by Student's t.
    min_compared: int = 2


RULES = NamingRules()


def diagnose(
    observations: Iterable[Observation],
    baseline: Baseline | None = None,
    *,
    type_baseline: TypeBaseline | None = None,
    false_alarms: float = 1e-3,
    windows_per_day: float = 48.0,
) -> Diagnosis:
    """Diagnose a vehicle.

    Parameters
    ----------
    observations
        Windows of one vehicle in the order of time.
    baseline
        Baseline of the vehicle; None: it is compared with its type.
    type_baseline
        Baseline of the vehicle's type; None: left is compared with right by production scatter, see `nominal_type`.
    false_alarms
        Rate of false alarms of a healthy vehicle, per day; above 0.
    windows_per_day
        Windows in a day of driving, above 0.

    Returns
    -------
    Diagnosis
        Verdict, findings, sensor faults, and the smallest changes that would have been found.

    Raises
    ------
    ParameterError
        If a number is out of range, or the windows are of several vehicles, of another one than the baseline, or of
        other components than the type's.

    Notes
    -----
    All windows pass through one `ChangeDetector`, or without a baseline through `compare_with_type`.

    References
    ----------
    As for `ChangeDetector` and `compare_with_type`.

    Examples
    --------
    Eight windows of a healthy vehicle, and six with a front-left spring that has lost 30 % of its stiffness:

    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> diagnosis = diagnose(windows[8:], sprung.learn(windows[:8]))
    >>> diagnosis.verdict
    'change'
    >>> print(diagnosis.findings[0].sentence)
    front-left spring 30 % (27 to 32 %) softer, since 80 min; inspect before the next 500 km
    """
    for name, value, kind in (("baseline", baseline, Baseline), ("type_baseline", type_baseline, TypeBaseline)):
        if value is not None:
            check_type(name, value, kind)
    every = tuple(check_each("observations", observations, Observation))
    vehicle = vehicle_of(every)
    if baseline is not None:
        if vehicle and baseline.vehicle and vehicle != baseline.vehicle:
            raise ParameterError(
                f"the windows are of the vehicle {vehicle!r}, the baseline is of {baseline.vehicle!r}: give that of "
                f"{vehicle!r}, or learn one"
            )
        detector = ChangeDetector.resumed(
            baseline, every, (), false_alarms=false_alarms, windows_per_day=windows_per_day
        )
        return diagnosis_of(detector)
    components = next((window.components for window in every if window.is_conclusive), None)
    if components is None:
        return _diagnosis(every, None, None, false_alarms)
    of_type = nominal_type(components, name=vehicle) if type_baseline is None else type_baseline
    if not any(window.components == of_type.components for window in every):
        raise ParameterError("the components differ from those of the type's baseline: fit the same ones")
    detection = compare_with_type(every, of_type, false_alarms=false_alarms, windows_per_day=windows_per_day)
    return _diagnosis(every, of_type.baseline(every), detection, false_alarms)


def diagnosis_of(detector: ChangeDetector) -> Diagnosis:
    """Return the diagnosis of the windows that a detector holds.

    Parameters
    ----------
    detector
        Detector with its windows and baseline.

    Notes
    -----
    Without a baseline, a difference that no part explains is attributed to the vehicle file: a doubt, not a finding. If
    the baseline has a residual reference, each conclusive window with valid sensors is tested against it as well; a
    note states this second opinion, and whether it disagrees. The residuals depend on the conditions, which this test
    does not model: windows far from the conditions of the baseline are not tested. Without findings, the diagnosis is
    inconclusive if the second opinion disagrees, if there is no baseline, or if the loss of a fifth of some part would
    not have been found.

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> from sprung.diagnosis import ChangeDetector
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((12, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> detector = ChangeDetector(sprung.learn(windows[:8]))
    >>> for window in windows[8:]:
    ...     detector.update(window)
    >>> diagnosis_of(detector).verdict
    'no_change_detected'
    """
    every = detector.observations
    baseline = detector.baseline if any(window.is_conclusive for window in every) else None
    return _diagnosis(every, baseline, detector.detection, detector.false_alarms)


def compare(before: Iterable[Observation], after: Iterable[Observation], *, false_alarms: float = 0.01) -> Diagnosis:
    """Return whether two sets of windows of one vehicle differ, where, and by how much.

    Parameters
    ----------
    before, after
        Windows of each set, before and after what may have changed the vehicle.
    false_alarms
        Probability that two sets of an unchanged vehicle are called different, above 0.

    Returns
    -------
    Diagnosis
        That of the second set with a baseline of the first alone: findings are changes of the second from the first,
        and `detectable` is the smallest change that would have been found.

    Raises
    ------
    DataError
        If the first set has fewer than two usable windows.
    ParameterError
        If a number is out of range, or the windows are of several vehicles.

    Notes
    -----
    The test is `ChangeDetector`. With few windows in the first set, its mean and scatter are uncertain, and a change
    has to be larger to be found: that is part of the baseline (`learn`).

    Examples
    --------
    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((10, 12))
    >>> values[5:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> result = compare(windows[:5], windows[5:])
    >>> result.verdict, str(result.findings[0].corner), result.findings[0].component
    ('change', 'front_left', 'spring')
    """
    check_number("false_alarms", false_alarms, above=0)
    later = list(check_each("after", after, Observation))
    first = learn(before, min_windows=RULES.min_compared, reason="first set of a comparison")
    # One comparison is one day: the rate of false alarms per day is the probability for the whole set.
    result = diagnose(later, first, false_alarms=false_alarms, windows_per_day=max(len(later), 1))
    return replace(
        result, notes=(f"compared with {counted(first.n_windows, 'window')} of the first set", *result.notes)
    )


def _diagnosis(
    every: tuple[Observation, ...], baseline: Baseline | None, detection: Detection | None, false_alarms: float
) -> Diagnosis:
    """Return the diagnosis of windows by their comparison with a baseline; None if no window is conclusive."""
    faults: dict[tuple[str, str], SensorFault] = {}
    for fault in (fault for window in every for fault in window.sensor_faults):
        faults.setdefault((fault.channel, fault.kind), fault)
    notes, first_faults = _window_notes(every), tuple(faults.values())
    if baseline is None:
        return Diagnosis((), first_faults, None, every, notes, None, false_alarms)
    compared = [window for window in every if baseline.accepts(window)]
    named: Candidate | None = None
    findings: tuple[Finding, ...] = ()
    doubts = []
    if detection is not None:
        best, second = _best_two(detection)
        named = _at_present(best, compared, baseline) if detection.is_alert else best
        stated = tuple(named if candidate is best else candidate for candidate in detection.candidates)
        detection = replace(detection, candidates=stated)
        findings = _findings(named, second, compared, baseline) if detection.is_alert else ()
        stops = stops_of(every, baseline)
        if attributed := _attributed(findings, every, baseline, stops, detection.threshold):
            findings = ()
            doubts.append(attributed)
        findings = findings or on_bump_stop(stops, detection.threshold, compared, baseline)
        findings = (*findings, *out_of_round(compared, baseline))
    if detection is not None and baseline.n_windows == 0:
        doubts.append("no baseline: compared with the vehicle file, and left with right, with wide limits")
        if any(finding.component == "unmodelled" for finding in findings):
            findings = ()
            doubts.append(
                "the windows differ from the vehicle file in a way that no single part explains: the file does not "
                "describe this vehicle; calibrate it on healthy drives, or learn a baseline"
            )
    elif detection is not None and doubt_about(detection.detectable):
        doubts.append(doubt_about(detection.detectable))
    tests = _residual_tests(every, baseline)
    opinion, is_contradicted = _second_opinion(tests, is_changed=any(one.run_out is None for one in findings))
    notes = (
        *notes,
        *_exclusion_notes(every, baseline),
        *baseline.notes,
        *_condition_notes(baseline, compared),
        *stop_notes(baseline, compared),
        *([] if detection is None or named is None else _evidence_notes(detection, named)),
        *([_OF_STIFFENING] if any(one.is_on_bump_stop for one in findings) else []),
        *opinion,
        *doubts,
    )
    doubts += opinion if is_contradicted else []
    return Diagnosis(findings, first_faults, detection, every, notes, baseline, false_alarms, tests, tuple(doubts))


#: Note beside the finding of a corner on its bump stop.
_OF_STIFFENING = (
    "a corner on its bump stop is found by how its spring stiffens inwards: the evidence stated is of the other test"
)


def doubt_about(detectable: Mapping[Component, float]) -> str:
    """Return why a change of some part may have gone undetected; empty if a fifth of any would have been found.

    Notes
    -----
    Anti-roll bars and longitudinal springs raise no doubt about the others: sensors hardly see a weak one. What is said
    of a vehicle without changes names those whose change is hidden (`detectable_in_words`). Nor does the conicity of
    wheels, which follows the gauge of the rails.

    Examples
    --------
    >>> from sprung.vehicles import Component
    >>> doubt_about({Component("front_left", "spring"): 0.2, Component("rear_axle", "anti_roll"): 0.9})
    ''
    """
    parts = {part: least for part, least in detectable.items() if part.kind not in {*MAY_HIDE, "conicity"}}
    hidden = {part: least for part, least in parts.items() if least > MAX_UNDETECTED}
    if not hidden:
        return ""
    names = ", ".join(
        f"{str(part).replace('_', '-').replace('.', ' ')} {100 * least:.0f} %" for part, least in hidden.items()
    )
    return (
        f"a change of {100 * MAX_UNDETECTED:.0f} % would not have been found in every part, as the smallest "
        f"detectable changes show ({names}): give more windows, or learn the baseline from more"
    )


def _residual_tests(observations: Sequence[Observation], baseline: Baseline) -> dict[float, ResidualTest]:
    """Return the residual tests of windows with valid sensors, the reference's channels and known conditions."""
    reference = baseline.residuals
    if reference is None:
        return {}
    return {
        observation.time: residual_test(reference, observation.residuals)
        for observation in observations
        if observation.residuals is not None
        and observation.residuals.is_like(reference)
        and not any(_is_far(baseline, name, observation) for name in baseline.ranges)
    }


def _second_opinion(tests: Mapping[float, ResidualTest], *, is_changed: bool) -> tuple[list[str], bool]:
    """Return a note on the result of the residual test, and whether most windows differ."""
    different = sum(test.is_different for test in tests.values())
    is_contradicted = different > len(tests) / 2
    if not tests:
        return [], False
    doubt = ""
    if is_changed and not different:
        doubt = ": it does not confirm the finding"
    if not is_changed and is_contradicted:
        doubt = ": it disagrees, no change of springs, dampers or tyres was detected"
    sentence = (
        f"second opinion without the vehicle file (subspace residuals): {different} of {len(tests)} windows differ "
        f"from those of the baseline (p < {RESIDUALS.different:g}){doubt}"
    )
    return [sentence], is_contradicted


def _at_present(best: Candidate, observations: Sequence[Observation], baseline: Baseline) -> Candidate:
    """Return the hypothesis to name with its sizes after the last window, by which it is judged."""
    sizes = []
    for change, size in zip(best.hypothesis.changes, current_sizes(best, observations, baseline), strict=True):
        low, high = size.interval
        if change.component == "tyre" and change.scope == "single" and size.change >= STIFFER_TYRE:
            low = max((1 + low) * LIGHTEST_WHEEL - 1, 0.0)
        sizes.append(replace(size, interval=(low, high)))
    return replace(best, sizes=tuple(sizes))


def _findings(
    best: Candidate, second: Candidate | None, observations: Sequence[Observation], baseline: Baseline
) -> tuple[Finding, ...]:
    """Return the findings of an alert: one for each change of the hypothesis to name, one for an unmodelled change."""
    is_close = second is not None and best.log_evidence - second.log_evidence < RULES.close
    onset = best.onset, best.onset_interval, _words(second) if second is not None and is_close else ""
    if not best.sizes:
        without_size, severity = (None, None, None), SEVERITIES[2][1:]
        return (Finding(best.hypothesis.corner, best.hypothesis.component, *without_size, *severity, *onset, None),)
    findings = []
    for number, (change, size) in enumerate(zip(best.hypothesis.changes, best.sizes, strict=True)):
        low, high = size.interval
        certain = min(abs(low), abs(high)) if low * high > 0 else 0.0
        severity = next(level[1:] for level in SEVERITIES if certain >= level[0])
        phase = None
        if change.component in DAMPERS and size.change < 0:
            corners = [part.corner for part in change.parts(baseline.components)]
            phase = phase_shift(corners, observations, since=best.onset)
        severity = max(severity, _severity_by(phase), key=itemgetter(1))
        course = trend(best, observations, baseline, since=best.onset, number=number)
        size_of_it = size.change, size.interval, size.score
        findings.append(Finding(change.corner, change.component, *size_of_it, *severity, *onset, course, phase))
    return tuple(findings)


def _attributed(
    findings: Sequence[Finding],
    observations: Sequence[Observation],
    baseline: Baseline,
    stops: Stops,
    threshold: float,
) -> str:
    """Return why findings are not stated: loads and roads that the baseline has not met may explain them; else empty.

    They are not what is found with a baseline that allows for these.
    """
    wider = in_doubt(baseline, stops, findings)
    if wider is baseline:
        return ""
    again = detect(wider, observations, false_alarms=float(np.exp(-threshold)), windows_per_day=1.0)
    if again is not None and again.is_alert:
        best, _ = _best_two(again)
        changes = zip(best.hypothesis.changes, best.sizes, strict=True)
        named = {(part.name, size.change > 0) for part, size in changes} or {(best.hypothesis.name, False)}
        if named == {(one.hypothesis, (one.change or 0.0) > 0) for one in findings}:
            return ""
    words = " and ".join(f"{one.corner} {one.component}".replace("_", "-") for one in findings)
    what = "the unmodelled change" if words == "vehicle unmodelled" else f"the change of {words}"
    return (
        f"{what} is within what bump stops and the error of the vehicle file ({100 * baseline.model_error:.0f} %) may "
        "cause under other loads and on other roads: it is not named; learn a baseline with such drives"
    )


def _severity_by(phase: PhaseShift | None) -> tuple[str, int, str]:
    """Return the severity of a damper that certainly fails the suspension test, that probably does, or of others."""
    if phase is None or phase.degrees >= PLATE.phase_limit:
        return SEVERITIES[3][1:]
    return SEVERITIES[1 if phase.interval[1] < PLATE.phase_limit else 2][1:]


def _best_two(detection: Detection) -> tuple[Candidate, Candidate | None]:
    """Return the hypothesis to name, and the next best among those of possible sizes; None if there is none.

    A part, or a pair, that explains nearly all is named even if an unmodelled change explains a little more: with much
    evidence, every error of the vehicle file makes it do so. For the same reason a pair is named only if its second
    part changes more than the first one may mimic, and explains what the first one does not.
    """
    alone = {value.hypothesis: value.explained for value in detection.candidates if len(value.sizes) == 1}
    candidates = [
        value
        for value in detection.candidates
        if value.hypothesis.scope != "pair" or (_is_distinct(value) and _is_needed(value, alone))
    ]
    first, *others = candidates
    named = next(candidate for candidate in candidates if candidate.hypothesis.scope != "else")
    mostly = RULES.mostly_of_pair if named.hypothesis.scope == "pair" else RULES.mostly
    is_enough = named.explained >= mostly * first.explained and named.log_evidence >= detection.threshold
    if first.hypothesis.scope == "else" and is_enough:
        first, others = named, [value for value in others if value is not named and value.hypothesis.scope != "else"]
    possible = (value for value in others if all(1 + size.change <= RULES.largest for size in value.sizes))
    return first, next(possible, None)


def _is_distinct(pair: Candidate) -> bool:
    """Return whether the smaller change of a pair exceeds what chance and the larger one may mimic.

    Of two anti-roll bars none becomes stiffer as the other is lost: sensors on the body see their sum far better than
    each of them, and an error of their shares reads so.
    """
    parts, changes = pair.hypothesis.changes, [np.log1p(size.change) for size in pair.sizes]
    if all(part.component == "anti_roll" for part in parts) and min(changes) < 0 < max(changes):
        return False
    smaller, larger = np.argsort(np.abs(changes))
    leak = (RULES.leak_of_damper if parts[larger].component == "damper" else RULES.leak) * changes[larger]
    return bool(abs(changes[smaller]) > RULES.clearly * np.hypot(changes[smaller] / pair.sizes[smaller].score, leak))


def _is_needed(pair: Candidate, alone: Mapping[Hypothesis, float]) -> bool:
    """Return whether a pair explains clearly more than the best of all parts alone, its own or not."""
    return pair.explained > (1 + RULES.more) * max(alone.values())


def _words(candidate: Candidate) -> str:
    """Return a hypothesis in words."""
    return " and ".join(
        f"{change.corner.replace('_', '-')} {change.component.replace('_', ' ')} by {100 * size.change:+z.0f} %"
        for change, size in zip(candidate.hypothesis.changes, candidate.sizes, strict=True)
    )


def _share_of(number: int, windows: Sequence[Observation]) -> str:
    """Return how many of some windows were, such as "1 of 3 windows was"."""
    return f"{number} of {counted(len(windows), 'window')} {'was' if number == 1 else 'were'}"


def _window_notes(observations: Sequence[Observation]) -> tuple[str, ...]:
    """Return the notes of windows, once each, and one for each reason why some are inconclusive."""
    reasons = [observation.reason for observation in observations if not observation.is_conclusive]
    notes = dict.fromkeys(note for observation in observations for note in observation.notes)
    return *notes, *(
        f"{_share_of(reasons.count(reason), observations)} inconclusive: {reason}" for reason in dict.fromkeys(reasons)
    )


def _exclusion_notes(observations: Sequence[Observation], baseline: Baseline) -> list[str]:
    """Return notes on what the windows are compared with, and on those that were excluded."""
    conclusive = [observation for observation in observations if observation.is_conclusive]
    valid = [observation for observation in conclusive if not observation.sensor_faults]
    notes = []
    if len(valid) < len(conclusive):
        causes = {fault.statement for window in conclusive for fault in window.sensor_faults}
        notes.append(
            f"{_share_of(len(conclusive) - len(valid), conclusive)} excluded because "
            f"{' and '.join(sorted(causes))}; the suspension is not monitored until this is repaired"
        )
    others = {name for window in valid if not baseline.has_sensors_of(window) for name in window.missing}
    n_others = sum(not baseline.has_sensors_of(window) for window in valid)
    if n_others:
        lacking = f"lack the sensors {', '.join(sorted(others))}" if others else "have more sensors"
        notes.append(
            f"{_share_of(n_others, valid)} excluded because they {lacking}, unlike those of the baseline:"
            " learn it again with the same sensors"
        )
    distrusted = sum(not baseline.is_trusted_on(observation) for observation in valid)
    if distrusted:
        notes.append(
            f"the model fits {distrusted} of {len(valid)} windows too poorly for a comparison with the vehicle file: "
            "learn a baseline"
        )
    alike = [window for window in valid if window.components == baseline.components]
    undetermined = [parts for window in alike if (parts := baseline.too_stiff_in(window))]
    if undetermined:
        names = ", ".join(
            sorted({str(part).replace("_", "-").replace(".", " ") for each in undetermined for part in each})
        )
        notes.append(
            f"{_share_of(len(undetermined), valid)} excluded because the fit of {names} is more than "
            f"{BASELINE.stiffest:g} times as stiff as in the baseline, which no fault explains: give other drives"
        )
    return notes


def _evidence_notes(detection: Detection, named: Candidate) -> list[str]:
    """Return notes on what the named part leaves unexplained, or on an alert that has cleared."""
    if not detection.is_alert:
        if detection.first_alert is None:
            return []
        return [f"an alert was raised in the window at {format_time(detection.first_alert)} and has cleared"]
    first = detection.candidates[0]
    if first.log_evidence - named.log_evidence < detection.threshold:
        return []
    return [
        f"the {_words(named)} explains {100 * named.explained / first.explained:.0f} % of the change: the rest may be "
        "another part, or what the vehicle file lacks"
    ]


def _condition_notes(baseline: Baseline, observations: Sequence[Observation]) -> list[str]:
    """Return notes on conditions that are far from those of the baseline."""
    notes = []
    for name in (name for name in CONDITIONS if name in baseline.ranges):
        low, high = baseline.ranges[name]
        n_outside = sum(_is_far(baseline, name, observation) for observation in observations)
        if n_outside:
            notes.append(
                f"{n_outside} of {len(observations)} windows have a {name.replace('_', ' ')} far from that of the "
                f"baseline's windows ({low:.3g} to {high:.3g}): learn it again with such drives"
            )
    return notes


def _is_far(baseline: Baseline, name: str, observation: Observation) -> bool:
    """Return whether a condition of a window is known and far from those of the baseline's windows."""
    if name not in observation.conditions:
        return False
    scale = np.log if name == "roughness" else float
    low, high, value = (scale(one) for one in (*baseline.ranges[name], observation.conditions[name]))
    room = max(RULES.room * (high - low), RULES.min_room * (CONDITIONS | LAYOUT_CONDITIONS)[name])
    return not low - room <= value <= high + room


@dataclass(frozen=True, slots=True)
class RankedVehicle:
    """A vehicle of a fleet against its baseline, or against its type.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    detection
        Evidence that it has changed, or deviates from the others, and what.
    is_discovery
        Whether it is among the vehicles that have changed or deviate, see `rank_fleet`.
    n_windows
        Number of windows compared.
    information
        Expected information in the verdict of an inspection [nat], see `to_inspect`; 0 with a baseline.
    probability
        Probability that it differs from its type; 0 with a baseline.
    """

    vehicle: str
    detection: Detection
    is_discovery: bool
    n_windows: int
    information: float = 0.0
    probability: float = 0.0


def rank_fleet(
    windows: Mapping[str, Iterable[Observation]],
    *,
    baselines: Mapping[str, Baseline] | None = None,
    healthy: Mapping[str, Iterable[Observation]] | None = None,
    rate: float = 0.05,
) -> tuple[RankedVehicle, ...]:
    """Rank the vehicles of a type by the evidence that each has changed, or deviates from the others.

    Parameters
    ----------
    windows
        Windows of each vehicle, by its name.
    baselines
        Baselines of those vehicles that have one: they are compared with themselves, the others with their type.
    healthy
        Windows in which vehicles are known to be healthy, as an inspection found: they belong to the type whatever they
        are, and are not ranked. Leave out windows in which an inspection found a fault.
    rate
        Expected share of healthy vehicles among the discoveries, above 0 and up to 1.

    Returns
    -------
    tuple of RankedVehicle
        Vehicles whose windows can be compared, those with the strongest evidence first. Vehicles without a baseline are
        left out where fewer than five vehicles have usable windows.

    Raises
    ------
    DataError
        If no vehicle can be compared.
    ParameterError
        If the rate is not above 0 and at most 1.

    Notes
    -----
    The evidence is that of the diagnosis of each vehicle: the e-value e of its change test, or -ln p of the comparison
    with the type of the others, as by `compare_with_type`. Whether parts scatter unequally, and how consecutive windows
    are correlated, is taken from the baselines of all vehicles together: these are supposed to be alike in both, as
    vehicles of a type on the same routes are. Where all have a baseline, the rate holds at whatever moment
    one looks, in proportion to the time until then over a year, under any dependence (`false_discoveries`). As 1 / e is
    a p-value, with others it is the procedure of Benjamini and Hochberg: for independent vehicles and one look. A run
    over an archive (`sprung fleet run`) chooses in the same way.

    References
    ----------
    Y. Benjamini, Y. Hochberg, Controlling the false discovery rate: a practical and powerful approach to multiple
    testing, Journal of the Royal Statistical Society B 57 (1995) 289-300.

    Examples
    --------
    One of eight vehicles has a spring that has lost 30 % of its stiffness:

    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((8, 3, 12))
    >>> values[2, :, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> fleet = {
    ...     f"car-{n}": [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(of_car)]
    ...     for n, of_car in enumerate(values)
    ... }
    >>> ranked = rank_fleet(fleet)
    >>> ranked[0].vehicle, [vehicle.vehicle for vehicle in ranked if vehicle.is_discovery]
    ('car-2', ['car-2'])
    """
    check_number("rate", rate, above=0, at_most=1)
    check_type("windows", windows, Mapping, advice="{'bus-17': sprung.observe(recordings, vehicle), ..}")
    known, every = of_one_type(baselines or {}), {vehicle: tuple(own) for vehicle, own in windows.items()}
    found = {vehicle: detect(known[vehicle], own) for vehicle, own in every.items() if vehicle in known}
    detections = {vehicle: detection for vehicle, detection in found.items() if detection is not None}
    # Estimates of a vehicle whose file a calibration completed are relative to that file.
    completed = {vehicle for vehicle, baseline in known.items() if baseline.vehicle_file}
    trusted = {f"{vehicle} (inspected)": tuple(own) for vehicle, own in (healthy or {}).items()}
    usable = usable_windows({vehicle: own for vehicle, own in every.items() if vehicle not in completed} | trusted)
    verdicts: dict[str, Real] = {}
    if len(usable) > MIN_VEHICLES:
        fleet = Fleet.of(usable)
        for vehicle in (vehicle for vehicle in usable if vehicle not in known | trusted.keys()):
            others = (other for other in usable if other not in {vehicle, f"{vehicle} (inspected)"})
            comparison = TypeComparison.of(fleet.type_of(others, name="", healthy=trusted), usable[vehicle])
            verdicts[vehicle] = comparison.probabilities()
            detections[vehicle] = comparison.detection(
                times=np.array([usable[vehicle][-1].time]),
                evidence=np.array([comparison.candidates()[0].log_evidence]),
                threshold=float(-np.log(rate)),
            )
    if not detections:
        raise DataError(
            f"{len(usable)} vehicles have usable windows, and {MIN_VEHICLES + 1} are needed: give more vehicles"
        )
    chosen = false_discoveries([detection.e_value for detection in detections.values()], rate=rate)
    ranked = [
        RankedVehicle(
            vehicle,
            detection,
            is_discovery=number in chosen,
            n_windows=len(usable.get(vehicle, detection.times)),
            information=float(entr(verdicts[vehicle]).sum()) if vehicle in verdicts else 0.0,
            probability=1 - float(verdicts[vehicle][0]) if vehicle in verdicts else 0.0,
        )
        for number, (vehicle, detection) in enumerate(detections.items())
    ]
    return tuple(sorted(ranked, key=lambda one: -one.detection.e_value))


def to_inspect(ranked: Iterable[RankedVehicle]) -> RankedVehicle | None:
    """Return the vehicle whose inspection is expected to teach most; None where all are known or have a baseline.

    Parameters
    ----------
    ranked
        Vehicles of one type, from `rank_fleet`. Those that are reported to deviate are left out: an alert asks for
        their inspection already.

    Notes
    -----
    An inspection states what a vehicle is: as its type, or with one of the changes. What is expected to be learnt from
    its verdict v about all vehicles and the type together, the mutual information of v with (h_1 .. h_n, centre,
    scatter), is the entropy of v, -sum p ln p over its outcomes: as v is one of the h_i, nothing is left open about it.
    It is largest for the vehicle of which least is known, and nearly 0 for one that surely is as its type.

    References
    ----------
    D. V. Lindley, On a measure of the information provided by an experiment, Annals of Mathematical Statistics 27
    (1956) 986-1005. M. C. Shewry, H. P. Wynn, Maximum entropy sampling, Journal of Applied Statistics 14 (1987)
    165-170.

    Examples
    --------
    >>> to_inspect([]) is None
    True
    """
    open_ones = [one for one in ranked if one.information > 0 and not one.is_discovery]
    return max(open_ones, key=lambda one: one.information, default=None)
