"""Noise of the sensors in the coordinates of the data."""

import numpy as np
import pytest

from sprung.likelihood import SensorNoise, rigid_layout
from sprung.likelihood.terms import nominal_terms
from sprung.vehicles import Sensor, structure

#: Usual noise of an accelerometer [m/s^2] and of a gyroscope [rad/s].
ACCELERATION, RATE = 1e-2, 1e-3


def noise_of(vehicle, classes, log_densities):
    nominal = structure(vehicle)
    layout = rigid_layout(nominal)
    spectra = classes(len(layout.rows))
    terms = nominal_terms(nominal, layout, spectra)
    return layout, spectra.grid, SensorNoise(layout).contribute(np.asarray(log_densities), terms).noise


def test_noise_of_an_accelerometer_is_white_and_reaches_the_coordinates_as_its_readings_do(car, classes) -> None:
    layout, _, noise = noise_of(car, classes, np.log([4.0, 1e-30, 1e-30, 1e-30]))
    column = layout.reduction[:, 0]
    expected = np.broadcast_to(4.0 * ACCELERATION**2 * np.outer(column, column), noise.shape)
    assert noise == pytest.approx(expected, rel=1e-9, abs=1e-15)


def test_noise_of_a_gyroscope_grows_with_the_square_of_the_frequency(car, classes) -> None:
    """White in rad/s, so w^2 times as dense in rad/s^2."""
    roll = Sensor(channel="wx", quantity="angular_velocity", unit="rad/s", direction=(1.0, 0.0, 0.0))
    layout, grid, noise = noise_of(car.model_copy(update={"sensor": (roll,)}), classes, [0.0])
    assert layout.coordinates == ("roll",)
    assert noise[:, 0, 0].real == pytest.approx(RATE**2 * (2 * np.pi * grid) ** 2)
