"""Corners from simulated drives and rigs: values, identifiability, refusals."""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import pytest

from sprung.errors import DataError
from sprung.excitation import Lines, Sum, SurfaceMotion, random_speed, road_class
from sprung.identification import cov_ssi
from sprung.likelihood import CornerSettings, Expected, fit_corners, fitting
from sprung.likelihood.search import minimised
from sprung.likelihood.whittle import Model
from sprung.recording import Channel
from sprung.simulation import (
    REALISTIC_SUSPENSION,
    Payload,
    RailDrive,
    RigRun,
    RoadDrive,
    dead,
    inverted,
    simulate,
    simulate_drive,
)
from sprung.vehicles import MountedMass, Sensor, Vehicle, parse_fault, read_vehicle, structure


def drive(car, seed=0, kind=RoadDrive, **settings):
    return simulate_drive(car, kind(**{"snr": 50.0, "n_stops": 1, **settings}), seed=seed)


def errors(fit, truth):
    """ln(fitted / true) of every component."""
    true = [truth["components"][component.corner][component.kind]["value"] for component in fit.components]
    return np.log(fit.values / true)


def contrast_std(fit):
    """Standard deviations of ln(left / right), shape (axles, kinds)."""
    covariance = fit.covariance[:12, :12].reshape(2, 2, 3, 2, 2, 3)
    sides = np.array([1.0, -1.0])
    return np.sqrt(np.einsum("s,t,asuatu->au", sides, sides, covariance))


@pytest.mark.slow
def test_linear_drives_give_all_twelve_components_and_body_modes(car) -> None:
    drives = [drive(car, seed=seed) for seed in range(8)]
    fits = [(fit_corners(one.recording, car), one.truth) for one in drives]
    found = np.array([errors(fit, truth) for fit, truth in fits])
    assert np.abs(found.mean(axis=0)).max() < 0.03
    assert found.std(axis=0).max() < 0.04
    scores = found / [fit.log_ratios_std for fit, _ in fits]
    assert np.mean(np.abs(scores) < 1.96) >= 0.9
    sides = found.reshape(-1, 2, 2, 3)
    contrasts = sides[:, :, 0] - sides[:, :, 1]  # left against right
    assert contrasts.std(axis=0).max() < 0.015
    scores = contrasts / [contrast_std(fit) for fit, _ in fits]
    assert 0.9 <= np.mean(np.abs(scores) < 1.96) <= 1.0
    assert 0.5 < scores.std() < 1.2
    assert np.median([fit.model_error for fit, _ in fits]) < 0.03
    assert not any("than chance allows" in note for fit, _ in fits for note in fit.notes)
    for fit, truth in fits[:4]:
        modes = fit.modes()
        assert modes.labels[:3] == ("bounce", "pitch", "roll")
        for k, true in enumerate(truth["modes"][:3]):
            assert modes.natural_frequency[k] == pytest.approx(true["natural_frequency"], rel=0.03)
            assert modes.damping_ratio[k] == pytest.approx(true["damping_ratio"], rel=0.15)
    frequency = np.array([[fit.modes().natural_frequency[:3], fit.modes_std()[0][:3]] for fit, _ in fits])
    scatter = frequency[:, 0].std(axis=0) / frequency[:, 1].mean(axis=0)
    assert np.all((scatter > 0.4) & (scatter < 1.6))


def same(car: Vehicle) -> Vehicle:
    return car


def with_imu(car: Vehicle, sign: float = 1.0) -> Vehicle:
    """The car with the vertical acceleration ahead of its centre of gravity and both rates, of pitch with a sign."""
    place, up = (0.3, 0.1, 0.2), (0.0, 0.0, 1.0)
    rates = (("wx", (1.0, 0.0, 0.0)), ("wy", (0.0, sign, 0.0)))
    sensors = (
        Sensor(channel="az", quantity="acceleration", unit="m/s^2", position=place, direction=up),
        *(Sensor(channel=name, quantity="angular_velocity", unit="rad/s", direction=axis) for name, axis in rates),
    )
    return car.model_copy(update={"sensor": sensors})


def longer(car: Vehicle) -> Vehicle:
    """The car 3 % longer and wider."""
    axles = (axle.model_copy(update={"half_track": 1.03 * axle.half_track, "x": 1.03 * axle.x}) for axle in car.axle)
    return car.model_copy(update={"axle": tuple(axles)})


def lighter(car: Vehicle) -> Vehicle:
    return car.model_copy(update={"body": car.body.model_copy(update={"mass": 0.9 * car.body.mass})})


