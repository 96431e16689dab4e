"""Terms of a nominal vehicle."""

import numpy as np
import pytest

from sprung.likelihood import rigid_layout
from sprung.likelihood.terms import nominal_terms
from sprung.vehicles import structure


def test_elements_have_the_dynamic_stiffness_of_their_springs_and_dampers(car, classes) -> None:
    """k + i w c of a suspension, k of a tyre, from the vehicle file."""
    nominal = structure(car)
    spectra = classes(3, n_classes=2)
    terms = nominal_terms(nominal, rigid_layout(nominal), spectra)
    pulsation = 2 * np.pi * spectra.grid
    front = car.axle[0]
    for element, stiffness in zip(nominal.elements, terms.stiffness, strict=True):
        if element.owner != "front_left":
            continue
        is_tyre = element.foot is not None
        expected = front.tyre_stiffness if is_tyre else front.spring_stiffness + 1j * pulsation * front.damping
        assert stiffness == pytest.approx(np.broadcast_to(expected, pulsation.shape), rel=1e-12)


def test_sensors_are_perfect_and_nothing_drives_the_wheels(car, classes) -> None:
    nominal = structure(car)
    spectra = classes(3, n_classes=2)
    terms = nominal_terms(nominal, rigid_layout(nominal), spectra)
    assert terms.frequencies.size == spectra.frequencies.size + 2
    assert terms.inputs.shape == (2, 98, 4, 4)
    assert not terms.inputs.any()
    assert not terms.noise.any()
    assert not terms.feedthrough.any()
    assert np.all(terms.channel_response == 1)
    assert np.array_equal(terms.mass, nominal.mass)
