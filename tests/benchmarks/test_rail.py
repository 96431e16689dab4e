"""The bounds beside the metro car of the benchmark, against closed forms."""

import numpy as np
import pytest
from benchmarks.rail import named_right
from scipy.stats import norm


@pytest.mark.parametrize("correlation", [0.0, 0.6])
def test_the_share_of_right_parts_is_that_of_two_normal_scores(correlation) -> None:
    """One known size: the difference of two scores has the mean s I (1 - r) and the variance 2 I (1 - r)."""
    information = 100.0 * np.array([[1.0, correlation], [correlation, 1.0]])
    exact = norm.cdf(-np.log(0.85) * np.sqrt(100.0 * (1 - correlation) / 2))
    assert named_right(information, 1, -0.15, (0.15, 0.15)) == pytest.approx(exact, abs=3 * 0.5 / np.sqrt(1000))


def test_a_part_that_the_drives_do_not_determine_is_named_by_chance() -> None:
    assert named_right(1e-6 * np.eye(4), 2, -0.3, (0.1, 0.4)) == pytest.approx(0.25, abs=0.05)