SOFT_AND_LOADED = {"seed": 4, "faults": (parse_fault("front_left.spring=-0.3"),), "payload": Payload(100.0)}
#: True car, file, drive, channels, and largest error of ln of a component.
UNUSUAL: dict[str, tuple[Any, ...]] = {
    "inertial unit": (with_imu, with_imu, {"seed": 3, "snr": 100.0}, (), 0.12),
    "constant speed": (same, same, {"seed": 5, "speed": (14.0, 14.0), "n_stops": 0}, (0, 1, 2, 4), 0.15),
    "wheelbase": (longer, same, {"seed": 1}, (), 0.08),
    "mass": (same, lighter, {"seed": 1}, (), 0.08),
    "no speed": (same, same, SOFT_AND_LOADED, (0, 1, 2, 3), 0.08),
}


@pytest.mark.slow
@pytest.mark.parametrize("what", UNUSUAL)
def test_unusual_drives_still_give_the_components(car, what) -> None:
    true, file, settings, channels, bound = UNUSUAL[what]
    one = drive(true(car), **settings)
    run = one.recording.select([one.recording.names[row] for row in channels]) if channels else one.recording
    fit = fit_corners(run, file(car), allow_missing=True)
    assert np.abs(errors(fit, one.truth)).max() < bound
    if what == "inertial unit":
        assert fit.is_identifiable.all()
    if what == "wheelbase":
        assert fit.inputs["delay"] == pytest.approx(1.03, abs=0.01)
    if what == "mass":
        assert fit.payload["payload_mass"]["value"] == pytest.approx(148.0, abs=60.0)
    if what == "no speed":
        assert "the speed was not recorded: " in fit.notes[-1]


@pytest.mark.slow
def test_a_wrong_sign_of_the_pitch_rate_shows_as_a_misfit(car) -> None:
    right, wrong = (with_imu(car, sign) for sign in (1.0, -1.0))
    run = drive(right, seed=3, snr=100.0).recording
    fit = fit_corners(run, wrong)
    assert fit.model_error > 5 * max(fit_corners(run, right).model_error, 0.02)
    assert any("than chance allows" in note for note in fit.notes)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "kind", "settings", "bound"),
    [
        ("scale-bogie", RigRun, {"duration": 400.0, "speed": (5.7, 5.7)}, 0.05),  # faults of chapter 7 of the thesis
        ("y25", RigRun, {"duration": 300.0, "speed": (10.0, 10.0), "seed": 4}, 0.05),
        ("y25", RailDrive, {"duration": 300.0, "seed": 4}, 0.08),
    ],
)
def test_springs_of_bogies_on_rigs_and_on_a_track(name, kind, settings, bound) -> None:
    bogie, faults = read_vehicle(name), ("front_left.spring=0.5", "rear_left.spring=-0.75")
    one = drive(bogie, kind=kind, n_stops=0, faults=tuple(map(parse_fault, faults)), **settings)
    fit = fit_corners(one.recording, bogie, settings=CornerSettings(kind="rail" if kind is RailDrive else "rig"))
    springs = [k for k, component in enumerate(fit.components) if component.kind == "spring"]
    assert np.abs(errors(fit, one.truth)[springs]).max() < bound


@pytest.mark.slow
def test_one_sensor_does_not_identify_all_corners(car) -> None:
    one = drive(car, seed=5)
    run = one.recording.select(["acc_fl", "speed"])
    fit = fit_corners(run, car, settings=CornerSettings(prior_std=0.3), allow_missing=True)
    assert not fit.is_identifiable.all()
    assert any("not identifiable" in note for note in fit.notes)


@pytest.mark.slow
def test_a_payload_is_fitted_and_not_taken_for_soft_springs(car) -> None:
    one = drive(car, seed=6, payload=Payload(300.0))
    fit = fit_corners(one.recording, car)
    assert np.abs(errors(fit, one.truth)).max() < 0.06
    load = fit.payload["payload_mass"]
    assert load["value"] == pytest.approx(300.0, abs=3 * load["std"])
    assert load["std"] < 100.0
    plain = fit_corners(one.recording, car, settings=CornerSettings(has_payload=False))
    assert np.exp(errors(plain, one.truth)[::3]).max() < 0.97  # per mass all springs are softer
    assert plain.model_error > 0.1


