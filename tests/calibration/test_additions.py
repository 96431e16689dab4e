"""Parts that a file lacks: masses on mounts and flexible modes."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.calibration.draft import component_numbers, explicit
from sprung.calibration.fitting import FreeVehicle, JointFit, likely_mount, with_mode, with_mount
from sprung.calibration.joint import fitted, joint_of, scaled_start
from sprung.likelihood import CornerSettings
from sprung.vehicles import MountedMass
from sprung.vehicles.sections import FlexibleMode


@pytest.mark.slow
@pytest.mark.parametrize(("frequency", "axle"), [(11.0, 0), (16.0, 1)])
def test_the_misfit_says_where_a_mass_is_and_at_which_frequency(hatchback, window_of_data, frequency, axle) -> None:
    draft = explicit(hatchback)
    place = hatchback.axle[axle].x
    mount = MountedMass(mass=120.0, x=place, frequency=frequency, damping_ratio=0.08)
    truth = window_of_data(None, with_mount(draft, mount), ())
    data = replace(truth.spectra, matrices=truth.matrix(truth.start))
    numbers = component_numbers(draft, std=0.2)
    joint = joint_of([window_of_data(replace(data, weights=data.weights / 1e3), draft, numbers)])
    fit = JointFit(FreeVehicle((), draft, numbers, CornerSettings()), joint, fitted(joint, scaled_start(joint)), ())
    likely, gain = likely_mount(fit)
    assert likely is not None
    assert gain > 10
    assert likely.frequency == pytest.approx(frequency, rel=0.12)
    assert likely.x == pytest.approx(place, abs=0.3)


def test_a_complete_file_asks_for_no_mass(hatchback, window_of_data) -> None:
    draft = explicit(hatchback)
    numbers = component_numbers(draft, std=0.7)
    truth = window_of_data(None, draft, numbers)
    data = replace(truth.spectra, matrices=truth.matrix(truth.start))
    joint = joint_of([window_of_data(data, draft, numbers)])
    fit = JointFit(FreeVehicle((), draft, numbers, CornerSettings()), joint, truth.start, ())
    assert likely_mount(fit)[1] < 0.1


def test_a_mass_on_rigid_mounts_leaves_the_vehicle_as_it_was(hatchback) -> None:
    draft = explicit(hatchback)
    rigid = with_mount(draft, MountedMass(mass=150.0, x=0.9, frequency=2e3, damping_ratio=0.1))
    before = draft.structure().modes().natural_frequency
    after = rigid.structure().modes().natural_frequency[: before.size]
    assert after == pytest.approx(before, rel=1e-4)
    assert rigid.vehicle.body.mass == pytest.approx(hatchback.body.mass - 150)
    wheelbase = rigid.vehicle.axle[0].x - rigid.vehicle.axle[1].x
    assert wheelbase == pytest.approx(hatchback.axle[0].x - hatchback.axle[1].x)


def test_a_flexible_mode_has_its_frequency(hatchback) -> None:
    draft = with_mode(explicit(hatchback), FlexibleMode(shape="torsion", frequency=22.0, damping_ratio=0.03))
    assert draft.vehicle.flexible_mode[0].mass is not None
    frequencies = draft.structure().modes().natural_frequency
    assert np.min(np.abs(frequencies - 22.0)) < 1.0
