"""Corners that meet their bump stops: by how their springs stiffen inwards, through the change test of the parts."""

from collections.abc import Sequence

import numpy as np

from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.changes import Candidate, detect
from sprung.diagnosis.findings import SEVERITIES, Finding
from sprung.diagnosis.learning import learn
from sprung.diagnosis.observation import Observation
from sprung.errors import DataError

#: Odds of 20 to 1, in ln of evidence: of what is clear, and by which a finding of this test must exceed the threshold.
CLEAR = float(np.log(20.0))


def detection_of_stiffening(observations: Sequence[Observation], baseline: Baseline) -> list[Candidate]:
    """Return by which corners springs stiffen inwards more than in the baseline, as on their bump stops.

    Parameters
    ----------
    observations
        Windows in the order of time.
    baseline
        Baseline of the vehicle.

    Returns
    -------
    list of Candidate
        Corners, axles and all corners, the most probable first, by the change test of the parts; empty where the
        stiffening of the windows or of the baseline is unknown.
    """
    windows = [window for window in observations if window.is_valid and baseline.has_sensors_of(window)]
    later = [one for one in (window.of_stiffening() for window in windows) if one is not None]
    try:
        detection = detect(learn(baseline.stiffenings), later)
    except DataError:  # too few of them in the baseline
        return []
    candidates = () if detection is None else detection.candidates
    return [one for one in candidates if one.hypothesis.scope in {"single", "axle", "all"}]


def on_loaded_stops(findings: Sequence[Finding], stops: Sequence[Candidate], threshold: float) -> str:
    """Return why findings that name a spring are not stated: corners on their bump stops under a load; else empty.

    Parameters
    ----------
    findings
        Findings of the test of the parts.
    stops
        Corners whose springs stiffen, by `detection_of_stiffening`.
    threshold
        ln evidence of an alert.

    Notes
    -----
    A spring reads stiffer where its corner meets its stop, by odds of 20 to 1. Where both sides of an axle do so by the
    evidence of an alert, the linear fit is wrong at the springs of the other corners, too.
    """
    springs = [one for one in findings if one.component == "spring"]
    if not springs or not stops or (stops[0].change or 0.0) < 0 or stops[0].log_evidence < CLEAR:
        return ""
    where = stops[0].hypothesis
    is_certain = where.scope == "axle" and stops[0].log_evidence >= threshold
    places = [{one.corner, one.corner.split("_")[0], "all"} for one in springs if (one.change or 0.0) > 0]
    if not is_certain and not any(where.corner in place for place in places):
        return ""
    corner = where.corner.replace("_", "-")
    place = (
        f"the {corner} corner meets its bump stop"
        if where.scope == "single"
        else f"{corner} corners meet their bump stops"
    )
    return f"{place} more than in the baseline, as under a load: springs then read differently, and none is named"


def on_bump_stop(stops: Sequence[Candidate], threshold: float) -> tuple[Finding, ...]:
    """Return a finding about the spring of a corner that meets its bump stop more than in the baseline, and it alone.

    Parameters
    ----------
    stops
        Corners whose springs stiffen, by `detection_of_stiffening`.
    threshold
        ln evidence of an alert.

    Notes
    -----
    The rate of false alarms is a twentieth of that of the parts. A load lowers both sides of an axle, or all corners:
    the other corners and the axles must explain the stiffening clearly less well.
    """
    if not stops:
        return ()
    best, second, *_ = stops
    is_clear = best.log_evidence >= max(threshold, second.log_evidence) + CLEAR
    if not is_clear or best.hypothesis.scope != "single" or best.change is None or best.change < 0:
        return ()
    onset = best.onset, best.onset_interval, ""
    return (Finding(best.hypothesis.corner, "spring", None, None, None, *SEVERITIES[1][1:], *onset, None),)
