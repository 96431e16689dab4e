"""Learning the baseline of a vehicle from its windows."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number
from sprung.diagnosis.baseline import CONDITIONS, Baseline, units_of, vehicle_of
from sprung.diagnosis.directions import USUAL_ENDS, directions, kinds_of, usual_nuisance
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.residuals import FEWEST as FEWEST_RESIDUALS
from sprung.diagnosis.residuals import ResidualReference, learn_reference
from sprung.errors import DataError
from sprung.vehicles import Component

#: Usual number of windows that a baseline is learnt from, and the smallest that must be usable.
LEARNING_WINDOWS = 12
LEAST_WINDOWS = LEARNING_WINDOWS // 2
#: Standard deviation of the change of ln values with one unit of a condition, before any window.
_SLOPE = 0.01
#: Weights in windows of prior scatters: the usual one of axles, and the one that windows report.
_PRIOR_WINDOWS, _PRIOR_SCATTER = 8.0, 2.0
#: Probability that a healthy window is left out of learning.
_SUSPECT = 1e-3


def learn(
    observations: Iterable[Observation],
    *,
    reason: str = "first learning",
    previous: Baseline | None = None,
    least_windows: int = LEAST_WINDOWS,
) -> Baseline:
    """Learn the baseline of a vehicle.

    Parameters
    ----------
    observations
        Windows of one healthy vehicle over the conditions it meets.
    reason
        Reason for learning: "first learning", "new dampers" ...
    previous
        Baseline that this one replaces.
    least_windows
        Smallest number of usable windows, at least 2.

    Returns
    -------
    Baseline
        Baseline, with the reference of the residual test if at least three windows carry its statistics.

    Raises
    ------
    DataError
        If too few windows are conclusive and alike.
    ParameterError
        If the windows are of several vehicles.

    Notes
    -----
    Rows x_w = (1, conditions in units away from their median) and y_w = ln(value / nominal value) of n windows give
    means and slopes by ridge regression: B = (X^T X + L)^-1 X^T Y, with L = diag(0, l, ...) and l the variance of a
    window over that of a slope before any window. The degrees of freedom that remain are n - tr[(X^T X + L)^-1 X^T X].

    The covariance of a window is the mean of those that windows report, scaled by the ratio of the observed scatter of
    left against right about the fit to the reported one (regularised by two windows' worth of the latter); it is never
    narrowed. The scatter of axles and of all corners together is nuisance, see `usual_nuisance`.

    Windows are left out one at a time, the most distant first, while the distance from the prediction of the others is
    beyond its 99.9 % quantile: with m components, d^2 = r^T (S + Q)^-1 r / (1 + x^T (X^T X + L)^-1 x) follows
    m F(m, degrees), as the prediction follows Student's t.

    References
    ----------
    A. E. Hoerl, R. W. Kennard, Ridge regression: biased estimation for nonorthogonal problems, Technometrics 12 (1970)
    55-67.
    T. Hastie, R. Tibshirani, J. Friedman, The Elements of Statistical Learning, 2nd edition (2009), section 3.4.1
    (degrees of freedom).
    H. Hotelling, The generalization of Student's ratio, Annals of Mathematical Statistics 2 (1931) 360-378.
    A. Gelman et al., Bayesian Data Analysis, 3rd edition (2013), chapter 14 (Student's t prediction).
    """
    check_number("least_windows", least_windows, at_least=2)
    every = list(observations)
    vehicle = vehicle_of(every)
    sound = [observation for observation in every if observation.is_conclusive and not observation.sensor_faults]
    common = [observation for observation in sound if observation.components == sound[0].components]
    while True:
        if len(common) < least_windows:
            raise DataError(
                f"{len(common)} of {len(every)} windows can be learnt from, and {least_windows} are needed: give more "
                f"drives{_commonest_reason(every)}"
            )
        estimate = _Estimate.of(common)
        distances = [estimate.distance(observation) for observation in common]
        worst = int(np.argmax(distances))
        suspect = common[worst]
        others = [*common[:worst], *common[worst + 1 :]]
        if _is_like(suspect, others, chance=_SUSPECT / len(distances)):
            break
        common = others
    return Baseline(
        vehicle=vehicle,
        components=estimate.components,
        mean=estimate.mean,
        covariance=estimate.covariance,
        slopes=estimate.slopes,
        middle=estimate.middle,
        ranges=_ranges(common),
        nuisance=estimate.nuisance,
        design=estimate.design,
        degrees=estimate.degrees,
        n_windows=len(common),
        n_refused=len(every) - len(common),
        version=1 if previous is None else previous.version + 1,
        reason=reason,
        residuals=_residual_reference(common),
        model_error=float(np.median([window.conditions.get("model_error", 0.0) for window in common])),
        taught=tuple(sorted(observation.time for observation in common)),
    )


@dataclass(frozen=True, eq=False, slots=True)
class _Estimate:
    """Estimate of the normal state from windows; equations as in `learn`, fields as in `Baseline`."""

    components: tuple[Component, ...]
    middle: dict[str, float]
    mean: Real
    slopes: Real
    covariance: Real
    nuisance: Real
    design: Real
    degrees: float

    @classmethod
    def of(cls, observations: Sequence[Observation]) -> "_Estimate":
        """Return the estimate from windows with the same components."""
        components = observations[0].components
        middle = {name: float(np.median(values)) for name, values in _conditions_met(observations).items()}
        values = np.array([observation.log_ratios for observation in observations])
        reported = np.mean([observation.covariance for observation in observations], axis=0)
        rows = np.array([np.concatenate([[1.0], units_of(observation, middle)]) for observation in observations])
        penalty = float(np.diag(reported).mean()) / _SLOPE**2
        design = rows.T @ rows + np.diag([0.0, *([penalty] * (rows.shape[1] - 1))])
        coefficients = np.linalg.solve(design, rows.T @ values)
        scatter = values - rows @ coefficients
        free = max(len(values) - float(np.trace(np.linalg.solve(design, rows.T @ rows))), 1.0)
        pairs, _, _ = directions(components)
        inflation = _inflation(scatter @ pairs.T, np.diag(pairs @ reported @ pairs.T), free)
        ends = _scatter_of_ends(scatter, inflation * reported, components, free)
        return cls(
            components=components,
            middle=middle,
            mean=coefficients[0],
            slopes=coefficients[1:].T,
            covariance=inflation * reported,
            nuisance=usual_nuisance(components, ends),
            design=design,
            degrees=len(pairs) * (free + _PRIOR_SCATTER),
        )

    def distance(self, observation: Observation) -> float:
        """Return the squared Mahalanobis distance of a window from the prediction for its conditions."""
        units = units_of(observation, self.middle)
        away = observation.log_ratios - self.mean - self.slopes @ units
        row = np.concatenate([[1.0], units])
        doubt = 1 + row @ np.linalg.solve(self.design, row)
        return float(away @ np.linalg.solve(self.covariance + self.nuisance, away) / doubt)


def _inflation(contrasts: Real, variances: Real, free: float) -> float:
    """Return the ratio of the variance of left against right to the reported one, at least 1; (windows, pairs)."""
    own = float(np.sum(contrasts**2 / variances)) / contrasts.shape[1]
    return max(1.0, (own + _PRIOR_SCATTER) / (free + _PRIOR_SCATTER))


def _scatter_of_ends(
    scatter: Real, covariance: Real, components: tuple[Component, ...], free: float
) -> dict[str, float]:
    """Return the standard deviation of front against rear by kind: the vehicle's own beyond chance, and the usual one.

    The vehicle's own is weighted by its degrees of freedom, the usual one by eight windows.
    """
    _, ends, _ = directions(components)
    kinds = sorted({component.kind for component in components})
    share = free / (free + _PRIOR_WINDOWS)
    usual = {kind: USUAL_ENDS.get(kind, 0.02) for kind in kinds}
    kinds_of_ends = np.array(kinds_of(ends, components))
    for kind in kinds:
        rows = ends[kinds_of_ends == kind]
        if not len(rows):
            continue
        own = float(np.mean(np.sum((scatter @ rows.T) ** 2, axis=0))) / free
        chance = float(np.mean(np.diag(rows @ covariance @ rows.T)))
        usual[kind] = float(np.sqrt(share * max(0.0, own - chance) + (1 - share) * usual[kind] ** 2))
    return usual


def _is_like(observation: Observation, others: Sequence[Observation], *, chance: float) -> bool:
    """Return whether a window agrees with the others; a healthy one does not with probability `chance`."""
    from scipy import stats

    estimate = _Estimate.of(others)
    size = len(estimate.components)
    return estimate.distance(observation) <= size * stats.f.isf(chance, size, estimate.degrees)


def _conditions_met(observations: Sequence[Observation]) -> dict[str, list[float]]:
    """Return the values of each known condition."""
    met = {
        name: [window.conditions[name] for window in observations if name in window.conditions] for name in CONDITIONS
    }
    return {name: values for name, values in met.items() if values}


def _ranges(observations: Sequence[Observation]) -> dict[str, tuple[float, float]]:
    return {name: (min(values), max(values)) for name, values in _conditions_met(observations).items()}


def _residual_reference(observations: Sequence[Observation]) -> ResidualReference | None:
    """Return the residual reference of the windows with the channels of the first one; None from too few."""
    residuals = [window.residuals for window in observations]
    complete = [statistics for statistics in residuals if statistics is not None and statistics.segments is not None]
    alike = [statistics for statistics in complete if statistics.is_like(complete[0])]
    return learn_reference(alike) if len(alike) >= FEWEST_RESIDUALS else None


def _commonest_reason(observations: Sequence[Observation]) -> str:
    """Return the commonest reason why windows cannot be learnt from, in brackets."""
    reasons = [
        window.reason or f"{window.sensor_faults[0].channel} is {window.sensor_faults[0].kind}"
        for window in observations
        if not window.is_conclusive or window.sensor_faults
    ]
    return f" ({max(set(reasons), key=reasons.count)})" if reasons else ""
