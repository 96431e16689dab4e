"""Springs and dampers of both stages of a vehicle on bogies, from sensors on frames and body."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood import CornerSettings, fit_corners
from sprung.simulation import RailDrive, simulate_drive
from sprung.vehicles import parse_fault, read_vehicle

FAULTS = {"bogie1_left.secondary_spring": -0.2, "bogie2_rear_left.primary_damper": -0.3}


@pytest.fixture(scope="module")
def fit():
    """Fit to three minutes on welded rails, with two changed parts."""
    faults = tuple(parse_fault(f"{name}={change}") for name, change in FAULTS.items())
    drive = RailDrive(duration=180.0, sampling_rate=100.0, snr=50.0, welded=True, faults=faults)
    metro = read_vehicle("metro")
    return fit_corners(simulate_drive(metro, drive, seed=3).recording, metro, settings=CornerSettings(band=(0.4, 12.0)))


def test_all_springs_and_dampers_of_both_stages_are_fitted(fit) -> None:
    """Four secondary and eight primary suspensions; the contacts with the rails keep the file's values."""
    kinds = [component.kind for component in fit.components]
    assert {kind: kinds.count(kind) for kind in kinds} == {
        "secondary_spring": 4,
        "secondary_damper": 4,
        "primary_spring": 8,
        "primary_damper": 8,
    }
    assert fit.is_identifiable.all()


def test_estimates_are_the_true_values_within_their_standard_deviations(fit) -> None:
    true = np.array([np.log1p(FAULTS.get(str(component), 0.0)) for component in fit.components])
    errors = fit.log_ratios - true
    assert np.abs(errors).max() < 0.03
    assert np.sqrt(np.mean((errors / fit.log_ratios_std) ** 2)) < 1.6
    assert np.max(fit.log_ratios_std) < 0.03


def test_what_runs_on_a_track_only_has_no_other_excitation() -> None:
    metro = read_vehicle("metro")
    run = simulate_drive(metro, RailDrive(duration=20.0, sampling_rate=50.0), seed=1).recording
    with pytest.raises(ParameterError, match=r"kind='road' of a vehicle on bogies must be \"rail\""):
        fit_corners(run, metro, settings=CornerSettings(kind="road"))
