"""Corners from simulated drives and rigs: values, what can be told, failing gracefully."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import DataError, ParameterError
from sprung.likelihood import CornerSettings, fit_corners
from sprung.simulation import Dead, DriveSettings, simulate_drive, with_imperfections
from sprung.vehicles import Sensor, parse_fault, read_vehicle


def drive(car, seed=0, **settings):
    return simulate_drive(car, DriveSettings(**{"kind": "road", "snr": 50.0, "n_stops": 1, **settings}), seed=seed)


def errors(fit, truth):
    """ln(fitted / true) of every component."""
    true = [truth["components"][component.owner][component.name]["value"] for component in fit.components]
    return np.log(fit.values / true)


@pytest.fixture(scope="module")
def fits(car):
    """Linear drives of ten minutes and their fits."""
    drives = [drive(car, seed=seed) for seed in range(12)]
    return [(fit_corners(one.recording, car), one.truth) for one in drives]


@pytest.mark.slow
def test_linear_drives_give_all_twelve_components(fits):
    found = np.array([errors(fit, truth) for fit, truth in fits])
    assert np.abs(found.mean(axis=0)).max() < 0.012
    assert found.std(axis=0).max() < 0.02
    scores = found / [fit.log_ratios_std for fit, _ in fits]
    assert 0.9 <= np.mean(np.abs(scores) < 1.96) <= 1.0
    assert 0.6 < scores.std() < 1.2


@pytest.mark.slow
def test_body_modes_come_out_with_their_uncertainty(fits):
    for fit, truth in fits[:4]:
        modes = fit.modes()
        assert modes.labels[:3] == ("bounce", "pitch", "roll")
        for k, true in enumerate(truth["modes"][:3]):
            assert modes.natural_frequency[k] == pytest.approx(true["natural_frequency"], rel=0.03)
            assert modes.damping_ratio[k] == pytest.approx(true["damping_ratio"], rel=0.15)
    frequency = np.array([[fit.modes().natural_frequency[:3], fit.modes_std()[0][:3]] for fit, _ in fits])
    scatter = frequency[:, 0].std(axis=0) / frequency[:, 1].mean(axis=0)
    assert np.all((scatter > 0.5) & (scatter < 1.6))


@pytest.mark.slow
def test_a_perfect_model_is_not_called_imperfect(fits):
    assert np.median([fit.imperfection for fit, _ in fits]) < 0.03
    assert not any("off by" in note for fit, _ in fits for note in fit.notes)


@pytest.mark.slow
@pytest.mark.parametrize("fault", ["front_left.spring=-0.1", "rear_right.damper=-0.2", "front_right.tyre=-0.3"])
def test_a_fault_stands_out_at_its_corner_only(car, fault):
    """A nonlinear drive with potholes, payload and warm dampers, against the same car healthy."""
    options = {"is_nonlinear": True, "payload": 150.0, "temperature": 40.0}
    before = fit_corners(drive(car, seed=1, **options).recording, car)
    after = fit_corners(drive(car, seed=2, faults=(parse_fault(fault),), **options).recording, car)
    change = dict(
        zip([f"{c.owner}.{c.name}" for c in after.components], after.log_ratios - before.log_ratios, strict=True)
    )
    parsed = parse_fault(fault)
    assert np.exp(change.pop(parsed.component)) - 1 == pytest.approx(parsed.change, abs=0.04)
    assert max(map(abs, change.values())) < 0.06


@pytest.mark.slow
def test_an_imu_tells_what_four_corners_tell(car):
    rate = {"quantity": "angular_velocity", "unit": "rad/s"}
    imu = (
        Sensor(
            channel="az", quantity="acceleration", unit="m/s^2", position=(0.3, 0.1, 0.2), direction=(0.0, 0.0, 1.0)
        ),
        Sensor(channel="wx", direction=(1.0, 0.0, 0.0), **rate),
        Sensor(channel="wy", direction=(0.0, 1.0, 0.0), **rate),
    )
    with_imu = car.model_copy(update={"sensor": imu})
    one = drive(with_imu, seed=3, snr=100.0)
    fit = fit_corners(one.recording, with_imu)
    assert np.abs(errors(fit, one.truth)).max() < 0.12
    assert fit.is_told.all()


@pytest.mark.slow
def test_a_wrong_sign_of_the_pitch_rate_shows_as_a_misfit(car):
    rate = {"quantity": "angular_velocity", "unit": "rad/s"}
    sensors = [
        Sensor(
            channel="az", quantity="acceleration", unit="m/s^2", position=(0.3, 0.0, 0.0), direction=(0.0, 0.0, 1.0)
        ),
        Sensor(channel="wx", direction=(1.0, 0.0, 0.0), **rate),
        Sensor(channel="wy", direction=(0.0, 1.0, 0.0), **rate),
    ]
    right = car.model_copy(update={"sensor": tuple(sensors)})
    wrong = car.model_copy(update={"sensor": (*sensors[:2], Sensor(channel="wy", direction=(0.0, -1.0, 0.0), **rate))})
    run = drive(right, seed=3, snr=100.0).recording
    assert fit_corners(run, wrong).imperfection > 5 * max(fit_corners(run, right).imperfection, 0.02)
    assert any("off by" in note for note in fit_corners(run, wrong).notes)


@pytest.mark.slow
def test_scale_bogie_on_its_rig(car):
    """Independent wheel inputs, faults of chapter 7: the changed corner's stiffness within 5 %."""
    bogie = read_vehicle("scale-bogie")
    for fault in ("front_left.spring=0.5", "rear_left.spring=-0.75"):
        one = drive(bogie, kind="rig", n_stops=0, duration=400.0, speed=(5.7, 5.7), faults=(parse_fault(fault),))
        fit = fit_corners(one.recording, bogie)
        springs = [k for k, component in enumerate(fit.components) if component.name == "spring"]
        assert np.abs(errors(fit, one.truth)[springs]).max() < 0.05


