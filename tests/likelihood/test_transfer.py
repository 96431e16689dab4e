"""Response of a vehicle, and derivatives of its spectral matrix with respect to every term."""

from dataclasses import replace

import numpy as np
import pytest

from sprung._arrays import Complex
from sprung.likelihood.transfer import classes_times, sum_of_products, times_classes, transfer
from sprung.vehicles import frequency_response, structure


@pytest.fixture
def on_a_road(whole_model, somewhere, with_data):
    """A model of a car on a road with the data of some parameters, and its terms at others."""
    model = whole_model("zafira", "road")
    return with_data(model, somewhere(model, seed=1)), model.terms(somewhere(model))


def test_transfer_is_the_frequency_response(car, road_model) -> None:
    """H of the model times the reduction's inverse: what `frequency_response` of the state space gives."""
    model = road_model(car)
    H = transfer(model.terms(model.start)).matrix
    expected = model.layout.reduction @ frequency_response(structure(car), model.spectra.grid)
    assert pytest.approx(expected, rel=1e-9, abs=1e-9 * np.abs(expected).max()) == H


@pytest.mark.parametrize(
    "term", ["stiffness", "mass", "forces", "motion", "feedthrough", "channel_response", "inputs", "noise"]
)
def test_gradient_of_a_term_is_the_finite_difference(term, on_a_road, misfit, gradients_of) -> None:
    """d objective = Re sum(g dT) for a change of a term, Hermitian or symmetric where the term is."""
    model, terms = on_a_road
    value, generator = getattr(terms, term), np.random.default_rng(3)
    change = generator.standard_normal(value.shape)
    if np.iscomplexobj(value):
        change = change + 1j * generator.standard_normal(value.shape)
    if term in {"mass", "inputs", "noise"}:
        change = change + change.conj().swapaxes(-1, -2)
    typical = {"forces": 1e3, "feedthrough": 10.0}.get(term, np.abs(value).mean())
    change *= 1e-6 * typical
    gradients = gradients_of(model, terms)
    gradient = gradients.stiffness(range(len(value))) if term == "stiffness" else getattr(gradients, term)
    above, below = (misfit(model, replace(terms, **{term: value + sign * change})) for sign in (1, -1))
    assert np.sum(gradient * change).real == pytest.approx((above - below) / 2, rel=1e-4)


def with_measured_input(terms, *, density=0.3):
    """Terms with one more input, which moves no wheel and is independent of the road."""
    measured = np.pad(terms.measured_inputs, ((0, 0), (0, 0), (0, 1), (0, 1)))
    measured[..., -1, -1] = density
    more = {name: np.pad(getattr(terms, name), ((0, 0), (0, 1))) for name in ("feet", "forces", "feedthrough")}
    return replace(terms, measured_inputs=measured, **more)


def test_a_measured_input_that_a_channel_reads_adds_its_spectrum(on_a_road) -> None:
    _, terms = on_a_road
    more = with_measured_input(terms)
    more.feedthrough[2, -1] = 0.5  # half of the input is read by the third channel
    column = 0.5 * terms.channel_response[:, 2, None] * terms.reduction[:, 2]
    both = transfer(more).spectral_matrix
    expected = transfer(terms).spectral_matrix + 0.3 * column[:, :, None] * column[:, None, :].conj()
    assert both == pytest.approx(expected, rel=1e-9, abs=1e-12)


def test_products_with_all_classes_are_those_of_each() -> None:
    generator = np.random.default_rng(1)
    by_class: Complex = generator.standard_normal((5, 7, 3, 4)).astype(np.complex128)
    weights: Complex = 1j * generator.standard_normal((5, 7, 4, 2)).astype(np.complex128)
    common: Complex = generator.standard_normal((7, 4, 2)) + 1j * generator.standard_normal((7, 4, 2))
    assert classes_times(by_class, common) == pytest.approx(by_class @ common)
    assert times_classes(common, weights.swapaxes(-1, -2)) == pytest.approx(common @ weights.swapaxes(-1, -2))
    assert sum_of_products(by_class, weights) == pytest.approx((by_class @ weights).sum(axis=0))
