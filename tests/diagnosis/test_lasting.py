"""Evidence where consecutive windows are correlated and parts scatter unequally: likelihoods, and false alarms."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gammaln
from scipy.stats import multivariate_t

from sprung.diagnosis import Observation, learn
from sprung.diagnosis.changes import ChangeDetector
from sprung.diagnosis.hypotheses import PRIORS
from sprung.diagnosis.lasting import _Scales, _Series
from sprung.diagnosis.ratios import Hypotheses, compare
from sprung.diagnosis.scatter import LASTING

COLUMN = 3  # a correlation of 0.3


def lasting(components, correlation, n_windows, seed, *, unequal=0.0):
    """Return healthy windows that scatter by 2 %, parts unequally; consecutive windows are correlated."""
    generator = np.random.default_rng(seed)
    values = generator.standard_normal((n_windows, len(components)))
    for before, now in pairwise(values):
        now[:] = correlation * before + np.sqrt(1 - correlation**2) * now
    values = 0.02 * np.exp(unequal * generator.standard_normal(len(components))) * values
    covariance, speeds = 4e-4 * np.eye(len(components)), generator.uniform(10, 20, n_windows)
    return [
        Observation(600.0 * k, components, row, covariance, {"speed": speed}, {}, ())
        for k, (row, speed) in enumerate(zip(values, speeds, strict=True))
    ]


@pytest.fixture(scope="module")
def compared(baseline):
    """A baseline of 8 windows, and 5 that are compared with it, some faster than all of these."""
    windows = lasting(baseline.components, 0.3, 13, 1)
    learnt = learn(windows[:8])
    later = [replace(each, conditions={"speed": each.conditions["speed"] + 6}) for each in windows[8:]]
    return learnt, [compare(learnt, each) for each in later]


def joint(learnt, windows, rows):
    """Return values and joint covariances, of scale 1, of rows of coordinates of windows with a correlation of 0.3."""
    count, units = len(windows), np.array([each.units for each in windows])
    size = len(learnt.components)
    doubt = learnt.doubt_beyond(0.3).reshape(units.shape[1], size, units.shape[1], size)
    serial = 0.3 ** np.abs(np.subtract.outer(np.arange(count), np.arange(count)))
    found = []
    for row in rows:
        T = learnt.coordinates[row]
        stds = np.sqrt([each.variances[row] for each in windows])
        start = np.einsum("i,aibj,j->ab", T, doubt, T) / (T @ (learnt.covariance + learnt.nuisance) @ T)
        values = np.array([T @ each.residual for each in windows])
        found.append((values, serial * np.outer(stds, stds) + units @ start @ units.T))
    return found


def log_t(values, covariance, squares, degrees):
    """Return ln of the density of Student's t, but for the constant that the likelihoods leave out."""
    density = multivariate_t(shape=squares / degrees * covariance, df=degrees).logpdf(values)
    return density + len(values) / 2 * np.log(np.pi)


def test_likelihoods_are_those_of_students_t(compared) -> None:
    learnt, windows = compared
    series, size = _Series.of(windows, learnt, Hypotheses.of(learnt.components), 0.3), len(learnt.components)
    alike, _ = _Scales.of(learnt, COLUMN)
    parts, expected = joint(learnt, windows, range(size)), 0.0
    for group, squares, degrees in zip(alike.groups, alike.squares, alike.degrees, strict=True):
        own = [parts[k] for k in np.flatnonzero(group)]
        whole = np.zeros((5 * len(own), 5 * len(own)))
        for k, (_, covariance) in enumerate(own):
            whole[5 * k : 5 * k + 5, 5 * k : 5 * k + 5] = covariance
        expected += log_t(np.concatenate([values for values, _ in own]), whole, squares, degrees)
    assert series.part(slice(size)).log_likelihood(alike) == pytest.approx(expected)


@pytest.mark.parametrize("hypothesis", [0, 7])
def test_a_change_that_scatters_by_itself_leaves_the_rest_of_its_group(compared, hypothesis) -> None:
    """By quadrature over ln of both variances, from sums of squares by the joint density of windows."""
    learnt, windows = compared
    hypotheses, size = Hypotheses.of(learnt.components), len(learnt.components)
    series, (alike, own) = _Series.of(windows, learnt, hypotheses, 0.3), _Scales.of(learnt, COLUMN)
    sums = [y @ np.linalg.solve(C, y) for y, C in joint(learnt, windows, [*range(size), size + hypothesis])]
    moved = (learnt.coordinates[:size] @ hypotheses.directions[hypothesis]) ** 2
    share, rest = moved @ alike.groups[0] / moved.sum(), alike.groups[0] @ sums[:size]
    count, taken = 5 * alike.groups[0].sum(), share * sums[-1]

    def marginal(squares, degrees, count, rest):
        def density(x):
            return -(degrees + count) / 2 * x - (squares + rest) / 2 * np.exp(-x)

        middle = np.log((squares + rest) / (degrees + count))
        integral, _ = quad(lambda x: np.exp(density(x) - density(middle)), middle - 3, middle + 3)
        usual = degrees / 2 * np.log(squares / 2) - gammaln(degrees / 2)
        return np.log(integral) + density(middle) + usual + count / 2 * np.log(2)

    scale, of_change = (alike.squares[0], alike.degrees[0]), (own.squares[hypothesis], own.degrees[hypothesis])
    expected = (
        marginal(*scale, count - 5, rest - taken) + marginal(*of_change, 5, taken) - marginal(*scale, count, rest)
    )
    found = series.part(slice(size)).log_apart(alike, own, series.part(slice(size, None)))
    assert found[hypothesis] == pytest.approx(expected)
    of_kinds = [k for k, row in enumerate(hypotheses.directions) if np.count_nonzero(row) == 4]
    assert of_kinds
    assert np.all(found[of_kinds] == -np.inf)


