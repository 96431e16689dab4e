"""Joint models: exact spectra of windows with different payloads in, what the windows share out."""

from dataclasses import replace
from unittest.mock import Mock

import numpy as np
import pytest

from sprung.calibration import completion
from sprung.calibration import joint as module
from sprung.calibration.draft import (
    channel_responses,
    component_numbers,
    explicit,
    file_numbers,
    moved,
    sensor_numbers,
    with_widths,
)
from sprung.calibration.joint import fitted, joint_of, scaled_start, structure_at_speed, window_spectra
from sprung.likelihood import CornerSettings
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import structure
from sprung.vehicles.sections import LearntNumber
from sprung.vehicles.window import window_of

CHANNELS = ("acc_fl", "acc_fr", "acc_rl", "acc_rr")


@pytest.fixture(scope="module")
def places_and_lags(hatchback, exact_windows):
    """Two windows with sensors out of place, late and of wrong gain; each with its own payload and road."""
    draft = explicit(hatchback)
    numbers = tuple(
        number for number in sensor_numbers(draft, CHANNELS) if number.name.rpartition(".")[2] in {"x", "y", "delay"}
    )
    true = {
        "acc_fl.x": 0.08, "acc_fr.x": -0.05, "acc_rl.x": 0.06, "acc_rr.x": -0.1,
        "acc_fl.y": -0.06, "acc_fr.y": 0.05, "acc_rl.y": 0.09, "acc_rr.y": -0.03,
        "acc_fl.delay": 2e-3, "acc_fr.delay": -1e-3, "acc_rl.delay": -3e-3, "acc_rr.delay": 2e-3,
        "window_0.payload_mass": 0.1, "window_1.payload_mass": -0.05, "window_1.payload_y_moment": 0.04,
        "window_1.waviness": 2.3, "delay": 0.02,
    }  # fmt: skip
    joint, parameters = exact_windows(hatchback, numbers, true)
    return joint, parameters, true


@pytest.mark.slow
def test_places_and_lags_come_out_of_exact_spectra(places_and_lags) -> None:
    joint, _, true = places_and_lags
    end = dict(zip(joint.names, fitted(joint, scaled_start(joint)), strict=True))
    for name in (name for name in true if name.endswith((".x", ".y"))):
        assert end[name] == pytest.approx(true[name], abs=2e-4)
    lags = [end[f"{channel}.delay"] - end["acc_fl.delay"] for channel in CHANNELS]  # a common one shows nowhere
    assert lags == pytest.approx([true[f"{channel}.delay"] - 2e-3 for channel in CHANNELS], abs=2e-6)
    assert end["delay"] == pytest.approx(0.02, abs=1e-5)
    assert [end["window_0.payload_mass"], end["window_1.payload_mass"]] == pytest.approx([0.1, -0.05], abs=2e-3)


@pytest.fixture(scope="module")
def on_tyres(hatchback):
    """The hatchback with tyres that hold it sideways, and a rigid rear axle."""
    front, rear = (axle.model_copy(update={"cornering_stiffness": 50e3}) for axle in hatchback.axle)
    rigid = {"unsprung_mass": None, "wheelset_mass": 70.0, "wheelset_roll_inertia": 20.0, "roll_centre_height": 0.3}
    rigid |= {"half_track": 0.5, "contact_half_track": 0.73}
    body = hatchback.body.model_copy(update={"height": 0.5})
    return hatchback.model_copy(update={"axle": (front, rear.model_copy(update=rigid)), "body": body})


def test_height_cornering_stiffness_and_rigid_axle_come_out_of_exact_spectra(on_tyres, exact_windows) -> None:
    draft = explicit(on_tyres)
    true = {
        "body.height": 0.08, "front.cornering_stiffness": 0.3, "rear.cornering_stiffness": -0.2,
        "front.roll_centre_height": 0.04, "rear.relaxation_length": 0.2,
        "rear.half_track": -0.1, "rear.wheelset_roll_inertia": 0.1, "rear_left.spring": 0.05,
    }  # fmt: skip
    numbers = tuple(number for number in every(draft) if number.name in true)
    assert {number.name for number in numbers} == set(true)
    joint, _ = exact_windows(on_tyres, numbers, true)
    end = dict(zip(joint.names, fitted(joint, scaled_start(joint)), strict=True))
    height = "body.height"
    assert end[height] == pytest.approx(true.pop(height), abs=0.03)  # the loads of the windows may be high, too
    assert {name: end[name] for name in true} == pytest.approx(true, abs=2e-4)


