"""Likelihood ratios of a change, for every onset and hypothesis."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from sprung._arrays import Indices, Real
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.hypotheses import (
    PRIORS,
    Hypothesis,
    hypotheses_of,
    log_prior,
    typical_directions,
    typical_sizes,
)
from sprung.diagnosis.observation import Observation
from sprung.vehicles import Component


@dataclass(frozen=True, eq=False, slots=True)
class Compared:
    """A window against the baseline.

    Parameters
    ----------
    time
        Time of its first sample [s].
    model_error
        Model error of its fit.
    residual
        Deviation from the normal state under its conditions, ln values, shape (components,).
    units
        1, then its conditions in units away from the middle of the baseline's, then how far they are outside of those,
        shape (1 + 2 conditions,).
    information
        Inverse covariance of the residual, shape (components, components).
    variances
        Variance of each row of the baseline's coordinates over that in its own windows, shape (rows,).
    """

    time: float
    model_error: float
    residual: Real
    units: Real
    information: Real
    variances: Real


def compare(baseline: Baseline, observation: Observation) -> Compared:
    """Return a window against the baseline.

    Parameters
    ----------
    baseline
        Normal state of the vehicle.
    observation
        Window with the baseline's components.
    """
    units, scales = baseline.units(observation), np.sqrt(np.diag(baseline.covariance) / np.diag(baseline.reported))
    # Beyond the conditions of the baseline windows need not scatter more, which a smaller common scale would answer.
    scatter, nuisance = baseline.scatter_of(observation), baseline.nuisance_of(observation)
    alike = scatter / np.outer(scales, scales) + nuisance
    of_window, of_usual = (
        np.einsum("ki,ij,kj->k", baseline.coordinates, each, baseline.coordinates)
        for each in (alike, baseline.reported + baseline.nuisance)
    )
    return Compared(
        observation.time,
        observation.conditions.get("model_error", 0.0),
        baseline.residual(observation),
        np.concatenate([[1.0], units, baseline.beyond(units)]),
        np.asarray(np.linalg.inv(scatter + nuisance + baseline.unmet_of(observation)), dtype=np.float64),
        of_window / of_usual,
    )


@dataclass(frozen=True, eq=False, slots=True)
class Scores:
    """Score and information of a change from each window on.

    Parameters
    ----------
    score
        Derivative of the log likelihood by a change that begins with each window, shape (windows, components).
    information
        Information on such a change, shape (windows, components, components).
    of_first
        Mean of `score` for a unit change that begins with the first window, shape (windows, components, components).
    rest
        Sum of squares of the baseline's scatter and of the windows without any change, in variances.
    degrees, of_baseline
        Degrees of freedom of `rest`, and those of them that are the baseline's.
    """

    score: Real
    information: Real
    of_first: Real
    rest: float
    degrees: float
    of_baseline: float


@dataclass(frozen=True, eq=False, slots=True)
class Hypotheses:
    """Hypotheses with the arrays that evaluate all of them at once.

    Parameters
    ----------
    values
        Hypotheses in the order of `hypotheses_of`.
    log_prior
        ln of the prior probability of each, shape (hypotheses,).
    directions
        Directions of those with one size, as large as is typical, shape (hypotheses with one size, components).
    typical
        Typical size of a change of each component over that of a spring, shape (components,).
    pairs
        Indices of the components of each pair, shape (2, pairs).
    """

    values: tuple[Hypothesis, ...]
    log_prior: Real
    directions: Real
    typical: Real
    pairs: Indices

    @property
    def without_pairs(self) -> "Hypotheses":
        """Those that are no pairs, with their own prior probabilities."""
        count = len(self.values) - self.pairs.shape[1]
        return Hypotheses(self.values[:count], self.log_prior[:count], self.directions, self.typical, self.pairs[:, :0])

    @classmethod
    @lru_cache(maxsize=16)
    def of(cls, components: tuple[Component, ...]) -> "Hypotheses":
        """Return the hypotheses about components."""
        values = hypotheses_of(components)
        return cls(
            values,
            log_prior(values),
            typical_directions(components),
            typical_sizes(components),
            np.array(np.triu_indices(len(components), 1)),
        )


@dataclass(frozen=True, eq=False, slots=True)
class Ratios:
    """Log likelihood ratios of all onsets and hypotheses.

    Parameters
    ----------
    logs
        ln of the likelihood ratio, averaged over sizes, shape (windows, hypotheses).
    explained
        Reduction of the sum of squares, in variances, shape (windows, hypotheses).
    scores
        Scores that they follow from.
    """

    logs: Real
    explained: Real
    scores: Scores

    def sizes(self, onset: int, column: int, directions: Real) -> tuple[Real, Real]:
        """Return sizes of maximum likelihood, and their covariance.

        Parameters
        ----------
        onset, column
            Window from which on there is a change, and hypothesis.
        directions
            Direction of each of its sizes, shape (sizes, components).

        Returns
        -------
        tuple
            Sizes [ln], shape (sizes,), and covariance, shape (sizes, sizes).
        """
        inverse = np.linalg.inv(directions @ self.scores.information[onset] @ directions.T)
        variance = (self.scores.rest - self.explained[onset, column]) / self.scores.degrees
        return inverse @ (directions @ self.scores.score[onset]), inverse * variance


def scores_of(windows: Sequence[Compared], start: Real, degrees: float) -> Scores:
    """Return the scores of a change from each window on.

    Parameters
    ----------
    windows
        Windows in the order of time, at least one.
    start
        Covariance of the baseline's errors of means and slopes, shape (units x components, the same).
    degrees
        Degrees of freedom of the baseline's scatter.

    Notes
    -----
    The errors of the baseline move a window by B = u (x) I and are estimated as J^-1 b with J = start^-1 + sum B^T W B
    and b = sum B^T W r. From an onset on, the score of a change is sum W r - M^T J^-1 b and its information
    sum W - M^T J^-1 M with M = sum B^T W: the part that errors of the baseline cannot explain.

    References
    ----------
    G. E. P. Box, G. C. Tiao, Intervention analysis with applications to economic and environmental problems, Journal of
    the American Statistical Association 70 (1975) 70-79.
    """
    r, u, W = (np.array([getattr(each, name) for each in windows]) for name in ("residual", "units", "information"))
    n, p = r.shape
    # Errors that move no window stay as they were.
    met = np.any(u != 0, axis=0)
    u, at = u[:, met], np.flatnonzero(np.repeat(met, p))
    weighted = (W @ r[..., None])[..., 0]
    summed = (u[:, :, None] * u[:, None]).reshape(n, -1).T @ W.reshape(n, -1)
    J = np.linalg.inv(start[np.ix_(at, at)])
    J += summed.reshape(u.shape[1], u.shape[1], p, p).swapaxes(1, 2).reshape(at.size, at.size)
    errors_of, pulled = np.linalg.inv(J), (u.T @ weighted).ravel()
    errors = errors_of @ pulled
    moved = _from_onset((u[:, :, None, None] * W[:, None]).reshape(n, -1, p))
    hidden = moved.swapaxes(-1, -2) @ errors_of
    whole = _from_onset(W)
    return Scores(
        np.asarray(_from_onset(weighted) - errors @ moved, dtype=np.float64),
        np.asarray(whole - hidden @ moved, dtype=np.float64),
        np.asarray(whole - hidden @ moved[0], dtype=np.float64),
        degrees + float(np.sum(r * weighted) - pulled @ errors),
        degrees + float(n * p),
        degrees,
    )


def _from_onset(rows: Real) -> Real:
    """Return sums from each window on."""
    return np.asarray(np.cumsum(rows[::-1], axis=0)[::-1], dtype=np.float64)


def ratios_of(scores: Scores, hypotheses: Hypotheses) -> Ratios:
    """Return the likelihood ratios of all onsets and hypotheses.

    Parameters
    ----------
    scores
        Scores of a change from each window on.
    hypotheses
        Hypotheses about the components.

    Notes
    -----
    With the information K of the sizes of a hypothesis, its score s, and the prior N(0, C) of its sizes, s^T (K +
    C^-1)^-1 s of the sum of squares is explained, and the likelihood ratio of Student's t with f degrees of freedom is
    (rest / (rest - explained))^(f / 2) / det(1 + C K)^(1 / 2).
    """
    explained, volumes = explained_by(scores.score, scores.information, hypotheses)
    logs = scores.degrees / 2 * np.log(scores.rest / (scores.rest - explained)) - volumes
    return Ratios(logs, explained, scores)


def explained_by(score: Real, information: Real, hypotheses: Hypotheses) -> tuple[Real, Real]:
    """Return what each hypothesis explains of the sum of squares, and ln of the volume of its sizes.

    Parameters
    ----------
    score
        Scores, shape (.., windows, components).
    information
        Their information, shape (windows, components, components).
    hypotheses
        Hypotheses about the components.

    Returns
    -------
    tuple
        What is explained, shape (.., windows, hypotheses), and volumes, shape (windows, hypotheses).
    """
    lines, between, spread = hypotheses.directions, 1 / PRIORS.size**2, 1 / PRIORS.unmodelled_size**2
    known, each, a, b, c = _informations(information, hypotheses)
    first, second = hypotheses.pairs
    one, two = ((score * hypotheses.typical)[..., parts] for parts in (first, second))
    determinant = (a + between) * (b + between) - c**2
    explained = [
        (score @ lines.T) ** 2 / (known + between),
        np.sum(score * np.matmul(score[..., None, :], np.linalg.inv(each))[..., 0, :], axis=-1, keepdims=True),
        (one * (one * (b + between) - two * c) + two * (two * (a + between) - one * c)) / determinant,
    ]
    volumes = [
        np.log1p(known * PRIORS.size**2) / 2,
        np.linalg.slogdet(each / spread)[1][:, None] / 2,
        np.log(determinant * PRIORS.size**4) / 2,
    ]
    return np.concatenate(explained, axis=-1), np.concatenate(volumes, axis=-1)


def _informations(information: Real, hypotheses: Hypotheses) -> tuple[Real, Real, Real, Real, Real]:
    """Return the information of single sizes, of an unmodelled change with its prior, and of each pair: a, b and c."""
    lines, (first, second) = hypotheses.directions, hypotheses.pairs
    known = np.einsum("hi,wij,hj->wh", lines, information, lines)
    each = information + np.eye(information.shape[-1]) / PRIORS.unmodelled_size**2
    of_pairs = information * np.outer(hypotheses.typical, hypotheses.typical)
    return known, each, of_pairs[:, first, first], of_pairs[:, second, second], of_pairs[:, first, second]


def dimensions_of(information: Real, hypotheses: Hypotheses) -> Real:
    """Return the mean of what each hypothesis explains of chance alone, shape (windows, hypotheses).

    Parameters
    ----------
    information
        Information of a change from each window on, shape (windows, components, components).
    hypotheses
        Hypotheses about the components.

    Notes
    -----
    tr K (K + C^-1)^-1 with the information K and the prior covariance C of the sizes.
    """
    between = 1 / PRIORS.size**2
    known, each, a, b, c = _informations(information, hypotheses)
    of_pairs = (a * (b + between) + b * (a + between) - 2 * c**2) / ((a + between) * (b + between) - c**2)
    of_all = np.einsum("wij,wji->w", information, np.linalg.inv(each))[:, None]
    return np.concatenate([known / (known + between), of_all, of_pairs], axis=-1)


def evidence_of(ratios: Ratios, hypotheses: Hypotheses) -> float:
    """Return ln of the e-detector: the sum over onsets of the mean over hypotheses."""
    return float(np.logaddexp.reduce(ratios.logs + hypotheses.log_prior, axis=(0, 1)))
