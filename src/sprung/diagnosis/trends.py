"""Course of a change after its onset, and the time until it reaches a limit: prognostic assessment of ISO 13374."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.changes import INTERVAL_95, Candidate
from sprung.diagnosis.observation import Observation

#: Relative change at which a part is due, for forecasts.
_LIMIT = 0.3
#: Smallest number of windows for a trend.
_FEWEST = 4


@dataclass(frozen=True, slots=True)
class Trend:
    """Course of a change after its onset.

    Parameters
    ----------
    per_hour, interval
        Relative change per hour of the windows' clock, and its 95 % interval.
    hours_to_limit
        Hours from the last window until the change reaches 30 %: earliest and latest, 0 if it has; None without a trend
        towards it.
    """

    per_hour: float
    interval: tuple[float, float]
    hours_to_limit: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class _Line:
    """Line through the sizes of windows [ln], over time [h]: slope, size at the last window, and their deviations."""

    slope: float
    slope_std: float
    last: float
    last_std: float


def trend(
    candidate: Candidate, observations: Sequence[Observation], baseline: Baseline, *, since: float
) -> Trend | None:
    """Return the course of a change after its onset.

    Parameters
    ----------
    candidate
        Hypothesis of the change.
    observations
        Windows in the order of time.
    baseline
        Normal state of the vehicle.
    since
        Onset of the change [s].

    Returns
    -------
    Trend or None
        Trend; None with fewer than four windows since the onset, and for an unmodelled change, which has no single
        size.

    Notes
    -----
    With d the direction of the change and W the information of a window's residual r, its size is d^T W r / d^T W d
    with the weight d^T W d. A line is fitted to the sizes by weighted least squares; the observed scatter is used if it
    exceeds that implied by the weights. There is no trend if 0 lies within the interval of the slope. The earliest and
    latest times are those at which the ends of the line's interval reach the limit.
    """
    components = baseline.components
    direction = candidate.hypothesis.direction(components)
    later = [window for window in observations if window.time >= since and window.components == components]
    if len(later) < _FEWEST or not direction.any():
        return None
    hours = np.array([observation.time for observation in later]) / 3600
    line = _line(hours, *_sizes(direction, later, baseline))
    half = INTERVAL_95 * line.slope_std
    interval = line.slope - half, line.slope + half
    low, high = map(float, np.expm1(interval))
    return Trend(float(np.expm1(line.slope)), (low, high), _hours_to_limit(line, interval))


def _sizes(direction: Real, observations: Sequence[Observation], baseline: Baseline) -> tuple[Real, Real]:
    """Return the size of the change in each window [ln], and its weight."""
    informations = [np.linalg.inv(baseline.covariance_of(observation)) for observation in observations]
    weights = np.array([direction @ information @ direction for information in informations])
    pulls = [
        direction @ information @ baseline.residual(observation)
        for information, observation in zip(informations, observations, strict=True)
    ]
    return np.array(pulls) / weights, weights


def _line(hours: Real, sizes: Real, weights: Real) -> _Line:
    """Return the line of weighted least squares."""
    away = hours - np.average(hours, weights=weights)
    mean = float(np.average(sizes, weights=weights))
    slope = float(np.sum(weights * away * sizes) / np.sum(weights * away**2))
    scatter = max(1.0, float(np.sum(weights * (sizes - mean - slope * away) ** 2)) / (len(sizes) - 2))
    slope_std = float(np.sqrt(scatter / np.sum(weights * away**2)))
    last_std = float(np.sqrt(scatter / np.sum(weights) + (slope_std * away[-1]) ** 2))
    return _Line(slope, slope_std, float(mean + slope * away[-1]), last_std)


def _hours_to_limit(line: _Line, interval: tuple[float, float]) -> tuple[float, float] | None:
    """Return the earliest and latest time at which the line reaches the limit [h]; None if it does not."""
    if interval[0] * interval[1] <= 0 or line.last * line.slope <= 0:
        return None
    distance = abs(np.log1p(np.copysign(_LIMIT, line.slope))) - abs(line.last)
    doubt = INTERVAL_95 * line.last_std
    fast, slow = max(map(abs, interval)), min(map(abs, interval))
    return max(0.0, float(distance - doubt)) / fast, max(0.0, float(distance + doubt)) / slow
