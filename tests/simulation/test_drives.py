import pickle

import numpy as np
import pytest
from scipy.signal import welch

from sprung.errors import ParameterError
from sprung.excitation import Corrugation, Crossings, Joints, rail_quality, road_class
from sprung.signals.conditioning import while_moving
from sprung.signals.spectrum import spectral_matrix
from sprung.simulation import (
    FEW_POTHOLES,
    REALISTIC_SUSPENSION,
    RailDrive,
    RigRun,
    RoadConditions,
    RoadDrive,
    simulate_drive,
    with_gravity,
)
from sprung.vehicles import frequency_response, parse_fault, read_vehicle, structure


@pytest.fixture(scope="module")
def car():
    return read_vehicle("zafira")


def drive(vehicle, seed=1, kind=RoadDrive, **settings):
    return simulate_drive(vehicle, kind(**{"duration": 20.0, **settings}), seed=seed)


@pytest.mark.slow
def test_spectra_are_response_times_road(car) -> None:
    """At one speed the accelerations have the spectral matrix H S H^H with the delay of the rear wheels."""
    speed = 12.0
    found = drive(car, duration=1200.0, speed=(speed, speed)).recording
    spectra = spectral_matrix(found.select(found.names[:4]), segment_length=10.24)
    f = spectra.frequencies[10:200]
    n = f / speed
    road = road_class("C")
    level, coherence = road.density(n) / speed * np.sinc(n * 0.1) ** 2, road.coherence(n)
    delay = np.exp(-2j * np.pi * f * (1.22 + 1.58) / speed)
    pair = np.array([[np.ones_like(f), coherence], [coherence, np.ones_like(f)]])
    rows = [np.concatenate([pair, pair * delay.conj()], axis=1), np.concatenate([pair * delay, pair], axis=1)]
    S = (np.concatenate(rows) * level).transpose(2, 0, 1)
    H = frequency_response(structure(car), f)
    expected = (H @ S @ H.conj().swapaxes(1, 2)).transpose(1, 2, 0)
    measured = spectra.matrix[:, :, 10:200]
    size = np.sqrt(np.einsum("iif,jjf->ijf", expected, expected).real)
    error = ((measured - expected) / size).reshape(4, 4, 10, 19).mean(axis=3)  # 234 segments, 19 frequencies each
    assert np.abs(error).max() < 0.08


def test_a_fault_is_in_the_truth_and_in_the_signal(car) -> None:
    healthy, faulty = drive(car), drive(car, faults=(parse_fault("front_left.spring=-0.5"),))
    value = healthy.truth["components"]["front_left"]["spring"]["value"]
    assert faulty.truth["components"]["front_left"]["spring"]["value"] == pytest.approx(value / 2)
    assert faulty.truth["faults"] == {"front_left.spring": -0.5}
    assert faulty.truth["modes"][0]["natural_frequency"] < healthy.truth["modes"][0]["natural_frequency"]
    difference = np.abs(faulty.recording.samples - healthy.recording.samples).mean(axis=1)
    assert np.argmax(difference) == 0


def test_a_growing_fault_changes_nothing_before_its_onset(car) -> None:
    healthy, faulty = drive(car), drive(car, faults=(parse_fault("rear_left.tyre=-0.5@10+5"),))
    before = slice(0, 1900)
    size = healthy.recording.samples[:4].std()
    expected = healthy.recording.samples[:, before]
    np.testing.assert_allclose(faulty.recording.samples[:, before], expected, rtol=0, atol=1e-4 * size, equal_nan=False)
    assert np.abs(faulty.recording.samples[2, 3000:] - healthy.recording.samples[2, 3000:]).max() > 0.05 * size
    instants = faulty.truth["modes_over_time"]
    assert [instant["time"] for instant in instants] == pytest.approx(np.linspace(0, 20, 11))
    frequency = [instant["modes"][-1]["natural_frequency"] for instant in instants]
    assert frequency[0] == frequency[5] == pytest.approx(healthy.truth["modes"][-1]["natural_frequency"])
    assert faulty.truth["fault_courses"] == {"rear_left.tyre": {"onset": 10.0, "growth": 5.0}}