@pytest.mark.slow
def test_two_minutes_widen_the_intervals_and_say_so_honestly(car, fits):
    one = drive(car, seed=5, duration=120.0, n_stops=0)
    fit = fit_corners(one.recording, car)
    assert fit.log_ratios_std.mean() > 1.5 * fits[0][0].log_ratios_std.mean()
    assert np.mean(np.abs(errors(fit, one.truth)) < 2.6 * fit.log_ratios_std) > 0.8


@pytest.mark.slow
def test_constant_speed_and_three_sensors_still_answer(car):
    one = drive(car, seed=5, speed=(14.0, 14.0), n_stops=0)
    run = one.recording.select(["acc_fl", "acc_fr", "acc_rl", "speed"])
    fit = fit_corners(run, car)
    assert np.abs(errors(fit, one.truth)).max() < 0.15


@pytest.mark.slow
def test_one_sensor_cannot_tell_the_corners_apart(car):
    one = drive(car, seed=5)
    fit = fit_corners(one.recording.select(["acc_fl", "speed"]), car, settings=CornerSettings(width=0.3))
    assert not fit.is_told.all()
    assert any("cannot tell" in note for note in fit.notes)


@pytest.mark.slow
def test_a_payload_lowers_all_values_alike_or_is_fitted(car):
    one = drive(car, seed=6, payload=300.0)
    plain = fit_corners(one.recording, car)
    assert errors(plain, one.truth).mean() < -0.03  # per mass everything is softer
    contrast = errors(plain, one.truth) - errors(plain, one.truth).mean()
    assert np.abs(contrast).max() < 0.12
    free = fit_corners(one.recording, car, settings=CornerSettings(has_payload=True, width=0.05))
    mass = dict(zip(free.model.names, free.parameters, strict=True))["payload_mass"]
    assert mass > 0.05


def test_without_speed_it_says_what_is_missing(car):
    run = drive(car, duration=30.0).recording
    with pytest.raises(DataError, match="no speed channel 'speed': add one"):
        fit_corners(run.select(run.names[:4]), car)


def test_a_standing_car_is_refused(car):
    run = drive(car, duration=30.0, n_stops=0).recording
    still = replace(run, samples=np.vstack([run.samples[:4], 0.5 + 0 * run.samples[4:]]))
    with pytest.raises(DataError):
        fit_corners(still, car)


def test_a_short_record_is_refused(car):
    run = drive(car, duration=4.0, n_stops=0).recording
    with pytest.raises(DataError, match="no stretch without a gap is as long as a segment"):
        fit_corners(run, car)


def test_a_dead_sensor_is_refused_by_name(car):
    run = with_imperfections(drive(car, duration=30.0).recording, [Dead("acc_rl")])
    with pytest.raises(DataError, match="'acc_rl' is constant"):
        fit_corners(run, car)


@pytest.mark.parametrize(
    ("settings", "message"),
    [({"band": (5.0, 2.0)}, "must rise"), ({"width": 0.0}, "above 0"), ({"segment": -1.0}, "above 0")],
)
def test_impossible_settings_are_refused(settings, message):
    with pytest.raises(ParameterError, match=message):
        CornerSettings(**settings)
