import pickle

import numpy as np
import pytest

from sprung.excitation import road_class
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


def test_settings_can_be_sent_to_another_process() -> None:
    settings = RoadDrive(suspension=REALISTIC_SUSPENSION, road=RoadConditions("B", potholes=FEW_POTHOLES))
    assert pickle.loads(pickle.dumps(settings)) == settings


def test_noise_is_on_the_sensors_but_not_on_the_speed(car) -> None:
    clean, noisy = drive(car).recording.samples, drive(car, snr=10.0).recording.samples
    assert (noisy - clean)[:4].std(axis=1) == pytest.approx(clean[:4].std(axis=1) / 10, rel=0.05)
    assert np.array_equal(noisy[4], clean[4])
