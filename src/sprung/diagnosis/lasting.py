"""Evidence of a change for windows of an unknown serial correlation and parts of an unknown, unequal scatter."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import gammaln

from sprung._arrays import Real
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.hypotheses import PRIORS
from sprung.diagnosis.ratios import Compared, Hypotheses
from sprung.diagnosis.scatter import (
    LASTING,
    WEIGHTS,
    directions,
    independent_directions,
    whitened,
)

#: Nodes of the mean over sizes (Gauss and Hermite), ln of their weights, and their spread over that of a normal size.
_NODES, _WEIGHTS = np.polynomial.hermite_e.hermegauss(9)
_SPREAD = 1.2


def lasting_evidence(windows: Sequence[Compared], baseline: Baseline, hypotheses: Hypotheses) -> float:
    """Return ln of the e-detector for windows that may be correlated, and for parts that may scatter unequally.

    Parameters
    ----------
    windows
        Windows in the order of time, at least one.
    baseline
        Baseline that they are compared with.
    hypotheses
        Hypotheses about the components, of which those with one size are weighed.

    Notes
    -----
    Coordinates of a window are uncorrelated, and each is as Student's t: all but those of a whole kind have one
    variance in common where parts scatter alike. Where they scatter unequally, the estimate of the change alone has a
    variance of its own, drawn about the common one; what that leaves of the coordinates is in both cases the same, so
    that their unequal scatter decides nothing. With p the probability of the scatter and of a correlation by the
    baseline, p0 that before any window, and f and f0 the likelihoods with and without a change, each ratio is
    sum p f / sum q f0, where q is c p / p0, between 0.001 and 1.

    Whichever of them is true, the mean of a ratio without a change is at most that of 1 / q over baselines: up to
    1 + E[p0 / (c p)] = 1 + 1 / c, by which ratios are divided. For p / p0 is the likelihood of the true one over that
    of a mixture of all, whose inverse has the mean 1 (universal inference; what the baseline excludes is left out).

    References
    ----------
    L. Wasserman, A. Ramdas, S. Balakrishnan, Universal inference, Proceedings of the National Academy of Sciences 117
    (2020) 16880-16890.
    """
    prior = hypotheses.log_prior[: len(hypotheses.directions)]
    known = np.log(np.maximum(baseline.weights, np.finfo(float).tiny))
    counted = np.clip(np.log(LASTING.caution / LASTING.prior) + known, np.log(LASTING.rare), 0.0)
    with_change: list[Real] = []
    without: list[Real] = []
    for column, correlation in enumerate(LASTING.correlations):
        series = _Series.of(windows, baseline, hypotheses, correlation)
        alike, own = _Scales.of(baseline, column)
        size = len(baseline.components)
        first, alone = series.part(slice(size)), series.part(slice(size, None))
        likelihood = first.log_likelihood(alike)
        likelihoods = np.array([np.full(len(prior), likelihood), likelihood + first.log_apart(alike, own, alone)])
        ratios = np.array([first.log_ratios(alike), alone.own_log_ratios(own)])
        with_change.append((known[:, column, None] + likelihoods)[..., None] + ratios)
        without.append(counted[:, column, None] + likelihoods)
    total = np.logaddexp.reduce
    each = total(with_change, axis=(0, 1)) - total(without, axis=(0, 1))[:, None]
    return float(total(each + (prior - total(prior))[:, None], axis=(0, 1)) - np.log1p(1 / LASTING.caution))


@dataclass(frozen=True, eq=False, slots=True)
class _Scales:
    """Variances of coordinates over the reported ones: of groups that have one in common, or of each by itself.

    Parameters
    ----------
    groups
        1 where a coordinate is of a group, shape (groups, coordinates).
    squares
        Sum of squares of each group by the baseline, shape (groups,).
    degrees
        Their degrees of freedom, shape (groups,).
    """

    groups: Real
    squares: Real
    degrees: Real

    @classmethod
    def of(cls, baseline: Baseline, column: int) -> tuple["_Scales", "_Scales"]:
        """Return the variances of uncorrelated coordinates where parts scatter alike, and of each change by itself.

        Of all of a kind together, which common changes move, each has a variance by itself in either case.
        """
        size, squares, own = len(baseline.components), baseline.squares[column], baseline.degrees
        n_pairs, (_, n_alike) = len(directions(baseline.components)[0]), independent_directions(baseline.components)
        before = max(baseline.degrees_of_freedom - float(np.sum(own[:n_pairs])), WEIGHTS.reported)
        common = (float(np.sum(squares[:n_pairs])) + before) / (float(np.sum(own[:n_pairs])) + before)
        spreads = np.where(np.arange(len(own)) < size, WEIGHTS.common, LASTING.spread)
        each = cls(np.eye(len(own)), squares + spreads * common, own + spreads)
        alike = (np.arange(size) < n_alike).astype(np.float64)
        return cls(
            np.vstack([alike, np.eye(size)[n_alike:]]),
            np.concatenate([[alike @ squares[:size] + before], each.squares[n_alike:size]]),
            np.concatenate([[alike @ own[:size] + before], each.degrees[n_alike:size]]),
        ), cls(each.groups[size:, size:], each.squares[size:], each.degrees[size:])


@dataclass(frozen=True, eq=False, slots=True)
class _Series:
    """Coordinates of windows as series, whitened by a correlation; sums are over windows, in variances of scale 1.

    Parameters
    ----------
    volume
        ln of the square root of the determinant of their information, without that of their scales.
    n_windows
        Number of windows.
    rest
        Sum of squares that errors of the baseline leave, shape (coordinates,).
    scores, informations
        Score and information of a change of each coordinate from each window on, shape (coordinates, windows).
    moved
        Change of each coordinate by each hypothesis, shape (hypotheses, coordinates).
    """

    volume: Real
    n_windows: int
    rest: Real
    scores: Real
    informations: Real
    moved: Real

    @classmethod
    def of(
        cls, windows: Sequence[Compared], baseline: Baseline, hypotheses: Hypotheses, correlation: float
    ) -> "_Series":
        """Return the series of windows."""
        rows, count = baseline.coordinates, len(windows)
        residuals, u = (np.array([getattr(each, name) for each in windows]) for name in ("residual", "units"))
        deviations = 1 / np.sqrt([each.variances for each in windows])
        met = np.any(u != 0, axis=0)
        doubt = baseline.doubt_beyond(correlation).reshape(u.shape[1], rows.shape[1], u.shape[1], rows.shape[1])
        start = np.einsum("ki,aibj,kj->kab", rows, doubt[met][:, :, met], rows, optimize=True)
        widened = np.einsum("ki,ij,kj->k", rows, baseline.covariance + baseline.nuisance, rows)
        start = start / widened[:, None, None]
        y = whitened(residuals @ rows.T * deviations, correlation).T
        X = whitened(u[:, None, met] * deviations[..., None], correlation).swapaxes(0, 1)
        # A change from a window on has its whole innovation there, and those of a constant change after it.
        later = whitened(deviations, correlation).T
        first = deviations.T / np.append(1.0, np.full(count - 1, np.sqrt(1 - correlation**2))) - later

        def since(values: Real, power: int = 1) -> Real:
            """Sums over windows from each one on, along the last axis but one, with the innovations of its change."""
            sums = (later**power)[..., None] * values
            at = ((first + later) ** power - later**power)[..., None] * values
            return np.asarray(sums[:, ::-1].cumsum(axis=1)[:, ::-1] + at, dtype=np.float64)

        J = np.linalg.inv(start) + X.swapaxes(-1, -2) @ X
        pulled = (X.swapaxes(-1, -2) @ y[..., None])[..., 0]
        errors = np.linalg.solve(J, pulled[..., None])[..., 0]
        crossed = since(X).swapaxes(-1, -2)
        volume = (np.linalg.slogdet(start)[1] + np.linalg.slogdet(J)[1]) / 2
        volume = volume + (count - 1) / 2 * np.log1p(-(correlation**2)) - np.sum(np.log(deviations), axis=0)
        return cls(
            -volume,
            count,
            np.sum(y**2, axis=1) - np.sum(pulled * errors, axis=1),
            since(y[..., None])[..., 0] - (crossed.swapaxes(-1, -2) @ errors[..., None])[..., 0],
            since(np.ones((1, count, 1)), 2)[..., 0] - np.sum(crossed * np.linalg.solve(J, crossed), axis=1),
            hypotheses.directions @ rows.T,
        )

    def part(self, rows: slice) -> "_Series":
        """Return some of the coordinates."""
        return _Series(
            self.volume[rows],
            self.n_windows,
            self.rest[rows],
            self.scores[rows],
            self.informations[rows],
            self.moved[:, rows],
        )

    def log_likelihood(self, scales: _Scales) -> float:
        """Return ln of the likelihood without any change, up to a constant."""
        count = self.n_windows * np.sum(scales.groups, axis=1)
        return float(np.sum(self.volume) + np.sum(_student(scales, count, scales.groups @ self.rest)))

    def log_apart(self, scales: _Scales, own: _Scales, alone: "_Series") -> Real:
        """Return ln of the likelihood if the estimate of a change scatters by itself over that if alike, per change.

        The first group loses one coordinate then. A change of all of a kind does not lie in it: -inf.
        """
        inside, count = scales.groups[0], self.n_windows
        share = self.moved**2 @ inside / np.sum(self.moved**2, axis=1)
        taken, rest, size = share * alone.rest, inside @ self.rest, np.sum(inside)
        first = _Scales(scales.groups[:1], scales.squares[0], scales.degrees[0])
        left = _student(first, count * (size - 1), np.maximum(rest - taken, 0.0))
        apart = left + _student(own, count, taken) - _student(first, count * size, rest)
        return np.where(share > 0.5, apart, -np.inf)

    def own_log_ratios(self, scales: _Scales) -> Real:
        """Return ln of the ratios of a change by its estimate alone, shape (hypotheses, windows): row by row.

        The size has the prior N(0, C), times the variance of the coordinate over the reported one, which is unknown.
        """
        moved, prior, rest = np.diag(self.moved)[:, None], 1 / PRIORS.size**2, (scales.squares + self.rest)[:, None]
        known = moved**2 * self.informations
        explained = (moved * self.scores) ** 2 / (known + prior)
        after = (scales.degrees + self.n_windows)[:, None]
        return np.asarray(-after / 2 * np.log1p(-explained / rest) - np.log1p(known / prior) / 2, dtype=np.float64)

    def log_ratios(self, scales: _Scales) -> Real:
        """Return ln of the ratios of a change of each hypothesis from each window on, shape (hypotheses, windows).

        Notes
        -----
        The mean over the size x, whose prior is N(0, C), of the product over groups of (1 + sum_k (m_k^2 x^2 I_k -
        2 m_k x s_k) / rest)^(-f / 2) by nodes about the size and its standard deviation that a normal distribution
        would have.
        """
        degrees = scales.degrees + self.n_windows * np.sum(scales.groups, axis=1)
        rest, prior = scales.squares + scales.groups @ self.rest, 1 / PRIORS.size**2
        weights = (degrees / rest) @ scales.groups
        known = (self.moved**2 * weights) @ self.informations + prior
        centre, std = (self.moved * weights) @ self.scores / known, _SPREAD / np.sqrt(known)
        sizes = centre + std * _NODES[:, None, None]
        logs = (np.log(_WEIGHTS) + _NODES**2 / 2)[:, None, None] - sizes**2 * prior / 2
        moved = np.where(np.abs(self.moved) > 1e-9 * np.abs(self.moved).max(axis=1, keepdims=True), self.moved, 0.0)
        for group, squares, degree in zip(scales.groups, rest, degrees, strict=True):
            touched = np.any(moved * group, axis=1)
            own, of_group = sizes[:, touched], moved[touched] * group
            twice, squared = of_group @ self.scores * 2 / squares, of_group**2 @ self.informations / squares
            logs[:, touched] -= degree / 2 * np.log1p(own * (own * squared - twice))
        every = np.logaddexp.reduce(logs, axis=0) + np.log(std) + np.log(prior / (2 * np.pi)) / 2
        return np.asarray(every, dtype=np.float64)


def _student(scales: _Scales, count: Real | float, rest: Real) -> Real:
    """Return ln of the density of values by their count and their sum of squares, Student's t, up to a constant."""
    before, after = scales.degrees, scales.degrees + count
    each = gammaln(after / 2) - gammaln(before / 2) + before / 2 * np.log(scales.squares)
    return np.asarray(each - after / 2 * np.log(scales.squares + rest), dtype=np.float64)
