"""Viscous damping and dry friction of suspensions, from exact spectra and from nonlinear drives."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood import CornerFit, fit_corners
from sprung.likelihood.dry_friction import Friction, common_friction, separate_friction, usual_friction
from sprung.likelihood.plate_test import _friction_forces
from sprung.likelihood.uncertainty import expected_covariance
from sprung.simulation import ForceLaw, RoadConditions, RoadDrive, SuspensionConditions, simulate_drive
from sprung.vehicles import Component

CORNERS = ("front_left", "front_right", "rear_left", "rear_right")


def velocities(model, parameters):
    """RMS velocity of each suspension in each class, by the matrices of motion."""
    structure, terms = model.structure, model.terms(parameters)
    system, w = structure.system, 2 * np.pi * terms.frequencies
    dynamic = system.stiffness + 1j * w[:, None, None] * system.damping - (w**2)[:, None, None] * system.mass
    motion = np.linalg.solve(dynamic, np.broadcast_to(system.input_matrix, (w.size, *system.input_matrix.shape)))
    found = []
    for element in structure.elements:
        if element.part == "suspension":
            speed = 1j * w[:, None] * (element.elongation @ motion)
            power = np.einsum("fi,cfij,fj->cf", speed, terms.inputs, speed.conj()).real
            found.append(np.sqrt(np.trapezoid(power, terms.frequencies, axis=1)))
    return np.array(found)


def with_friction(model, forces):
    """The model with the spectra of its vehicle with friction, as the damping that it has in each class."""
    gains, nominal = np.sqrt(2 / np.pi) / velocities(model, model.start), model.structure.components()
    matrices = []
    for number in range(model.spectra.counts.size):
        parameters = model.start.copy()
        for row, corner in enumerate(CORNERS):
            damper = nominal[Component(corner, "damper")]
            parameters[model.names.index(f"{corner}.damper")] = np.log1p(forces[row] * gains[row, number] / damper)
        matrices.append(model.matrix(parameters)[number])
    return replace(model, spectra=replace(model.spectra, matrices=np.array(matrices)))


def at_start(model):
    """A fit that ends at the start of its model."""
    covariance = expected_covariance(model.information(model.start), model.prior_std)
    return CornerFit(model, model.start, covariance, np.zeros((3, 96)), 0.0, 54, 0, ())


@pytest.fixture
def model(car, road_model, with_data):
    """A model of a car with so much exact data that the prior is nothing."""
    model = road_model(car)
    return with_data(model, model.start, counts=1e8)


def test_exact_spectra_give_the_friction_and_leave_the_damper(model) -> None:
    """To first order in the force: a hundredth of a newton adds a thousandth of a percent to the damping."""
    forces = np.array([0.02, 0.0, 0.01, 0.03])
    fit = at_start(with_friction(model, forces))
    loose = replace(usual_friction(fit), covariance=1e6 * np.eye(4))
    apart = separate_friction(fit, prior=loose)
    assert apart.friction.forces == pytest.approx(forces, abs=3e-4)
    assert apart.parameters[model.rows("components")] == pytest.approx(np.zeros(12), abs=2e-6)
    assert common_friction([fit]).forces == pytest.approx(forces, abs=3e-4)
    assert apart.velocities == pytest.approx(np.sqrt(np.mean(velocities(model, model.start) ** 2, axis=1)))


def test_without_friction_the_parameters_stay(model) -> None:
    fit = at_start(model)
    loose = replace(usual_friction(fit), forces=np.zeros(4))
    apart = separate_friction(fit, prior=loose)
    assert apart.friction.forces == pytest.approx(np.zeros(4), abs=1e-6)
    assert apart.parameters == pytest.approx(fit.parameters, abs=1e-6)
    assert np.all(apart.friction.is_identifiable)


def test_one_speed_says_nothing_about_friction(car, road_model, classes, with_data) -> None:
    """It stays as it was, and the damper has what is left, uncertain by as much as the friction."""
    one = road_model(car, spectra=classes(3, n_classes=1))
    fit = at_start(with_data(one, one.start, counts=1e6))
    apart, usual = separate_friction(fit), usual_friction(fit)
    assert apart.friction.forces == pytest.approx(usual.forces, rel=0.1)
    assert apart.friction.std == pytest.approx(usual.std, rel=0.05)
    assert not np.any(apart.friction.is_identifiable)
    row = one.names.index("front_left.damper")
    gain = np.sqrt(2 / np.pi) / velocities(one, one.start)[0, 0]
    damper = one.structure.components()[Component("front_left", "damper")]
    assert np.exp(apart.parameters[row]) == pytest.approx(1 - apart.friction.forces[0] * gain / damper, abs=2e-3)
    both = apart.covariance[row, one.start.size]
    assert both / np.sqrt(apart.covariance[row, row]) / apart.friction.std[0] < -0.95


def test_segments_that_scatter_more_say_less(car, road_model, classes, with_data) -> None:
    """They widen what the data say, and not what was known before."""
    one = road_model(car, spectra=classes(3, n_classes=1))
    fit = at_start(with_data(one, one.start, counts=1e6))
    scattered = replace(fit, covariance=9 * fit.covariance)
    usual, apart = usual_friction(fit), separate_friction(scattered)
    assert apart.friction.std == pytest.approx(usual.std, rel=0.05)
    assert np.all(apart.friction.std <= usual.std)
    assert apart.friction.forces == pytest.approx(usual.forces, rel=0.1)


def test_usual_friction_is_a_share_of_the_load(model) -> None:
    usual = usual_friction(at_start(model))
    assert usual.corners == CORNERS
    mass = model.structure.mass[0, 0] + 4 * 40.5
    assert usual.forces.sum() == pytest.approx(0.007 * 9.80665 * mass)
    assert usual.covariance[0, 1] == pytest.approx(0.8 * usual.std[0] * usual.std[1])


def test_friction_is_not_negative(model) -> None:
    """The spectra of a car with less damping on smooth roads than on rough ones."""
    fit = at_start(with_friction(model, np.array([-0.02, 0.01, 0.0, 0.0])))
    apart = separate_friction(fit, prior=replace(usual_friction(fit), covariance=1e6 * np.eye(4)))
    assert apart.friction.forces[0] == 0.0
    assert np.all(apart.friction.forces >= 0)


def test_more_drives_know_more(model, with_data) -> None:
    fit = at_start(with_data(model, model.start, counts=50.0))
    stds = [common_friction(number * [fit]).std for number in (1, 4)]
    assert np.all(stds[1] < 0.75 * stds[0])
    assert separate_friction(fit).friction.std == pytest.approx(stds[0], rel=0.15)


def test_wrong_vehicles_are_refused(model) -> None:
    fit = at_start(model)
    with pytest.raises(ParameterError, match="give at least one"):
        common_friction([])
    other = Friction(("front", "rear"), np.ones(2), np.eye(2), np.ones(2))
    with pytest.raises(ParameterError, match="prior is of front, rear"):
        separate_friction(fit, prior=other)


def test_friction_forces_of_suspensions_that_move_each_other_oppose_their_velocities() -> None:
    """At small amplitudes F v / u, at large ones the 4 F / pi of Coulomb friction, by quadrature over a turn."""
    random = np.random.default_rng(1)
    drawn = random.standard_normal((50, 3, 3)) + 1j * random.standard_normal((50, 3, 3))
    mobility = np.asarray(np.eye(3) + 0.1 * drawn, dtype=np.complex128)
    turned = np.exp(2j * np.pi * random.uniform(size=(50, 3)))
    free = np.asarray(10 ** random.uniform(-3, 2, (50, 3)) * turned, dtype=np.complex128)
    friction, sliding, turn = np.array([0.5, 1.0, 0.2]), 0.05, 2 * np.pi * np.arange(4000) / 4000
    forces = _friction_forces(free, mobility, friction, sliding)
    moved = free - np.einsum("fij,fj->fi", mobility, forces)
    over_time = np.abs(moved)[..., None] * np.cos(turn)
    by_quadrature = 2 * np.mean(over_time / np.hypot(over_time, sliding) * np.cos(turn), axis=-1)
    assert np.abs(forces) == pytest.approx(friction * by_quadrature, rel=0.03)
    assert forces / np.abs(forces) == pytest.approx(moved / np.abs(moved), rel=0.01)
    assert 0.1 < np.mean(np.abs(forces) > 1.2 * friction) < 0.9


@pytest.mark.slow
def test_friction_of_drives_on_several_roads(car) -> None:
    """25 N at each corner: dampers of a linear fit are 10 to 30 % high, those beside friction are not."""
    law = {"suspension": ForceLaw(friction=25.0)}
    fits = []
    for road in "AC":
        drive = RoadDrive(
            duration=300.0,
            sampling_rate=80.0,
            speed=(8.0, 25.0),
            snr=50.0,
            road=RoadConditions(road),
            suspension=SuspensionConditions(force_laws=law),
        )
        fits.append(fit_corners(simulate_drive(car, drive, seed=3).recording, car))
    common = common_friction(fits)
    assert np.all(common.is_identifiable)
    assert np.all(np.abs(common.forces - 25.0) < 3 * common.std)
    for fit in fits:
        apart = separate_friction(fit, prior=common)
        rows = [fit.model.names.index(f"{corner}.damper") for corner in CORNERS]
        std = np.sqrt(np.diag(apart.covariance))[rows]
        assert np.all(np.abs(apart.parameters[rows]) < 3 * std)
        assert np.mean(fit.parameters[rows]) > np.mean(apart.parameters[rows]) + 0.04
