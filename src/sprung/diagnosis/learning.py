"""Learning the baseline of a vehicle from its windows."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy import stats

from sprung._arrays import Real
from sprung._checks import check_number
from sprung.diagnosis.baseline import (
    CONDITIONS,
    Baseline,
    prior_information,
    slope_covariances,
    units_of,
    vehicle_of,
)
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.residuals import FEWEST as FEWEST_RESIDUALS
from sprung.diagnosis.residuals import ResidualReference, learn_reference
from sprung.diagnosis.scatter import FreeDegrees, Scatter, regression
from sprung.errors import DataError
from sprung.vehicles import Component

#: Usual number of windows that a baseline is learnt from, and the smallest that must be usable.
LEARNING_WINDOWS = 12
LEAST_WINDOWS = LEARNING_WINDOWS // 2
#: Rounds of regression and scatter, which need each other.
_ROUNDS = 3
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
    mean and slopes by Bayesian linear regression: with V the covariance of a window, the information is
    J = X^T X (x) V^-1 + P, with P that of the slopes before any window, and the coefficients are
    J^-1 sum x_w (x) V^-1 y_w. Slopes of a component by itself are small; those of all components of a kind together may
    be as large as those of dampers with the temperature. V and the coefficients are estimated in turn.

    V has three parts. (1) The covariance that windows report, each pair of components scaled as left against right
    scatters about the regression, more or less than reported: a fit that is uncertain because the vehicle file lacks
    something errs alike in every window. Pairs are shrunk to the ratio of all pairs. (2) Front against rear and (3) all
    components of a kind together, beyond (1), regularised by usual values. The third is learnt only if the temperature
    of all windows is known: otherwise a cold day has still to come, and the usual one stays. Degrees of freedom are
    n - tr[(X^T X + L)^-1 X^T X], with L the variance of a window over that of a slope, and variances with few of them
    are widened to what their Student's t implies.

    Windows are left out one at a time, the most distant first, while the distance from the prediction of the others is
    beyond its 99.9 % quantile: with m components, d^2 = r^T (V + x^T J^-1 x)^-1 r follows m F(m, degrees), as the
    prediction follows Student's t.

    References
    ----------
    T. Hastie, R. Tibshirani, J. Friedman, The Elements of Statistical Learning, 2nd edition (2009), section 3.4.1
    (degrees of freedom).
    H. Hotelling, The generalization of Student's ratio, Annals of Mathematical Statistics 2 (1931) 360-378.
    A. Gelman et al., Bayesian Data Analysis, 3rd edition (2013), chapter 14 (regression, Student's t prediction).
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
        reported=estimate.reported,
        slopes=estimate.slopes,
        middle=estimate.middle,
        ranges=_ranges(common),
        nuisance=estimate.nuisance,
        information=estimate.information,
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
    reported: Real
    nuisance: Real
    information: Real
    degrees: float

    @classmethod
    def of(cls, observations: Sequence[Observation]) -> "_Estimate":
        """Return the estimate from windows with the same components."""
        components = observations[0].components
        middle = {name: float(np.median(values)) for name, values in conditions_met(observations).items()}
        values = np.array([observation.log_ratios for observation in observations])
        reported = np.mean([observation.covariance for observation in observations], axis=0)
        rows = np.array([np.concatenate([[1.0], units_of(observation, middle)]) for observation in observations])
        is_warm = all("temperature" in observation.conditions for observation in observations)
        prior = prior_information(components, np.zeros_like(reported))
        scatter = Scatter.usual(components, reported, with_temperature=is_warm)
        for _ in range(_ROUNDS):
            coefficients, information = regression(rows, values, scatter.whole, prior)
            away = values - rows @ coefficients
            scatter = scatter.learnt(away, FreeDegrees(rows, scatter.whole, slope_covariances(components)))
        return cls(
            components=components,
            middle=middle,
            mean=coefficients[0],
            slopes=coefficients[1:].T,
            covariance=scatter.covariance,
            reported=reported,
            nuisance=scatter.nuisance,
            information=information,
            degrees=scatter.degrees,
        )

    def distance(self, observation: Observation) -> float:
        """Return the squared Mahalanobis distance of a window from the prediction for its conditions."""
        row = np.concatenate([[1.0], units_of(observation, self.middle)])
        away = observation.log_ratios - self.mean - self.slopes @ row[1:]
        seen = np.kron(row, np.eye(len(away)))
        doubt = seen @ np.linalg.solve(self.information, seen.T)
        return float(away @ np.linalg.solve(self.covariance + self.nuisance + doubt, away))


def _is_like(observation: Observation, others: Sequence[Observation], *, chance: float) -> bool:
    """Return whether a window agrees with the others; a healthy one does not with probability `chance`."""
    estimate = _Estimate.of(others)
    size = len(estimate.components)
    return estimate.distance(observation) <= size * stats.f.isf(chance, size, estimate.degrees)


def conditions_met(observations: Sequence[Observation]) -> dict[str, list[float]]:
    """Return the values of each known condition."""
    met = {
        name: [window.conditions[name] for window in observations if name in window.conditions] for name in CONDITIONS
    }
    return {name: values for name, values in met.items() if values}


def _ranges(observations: Sequence[Observation]) -> dict[str, tuple[float, float]]:
    return {name: (min(values), max(values)) for name, values in conditions_met(observations).items()}


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
