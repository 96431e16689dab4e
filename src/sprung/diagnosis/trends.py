"""Growth of a change after its onset, and the time until it reaches a limit: prognostic assessment of ISO 13374."""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.changes import Candidate, Size, size_of
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.ratios import Compared, compare
from sprung.likelihood.plate_test import PLATE
from sprung.modal import INTERVAL_95


@dataclass(frozen=True, slots=True)
class TrendRules:
    """When a change grows, and when it is due."""

    #: Relative change at which a part is due, for forecasts.
    limit: float = 0.3
    #: Smallest number of windows for a trend.
    min_windows: int = 4
    #: Standard deviations of its slope that a trend must differ from 0 by, for the end of the line to be the size.
    clearly: float = 2.6


RULES = TrendRules()


@dataclass(frozen=True, slots=True)
class Trend:
    """Growth of a change after its onset.

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
class PhaseShift:
    """Phase shift that a suspension tester would measure at the corner of a damper, after the last window.

    Parameters
    ----------
    degrees, interval
        Phase shift and its 95 % interval [degrees]; a suspension below 35 degrees fails (EGEA SPECSUS2018).
    hours_to_limit
        Hours from the last window until it falls to 35 degrees: earliest and latest, 0 if it has; None without a trend
        towards it.
    """

    degrees: float
    interval: tuple[float, float]
    hours_to_limit: tuple[float, float] | None


@dataclass(frozen=True, slots=True)
class _Line:
    """Line through the sizes of windows [ln], over time [h]: slope, size at the last window, and their deviations."""

    slope: float
    slope_std: float
    last: float
    last_std: float

    @property
    def trend(self) -> Trend:
        """Growth of the change, and when the ends of the line's interval reach the limit."""
        half, doubt = INTERVAL_95 * self.slope_std, INTERVAL_95 * self.last_std
        interval = self.slope - half, self.slope + half
        low, high = map(float, np.expm1(interval))
        if interval[0] * interval[1] <= 0 or self.last * self.slope <= 0:
            return Trend(float(np.expm1(self.slope)), (low, high), None)
        distance = abs(np.log1p(np.copysign(RULES.limit, self.slope))) - abs(self.last)
        return Trend(float(np.expm1(self.slope)), (low, high), _hours(distance, doubt, interval))


def trend(
    candidate: Candidate, observations: Sequence[Observation], baseline: Baseline, *, since: float, number: int = 0
) -> Trend | None:
    """Return the growth of a change after its onset.

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
    number
        Number of the change of a pair, 0 or 1; 0 otherwise.

    Returns
    -------
    Trend or None
        Trend; None with fewer than four windows since the onset, and for an unmodelled change, which has no single
        size.

    Notes
    -----
    Residuals r = D (a + b tau) + U m + e of the windows since the onset, with the time tau after the last window, the
    directions D of the changes and the errors m of the baseline's means and slopes, by generalised least squares: a is
    the size at the last window, b the slope. Windows before the onset are left out: what grows is not 0 before it. The
    observed scatter is used if it exceeds that of the windows. There is no trend if 0 lies within the interval of the
    slope. The earliest and latest times are those at which the ends of the line's interval reach the limit.

    References
    ----------
    A. C. Aitken, On least squares and linear combination of observations, Proceedings of the Royal Society of
    Edinburgh 55 (1936) 42-48 (generalised least squares).

    Examples
    --------
    A spring that loses 5 % of its stiffness in every window of ten minutes, from the ninth one on:

    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((14, 12))
    >>> values[8:, 0] += np.log(0.95) * np.arange(1, 7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> baseline = sprung.learn(windows[:8])
    >>> candidate = sprung.diagnosis.detect(baseline, windows[8:]).candidates[0]
    >>> growth = trend(candidate, windows, baseline, since=windows[8].time)
    >>> round(growth.per_hour, 1), growth.interval[0] < 0.95**6 - 1 < growth.interval[1]
    (-0.3, True)
    """
    lines = _lines(candidate, _compared(observations, baseline), baseline, since=since)
    return lines[number].trend if lines else None


def current_sizes(candidate: Candidate, observations: Sequence[Observation], baseline: Baseline) -> tuple[Size, ...]:
    """Return the sizes of the changes after the last window.

    Parameters
    ----------
    candidate
        Hypothesis of the change.
    observations
        Windows in the order of time.
    baseline
        Normal state of the vehicle.

    Returns
    -------
    tuple of Size
        The end of the line through the windows since the onset where its slope differs from 0 by 2.6 standard
        deviations (99 %); the candidate's size, which is steady after the onset, otherwise.
    """
    windows = _compared(observations, baseline)
    lines = _lines(candidate, windows, baseline, since=candidate.onset)
    if not lines:
        return candidate.sizes
    model_error = float(np.median([window.model_error for window in windows]))
    return tuple(
        size_of(change.component, line.last, line.last_std, model_error)
        if abs(line.slope) > RULES.clearly * line.slope_std
        else size
        for change, line, size in zip(candidate.hypothesis.changes, lines, candidate.sizes, strict=True)
    )