@pytest.mark.parametrize("car", ["hatchback", "on_tyres"])
def test_gradient_is_the_slope_of_the_objective(car, request, exact_windows) -> None:
    hatchback = request.getfixturevalue(car)
    draft = explicit(hatchback)
    numbers = (*component_numbers(draft, std=0.7), *file_numbers(draft, CHANNELS))
    joint, parameters = exact_windows(hatchback, numbers, {})
    generator = np.random.default_rng(1)
    point = parameters + 0.1 * joint.prior_std * generator.standard_normal(parameters.size)
    gradient = joint.objective(point)[1]
    for _ in range(3):
        direction = joint.prior_std * generator.standard_normal(point.size)
        above, below = (joint.objective(point + step * direction)[0] for step in (1e-6, -1e-6))
        assert gradient @ direction == pytest.approx((above - below) / 2e-6, rel=1e-4)


def test_windows_of_a_vehicle_with_a_rigid_axle_are_of_one_range_of_speed(hatchback, on_tyres, monkeypatch) -> None:
    """Over the whole range of a drive, its roll inertia would imitate a damping that falls with speed."""
    drive = simulate_drive(hatchback, RoadDrive(duration=120.0, sampling_rate=60.0, snr=50.0), seed=3).recording
    window = window_of(drive, on_tyres)
    spectra = window_spectra(window, CornerSettings())
    similar = spectra.segments
    monkeypatch.setattr(module, "_of_similar_speed", lambda segments: segments)
    every = window_spectra(window, CornerSettings()).segments
    low, high = similar.speeds.min(), similar.speeds.max()
    assert high / low < 1.44 < every.speeds.max() / every.speeds.min()
    inside = (low <= every.speeds) & (every.speeds <= high)
    np.testing.assert_array_equal(similar.values, every.values[inside])
    counts = [np.sum((one <= every.speeds) & (every.speeds <= 1.44 * one)) for one in every.speeds]
    assert similar.speeds.size == max(counts)
    (note,) = completion._note_on_speeds((spectra,), on_tyres)
    assert f"{low:.0f} to {high:.0f} m/s" in note
    assert completion._note_on_speeds((spectra,), hatchback) == ()


def test_a_vehicle_at_another_speed_is_the_one_that_is_built_for_it(on_tyres) -> None:
    draft = explicit(on_tyres)
    vehicles = structure_at_speed(draft.structure(), 27.0), structure(draft.vehicle, speed=27.0)
    found, built = ([(one.stiffness, one.damping) for one in vehicle.elements] for vehicle in vehicles)
    np.testing.assert_allclose(found, built, rtol=1e-12)
    turning = [vehicle.rolling for vehicle in vehicles if vehicle.rolling is not None]
    np.testing.assert_allclose(turning[0], turning[1], rtol=1e-12)


def test_windows_at_other_speeds_share_the_derivatives_of_the_file(on_tyres, window_of_data, monkeypatch) -> None:
    """Their frequencies differ in the last digits, as those of resampled records do."""
    draft = explicit(on_tyres)
    numbers = file_numbers(draft, CHANNELS)
    first = window_of_data(None, draft, numbers)
    spectra = first.spectra
    faster = replace(spectra, frequencies=spectra.frequencies * (1 + 4e-16), speeds=1.5 * spectra.speeds)
    windows = joint_of([first, window_of_data(faster, draft, numbers)])
    change = Mock(side_effect=module._structural_change)
    monkeypatch.setattr(module, "_structural_change", change)
    gradient = windows.objective(windows.start)[1]
    assert sorted(call.args[2].name for call in change.call_args_list) == sorted(
        number.name for number in numbers if number.group != "sensors"
    )
    for row in map(windows.names.index, ("front.cornering_stiffness", "rear.half_track", "body.height")):
        step = 1e-4 * np.eye(gradient.size)[row]
        above, below = (windows.objective(windows.start + sign * step)[0] for sign in (1, -1))
        assert gradient[row] == pytest.approx((above - below) / 2e-4, rel=1e-4)


