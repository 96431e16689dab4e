"""Mean deviation of windows from a baseline."""

import numpy as np
import pytest

from sprung.diagnosis import learn
from sprung.diagnosis.baseline import mean_deviation, typical_std
from sprung.errors import ParameterError


def test_mean_and_deviations_are_those_of_the_windows(healthy) -> None:
    every = healthy(30)
    baseline, later = learn(every[:12]), every[12:]
    mean = mean_deviation(baseline, later)
    np.testing.assert_allclose(mean.log_ratios, np.mean([baseline.residual(window) for window in later], axis=0))
    by_chance = np.diag(baseline.covariance) * (1 / 18 + 1 / 12)
    np.testing.assert_allclose(mean.std_by_chance**2, by_chance)
    np.testing.assert_allclose(mean.std**2, by_chance + np.diag(baseline.nuisance))
    np.testing.assert_allclose(typical_std(baseline) ** 2, np.diag(baseline.covariance + baseline.nuisance))
    assert (mean.components, mean.n_windows) == (baseline.components, 18)
    assert np.all(np.abs(mean.log_ratios) < 3 * mean.std)


def test_a_change_is_found_at_its_part_alone(window) -> None:
    generator = np.random.default_rng(3)
    baseline = learn([window(generator, 600.0 * k) for k in range(12)])
    changed = [window(generator, 7200 + 600.0 * k, {"front_left.spring": -0.2}) for k in range(12)]
    mean = mean_deviation(baseline, changed)
    scores = dict(zip(map(str, mean.components), mean.log_ratios / mean.std, strict=True))
    assert min(scores, key=scores.__getitem__) == "front_left.spring"
    assert scores.pop("front_left.spring") < -2.5
    assert all(abs(score) < 1.96 for score in scores.values())


def test_no_window_has_no_mean(healthy) -> None:
    with pytest.raises(ParameterError, match="at least one conclusive window"):
        mean_deviation(learn(healthy(12)), [])