def test_speed_is_recorded_and_in_the_truth(car) -> None:
    found = drive(car, duration=120.0, speed=(5.0, 12.0), n_stops=1)
    speed = found.recording.samples[found.recording.index("speed")]
    assert speed == pytest.approx(found.speed.speed(np.arange(speed.size) / 200))
    assert found.truth["speed"]["lowest"] == speed.min() == 0
    assert found.truth["speed"]["mean"] == pytest.approx(speed.mean(), rel=1e-3)
    assert while_moving(found.recording, "speed").n_samples < speed.size


@pytest.mark.parametrize(("settings", "rate"), [(RailDrive(duration=5.0), 500.0), (RigRun(duration=5.0), 1000.0)])
def test_bogies_run_on_rails_and_rigs(settings, rate) -> None:
    found = simulate_drive(read_vehicle("y25"), settings, seed=1)
    assert found.recording.sampling_rate == rate
    assert np.all(found.recording.samples.std(axis=1)[:4] > 1e-4)


@pytest.mark.slow
def test_spectra_on_a_track_are_response_times_rails() -> None:
    """At one speed a vehicle on bogies has the spectral matrix H S H^H; its eight wheels meet the same track."""
    metro, speed = read_vehicle("metro"), 20.0
    found = drive(metro, kind=RailDrive, duration=900.0, speed=(speed, speed), sampling_rate=100.0, welded=True)
    spectra = spectral_matrix(found.recording.select(found.recording.names[:12]), segment_length=20.48)
    f = spectra.frequencies[8:408]  # 0.4 to 20 Hz
    n, track = f / speed, rail_quality("good")
    patch = np.sinc(n * 0.01) ** 2 / speed
    x, side = np.array([(wheel.x, np.sign(wheel.y)) for wheel in metro.wheels]).T
    alike = np.equal.outer(side, side)[..., None]
    level = patch * (track.common(n) + np.where(alike, 1.0, -1.0) * track.differing(n))
    S = level * np.exp(2j * np.pi * n * np.subtract.outer(x, x)[..., None])
    H = frequency_response(structure(metro), f)
    expected = (H @ S.transpose(2, 0, 1) @ H.conj().swapaxes(1, 2)).transpose(1, 2, 0)
    size = np.sqrt(np.einsum("iif,jjf->ijf", expected, expected).real)
    error = np.abs(((spectra.matrix[:, :, 8:408] - expected) / size).reshape(12, 12, 20, 20).mean(axis=3))
    assert error[:8, :8].max() < 0.12  # frames; 87 segments, 20 frequencies each
    assert (
        error[..., :4].max() < 0.12
    )  # frames and body, up to 4.3 Hz: above, the distances of the wheelsets make notches


def test_bogies_meet_the_track_one_after_another_and_faults_are_in_the_truth() -> None:
    """The second frame moves as the first did 14.4 m earlier, as both bogies are alike and the body moves little."""
    settings = {"kind": RailDrive, "duration": 60.0, "speed": (20.0, 20.0), "sampling_rate": 100.0}
    fault = parse_fault("bogie1_left.secondary_spring=-0.2")
    found = drive(read_vehicle("metro"), faults=(fault,), quality="bad", **settings)
    first, second = (found.recording.samples[found.recording.index(f"bogie{number}_fl")] for number in (1, 2))
    lags = np.arange(30, 110)
    best = lags[np.argmax([np.corrcoef(first[:-lag], second[lag:])[0, 1] for lag in lags])]
    assert best == 72
    assert found.truth["components"]["bogie1_left"]["secondary_spring"]["value"] == pytest.approx(0.8 * 290e3)
    assert found.truth["components"]["bogie2_rear_right"]["primary_damper"]["value"] == 11e3
    assert found.truth["conditions"]["track"] == {"quality": "bad", "welded": False}


