"""The likelihood against finite differences, exact spectra and simulated drives."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood import MassChange, RailInputs, RigInputs
from sprung.likelihood.fitting import minimised
from sprung.likelihood.spectra import onto_grid, through_window
from sprung.likelihood.whittle import inverse_and_logdet
from sprung.signals.spectrum import spectral_matrix
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import frequency_response, structure


@pytest.fixture(params=["plain", "bushed", "loaded", "imu", "sensors", "rail", "rig"])
def model(request, car, road_model):
    if request.param == "bushed":
        axles = tuple(axle.model_copy(update={"damper_bushing_stiffness": 60e3}) for axle in car.axle)
        return road_model(car.model_copy(update={"axle": axles}))
    if request.param == "loaded":
        mass = np.zeros((7, 7))
        mass[0, 0], mass[0, 1], mass[1, 0] = 100.0, -50.0, -50.0
        return road_model(car, masses=(MassChange("load", mass, 1.0),))
    if request.param in {"rail", "rig"}:
        model = road_model(car)
        road = model.inputs
        inputs = (
            RailInputs(road.spectra, road.positions, road.sides, contact_length=0.01)
            if request.param == "rail"
            else RigInputs(road.spectra, model.structure.inputs, usual_level=1e-7)
        )
        return replace(model, inputs=inputs)
    if request.param == "sensors":
        return road_model(car, sensors=True)
    if request.param == "imu":
        return road_model(car.model_copy(update={"sensor": imu()}))
    return road_model(car)


def imu():
    from sprung.vehicles import Sensor

    up, ahead, left = [0.0, 0.0, 1.0], [1.0, 0.0, 0.0], [0.0, 1.0, 0.0]
    rate = {"quantity": "angular_velocity", "unit": "deg/s"}
    return (
        Sensor(channel="az", quantity="acceleration", unit="g", position=[0.3, 0.1, 0.2], direction=up),
        Sensor(channel="ax", quantity="acceleration", unit="g", position=[0.3, 0.1, 0.2], direction=ahead),
        Sensor(channel="wx", direction=ahead, **rate),
        Sensor(channel="wy", direction=left, **rate),
        Sensor(channel="wz", direction=up, **rate),
    )


def somewhere(model, seed=0, size=0.1):
    return model.start + size * np.random.default_rng(seed).standard_normal(model.start.size)


def test_gradient_is_the_finite_difference(model, with_data):
    generator = np.random.default_rng(1)
    model = with_data(model, somewhere(model), generator=generator)
    point = somewhere(model, seed=2)
    gradient = model.objective(point)[1]
    steps = 1e-4 * np.eye(point.size)
    # five-point differences
    values = [[model.objective(point + k * step)[0] for k in (-2, -1, 1, 2)] for step in steps]
    expected = np.array([(low2 - 8 * low + 8 * high - high2) / 12e-4 for low2, low, high, high2 in values])
    assert gradient == pytest.approx(expected, rel=1e-6, abs=1e-6 * np.abs(expected).max())


def test_derivatives_are_finite_differences(model):
    point = somewhere(model)
    found = model.derivatives(point)
    for k, step in enumerate(1e-5 * np.eye(point.size)):
        expected = (model.matrix(point + step) - model.matrix(point - step)) / 2e-5
        size = np.abs(model.matrix(point)).max()
        assert np.abs(found[k] - expected).max() < 1e-6 * np.abs(expected).max() + 1e-9 * size


def test_exact_spectra_give_the_parameters_back(model, with_data):
    """By the search, and then by steps of Fisher scoring, which need no difference of large numbers."""
    truth = model.start + 0.2 * np.minimum(model.widths, 1.0) * np.random.default_rng(0).standard_normal(
        model.start.size
    )
    truth[[row for row, name in enumerate(model.names) if name.startswith("class_")]] = 0
    some = with_data(model, truth, counts=100.0)
    start = some.scaled_start()
    found = minimised(some, start)
    free = slice(0, model.n_free)
    if not model.masses:  # a load and all components together can hardly be told apart from accelerations
        assert found[free] == pytest.approx(truth[free], abs=0.05)
    for counts in (1e2, 1e3, 1e4, 1e6, 1e8, 1e10, 1e12, 1e12, 1e12, 1e12):  # the prior fades
        exact = with_data(model, truth, counts=counts)
        information = exact.information(found) + np.diag(1 / exact.widths**2)
        found = found - np.linalg.solve(information, exact.objective(found)[1])
    assert found[free] == pytest.approx(truth[free], abs=1e-6 if model.masses else 1e-8)
    assert exact.matrix(found) == pytest.approx(exact.matrix(truth), rel=1e-7, abs=1e-9)


def test_information_is_the_mean_curvature(car, road_model, with_data):
    """Fisher information = second derivative of the expected likelihood at the truth."""
    model = road_model(car)
    truth = somewhere(model)
    exact = with_data(model, truth)
    information = model.information(truth)
    for k in (0, 1, 5, 13):
        step = 1e-4 * np.eye(truth.size)[k]
        curvature = (exact.objective(truth + step)[1] - exact.objective(truth - step)[1]) / 2e-4
        curvature[k] -= 1 / model.widths[k] ** 2
        assert curvature[:12] == pytest.approx(information[k, :12], rel=1e-4, abs=1e-5 * information[k, k])


def test_window_and_its_adjoint():
    generator = np.random.default_rng(1)
    x = generator.standard_normal((2, 12, 3, 3)) + 0j
    y = generator.standard_normal((2, 10, 3, 3)) + 0j
    assert np.vdot(y, through_window(x)) == pytest.approx(np.vdot(onto_grid(y), x))
    assert through_window(np.ones((1, 5, 1, 1)) + 0j) == pytest.approx(1)


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_inverse_and_determinant(size):
    generator = np.random.default_rng(1)
    root = generator.standard_normal((2, 5, size, size)) + 1j * generator.standard_normal((2, 5, size, size))
    matrices = root @ root.conj().swapaxes(-1, -2) + np.eye(size)
    inverse, logdet = inverse_and_logdet(matrices)
    assert inverse @ matrices == pytest.approx(np.broadcast_to(np.eye(size), matrices.shape), abs=1e-10)
    assert logdet == pytest.approx(np.linalg.slogdet(matrices)[1])


def test_search_beyond_all_numbers_turns_back(car, road_model, with_data):
    model = with_data(road_model(car), road_model(car).start)
    value, gradient = model.objective(model.start + 1e4)
    assert value == 1e100
    assert not gradient.any()


def test_transfer_is_the_frequency_response(car, road_model):
    """H of the model times the reduction's inverse: what `frequency_response` of the state space gives."""
    model = road_model(car)
    arms = model.arms(np.zeros(12))
    H = model.response(arms, np.zeros(12))[2]
    expected = model.layout.reduction @ frequency_response(structure(car), model.spectra.grid)
    assert pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max()) == H


@pytest.mark.slow
def test_spectra_of_a_simulated_drive_are_the_models(car, road_model, classes):
    """Twenty minutes at 12 m/s: every entry of the spectral matrix, phases of the delay included, within chance."""
    speed = 12.0
    run = simulate_drive(car, RoadDrive(duration=1200.0, speed=(speed, speed)), seed=3).recording
    spectra = spectral_matrix(run.select(run.names[:4]), segment_length=5.12)
    model = road_model(car)
    rows = slice(4, 100)
    measured = np.einsum("ip,pqf,jq->fij", model.layout.reduction, spectra.matrix[:, :, rows], model.layout.reduction)
    one = replace(classes(3, n_classes=1), speeds=np.array([speed]), spreads=np.zeros(1))
    model = road_model(car, spectra=one)
    parameters = model.start
    parameters[12:15] = np.log(256e-6), 2.0, np.log(1.5)
    parameters[-1] = -30.0
    expected = model.matrix(parameters)[0]
    size = np.sqrt(np.einsum("fii,fjj->fij", expected, expected).real)
    error = ((measured - expected) / size).reshape(8, 12, 3, 3).mean(axis=1)  # 468 segments, 12 lines each
    assert np.abs(error).max() < 0.07
