"""Wrong positions and delays of sensors."""

import numpy as np
import pytest

from sprung.likelihood import SensorDelays, rigid_layout
from sprung.likelihood.sensor_errors import sensor_positions
from sprung.likelihood.terms import nominal_terms
from sprung.vehicles import structure


def test_a_moved_sensor_reads_what_the_vehicle_file_with_its_new_place_says(car, classes) -> None:
    nominal = structure(car)
    layout = rigid_layout(nominal)
    positions = sensor_positions(nominal, layout)
    assert positions.names[:2] == ("acc_fl_x", "acc_fl_y")
    parameters = np.zeros(len(positions.names))
    parameters[:2] = 0.2, -0.1
    x, y, z = car.sensor[0].position
    moved = car.sensor[0].model_copy(update={"position": (x + 0.2, y - 0.1, z)})
    expected = rigid_layout(structure(car.model_copy(update={"sensor": (moved, *car.sensor[1:])})))
    terms = nominal_terms(nominal, layout, classes(3))
    np.testing.assert_allclose(positions.contribute(parameters, terms).motion, expected.motion, atol=1e-12)


def test_a_late_channel_lags_by_a_quarter_period_at_a_quarter_of_its_rate(car, classes) -> None:
    """tau = 1 / (4 f) turns by -90 degrees at f and leaves the others as they are."""
    nominal = structure(car)
    layout, spectra = rigid_layout(nominal), classes(3)
    delays = SensorDelays(layout, ("acc_fr",))
    assert delays.names == ("acc_fr_lag",)
    terms = nominal_terms(nominal, layout, spectra)
    response = delays.contribute(np.array([1 / (4 * spectra.grid[30])]), terms).channel_response
    assert response[30] == pytest.approx(np.array([1, -1j, 1, 1]), abs=1e-12)
    assert np.abs(response) == pytest.approx(np.ones(response.shape))
