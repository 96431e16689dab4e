"""A recording as a window of its vehicle: sensors placed once, speed, conditions, usable motion."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import DataError, ParameterError
from sprung.recording import Channel, Recording
from sprung.vehicles import Sensor, read_vehicle
from sprung.vehicles.usable import usable
from sprung.vehicles.window import window_of


@pytest.fixture
def car():
    """The file's four accelerometers, the last one in g, and a gyroscope about the vertical."""
    car = read_vehicle("zafira")
    *others, last = car.sensor
    yaw = Sensor(channel="yaw_rate", quantity="angular_velocity", unit="deg/s", direction=(0.0, 0.0, -1.0))
    return car.model_copy(update={"sensor": (*others, last.model_copy(update={"unit": "g"}), yaw)})


@pytest.fixture
def run(car):
    """Raw values, standing for a quarter of the time, and one that no sensor of the file explains."""
    generator = np.random.default_rng(1)
    names = (*(sensor.channel for sensor in car.sensor), "other")
    samples = generator.standard_normal((len(names) + 2, 1000))
    samples[-2], samples[-1] = np.repeat([0.0, 12.0], [250, 750]), 21.5
    channels = (*map(Channel, names), Channel("Speed", "speed"), Channel("oil", "temperature"))
    return Recording(samples, 100.0, channels)


def test_sensors_are_placed_in_si_units(car, run) -> None:
    window = window_of(run, car)
    assert window.outputs == tuple(sensor.channel for sensor in car.sensor)
    placed = window.recording
    np.testing.assert_allclose(placed.samples[3], 9.80665 * run.samples[3])
    np.testing.assert_allclose(placed.samples[4], np.pi / 180 * run.samples[4])
    assert placed.channels[3].position == car.sensor[3].position
    assert [component.corner for component in window.structure.components()][:1] == ["front_left"]


def test_conditions_are_those_that_channels_show(car, run) -> None:
    window = window_of(run, car)
    assert window.speed == "Speed"
    assert window.conditions == {
        "speed": pytest.approx(9.0),
        "standing": pytest.approx(0.25),
        "temperature": pytest.approx(21.5),
        "turning": pytest.approx(np.pi / 180 * np.sqrt(np.mean(run.samples[4] ** 2))),
    }


def test_the_speed_is_scaled_and_advanced(car, run) -> None:
    """A ramp, whose values at every time are known: 0.5 s later, times 1.1."""
    samples = run.samples.copy()
    samples[-2] = np.linspace(10.0, 20.0, 1000)
    late = car.model_copy(update={"speed_delay": 0.505, "speed_scale": 1.1})
    window = window_of(replace(run, samples=samples), late)
    speed = window.recording.samples[window.recording.index("Speed")]
    assert speed[:949] == pytest.approx(1.1 * (samples[-2] + 0.505 * 100 * 10 / 999)[:949], rel=1e-12)
    assert np.isnan(speed[949:]).all()
    assert window.conditions["speed"] == pytest.approx(np.nanmean(speed))
    assert window.motion.n_samples == 949
    assert window.recording.history[-1] == "speed times 1.1, advanced by 0.505 s"


def test_motion_is_what_identification_uses_and_computed_once(car, run) -> None:
    window = window_of(run, car)
    expected = usable(run, vehicle=car)
    np.testing.assert_array_equal(window.motion.samples, expected.samples)
    assert (window.motion.names, window.motion.gaps) == (expected.names, expected.gaps)
    assert window.motion.n_samples == 750
    assert window.motion is window.motion


def test_channels_left_out_take_with_them_what_they_show(car, run) -> None:
    window = window_of(run, car)
    assert window.without(()) is window
    rest = window.without({"acc_fr"})
    assert rest.outputs == ("acc_fl", "acc_rl", "acc_rr", "yaw_rate")
    assert rest.conditions == window.conditions
    slow = window.without({"Speed", "acc_fl"})
    assert (slow.speed, slow.conditions.keys()) == (None, {"temperature", "turning"})
    assert slow.motion.n_samples == 1000
    with pytest.raises(DataError, match="no channel of motion"):
        _ = window.without(window.outputs).motion


def test_exchanged_sensors_hold_each_others_samples(car, run) -> None:
    window = window_of(run, car)
    exchanged = window.exchanged("acc_fl", "acc_rr")
    np.testing.assert_array_equal(exchanged.recording.samples[[0, 3]], window.recording.samples[[3, 0]])
    assert exchanged.recording.channels == window.recording.channels
    again = exchanged.exchanged("acc_fl", "acc_rr")
    np.testing.assert_array_equal(again.recording.samples, window.recording.samples)


def test_a_part_keeps_the_samples_in_between(car, run) -> None:
    part = window_of(run, car).part(200, 300)
    assert part.recording.n_samples == 100
    assert part.motion.n_samples == 50


def test_a_file_of_another_recording_is_refused(car, run) -> None:
    with pytest.raises(ParameterError, match="make the names agree"):
        window_of(run.select(["other", "Speed"]), car)
