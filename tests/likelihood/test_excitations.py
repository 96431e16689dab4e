"""Braking and cornering as random forces on pitch and roll."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood import rigid_layout
from sprung.likelihood.excitations import Driving, driving
from sprung.likelihood.terms import nominal_terms
from sprung.likelihood.transfer import transfer
from sprung.vehicles import chain, structure


@pytest.fixture
def terms(car, classes):
    """Terms of the car with hardly any road."""
    nominal = structure(car)
    return nominal_terms(nominal, rigid_layout(nominal), classes(3, n_classes=2))


def test_slow_braking_and_cornering_tilt_the_body_as_in_a_steady_state(car, terms) -> None:
    """m h a over the stiffness in pitch and in roll, of springs and tyres in series."""
    slow = nominal_terms_at(terms, 1e-3)
    block = Driving(structure(car), height=0.5)
    displacements = transfer(block.contribute(block.start, slow)).displacements[0, :, -2:].real
    series = [1 / (1 / axle.spring_stiffness + 1 / axle.tyre_stiffness) for axle in car.axle]
    total, moment = 2 * sum(series), sum(2 * k * axle.x for k, axle in zip(series, car.axle, strict=True))
    pitch = sum(2 * k * axle.x**2 for k, axle in zip(series, car.axle, strict=True)) - moment**2 / total
    roll = sum(2 * k * axle.half_track**2 for k, axle in zip(series, car.axle, strict=True))
    assert displacements[1, 0] == pytest.approx(-car.body.mass * 0.5 / pitch, rel=1e-4)
    assert displacements[2, 1] == pytest.approx(car.body.mass * 0.5 / roll, rel=1e-4)
    assert displacements[[2, 1], [0, 1]] == pytest.approx(0.0, abs=1e-12)


def nominal_terms_at(terms, frequency):
    """The same terms at one frequency."""
    return replace(
        terms,
        frequencies=np.array([frequency]),
        stiffness=terms.stiffness[:, :1].real + 0j,
        channel_response=terms.channel_response[:1],
        inputs=terms.inputs[:, :1],
        measured_inputs=terms.measured_inputs[:, :1],
        noise=terms.noise[:1],
    )


def test_densities_are_powers_of_the_frequency(car, terms) -> None:
    block = Driving(structure(car), height=0.5)
    inputs = block.contribute(np.array([np.log(0.2), np.log(0.3), 4.0, 2.0]), terms).measured_inputs
    f = terms.frequencies
    assert inputs[1, :, 0, 0].real == pytest.approx(0.2 * f**-4)
    assert inputs[0, :, 1, 1].real == pytest.approx(0.3 * f**-2)
    assert not inputs[..., 0, 1].any()


def test_a_chain_has_no_driver() -> None:
    with pytest.raises(ParameterError, match="pitch and roll"):
        driving(chain(), 2.5)