def test_information_is_the_curvature_at_the_truth(places_and_lags) -> None:
    joint, parameters, _ = places_and_lags
    information = joint.information(parameters) + np.diag(1 / joint.prior_std**2)
    for row in (0, 5, 8, joint.names.index("delay"), joint.names.index("window_1.payload_mass")):
        step = 1e-4 * joint.prior_std[row] * np.eye(parameters.size)[row]
        above, below = (joint.objective(parameters + sign * step)[1] for sign in (1, -1))
        curvature = (above - below) / (2 * step[row])
        assert curvature == pytest.approx(information[row], rel=1e-3, abs=1e-5 * np.abs(information[row]).max())


def test_a_prior_that_windows_share_counts_once(places_and_lags) -> None:
    joint, parameters, _ = places_and_lags
    own = [model.objective(joint.of_window(number, parameters))[0] for number, model in enumerate(joint.models)]
    shared = [row for row, name in enumerate(joint.names) if not name.startswith("window_")]
    deviation = ((parameters - joint.start) / joint.prior_std)[shared]
    assert joint.objective(parameters)[0] == pytest.approx(sum(own) - deviation @ deviation / 2, rel=1e-12)


def every(draft):
    return (*component_numbers(draft, std=0.7), *file_numbers(draft, CHANNELS))


@pytest.mark.parametrize("car", ["hatchback", "on_tyres"])
def test_parameters_of_zero_are_the_file(car, request) -> None:
    draft = explicit(request.getfixturevalue(car))
    numbers = every(draft)
    assert moved(draft, numbers, np.zeros(len(numbers))).vehicle == draft.vehicle


@pytest.mark.slow
@pytest.mark.parametrize("car", ["hatchback", "on_tyres"])
def test_every_number_moves_itself_alone(car, request) -> None:
    draft = explicit(request.getfixturevalue(car))
    numbers = [number for number in every(draft) if number.name != "body.centre_x"]
    before = np.array([draft.value_at(number.place) for number in numbers])
    for row, number in enumerate(numbers):
        parameters = 0.1 * number.std * np.eye(len(numbers))[row]
        after = np.array([moved(draft, numbers, parameters).value_at(other.place) for other in numbers])
        assert np.flatnonzero(np.abs(after - before) > 1e-12).tolist() == [row]
        assert after[row] == pytest.approx(number.value(before[row], parameters[row]))


def test_the_centre_of_gravity_moves_against_all_else(hatchback) -> None:
    draft = explicit(hatchback)
    ahead = draft.ahead(0.05).vehicle
    assert [axle.x for axle in ahead.axle] == pytest.approx([axle.x - 0.05 for axle in hatchback.axle])
    places = [(car.sensor[0].position or (np.nan,))[0] for car in (ahead, hatchback)]
    assert places[0] == pytest.approx(places[1] - 0.05)


def test_a_late_channel_lags_and_a_larger_scale_reads_less(hatchback) -> None:
    draft = explicit(hatchback)
    late = draft.with_value(("sensor", 1, "delay"), 5e-3).with_value(("sensor", 1, "scale"), 2.0)
    response = channel_responses(late, draft, CHANNELS, np.array([10.0]))[0]
    assert response[0] == 1
    assert response[1] == pytest.approx(0.5 * np.exp(-2j * np.pi * 10 * 5e-3))


def test_the_width_of_a_guess_is_the_prior(hatchback) -> None:
    guess = LearntNumber(name="front.tyre_stiffness", value=185e3, std=37e3)
    sure = LearntNumber(name="acc_fl.x", value=1.02, std=1e-6)
    draft = explicit(hatchback.model_copy(update={"learnt": (guess, sure)}))
    std = {number.name: number.std for number in with_widths(every(draft), draft)}
    assert std["front.tyre_stiffness"] == pytest.approx(0.2)
    assert std["acc_fl.x"] == pytest.approx(0.01)  # a tenth of the usual: a sensor may be moved
    assert std["rear.tyre_stiffness"] == 0.7
