"""What loads and roads may change without a fault: springs on their bump stops, and the error of the vehicle file."""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

import numpy as np

from sprung._arrays import Real
from sprung._display import counted
from sprung.diagnosis.baseline import Baseline, unequal_stiffening
from sprung.diagnosis.changes import Candidate, ChangeDetector
from sprung.diagnosis.findings import SEVERITIES, Finding
from sprung.diagnosis.learning import learn
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.scatter import directions
from sprung.errors import DataError


@dataclass(frozen=True, slots=True)
class LoadSettings:
    """How much parts may read differently under loads and on roads that the baseline has not met."""

    #: ln evidence that is clear, odds of 20 to 1: of one hypothesis over another, and over the threshold of an alert.
    clear: float = float(np.log(20.0))
    #: ln of a spring's stiffness over the rise of its stiffening inwards, and its standard deviation: of a stop beyond
    #: a gap g it is the ratio of Mills at g over the RMS of travel, 1.25 at no gap and 0.66 at one RMS.
    excess: float = 1.0
    excess_std: float = 0.5
    #: Standard deviation of ln of a damper over the largest of these rises: behind a corner that had sunk on its stop
    #: one read 11 % softer.
    of_damper: float = 0.2
    #: Standard deviation over the model error of ln(left / right) and ln(front / rear) of each kind of part, and of
    #: ln of an anti-roll bar.
    left_right: float = 0.5
    front_rear: float = 1.0
    bars: float = 2.0
    #: Standard deviation over the corners of the rise of their stiffening above which a note states it.
    noted: float = 0.1


SETTINGS = LoadSettings()


@dataclass(frozen=True, eq=False)
class Stops:
    """How springs stiffen inwards, as on their bump stops, compared with the baseline.

    Parameters
    ----------
    candidates
        Corners, axles and all corners, the most probable first, by the change test of the parts; none where the
        stiffening of the windows or of the baseline is unknown.
    windows
        Windows with a known stiffening.
    baseline
        Baseline of the vehicle.
    """

    candidates: tuple[Candidate, ...]
    windows: Sequence[Observation]
    baseline: Baseline

    @cached_property
    def rises(self) -> Real:
        """Rise of the stiffening over the baseline's at each component above the mean of all corners, at least 0.

        Shape (components,): in the mean of the windows by what they show of springs.
        """
        first, parts = _learnt(self.baseline.stiffenings), self.baseline.components
        if first is None or not self.candidates:
            return np.zeros(len(parts))
        is_spring = [part.kind == "spring" for part in parts]
        weights = [1 / np.diag(self.baseline.scatter_of(window))[is_spring].mean() for window in self.windows]
        later = (window.of_stiffening() for window in self.windows)
        risen = np.average([first.residual(one) for one in later if one is not None], axis=0, weights=weights)
        by_part = dict(zip(first.components, np.maximum(risen - risen.mean(), 0.0).tolist(), strict=True))
        return np.array([by_part.get(part, 0.0) for part in parts])


def stops_of(observations: Sequence[Observation], baseline: Baseline) -> Stops:
    """Return how springs stiffen inwards in windows, compared with the baseline.

    Parameters
    ----------
    observations
        Windows in the order of time.
    baseline
        Baseline of the vehicle.
    """
    windows = [window for window in observations if window.is_valid and baseline.has_sensors_of(window)]
    known = [(window, one) for window in windows if (one := window.of_stiffening()) is not None]
    first = _learnt(baseline.stiffenings)
    # The evidence after earlier windows, which takes longest, is not asked for.
    later = [one for _, one in known]
    candidates = () if first is None else ChangeDetector.resumed(first, later, np.zeros(len(later))).candidates
    chosen = tuple(one for one in candidates if one.hypothesis.scope in {"single", "axle", "all"})
    return Stops(chosen, [window for window, _ in known], baseline)


@lru_cache(maxsize=16)
def _learnt(stiffenings: tuple[Observation, ...]) -> Baseline | None:
    """Return the baseline of the stiffening of springs; None from too few windows."""
    try:
        return learn(stiffenings)
    except DataError:
        return None


