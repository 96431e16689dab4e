"""Learning the baseline of a vehicle from its windows."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import betaincinv

from sprung._checks import check_each, check_number, check_type
from sprung._threads import one_thread
from sprung.diagnosis.baseline import (
    Baseline,
    medians,
    model_error_of,
    prior_information,
    ranges,
    slope_covariances,
    units_of,
    vehicle_of,
)
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.residuals import RESIDUALS, ResidualReference, learn_reference
from sprung.diagnosis.scatter import ROUNDS, Deviations, Scatter, coordinates, directions, own_scatter, regression
from sprung.diagnosis.type_baselines import TypeBaseline
from sprung.errors import DataError, ParameterError

#: Usual number of windows that a baseline is learnt from.
LEARNING_WINDOWS = 12


@dataclass(frozen=True, slots=True)
class LearningSettings:
    """Settings of the learning of a baseline."""

    #: Smallest number of windows that must be usable.
    min_windows: int = LEARNING_WINDOWS // 2
    #: The same with the baseline of a type.
    min_with_type: int = 2
    #: Probability that a healthy window is left out of learning.
    suspect: float = 1e-3


SETTINGS = LearningSettings()


@one_thread
def learn(
    observations: Iterable[Observation],
    *,
    reason: str = "first learning",
    previous: Baseline | None = None,
    type_baseline: TypeBaseline | None = None,
    min_windows: int | None = None,
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
    type_baseline
        Baseline of the vehicle's type, which takes part as what was known before any window; None: nothing was.
    min_windows
        Smallest number of usable windows, at least 2; None: 6, or 2 with the baseline of a type.

    Returns
    -------
    Baseline
        Baseline, with the reference of the residual test if at least three windows carry its statistics.

    Raises
    ------
    DataError
        If too few windows are conclusive and alike.
    ParameterError
        If the windows are of several vehicles, or the baseline of the type is for other components.

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
    of all windows is known: otherwise a cold day has still to come, and the usual one stays, but for secondary and
    lateral springs of rail vehicles, which are of steel. Sizes of (2) and (3) are plain means, of vehicles on bogies by
    generalised least squares, as sensors may hardly see one bogie. Degrees of freedom are n - tr[(X^T X + L)^-1 X^T X],
    with L the variance of a window over that of a slope, and variances with few of them are widened to what their
    Student's t implies, in J too: means and slopes are no more certain than the windows.

    With the baseline of a type, the vehicle's mean is drawn from N(mean of the type, covariance between its vehicles)
    and its slopes and scatter are shrunk to those of the type (empirical Bayes): a few windows are enough.

    Windows are left out one at a time, the most distant first, while the distance from the prediction of the others is
    beyond its 99.9 % quantile: with m components, d^2 = r^T (V + x^T J^-1 x)^-1 r follows m F(m, degrees), as the
    prediction follows Student's t.

    References
    ----------
    T. Hastie, R. Tibshirani, J. Friedman, The Elements of Statistical Learning, 2nd edition (2009), section 3.4.1
    (degrees of freedom).
    H. Hotelling, The generalization of Student's ratio, Annals of Mathematical Statistics 2 (1931) 360-378.
    A. Gelman et al., Bayesian Data Analysis, 3rd edition (2013), chapter 14 (regression, Student's t prediction).

    Examples
    --------
    Twelve healthy windows, which scatter by 2 % about nominal:

    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((12, 12))
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> baseline = learn(windows)
    >>> baseline.n_windows, bool(np.allclose(baseline.mean, values.mean(axis=0), atol=0.005))
    (12, True)
    """
    if min_windows is None:
        min_windows = SETTINGS.min_windows if type_baseline is None else SETTINGS.min_with_type
    check_number("min_windows", min_windows, at_least=2)
    for name, value, kind in (("previous", previous, Baseline), ("type_baseline", type_baseline, TypeBaseline)):
        if value is not None:
            check_type(name, value, kind)
    every = list(check_each("observations", observations, Observation))
    vehicle = vehicle_of(every)
    valid = [window for window in every if window.is_valid]
    common = [
        window for window in valid if (window.components, window.missing) == (valid[0].components, valid[0].missing)
    ]
    if type_baseline is not None and common and common[0].components != type_baseline.components:
        raise ParameterError("the components differ from those of the type's baseline: fit the same ones")
    while True:
        if len(common) < min_windows:
            raise DataError(
                f"{len(common)} of {len(every)} windows can be learnt from, and {min_windows} are needed: give more "
                f"drives{_commonest_reason(every)}"
            )
        baseline = _estimated(common, type_baseline)
        worst = int(np.argmax([_distance(baseline, window) for window in common]))
        others = [*common[:worst], *common[worst + 1 :]]
        of_others, size = _estimated(others, type_baseline), len(baseline.components)
        degrees = of_others.degrees_of_freedom
        share = betaincinv(degrees / 2, size / 2, SETTINGS.suspect / len(common))
        limit = degrees * (1 / share - 1)  # size times the quantile of F
        if _distance(of_others, common[worst]) <= limit:
            break
        common = others
    return replace(
        baseline,
        vehicle=vehicle,
        n_refused=len(every) - len(common),
        version=1 if previous is None else previous.version + 1,
        reason=reason,
        residuals=_residual_reference(common),
        stiffenings=tuple(filter(None, (window.of_stiffening() for window in common))),
        run_outs={
            wheel: max(value + 2 * std for value, std in (window.run_outs.get(wheel, (0.0, 0.0)) for window in common))
            for wheel in dict.fromkeys(wheel for window in common for wheel in window.run_outs)
        },
    )


