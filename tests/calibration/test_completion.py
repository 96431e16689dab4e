"""Calibration on simulated drives: sensor places, and what a complete file gets."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.calibration import CalibrationSettings, calibrate
from sprung.errors import DataError, ParameterError
from sprung.recording import Recording
from sprung.simulation import RoadDrive, simulate_drive
from sprung.vehicles import MountedMass, vehicle_from_text, vehicle_text


@pytest.fixture(scope="module")
def drive(hatchback):
    """A linear drive of five minutes."""
    return simulate_drive(hatchback, RoadDrive(duration=300.0, sampling_rate=120.0, snr=50.0), seed=3)


def _apart(error):
    """Errors without what no drive shows: a common shift ahead, and a common share of the distance to the middle."""
    outwards = np.array([1.0, -1.0, 1.0, -1.0])
    y = error[:, 1] * outwards
    return np.column_stack([error[:, 0] - error[:, 0].mean(), y - y.mean()])


@pytest.mark.slow
def test_exchanged_sensors_are_refused(hatchback, drive) -> None:
    run = drive.recording
    rows = [run.index(name) for name in ("acc_fr", "acc_fl", *run.names[2:])]
    with pytest.raises(DataError, match="sensors are swapped, acc_fl with acc_fr or acc_rl with acc_rr"):
        calibrate(replace(run, samples=run.samples[rows]), hatchback)


@pytest.mark.slow
def test_sensors_out_of_place_are_put_right(hatchback, drive) -> None:
    places = np.array([sensor.position[:2] for sensor in hatchback.sensor])
    wrong = places + np.array([[-0.08, 0.05], [0.1, 0.06], [0.07, -0.09], [-0.1, 0.04]])
    sensors = tuple(
        sensor.model_copy(update={"position": (*place, 0.0)})
        for sensor, place in zip(hatchback.sensor, wrong.tolist(), strict=True)
    )
    given = hatchback.model_copy(update={"sensor": sensors})
    settings = CalibrationSettings(most_mounts=0, has_modes=False)
    calibration = calibrate([drive.recording], given, settings=settings)
    learnt = np.array([sensor.position or (np.nan,) * 3 for sensor in calibration.vehicle.sensor])[:, :2]
    error, given_error = _apart(learnt - places), _apart(wrong - places)
    assert np.sqrt(np.mean(error**2)) < 0.25 * np.sqrt(np.mean(given_error**2))
    assert calibration.number("acc_fl.x").is_identifiable
    text = vehicle_text(calibration.vehicle)
    assert vehicle_from_text(text, source="text") == calibration.vehicle
    assert {entry.name for entry in calibration.vehicle.learnt} == {
        number.name for number in calibration.learnt if number.is_identifiable
    }


@pytest.mark.slow
def test_a_complete_file_stays_what_it_was(hatchback, drive) -> None:
    calibration = calibrate([drive.recording], hatchback)
    assert not calibration.vehicle.mounted_mass
    assert not calibration.vehicle.flexible_mode
    assert not any(axle.damper_bushing_stiffness for axle in calibration.vehicle.axle)
    scores = [
        (number.value - number.nominal_value) / number.std
        for number in calibration.learnt
        if number.nominal_value is not None
        and number.is_identifiable
        and number.group in {"sensors", "wheels", "speed"}
    ]
    assert np.sqrt(np.mean(np.square(scores))) < 2
    assert max(calibration.model_errors_after) < 0.1


@pytest.mark.slow
def test_rubber_that_carries_the_dampers_is_found_at_the_axle_that_has_it(hatchback) -> None:
    """A top mount of 120 kN/m in front, and a damper without rubber behind."""
    front, rear = hatchback.axle
    on_rubber = (front.model_copy(update={"damper_bushing_stiffness": 120e3}), rear)
    vehicle = hatchback.model_copy(update={"axle": on_rubber})
    settings = RoadDrive(duration=300.0, sampling_rate=120.0, snr=50.0)
    run = simulate_drive(vehicle, settings, seed=3).recording
    calibration = calibrate([run], hatchback, settings=CalibrationSettings(most_mounts=0, has_modes=False))
    found = calibration.number("front.damper_bushing_stiffness")
    assert found.nominal_value is None
    assert found.is_identifiable
    assert abs(np.log(found.value / 120e3)) < 0.1
    stiff = calibration.vehicle.axle[1].damper_bushing_stiffness
    assert stiff is not None
    assert stiff > 5 * found.value
    assert any("rubber that carries the dampers" in note for note in calibration.notes)


@pytest.mark.slow
def test_people_on_seats_are_no_part_of_the_file(hatchback) -> None:
    """One person on one drive and four on the other: a mass that stays helps on neither."""
    seat = MountedMass(mass=75.0, x=0.2, y=0.2, frequency=4.5, damping_ratio=0.3)
    behind = seat.model_copy(update={"mass": 150.0, "x": -1.0})
    drives = [
        simulate_drive(
            hatchback.model_copy(update={"mounted_mass": on_seats}),
            RoadDrive(duration=180.0, sampling_rate=120.0, snr=50.0),
            seed=seed,
        ).recording
        for seed, on_seats in enumerate([(seat,), (seat.model_copy(update={"mass": 150.0}), behind)], start=3)
    ]
    calibration = calibrate(drives, hatchback, settings=CalibrationSettings(has_modes=False))
    assert not calibration.vehicle.mounted_mass


def test_no_recording_is_refused(hatchback) -> None:
    with pytest.raises(ParameterError, match="no window was given"):
        calibrate([], hatchback)


def test_windows_with_other_channels_are_refused(hatchback, drive) -> None:
    names = [name for name in drive.recording.names if name != "acc_rr"]
    other: Recording = drive.recording.select(names)
    with pytest.raises(ParameterError, match="give windows with the same channels"):
        calibrate([drive.recording, other], hatchback, allow_missing=True)


@pytest.mark.slow
def test_channels_that_are_combinations_of_others_are_refused(hatchback) -> None:
    """More accelerometers than motions, and no noise: the spectral matrices are singular."""
    middle = hatchback.sensor[0].model_copy(update={"channel": "acc_middle", "position": (0.2, 0.1, 0.0)})
    behind = hatchback.sensor[0].model_copy(update={"channel": "acc_behind", "position": (-0.5, -0.3, 0.0)})
    front = hatchback.sensor[0].model_copy(update={"channel": "acc_front", "position": (1.0, 0.0, 0.0)})
    given = hatchback.model_copy(update={"sensor": (*hatchback.sensor, middle, behind, front)})
    drive = simulate_drive(given, RoadDrive(duration=120.0, sampling_rate=100.0), seed=1)
    with pytest.raises(DataError, match="exact combinations of others: give measured drives, or simulate"):
        calibrate([drive.recording], given, settings=CalibrationSettings(most_mounts=0, has_modes=False))
