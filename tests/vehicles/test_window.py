"""A recording as a window of its vehicle: sensors placed once, speed, conditions, usable motion."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.errors import DataError, ParameterError
from sprung.recording import Channel, Recording
from sprung.vehicles import Sensor, Vehicle, read_vehicle
from sprung.vehicles.sensor_layout import usable
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


@pytest.mark.parametrize(
    ("factor", "offset", "unit", "is_noted"),
    [
        (1.0, 0.0, "unknown", False),
        (1.0, 9.81, "unknown", False),
        (0.05, 0.0, "unknown", True),  # in g
        (0.3, 1.0, "unknown", True),  # in g, with gravity
        (300.0, 0.0, "unknown", True),  # counts
        (0.05, 0.0, "acceleration", False),  # stated: a smooth ride
    ],
)
def test_accelerations_without_unit_that_are_hardly_in_si_are_noted(factor, offset, unit, is_noted) -> None:
    car = read_vehicle("zafira")
    names = [sensor.channel for sensor in car.sensor]
    shaken = offset + factor * np.random.default_rng(1).standard_normal((len(names), 1000))
    samples = np.vstack([shaken, np.repeat([0.0, 12.0], [700, 300])])
    samples[:-1, :700] = offset
    channels = (*(Channel(name, unit) for name in names), Channel("speed", "speed"))
    notes = window_of(Recording(samples, 100.0, channels), car).notes
    assert any("no unit is stated" in note for note in notes) == is_noted


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


@pytest.mark.parametrize(
    ("channel", "mileage"),
    [
        (Channel("Odometer", "distance"), 154_321.7),
        (Channel("Vehicle.TraveledDistance", "distance"), 154_321.7),
        (Channel("range_left", "distance"), None),
        (Channel("odometer"), None),  # of an unknown unit
    ],
)
def test_the_mileage_is_the_last_reading_of_an_odometer(car, run, channel, mileage) -> None:
    readings = np.full(run.n_samples, np.nan)
    readings[::100] = np.linspace(154_320.0e3, 154_321.7e3, readings[::100].size)
    with_odometer = replace(run, samples=np.vstack([run.samples, readings]), channels=(*run.channels, channel))
    assert window_of(with_odometer, car).conditions.get("mileage") == (mileage and pytest.approx(mileage, rel=1e-12))


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
    assert "speed times 1.1, advanced by 0.505 s" in window.recording.history


def test_a_window_says_what_its_recording_lacks(car, run) -> None:
    with pytest.raises(ParameterError, match="lacks 1 of the vehicle file's 5 sensors: acc_rr "):
        window_of(run.select([name for name in run.names if name != "acc_rr"]), car)
    part = run.select([name for name in run.names if name not in {"acc_rr", "yaw_rate"}])
    window = window_of(part, car, allow_missing=True)
    assert window.missing == ("acc_rr", "yaw_rate")
    assert window.notes == (
        "missing sensors, which the vehicle file names: acc_rr, yaw_rate",
        "left-over channels, which the vehicle file does not name: other",
    )
    assert window.recording.history[-2:] == window.notes
    assert usable(part, vehicle=car, allow_missing=True).history[-3:-1] == window.notes
    with pytest.raises(ParameterError, match="lacks 2 of"):
        usable(part, vehicle=car)


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


CORNERS = ("front_left", "front_right", "rear_left", "rear_right")


def on_wheels(car, quantity, unit):
    """A sensor on every wheel, and axles of known rolling radius."""
    axles = tuple(axle.model_copy(update={"rolling_radius": 0.3}) for axle in car.axle)
    sensors = tuple(Sensor(channel=name, quantity=quantity, unit=unit, on=f"wheel_{name}") for name in CORNERS)
    return car.model_copy(update={"axle": axles, "sensor": (*car.sensor, *sensors)})


@pytest.mark.parametrize(
    ("quantity", "unit", "factor"), [("wheel_speed", "rpm", np.pi / 30 * 0.3), ("speed", "m/s", 1.0)]
)
def test_wheels_give_the_speed_where_there_is_no_other(car, run, quantity, unit, factor) -> None:
    """Two wheels outside and two inside a bend, and one of them fails: the speed is that of the others' middle."""
    vehicle = on_wheels(car, quantity, unit)
    samples = np.vstack([run.samples[:5], np.outer([90.0, 110.0, 90.0, 110.0], np.ones(1000))])
    samples[8, 600:] = 0.0
    samples[5:, 700:] = np.nan
    wheels = replace(run, samples=samples, channels=(*run.channels[:5], *map(Channel, CORNERS)))
    window = window_of(wheels, vehicle)
    speed = window.recording.samples[window.recording.index("speed")]
    assert window.speed == "speed"
    assert speed[:600] == pytest.approx(np.full(600, 100 * factor))
    assert speed[600:700] == pytest.approx(np.full(100, 90 * factor))
    assert np.isnan(speed[700:]).all()
    assert window.outputs == run.names[:5]
    assert "speed of 4 wheels" in window.recording.history
    with_speed = (*wheels.channels, Channel("speed", "speed"))
    known = replace(wheels, samples=np.vstack([samples, np.full(1000, 7.0)]), channels=with_speed)
    assert window_of(known, vehicle).conditions["speed"] == pytest.approx(7.0)


