"""The sensors of a vehicle file on the channels of a recording."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.recording import Channel, Gap, Recording
from sprung.vehicles import Sensor, read_vehicle
from sprung.vehicles.sensor_layout import check_present, layout_notes, quantities_of, with_layout


def recorded(*channels):
    return Recording(np.arange(1.0, 4.0) * np.ones((len(channels), 1)), 10.0, channels, history=("read",))


def sensor(channel, **fields):
    given = {"quantity": "acceleration", "unit": "g", "position": (1.2, 0.7, 0.0), "direction": (0.0, 0.0, 1.0)}
    return Sensor(channel=channel, **{**given, **fields})


def test_raw_values_become_si_and_get_their_place() -> None:
    """1 g = 9.80665 m/s^2 (CGPM 1901); scale multiplies raw values first."""
    placed = with_layout(recorded(Channel("a"), Channel("b")), [sensor("a", scale=-2.0)])
    np.testing.assert_allclose(placed.samples, np.outer([-2 * 9.80665, 1.0], [1.0, 2.0, 3.0]))
    assert placed.channels == (Channel("a", "acceleration", (1.2, 0.7, 0.0), (0.0, 0.0, 1.0)), Channel("b"))
    assert placed.history == ("read", "sensor layout of 1 channel")


def test_values_in_si_are_not_converted_again() -> None:
    placed = with_layout(recorded(Channel("a", "acceleration")), [sensor("a")])
    np.testing.assert_allclose(placed.samples, [[1, 2, 3]])
    assert placed.channels[0].position == (1.2, 0.7, 0.0)
    turned = with_layout(recorded(Channel("a", "acceleration")), [sensor("a", scale=-1.0)])
    np.testing.assert_allclose(turned.samples, [[-1, -2, -3]])


def test_a_late_channel_is_advanced() -> None:
    """A sine known at every time, late by 0.37 samples in one of two channels."""
    late, times = 3.7e-3, np.arange(400) / 100
    samples = np.sin(2 * np.pi * 7.0 * np.array([times, times - late]))
    run = Recording(samples, 100.0, (Channel("a"), Channel("b")), gaps=(Gap(200, 1.0),))
    placed = with_layout(run, [sensor("a", unit="m/s^2"), sensor("b", unit="m/s^2", delay=late)])
    inner = np.r_[40:160, 240:360]
    assert placed.samples[1, inner] == pytest.approx(samples[0, inner], abs=1e-4)
    np.testing.assert_array_equal(placed.samples[0], samples[0])
    assert np.flatnonzero(np.isnan(placed.samples[1])).tolist() == [199, 399]
    again = with_layout(run, [sensor("a", unit="m/s^2"), sensor("b", unit="m/s^2")])
    np.testing.assert_array_equal(again.samples, samples)


def test_a_reversed_gyroscope_is_turned_by_its_scale() -> None:
    gyro = sensor("g", quantity="angular_velocity", unit="deg/s", position=None, direction=(0.0, 1.0, 0.0), scale=-1.0)
    placed = with_layout(recorded(Channel("g")), [gyro])
    np.testing.assert_allclose(placed.samples, [[-np.pi / 180 * n for n in (1, 2, 3)]])
    assert placed.channels[0].unit == "rad/s"


def test_a_file_of_another_recording_is_refused() -> None:
    with pytest.raises(ParameterError) as refusal:
        with_layout(recorded(Channel("x"), Channel("y")), [sensor("a"), sensor("b")])
    assert str(refusal.value) == (
        "none of the vehicle file's sensors a, b is among the channels x, y: rename the channels, or state under"
        " [[sensor]] in the vehicle file what they measure and where they are"
    )


def test_contradicting_quantities_are_refused() -> None:
    with pytest.raises(ParameterError) as refusal:
        with_layout(recorded(Channel("a", "speed")), [sensor("a")])
    assert str(refusal.value) == (
        "channel 'a' is speed [m/s] in the recording, but acceleration [g] in the vehicle file: correct one of them"
    )


def test_quantities_of_one_unit_are_the_file_s() -> None:
    """Speed and velocity are both in m/s."""
    velocity = sensor("v", quantity="velocity", unit="m/s")
    placed = with_layout(recorded(Channel("v", "speed")), [velocity])
    assert placed.channels[0].quantity == "velocity"


def test_a_missing_sensor_is_refused_with_the_name_that_may_have_been_meant() -> None:
    """The sensor AccZ was called Acc_Z by the logger: without it corners came out 124 % off."""
    run = recorded(Channel("AccX"), Channel("Acc_Z"), Channel("speed", "speed"))
    sensors = [sensor("AccX"), sensor("AccZ")]
    sentence = (
        "the recording lacks 1 of the vehicle file's 2 sensors: AccZ (did you mean 'Acc_Z'?) (channels that no sensor"
        " names: Acc_Z, speed): make the names agree, or continue without them with --allow-missing (in Python"
        " allow_missing=True)"
    )
    for refused in (with_layout, quantities_of):
        with pytest.raises(ParameterError) as refusal:
            refused(run, sensors)
        assert str(refusal.value) == sentence
    placed = with_layout(run, sensors, allow_missing=True)
    assert placed.history[-1] == "sensor layout of 1 channel"
    assert placed.channels[1] == Channel("Acc_Z")
    assert quantities_of(run, sensors, allow_missing=True)["AccX"] == "acceleration"


def test_a_dead_sensor_is_not_missing() -> None:
    run = recorded(Channel("a"), Channel("b"))
    dead = Recording(run.samples * [[1.0], [np.nan]], 10.0, run.channels)
    assert with_layout(dead, [sensor("a"), sensor("b")]).names == ("a", "b")


def test_a_recording_may_lack_conditions() -> None:
    speed = sensor("v", quantity="speed", unit="m/s", position=None, direction=None)
    heat = sensor("t", quantity="temperature", unit="degC", position=None, direction=None)
    assert with_layout(recorded(Channel("a")), [sensor("a"), speed, heat]).names == ("a",)


def test_channels_left_out_by_choice_are_not_missing_unless_one_looks_like_them() -> None:
    sensors = [sensor("acc_fl"), sensor("acc_fr")]
    check_present(["acc_fl", "speed"], sensors, is_choice=True)
    with pytest.raises(ParameterError, match=r"acc_fr \(did you mean 'AccFR'\?\)"):
        check_present(["acc_fl", "AccFR"], sensors, is_choice=True)


def test_notes_name_what_is_missing_and_what_is_left_over() -> None:
    """Speed, whatever its case, and temperatures are used although no sensor names them."""
    car = read_vehicle("zafira")
    names = ("acc_fl", "acc_fr", "ACC_RL", "throttle", "Speed", "oil")
    kinds = ("unknown",) * 5 + ("temperature",)
    run = recorded(*(Channel(name, kind) for name, kind in zip(names, kinds, strict=True)))
    assert layout_notes(run, car) == (
        "missing sensors, which the vehicle file names: acc_rl (did you mean 'ACC_RL'?), acc_rr",
        "left-over channels, which the vehicle file does not name: ACC_RL, throttle",
    )
    complete = recorded(*(Channel(one.channel) for one in car.sensor))
    assert layout_notes(complete, car) == ()
    assert layout_notes(run, car.model_copy(update={"sensor": ()})) == ()