def test_joints_and_crossings_of_a_track_are_in_the_truth() -> None:
    settings = {"kind": RailDrive, "duration": 20.0, "sampling_rate": 100.0}
    joints, crossings = Joints(rail_length=12.5), Crossings(per_kilometre=5.0)
    found = drive(read_vehicle("y25").model_copy(update={"kind": "rail"}), joints=joints, **settings)
    assert found.truth["conditions"]["track"] == {
        "quality": "good",
        "welded": False,
        "joints": {"rail_length": 12.5, "depth": 0.002, "length": 0.3, "stagger": 0.0, "side": None},
    }
    found = drive(read_vehicle("metro"), welded=True, crossings=crossings, **settings)
    assert found.truth["conditions"]["track"]["crossings"]["per_kilometre"] == 5.0


def test_corrugation_is_in_the_truth_and_shakes_an_axle_box_at_speed_over_wavelength() -> None:
    settings = {"kind": RailDrive, "duration": 30.0, "sampling_rate": 1000.0, "speed": (20.0, 20.0), "welded": True}
    y25 = read_vehicle("y25").model_copy(update={"kind": "rail"})
    corrugated = drive(y25, corrugation=Corrugation(wavelength=0.2, amplitude=1e-4), **settings)
    assert corrugated.truth["conditions"]["track"]["corrugation"]["wavelength"] == 0.2
    plain = drive(y25, **settings)
    box = corrugated.recording.index("acc_al")
    frequencies, power = welch(corrugated.recording.samples[box] - plain.recording.samples[box], 1000.0, nperseg=1024)
    below = frequencies < 140  # of the resonance on the rail at 168 Hz
    assert frequencies[below][np.argmax(power[below])] == pytest.approx(100.0, abs=15.0)
    with pytest.raises(
        ParameterError, match="waves of the corrugation in a second=500 must be at most 400: drive slow"
    ):
        RailDrive(speed=(10.0, 50.0), corrugation=Corrugation(wavelength=0.1))


def test_a_class_of_the_fra_has_more_power_where_it_is_lower() -> None:
    power = [
        drive(read_vehicle("metro"), kind=RailDrive, quality=quality, welded=True, sampling_rate=100.0)
        .recording.samples[:12]
        .var()
        for quality in ("fra4", "fra5", "fra6")
    ]
    assert power[0] > 2 * power[1] > 8 * power[2] > 0


def test_a_bad_track_has_2_7_times_the_power_of_a_good_one() -> None:
    """Without joints, for the same seed; the ratio of both scale factors of ERRI B176 is 1.080 / 0.4032."""
    good, bad = (
        drive(read_vehicle("metro"), kind=RailDrive, quality=quality, welded=True, sampling_rate=100.0).recording
        for quality in ("good", "bad")
    )
    ratio = bad.samples[:12].var(axis=1) / good.samples[:12].var(axis=1)
    assert ratio == pytest.approx(np.full(12, 1.080 / 0.4032), rel=1e-6)


def test_an_accelerometer_on_a_frame_reads_gravity_as_the_frame_turns() -> None:
    metro = read_vehicle("metro")
    sensor = metro.sensor[0].model_copy(update={"direction": (0.6, 0.0, 0.8)})
    turned = metro.model_copy(update={"sensor": (sensor,)})
    still = with_gravity(structure(turned), turned)
    row = dict(zip(still.coordinates, still.outputs.displacement[0], strict=True))
    assert {name: value for name, value in row.items() if value} == {"bogie1_pitch": pytest.approx(-0.6 * 9.81)}


def test_settings_can_be_sent_to_another_process() -> None:
    settings = RoadDrive(suspension=REALISTIC_SUSPENSION, road=RoadConditions("B", potholes=FEW_POTHOLES))
    assert pickle.loads(pickle.dumps(settings)) == settings


def test_noise_is_on_the_sensors_but_not_on_the_speed(car) -> None:
    clean, noisy = drive(car).recording.samples, drive(car, snr=10.0).recording.samples
    assert (noisy - clean)[:4].std(axis=1) == pytest.approx(clean[:4].std(axis=1) / 10, rel=0.05)
    assert np.array_equal(noisy[4], clean[4])
