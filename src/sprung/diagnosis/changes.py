"""Change tests: whether anything differs from the baseline, where, by how much, and since when."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number
from sprung._threads import one_thread
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.detectability import detectable_changes, losses
from sprung.diagnosis.hypotheses import Hypothesis
from sprung.diagnosis.lasting import lasting_evidence
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.ratios import (
    Compared,
    Hypotheses,
    Ratios,
    compare,
    evidence_of,
    ratios_of,
    scores_of,
)
from sprung.modal import INTERVAL_95
from sprung.vehicles import Component

#: Share of the size of a change [ln] that friction hides from a linear model: on 14 faults of two simulated nonlinear
#: cars, sizes were 1 to 6 % (springs), 5 to 11 % (dampers) and -2 to 2 % (tyres) too small.
HIDDEN = {"spring": 0.03, "damper": 0.06, "tyre": 0.0}
#: Time over which `false_discoveries` of the e-values of changes keeps its rate: a year of days of driving.
PATIENCE_DAYS = 365.0
#: Standard deviation of this share.
HIDDEN_STD = {"spring": 0.025, "damper": 0.05, "tyre": 0.012}


@dataclass(frozen=True, slots=True)
class CandidateSettings:
    """Settings of the candidates of a change test."""

    #: Share of the model error that adds to the standard deviation of a size, over the size: of vehicles of a multibody
    #: engine, whose model error is 6 to 7 %, sizes are off by 3 % (dampers and tyres) to 13 % (springs) of themselves.
    of_model_error: float = 1.5
    #: Number of pairs among the candidates: those of the largest likelihood.
    max_pairs: int = 5


CANDIDATES = CandidateSettings()


@dataclass(frozen=True, slots=True)
class Size:
    """Size of the change of one hypothesis, or of one part of a pair.

    Parameters
    ----------
    change
        Relative change: -0.2 is a loss of a fifth.
    interval
        95 % interval of the change: chance, onset, and the error of a linear and imperfect model.
    score
        Size over its standard deviation.
    """

    change: float
    interval: tuple[float, float]
    score: float


@dataclass(frozen=True, slots=True)
class Candidate:
    """One hypothesis with its evidence, and its most likely sizes and onset.

    Parameters
    ----------
    hypothesis
        Part or parts that may have changed.
    log_evidence
        ln of the likelihood with the change over that without any, averaged over sizes and onset.
    explained
        Reduction of the sum of squares of the windows' residuals, in variances.
    sizes
        Sizes of the hypothesis' `changes`: two of a pair, none of an unmodelled change.
    onset, onset_interval
        Time of the first changed window [s], and earliest and latest one, 95 % of its posterior.
    """

    hypothesis: Hypothesis
    log_evidence: float
    explained: float
    sizes: tuple[Size, ...]
    onset: float
    onset_interval: tuple[float, float]

    @property
    def change(self) -> float | None:
        """Relative change; None for a pair or an unmodelled change, which have no single size."""
        return self.sizes[0].change if len(self.sizes) == 1 else None

    @property
    def interval(self) -> tuple[float, float] | None:
        """95 % interval of the change; None without a single size."""
        return self.sizes[0].interval if len(self.sizes) == 1 else None

    @property
    def score(self) -> float | None:
        """Size over its standard deviation; None without a single size."""
        return self.sizes[0].score if len(self.sizes) == 1 else None


@dataclass(frozen=True, eq=False, slots=True)
class Detection:
    """Evidence of a change in a sequence of windows.

    Parameters
    ----------
    times
        Times of the windows compared with the baseline [s].
    evidence
        ln of the e-detector after each of them.
    e_value
        ln of the e-detector after all of them, with an unknown serial correlation of windows and an unknown scatter of
        parts, over the windows in a year: its mean without a change is at most 1 at whatever moment within a year one
        stops to look, see `false_discoveries`.
    threshold
        ln of the value of the e-detector at which it raises an alert.
    candidates
        All hypotheses but most pairs, of which the five likeliest are kept; the most probable first.
    detectable
        Smallest relative loss of each component that, present in all of these windows, would have been found with 95 %
        power: 0.07 for 7 %.
    """

    times: Real
    evidence: Real
    e_value: float
    threshold: float
    candidates: tuple[Candidate, ...]
    detectable: dict[Component, float]

    @property
    def is_alert(self) -> bool:
        """Whether the alert is active after the last window."""
        return bool(self.evidence.size and self.evidence[-1] >= self.threshold)

    @property
    def first_alert(self) -> float | None:
        """Time of the first window with an alert [s]; None without one."""
        above = np.flatnonzero(self.evidence >= self.threshold)
        return float(self.times[above[0]]) if above.size else None


class ChangeDetector:
    """Compares the windows of a vehicle with its baseline, one after the other.

    Parameters
    ----------
    baseline
        Normal state of the vehicle.
    false_alarms
        Rate of false alarms of a healthy vehicle, per day; above 0.
    windows_per_day
        Windows in a day of driving, above 0.
    n_windows
        Number of most recent windows that it holds, comparable or not, which bounds its memory and the cost of an
        update; None: all.

    Raises
    ------
    ParameterError
        If a number is out of its range.

    Notes
    -----
    Residual of window w under its conditions u_w (1, units away from the middle of those that the baseline was learnt
    from, then how far they are outside of these): r_w = (m + B u_w) + d size 1[w >= onset] + g_w + e_w. The errors m
    and B of the baseline's means and slopes have its information, g_w ~ N(0, Q) moves corners together, e_w ~ N(0, S_w)
    is the error of the fit. All covariances share one unknown scale, estimated from the windows of the baseline and
    those compared: the likelihood is that of Student's t.

    For every onset and hypothesis the likelihood ratio, the size averaged over its prior N(0, 0.15^2), has the mean 1
    without a change (an e-value); the sum over onsets of their mean over hypotheses is an e-detector (Shiryaev-Roberts)
    whose mean time to a false alarm is at least its threshold in windows. Sizes are those of maximum likelihood,
    without that prior, and without the share that friction hides from a linear model.

    When old windows are dropped, the evidence after earlier ones stays as it was; that after the last one is that of
    the windows still held. An update evaluates all of these: errors of the baseline and the scale are common to them.

    References
    ----------
    J. Shin, A. Ramdas, A. Rinaldo, E-detectors: a nonparametric framework for sequential change detection, New England
    Journal of Statistics in Data Science 2 (2024) 229-260.
    S. W. Roberts, A comparison of some control chart procedures, Technometrics 8 (1966) 411-430.
    """

    def __init__(
        self,
        baseline: Baseline,
        *,
        false_alarms: float = 1e-3,
        windows_per_day: float = 48.0,
        n_windows: int | None = None,
    ) -> None:
        check_number("false_alarms", false_alarms, above=0)
        check_number("windows_per_day", windows_per_day, above=0)
        if n_windows is not None:
            check_number("n_windows", n_windows, at_least=1)
        #: Normal state of the vehicle.
        self.baseline: Final = baseline
        #: Rate of false alarms of a healthy vehicle, per day.
        self.false_alarms: Final = false_alarms
        #: Evidence at which an alert is raised.
        self.threshold: Final = float(np.log(windows_per_day / false_alarms))
        self._patience = float(np.log(windows_per_day * PATIENCE_DAYS))
        self._doubt = baseline.doubt_beyond()
        self._n_windows = n_windows
        self._hypotheses = Hypotheses.of(baseline.components)
        self._observations: list[Observation] = []
        self._compared: list[Compared] = []
        self._evidence: list[float] = []
        self._table: Ratios | None = None

    @classmethod
    @one_thread
    def resumed(
        cls,
        baseline: Baseline,
        observations: Iterable[Observation],
        evidence: Iterable[float],
        *,
        false_alarms: float = 1e-3,
        windows_per_day: float = 48.0,
        n_windows: int | None = None,
    ) -> "ChangeDetector":
        """Return a detector that continues from the `observations` and the `evidence` of an earlier one.

        Parameters
        ----------
        baseline
            Baseline of the earlier detector.
        observations, evidence
            Attributes of the earlier detector; evidence that is not given is computed.
        false_alarms, windows_per_day, n_windows
            Arguments of the earlier detector.
        """
        detector = cls(baseline, false_alarms=false_alarms, windows_per_day=windows_per_day, n_windows=n_windows)
        for observation in observations:
            detector._take(observation)
        detector._evidence = [*map(float, evidence)][: len(detector._compared)]
        while len(detector._evidence) < len(detector._compared):
            table = detector._table_of(len(detector._evidence) + 1)
            detector._evidence.append(evidence_of(table, detector._hypotheses))
        return detector

    @property
    def observations(self) -> tuple[Observation, ...]:
        """Windows held, oldest first, comparable or not."""
        return tuple(self._observations)

    @property
    def evidence(self) -> Real:
        """Evidence after each window compared: ln of the e-detector, shape (windows,)."""
        return np.array(self._evidence)

    @property
    def is_alert(self) -> bool:
        """Whether the alert is active after the last window."""
        return bool(self._evidence and self._evidence[-1] >= self.threshold)

    @property
    @one_thread
    def detection(self) -> Detection | None:
        """Evidence after the last window; None before the first window that can be compared."""
        if not self._compared:
            return None
        table = self._table_of(len(self._compared)) if self._table is None else self._table
        times = np.array([window.time for window in self._compared])
        candidates = self._candidates(table)
        unexplained = table.scores.rest - (candidates[0].explained if self.is_alert else 0.0)
        found = detectable_changes(table.scores, self._hypotheses, threshold=self.threshold, unexplained=unexplained)
        return Detection(
            times=times,
            evidence=self.evidence,
            e_value=lasting_evidence(self._compared, self.baseline, self._hypotheses) - self._patience,
            threshold=self.threshold,
            candidates=candidates,
            detectable=dict(zip(self.baseline.components, losses(found), strict=True)),
        )

    @property
    @one_thread
    def candidates(self) -> tuple[Candidate, ...]:
        """Those of `detection`, without what else it takes; none before the first window that can be compared."""
        return self._candidates(self._table_of(len(self._compared))) if self._compared else ()

    def _candidates(self, table: Ratios) -> tuple[Candidate, ...]:
        """Return the candidates, the most probable first."""
        values = self._hypotheses.values
        order = np.argsort(-(np.logaddexp.reduce(table.logs, axis=0) + self._hypotheses.log_prior)).tolist()
        unlikely = [row for row in order if values[row].scope == "pair"][CANDIDATES.max_pairs :]
        times = np.array([window.time for window in self._compared])
        model_error = float(np.median([window.model_error for window in self._compared]))
        return tuple(self._candidate(table, row, times, model_error) for row in order if row not in unlikely)

    def _candidate(self, table: Ratios, row: int, times: Real, model_error: float) -> Candidate:
        """Return the candidate of a hypothesis."""
        hypothesis, logs = self._hypotheses.values[row], table.logs[:, row]
        best = int(np.argmax(logs))
        sizes, covariance = table.sizes(best, row, hypothesis.directions(self.baseline.components))
        # The onset may lie anywhere after the start of the window before.
        total = np.logaddexp.reduce(logs)
        first, last = np.searchsorted(np.cumsum(np.exp(logs - total)), [0.025, 0.975])
        return Candidate(
            hypothesis,
            float(total - np.log(len(times))),
            float(table.explained[best, row]),
            tuple(
                size_of(change.component, float(size), float(std), model_error)
                for change, size, std in zip(hypothesis.changes, sizes, np.sqrt(np.diagonal(covariance)), strict=True)
            ),
            float(times[best]),
            (float(times[max(min(first, len(times) - 1) - 1, 0)]), float(times[min(last, len(times) - 1)])),
        )

    @one_thread
    def update(self, observation: Observation) -> None:
        """Add the next window; one that cannot be compared with the baseline adds no evidence.

        Parameters
        ----------
        observation
            Window that follows the earlier ones in time.
        """
        is_compared = self._take(observation)
        is_shortened = self._forget()
        if is_compared:
            self._evidence.append(0.0)
        if self._compared and (is_compared or is_shortened):
            self._table = self._table_of(len(self._compared))
            self._evidence[-1] = evidence_of(self._table, self._hypotheses)

    def _take(self, observation: Observation) -> bool:
        """Keep a window, and return whether it can be compared."""
        self._observations.append(observation)
        if not self.baseline.accepts(observation):
            return False
        self._compared.append(compare(self.baseline, observation))
        return True

    def _forget(self) -> bool:
        """Drop windows beyond the limit, and return whether any of them had been compared."""
        if self._n_windows is None:
            return False
        gone = self._observations[: -self._n_windows]
        n_compared = sum(self.baseline.accepts(observation) for observation in gone)
        del self._observations[: len(gone)], self._compared[:n_compared], self._evidence[:n_compared]
        return n_compared > 0

    def _table_of(self, end: int) -> Ratios:
        """Return the likelihood ratios of the first `end` windows compared."""
        windows = self._compared[:end]
        scores = scores_of(windows, self._doubt, self.baseline.degrees_of_freedom)
        return ratios_of(scores, self._hypotheses)


def detect(
    baseline: Baseline,
    observations: Iterable[Observation],
    *,
    false_alarms: float = 1e-3,
    windows_per_day: float = 48.0,
) -> Detection | None:
    """Compare a sequence of windows with a baseline.

    Parameters
    ----------
    baseline
        Normal state of the vehicle.
    observations
        Windows in the order of time; those that cannot be compared are left out (see `Baseline.accepts`).
    false_alarms
        Rate of false alarms of a healthy vehicle, per day; above 0.
    windows_per_day
        Windows in a day of driving, above 0.

    Returns
    -------
    Detection or None
        None where no window can be compared.

    Raises
    ------
    ParameterError
        If a number is out of its range.

    Notes
    -----
    All windows pass through one `ChangeDetector`, which states the equations.

    References
    ----------
    As for `ChangeDetector`.

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
    >>> detection = detect(sprung.learn(windows[:8]), windows[8:])
    >>> best = detection.candidates[0]
    >>> detection.is_alert, best.hypothesis.name, round(best.change, 1), best.onset
    (True, 'front_left.spring', -0.3, 4800.0)
    """
    detector = ChangeDetector.resumed(
        baseline, observations, (), false_alarms=false_alarms, windows_per_day=windows_per_day
    )
    return detector.detection


def false_discoveries(evidence: Sequence[float] | Real, *, rate: float = 0.05) -> list[int]:
    """Return which of many vehicles have changed, with a share of false names of at most `rate` over the patience.

    Parameters
    ----------
    evidence
        ln of an e-value of each vehicle, such as `Detection.e_value`.
    rate
        Expected share of false discoveries among those named, above 0 and up to 1.

    Returns
    -------
    list of int
        Indices of the vehicles, ascending.

    Raises
    ------
    ParameterError
        If the rate is not above 0 and at most 1.

    Notes
    -----
    e-BH: of n e-values in descending order, the first k are discoveries, with the largest k for which the k-th is at
    least n / (k rate). Valid under any dependence between the vehicles.

    With e-detectors over the windows of a patience T, which is `Detection.e_value`, this is e-d-BH: whatever rule says
    when to stop and look, the expected share of healthy vehicles among those named is at most `rate` times the
    expected time until then over T ("error over patience"), as long as the scatter of the parts is that of the model.
    No rate holds over unlimited time.

    References
    ----------
    S. Dandapanthula, A. Ramdas, Multiple testing in multi-stream sequential change detection, arXiv 2501.04130 (2025).
    R. Wang, A. Ramdas, False discovery rate control with e-values, Journal of the Royal Statistical Society B 84 (2022)
    822-852.

    Examples
    --------
    Three of five vehicles, of which the third has an e-value of 40, above 5 / (3 x 0.05) = 33.3:

    >>> import numpy as np
    >>> false_discoveries(np.log([1.5, 200.0, 0.2, 40.0, 90.0]))
    [1, 3, 4]
    >>> false_discoveries(np.log([1.5, 200.0, 0.2, 30.0, 90.0]))
    [1, 4]
    """
    check_number("rate", rate, above=0, at_most=1)
    order = np.argsort(-np.asarray(evidence))
    ranked = np.asarray(evidence)[order]
    passing = np.flatnonzero(ranked >= np.log(len(ranked) / rate) - np.log(np.arange(1, len(ranked) + 1)))
    return sorted(int(k) for k in order[: passing[-1] + 1]) if passing.size else []


def size_of(kind: str, size: float, deviation: float, model_error: float) -> Size:
    """Return the size of a change with its interval.

    Parameters
    ----------
    kind
        "spring", "damper", "tyre" or "anti_roll".
    size, deviation
        Estimate and its standard deviation [ln].
    model_error
        Model error of the windows.
    """
    scale = np.hypot(HIDDEN_STD.get(kind, 0.05), CANDIDATES.of_model_error * model_error)
    size, deviation = (value / (1 - HIDDEN.get(kind, 0.0)) for value in (size, deviation))
    half = INTERVAL_95 * np.hypot(deviation, scale * size)
    # The prior of the fit keeps a bar from losing all.
    is_lost = kind == "anti_roll" and size < -np.log(2)
    interval = -1.0 if is_lost else float(np.expm1(size - half)), float(np.expm1(size + half))
    return Size(float(np.expm1(size)), interval, abs(size) / deviation)
