"""Change tests: is anything different from the baseline, where, how much, and since when."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from sprung._checks import check_number
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.observation import Observation

Real = NDArray[np.float64]
_Span = tuple[float, float]

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
    name
        "front_left.spring", "front.spring" (both of an axle), "all.spring" or "something_else".
    kind
        "single", "axle", "all" or "else".
    """

    name: str
    kind: str

    def parts(self, components: tuple[str, ...]) -> tuple[str, ...]:
        """Return which of the components it moves together; none for something else."""
        if self.kind == "else":
            return ()
        owner, component = self.name.split(".")
        owners = {"single": {owner}, "axle": {f"{owner}_left", f"{owner}_right"}}.get(self.kind)
        return tuple(
            name
            for name in components
            if name.split(".")[1] == component and (owners is None or name.split(".")[0] in owners)
        )


@dataclass(frozen=True, slots=True)
class Candidate:
    """One hypothesis with its evidence at its best onset.

    Parameters
    ----------
    hypothesis
        Which.
    log_evidence
        ln of the likelihood with it over that without any change, size and onset averaged over.
    change
        Relative: -0.2 is a loss of a fifth.
    interval
        Of the change, 95 %: of chance, and of what a linear and imperfect vehicle makes of it.
    score
        Size over its standard deviation.
    onset, onset_interval
        Time of the first changed window, and 95 % of its posterior [s].
    """

    hypothesis: Hypothesis
    log_evidence: float
    change: float
    interval: tuple[float, float]
    score: float
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
    threshold
        ln of the value from which on it alarms.
    candidates
        All hypotheses, the best first.
    first_alarm
        Time of the end of the window with which it alarmed first [s]; None: never.
    """

    times: Real
    evidence: Real
    threshold: float
    candidates: tuple[Candidate, ...]
    first_alarm: float | None

    @property
    def is_alarm(self) -> bool:
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
    Residual of window w: r_w = m + d size 1[w >= onset] + g_w + e_w with m ~ N(0, (C + Q) / N) the baseline's own
    error, g_w ~ N(0, Q) what moves corners together and e_w ~ N(0, S_w) the fit's. For every onset and hypothesis the
    likelihood ratio with the size's prior N(0, 0.15^2) averaged over has the mean 1 without a change (an e-value); the
    sum over onsets of their mean over hypotheses is an e-detector (Shiryaev-Roberts), whose mean time to a false alarm
    is at least its threshold in windows.

    References
    ----------
    J. Shin, A. Ramdas, A. Rinaldo, E-detectors: a nonparametric framework for sequential change detection (2024).
    """
    check_number("false_alarms", false_alarms, above=0)
    check_number("windows_per_day", windows_per_day, above=0)
    telling = [one for one in observations if one.can_tell and one.components == baseline.components]
    if not telling:
        return None
    hypotheses = _hypotheses(baseline.components)
    residuals = np.array([baseline.residual(one) for one in telling])
    shares = np.log([_SHARES[one.kind] / sum(o.kind == one.kind for o in hypotheses) for one in hypotheses])
    informations = [_inverse(_own(baseline, one) + baseline.nuisance) for one in telling]
    start = _baseline_information(baseline)
    evidence = np.empty(len(telling))
    last: list[list[tuple[float, float, float]]] = []
    evidence[: len(known)] = known[: len(telling)]
    for end in range(min(len(known) + 1, len(telling)), len(telling) + 1):
        table = _evidence(residuals[:end], informations[:end], start, hypotheses, baseline.components)
        evidence[end - 1] = logsumexp(
            [[one[0] + share for one, share in zip(row, shares, strict=True)] for row in table]
        )
        last = table
    threshold = float(np.log(windows_per_day / false_alarms))
    logs = np.array([[one[0] for one in row] for row in last])
    totals = logsumexp(logs, axis=0) - np.log(len(logs))
    times = np.array([one.time for one in telling])
    misfit = float(np.median([one.conditions.get("imperfection", 0.0) for one in telling]))
    candidates = []
    for k, hypothesis in enumerate(hypotheses):
        best = int(np.argmax(logs[:, k]))
        _, size, deviation = last[best][k]
        onset = float(times[best]), _interval(logs[:, k], times)
        candidates.append(_candidate(hypothesis, float(totals[k]), (size, deviation), misfit, onset))
    order = np.argsort(-(totals + shares))
    above = np.flatnonzero(evidence >= threshold)
    return Detection(
        times=times,
        evidence=evidence,
        threshold=threshold,
        candidates=tuple(candidates[k] for k in order),
        first_alarm=float(times[above[0]]) if above.size else None,
    )


