"""The fit of a drive with a second start from its modes, against the same done step by step."""

import numpy as np
import pytest

from sprung.diagnosis.observation import fit_drive
from sprung.errors import IdentificationError
from sprung.identification import IdentificationSettings, cov_ssi
from sprung.likelihood import fit_corners
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import read_vehicle


@pytest.fixture(scope="module")
def car():
    return read_vehicle("zafira")


@pytest.fixture(scope="module")
def run(car):
    return simulate_drive(car, RoadDrive(duration=120.0, snr=50.0), seed=1).recording


def test_modes_of_the_drive_are_a_start_and_a_check(run, car):
    modes = cov_ssi(run, settings=IdentificationSettings(has_road_modes=False, refine=False), vehicle=car).modes
    expected = fit_corners(run, car, modes=modes)
    fit = fit_drive(run, car)
    np.testing.assert_array_equal(fit.log_ratios, expected.log_ratios)
    np.testing.assert_array_equal(fit.from_modes, expected.from_modes)
    assert fit.from_modes is not None


def test_a_drive_without_modes_is_fitted_from_nominal_values(run, car, monkeypatch):
    def no_modes(*_, **__):
        raise IdentificationError("no mode")

    monkeypatch.setattr("sprung.diagnosis.observation.cov_ssi", no_modes)
    fit = fit_drive([run], car)
    np.testing.assert_array_equal(fit.log_ratios, fit_corners(run, car).log_ratios)
    assert fit.from_modes is None