@pytest.mark.parametrize(("hypothesis", "onset"), [(0, 0), (7, 3), (13, 1), (20, 4)])
def test_ratios_are_means_over_the_size_of_a_change(compared, hypothesis, onset) -> None:
    """Of its estimate alone by the joint density of windows, and of uncorrelated coordinates by quadrature."""
    learnt, windows = compared
    hypotheses, size = Hypotheses.of(learnt.components), len(learnt.components)
    series, (alike, own) = _Series.of(windows, learnt, hypotheses, 0.3), _Scales.of(learnt, COLUMN)
    step = (np.arange(5) >= onset).astype(float)

    row = size + hypothesis
    ((values, covariance),) = joint(learnt, windows, [row])
    move = learnt.coordinates[row] @ hypotheses.directions[hypothesis] * step
    moved = covariance + PRIORS.size**2 * np.outer(move, move)
    scale = own.squares[hypothesis], own.degrees[hypothesis]
    found = series.part(slice(size, None)).own_log_ratios(own)
    assert found[hypothesis, onset] == pytest.approx(log_t(values, moved, *scale) - log_t(values, covariance, *scale))

    parts, moves = joint(learnt, windows, range(size)), learnt.coordinates[:size] @ hypotheses.directions[hypothesis]

    def likelihood(x):
        rest = alike.squares + alike.groups @ [
            (values - x * move * step) @ np.linalg.solve(covariance, values - x * move * step)
            for (values, covariance), move in zip(parts, moves, strict=True)
        ]
        return -(alike.degrees + 5 * alike.groups.sum(axis=1)) / 2 @ np.log(rest) - x**2 / 2 / PRIORS.size**2

    integral, _ = quad(lambda x: np.exp(likelihood(x) - likelihood(0.0)), -1.5, 1.5, limit=400, epsabs=0)
    expected = np.log(integral / np.sqrt(2 * np.pi) / PRIORS.size)
    assert series.part(slice(size)).log_ratios(alike)[hypothesis, onset] == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("correlation", [0.0, 0.3, 0.6])
def test_a_long_baseline_states_the_correlation_of_its_windows(baseline, correlation) -> None:
    """Of 6 pairs and 60 windows its standard deviation is at most 0.05."""
    learnt = learn(lasting(baseline.components, correlation, 60, 3))
    assert learnt.weights.sum(axis=0) @ LASTING.correlations == pytest.approx(correlation, abs=0.1)
    assert learnt.weights.sum() == pytest.approx(1)
    # The doubt about the mean of many windows is (1 + rho) / (1 - rho) times that of independent ones.
    ratio = learnt.doubt_beyond(correlation)[0, 0] / learnt.doubt[0, 0]
    assert ratio == pytest.approx((1 + correlation) / (1 - correlation), rel=0.05)


@pytest.mark.parametrize(("unequal", "alike"), [(0.0, 1.0), (0.6, 0.0)])
def test_a_long_baseline_states_whether_parts_scatter_alike(baseline, unequal, alike) -> None:
    learnt = learn(lasting(baseline.components, 0.0, 60, 3, unequal=unequal))
    assert learnt.weights[0].sum() == pytest.approx(alike, abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("correlation", "unequal", "n_learning"), [(0.5, 0.0, 12), (0.0, 0.6, 6)])
def test_windows_of_a_healthy_vehicle_are_no_evidence_over_a_year(baseline, correlation, unequal, n_learning) -> None:
    """Over the 8.5 of a list of one vehicle a day, 100 vehicles each; as independent windows 27 are, and with one scale
    of all parts 18 are."""
    found = []
    for seed in range(100):
        windows = lasting(baseline.components, correlation, n_learning + 48, seed, unequal=unequal)
        detection = ChangeDetector.resumed(learn(windows[:n_learning]), windows[n_learning:], np.zeros(48)).detection
        assert detection is not None
        found.append(detection.e_value + np.log(48 * 365))
    assert sum(value > np.log(48 / 0.05) for value in found) <= 5