def in_doubt(baseline: Baseline, stops: Stops, findings: Sequence[Finding]) -> Baseline:
    """Return a baseline that allows for what loads and roads may change in what findings name.

    Parameters
    ----------
    baseline
        Baseline of the vehicle.
    stops
        How springs stiffen inwards.
    findings
        Findings of the test of the parts.

    Notes
    -----
    The mean of springs that stiffen inwards more than others is higher, and all the less certain. Where no single part
    explains the change, or an anti-roll bar is named, the mean is less certain by the error of the vehicle file, too:
    parts that a load or road moves together by a share of it are no change of the vehicle. Tyres alone have nothing to
    do with bump stops; dampers of all corners read otherwise by a share of what one of them meets more than others.
    """
    if all(finding.component.endswith("tyre") for finding in findings):
        return baseline
    size = len(baseline.components)
    is_damper = np.array([part.kind == "damper" for part in baseline.components])
    doubt = np.diag(SETTINGS.of_damper**2 * is_damper * stops.rises.max(initial=0.0) ** 2)
    if not all(finding.component.endswith(("damper", "tyre")) for finding in findings):
        doubt = doubt + np.diag((SETTINGS.excess_std * stops.rises) ** 2)
    if any(finding.component in {"unmodelled", "anti_roll"} for finding in findings):
        is_bar = np.array([part.kind == "anti_roll" for part in baseline.components])
        pairs, ends, _ = directions(baseline.components)
        pairs, ends = (rows[~np.any(rows[:, is_bar], axis=1)] for rows in (pairs / 2, ends))
        shares = ((SETTINGS.left_right, pairs), (SETTINGS.front_rear, ends), (SETTINGS.bars, np.diag(1.0 * is_bar)))
        doubt = doubt + sum((share * baseline.model_error) ** 2 * rows.T @ rows for share, rows in shares)
    if baseline.version == 0 or not doubt.any():
        return baseline
    covariance = np.linalg.inv(baseline.information)
    covariance[:size, :size] += doubt
    mean = baseline.mean + SETTINGS.excess * stops.rises
    return replace(baseline, information=np.linalg.inv(covariance), mean=mean)


def stop_notes(baseline: Baseline, observations: Sequence[Observation]) -> list[str]:
    """Return a note on windows that say little about springs, as some corners meet their bump stops more than others.

    Parameters
    ----------
    baseline
        Baseline of the vehicle.
    observations
        Windows compared.
    """
    count = sum(unequal_stiffening(baseline.stiffenings, window) > SETTINGS.noted**2 for window in observations)
    if not count:
        return []
    return [
        f"in {count} of {counted(len(observations), 'window')} some corners meet their bump stops more than others, as "
        "under a load: such a window says little about springs"
    ]


def on_bump_stop(
    stops: Stops, threshold: float, observations: Sequence[Observation], baseline: Baseline
) -> tuple[Finding, ...]:
    """Return a finding about the spring of a corner that meets its bump stop more than in the baseline, and it alone.

    Parameters
    ----------
    stops
        How springs stiffen inwards.
    threshold
        ln evidence of an alert.
    observations
        Windows compared.
    baseline
        Baseline of the vehicle.

    Notes
    -----
    The rate of false alarms is a twentieth of that of the parts. A load lowers both sides of an axle, or all corners:
    the other corners and the axles must explain the stiffening clearly less well. One on the side of the corner moves
    the fitted load there beyond that of the baseline, which a sagged spring does not.
    """
    if not stops.candidates:
        return ()
    best, second, *_ = stops.candidates
    is_clear = best.log_evidence >= max(threshold, second.log_evidence) + SETTINGS.clear
    if not is_clear or best.hypothesis.scope != "single" or best.change is None or best.change < 0:
        return ()
    name = "payload_y_moment"
    moments = [window.conditions[name] for window in observations if name in window.conditions]
    if moments and name in baseline.ranges:
        left = 1.0 if best.hypothesis.corner.endswith("left") else -1.0
        if left * float(np.mean(moments)) > max(left * end for end in baseline.ranges[name]):
            return ()
    onset = best.onset, best.onset_interval, ""
    return (Finding(best.hypothesis.corner, "spring", None, None, None, *SEVERITIES[1][1:], *onset, None),)
