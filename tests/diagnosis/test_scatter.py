"""Scatter of windows: degrees of freedom, regression, and how far variances are shrunk and widened."""

import numpy as np
import pytest
from scipy.integrate import quad
from scipy.special import gammaln

from sprung.diagnosis.scatter import (
    LASTING,
    Deviations,
    Scatter,
    coordinates,
    directions,
    kinds_of,
    own_scatter,
    pooled,
    regression,
    shared_covariance,
)
from sprung.vehicles import Component, read_vehicle, structure

COMPONENTS = tuple(structure(read_vehicle("zafira")).components())


def test_a_mean_alone_takes_one_degree_of_freedom_and_a_free_slope_another() -> None:
    rows = np.column_stack([np.ones(8), np.arange(8.0) - 3.5])
    direction, covariance = np.eye(12)[0], np.eye(12)
    for prior, left in ((1e-9, 7), (1e9, 6)):
        deviations = Deviations(np.zeros((8, 12)), rows, covariance, [prior * np.eye(12)])
        assert deviations.degrees(direction) == pytest.approx(left)


def test_regression_without_a_prior_is_least_squares() -> None:
    generator = np.random.default_rng(1)
    rows, values = generator.standard_normal((9, 2)), generator.standard_normal((9, 3))
    covariance = np.diag([1.0, 2.0, 3.0]) + 0.5
    coefficients, information = regression(rows, values, covariance, np.zeros((6, 6)))
    np.testing.assert_allclose(coefficients, np.linalg.lstsq(rows, values)[0], atol=1e-12)
    np.testing.assert_allclose(np.linalg.inv(information), np.kron(np.linalg.inv(rows.T @ rows), covariance))


def test_a_strong_prior_is_the_answer() -> None:
    rows, values = np.ones((4, 1)), np.zeros((4, 2))
    coefficients, _ = regression(rows, values, np.eye(2), 1e9 * np.eye(2), np.array([[3.0, -2.0]]))
    np.testing.assert_allclose(coefficients, [[3.0, -2.0]], atol=1e-7)


@pytest.mark.parametrize("ratio", [0.1, 1.0, 3.0])
def test_many_windows_give_their_own_scatter(ratio) -> None:
    """Two thousand windows whose pairs, ends and kinds scatter as chosen: estimates within 6 to 10 %."""
    generator = np.random.default_rng(2)
    reported = 0.01**2 * (np.eye(12) + 0.2)
    pairs, ends, together = directions(COMPONENTS)
    truth = ratio**2 * reported + 0.03**2 * ends.T @ ends + 0.05**2 * together.T @ together
    away = generator.standard_normal((2000, 12)) @ np.linalg.cholesky(truth).T
    usual = Scatter.typical(COMPONENTS, reported, with_temperature=True)
    learnt = usual.learnt(Deviations(away, np.ones((2000, 1)), usual.whole, []))
    np.testing.assert_allclose(learnt.scales, ratio, rtol=0.06)
    np.testing.assert_allclose(list(learnt.front_rear_std.values()), 0.03, rtol=0.1)
    np.testing.assert_allclose(list(learnt.common_std.values()), 0.05, rtol=0.1)
    np.testing.assert_allclose(np.diag(pairs @ learnt.whole @ pairs.T), np.diag(pairs @ truth @ pairs.T), rtol=0.1)
    unknown = Scatter.typical(COMPONENTS, reported, with_temperature=False)
    kept = unknown.learnt(Deviations(away, np.ones((2000, 1)), usual.whole, []))
    assert kept.common_std == unknown.common_std


def of_six_pairs(y, X, slope, spread, correlation):
    """Return ln of the marginal likelihood of six series, by the covariance of windows and quadrature over ln c."""
    n, f = len(y), spread
    V = correlation ** abs(np.subtract.outer(np.arange(n), np.arange(n))) + slope * np.outer(X, X)
    J, one = np.linalg.inv(V), np.ones(n)
    rest = y.T @ (J - np.outer(J @ one, one @ J) / (one @ J @ one)) @ y
    S, m = np.diag(rest), n - 1

    def log(t):
        each = gammaln((f + m) / 2) - gammaln(f / 2) + f / 2 * np.log(f * np.exp(t))
        return np.sum(each - (f + m) / 2 * np.log(f * np.exp(t) + S))

    middle, std = np.log(np.sum(S) / (6 * m)), np.sqrt((2 / m + 2 / f) / 6)
    top = max(log(middle + k * std) for k in np.linspace(-4, 4, 81))
    area, _ = quad(lambda t: np.exp(log(t) - top), middle - 12 * std, middle + 12 * std, limit=400)
    return top + np.log(area) - 3 * (np.linalg.slogdet(V)[1] + np.log(one @ J @ one))


