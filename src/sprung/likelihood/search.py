"""Search for the parameters at which the likelihood is largest."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import islice
from typing import TYPE_CHECKING, Protocol, Self, TypeVar

import numpy as np

from sprung._arrays import Booleans, Complex, Real

if TYPE_CHECKING:
    from sprung.likelihood.spectra import ClassSpectra

#: Value of an objective that is not finite, or of parameters that no vehicle has.
TOO_FAR = 1e100


@dataclass(frozen=True, slots=True)
class DescentSettings:
    """Settings of the search by BFGS."""

    #: Largest number of steps.
    max_steps: int = 300
    #: Length of a step, in standard deviations, after which the information is computed again.
    far: float = 3.0
    #: Change of ln of a power after which it is, too.
    far_of_power: float = 2.0
    #: Largest number of times that a long step calls for new information.
    max_far: int = 5
    #: Steps after which the information is computed again in any case.
    stale: int = 25
    #: Slope at which the search ends, in standard deviations.
    slope: float = 1e-2
    #: Whether a last step from there is taken without another likelihood.
    has_last_step: bool = False
    #: Share of the total gain below which a step ends the search.
    gain: float = 1e-8
    #: Share of the gain by the slope that a step must reach.
    sufficient: float = 1e-4
    #: Bounds of the shortening of a step.
    shorter: tuple[float, float] = (0.1, 0.5)
    #: Shortest step.
    shortest: float = 1e-6
    #: Least curvature along a step over the largest possible, for an update of the curvature.
    curved: float = 1e-10


@dataclass(frozen=True, slots=True)
class ScoringSettings:
    """Settings of Fisher scoring."""

    #: Squared slope in standard deviations at which scoring ends.
    scored: float = 1e-4
    #: Largest number of steps.
    max_steps: int = 4
    #: Shortest step, as a share of the full one.
    shortest: float = 0.05
    #: Largest number of steps of the search after it.
    max_after: int = 40
    #: Squared slope below which that search has converged.
    converged: float = 1e-2


@dataclass(frozen=True, slots=True)
class LeastSquaresSettings:
    """Settings of the search by Levenberg and Marquardt."""

    #: Most steps, and gain of the log likelihood at which the search ends.
    max_steps: int = 40
    gain: float = 1e-4
    #: Damping of the first step, its factors after a good and a bad step, and its end: first steps that are bolder end
    #: in false minima of swings with friction.
    begin: float = 0.1
    less: float = 0.3
    more: float = 3.0
    vain: float = 1e4
    #: Least damping, and least of a parameter without effect over the sum of all.
    least: float = 1e-9
    #: Step of derivatives by differences.
    difference: float = 1e-7


DESCENT = DescentSettings()
SCORING = ScoringSettings()
LEAST_SQUARES = LeastSquaresSettings()


class Likelihood(Protocol):
    """A model with data whose likelihood is searched: of a vehicle (`whittle.Model`) or of modes (`ModalModel`)."""

    @property
    def prior_std(self) -> Real:
        """Standard deviation of the prior, shape (parameters,)."""

    def objective(self, parameters: Real) -> tuple[float, Real]:
        """Return minus the log likelihood, the prior included, and its gradient; `TOO_FAR` where it does not exist."""

    def information(self, parameters: Real) -> Real:
        """Return the Fisher information without the prior, shape (parameters, parameters)."""


class LeastSquares(Protocol):
    """Parameters at which errors are taken, and which may move."""

    @property
    def criterion(self) -> float:
        """Minus the log likelihood, but for a constant."""

    @property
    def errors(self) -> Real:
        """Errors over their deviations, shape (errors,)."""

    def slopes(self) -> Real:
        """Return the derivatives of the errors by the parameters, shape (errors, parameters)."""

    def moved(self, step: Real) -> Self:
        """Return the parameters after a step, shape (parameters,), kept within their bounds."""


_Point = TypeVar("_Point", bound=LeastSquares)


@dataclass(frozen=True, eq=False)
class Differenced:
    """Parameters of a function of errors whose derivatives are differences: a point of `least_squares`.

    Parameters
    ----------
    function
        Function of the parameters, which are of the order of 1, that returns errors over their deviations.
    parameters
        Parameters, shape (parameters,).
    """

    function: Callable[[Real], Real]
    parameters: Real

    @cached_property
    def errors(self) -> Real:
        """Errors over their deviations, shape (errors,)."""
        return self.function(self.parameters)

    @property
    def criterion(self) -> float:
        """Minus the log likelihood, but for a constant."""
        return float(self.errors @ self.errors) / 2

    def slopes(self) -> Real:
        """Return the derivatives of the errors by the parameters, shape (errors, parameters)."""
        step = LEAST_SQUARES.difference
        moved = [self.function(self.parameters + step * row) for row in np.eye(self.parameters.size)]
        return np.stack([(errors - self.errors) / step for errors in moved], axis=-1)

    def moved(self, step: Real) -> "Differenced":
        """Return the parameters after a step, shape (parameters,)."""
        return replace(self, parameters=self.parameters + step)


def least_squares(start: _Point, *, gain: float | None = None) -> _Point:
    """Return the parameters of least squares near a start.

    Parameters
    ----------
    start
        Parameters at which the search starts.
    gain
        Gain of the log likelihood at which the search ends; default: 1e-4.

    Notes
    -----
    Steps (J^T J + d diag(J^T J))^-1 J^T errors, whose damping d falls after each that decreases the criterion.

    References
    ----------
    D. W. Marquardt, An algorithm for least-squares estimation of nonlinear parameters, SIAM Journal on Applied
    Mathematics 11 (1963), 431-441.
    """
    found, damping = start, LEAST_SQUARES.begin
    least = LEAST_SQUARES.gain if gain is None else gain
    for _ in range(LEAST_SQUARES.max_steps):
        slopes = found.slopes()
        normal, slope = slopes.T @ slopes, slopes.T @ found.errors
        if not np.trace(normal) > 0:
            return found
        stretch = np.diag(np.diag(normal) + LEAST_SQUARES.least * np.trace(normal))
        while damping < LEAST_SQUARES.vain:
            better = found.moved(np.asarray(np.linalg.solve(normal + damping * stretch, -slope), dtype=np.float64))
            if better.criterion < found.criterion:
                break
            damping *= LEAST_SQUARES.more
        else:
            return found
        gained, found = found.criterion - better.criterion, better
        damping = max(damping * LEAST_SQUARES.less, LEAST_SQUARES.least)
        if gained < least:
            return found
    return found


class SpectralLikelihood(Likelihood, Protocol):
    """A likelihood of spectra by speed class, whose fit can be judged: see `sprung.likelihood.uncertainty`."""

    @property
    def spectra(self) -> "ClassSpectra":
        """Mean spectral matrices of the data, and their weights."""

    def matrix(self, parameters: Real) -> Complex:
        """Return the spectral matrices of the model, shape of the data's."""

    def whitened_derivatives(self, parameters: Real) -> Real:
        """Return sqrt(n) L^-1 (dS/dp) L^-H for each parameter p, in real coordinates; S = L L^H."""


