"""The search for the largest likelihood: where it ends, and what it costs."""

import numpy as np
import pytest

from sprung.likelihood.search import descent, minimised, preconditioner


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


def test_the_preconditioner_makes_the_information_the_unit_matrix(drawn) -> None:
    factor = preconditioner(drawn, drawn.start)
    information = drawn.information(drawn.start) + np.diag(1 / drawn.prior_std**2)
    assert factor.T @ information @ factor == pytest.approx(np.eye(drawn.start.size), abs=1e-6)