@pytest.mark.parametrize("n_windows", [3, 6, 40])
def test_scatter_and_correlation_have_their_marginal_likelihood(n_windows) -> None:
    generator = np.random.default_rng(2)
    X, slope, std = generator.uniform(-1, 1, n_windows), 0.25, 0.02
    values = std * generator.standard_normal((n_windows, 12)) + 0.5 * std * np.outer(X, generator.standard_normal(12))
    covariance = std**2 * np.eye(12)
    deviations = Deviations(values, np.column_stack([np.ones(n_windows), X]), covariance, [slope * covariance])
    rows = coordinates(COMPONENTS, covariance)
    weights, _, degrees = own_scatter(deviations, rows, 6)
    expected = np.log(LASTING.prior)
    for row, spread in enumerate((LASTING.same, LASTING.spread)):
        for column, correlation in enumerate(LASTING.correlations):
            expected[row, column] += of_six_pairs(values @ rows[:6].T, X, slope, spread, correlation)
    found = np.log(weights) - np.log(weights[0, 0])
    np.testing.assert_allclose(found, expected - expected[0, 0], rtol=1e-5, atol=1e-4)
    np.testing.assert_array_equal(degrees, n_windows - 1)


def test_windows_of_vehicles_that_are_alike_have_one_likelihood() -> None:
    generator = np.random.default_rng(3)
    likelihoods = generator.uniform(0.1, 1, (5, 2, 8))
    each = [LASTING.prior * one / np.sum(LASTING.prior * one) for one in likelihoods]
    together = LASTING.prior * np.prod(likelihoods, axis=0)
    np.testing.assert_allclose(pooled(each), together / together.sum())
    np.testing.assert_allclose(pooled(each[:1]), each[0])
    np.testing.assert_allclose(pooled([]), LASTING.prior)


def components(*names):
    return tuple(map(Component.parse, names))


#: Secondary springs and dampers of two bogies, of which sensors on the first one see that one ten times as well.
BOGIES = [f"bogie{number}_{side}.secondary" for number in (1, 2) for side in ("left", "right")]
STAGE = components(*(f"{place}_{kind}" for kind in ("spring", "damper") for place in BOGIES))
FAR = np.diag(np.array([0.02, 0.02, 0.2, 0.2] * 2) ** 2)


@pytest.mark.parametrize(
    ("common", "ends"),
    [
        (0.0, 0.015),  # by plain means 0.03
        (0.05, 0.1),  # what only the first bogie shows may be its own change, too
    ],
)
def test_secondary_springs_change_together_as_the_known_bogie_shows_whatever_the_temperature(common, ends) -> None:
    """Forty baselines of 60 windows: within 0.01 of the truth in the mean; plain means of the four scatter by 0.06."""
    usual, generator = Scatter.typical(STAGE, FAR, with_temperature=False), np.random.default_rng(4)
    springs = np.array([float(part.kind == "secondary_spring") for part in STAGE])
    root = np.linalg.cholesky(FAR + (common**2 + 1e-12) * np.outer(springs, springs))
    learnt = [
        usual.learnt(Deviations(generator.standard_normal((60, 8)) @ root.T, np.ones((60, 1)), usual.whole, []))
        for _ in range(40)
    ]
    found = [one.common_std["secondary_spring"] for one in learnt]
    assert np.mean(found) == pytest.approx(common, abs=0.01)
    assert np.std(found) < 0.01
    assert {one.common_std["secondary_damper"] for one in learnt} == {0.25}
    assert np.mean([one.front_rear_std["secondary_spring"] for one in learnt]) < ends


SPRINGS = ("front_left.spring", "front_right.spring", "rear_left.spring", "rear_right.spring")


def test_pairs_ends_and_all_of_a_kind() -> None:
    pairs, ends, together = directions(components(*SPRINGS))
    assert pairs.tolist() == [[1, -1, 0, 0], [0, 0, 1, -1]]
    assert ends.tolist() == [[0.5, 0.5, -0.5, -0.5]]
    assert together.tolist() == [[1, 1, 1, 1]]


def test_anti_roll_bars_scatter_each_by_itself() -> None:
    """Three times what windows report for one, and half of it for the other."""
    bars = components("front_axle.anti_roll", "rear_axle.anti_roll")
    pairs, ends, together = directions(bars)
    assert (pairs.tolist(), ends.tolist(), together.tolist()) == ([[1, 0], [0, 1]], [[0.5, -0.5]], [[1, 1]])
    away = np.random.default_rng(3).standard_normal((2000, 2)) * [0.3, 0.05]
    usual = Scatter.typical(bars, 0.1**2 * np.eye(2), with_temperature=True)
    learnt = usual.learnt(Deviations(away, np.ones((2000, 1)), usual.whole, []))
    np.testing.assert_allclose(learnt.scales, [3.0, 0.5], rtol=0.06)


def test_kinds_with_different_numbers_of_axles() -> None:
    """Dampers of the front axle only: they have no front against rear."""
    some = components(*SPRINGS, "front_left.damper", "front_right.damper")
    _, ends, _ = directions(some)
    assert kinds_of(ends, some) == ["spring"]
    nuisance = shared_covariance(some, {"spring": 0.008, "damper": 0.012})
    assert nuisance[4, 5] == pytest.approx(0.25**2)  # all dampers together
    assert nuisance[0, 2] == pytest.approx(0.08**2 - (0.008 / 2) ** 2)  # together, and against each other
    assert np.linalg.eigvalsh(nuisance).min() > -1e-12
