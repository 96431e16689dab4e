"""The windows of a vehicle compared with its type: the mean of all of them, and changes between them."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc, fdtrc, ndtr, ndtri, stdtr, stdtrit

from sprung._arrays import Indices, Real
from sprung._checks import check_each, check_number, check_type
from sprung.diagnosis.baseline import slope_covariances, unequal_stiffening
from sprung.diagnosis.changes import Candidate, Detection, Size, detect
from sprung.diagnosis.detectability import POWER, losses
from sprung.diagnosis.hypotheses import PRIORS, Hypothesis, hypotheses_of, log_prior
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.scatter import directions, kinds_of, shared_covariance
from sprung.diagnosis.type_baselines import TYPES, TypeBaseline, has_temperature
from sprung.modal import INTERVAL_95
from sprung.vehicles import Component


@dataclass(frozen=True, slots=True)
class TypeTest:
    """Settings of the comparison with a type."""

    #: Size that the tests are most powerful for, a loss of 20 % [ln].
    size: float = float(-np.log(0.8))
    #: Share of losses among changes.
    losses: float = 0.9
    #: Share of unmodelled deviations in the probability of a false alarm.
    unmodelled: float = 0.05
    #: Correlation above which two hypotheses are the same test.
    same: float = 0.9
    #: Largest loss that is sought as the smallest detectable one [ln].
    largest: float = 3.0
    #: Number of times that the range of this loss is halved.
    halvings: int = 10
    #: Share of vehicles with a change before any window, where it is asked which one to inspect.
    faulty: float = 0.1
    #: Widening of the deviations between vehicles where changes are sought between the windows of one vehicle.
    wide: float = 3.0
    #: Usual standard deviation over the corners of a vehicle of the rise of their springs' stiffening inwards.
    stiffening: float = 0.05


TEST = TypeTest()


def compare_with_type(
    observations: Iterable[Observation],
    type_baseline: TypeBaseline,
    *,
    false_alarms: float = 1e-3,
    windows_per_day: float = 48.0,
) -> Detection | None:
    """Compare the windows of a vehicle that has no baseline of its own with its type.

    Parameters
    ----------
    observations
        Windows of one vehicle in the order of time.
    type_baseline
        Baseline of the type, or `nominal_type`: production scatter.
    false_alarms
        Probability that a healthy vehicle raises an alert at first, and rate of false alarms per day afterwards; above
        0.
    windows_per_day
        Windows in a day of driving, above 0.

    Returns
    -------
    Detection or None
        Deviation from the type, or where there is none a change between the windows; None where no window can be
        compared.

    Raises
    ------
    ParameterError
        If a number is out of its range.

    Notes
    -----
    The mean of the windows, r ~ N(0, S) with S = D + V / n, is compared with the type: for hypothesis h with direction
    d, its deviation is z = d^T S^-1 r / sqrt(d^T S^-1 d), and a change of 20 % would make it delta. The test that is
    most powerful against such changes of all parts on average rejects above z = delta / 2 + c / delta (the likelihood
    ratio e^c, with prior shares of hypotheses); its evidence is -ln p, with p the sum of the tails of all distinct
    hypotheses at the c observed. Where left and right alone can be compared, a loss on one side and a gain on the other
    are the same test, and the loss is named first.

    The evidence after each window is that of all windows up to it, so that the cost grows with the square of their
    number. A change between the windows is sought by a `ChangeDetector` with wide limits on the vehicle's mean.

    References
    ----------
    K. Roeder, L. Wasserman, Genome-wide significance levels and weighted hypothesis testing, Statistical Science 24
    (2009) 398-413 (section 3).

    Examples
    --------
    Six windows of a vehicle with a front-left spring that has lost 30 % of its stiffness, against the vehicle file:

    >>> import numpy as np
    >>> import sprung
    >>> from sprung.diagnosis import nominal_type
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((6, 12))
    >>> values[:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> detection = compare_with_type(windows, nominal_type(parts, name="zafira"))
    >>> detection.is_alert, detection.candidates[0].hypothesis.name
    (True, 'front_left.spring')
    """
    check_type("type_baseline", type_baseline, TypeBaseline)
    check_number("false_alarms", false_alarms, above=0)
    check_number("windows_per_day", windows_per_day, above=0)
    every = tuple(check_each("observations", observations, Observation))
    compared = _comparable(type_baseline, every)
    if not compared:
        return None
    by_count = [TypeComparison.of(type_baseline, compared[:count]) for count in range(1, len(compared) + 1)]
    deviation = by_count[-1].detection(
        times=np.array([window.time for window in compared]),
        evidence=np.array([comparison.candidates()[0].log_evidence for comparison in by_count]),
        threshold=float(-np.log(min(false_alarms, 1.0))),
    )
    if deviation.is_alert:
        return deviation
    wide = replace(type_baseline, between=TEST.wide**2 * type_baseline.between).baseline(every)
    change = detect(wide, every, false_alarms=false_alarms, windows_per_day=windows_per_day)
    return change if change is not None and change.is_alert else deviation


def _comparable(of_type: TypeBaseline, windows: Sequence[Observation]) -> list[Observation]:
    """Return the windows that can be compared; none where a vehicle file explains most of them poorly."""
    alike = [window for window in windows if window.is_valid and window.components == of_type.components]
    if not alike:
        return []
    baseline = of_type.baseline(alike)
    compared = [window for window in alike if baseline.accepts(window)]
    return compared if 2 * len(compared) > len(alike) else []


@dataclass(frozen=True, eq=False, slots=True)
class TypeComparison:
    """Tests of all hypotheses on the mean of windows of a vehicle.

    Parameters
    ----------
    components
        Springs, dampers and tyres of the type.
    times
        Times of the first and the last window [s].
    residual
        Mean deviation of the windows from the type, ln values, shape (components,).
    inverse
        Inverse covariance of it, between vehicles and of the mean, shape (components, components).
    degrees
        Degrees of freedom of that covariance.
    hypotheses
        Hypotheses with one size.
    rows
        Direction of each, shape (hypotheses, components).
    stds
        Standard deviation of the size of each, shape (hypotheses,).
    distinct
        Signed hypotheses, losses first, none of which is nearly the same test as one before it.
    """

    components: tuple[Component, ...]
    times: tuple[float, float]
    residual: Real
    inverse: Real
    degrees: float
    hypotheses: tuple[Hypothesis, ...]
    rows: Real
    stds: Real
    distinct: Indices

    @classmethod
    def of(cls, of_type: TypeBaseline, windows: Sequence[Observation]) -> "TypeComparison":
        """Return the comparison of the mean of windows with a type."""
        residual, covariance = _mean_residual(of_type, windows)
        inverse = np.linalg.inv(of_type.single_vehicle_covariance + covariance)
        hypotheses = tuple(each for each in hypotheses_of(of_type.components) if len(each.changes) == 1)
        rows = np.array([hypothesis.direction(of_type.components) for hypothesis in hypotheses])
        likeness = rows @ inverse @ rows.T
        stds = 1 / np.sqrt(np.diag(likeness))
        return cls(
            components=of_type.components,
            times=(windows[0].time, windows[-1].time),
            residual=residual,
            inverse=np.asarray(inverse, dtype=np.float64),
            degrees=of_type.n_vehicles + TYPES.production if of_type.n_vehicles else np.inf,
            hypotheses=hypotheses,
            rows=rows,
            stds=stds,
            distinct=_distinct(likeness * np.outer(stds, stds)),
        )

    def sizes(self, residuals: Real) -> Real:
        """Return the size of each hypothesis in residuals of shape (..., components), ln values."""
        return np.asarray(self.stds**2 * (residuals @ self.inverse @ self.rows.T), dtype=np.float64)

    def evidence(self, residuals: Real) -> Real:
        """Return -ln p of each hypothesis, p the probability of evidence as strong from any of them."""
        z, shares = self.sizes(residuals) / self.stds, log_prior(self.hypotheses)
        deltas = np.tile(TEST.size / self.stds, 2)
        of_signs = np.concatenate([shares + np.log(TEST.losses), shares + np.log(1 - TEST.losses)])
        both = np.concatenate([-z, z], axis=-1) * deltas - deltas**2 / 2 + of_signs
        strength = both.reshape(*z.shape[:-1], 2, -1).max(axis=-2)
        deltas, of_signs = deltas[self.distinct], of_signs[self.distinct]
        limits = deltas / 2 + (strength[..., None] - of_signs) / deltas
        tails = ndtr(-limits) if np.isinf(self.degrees) else stdtr(self.degrees, -limits)
        return _minus_log(tails.sum(axis=-1) / (1 - TEST.unmodelled))

    def probabilities(self) -> Real:
        """Return the probability that nothing differs from the type, and of each hypothesis, shape (1 + hypotheses,).

        Notes
        -----
        The size of a change is N(0, s^2) before, with the s of `PRIORS`. With r = s / std and z the deviation in
        standard deviations, as a normal one of the same tail, the odds against the type are those before times
        exp(z^2 r^2 / (1 + r^2) / 2) / sqrt(1 + r^2).

        References
        ----------
        J. Wakefield, Bayes factors for genome-wide association studies: comparison with P-values, Genetic Epidemiology
        33 (2009) 79-86.
        """
        z = np.abs(self.sizes(self.residual)) / self.stds
        if np.isfinite(self.degrees):
            z = -ndtri(np.clip(stdtr(self.degrees, -z), 1e-300, 0.5))
        is_bar = np.array([hypothesis.component == "anti_roll" for hypothesis in self.hypotheses])
        ratio = (np.where(is_bar, PRIORS.size_of_bars, PRIORS.size) / self.stds) ** 2
        factors = z**2 * ratio / (1 + ratio) / 2 - np.log1p(ratio) / 2
        before = log_prior(self.hypotheses) + np.log(TEST.faulty)
        logs = np.concatenate([[np.log(1 - TEST.faulty)], before + factors])
        weights = np.exp(logs - logs.max())
        return np.asarray(weights / weights.sum(), dtype=np.float64)

    def candidates(self) -> tuple[Candidate, ...]:
        """Return what may be different from the type, the most likely first."""
        half = -float(stdtrit(self.degrees, 0.025)) if np.isfinite(self.degrees) else INTERVAL_95
        numbers = np.stack([self.evidence(self.residual), self.sizes(self.residual), self.stds], axis=1).tolist()
        candidates = [
            Candidate(hypothesis, log, (size / std) ** 2, (_size(size, std, half),), self.times[0], self.times)
            for hypothesis, (log, size, std) in zip(self.hypotheses, numbers, strict=True)
        ]
        explained, count = float(self.residual @ self.inverse @ self.residual), len(self.residual)
        is_normal = np.isinf(self.degrees)
        rest: Real = np.asarray(
            chdtrc(count, explained) if is_normal else fdtrc(count, self.degrees, explained / count)
        )
        unmodelled = float(_minus_log(rest / TEST.unmodelled))
        candidates.append(
            Candidate(Hypothesis("else", "vehicle", "unmodelled"), unmodelled, explained, (), self.times[0], self.times)
        )
        return tuple(sorted(candidates, key=lambda candidate: (-candidate.log_evidence, -candidate.explained)))

    def detectable(self, threshold: float) -> dict[Component, float]:
        """Return the smallest relative loss of each component that is found with 95 % power.

        The size is found by bisection: that at which the evidence reaches the threshold, and 1.645 standard deviations.
        """
        count = len(self.components)
        low, high = np.zeros(count), np.full(count, TEST.largest)
        for _ in range(TEST.halvings):
            middle = (low + high) / 2
            is_found = self.evidence(-middle[:, None] * self.rows[:count]).max(axis=1) >= threshold
            low, high = np.where(is_found, low, middle), np.where(is_found, middle, high)
        changes = high + ndtri(POWER) * self.stds[:count]
        return dict(zip(self.components, losses(changes), strict=True))

    def detection(self, *, times: Real, evidence: Real, threshold: float) -> Detection:
        """Return the deviation from the type, with the evidence after each of some windows, the last one included."""
        candidates = self.candidates()
        return Detection(times, evidence, candidates[0].log_evidence, threshold, candidates, self.detectable(threshold))


def _distinct(cosines: Real) -> Indices:
    """Return the signed hypotheses, losses first, that are no test nearly the same as an earlier one."""
    signs = np.repeat([-1.0, 1.0], len(cosines))
    alike = np.outer(signs, signs) * np.tile(cosines, (2, 2))
    distinct: list[int] = []
    for number in range(len(signs)):
        if not np.any(alike[number, distinct] > TEST.same):
            distinct.append(number)
    return np.array(distinct)


def _minus_log(probabilities: Real) -> Real:
    return np.asarray(-np.log(np.clip(probabilities, 1e-300, 1.0)), dtype=np.float64)


def _size(size: float, std: float, half: float) -> Size:
    """Return the size of a change [ln] with its interval, `half` standard deviations on either side."""
    interval = float(np.expm1(size - half * std)), float(np.expm1(size + half * std))
    return Size(float(np.expm1(size)), interval, abs(size) / std)


def _mean_residual(of_type: TypeBaseline, windows: Sequence[Observation]) -> tuple[Real, Real]:
    """Return the mean of the windows' residuals and its covariance, at least as wide as they scatter.

    A common change with an unknown temperature, or beyond the conditions of the type, is the same in all windows. So is
    the error of a linear fit at any part where some corners meet their bump stops more than is usual.
    """
    baseline = of_type.baseline(windows)
    away = np.array([baseline.residual(window) for window in windows])
    own = np.mean([baseline.covariance_of(window) for window in windows], axis=0)
    pairs, ends, _ = directions(baseline.components)
    scatter = (away - away.mean(axis=0)) @ pairs.T
    free = max((len(away) - 1) * len(pairs), 1)
    excess = max(1.0, float(np.sum(scatter**2 / np.diag(pairs @ own @ pairs.T))) / free)
    covariance = excess * own / len(away)
    if not (of_type.has_temperature and has_temperature(windows)):
        no_ends = dict.fromkeys(kinds_of(ends, baseline.components), 0.0)
        covariance = covariance + shared_covariance(baseline.components, no_ends)
    beyond = baseline.beyond(np.mean([baseline.units(window) for window in windows], axis=0))
    for distance, slope in zip(beyond, slope_covariances(baseline.components, of_type.model_error), strict=True):
        covariance = covariance + distance**2 * slope
    on_stops = [np.sqrt(max(unequal_stiffening((), window) - TEST.stiffening**2, 0.0)) for window in windows]
    others = np.diag([float(part.kind != "spring") for part in baseline.components])  # springs: in `covariance_of`
    covariance = covariance + np.mean(on_stops) ** 2 * others
    return away.mean(axis=0), np.asarray(covariance, dtype=np.float64)