def false_discoveries(evidence: Sequence[float], *, rate: float = 0.05) -> list[int]:
    """Return which of many vehicles have changed, so that at most a share `rate` of them is named falsely in the mean.

    Parameters
    ----------
    evidence
        ln of an e-value of each vehicle, such as the largest `Candidate.log_evidence`.
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


def _hypotheses(components: tuple[str, ...]) -> list[Hypothesis]:
    """Return single components, both of an axle, all of a kind, and something else."""
    axles = {f"{name.split('.')[0].rsplit('_', 1)[0]}.{name.split('.')[1]}" for name in components}
    kinds = {name.split(".")[1] for name in components}
    return [
        *(Hypothesis(name, "single") for name in components),
        *(Hypothesis(name, "axle") for name in sorted(axles)),
        *(Hypothesis(f"all.{kind}", "all") for kind in sorted(kinds)),
        Hypothesis("something_else", "else"),
    ]


def _direction(hypothesis: Hypothesis, components: tuple[str, ...]) -> Real:
    """Return which components a hypothesis moves."""
    parts = hypothesis.parts(components)
    return np.array([float(name in parts) for name in components])


def _own(baseline: Baseline, observation: Observation) -> Real:
    """Return the covariance of one window's estimates, at least as wide as the baseline's windows were."""
    if baseline.n_windows == 0:
        return observation.covariance
    own = np.sqrt(np.maximum(np.diag(observation.covariance) / np.diag(baseline.covariance), 1.0))
    return np.asarray(baseline.covariance * np.outer(own, own))


def _baseline_information(baseline: Baseline) -> Real:
    """Return the information about the baseline's own error."""
    if baseline.n_windows == 0:
        return np.asarray(np.linalg.inv(baseline.covariance + baseline.nuisance))
    return np.asarray(baseline.n_windows * np.linalg.inv(baseline.covariance + baseline.nuisance))


def _evidence(
    residuals: Real,
    informations: Sequence[Real],
    start: Real,
    hypotheses: Sequence[Hypothesis],
    components: tuple[str, ...],
) -> list[list[tuple[float, float, float]]]:
    """Return for each onset and hypothesis ln evidence, size and its standard deviation (ln values)."""
    table = []
    before_information, before_sum = start, np.zeros(len(components))
    after_information = np.sum(informations, axis=0)
    after_sum = np.sum([info @ r for info, r in zip(informations, residuals, strict=True)], axis=0)
    for information, residual in zip(informations, residuals, strict=True):
        before, after = _inverse(before_information), _inverse(after_information)
        contrast = after @ after_sum - before @ before_sum
        spread = before + after
        weight = _inverse(spread)
        row = []
        for hypothesis in hypotheses:
            if hypothesis.kind == "else":
                row.append((_something(contrast, spread), 0.0, 0.0))
                continue
            d = _direction(hypothesis, components)
            size_information, score = float(d @ weight @ d), float(d @ weight @ contrast)
            total = size_information + 1 / _SIZE**2
            log = -0.5 * np.log(size_information * _SIZE**2 + 1) + score**2 / (2 * total)
            row.append((float(log), score / total, float(1 / np.sqrt(total))))
        table.append(row)
        before_information = before_information + information
        before_sum = before_sum + information @ residual
        after_information = after_information - information
        after_sum = after_sum - information @ residual
        if len(table) == len(residuals):
            break
    return table


def _inverse(matrix: Real) -> Real:
    """Return the inverse."""
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _something(contrast: Real, spread: Real) -> float:
    """Return ln evidence that every component moved by itself."""
    wider = spread + _ELSE**2 * np.eye(len(contrast))
    squares = contrast @ np.linalg.solve(spread, contrast) - contrast @ np.linalg.solve(wider, contrast)
    return float((squares - np.linalg.slogdet(wider)[1] + np.linalg.slogdet(spread)[1]) / 2)


def _candidate(
    hypothesis: Hypothesis, log: float, found: tuple[float, float], misfit: float, onset: tuple[float, _Span]
) -> Candidate:
    """Return the candidate of a hypothesis, its size and the standard deviation of that [ln values]."""
    size, deviation = found
    scale = np.hypot(_SCALE.get(hypothesis.name.rsplit(".", maxsplit=1)[-1], 0.05), _OF_MISFIT * misfit)
    away = _Z * np.hypot(deviation, scale * size)
    score = abs(size) / deviation if deviation else 0.0
    interval = float(np.expm1(size - away)), float(np.expm1(size + away))
    return Candidate(hypothesis, log, float(np.expm1(size)), interval, score, *onset)


def _interval(logs: Real, times: Real) -> tuple[float, float]:
    """Return 95 % of the posterior of the onset."""
    weights = np.exp(logs - logsumexp(logs))
    total = np.cumsum(weights)
    first, last = np.searchsorted(total, [0.025, 0.975])
    return float(times[min(first, len(times) - 1)]), float(times[min(last, len(times) - 1)])
