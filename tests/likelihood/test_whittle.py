"""The likelihood against finite differences, exact spectra and simulated drives."""

from dataclasses import replace

import numpy as np
import pytest

from sprung._arrays import Complex
from sprung.likelihood import MassParameter
from sprung.likelihood.hermitian import real_coordinates
from sprung.likelihood.search import TOO_FAR, minimised
from sprung.likelihood.whittle import inverse_and_logdet, minus_log_likelihood
from sprung.signals.spectrum import spectral_matrix
from sprung.simulation import RoadDrive, simulate_drive


@pytest.fixture(params=["road", "rail", "rig"])
def model(request, car, road_model):
    """A car with all corners and inputs of one kind as parameters."""
    return road_model(car, kind=request.param)


def test_gradient_is_the_finite_difference(model, with_data, somewhere) -> None:
    generator = np.random.default_rng(1)
    model = with_data(model, somewhere(model), generator=generator)
    point = somewhere(model, seed=2)
    gradient = model.objective(point)[1]
    steps = 1e-4 * np.eye(point.size)
    # five-point differences
    values = [[model.objective(point + k * step)[0] for k in (-2, -1, 1, 2)] for step in steps]
    expected = np.array([(low2 - 8 * low + 8 * high - high2) / 12e-4 for low2, low, high, high2 in values])
    assert gradient == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(expected).max())


def test_whitened_derivatives_are_finite_differences(model, somewhere) -> None:
    point = somewhere(model)
    whitened = model.whitened_derivatives(point)
    factor = np.linalg.inv(np.linalg.cholesky(model.matrix(point)))
    for derivative, step in zip(whitened, 1e-5 * np.eye(point.size), strict=True):
        difference = (model.matrix(point + step) - model.matrix(point - step)) / 2e-5
        expected = real_coordinates(factor @ difference @ factor.conj().swapaxes(-1, -2))
        expected *= np.sqrt(model.spectra.weights)[..., None]
        size = np.sqrt(model.spectra.weights.max())
        assert np.abs(derivative - expected).max() < 1e-6 * np.abs(expected).max() + 1e-8 * size


def test_exact_spectra_give_the_parameters_back(model, with_data) -> None:
    """By the search, and then by steps of Fisher scoring, which need no difference of large numbers."""
    truth = model.start + 0.2 * np.minimum(model.prior_std, 1.0) * np.random.default_rng(0).standard_normal(
        model.start.size
    )
    truth[model.rows("class_roughness")] = 0
    some = with_data(model, truth, counts=100.0)
    start = some.scaled_start()
    found = minimised(some, start)
    free = model.rows("components")
    assert found[free] == pytest.approx(truth[free], abs=0.05)
    for counts in (1e2, 1e3, 1e4, 1e6, 1e8, 1e10, 1e12, 1e12, 1e12, 1e12):  # the prior fades
        exact = with_data(model, truth, counts=counts)
        information = exact.information(found) + np.diag(1 / exact.prior_std**2)
        found = found - np.linalg.solve(information, exact.objective(found)[1])
    assert found[free] == pytest.approx(truth[free], abs=1e-8)
    assert exact.matrix(found) == pytest.approx(exact.matrix(truth), rel=1e-7, abs=1e-9)


def test_information_is_the_mean_curvature(car, road_model, with_data, somewhere) -> None:
    """Fisher information = second derivative of the expected likelihood at the truth."""
    model = road_model(car)
    truth = somewhere(model)
    exact = with_data(model, truth)
    information = model.information(truth)
    for k in (0, 1, 5, 13):
        step = 1e-4 * np.eye(truth.size)[k]
        curvature = (exact.objective(truth + step)[1] - exact.objective(truth - step)[1]) / 2e-4
        curvature[k] -= 1 / model.prior_std[k] ** 2
        assert curvature[:12] == pytest.approx(information[k, :12], rel=1e-4, abs=1e-5 * information[k, k])


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_inverse_and_determinant(size) -> None:
    generator = np.random.default_rng(1)
    root = generator.standard_normal((2, 5, size, size)) + 1j * generator.standard_normal((2, 5, size, size))
    matrices: Complex = root @ root.conj().swapaxes(-1, -2) + np.eye(size, dtype=complex)
    inverse, logdet = inverse_and_logdet(matrices)
    assert inverse @ matrices == pytest.approx(np.broadcast_to(np.eye(size), matrices.shape), abs=1e-10)
    assert logdet == pytest.approx(np.linalg.slogdet(matrices)[1])


def test_weight_is_the_derivative_of_the_likelihood(car, road_model, with_data, somewhere) -> None:
    """dl = sum tr(W dS) for a Hermitian change of S."""
    model = road_model(car)
    spectra, matrices = with_data(model, model.start).spectra, model.matrix(somewhere(model))
    draws = np.random.default_rng(2).standard_normal((2, *matrices.shape))
    factor, draw = np.linalg.cholesky(matrices), draws[0] + 1j * draws[1]
    change = 1e-4 * factor @ (draw + draw.conj().swapaxes(-1, -2)) @ factor.conj().swapaxes(-1, -2)
    above, below = (minus_log_likelihood(matrices + sign * change, spectra)[0] for sign in (1, -1))
    weight = minus_log_likelihood(matrices, spectra)[1]
    assert np.einsum("cfij,cfji->", weight, change).real == pytest.approx((above - below) / 2, rel=1e-5)


def test_the_objective_is_large_where_the_mass_matrix_is_not_positive_definite(car, road_model) -> None:
    model = road_model(car, parts=(MassParameter("load", np.eye(7), 1.0),))
    parameters = model.start.copy()
    parameters[model.rows("payload")] = -1e4
    assert model.objective(parameters)[0] == TOO_FAR


def test_the_objective_is_large_where_it_overflows(car, road_model, with_data) -> None:
    model = with_data(road_model(car), road_model(car).start)
    value, gradient = model.objective(model.start + 1e4)
    assert value == TOO_FAR
    assert not gradient.any()


@pytest.mark.slow
def test_spectra_of_a_simulated_drive_are_those_of_the_model(car, road_model, classes) -> None:
    """Twenty minutes at 12 m/s: every entry of the spectral matrix, phases of the delay included, within chance."""
    speed = 12.0
    run = simulate_drive(car, RoadDrive(duration=1200.0, speed=(speed, speed)), seed=3).recording
    spectra = spectral_matrix(run.select(run.names[:4]), segment_length=5.12)
    model = road_model(car)
    rows = slice(4, 100)
    measured = np.einsum("ip,pqf,jq->fij", model.layout.reduction, spectra.matrix[:, :, rows], model.layout.reduction)
    one = replace(classes(3, n_classes=1), speeds=np.array([speed]), spreads=np.zeros(1))
    model = road_model(car, spectra=one)
    parameters = model.start.copy()
    parameters[model.names.index("roughness")] = np.log(256e-6)
    parameters[model.rows("noise")[-1]] = -30.0
    expected = model.matrix(parameters)[0]
    size = np.sqrt(np.einsum("fii,fjj->fij", expected, expected).real)
    error = ((measured - expected) / size).reshape(8, 12, 3, 3).mean(axis=1)  # 468 segments, 12 lines each
    assert np.abs(error).max() < 0.07