def _estimated(windows: Sequence[Observation], of_type: TypeBaseline | None) -> Baseline:
    """Return the baseline from windows with the same components, and what is known of the vehicle's type."""
    components, error = windows[0].components, model_error_of(windows)
    centre = medians(windows) if of_type is None else dict(of_type.centre)
    windows = sorted(windows, key=lambda window: window.time)
    values = np.array([window.log_ratios for window in windows])
    reported = np.mean([window.covariance for window in windows], axis=0)
    rows = np.array([np.concatenate([[1.0], units_of(window.conditions, centre)]) for window in windows])
    has_temperature = all("temperature" in window.conditions for window in windows)
    if of_type is None:
        prior, prior_mean = prior_information(components, np.zeros_like(reported), model_error=error), None
        typical = Scatter.typical(components, reported, with_temperature=has_temperature)
    else:
        prior, prior_mean = of_type.information, np.vstack([of_type.mean, of_type.slopes.T])
        typical = of_type.scatter(reported, with_temperature=has_temperature)
    scatter = typical
    for _ in range(ROUNDS):
        coefficients, _ = regression(rows, values, scatter.whole, prior, prior_mean)
        before = slope_covariances(components, error)
        deviations = Deviations(values - rows @ coefficients, rows, scatter.whole, before)
        scatter = typical.learnt(deviations)
    of_coordinates = coordinates(components, reported + scatter.nuisance)
    known = 0.0 if prior_mean is None else rows[:, 1:] @ prior_mean[1:]
    whole = replace(deviations, values=values - known)
    weights, squares, degrees = own_scatter(whole, of_coordinates, len(directions(components)[0]))
    scatter = typical.learnt(deviations, is_widened=True)
    # Means and slopes are as uncertain as the windows that they are from: by the widened scatter.
    _, information = regression(rows, values, scatter.whole, prior, prior_mean)
    return Baseline(
        vehicle=windows[0].vehicle,
        components=components,
        mean=coefficients[0],
        covariance=scatter.covariance,
        reported=reported,
        slopes=coefficients[1:].T,
        centre=centre,
        ranges=ranges(windows),
        nuisance=scatter.nuisance,
        information=information,
        degrees_of_freedom=scatter.degrees_of_freedom,
        n_windows=len(windows),
        n_refused=0,
        version=1,
        reason="",
        model_error=error,
        learning_times=tuple(sorted(window.time for window in windows)),
        missing=windows[0].missing,
        weights=weights,
        coordinates=of_coordinates,
        squares=squares,
        degrees=degrees,
    )


def _distance(baseline: Baseline, window: Observation) -> float:
    """Return the squared Mahalanobis distance of a window from the prediction for its conditions."""
    away = baseline.residual(window)
    seen = np.kron(np.concatenate([[1.0], baseline.units(window)]), np.eye(len(away)))
    doubt = seen @ np.linalg.solve(baseline.information, seen.T)
    return float(away @ np.linalg.solve(baseline.covariance + baseline.nuisance + doubt, away))


def _residual_reference(observations: Sequence[Observation]) -> ResidualReference | None:
    """Return the residual reference of the windows with the channels of the first one; None from too few."""
    residuals = [window.residuals for window in observations]
    complete = [statistics for statistics in residuals if statistics is not None and statistics.segments is not None]
    alike = [statistics for statistics in complete if statistics.is_like(complete[0])]
    return learn_reference(alike) if len(alike) >= RESIDUALS.min_windows else None


def _commonest_reason(observations: Sequence[Observation]) -> str:
    """Return the commonest reason why windows cannot be learnt from, in brackets."""
    reasons = [
        window.reason or f"{window.sensor_faults[0].channel} is {window.sensor_faults[0].kind}"
        for window in observations
        if not window.is_conclusive or window.sensor_faults
    ]
    return f" ({max(set(reasons), key=reasons.count)})" if reasons else ""