def test_temperatures_are_those_of_dampers_before_ambient(car, run) -> None:
    """Means over the four dampers; tyres have conditions of their own, in SI units."""
    damper = [Sensor(channel=f"damper_{k}", quantity="temperature", unit="degC", between=CORNERS[k]) for k in range(2)]
    tyre = [Sensor(channel="tyre", quantity="temperature", unit="degC", on="wheel_front_left")]
    pressure = [Sensor(channel=f"p_{k}", quantity="pressure", unit="bar", on=f"wheel_{CORNERS[k]}") for k in range(2)]
    vehicle = car.model_copy(update={"sensor": (*car.sensor, *damper, *tyre, *pressure)})
    values = np.outer([40.0, 50.0, 35.0, 2.2, 2.4], np.ones(1000))
    names = ("damper_0", "damper_1", "tyre", "p_0", "p_1")
    more = replace(run, samples=np.vstack([run.samples, values]), channels=(*run.channels, *map(Channel, names)))
    conditions = window_of(more, vehicle).conditions
    assert conditions["temperature"] == pytest.approx(45.0)
    assert conditions["tyre_temperature"] == pytest.approx(35.0)
    assert conditions["tyre_pressure"] == pytest.approx(2.3e5)
    assert window_of(more, vehicle).outputs == window_of(run, car).outputs


def test_wheels_and_tyres_are_known_by_their_names(car, run) -> None:
    """Two wheels at 10 and 14 m/s; the temperature of a tyre is not that of the air."""
    wheel = "Vehicle.Chassis.Axle.Row1.Wheel.{}"
    names = {f"{wheel.format('Left')}.Speed": "speed", f"{wheel.format('Right')}.Speed": "speed"}
    names |= {
        f"{wheel.format('Left')}.Tire.Temperature": "temperature",
        f"{wheel.format('Left')}.Tire.Pressure": "pressure",
    }
    channels = (*run.channels[:5], *(Channel(name, quantity) for name, quantity in names.items()))
    values = np.outer([10.0, 14.0, 35.0, 2.2e5], np.ones(1000))
    window = window_of(replace(run, samples=np.vstack([run.samples[:5], values]), channels=channels), car)
    assert window.speed == "speed"
    assert window.conditions == {
        "speed": pytest.approx(12.0),
        "standing": 0.0,
        "turning": window.conditions["turning"],
        "tyre_temperature": pytest.approx(35.0),
        "tyre_pressure": pytest.approx(2.2e5),
    }
    assert window.notes == ()


def test_a_speed_of_another_quantity_is_refused_and_one_in_other_units_noted(car, run) -> None:
    """A recording in m/s^2, and one in km/h without its unit, were taken as m/s without a word."""
    row = run.index("Speed")

    def with_speed(quantity: str, factor: float) -> Recording:
        samples = run.samples.copy()
        samples[row] *= factor
        channels = tuple(Channel("Speed", quantity) if k == row else own for k, own in enumerate(run.channels))
        return replace(run, samples=samples, channels=channels)

    with pytest.raises(ParameterError, match="channel 'Speed' is acceleration in the recording, not a speed"):
        window_of(with_speed("acceleration", 1.0), car)
    assert window_of(with_speed("unknown", 1.0), car).notes == window_of(run, car).notes
    assert any("taken in m/s, 156 km/h" in note for note in window_of(with_speed("unknown", 3.6), car).notes)


def test_a_gap_of_a_channel_is_filled_by_what_the_others_imply(car, run) -> None:
    """Exact for a rigid body, whichever of four sensors is missing and whatever offset each has."""
    own = with_rigid_motion(run, car)
    samples = own.samples.copy()
    for row in range(4):
        samples[row, 300 + 100 * row : 380 + 100 * row] = np.nan
    motion = window_of(replace(own, samples=samples), car).motion
    assert motion.gaps == ()
    whole = window_of(own, car).motion
    assert motion.samples == pytest.approx(whole.samples, abs=1e-9)
    samples[:2, 900:950] = np.nan  # two at once are implied by nothing
    assert window_of(replace(own, samples=samples), car).motion.n_samples == whole.n_samples - 50


def test_a_gap_of_a_body_that_twists_is_not_filled(car, run) -> None:
    own = with_rigid_motion(run, car)
    samples = own.samples.copy()
    samples[:4] += 0.5 * np.outer([1, -1, -1, 1], np.random.default_rng(3).standard_normal(1000))
    samples[0, 300:500] = np.nan
    assert window_of(replace(own, samples=samples), car).motion.n_samples == 550


def test_a_channel_that_is_mostly_missing_is_not_filled(car, run) -> None:
    own = with_rigid_motion(run, car)
    samples = own.samples.copy()
    samples[0, 300:900] = np.nan
    assert window_of(replace(own, samples=samples), car).motion.n_samples == 150


def test_some_outputs_are_not_interrupted_by_gaps_of_others(car, run) -> None:
    own = with_rigid_motion(run, car)
    samples = own.samples.copy()
    samples[4, 300:900] = np.nan
    window = window_of(replace(own, samples=samples), car)
    assert window.motion.n_samples == 150
    assert window.motion_of(window.outputs[:4]).n_samples == 750


def with_rigid_motion(run: Recording, car: Vehicle) -> Recording:
    """Return the run with accelerometers that read bounce, pitch and roll of the body and offsets of their own."""
    bounce, pitch, roll = np.random.default_rng(2).standard_normal((3, run.n_samples))
    samples = run.samples.copy()
    for row, sensor in enumerate(car.sensor[:4]):
        x, y, _ = sensor.position or (0.0, 0.0, 0.0)
        samples[row] = (bounce - x * pitch + y * roll + 0.1 * row) / (9.80665 if sensor.unit == "g" else 1.0)
    return replace(run, samples=samples)
