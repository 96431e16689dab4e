"""Evidence that lasts: of a change, with unknown serial correlation of windows and an unknown scatter of every part."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.special import logsumexp

from sprung._arrays import Real
from sprung.diagnosis.baseline import Baseline, slope_covariances
from sprung.diagnosis.hypotheses import PRIORS
from sprung.diagnosis.ratios import Compared, Hypotheses
from sprung.diagnosis.scatter import SERIAL, WEIGHTS


@dataclass(frozen=True, slots=True)
class OwnScatterSettings:
    """What is known of how alike parts scatter, before any window."""

    #: Probability that parts scatter unequally, and otherwise as their windows report up to a common factor.
    unequal: float = 0.1
    #: Standard deviation of ln(variance of a part / common one) then: most parts within a factor of 2 of the scatter.
    spread: float = 0.8
    #: Largest variance of a part that is weighed, and the inverse of the smallest, over the common one.
    largest: float = 16.0
    #: Share of a change up to which a contrast counts as not moved by it.
    moved: float = 0.1

    @property
    def scales(self) -> tuple[Real, Real]:
        """Variances of a part over the common one where unequal, shape (scales,), and ln of their probabilities."""
        logs = np.arange(-np.log(self.largest), np.log(self.largest) + 0.1, np.log(2))
        weights = -((logs / self.spread) ** 2) / 2
        return np.exp(logs), np.asarray(weights - logsumexp(weights), dtype=np.float64)


OWN_SCATTER = OwnScatterSettings()


def contrasts(first: Real, baseline: Baseline, hypotheses: Hypotheses) -> Real:
    """Return what of a window shows the size of each change of one size best, shape (changes, components).

    Parameters
    ----------
    first
        Covariance of the scatter of a window, shape (components, components).
    baseline
        Baseline that windows are compared with.
    hypotheses
        Hypotheses about the components.

    Notes
    -----
    c = V^-1 d / (d^T V^-1 d) for a change along d, with the covariance V of a window whose conditions are one unit
    outside of those of the baseline: what moves a kind together nearly cancels.
    """
    slopes = sum(slope_covariances(baseline.components, baseline.model_error), baseline.nuisance)
    rows = np.linalg.solve(first + slopes, hypotheses.directions.T)
    return np.asarray((rows / np.sum(hypotheses.directions.T * rows, axis=0)).T, dtype=np.float64)


def witnesses_of(rows: Real, hypotheses: Hypotheses) -> Real:
    """Return `Series.witnesses` of contrasts as rows."""
    moved = np.abs(hypotheses.directions @ rows.T) / np.abs(np.sum(hypotheses.directions * rows, axis=1))
    is_single = np.arange(len(rows)) < rows.shape[1]
    return np.asarray((moved < OWN_SCATTER.moved) & is_single | np.eye(len(rows), dtype=bool), dtype=np.float64)


@dataclass(frozen=True, eq=False, slots=True)
class Series:
    """Windows seen by contrasts, each by itself. Axes before those named are vehicles.

    Parameters
    ----------
    values
        Contrasts of the residuals, shape (contrasts, windows).
    variances, scatter
        Their variances, and the part of these that may be correlated with the window before, the same shape.
    units
        Units of each window: see `Compared`, shape (windows, units).
    own, beyond
        Covariances of the errors of mean and slopes, and of slopes beyond the conditions met, by contrasts, shape
        (contrasts, units, units) and (contrasts, units beyond, the same).
    n_learning
        Number of the baseline's windows that are the vehicle's own.
    correlations, squares
        As in `Baseline`, shape (8,).
    witnesses
        Whether the likelihood of a contrast (second axis) counts for the correlation and the scatter when a change
        (first axis) is weighed: its own, and those of single components that it hardly moves, shape (contrasts,
        contrasts).
    log_prior
        ln of the prior probability of the change of each contrast, shape (contrasts,).
    """

    values: Real
    variances: Real
    scatter: Real
    units: Real
    own: Real
    beyond: Real
    n_learning: int
    correlations: Real
    squares: Real
    witnesses: Real
    log_prior: Real

    @classmethod
    def of(cls, windows: Sequence[Compared], baseline: Baseline, hypotheses: Hypotheses) -> "Series":
        """Return the series of windows in the order of time, at least one."""
        rows = contrasts(windows[0].root @ windows[0].root.T, baseline, hypotheses)
        r, u, W, roots = (
            np.array([getattr(each, name) for each in windows]) for name in ("residual", "units", "information", "root")
        )
        doubt = baseline.doubt_beyond()
        size, n_own = len(baseline.components), len(baseline.information)
        seen = (doubt[part, part] for part in (slice(n_own), slice(n_own, None)))
        own, beyond = (
            np.einsum("ki,aibj,kj->kab", rows, each.reshape(-1, size, len(each) // size, size), rows) for each in seen
        )
        count = len(rows)
        # Where parts scatter alike, windows scatter as they report: the few of a baseline hardly show anything else.
        learnt, reported = (
            np.einsum("ki,ij,kj->k", rows, each + baseline.nuisance, rows)
            for each in (baseline.covariance, baseline.reported)
        )
        scale = (reported / learnt if baseline.n_windows else np.ones(count))[:, None]
        return cls(
            rows @ r.T,
            scale * np.einsum("ki,wij,kj->kw", rows, np.linalg.inv(W), rows),
            scale * np.sum((rows @ roots) ** 2, axis=-1).T,
            u,
            scale[..., None] * own,
            scale[..., None] * beyond,
            baseline.n_windows if baseline.version > 0 else 0,
            baseline.correlations,
            baseline.squares,
            witnesses_of(rows, hypotheses),
            hypotheses.log_prior[:count] - logsumexp(hypotheses.log_prior[:count]),
        )

    def evidence(self) -> Real:
        """Return ln of the e-detector, shape of the axes of vehicles.

        Notes
        -----
        A contrast is a series y_w = m u_w + size 1[w >= onset] + e_w of one dimension. With a correlation rho it is
        whitened to z_w = y_w - a_w y_(w - 1). Its variance is a scale x times the common one of the contrasts that the
        change hardly moves: 1 where parts scatter alike, else with a log-normal prior. With p the probability of rho
        and x, and l their likelihood without a change by this contrast and those, a change of ratio R has the evidence
        sum p l R / sum q l, and the e-detector is the mean over changes. Up to a correlation of 0.3, q is p; above, it
        is 1 for rho: the mean of R is at most 1 for each of these, however improbable the baseline makes it (universal
        inference).

        References
        ----------
        L. Wasserman, A. Ramdas, S. Balakrishnan, Universal inference, Proceedings of the National Academy of Sciences
        117 (2020) 16880-16890.
        """
        rho, squares = np.array(SERIAL.correlations), self.squares[..., None, :]
        n = self.values.shape[-1]
        v, s = (each[..., None, :] for each in (self.variances, self.scatter))
        v = v + (squares[..., None] - 1) * s
        a = np.zeros(v.shape)
        steps = np.sqrt(s[..., 1:] * s[..., :-1])
        a[..., 1:] = rho[:, None] * squares[..., None] * steps / v[..., :-1]
        left = v.copy()
        left[..., 1:] -= a[..., 1:] ** 2 * v[..., :-1]
        z = self.values[..., None, :] - a * _before(self.values[..., None, :])
        units = self.units[..., None, None, :, :]
        g = units - a[..., None] * _before(units.swapaxes(-1, -2)).swapaxes(-1, -2)
        heavy, lasting = g / left[..., None], 1 - a
        share = (1 - rho * (1 - 2 / self.n_learning)) / (1 + rho) if self.n_learning else np.ones(len(rho))
        start = np.zeros((*squares.shape[:-2], self.values.shape[-2], len(rho), g.shape[-1], g.shape[-1]))
        n_own = self.own.shape[-1]
        start[..., :n_own, :n_own] = np.linalg.inv(self.own)[..., None, :, :] * share[:, None, None]
        start[..., n_own:, n_own:] = np.linalg.inv(self.beyond)[..., None, :, :]
        start /= squares[..., None, None]
        J = start + heavy.swapaxes(-1, -2) @ g
        errors_of = np.linalg.inv(J)
        errors = (errors_of @ np.sum(heavy * z[..., None], axis=-2)[..., None])[..., 0]
        rest = np.sum(z**2 / left, axis=-1) - np.sum(np.sum(heavy * z[..., None], axis=-2) * errors, axis=-1)
        volume = np.linalg.slogdet(start)[1] - np.linalg.slogdet(J)[1] - np.sum(np.log(left), axis=-1)
        moved = _from_onset(heavy, heavy * lasting[..., None], axis=-2)
        score = _from_onset(z / left, z * lasting / left) - np.sum(moved * errors[..., None, :], axis=-1)
        information = _from_onset(1 / left, lasting**2 / left) - np.sum(moved * (moved @ errors_of), axis=-1)
        explained = score**2 / (information + 1 / PRIORS.size**2)
        volumes = np.log1p(information * PRIORS.size**2) / 2
        # Axes: change, contrast that bears witness, correlation, scale.
        scales, weights = OWN_SCATTER.scales
        others = self.witnesses - np.eye(self.witnesses.shape[-1])
        count = (WEIGHTS.pairs + n * np.sum(others, axis=-1))[..., None, None]
        common = (WEIGHTS.pairs + others @ rest)[..., None] / count
        logs = -(n * np.log(scales) + rest[..., None, :, :, None] / (common[..., None, :, :] * scales)) / 2
        alike = -rest[..., None, :, :] / common[..., None, :, 0] / 2
        unequal = logsumexp(logs + weights, axis=-1)
        both = np.stack([alike, unequal], axis=-1)
        seen = others[..., None, None] * (
            both + (volume[..., None, :, :, None] - n * np.log(common)[..., None, :, :]) / 2
        )
        every = np.concatenate([np.ones(1), scales])
        prior = np.concatenate([[np.log1p(-OWN_SCATTER.unequal)], np.log(OWN_SCATTER.unequal) + weights])
        variance, free = common * every, count + n
        own = (volume[..., None] - n * np.log(variance)) / 2 - free / 2 * np.log1p(rest[..., None] / (count * variance))
        likelihood = np.sum(seen, axis=-3)[..., [0] + [1] * len(scales)] + own + prior
        whole = rest[..., None] + count * variance
        logs = -free[..., None] / 2 * np.log1p(-explained[..., None, :] / whole[..., None]) - volumes[..., None, :]
        known = np.log(np.maximum(self.correlations, np.finfo(float).tiny))[..., None, :, None]
        counted = np.where(rho[:, None] < SERIAL.strong, known, 0.0)
        top = logsumexp(known + likelihood + logsumexp(logs, axis=-1), axis=(-1, -2))
        found = top - logsumexp(counted + likelihood, axis=(-1, -2))
        return np.asarray(logsumexp(found + self.log_prior, axis=-1), dtype=np.float64)


def _before(rows: Real) -> Real:
    """Return the value before each along the last axis, 0 before the first."""
    return np.concatenate([np.zeros_like(rows[..., :1]), rows[..., :-1]], axis=-1)


def _from_onset(first: Real, later: Real, axis: int = -1) -> Real:
    """Return sums from each window on: `first` of that window, and `later` of those after it."""
    return np.asarray(np.flip(np.cumsum(np.flip(later, axis), axis), axis) - later + first, dtype=np.float64)
