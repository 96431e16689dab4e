"""Likelihood ratios of a change, for every onset and hypothesis."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from sprung._arrays import Indices, Real
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.hypotheses import PRIORS, Hypothesis, hypotheses_of, log_prior, typical_sizes
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.scatter import SERIAL
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
    root
        Root of the covariance of its scatter, which may be correlated with that of the window before, shape
        (components, components).
    """

    time: float
    model_error: float
    residual: Real
    units: Real
    information: Real
    root: Real


def compare(baseline: Baseline, observation: Observation) -> Compared:
    """Return a window against the baseline.

    Parameters
    ----------
    baseline
        Normal state of the vehicle.
    observation
        Window with the baseline's components.
    """
    units = baseline.units(observation)
    return Compared(
        observation.time,
        observation.conditions.get("model_error", 0.0),
        baseline.residual(observation),
        np.concatenate([[1.0], units, baseline.beyond(units)]),
        np.asarray(np.linalg.inv(baseline.covariance_of(observation)), dtype=np.float64),
        np.asarray(np.linalg.cholesky(baseline.scatter_of(observation)), dtype=np.float64),
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
    def of(cls, components: tuple[Component, ...]) -> "Hypotheses":
        """Return the hypotheses about components."""
        values = hypotheses_of(components)
        directions = [value.direction(components) for value in values if len(value.changes) == 1]
        typical = typical_sizes(components)
        return cls(
            values,
            log_prior(values),
            np.array(directions).reshape(-1, len(components)) * typical,
            typical,
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

    def sizes(self, column: int, directions: Real) -> tuple[Real, Real]:
        """Return sizes of maximum likelihood for every onset, and their covariances.

        Parameters
        ----------
        column
            Hypothesis.
        directions
            Direction of each of its sizes, shape (sizes, components).

        Returns
        -------
        tuple
            Sizes [ln], shape (windows, sizes), and covariances, shape (windows, sizes, sizes).
        """
        inverse = np.linalg.inv(directions @ self.scores.information @ directions.T)
        sizes = np.einsum("wab,wb->wa", inverse, self.scores.score @ directions.T)
        variance = (self.scores.rest - self.explained[:, column]) / self.scores.degrees
        return sizes, inverse * variance[:, None, None]


@dataclass(frozen=True, eq=False, slots=True)
class Innovations:
    """What the windows before do not predict of windows that follow each other.

    Parameters
    ----------
    values
        Innovations z_w = r_w - A_w r_(w - 1), shape (windows, components).
    information
        Inverse covariance of each, shape (windows, components, components).
    carried
        A_w, what is predicted of each from the window before, shape (windows, components, components).
    units
        Units of each window and of the one before, shape (2, windows, units).
    errors, errors_of
        Errors of the baseline, shape (units x components,), and their covariance.
    rest, degrees, of_baseline
        As in `Scores`.
    log_likelihood
        ln of the likelihood of the windows without any change, up to a constant.
    """

    values: Real
    information: Real
    carried: Real
    units: Real
    errors: Real
    errors_of: Real
    rest: float
    degrees: float
    of_baseline: float
    log_likelihood: float

    @classmethod
    def of(
        cls, windows: Sequence[Compared], start: Real, degrees: float, correlation: float = 0.0, squares: float = 1.0
    ) -> "Innovations":
        """Return the innovations of windows.

        Parameters
        ----------
        windows
            Windows in the order of time, at least one.
        start
            Covariance of the baseline's errors of means and slopes, shape (units x components, the same).
        degrees
            Degrees of freedom of the baseline's scatter.
        correlation
            Correlation of the scatter of consecutive windows.
        squares
            Factor of the variances of the scatter with this correlation.

        Notes
        -----
        A_w = rho L_w L_(w - 1)^T W_(w - 1), and the covariance of an innovation is V_w - A_w V_(w - 1) A_w^T: L_w L_w^T
        is the scatter, V_w = W_w^-1 has also what is not correlated. The errors of the baseline move an innovation by
        B_w = u_w (x) I - u_(w - 1) (x) A_w and are estimated as J^-1 b with J = start^-1 + sum B^T W B and
        b = sum B^T W z, W now that of innovations.
        """
        r, u, W, roots = (
            np.array([getattr(each, name) for each in windows]) for name in ("residual", "units", "information", "root")
        )
        n, p = r.shape
        A = np.zeros_like(W)
        if correlation:
            V = np.linalg.inv(W) + (squares - 1) * roots @ roots.swapaxes(-1, -2)
            A[1:] = correlation * squares * roots[1:] @ roots[:-1].swapaxes(-1, -2) @ np.linalg.inv(V[:-1])
            V[1:] -= A[1:] @ V[:-1] @ A[1:].swapaxes(-1, -2)
            W = np.linalg.inv(V)
        # Errors that move no window stay as they were.
        met = np.any(u != 0, axis=0)
        units, at = np.stack([u, np.roll(u, 1, axis=0)])[..., met], np.flatnonzero(np.repeat(met, p))
        start = start[np.ix_(at, at)]
        crossed = _summed(units[0], units[1], W @ A)
        J = np.linalg.inv(start) + _summed(units[0], units[0], W) - crossed - crossed.T
        J += _summed(units[1], units[1], A.swapaxes(-1, -2) @ W @ A)
        z = r - (A @ np.roll(r, 1, axis=0)[..., None])[..., 0]
        weighted, errors_of = (W @ z[..., None])[..., 0], np.asarray(np.linalg.inv(J), dtype=np.float64)
        pulled = units[0].T @ weighted - units[1].T @ (A.swapaxes(-1, -2) @ weighted[..., None])[..., 0]
        errors = np.asarray(errors_of @ pulled.ravel(), dtype=np.float64)
        rest = degrees + float(np.sum(z * weighted) - pulled.ravel() @ errors)
        volume = np.sum(np.linalg.slogdet(W)[1]) - np.linalg.slogdet(start)[1] - np.linalg.slogdet(J)[1]
        likelihood = (volume + degrees * np.log(degrees) - (degrees + n * p) * np.log(rest)) / 2
        return cls(z, W, A, units, errors, errors_of, rest, degrees + float(n * p), degrees, float(likelihood))

    @property
    def scores(self) -> Scores:
        """Scores of a change from each window on.

        Notes
        -----
        A change moves the innovation of its first window by I, and later ones by I - A. With D this effect from an
        onset on, its score is s = sum D^T W z - M^T J^-1 b and its information I = sum D^T W D - M^T J^-1 M with
        M = sum B^T W D: the part that errors of the baseline cannot explain.

        References
        ----------
        G. E. P. Box, G. C. Tiao, Intervention analysis with applications to economic and environmental problems,
        Journal of the American Statistical Association 70 (1975) 70-79.
        """
        W, lasting = self.information, np.eye(self.values.shape[1]) - self.carried
        weighted, W_lasting = W @ self.values[..., None], W @ lasting
        later = lasting.swapaxes(-1, -2) @ W_lasting
        score = _from_onset(weighted, lasting.swapaxes(-1, -2) @ weighted)[..., 0]
        moved = _from_onset(self._seen(W), self._seen(W_lasting))
        hidden = moved.swapaxes(-1, -2) @ self.errors_of
        return Scores(
            score - self.errors @ moved,
            _from_onset(W, later) - hidden @ moved,
            _from_onset(W_lasting, later) - hidden @ moved[0],
            self.rest,
            self.degrees,
            self.of_baseline,
        )

    def _seen(self, parts: Real) -> Real:
        """Return B^T parts of each window, parts of shape (windows, components, components)."""
        both = parts, self.carried.swapaxes(-1, -2) @ parts
        now, then = (rows[:, :, None, None] * part[:, None] for rows, part in zip(self.units, both, strict=True))
        return np.asarray((now - then).reshape(len(parts), -1, parts.shape[-1]), dtype=np.float64)


def _summed(first: Real, second: Real, parts: Real) -> Real:
    """Return the sum over windows of (first second^T) (x) parts, shape (units x components, the same)."""
    n, a = first.shape
    p = parts.shape[-1]
    every = (first[:, :, None] * second[:, None]).reshape(n, -1).T @ parts.reshape(n, -1)
    return np.asarray(every.reshape(a, a, p, p).swapaxes(1, 2).reshape(a * p, a * p), dtype=np.float64)


def _from_onset(first: Real, later: Real) -> Real:
    """Return sums from each window on: `first` of that window, and `later` of those after it."""
    return np.asarray(np.cumsum(later[::-1], axis=0)[::-1] - later + first, dtype=np.float64)


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
    return float(logsumexp(ratios.logs + hypotheses.log_prior))


def lasting_evidence(windows: Sequence[Compared], baseline: Baseline, hypotheses: Hypotheses) -> float:
    """Return ln of the e-detector for windows of which consecutive ones are correlated, nobody knows how strongly.

    Parameters
    ----------
    windows
        Windows in the order of time, at least one.
    baseline
        Baseline that they are compared with.
    hypotheses
        Hypotheses about the components.

    Notes
    -----
    With p the probability of a correlation by the baseline, and f and f0 the likelihoods with and without a change,
    each ratio is sum p f / sum q f0. Up to 0.3 q is p: the mean is at most 1 without a change if the correlation is
    drawn from p. Above, q is 1: it is at most 1 for each of these correlations, however improbable the baseline makes
    it (universal inference).

    References
    ----------
    L. Wasserman, A. Ramdas, S. Balakrishnan, Universal inference, Proceedings of the National Academy of Sciences 117
    (2020) 16880-16890.
    """
    degrees = baseline.degrees_of_freedom
    every = [
        Innovations.of(windows, squares * baseline.doubt_beyond(correlation), degrees, correlation, squares)
        for correlation, squares in zip(SERIAL.correlations, baseline.squares.tolist(), strict=True)
    ]
    likelihoods = np.array([each.log_likelihood for each in every])
    known = np.log(np.maximum(baseline.correlations, np.finfo(float).tiny))
    counted = np.where(np.array(SERIAL.correlations) < SERIAL.strong, known, 0.0)
    evidence = [evidence_of(ratios_of(each.scores, hypotheses), hypotheses) for each in every]
    return float(logsumexp(known + likelihoods + evidence) - logsumexp(counted + likelihoods))