def minimised(
    model: Likelihood, start: Real, settings: DescentSettings = DESCENT, powers: Booleans | None = None
) -> Real:
    """Return the parameters at which the likelihood is largest.

    Parameters
    ----------
    model
        Model with its data.
    start
        Parameters at which the search starts, shape (parameters,).
    settings, powers
        As for `descent`.

    Raises
    ------
    LinAlgError
        If the information is not positive definite.

    Notes
    -----
    The last point of `descent`.

    References
    ----------
    J. Nocedal and S. J. Wright, Numerical Optimization, 2nd edition, Springer, 2006, chapter 6.
    """
    return [start, *descent(model, start, settings, powers)][-1]


def scored(model: Likelihood, start: Real, *, is_vain: Callable[[Real], bool] | None = None) -> tuple[Real, bool]:
    """Return the parameters of largest likelihood by Fisher scoring, and whether the search converged.

    Parameters
    ----------
    model
        Model with its data, whose information is cheap.
    start
        Parameters at which the search starts, near the largest likelihood, shape (parameters,).
    is_vain
        Function that says whether parameters at which scoring ended are so far from the data that no further search
        is wanted; None: all are searched from.

    Raises
    ------
    LinAlgError
        If the information is singular.

    Notes
    -----
    Steps (I + diag(1 / prior_std^2))^-1 slope, shortened where they do not decrease the objective enough, then
    `descent`, for data that the model does not explain. The search has converged if the slope is below 0.1 standard
    deviations.

    References
    ----------
    J. Nocedal and S. J. Wright, Numerical Optimization, 2nd edition, Springer, 2006, section 10.3 (Gauss-Newton).
    """
    parameters = start
    value, slope = model.objective(parameters)
    for _ in range(SCORING.max_steps):
        step, squared = _score_step(model, parameters, slope)
        if squared < SCORING.scored:
            return parameters, True
        length, new_value, new_slope = _shortened(model, parameters, step, value, squared)
        if length < SCORING.shortest:
            break
        parameters, value, slope = parameters + length * step, new_value, new_slope
    if is_vain is not None and is_vain(parameters):
        return parameters, False
    parameters = [parameters, *islice(descent(model, parameters), SCORING.max_after)][-1]
    value, slope = model.objective(parameters)
    step, squared = _score_step(model, parameters, slope)
    if SCORING.scored <= squared < SCORING.converged:
        parameters = parameters + _shortened(model, parameters, step, value, squared)[0] * step
    return parameters, squared < SCORING.converged


def _score_step(model: Likelihood, parameters: Real, slope: Real) -> tuple[Real, float]:
    """Return the step of Fisher scoring, and the squared slope in standard deviations."""
    information = model.information(parameters) + np.diag(1 / model.prior_std**2)
    step = np.asarray(np.linalg.solve(information, -slope), dtype=np.float64)
    if not np.all(np.isfinite(step)):
        raise np.linalg.LinAlgError("the information is singular")
    return step, float(-slope @ step)