def phase_shift(corners: Collection[str], observations: Iterable[Observation], *, since: float) -> PhaseShift | None:
    """Return the phase shift of the weakest of some corners after the onset of a change, and when it reaches the limit.

    Parameters
    ----------
    corners
        Corners whose dampers have changed.
    observations
        Windows in the order of time.
    since
        Onset of the change [s].

    Returns
    -------
    PhaseShift or None
        Mean of the last windows since the onset that state it without a break, or the end of the line through them
        where it falls by 2.6 standard deviations of its slope; None if the last window does not state it.

    Notes
    -----
    Least squares. The friction that a window does not determine is wrong alike in all of them: the standard deviation
    of their own mean is not divided by their number.
    """
    later = [window for window in observations if window.time >= since and window.is_valid]
    courses = []
    for corner in corners:
        first = max((k + 1 for k, window in enumerate(later) if corner not in window.phase_shifts), default=0)
        known = later[first:]
        if known:
            courses.append(np.array([(window.time, *window.phase_shifts[corner]) for window in known]))
    if not courses:
        return None
    seconds, values, stds = min(courses, key=lambda course: float(course[:, 1].mean())).T
    level, std, hours = float(values.mean()), float(stds.mean()), None
    times = (seconds - seconds[-1]) / 3600
    if len(values) >= RULES.min_windows and times.any():
        (slope, last), scatter = np.polyfit(times, values, 1, cov=True)
        slope_std = float(np.sqrt(scatter[0, 0]))
        if slope < -RULES.clearly * slope_std:
            half = INTERVAL_95 * slope_std
            level, std = float(last), float(np.hypot(std, np.sqrt(scatter[1, 1])))
            hours = _hours(level - PLATE.phase_limit, INTERVAL_95 * std, (slope - half, slope + half))
    return PhaseShift(level, (level - INTERVAL_95 * std, level + INTERVAL_95 * std), hours)


def _hours(distance: float, doubt: float, slope: tuple[float, float]) -> tuple[float, float]:
    """Return the earliest and the latest time [h] at which a line has covered a distance that is uncertain."""
    slow, fast = sorted(map(abs, slope))
    return max(0.0, float(distance - doubt)) / fast, max(0.0, float(distance + doubt)) / slow


def _compared(observations: Sequence[Observation], baseline: Baseline) -> list[Compared]:
    """Return the windows with the baseline's components, against it."""
    return [compare(baseline, window) for window in observations if window.components == baseline.components]


def _lines(candidate: Candidate, windows: Sequence[Compared], baseline: Baseline, *, since: float) -> list[_Line]:
    """Return the line of each change of a candidate; none with too few windows or times, or no size."""
    directions = candidate.hypothesis.directions(baseline.components)
    windows = [window for window in windows if window.time >= since]
    hours = np.array([window.time - windows[-1].time for window in windows]) / 3600
    if len(windows) < RULES.min_windows or not len(directions) or not hours.any():
        return []
    lines = [np.kron([1.0, hour], directions.T) for hour in hours]
    identity = np.eye(len(baseline.components))
    columns = [np.hstack([line, np.kron(w.units, identity)]) for line, w in zip(lines, windows, strict=True)]
    n_line = lines[0].shape[1]
    information = sum(x.T @ w.information @ x for x, w in zip(columns, windows, strict=True))
    information[n_line:, n_line:] += np.linalg.inv(baseline.doubt_beyond())
    pull = sum(x.T @ w.information @ w.residual for x, w in zip(columns, windows, strict=True))
    covariance = np.linalg.inv(information)
    estimate = covariance @ pull
    away = [w.residual - x @ estimate for x, w in zip(columns, windows, strict=True)]
    squares = float(sum(w.residual @ w.information @ w.residual for w in windows) - pull @ estimate)
    variance = (baseline.degrees_of_freedom + squares) / (baseline.degrees_of_freedom + len(windows) * len(identity))
    count = len(directions)
    result = []
    for k, direction in enumerate(directions):
        own = [
            (direction @ w.information @ r) ** 2 / (direction @ w.information @ direction)
            for w, r in zip(windows, away, strict=True)
        ]
        scatter = max(variance, sum(own) / (len(own) - 2))
        last_std, slope_std = (float(np.sqrt(scatter * covariance[row, row])) for row in (k, count + k))
        result.append(_Line(float(estimate[count + k]), slope_std, float(estimate[k]), last_std))
    return result
