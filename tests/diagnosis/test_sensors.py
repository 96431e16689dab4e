"""All eleven faults of a sensor, named with their channel; none in a healthy drive."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from sprung.diagnosis import observe_window, sensor_faults
from sprung.diagnosis.observation import fit_drive
from sprung.diagnosis.sensors import speed_fault
from sprung.errors import DataError
from sprung.identification.records import without_dead_parts
from sprung.signals.inspection import inspect
from sprung.simulation import (
    FEW_POTHOLES,
    REALISTIC_SUSPENSION,
    Payload,
    RailDrive,
    RoadConditions,
    RoadDrive,
    clipped,
    dead,
    delayed,
    drifting,
    inverted,
    noisy,
    scaled,
    simulate_drive,
    spiking,
    stuck,
    swapped,
    with_hum,
    with_imperfections,
)
from sprung.vehicles import MountedMass, Sensor, read_vehicle
from sprung.vehicles.channel_faults import KINDS
from sprung.vehicles.sensor_checks import check_sensors
from sprung.vehicles.window import window_of


def nonlinear(road_class="C", **settings):
    """A drive with realistic suspensions on a road with potholes."""
    road = RoadConditions(road_class, potholes=FEW_POTHOLES)
    return RoadDrive(road=road, suspension=REALISTIC_SUSPENSION, **settings)


@pytest.fixture(scope="module")
def car():
    return read_vehicle("zafira")


@pytest.fixture(scope="module")
def run(car):
    settings = nonlinear(duration=300.0, snr=50.0, n_stops=1, payload=Payload(100.0))
    return simulate_drive(car, settings, seed=5).recording


FAULTS = {
    "dead": lambda rms, name: partial(dead, channel=name, onset=60.0),
    "stuck": lambda rms, name: partial(stuck, channel=name, onset=60.0),
    "clipped": lambda rms, name: partial(clipped, channel=name, limit=2 * rms),
    "spiking": lambda rms, name: partial(spiking, channel=name, rate=0.05, height=20 * rms),
    "noisy": lambda rms, name: partial(noisy, standard_deviation=0.4 * rms, channel=name),
    "drifting": lambda rms, name: partial(drifting, channel=name, per_hour=4 * rms),
    "inverted": lambda rms, name: partial(inverted, channel=name),
    "swapped": lambda rms, name: partial(swapped, first=name, second="acc_rr" if name != "acc_rr" else "acc_fr"),
    "wrong_gain": lambda rms, name: partial(scaled, channel=name, factor=1.15),
    "time_shifted": lambda rms, name: partial(delayed, channel=name, delay=0.01),
    "hum": lambda rms, name: partial(with_hum, channel=name, amplitude=0.1 * rms),
}


def tilted(run, highest, **degrees):
    """A vertical accelerometer that leans by 3 degrees reads a twentieth of the lateral acceleration of every bend."""
    white = np.fft.rfft(np.random.default_rng(3).standard_normal(run.n_samples))
    bends = np.fft.irfft(white * (np.fft.rfftfreq(run.n_samples, 1 / run.sampling_rate) < highest), run.n_samples)
    samples = run.samples.copy()
    for name, angle in degrees.items():
        samples[run.index(name)] += np.sin(np.radians(angle)) * 2.5 * bends / bends.std()
    return replace(run, samples=samples)


def on_edges(run):
    """The edge of a pothole on a smooth road moves one sensor by its own standard deviation within two samples."""
    height = 1.2 * run.samples[1].std()
    return spiking(run, channel="acc_fr", rate=0.1, height=height, generator=np.random.default_rng(2))


@pytest.mark.slow
def test_harmless_motion_is_no_fault(car, run) -> None:
    smooth = simulate_drive(car, RoadDrive(road=RoadConditions("A"), duration=120.0), seed=4).recording
    assert sensor_faults(run, car) == ()
    assert sensor_faults(tilted(run, 0.06, acc_fr=3.0), car) == ()
    assert sensor_faults(tilted(run, 0.004, acc_fl=0.4, acc_fr=-5.0, acc_rl=1.0, acc_rr=-0.7), car) == ()
    assert sensor_faults(on_edges(smooth), car) == ()
    assert set(FAULTS) == set(KINDS)


@pytest.mark.parametrize("channel", ["acc_fr", "acc_rl"])
@pytest.mark.parametrize("kind", FAULTS)
def test_a_fault_is_named_with_its_channel(car, run, kind, channel) -> None:
    rms = float(run.samples[run.index(channel)].std())
    broken = with_imperfections(run, [FAULTS[kind](rms, channel)], seed=1)
    found = sensor_faults(broken, car)
    assert (channel, kind) in {(fault.channel, fault.kind) for fault in found}
    if kind != "swapped":
        assert len(found) == 1


@pytest.mark.parametrize("amplitude", [1.3, 2.8])
def test_a_tone_in_one_channel_alone_is_hum(car, run, amplitude) -> None:
    rms = float(run.samples[run.index("acc_fl")].std())
    broken = with_hum(
        run, channel="acc_fl", amplitude=amplitude * rms, frequency=17.0, generator=np.random.default_rng(1)
    )
    assert [(fault.channel, fault.kind) for fault in sensor_faults(broken, car)] == [("acc_fl", "hum")]


def test_a_tone_in_all_channels_is_no_fault(car, run) -> None:
    """As of an engine, or of wheels out of balance at a constant speed; at one corner 14 dB stronger."""
    rms = float(run.samples[run.index("acc_fl")].std())
    shaken, generator = run, np.random.default_rng(1)
    for name, share in (("acc_fl", 1.0), ("acc_fr", 0.2), ("acc_rl", 0.2), ("acc_rr", 0.2)):
        shaken = with_hum(shaken, channel=name, amplitude=2.0 * share * rms, frequency=17.0, generator=generator)
    assert "hum" not in {fault.kind for fault in sensor_faults(shaken, car)}


def test_a_channel_that_swings_slowly_alone_has_no_hum(car, run) -> None:
    rms = float(run.samples[run.index("acc_fl")].std())
    generator = np.random.default_rng(1)
    slow = with_hum(run, channel="acc_fl", amplitude=4 * rms, frequency=0.6, generator=generator)
    assert "hum" not in {fault.kind for fault in sensor_faults(slow, car)}


@pytest.mark.slow
def test_contradictions_are_refused_before_a_fit_and_other_faults_noted(car, run) -> None:
    short = run.part(0, 60 * round(run.sampling_rate))
    with pytest.raises(DataError, match="acc_fl with acc_fr or acc_rl with acc_rr: correct the names"):
        fit_drive(swapped(short, first="acc_fl", second="acc_fr"), car)
    with pytest.raises(DataError, match="acc_rr is inverted: correct"):
        fit_drive(inverted(short, channel="acc_rr"), car)
    rms = float(run.samples[run.index("acc_fl")].std())
    generator = np.random.default_rng(1)
    humming = with_hum(short, channel="acc_fl", amplitude=2 * rms, frequency=17.0, generator=generator)
    notes = fit_drive(humming, car).notes
    assert any(note.startswith("acc_fl has hum: 17.1 Hz") for note in notes)


def test_noise_in_the_band_of_the_body_is_seen_in_the_residual(car, run) -> None:
    half = 0.5 * run.samples[1].std()
    generator = np.random.default_rng(1)
    broken = noisy(run, standard_deviation=half, channel="acc_fr", band=(1.0, 20.0), generator=generator)
    (fault,) = sensor_faults(broken, car)
    assert (fault.channel, fault.kind) == ("acc_fr", "noisy")


@pytest.mark.parametrize(("gain", "delay"), [(0.8, 0.0), (1.3, 0.0), (1.0, 4e-3), (1.0, 30e-3), (1.0, -0.01)])
def test_size_of_gain_and_delay(car, run, gain, delay) -> None:
    is_gain = delay == 0
    wrong = scaled(run, channel="acc_fl", factor=gain) if is_gain else delayed(run, channel="acc_fl", delay=delay)
    (fault,) = sensor_faults(wrong, car)
    number = float(fault.detail.split()[0])
    assert number == pytest.approx(gain if is_gain else 1e3 * abs(delay), rel=0.07)
    assert is_gain or fault.detail.endswith("early" if delay < 0 else "late")


def test_a_recording_of_speed_alone_is_refused(car, run) -> None:
    speed = Sensor(channel="speed", quantity="speed", unit="m/s")
    with pytest.raises(DataError, match="none of the vehicle file's motion sensors"):
        sensor_faults(
            run.select(["speed"]), car.model_copy(update={"sensor": (*car.sensor, speed)}), allow_missing=True
        )


CONTRADICTIONS = {
    "diagonal inverted": [partial(inverted, channel=name) for name in ("acc_fl", "acc_rr")],
    "diagonal too large": [partial(scaled, channel=name, factor=1.3) for name in ("acc_fl", "acc_rr")],
    "front too large": [partial(scaled, channel=name, factor=1.5) for name in ("acc_fl", "acc_fr")],
    "front late": [partial(delayed, channel=name, delay=0.01) for name in ("acc_fl", "acc_fr")],
}


@pytest.mark.parametrize(
    "wrong", [pytest.param(name, marks=pytest.mark.slow if "inverted" in name else ()) for name in CONTRADICTIONS]
)
def test_two_wrong_sensors_make_the_window_inconclusive(car, run, wrong) -> None:
    found = observe_window(with_imperfections(run, CONTRADICTIONS[wrong]), car)
    assert not found.is_conclusive
    assert "check signs, gains, places and delays" in found.reason


def wheel_lines(run):
    """Lines at one and two cycles per turn of the wheels, of another phase at every corner."""
    way = np.cumsum(run.samples[-1]) / run.sampling_rate
    samples, generator = run.samples.copy(), np.random.default_rng(3)
    for order, size in ((1, 0.15), (2, 0.08)):
        for row in range(4):
            samples[row] += size * np.sin(2 * np.pi * 0.516 * order * way + generator.uniform(0, 6.28))
    return replace(run, samples=samples)


@pytest.mark.slow
@pytest.mark.parametrize("unknown", ["nothing", "engine", "anti-roll bars", "wheel lines"])
def test_healthy_sensors_agree_on_a_smooth_road_with_noise(car, unknown) -> None:
    engine = MountedMass(mass=180.0, x=1.1, frequency=11.0, damping_ratio=0.08)
    bars = tuple(axle.model_copy(update={"anti_roll_stiffness": 12e3}) for axle in car.axle)
    changes = {"engine": {"mounted_mass": (engine,)}, "anti-roll bars": {"axle": bars}}
    settings = nonlinear("A", duration=300.0, snr=30.0, n_stops=1)
    drive = simulate_drive(car.model_copy(update=changes.get(unknown, {})), settings, seed=4).recording
    checked = check_sensors(window_of(wheel_lines(drive) if unknown == "wheel lines" else drive, car))
    assert checked.faults == ()
    assert checked.disagreement == 0.0


def with_speed(run, values):
    return replace(run, samples=np.vstack([run.samples[:-1], np.broadcast_to(values, run.n_samples)]))


@pytest.mark.parametrize(("speed", "kind"), [(0.0, "dead"), pytest.param(30.0, "stuck", marks=pytest.mark.slow)])
def test_a_speed_that_stays_while_the_delay_says_another_is_left_out(car, run, speed, kind) -> None:
    found = observe_window(with_speed(run.part(0, run.n_samples // 2), speed), car)
    assert [(fault.channel, fault.kind) for fault in found.sensor_faults] == [("speed", kind)]
    assert found.is_conclusive
    assert not {"speed", "standing"} & found.conditions.keys()


@pytest.mark.slow
@pytest.mark.parametrize(("speed", "road"), [(5.5, "A"), (30.0, "B")])
def test_a_kept_speed_is_not_stuck(car, speed, road) -> None:
    settings = nonlinear(road, duration=180.0, speed=(speed, speed), snr=30.0)
    assert speed_fault(window_of(simulate_drive(car, settings, seed=2).recording, car)) is None


def test_a_standing_car_and_a_rig_have_no_speed_to_be_wrong(car, run) -> None:
    generator = np.random.default_rng(1)
    idling = 0.3 * np.sin(2 * np.pi * 26.0 * np.arange(run.n_samples) / run.sampling_rate)
    still = replace(run, samples=0.02 * generator.standard_normal(run.samples.shape) + idling)
    assert speed_fault(window_of(with_speed(still, 0.0), car)) is None
    assert speed_fault(window_of(with_speed(run, 0.0), car.model_copy(update={"kind": "rig"}))) is None
    shaken = replace(run, samples=generator.standard_normal(run.samples.shape))
    assert speed_fault(window_of(with_speed(shaken, 0.0), car)) is None


@pytest.mark.slow
def test_diagonal_sensors_exchanged_are_seen_despite_an_unknown_engine(car) -> None:
    engine = MountedMass(mass=180.0, x=1.1, frequency=11.0, damping_ratio=0.08)
    settings = nonlinear(duration=300.0, snr=50.0)
    run = simulate_drive(car.model_copy(update={"mounted_mass": (engine,)}), settings, seed=5).recording
    sound = observe_window(run, car)
    assert sound.conditions["model_error"] > 0.25
    assert sound.is_conclusive
    assert not sound.sensor_faults
    found = observe_window(swapped(run, first="acc_rl", second="acc_fr"), car)
    assert {fault.kind for fault in found.sensor_faults} == {"swapped"}


@pytest.mark.slow
def test_the_rest_goes_on_without_a_bad_channel(car, run) -> None:
    found = observe_window(dead(run, channel="acc_rl"), car)
    assert [fault.kind for fault in found.sensor_faults] == ["dead"]
    assert found.is_conclusive
    assert len(found.components) == 12


#: Faults that a recording shows by itself, with the words of `inspect` for each kind of the sensor checks.
OWN_FAULTS = {"dead": {"dead", "half-dead"}, "stuck": {"stuck"}, "clipped": {"clipped"}, "spiking": {"spiking"}}
BROKEN = {
    "healthy": lambda rms, name: [],
    "dead from a minute on": lambda rms, name: [partial(dead, channel=name, onset=60.0)],
    "dead throughout": lambda rms, name: [partial(dead, channel=name, onset=0.0)],
    "dead at the end": lambda rms, name: [partial(dead, channel=name, onset=290.0)],
    "stuck from a minute on": lambda rms, name: [partial(stuck, channel=name, onset=60.0)],
    "stuck at the end": lambda rms, name: [partial(stuck, channel=name, onset=285.0)],
    "clipped": lambda rms, name: [partial(clipped, channel=name, limit=2 * rms)],
    "spiking": lambda rms, name: [partial(spiking, channel=name, rate=0.05, height=20 * rms)],
}


@pytest.mark.parametrize("what", BROKEN)
def test_inspection_and_identification_agree_with_the_sensor_checks(car, run, what) -> None:
    rms = float(run.samples[run.index("acc_rl")].std())
    broken = with_imperfections(run, BROKEN[what](rms, "acc_rl"), seed=1)
    checked = {fault.channel: fault.kind for fault in sensor_faults(broken, car) if fault.kind in OWN_FAULTS}
    for facts in inspect(broken).channels:
        kinds = {kind for kind, words in OWN_FAULTS.items() if words & set(facts.faults)}
        assert kinds == ({checked[facts.name]} if facts.name in checked else set()), facts.name
    assert bool(checked) == (what != "healthy")
    _, noted = without_dead_parts(broken, [name for name in broken.names if name != "speed"])
    expected = {name for name, kind in checked.items() if kind in {"stuck", "clipped"} or "throughout" not in what}
    assert {fault.channel for fault in noted} == {name for name in expected if checked[name] != "spiking"}


@pytest.mark.parametrize(("name", "channels"), [("metro", ("bogie1_fl", "bogie1_rr")), ("y25", ("acc_fl", "acc_al"))])
def test_rail_joints_are_no_spikes(name, channels) -> None:
    """They hit one wheelset after another, and what they excite rings, which a spike of the electronics does not."""
    vehicle = read_vehicle(name)
    sensors = tuple(sensor for sensor in vehicle.sensor if sensor.channel in channels)
    vehicle = vehicle.model_copy(update={"kind": "rail", "sensor": sensors})
    drive = simulate_drive(vehicle, RailDrive(duration=120.0, sampling_rate=100.0, snr=50.0), seed=2).recording
    assert sensor_faults(drive, vehicle) == ()
    height = 20 * float(drive.samples[drive.index(channels[0])].std())
    broken = spiking(drive, channel=channels[0], rate=0.1, height=height, generator=np.random.default_rng(2))
    assert [(fault.channel, fault.kind) for fault in sensor_faults(broken, vehicle)] == [(channels[0], "spiking")]
