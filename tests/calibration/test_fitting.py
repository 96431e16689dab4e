"""Joint fits: steps that the score test expects, and misfits in the coordinates of a file."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from sprung.calibration.completion import has_misplaced_sensors
from sprung.calibration.draft import Draft, component_numbers, explicit, sensor_numbers
from sprung.calibration.fitting import (
    FreeVehicle,
    JointFit,
    Weighting,
    expected_steps,
    likely_mount,
    misfit_in,
    with_mode,
    with_mount,
)
from sprung.calibration.joint import WindowSpectra, fitted, joint_of, scaled_start
from sprung.likelihood import CornerSettings, Model, SegmentSpectra, class_spectra, rigid_layout
from sprung.vehicles import MountedMass
from sprung.vehicles.sections import FlexibleMode

CHANNELS = ("acc_fl", "acc_fr", "acc_rl", "acc_rr")


def segments_of(model: Model, parameters: np.ndarray, count: int, rng: np.random.Generator) -> SegmentSpectra:
    """Random segments of a model, the same number at each of its speeds."""
    spectra = model.spectra
    factors = np.linalg.cholesky(model.matrix(parameters))
    shape = (count, *factors.shape[:2], factors.shape[-1])
    white = (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)
    values = np.einsum("cfij,scfj->scfi", factors, white).reshape(-1, *shape[2:])
    speeds = np.tile(spectra.speeds, count)
    return SegmentSpectra(spectra.frequencies, values, speeds, np.full(speeds.size, 0.02), spectra.segment_length, 0)


@pytest.fixture(scope="module")
def fitted_as_given(hatchback, window_of_data):
    """Return a function that makes the fit of a file whose sensors are where they were, or one is farther ahead."""

    @cache
    def fit(shift: float) -> JointFit:
        draft = explicit(hatchback)
        true = draft.with_value(("sensor", 0, "position", 0), hatchback.sensor[0].position[0] + shift)
        numbers = component_numbers(draft, std=0.7)
        truth = window_of_data(None, true, numbers)
        parameters = truth.start.copy()
        parameters[truth.rows("noise")] = np.log(1e-3)
        segments = segments_of(truth, parameters, 60, np.random.default_rng(4))
        joint = joint_of([window_of_data(class_spectra(segments, width=0.1), draft, numbers)])
        end = fitted(joint, scaled_start(joint))
        layout = rigid_layout(draft.structure())
        window = WindowSpectra(segments, joint.models[0].layout, layout, "road")
        weighting = (Weighting(np.ones(segments.speeds.size), (), 1.0),)
        return JointFit(FreeVehicle((window,), draft, numbers, CornerSettings()), joint, end, weighting)

    return fit


def steps_of(fit: JointFit) -> tuple[dict[str, float], float]:
    draft: Draft = fit.free.draft
    free = replace(fit.free, numbers=(*fit.free.numbers, *sensor_numbers(draft, CHANNELS)))
    return expected_steps(free, fit)


@pytest.mark.slow
def test_one_step_shows_a_sensor_that_is_not_where_the_file_says(fitted_as_given) -> None:
    fit = fitted_as_given(0.1)
    steps, gain = steps_of(fit)
    assert gain > 100
    assert max((name for name in steps if name.endswith((".x", ".y"))), key=lambda name: abs(steps[name])) == "acc_fl.x"
    assert steps["acc_fl.x"] == pytest.approx(0.1, abs=0.04)
    assert has_misplaced_sensors(fit)


def test_sensors_in_place_are_left_there(fitted_as_given) -> None:
    fit = fitted_as_given(0.0)
    steps, gain = steps_of(fit)
    assert gain < 15
    assert max(abs(steps[f"{channel}.x"]) for channel in CHANNELS) < 0.02
    assert not has_misplaced_sensors(fit)


def test_the_misfit_is_that_of_the_coordinates_asked_for(fitted_as_given) -> None:
    fit = fitted_as_given(0.0)
    (window,) = fit.free.windows
    misfit, error = misfit_in(fit, 0, window.rigid)
    assert misfit.shape == (3, window.segments.frequencies.size)
    assert error < 0.05
    own, _ = misfit_in(fit, 0, window.layout)
    assert own.shape == (4, window.segments.frequencies.size)
    model = fit.joint.models[0]
    ratio = (
        np.einsum("cfii->if", model.spectra.matrices).real / np.einsum("cfii->if", model.matrix(fit.parameters)).real
    )
    assert own.mean() == pytest.approx((ratio - 1).mean(), abs=0.05)


@pytest.mark.slow
@pytest.mark.parametrize(("frequency", "axle"), [(11.0, 0), (16.0, 1), (None, 0)])
def test_the_misfit_says_where_a_mass_is_and_at_which_frequency(hatchback, window_of_data, frequency, axle) -> None:
    """Without a mass it asks for none."""
    draft = explicit(hatchback)
    place = hatchback.axle[axle].x
    real = draft
    if frequency is not None:
        real = with_mount(draft, MountedMass(mass=120.0, x=place, frequency=frequency, damping_ratio=0.08))
    truth = window_of_data(None, real, ())
    data = replace(truth.spectra, matrices=truth.matrix(truth.start))
    numbers = component_numbers(draft, std=0.2)
    joint = joint_of([window_of_data(replace(data, weights=data.weights / 1e3), draft, numbers)])
    fit = JointFit(FreeVehicle((), draft, numbers, CornerSettings()), joint, fitted(joint, scaled_start(joint)), ())
    likely, gain = likely_mount(fit)
    if frequency is None:
        assert gain < 0.1
        return
    assert likely is not None
    assert gain > 10
    assert likely.frequency == pytest.approx(frequency, rel=0.12)
    assert likely.x == pytest.approx(place, abs=0.3)


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
