"""The likelihood of modes: exact spectra give exact poles, true derivatives, closed forms of its information."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood.hermitian import real_form
from sprung.likelihood.modal import ModalModel, ModalParameters
from sprung.likelihood.modal_spectra import LineSpectra
from sprung.likelihood.search import minimised, scored

FREQUENCY, DAMPING = np.array([2.0, 2.1, 5.0]), np.array([0.01, 0.02, 0.015])


def parameters(n_channels=3):
    generator = np.random.default_rng(1)
    shapes = generator.normal(size=(3, n_channels)) + 0.2j * generator.normal(size=(3, n_channels))
    factor = generator.normal(size=(3, 3)) + 1j * generator.normal(size=(3, 3))
    return ModalParameters(
        natural_frequency=FREQUENCY,
        damping_ratio=DAMPING,
        common_exponent=np.zeros(1),
        force_exponents=np.zeros(3),
        mode_shapes=shapes / shapes[np.arange(3), np.argmax(np.abs(shapes), axis=1)][:, None],
        forces=factor @ factor.conj().T,
        noise=generator.uniform(1.0, 5.0, size=n_channels),
        noise_exponents=np.zeros(n_channels),
    )


def model_of(values, *, count=1.0, spread=0.0, exponent=2.0):
    """Return a model whose data are exactly its own spectra."""
    frequencies = np.geomspace(0.5, 12.0, 400)
    size = values.noise.size
    empty = LineSpectra(
        frequencies, np.full(400, spread), np.full(400, count), np.broadcast_to(np.eye(size), (400, size, size))
    )
    model = ModalModel(empty, values, exponent)
    return replace(model, spectra=replace(empty, matrices=model.matrix(model.start)))


def disturbed(values, share):
    return replace(
        values,
        natural_frequency=values.natural_frequency * (1 + share * np.array([0.3, -0.2, 0.4]) * values.damping_ratio),
        damping_ratio=values.damping_ratio * (1 + share * np.array([0.2, -0.2, 0.3])),
        mode_shapes=np.where(values.mode_shapes == 1, 1, values.mode_shapes * (1 + 0.1j * share)),
        noise=values.noise * (1 + 0.3 * share),
    )


@pytest.mark.parametrize("spread", [0.0, 0.005])
def test_exact_spectra_give_exact_modes(spread) -> None:
    values = parameters()
    exact = model_of(values, count=1e10, spread=spread)
    start = replace(exact, begin=disturbed(values, 1.0))
    estimate, is_converged = scored(start, start.start)
    fitted = start.unpacked(estimate)
    assert is_converged
    assert fitted.natural_frequency == pytest.approx(FREQUENCY, rel=1e-9)
    assert fitted.damping_ratio == pytest.approx(DAMPING, rel=1e-9 / 0.01)
    assert fitted.mode_shapes == pytest.approx(values.mode_shapes, abs=1e-7)


def test_both_searches_end_at_the_same_modes() -> None:
    exact = model_of(parameters(), count=1e4)
    start = replace(exact, begin=disturbed(parameters(), 0.3))
    one, other = scored(start, start.start)[0], minimised(start, start.start)
    assert one[:6] == pytest.approx(other[:6], abs=1e-4)


@pytest.mark.slow
def test_gradient_and_derivatives_are_those_of_the_model() -> None:
    values = replace(parameters(), common_exponent=np.array([0.1]), force_exponents=np.array([0.02, 0.0, -0.03]))
    exact = model_of(values, spread=0.01, exponent=1.0)
    at = exact.start + 0.02 * np.random.default_rng(2).normal(size=exact.start.size)
    steps = 1e-5 * np.eye(at.size)
    slopes = [(exact.objective(at + step)[0] - exact.objective(at - step)[0]) / 2e-5 for step in steps]
    assert exact.objective(at)[1] == pytest.approx(slopes, rel=1e-5, abs=1e-4)
    inverse = np.linalg.inv(np.linalg.cholesky(exact.matrix(at)))
    changes = [(exact.matrix(at + step) - exact.matrix(at - step)) / 2e-5 for step in steps]
    numeric = np.stack([real_form(inverse @ change @ inverse.conj().swapaxes(-1, -2)) for change in changes], axis=-1)
    assert exact.whitened_derivatives(at) == pytest.approx(numeric, rel=1e-5, abs=1e-6 * np.abs(numeric).max())


def test_parameters_survive_packing() -> None:
    exact = model_of(parameters())
    again = exact.unpacked(exact.packed(parameters()))
    for name in ("natural_frequency", "damping_ratio", "mode_shapes", "forces", "noise", "noise_exponents"):
        assert getattr(again, name) == pytest.approx(getattr(parameters(), name))


def test_information_does_not_depend_on_the_unit_of_a_channel() -> None:
    values, scale = parameters(), np.array([1.0, 1.0, 1e3])
    shapes = values.mode_shapes * scale
    largest = shapes[np.arange(3), np.argmax(np.abs(shapes), axis=1)]
    other = replace(
        values,
        mode_shapes=shapes / largest[:, None],
        forces=values.forces * np.outer(largest, largest.conj()),
        noise=values.noise * scale**2,
    )
    stds = [
        np.sqrt(np.diag(np.linalg.inv(model.information(model.start) + np.diag(1 / model.prior_std**2))))[:6]
        for model in (model_of(values), model_of(other))
    ]
    assert stds[0] == pytest.approx(stds[1], rel=1e-6)


@pytest.mark.parametrize("reach", [5.0, 10.0, 20.0])
def test_uncertainty_of_a_light_mode_without_noise_is_the_closed_form(reach) -> None:
    # With x = (f - f_k) / (xi f_k) there are N = xi f_k T lines for one unit of x, of the density p / (1 + x^2) between
    # -X and X. Then d ln S / df = 2 x / (1 + x^2) / (xi f_k), and, with the free density p of the force,
    # d ln S / d ln xi = -2 / (1 + x^2) less its mean over x:
    #     var(f / f_k) = xi^2 / (4 N (A - B)), var(ln xi) = 1 / (4 N (A + B - 2 A^2 / X)), A = atan X, B = X / (1 + X^2)
    # with limits xi / (2 pi T f_k) and 1 / (2 pi xi T f_k) for wide bands (S.-K. Au 2014, uncertainty laws in ambient
    # modal identification, Mechanical Systems and Signal Processing 48, 15-33).
    f, xi, duration = 10.0, 1e-3, 1e5
    frequencies = np.arange(np.ceil((f - reach * xi * f) * duration), (f + reach * xi * f) * duration) / duration
    values = ModalParameters(
        np.array([f]),
        np.array([xi]),
        np.zeros(1),
        np.zeros(1),
        np.ones((1, 1), dtype=complex),
        np.ones((1, 1), dtype=complex),
        np.array([1e-4]),
        np.zeros(1),
    )
    lines = LineSpectra(
        frequencies,
        np.zeros(frequencies.size),
        np.ones(frequencies.size),
        np.ones((frequencies.size, 1, 1), dtype=complex),
    )
    model = ModalModel(lines, values, 0.0)
    free = np.concatenate([model.rows[name] for name in ("natural_frequency", "damping_ratio", "forces")])
    information = model.information(model.start)[np.ix_(free, free)]
    variances = np.diag(np.linalg.inv(information))
    lines_each = xi * f * duration
    first, second = np.arctan(reach), reach / (1 + reach**2)
    assert variances[0] / xi**2 == pytest.approx(1 / (4 * lines_each * (first - second)), rel=0.01)
    squared = first + second - (2 * first) ** 2 / (2 * reach)
    assert variances[1] == pytest.approx(1 / (4 * lines_each * squared), rel=0.01)


def test_singular_matrices_are_too_far() -> None:
    exact = model_of(parameters())
    at = exact.start.copy()
    at[exact.rows["forces"][:3]] = -1e6
    assert exact.objective(at)[0] == pytest.approx(1e100)
