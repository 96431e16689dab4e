"""All eleven faults of a sensor, named with their channel; none in a healthy drive."""

import pytest

from sprung.diagnosis import KINDS, observe, sensor_faults
from sprung.simulation import (
    Clipped,
    Dead,
    Delayed,
    Drifting,
    DriveSettings,
    Gained,
    Hum,
    Inverted,
    Noisy,
    Spiking,
    Stuck,
    Swapped,
    simulate_drive,
    with_imperfections,
)
from sprung.vehicles import MountedMass, read_vehicle


@pytest.fixture(scope="module")
def car():
    return read_vehicle("zafira")


@pytest.fixture(scope="module")
def run(car):
    settings = DriveSettings("road", duration=300.0, snr=50.0, n_stops=1, is_nonlinear=True, payload=100.0)
    return simulate_drive(car, settings, seed=5).recording


FAULTS = {
    "dead": lambda rms, name: Dead(name, 60.0),
    "stuck": lambda rms, name: Stuck(name, 60.0),
    "clipped": lambda rms, name: Clipped(name, 2 * rms),
    "spiking": lambda rms, name: Spiking(name, 0.05, 20 * rms),
    "noisy": lambda rms, name: Noisy(0.4 * rms, name),
    "drifting": lambda rms, name: Drifting(name, 4 * rms),
    "inverted": lambda rms, name: Inverted(name),
    "swapped": lambda rms, name: Swapped(name, "acc_rr" if name != "acc_rr" else "acc_fr"),
    "wrong_gain": lambda rms, name: Gained(name, 1.15),
    "time_shifted": lambda rms, name: Delayed(name, 0.01),
    "hum": lambda rms, name: Hum(name, 0.1 * rms),
}


def test_every_kind_is_tried():
    assert set(FAULTS) == set(KINDS)


def test_healthy_sensors_are_not_accused(car, run):
    assert sensor_faults(run, car) == ()


@pytest.mark.parametrize("channel", ["acc_fr", "acc_rl"])
@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_is_named_with_its_channel(car, run, kind, channel):
    rms = float(run.samples[run.index(channel)].std())
    broken = with_imperfections(run, [FAULTS[kind](rms, channel)], seed=1)
    found = sensor_faults(broken, car)
    assert (channel, kind) in {(fault.channel, fault.kind) for fault in found}
    if kind != "swapped":
        assert len(found) == 1


def test_noise_in_the_band_of_the_body_is_seen_in_the_residual(car, run):
    noisy = with_imperfections(run, [Noisy(0.5 * run.samples[1].std(), "acc_fr", band=(1.0, 20.0))], seed=1)
    (fault,) = sensor_faults(noisy, car)
    assert (fault.channel, fault.kind) == ("acc_fr", "noisy")


@pytest.mark.parametrize(("gain", "delay"), [(0.8, 0.0), (1.3, 0.0), (1.0, 4e-3), (1.0, 30e-3)])
def test_size_of_gain_and_delay(car, run, gain, delay):
    change = Gained("acc_fl", gain) if delay == 0 else Delayed("acc_fl", delay)
    (fault,) = sensor_faults(with_imperfections(run, [change]), car)
    number = float(fault.detail.split()[0])
    assert number == pytest.approx(gain if delay == 0 else 1e3 * delay, rel=0.07)


@pytest.mark.slow
def test_diagonal_sensors_exchanged_are_seen_by_the_delay(car, run):
    found = observe(with_imperfections(run, [Swapped("acc_fl", "acc_rr")]), car)
    assert {fault.kind for fault in found.sensor_faults} == {"swapped"}
    assert not found.can_tell


@pytest.mark.slow
def test_diagonal_sensors_exchanged_are_seen_beside_an_unknown_engine(car):
    engine = MountedMass(mass=180.0, x=1.1, frequency=11.0, damping_ratio=0.08)
    settings = DriveSettings("road", duration=600.0, snr=50.0, is_nonlinear=True)
    run = simulate_drive(car.model_copy(update={"mounted_mass": (engine,)}), settings, seed=5).recording
    sound = observe(run, car)
    assert sound.conditions["imperfection"] > 0.25
    assert sound.can_tell
    assert not sound.sensor_faults
    found = observe(with_imperfections(run, [Swapped("acc_rl", "acc_fr")]), car)
    assert {fault.kind for fault in found.sensor_faults} == {"swapped"}


@pytest.mark.slow
def test_the_rest_goes_on_without_a_bad_channel(car, run):
    found = observe(with_imperfections(run, [Dead("acc_rl")]), car)
    assert [fault.kind for fault in found.sensor_faults] == ["dead"]
    assert found.can_tell
    assert len(found.components) == 12
