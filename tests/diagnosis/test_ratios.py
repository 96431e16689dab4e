"""Likelihoods of windows of which consecutive ones are correlated: their joint covariance, and false alarms."""

from itertools import pairwise

import numpy as np
import pytest

from sprung.diagnosis import Observation, learn
from sprung.diagnosis.changes import ChangeDetector
from sprung.diagnosis.ratios import Compared, Innovations
from sprung.diagnosis.scatter import SERIAL


@pytest.mark.parametrize("correlation", [0.0, 0.3, 0.8])
def test_scores_are_those_of_the_joint_covariance_of_all_windows(correlation) -> None:
    """Three components, six windows and two kinds of errors of the baseline, as one normal distribution."""
    generator, n, p, n_units, squares = np.random.default_rng(1), 6, 3, 3, 1.4
    roots = [np.eye(p) + 0.3 * np.tril(generator.standard_normal((p, p))) for _ in range(n)]
    others = [part @ part.T for part in generator.standard_normal((n, p, 2))]
    residuals, units = generator.standard_normal((n, p)), generator.standard_normal((n, n_units)) * [1, 1, 0]
    windows = [
        Compared(600.0 * k, 0.0, residual, unit, np.linalg.inv(root @ root.T + other), root)
        for k, (residual, unit, root, other) in enumerate(zip(residuals, units, roots, others, strict=True))
    ]
    start = np.eye(n_units * p) / 2 + 0.1
    found = Innovations.of(windows, start, 30.0, correlation, squares)
    scale = squares if correlation else 1.0
    variances = [scale * root @ root.T + other for root, other in zip(roots, others, strict=True)]
    joint = np.zeros((n, p, n, p))
    for first in range(n):
        covariance = joint[first, :, first] = variances[first]
        for later in range(first + 1, n):
            carried = correlation * scale * roots[later] @ roots[later - 1].T @ np.linalg.inv(variances[later - 1])
            covariance = carried @ covariance
            joint[later, :, first], joint[first, :, later] = covariance, covariance.T
    errors = np.vstack([np.kron(unit, np.eye(p)) for unit in units])
    whole = joint.reshape(n * p, n * p) + errors @ start @ errors.T
    inverse, r = np.linalg.inv(whole), residuals.ravel()
    assert found.rest == pytest.approx(30 + r @ inverse @ r)
    expected = (30 * np.log(30) - np.linalg.slogdet(whole)[1] - (30 + n * p) * np.log(found.rest)) / 2
    assert found.log_likelihood == pytest.approx(expected)
    steps = [np.vstack([np.eye(p) * (k >= onset) for k in range(n)]) for onset in range(n)]
    for onset, step in enumerate(steps):
        np.testing.assert_allclose(found.scores.score[onset], step.T @ inverse @ r, atol=1e-10)
        np.testing.assert_allclose(found.scores.information[onset], step.T @ inverse @ step, atol=1e-10)
        np.testing.assert_allclose(found.scores.of_first[onset], step.T @ inverse @ steps[0], atol=1e-10)


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
    # The doubt about the mean of many windows is (1 + rho) / (1 - rho) times that of independent ones.
    ratio = learnt.doubt_beyond(correlation)[0, 0] / learnt.doubt[0, 0]
    assert ratio == pytest.approx((1 + correlation) / (1 - correlation), rel=0.05)


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
