"""Dry friction from what the segments of nonlinear drives say beside their spectra."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood import fit_corners
from sprung.likelihood.dry_friction import separate_friction, usual_friction
from sprung.likelihood.suspension_forces import _by_bands, friction_forces
from sprung.simulation import ForceLaw, RoadConditions, RoadDrive, SuspensionConditions, simulate_drive
from sprung.vehicles import parse_fault

DRIVE = RoadDrive(duration=400.0, sampling_rate=80.0, speed=(8.0, 22.0), snr=50.0, road=RoadConditions("C"))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("force", "law"),
    [(0.0, None), (30.0, ForceLaw(friction=30.0)), (30.0, ForceLaw(friction=30.0, asymmetry=0.35, cubic=40.0))],
)
def test_one_drive_on_one_road_knows_the_friction(car, force, law) -> None:
    """The spectra alone leave it uncertain by 14 to 21 N, of 25 to 31 N before. A worn damper is part of it."""
    suspension = SuspensionConditions(force_laws={} if law is None else {"suspension": law})
    drive = replace(DRIVE, suspension=suspension, faults=(parse_fault("rear_left.damper=-0.6"),))
    fit = fit_corners(simulate_drive(car, drive, seed=3).recording, car)
    friction, of_spectra = separate_friction(fit).friction, separate_friction(replace(fit, driven=None)).friction
    assert np.all(of_spectra.std > 12.0)
    assert not np.any(of_spectra.is_identifiable)
    assert np.all(friction.std < 9.0)
    assert np.all(friction.is_identifiable)
    assert np.all(np.abs(friction.forces - force) < 3 * friction.std)
    assert np.abs(friction.forces.mean() - force) < 7.0
    apart = separate_friction(fit)
    dampings = [value for part, value in fit.structure().components().items() if part.kind == "damper"]
    assert apart.uneven / dampings == pytest.approx(0.0 if law is None else 0.8 * law.asymmetry, abs=0.07)


@pytest.mark.slow
def test_friction_beyond_the_usual_may_be_valves_that_open(car) -> None:
    """Their force levels off above 0.1 m/s as friction does above 0: the segments call it 95 N of friction."""
    law = ForceLaw(friction=25.0, knee=0.1, knee_slope=0.4)
    drive = replace(DRIVE, suspension=SuspensionConditions(force_laws={"suspension": law}))
    fit = fit_corners(simulate_drive(car, drive, seed=3).recording, car)
    friction = separate_friction(fit).friction
    assert np.all(np.abs(friction.forces - 25.0) < 3 * friction.std)
    assert np.all(friction.std > 10.0)


def test_bands_that_disagree_widen_the_friction() -> None:
    """The jackknife of a mean is its closed form, the variance of the bands' values over their number."""
    values = np.array([3.0, 1.0, 4.0, 1.0, 5.0, 9.0, 2.0, 6.0])
    information = np.tile(np.eye(2)[:, None, :, None], (3 * values.size, 1, 1, 1, 1)).reshape(-1, 2, 1, 2, 1)
    pull = np.repeat(np.stack([values, np.full(values.size, 7.0)], axis=-1), 3, axis=0)[:, :, None]
    given = np.asarray(information, dtype=np.complex128), np.asarray(pull, dtype=np.complex128)
    assert _by_bands(*given, 2) == pytest.approx([np.var(values, ddof=1) / values.size, 0.0])


def test_few_segments_say_nothing_of_friction(car) -> None:
    fit = fit_corners(simulate_drive(car, replace(DRIVE, duration=60.0), seed=3).recording, car)
    assert fit.driven is not None
    assert friction_forces(fit.driven, fit.model, fit.parameters, [0, 2, 4, 6], model_error=0.0) is None
    without = separate_friction(replace(fit, driven=None)).friction
    assert np.array_equal(separate_friction(fit).friction.forces, without.forces)
    assert usual_friction(fit).corners == without.corners
