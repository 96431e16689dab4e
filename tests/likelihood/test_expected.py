"""Expected precision against that of fits, and its limits."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood import fit_corners
from sprung.likelihood.expected import ExpectedDrive, ExpectedFit, expected_fit
from sprung.simulation import RoadConditions, RoadDrive, simulate_drive
from sprung.vehicles import read_vehicle

CAR = read_vehicle("zafira")


@pytest.mark.slow
def test_a_fit_reports_what_was_expected() -> None:
    drive = RoadDrive(duration=600.0, sampling_rate=100.0, speed=(6.0, 20.0), road=RoadConditions("C"), snr=50.0)
    fit = fit_corners(simulate_drive(CAR, drive, seed=1).recording, CAR)
    rows = fit.model.rows("components")
    reported = ExpectedFit(fit.components, fit.covariance[np.ix_(rows, rows)], 0.7)
    expected = expected_fit(CAR, ExpectedDrive(speed=(6.0, 20.0), roughness=256e-6, sampling_rate=100.0, driving=1e-5))
    for name in ("std", "contrast_std"):
        ratios = np.array(list(getattr(reported, name).values())) / list(getattr(expected, name).values())
        assert np.all(np.abs(ratios - 1) < 0.25), name


def test_a_vehicle_without_speed_is_less_certain() -> None:
    known, unknown = (expected_fit(CAR, ExpectedDrive(has_speed=each)) for each in (True, False))
    assert all(unknown.std[part] >= known.std[part] - 1e-12 for part in known.components)


def test_speeds_that_fall_are_refused() -> None:
    with pytest.raises(ParameterError, match="must rise"):
        ExpectedDrive(speed=(20.0, 10.0))
