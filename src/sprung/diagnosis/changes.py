"""Change tests: is anything different from the baseline, where, how much, and since when."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from sprung._arrays import Real
from sprung._checks import check_number
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.observation import Observation
from sprung.vehicles import Component

#: Standard deviation of the size of a fault, ln values, before any window; of something else, per component.
_SIZE, _ELSE = 0.15, 0.04
#: Prior shares of a single component, both of an axle, all corners, and anything else.
_SHARES = {"single": 0.78, "axle": 0.15, "all": 0.02, "else": 0.05}
#: Standard deviation of the size that a linear vehicle makes of a change, relative to it: friction hides part of a
#: change of a damper. An imperfect file adds this share of its misfit. Set on 38 simulated nonlinear cars.
_SCALE = {"spring": 0.025, "damper": 0.05, "tyre": 0.01}
_OF_MISFIT = 0.5
#: Quantile of a 95 % interval.
_Z = 1.96


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """What may have changed.

    Parameters
    ----------
    scope
        "single", "axle" (both sides of it), "all" (corners) or "else".
    corner
        "front_left", "front" for an axle, "all", or "vehicle" for an unmodelled change.
    component
        "spring", "damper" or "tyre"; "unmodelled".
    """

    scope: str
    corner: str
    component: str

    @property
    def name(self) -> str:
        """Such as "front_left.spring", "front.spring" (both of an axle), "all.spring", or "unmodelled"."""
        return self.component if self.scope == "else" else f"{self.corner}.{self.component}"

    def parts(self, components: tuple[Component, ...]) -> tuple[Component, ...]:
        """Return which of the components it moves together; none for an unmodelled change."""
        return tuple(
            one for one in components if one.kind == self.component and self.corner in {one.corner, one.axle, "all"}
        )


@dataclass(frozen=True, slots=True)
class Candidate:
    """One hypothesis with its evidence, and size and onset where it is likeliest.

    Parameters
    ----------
    hypothesis
        Which.
    log_evidence
        ln of the likelihood with it over that without any change, size and onset averaged over.
    explained
        By how much it lowers the sum of squares of the windows' residuals, in variances.
    change
        Relative: -0.2 is a loss of a fifth; None for something else, which has no one size.
    interval
        Of the change, 95 %: of chance, and of what a linear and imperfect vehicle makes of it.
    score
        Size over its standard deviation.
    onset, onset_interval
        Time of the first changed window, and from when to when it may be, 95 % of its posterior [s].
    """

    hypothesis: Hypothesis
    log_evidence: float
    explained: float
    change: float | None
    interval: tuple[float, float] | None
    score: float | None
    onset: float
    onset_interval: tuple[float, float]


@dataclass(frozen=True, eq=False, slots=True)
class Detection:
    """What a sequence of windows says against a baseline.

    Parameters
    ----------
    times
        Of the windows that could tell [s].
    evidence
        ln of the e-detector after each of them.
    e_value
        ln of the mean over onsets of the likelihood ratio after all of them: an e-value, see `false_discoveries`.
    threshold
        ln of the value from which on it alarms.
    candidates
        All hypotheses, the best first.
    first_alert
        Time at which the window begins with which it alarmed first [s]; None: never.
    """

    times: Real
    evidence: Real
    e_value: float
    threshold: float
    candidates: tuple[Candidate, ...]
    first_alert: float | None

    @property
    def is_alert(self) -> bool:
        """Whether the last window leaves an alarm standing."""
        return bool(self.evidence.size and self.evidence[-1] >= self.threshold)


def detect(
    baseline: Baseline,
    observations: Sequence[Observation],
    *,
    false_alarms: float = 1e-3,
    windows_per_day: float = 48.0,
    known: Sequence[float] = (),
) -> Detection | None:
    """Test a sequence of windows against a baseline.

    Parameters
    ----------
    baseline
        What is normal.
    observations
        In the order of time; those that cannot tell are left out.
    false_alarms
        Rate of false alarms per vehicle and day of a healthy vehicle.
    windows_per_day
        Windows in a day of driving.
    known
        Evidence after the first windows, from an earlier call with them: not computed again.

    Returns
    -------
    Detection or None
        None where no window can tell.

    Notes
    -----
    Residual of window w under its conditions u_w (1, then units away from the middle of those that taught):
    r_w = (m + B u_w) + d size 1[w >= onset] + g_w + e_w. The errors m and B of the baseline's means and slopes have its
    information, g_w ~ N(0, Q) moves corners together, e_w ~ N(0, S_w) is the fit's; one scale of all covariances is
    known as the windows that taught tell it, and as those tested do: a likelihood of Student's. For every onset and
    hypothesis the likelihood ratio with the size's prior N(0, 0.15^2) averaged over has the mean 1 without a change (an
    e-value); the sum over onsets of their mean over hypotheses is an e-detector (Shiryaev-Roberts), whose mean time to
    a false alarm is at least its threshold in windows. Sizes are those of most likelihood, without that prior.

    References
    ----------
    J. Shin, A. Ramdas, A. Rinaldo, E-detectors: a nonparametric framework for sequential change detection (2024).
    """
    check_number("false_alarms", false_alarms, above=0)
    check_number("windows_per_day", windows_per_day, above=0)
    telling = [one for one in observations if one.is_conclusive and one.components == baseline.components]
    if not telling:
        return None
    hypotheses = _hypotheses(baseline.components)
    shares = np.log([_SHARES[one.scope] / sum(o.scope == one.scope for o in hypotheses) for one in hypotheses])
    windows = _Windows(baseline, telling)
    evidence = np.empty(len(telling))
    evidence[: len(known)] = known[: len(telling)]
    for end in range(min(len(known) + 1, len(telling)), len(telling) + 1):
        table = windows.table(end, hypotheses)
        evidence[end - 1] = logsumexp(table.logs + shares)
    threshold = float(np.log(windows_per_day / false_alarms))
    totals = logsumexp(table.logs, axis=0) - np.log(len(telling))
    times = np.array([one.time for one in telling])
    misfit = float(np.median([one.conditions.get("model_error", 0.0) for one in telling]))
    candidates = [_candidate(one, row, table, times, misfit) for row, one in enumerate(hypotheses)]
    above = np.flatnonzero(evidence >= threshold)
    return Detection(
        times=times,
        evidence=evidence,
        e_value=float(evidence[-1] - np.log(len(telling))),
        threshold=threshold,
        candidates=tuple(candidates[row] for row in np.argsort(-(totals + shares))),
        first_alert=float(times[above[0]]) if above.size else None,
    )


def false_discoveries(evidence: Sequence[float], *, rate: float = 0.05) -> list[int]:
    """Return which of many vehicles have changed, so that at most a share `rate` of them is named falsely in the mean.

    Parameters
    ----------
    evidence
        ln of an e-value of each vehicle: `Detection.e_value`.
    rate
        Share of false discoveries.

    Notes
    -----
    e-BH (Wang and Ramdas, 2022): valid under any dependence of the vehicles.
    """
    check_number("rate", rate, above=0, at_most=1)
    order = np.argsort(-np.asarray(evidence))
    ranked = np.asarray(evidence)[order]
    passing = np.flatnonzero(ranked >= np.log(len(ranked) / rate) - np.log(np.arange(1, len(ranked) + 1)))
    return sorted(int(k) for k in order[: passing[-1] + 1]) if passing.size else []


def _hypotheses(components: tuple[Component, ...]) -> list[Hypothesis]:
    """Return single components, both of an axle, all of a kind, and an unmodelled change."""
    axles = sorted({(one.axle, one.kind) for one in components})
    kinds = sorted({one.kind for one in components})
    return [
        *(Hypothesis("single", one.corner, one.kind) for one in components),
        *(Hypothesis("axle", axle, kind) for axle, kind in axles),
        *(Hypothesis("all", "all", kind) for kind in kinds),
        Hypothesis("else", "vehicle", "unmodelled"),
    ]


def _direction(hypothesis: Hypothesis, components: tuple[Component, ...]) -> Real:
    """Return which components a hypothesis moves."""
    parts = hypothesis.parts(components)
    return np.array([float(name in parts) for name in components])


@dataclass(frozen=True, eq=False, slots=True)
class _Table:
    """What windows say for each onset (rows) and hypothesis, the last of which is something else and has no size."""

    logs: Real
    explained: Real
    sizes: Real
    deviations: Real


class _Windows:
    """Windows against a baseline: what they know of its errors and of a change."""

    def __init__(self, baseline: Baseline, observations: Sequence[Observation]) -> None:
        self._components, self._degrees = baseline.components, baseline.degrees
        self._residuals = np.array([baseline.residual(one) for one in observations])
        self._units = np.array([np.concatenate([[1.0], baseline.units(one)]) for one in observations])
        self._informations = np.array([np.linalg.inv(own_covariance(baseline, one)) for one in observations])
        # What the baseline knows of its own means and slopes.
        self._start = np.kron(baseline.design, np.linalg.inv(baseline.covariance + baseline.nuisance))

    def table(self, end: int, hypotheses: Sequence[Hypothesis]) -> _Table:
        """Return what the windows before `end` say."""
        r, u, W = self._residuals[:end], self._units[:end], self._informations[:end]
        n, p = r.shape
        weighted = np.einsum("wij,wj->wi", W, r)
        between = np.einsum("wa,wij->waij", u, W).reshape(n, -1, p)
        J = self._start + np.einsum("wa,wb,wij->aibj", u, u, W).reshape(self._start.shape)
        errors_of = np.linalg.inv(J)
        pulled = np.einsum("wa,wi->ai", u, weighted).ravel()
        errors = errors_of @ pulled
        left = self._degrees + float(np.sum(r * weighted) - pulled @ errors)
        # Of the windows from each on.
        later, score, moved = (np.cumsum(part[::-1], axis=0)[::-1] for part in (W, weighted, between))
        information = later - moved.swapaxes(-1, -2) @ errors_of @ moved
        score = score - errors @ moved
        directions = np.array([_direction(one, self._components) for one in hypotheses if one.scope != "else"])
        known = np.einsum("hi,wij,hj->wh", directions, information, directions)
        pulls = score @ directions.T
        each = information + np.eye(p) / _ELSE**2
        explained = np.column_stack(
            [pulls**2 / (known + 1 / _SIZE**2), np.einsum("wi,wij,wj->w", score, np.linalg.inv(each), score)]
        )
        volumes = np.column_stack([np.log1p(known * _SIZE**2), np.linalg.slogdet(_ELSE**2 * each)[1]]) / 2
        degrees, rest = self._degrees + n * p, left - explained
        logs = degrees / 2 * np.log(left / rest) - volumes
        return _Table(logs, explained, pulls / known, np.sqrt(rest[:, :-1] / degrees / known))


def own_covariance(baseline: Baseline, observation: Observation) -> Real:
    """Return the covariance of one window's residual, at least as wide as that of the baseline's windows."""
    if baseline.n_windows == 0:
        return observation.covariance + baseline.nuisance
    own = np.sqrt(np.maximum(np.diag(observation.covariance) / np.diag(baseline.covariance), 1.0))
    return baseline.covariance * np.outer(own, own) + baseline.nuisance


def _candidate(hypothesis: Hypothesis, row: int, table: _Table, times: Real, misfit: float) -> Candidate:
    """Return the candidate of a hypothesis."""
    log = float(logsumexp(table.logs[:, row]) - np.log(len(times)))
    best = int(np.argmax(table.logs[:, row]))
    onset = float(times[best]), _interval(table.logs[:, row], times)
    explained = float(table.explained[best, row])
    if hypothesis.scope == "else":
        return Candidate(hypothesis, log, explained, None, None, None, *onset)
    size, deviation = float(table.sizes[best, row]), float(table.deviations[best, row])
    scale = np.hypot(_SCALE.get(hypothesis.component, 0.05), _OF_MISFIT * misfit)
    away = _Z * np.hypot(deviation, scale * size)
    interval = float(np.expm1(size - away)), float(np.expm1(size + away))
    return Candidate(hypothesis, log, explained, float(np.expm1(size)), interval, abs(size) / deviation, *onset)


def _interval(logs: Real, times: Real) -> tuple[float, float]:
    """Return 95 % of the posterior of the onset, which may lie anywhere since the window before began."""
    weights = np.exp(logs - logsumexp(logs))
    first, last = np.searchsorted(np.cumsum(weights), [0.025, 0.975])
    return float(times[max(min(first, len(times) - 1) - 1, 0)]), float(times[min(last, len(times) - 1)])
