"""Scores of a change: the joint covariance of all windows."""

import numpy as np
import pytest
from scipy.linalg import block_diag

from sprung.diagnosis.ratios import Compared, scores_of


def test_scores_are_those_of_the_joint_covariance_of_all_windows() -> None:
    """Three components, six windows and two kinds of errors of the baseline, as one normal distribution."""
    generator, n, p, n_units = np.random.default_rng(1), 6, 3, 3
    variances = [np.eye(p) + part @ part.T for part in generator.standard_normal((n, p, 4))]
    residuals, units = generator.standard_normal((n, p)), generator.standard_normal((n, n_units)) * [1, 1, 0]
    windows = [
        Compared(600.0 * k, 0.0, residual, unit, np.linalg.inv(variance), np.ones(p))
        for k, (residual, unit, variance) in enumerate(zip(residuals, units, variances, strict=True))
    ]
    start = np.eye(n_units * p) / 2 + 0.1
    found = scores_of(windows, start, 30.0)
    errors = np.vstack([np.kron(unit, np.eye(p)) for unit in units])
    inverse, r = np.linalg.inv(block_diag(*variances) + errors @ start @ errors.T), residuals.ravel()
    assert found.rest == pytest.approx(30 + r @ inverse @ r)
    steps = [np.vstack([np.eye(p) * (k >= onset) for k in range(n)]) for onset in range(n)]
    for onset, step in enumerate(steps):
        np.testing.assert_allclose(found.score[onset], step.T @ inverse @ r, atol=1e-10)
        np.testing.assert_allclose(found.information[onset], step.T @ inverse @ step, atol=1e-10)
        np.testing.assert_allclose(found.of_first[onset], step.T @ inverse @ steps[0], atol=1e-10)
