"""The search for the largest likelihood: where it ends, and what it costs."""

from dataclasses import dataclass, replace

import numpy as np
import pytest
from scipy.optimize import least_squares as scipy_least_squares

from sprung.likelihood.search import DescentSettings, Differenced, descent, least_squares, minimised, preconditioner


@pytest.fixture
def drawn(car, road_model, with_data, somewhere):
    """A model with spectra drawn from parameters away from its start."""
    model = road_model(car)
    truth = somewhere(model)
    truth[model.rows("class_roughness")] = 0.0
    return with_data(model, truth, generator=np.random.default_rng(4))


def test_the_search_ends_where_another_one_gains_nothing(drawn) -> None:
    end = minimised(drawn, drawn.scaled_start())
    assert drawn.objective(end)[0] - drawn.objective(minimised(drawn, end))[0] < 0.01


def test_every_step_makes_the_model_more_likely(drawn) -> None:
    start = drawn.scaled_start()
    values = [drawn.objective(point)[0] for point in (start, *descent(drawn, start))]
    assert np.all(np.diff(values) < 0)
    assert len(values) < 100


def test_noise_that_starts_too_low_takes_few_steps_as_a_power(drawn) -> None:
    """Steps of its logarithm alone are more than forty."""
    ends = DescentSettings(slope=0.15, has_last_step=True)
    points = list(descent(replace(drawn, every=3), drawn.scaled_start(), ends, powers=drawn.powers))
    best = minimised(drawn, points[-1])
    assert len(points) < 20
    assert drawn.objective(points[-1])[0] - drawn.objective(best)[0] < 0.01


def test_the_preconditioner_makes_the_information_the_unit_matrix(drawn) -> None:
    factor = preconditioner(drawn, drawn.start)
    information = drawn.information(drawn.start) + np.diag(1 / drawn.prior_std**2)
    assert factor.T @ information @ factor == pytest.approx(np.eye(drawn.start.size), abs=1e-6)


@pytest.mark.slow
def test_a_metric_by_fewer_frequencies_leads_to_the_same_end(whole_model, with_data, somewhere) -> None:
    """A metro car with twelve sensors: its metric is rough, and the ends of 73 parameters 0.05 deviations apart."""
    nominal = whole_model("metro", "rail")
    model = with_data(nominal, somewhere(nominal, size=0.02), generator=np.random.default_rng(2))
    start = model.scaled_start()
    factor = preconditioner(model, start)
    curvatures = np.linalg.eigvalsh(
        factor.T @ (model.searched.information(start) + np.diag(1 / model.prior_std**2)) @ factor
    )
    assert 0.3 < curvatures.min() < 0.9
    assert 1.1 < curvatures.max() < 3
    exact, rough = minimised(model, start), minimised(model.searched, start)
    assert np.linalg.norm(np.linalg.solve(preconditioner(model, exact), rough - exact)) < 0.05


@dataclass(frozen=True, eq=False)
class Valley:
    """Rosenbrock's function: 1 - x and 10 (y - x^2), with both at least -2 and at most a bound."""

    at: np.ndarray
    bound: float = 9.0

    @property
    def errors(self):
        return np.array([1 - self.at[0], 10 * (self.at[1] - self.at[0] ** 2)])

    @property
    def criterion(self):
        return np.log(self.errors @ self.errors + 1e-20)

    def slopes(self):
        slopes = np.array([[-1.0, 0.0], [-20 * self.at[0], 10.0]])
        return np.where((self.at >= self.bound) & (self.errors @ slopes < 0), 0.0, slopes)

    def moved(self, step):
        return Valley(np.clip(self.at + step, -2, self.bound), self.bound)


def test_least_squares_of_a_curved_valley() -> None:
    """Rosenbrock (1960): the least is at (1, 1); with both at most 0.5, at (0.5, 0.25)."""
    np.testing.assert_allclose(least_squares(Valley(np.array([-1.2, 1.0]))).at, [1, 1], atol=1e-6)
    np.testing.assert_allclose(least_squares(Valley(np.array([-1.2, 0.3]), 0.5)).at, [0.5, 0.25], atol=1e-4)


def test_derivatives_by_differences_end_where_those_of_scipy_do() -> None:
    time, rng = np.linspace(0, 4, 60), np.random.default_rng(2)
    decay = np.exp(0.3 - np.exp(-0.2) * time) + 0.02 * rng.standard_normal(time.size)

    def errors(parameters):
        return np.append((np.exp(parameters[0] - np.exp(parameters[1]) * time) - decay) / 0.02, parameters / 3)

    found, wanted = least_squares(Differenced(errors, np.zeros(2)), gain=1e-9), scipy_least_squares(errors, np.zeros(2))
    assert found.parameters == pytest.approx(wanted.x, abs=1e-6)
    assert found.criterion == pytest.approx(wanted.cost, abs=1e-9)
    assert found.slopes() == pytest.approx(wanted.jac, abs=1e-4)
