"""Likelihoods of windows of which consecutive ones are correlated: their joint covariance, and false alarms."""

from dataclasses import replace
from itertools import pairwise
from typing import Any

import numpy as np
import pytest
from scipy.linalg import block_diag
from scipy.stats import multivariate_normal, multivariate_t

from sprung.diagnosis import Observation, learn
from sprung.diagnosis.changes import ChangeDetector
from sprung.diagnosis.hypotheses import PRIORS
from sprung.diagnosis.lasting import OWN_SCATTER, Series
from sprung.diagnosis.ratios import Compared, scores_of
from sprung.diagnosis.scatter import SERIAL, WEIGHTS


def test_scores_are_those_of_the_joint_covariance_of_all_windows() -> None:
    """Three components, six windows and two kinds of errors of the baseline, as one normal distribution."""
    generator, n, p, n_units = np.random.default_rng(1), 6, 3, 3
    roots = [np.eye(p) + 0.3 * np.tril(generator.standard_normal((p, p))) for _ in range(n)]
    residuals, units = generator.standard_normal((n, p)), generator.standard_normal((n, n_units)) * [1, 1, 0]
    windows = [
        Compared(600.0 * k, 0.0, residual, unit, np.asarray(np.linalg.inv(root @ root.T), dtype=np.float64), root)
        for k, (residual, unit, root) in enumerate(zip(residuals, units, roots, strict=True))
    ]
    start = np.eye(n_units * p) / 2 + 0.1
    found = scores_of(windows, start, 30.0)
    errors = np.vstack([np.kron(unit, np.eye(p)) for unit in units])
    inverse = np.linalg.inv(block_diag(*(root @ root.T for root in roots)) + errors @ start @ errors.T)
    r = residuals.ravel()
    assert found.rest == pytest.approx(30 + r @ inverse @ r)
    steps = [np.vstack([np.eye(p) * (k >= onset) for k in range(n)]) for onset in range(n)]
    for onset, step in enumerate(steps):
        np.testing.assert_allclose(found.score[onset], step.T @ inverse @ r, atol=1e-10)
        np.testing.assert_allclose(found.information[onset], step.T @ inverse @ step, atol=1e-10)
        np.testing.assert_allclose(found.of_first[onset], step.T @ inverse @ steps[0], atol=1e-10)


def test_lasting_evidence_is_a_ratio_of_densities() -> None:
    """Two contrasts, five windows; each density of all windows by its whole covariance, the change as part of it."""
    generator, n, n_learning = np.random.default_rng(2), 5, 8
    values, variances = generator.standard_normal((2, n)), generator.uniform(1, 2, (2, n))
    scatter, units = 0.8 * variances, np.column_stack([np.ones(n), generator.standard_normal((n, 2))])
    own, beyond = np.array([[[0.5, 0.1], [0.1, 0.3]], [[0.7, 0.0], [0.0, 0.2]]]), np.array([[[0.4]], [[0.6]]])
    probabilities, squares = SERIAL.prior, np.linspace(1, 2, len(SERIAL.correlations))
    priors, (scales, log_weights) = [0.4, 0.6], OWN_SCATTER.scales
    unequal = OWN_SCATTER.unequal * np.exp(log_weights)
    series = Series(
        values, variances, scatter, units, own, beyond, n_learning, probabilities, squares, np.ones((2, 2)),
        np.log(priors),
    )  # fmt: skip
    top, bottom = np.zeros(2), np.zeros(2)
    for rho, probability, factor in zip(SERIAL.correlations, probabilities, squares, strict=True):
        share = (1 - rho * (1 - 2 / n_learning)) / (1 + rho)
        covariances = []
        for k in range(2):
            v, s = variances[k] + (factor - 1) * scatter[k], factor * scatter[k]
            joint = np.diag(v)
            for first in range(n):
                for later in range(first + 1, n):
                    step = rho * np.sqrt(s[later] * s[later - 1]) / v[later - 1]
                    joint[first, later] = joint[later, first] = step * joint[later - 1, first]
            errors = factor * block_diag(own[k] / share, beyond[k])
            covariances.append(joint + units @ errors @ units.T)
        for k, other in ((0, 1), (1, 0)):
            y, C, count = values[k], covariances[k], int(WEIGHTS.pairs) + n
            squared = values[other] @ np.linalg.solve(covariances[other], values[other])
            common = (WEIGHTS.pairs + squared) / count
            seen = [multivariate_normal(cov=common * x * covariances[other]).pdf(values[other]) for x in (1.0, *scales)]
            is_unequal = unequal @ seen[1:] / OWN_SCATTER.unequal
            weights = [(1 - OWN_SCATTER.unequal) * seen[0], *(unequal * is_unequal)]
            for x, weight in zip((1.0, *scales), weights, strict=True):
                none = multivariate_t(shape=common * x * C, df=count).pdf(y)
                changed = 0.0
                for onset in range(n):
                    change = np.arange(n) >= onset
                    whole = C + PRIORS.size**2 * np.outer(change, change)
                    changed += float(multivariate_t(shape=common * x * whole, df=count).pdf(y))
                top[k] += probability * weight * changed
                bottom[k] += (probability if rho < SERIAL.strong else 1.0) * weight * none
    assert series.evidence() == pytest.approx(np.log(priors @ (top / bottom)), rel=1e-9)
    fields: dict[str, Any] = {name: np.stack([getattr(series, name)] * 3) for name in AXES}
    every = replace(series, **fields)
    np.testing.assert_allclose(every.evidence(), series.evidence())


#: Fields of a series that have an axis of vehicles where there are several.
AXES = ("values", "variances", "scatter", "units", "own", "beyond", "correlations", "squares")


def correlated(components, correlation, n_windows, seed):
    """Return healthy windows that scatter by 2 %, consecutive ones correlated."""
    generator = np.random.default_rng(seed)
    values = generator.standard_normal((n_windows, len(components)))
    for before, now in pairwise(values):
        now[:] = correlation * before + np.sqrt(1 - correlation**2) * now
    covariance = 4e-4 * np.eye(len(components))
    return [Observation(600.0 * k, components, row, covariance, {}, {}, ()) for k, row in enumerate(0.02 * values)]


@pytest.mark.parametrize("correlation", [0.0, 0.3, 0.6])
def test_a_long_baseline_states_the_correlation_of_its_windows(baseline, correlation) -> None:
    """Of 6 pairs and 60 windows its standard deviation is at most 0.05."""
    learnt = learn(correlated(baseline.components, correlation, 60, 3))
    assert learnt.correlations @ SERIAL.correlations == pytest.approx(correlation, abs=0.1)
    assert learnt.correlations.sum() == pytest.approx(1)


@pytest.mark.slow
def test_correlated_windows_of_a_healthy_vehicle_are_no_evidence_over_a_year(baseline) -> None:
    """As independent windows, 27 of these 100 vehicles would have more than the 8.5 of a list of one vehicle a day."""
    found = []
    for seed in range(100):
        windows = correlated(baseline.components, 0.5, 60, seed)
        detection = ChangeDetector.resumed(learn(windows[:12]), windows[12:], np.zeros(48)).detection
        assert detection is not None
        found.append(detection.e_value + np.log(48 * 365))
    assert sum(value > np.log(48 / 0.05) for value in found) <= 5
