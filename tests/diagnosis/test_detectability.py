"""Smallest detectable changes: the detector finds them with the power stated."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.diagnosis import ChangeDetector, detectable, diagnose, learn
from sprung.diagnosis.baseline import CONDITIONS
from sprung.diagnosis.ratios import Compared, Hypotheses, evidence_of, ratios_of, scores_of
from sprung.errors import ParameterError
from sprung.vehicles import Component

THRESHOLD = float(np.log(48 / 1e-3))


def vehicle(baseline, generator):
    """Return a function from a number of windows and their change to scores, by the detector's own model.

    The scale of the scatter and the errors of the baseline are drawn once.
    """
    root = np.linalg.cholesky(baseline.covariance + baseline.nuisance)
    information, variances = np.linalg.inv(root @ root.T), np.ones(len(baseline.coordinates))
    doubt = baseline.doubt_beyond(0.0)
    scale = np.sqrt(baseline.degrees_of_freedom / generator.chisquare(baseline.degrees_of_freedom))
    units = np.eye(1 + 2 * len(CONDITIONS))[0]
    of_mean = np.linalg.cholesky(np.linalg.inv(baseline.information)[: len(root), : len(root)])
    error = scale * of_mean @ generator.standard_normal(len(root))

    def scores(n_windows, change):
        residuals = scale * generator.standard_normal((n_windows, len(root))) @ root.T + error + change
        windows = [
            Compared(600.0 * k, 0.0, residual, units, information, variances) for k, residual in enumerate(residuals)
        ]
        return scores_of(windows, doubt, baseline.degrees_of_freedom)

    return scores


@pytest.mark.slow
@pytest.mark.parametrize(
    ("n_learnt", "n_windows", "part"),
    [(6, 1, "front_left.spring"), (6, 6, "rear_right.tyre"), (12, 1, "rear_left.damper"), (12, 6, "front_left.spring")],
)
def test_a_change_of_the_size_stated_by_a_baseline_is_found_with_95_percent_power(
    healthy, n_learnt, n_windows, part
) -> None:
    """Of 600 draws each; a share of 95 % scatters by 0.9 %. From six windows the power is 91 %."""
    baseline = learn(healthy(n_learnt, seed=n_learnt))
    hypotheses = Hypotheses.of(baseline.components)
    component = Component.parse(part)
    size = np.log1p(-detectable(baseline, n_windows=n_windows)[component])
    change = size * np.array([float(other == component) for other in baseline.components])
    generator = np.random.default_rng([n_learnt, n_windows])
    drawn = [vehicle(baseline, generator)(n_windows, change) for _ in range(600)]
    alerts = sum(evidence_of(ratios_of(each, hypotheses), hypotheses) >= THRESHOLD for each in drawn)
    assert (0.93 if n_learnt > 6 else 0.9) <= alerts / 600 <= 0.975


def test_more_windows_and_less_scatter_find_smaller_changes(baseline) -> None:
    sizes = [detectable(baseline, n_windows=count) for count in (1, 6, 12, 96)]
    for component in baseline.components:
        found = [size[component] for size in sizes]
        assert 0 < found[3] < found[2] < found[1] < found[0] < 0.3
    parts = {name: getattr(baseline, name) / 4 for name in ("covariance", "nuisance")}
    quiet = replace(baseline, **parts, information=4 * baseline.information)
    for component in baseline.components:
        assert np.log1p(-detectable(quiet, n_windows=12)[component]) == pytest.approx(
            np.log1p(-sizes[2][component]) / 2, rel=0.1
        )


def test_a_stricter_rate_of_false_alarms_needs_larger_changes(baseline) -> None:
    usual, strict = (detectable(baseline, n_windows=6, false_alarms=rate) for rate in (1e-3, 1e-6))
    assert all(strict[component] > usual[component] for component in baseline.components)
    with pytest.raises(ParameterError, match="n_windows=0"):
        detectable(baseline, n_windows=0)


def test_an_alert_does_not_hide_what_else_would_be_found(healthy, faulty, baseline) -> None:
    """The change itself is not taken for scatter."""
    still = diagnose(healthy(10, seed=3), baseline).detectable
    changed = diagnose(faulty(3, {"front_left.spring": -0.4}, before=0, after=10), baseline).detectable
    for component in baseline.components:
        assert changed[component] == pytest.approx(still[component], rel=0.2)


def test_without_a_window_nothing_is_known_of_it(baseline, silent) -> None:
    assert diagnose([silent("standing")], baseline).detectable == {}
    assert ChangeDetector(baseline).detection is None