@pytest.mark.slow
def test_free_sensors_find_a_place_and_a_lag(car) -> None:
    """One sensor stands 0.2 m from where the file says, another is 6 ms late."""
    moved = [
        one.model_copy(update={"position": (one.position[0] - 0.2 * (k == 0), *one.position[1:])})
        for k, one in enumerate(car.sensor)
    ]
    one = drive(car.model_copy(update={"sensor": tuple(moved)}), seed=2)
    samples = one.recording.samples.copy()
    f = np.fft.rfftfreq(samples.shape[1], 1 / one.recording.sampling_rate)
    samples[3] = np.fft.irfft(np.fft.rfft(samples[3]) * np.exp(-2j * np.pi * f * 6e-3), samples.shape[1])
    run = replace(one.recording, samples=samples)
    fit = fit_corners(run, car, settings=CornerSettings(has_free_sensors=True))
    found = fit.sensors
    lags = [found[f"{name}_lag"]["value"] for name in ("acc_fl", "acc_fr", "acc_rl", "acc_rr")]
    assert lags[3] - np.mean(lags[:3]) == pytest.approx(6e-3, abs=1e-3)
    assert found["acc_fl_x"]["value"] == pytest.approx(-0.2, abs=0.08)
    stiff = fit_corners(run, car)
    assert np.abs(errors(fit, one.truth)).max() < 0.6 * np.abs(errors(stiff, one.truth)).max()


@pytest.mark.slow
@pytest.mark.parametrize("part", ["engine", "anti_roll"])
def test_an_unknown_part_gives_a_model_error_and_contrasts_stay_usable(car, part) -> None:
    """A 180 kg engine on its mounts, or anti-roll bars, that the vehicle file does not have."""
    if part == "engine":
        engine = MountedMass(mass=180.0, x=1.1, frequency=11.0, damping_ratio=0.08)
        real = car.model_copy(update={"mounted_mass": (engine,)})
    else:
        axles = tuple(one.model_copy(update={"anti_roll_stiffness": 20e3}) for one in car.axle)
        real = car.model_copy(update={"axle": axles})
    run = drive(real, seed=1).recording
    before = fit_corners(run, car)
    after = fit_corners(drive(real, seed=2, faults=(parse_fault("front_left.spring=-0.2"),)).recording, car)
    assert before.model_error > 0.1
    assert any("than chance allows" in note for note in before.notes)
    change = after.log_ratios - before.log_ratios
    assert np.argmax(np.abs(change)) == 0
    assert change[0] == pytest.approx(np.log(0.8), abs=0.1)
    known = fit_corners(run, real)
    assert known.model_error < before.model_error / 2
    assert contrast_std(known)[0, 0] < contrast_std(before)[0, 0]


@pytest.mark.slow
def test_lines_of_wheels_are_named_and_left_out(car) -> None:
    generator = np.random.default_rng(3)
    speed = random_speed(600.0, low=8.0, high=22.0, generator=generator)
    road = SurfaceMotion(road_class("B"), (1.22, -1.58), speed)
    wheels = Lines(speed, (0.516, 1.03, 1.55), (3e-4, 3e-4, 1.5e-4), (1.0, 0.8, 0.9, 1.1))
    run = simulate(structure(car), Sum((road, wheels)), duration=600.0, sampling_rate=200.0, snr=50.0, seed=1)
    samples = np.vstack([run.samples, speed.speed(np.arange(run.n_samples) / 200.0)])
    run = replace(run, samples=samples, channels=(*run.channels, Channel("speed", "speed")))
    fit = fit_corners(run, car)
    assert np.abs(fit.log_ratios).max() < 0.05
    (note,) = [note for note in fit.notes if note.startswith("left out for lines")]
    places = [float(part.split()[0]) for part in note.split(": ")[1].split(", ")]
    assert places == pytest.approx([0.516, 1.03, 1.55], rel=0.02)
    assert np.abs(fit_corners(run, car, settings=CornerSettings(has_lines_masked=False)).log_ratios).max() > 0.1


def standing(run):
    return replace(run, samples=np.vstack([run.samples[:4], 0.5 + 0 * run.samples[4:]]))


def exchanged(run):
    rows = [run.index(name) for name in ("acc_fr", "acc_fl", *run.names[2:])]
    return replace(run, samples=run.samples[rows])


def noise_without_speed(run):
    noise = np.random.default_rng(1).standard_normal((4, run.n_samples))
    return replace(run.select(run.names[:4]), samples=noise)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (standing, "no part reaches 3 m/s"),
        (noise_without_speed, r"no speed channel, .* gives the speed of only \d+ of \d+ segments: add"),
        (lambda run: run.part(0, 800), "no stretch without a gap is as long as a segment"),
        (partial(dead, channel="acc_rl"), "'acc_rl' is constant"),
        (exchanged, "sensors are swapped, acc_fl with acc_fr or acc_rl with acc_rr: correct the names"),
        (partial(inverted, channel="acc_rl"), "acc_rl is inverted: correct the names, places or directions"),
    ],
)
def test_recordings_that_show_nothing_are_refused(car, change, message) -> None:
    run = drive(car, duration=60.0).recording
    with pytest.raises(DataError, match=message):
        fit_corners(change(run), car)