def descent(
    model: Likelihood, start: Real, settings: DescentSettings = DESCENT, powers: Booleans | None = None
) -> Iterator[Real]:
    """Yield the parameters after each step of a search for the largest likelihood.

    Parameters
    ----------
    model
        Model with its data.
    start
        Parameters at which the search starts, shape (parameters,).
    settings
        Ends of the search.
    powers
        Which parameters are ln of powers whose start may be far too low, such as noise; None: none.

    Raises
    ------
    LinAlgError
        If the information is not positive definite.

    Notes
    -----
    BFGS in coordinates in which the Fisher information, prior included, is the unit matrix (`preconditioner`): the
    first step is one of Fisher scoring, later ones learn how the curvature differs from the information, as it does
    where the model fits badly. A long step calls for new information, as do 25 steps with the same one.

    A step x > 0 of ln of a power is one of ln(1 + x): that of the power itself. The information about ln of a noise
    that starts too low is nearly nothing, and its step so long that all others would be shortened with it.

    References
    ----------
    J. Nocedal and S. J. Wright, Numerical Optimization, 2nd edition, Springer, 2006, chapter 6 (BFGS), section 3.1
    (sufficient decrease, backtracking by interpolation).
    """
    parameters, known_at, n_renewed, age = start, start, 0, 0
    value, slope = model.objective(parameters)
    first = value
    factor, inverse = preconditioner(model, parameters), np.eye(start.size)
    for _ in range(DESCENT.max_steps):
        step = -factor @ (inverse @ (factor.T @ slope))
        if -float(slope @ step) < settings.slope**2:
            if settings.has_last_step:
                yield parameters + step
            return
        step = step if powers is None else _of_powers(step, slope, powers)
        length, new_value, new_slope = _shortened(model, parameters, step, value, -float(slope @ step))
        if length == 0.0:
            return
        whitened = np.asarray(np.linalg.solve(factor, length * step), dtype=np.float64)
        change = factor.T @ (new_slope - slope)
        parameters = parameters + length * step
        gain, value, slope, age = value - new_value, new_value, new_slope, age + 1
        yield parameters
        if gain < settings.gain * (first - value):
            return
        is_far = bool(np.linalg.norm(whitened) > DESCENT.far) and n_renewed < DESCENT.max_far
        moved = 0.0 if powers is None else np.abs(parameters - known_at)[powers].max(initial=0.0)
        if is_far or moved > DESCENT.far_of_power or age == DESCENT.stale:
            factor, inverse, age, n_renewed = preconditioner(model, parameters), np.eye(start.size), 0, n_renewed + 1
            known_at = parameters
        else:
            inverse = _updated(inverse, whitened, change, is_first=age == 1)


def _of_powers(step: Real, slope: Real, powers: Booleans) -> Real:
    """Return a step with the rise of each power in place of that of its logarithm, unless that leads uphill."""
    of_powers = np.where(powers, np.log1p(np.maximum(step, 0.0)) + np.minimum(step, 0.0), step)
    return of_powers if slope @ of_powers < 0 else step


def _shortened(
    model: Likelihood, parameters: Real, direction: Real, value: float, descent_rate: float
) -> tuple[float, float, Real]:
    """Return length, value and slope of a step that decreases the objective enough; length 0 without any."""
    length = 1.0
    while length > DESCENT.shortest:
        new_value, slope = model.objective(parameters + length * direction)
        if new_value <= value - DESCENT.sufficient * length * descent_rate:
            return length, new_value, slope
        at_minimum = length * descent_rate / (2 * (new_value - value + length * descent_rate))  # of the parabola
        low, high = DESCENT.shorter
        length *= low if new_value == TOO_FAR else min(max(at_minimum, low), high)
    return 0.0, value, np.zeros_like(parameters)


def _updated(inverse: Real, step: Real, change: Real, *, is_first: bool) -> Real:
    """Return the inverse curvature with that along a step (BFGS); unchanged where the curvature is not positive."""
    curvature = float(step @ change)
    if curvature <= DESCENT.curved * np.linalg.norm(step) * np.linalg.norm(change):
        return inverse
    if is_first:
        inverse = inverse * (curvature / float(change @ change))
    projected = inverse @ change
    crossed = np.outer(projected, step) / curvature
    weight = (1 + float(change @ projected) / curvature) / curvature
    return np.asarray(inverse - crossed - crossed.T + weight * np.outer(step, step), dtype=np.float64)


def preconditioner(model: Likelihood, parameters: Real) -> Real:
    """Return the factor F that makes the information about the parameters, prior included, the unit matrix.

    Parameters
    ----------
    model
        Model with data.
    parameters
        Parameters at which the information is taken, shape (parameters,).

    Returns
    -------
    ndarray
        F = L^-T with L L^T the information, shape (parameters, parameters).

    Raises
    ------
    LinAlgError
        If the information is not positive definite.

    References
    ----------
    J. Nocedal and S. J. Wright, Numerical Optimization, 2nd edition, Springer, 2006, section 2.2 (scaling).
    """
    information = model.information(parameters) + np.diag(1 / model.prior_std**2)
    return np.linalg.inv(np.linalg.cholesky(information)).T