@pytest.mark.slow
def test_identified_modes_are_a_check_and_another_start(car) -> None:
    bogie = read_vehicle("scale-bogie")
    fault = parse_fault("front_left.spring=0.5")
    one = drive(bogie, kind=RigRun, n_stops=0, duration=200.0, speed=(5.7, 5.7), faults=(fault,))
    fit = fit_corners(one.recording, bogie, modes=cov_ssi(one.recording, vehicle=bogie).modes)
    assert fit.from_modes is not None
    assert fit.from_modes[0] == pytest.approx(np.log(1.5), abs=0.25)
    assert fit.log_ratios[0] == pytest.approx(np.log(1.5), abs=0.05)


def test_a_recording_that_no_vehicle_fits_is_refused_with_advice(car, monkeypatch) -> None:
    def hopeless(*_, **__):
        raise np.linalg.LinAlgError("Matrix is not positive definite")

    monkeypatch.setattr(fitting, "fit_segments", hopeless)
    with pytest.raises(DataError, match="check signs, places and units of the sensors"):
        fit_corners(drive(car, duration=30.0, n_stops=0).recording, car)


@pytest.mark.slow
@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_wrong_units_give_a_large_model_error_or_a_message(car, factor) -> None:
    """One channel in other units: the model error is large, or the recording is refused."""
    run = drive(car, duration=120.0, n_stops=0).recording
    samples = run.samples.copy()
    samples[2] *= factor
    outcome = error_or_message(replace(run, samples=samples), car)
    assert "check signs" in outcome if isinstance(outcome, str) else outcome > 0.2


def error_or_message(run, car):
    try:
        return fit_corners(run, car).model_error
    except DataError as error:
        return str(error)


@pytest.mark.slow
def test_what_other_windows_showed_saves_a_search_and_hides_no_broken_spring(car, monkeypatch) -> None:
    """The file lacks an engine, so that fits are doubtful: 3 searches without, 2 with what a healthy window showed."""
    searches: list[object] = []

    def counted(*given):
        searches.append(given)
        return minimised(*given)

    monkeypatch.setattr(fitting, "minimised", counted)
    engine = MountedMass(mass=180.0, x=1.1, frequency=9.0, damping_ratio=0.08)
    real = car.model_copy(update={"mounted_mass": (engine,)})
    settings = {"duration": 300.0, "sampling_rate": 100.0}
    healthy = fit_corners(drive(real, 1, **settings).recording, car)
    known = dict(zip(healthy.components, healthy.log_ratios, strict=True))
    expected = CornerSettings(expected=Expected(known, healthy.model_error))
    broken = parse_fault("front_left.spring=-0.9")
    for seed, faults in ((2, ()), (5, (broken,))):
        recording = drive(real, seed, faults=faults, **settings).recording
        numbers, fits = [], []
        for choices in (CornerSettings(), expected):
            searches.clear()
            fits.append(fit_corners(recording, car, settings=choices))
            numbers.append(len(searches))
        alone, started = fits
        assert numbers == [3, 2]
        assert np.abs((started.log_ratios - alone.log_ratios) / alone.log_ratios_std).max() < 0.1
        assert (started.log_ratios[0] - healthy.log_ratios[0] < np.log(0.5)) == bool(faults)


@pytest.mark.slow
@pytest.mark.parametrize("suspension", [None, REALISTIC_SUSPENSION], ids=["linear", "friction"])
def test_a_window_of_a_known_vehicle_is_searched_faster_to_the_same_parts(car, monkeypatch, suspension) -> None:
    """Parts within a twentieth of their deviations, with fewer likelihoods; with friction, of a changed car."""
    computed = [0]
    objective = Model.objective

    def counted(model, parameters):
        computed[-1] += 1
        return objective(model, parameters)

    monkeypatch.setattr(Model, "objective", counted)
    healthy = {} if suspension is None else {"suspension": suspension}
    before = fit_corners(drive(car, 1, **healthy).recording, car)
    known = Expected(dict(zip(before.components, before.log_ratios, strict=True)), before.model_error)
    changed = {"faults": (parse_fault("front_left.spring=-0.2"),), "payload": Payload(150.0, -0.5, 0.0)}
    recording = drive(car, 2, **healthy, **(changed if healthy else {})).recording
    fits = []
    for expected in (None, known):
        computed.append(0)
        fits.append(fit_corners(recording, car, settings=CornerSettings(expected=expected)))
    alone, started = fits
    assert np.abs((started.log_ratios - alone.log_ratios) / alone.log_ratios_std).max() < 0.05
    assert np.allclose(started.log_ratios_std, alone.log_ratios_std, rtol=0.05)
    assert computed[2] < 0.95 * computed[1]
