"""Each condition of a drive against what it states."""

import json
import math
from functools import partial
from typing import Any, cast

import numpy as np
import pytest
from scipy.signal import welch

from sprung.diagnosis import observe_window
from sprung.errors import ParameterError
from sprung.excitation import Potholes, constant_speed
from sprung.simulation import (
    REALISTIC_SUSPENSION,
    Deviations,
    Driving,
    ForceLaw,
    PartScatter,
    Payload,
    RailDrive,
    RigRun,
    RoadConditions,
    RoadDrive,
    SensorErrors,
    SuspensionConditions,
    Wear,
    WheelOrders,
    damping_factor,
    held,
    mems_accelerometers,
    rail_force_laws,
    simulate_drive,
)
from sprung.vehicles import (
    Component,
    FlexibleMode,
    MountedMass,
    Sensor,
    frequency_response,
    parse_fault,
    read_vehicle,
    structure,
)

ENGINE = MountedMass(mass=110.0, x=0.9, frequency=11.0, damping_ratio=0.08)
TORSION = FlexibleMode(shape="torsion", frequency=24.0, damping_ratio=0.03)
#: Every condition alone, and all of them together.
CONDITIONS: dict[str, dict[str, Any]] = {
    "payload": {"payload": (Payload(80.0, -0.9, -0.4), Payload(30.0, 1.0, 0.3))},
    "right track": {"road": RoadConditions(right_rougher_db=2.5)},
    "potholes": {"road": RoadConditions("A", Potholes(per_kilometre=20.0, side="left"))},
    "driving": {"driving": Driving(braking=3.0, cornering=3.0, cross_slope=0.03)},
    "wheels": {"wheel_orders": WheelOrders(unbalance=2e-3, run_out=(3e-4, 1e-4))},
    "values": {"deviations": Deviations(values={"mass": 0.07, "roll_inertia": -0.1})},
    "engine": {"deviations": Deviations(mounted_masses=(ENGINE,))},
    "torsion": {"deviations": Deviations(flexible_modes=(TORSION,))},
    "scatter": {"deviations": Deviations(scatter=PartScatter())},
    "wear": {"deviations": Deviations(wear=(Wear(Component("rear_left", "damper"), -0.05),), n_drives=10)},
    "places": {"deviations": Deviations(sensors=SensorErrors(places=0.1))},
    "tilt": {"deviations": Deviations(sensors=SensorErrors(tilt=0.2))},
    "gains": {"deviations": Deviations(sensors=SensorErrors(gain=0.05, lag=0.01))},
    "tyres": {"suspension": SuspensionConditions(tyre_temperature=50.0)},
    "noise": {"imperfections": mems_accelerometers(noise_density=1e-2)},
    "two faults": {"faults": (parse_fault("front_left.spring=-0.2"), parse_fault("rear_right.damper=-0.2"))},
}
ALL: dict[str, Any] = {
    **CONDITIONS["payload"],
    **CONDITIONS["driving"],
    **CONDITIONS["wheels"],
    **CONDITIONS["noise"],
    **CONDITIONS["two faults"],
    "road": RoadConditions("C", Potholes(side="right"), right_rougher_db=1.0),
    "suspension": REALISTIC_SUSPENSION,
    "deviations": Deviations(
        values={"mass": 0.07, "pitch_inertia": 0.1, "roll_inertia": -0.1},
        mounted_masses=(ENGINE,),
        flexible_modes=(TORSION,),
        scatter=PartScatter(),
        sensors=SensorErrors(places=0.05, tilt=0.035, gain=0.01, lag=0.002),
        individual=3,
    ),
    "imperfections": (*mems_accelerometers(), partial(held, channel="speed", rate=1.0, delay=1.0)),
}


def drive(car, *, seed=1, duration=20.0, **settings):
    return simulate_drive(car, RoadDrive(duration=duration, **settings), seed=seed)


@pytest.fixture(scope="module")
def plain(hatchback):
    return drive(hatchback)


@pytest.mark.parametrize("name", CONDITIONS)
def test_each_condition_alone_changes_the_drive(hatchback, plain, name):
    changed = drive(hatchback, **CONDITIONS[name])
    before, after = plain.recording.samples[:4], changed.recording.samples[:4]
    assert np.abs(after - before).max() > 0.02 * before.std()
    json.dumps(changed.truth, allow_nan=False)
    conditions = {key: changed.truth["conditions"][key] for key in plain.truth["conditions"]}
    assert conditions != plain.truth["conditions"] or name == "two faults"
    assert changed.recording.channels == plain.recording.channels  # as the file has them


def test_all_conditions_together(other_car):
    run = drive(other_car, **ALL)
    json.dumps(run.truth, allow_nan=False)
    assert np.all(np.isfinite(run.recording.samples))
    assert run.truth["faults"] == {"front_left.spring": -0.2, "rear_right.damper": -0.2}
    again = drive(other_car, **ALL)
    assert np.array_equal(run.recording.samples, again.recording.samples)


def test_conditions_leave_the_road_as_it_is(hatchback):
    """What a condition draws is drawn apart, so that its effect is the difference of two drives."""
    plain, curved = drive(hatchback), drive(hatchback, driving=Driving(cornering=1e-6))
    np.testing.assert_allclose(curved.recording.samples, plain.recording.samples, rtol=0, atol=1e-5, equal_nan=False)


def test_payload_shifts_the_centre_of_gravity(hatchback):
    masses = (Payload(80.0, -0.9, -0.4), Payload(20.0, 1.0, 0.5))
    body = drive(hatchback, duration=2.0, payload=masses).truth["conditions"]["body"]
    assert body["mass"] == pytest.approx(980.0)
    assert (body["x"], body["y"]) == pytest.approx(((-72 + 20) / 980, (-32 + 10) / 980))
    assert body["product_of_inertia"] == pytest.approx(-(80 * 0.9 * 0.4 + 20 * 1.0 * 0.5))
    assert body["pitch_inertia"] == pytest.approx(1120 + 80 * 0.81 + 20)


def test_right_wheels_move_more_by_the_stated_level(hatchback):
    """At the wheels, whose motion is that of their own track: sensors on them, on a road without coherence loss."""
    sensors = tuple(
        Sensor(channel=corner, quantity="acceleration", unit="m/s^2", on=f"wheel_front_{corner}")
        for corner in ("left", "right")
    )
    car = hatchback.model_copy(update={"sensor": sensors})
    run = drive(car, duration=120.0, road=RoadConditions(right_rougher_db=6.0), speed=(15.0, 15.0)).recording
    f, density = welch(run.samples[:2], run.sampling_rate, nperseg=1024)
    inside = (f > 30) & (f < 60)  # above wheel hop tracks and sides of the vehicle are independent
    assert 10 * np.log10(density[1, inside].sum() / density[0, inside].sum()) == pytest.approx(6.0, abs=0.6)


@pytest.mark.slow
def test_unbalanced_wheels_turn_at_speed_over_circumference(hatchback):
    """A line at v / (2 pi R) and at its double, with the amplitude of the response to the stated motion."""
    orders = WheelOrders(run_out=(1e-3, 5e-4), radius=0.3)
    settings: Any = {"speed": (15.0, 15.0), "duration": 60.0, "road": RoadConditions("A")}
    run = drive(hatchback, wheel_orders=orders, **settings)
    difference = run.recording.samples[:4] - drive(hatchback, **settings).recording.samples[:4]
    facts = run.truth["conditions"]["wheel_orders"]
    assert {corner: len(lines) for corner, lines in facts.items()} == dict.fromkeys(facts, 2)
    time = np.arange(difference.shape[1]) / run.recording.sampling_rate
    expected = np.zeros_like(difference)
    for wheel, lines in enumerate(facts.values()):
        for line in lines:
            frequency = 15.0 * line["order"]
            assert frequency == pytest.approx(15 / (2 * math.pi * 0.3) * round(line["order"] * 1.885), rel=0.01)
            response = frequency_response(structure(hatchback), [frequency])[0, :, wheel]
            wave = line["amplitude"] * np.exp(1j * (2 * np.pi * frequency * time + line["phase"]))
            expected += (response[:, None] * wave).imag
    inner = slice(200, -200)
    assert difference[:, inner] == pytest.approx(expected[:, inner], abs=0.01 * np.abs(expected).max())


def test_a_flat_drops_the_wheel_as_it_pivots_about_its_ends() -> None:
    """(l / 2 - |x|)^2 / (2 R) from the middle of the flat, once in a turn, but for its mean and all above 400 Hz."""
    metro, flat, radius = read_vehicle("metro"), 0.3, 0.4
    orders = WheelOrders(radius=radius, flat=flat, wheels=("bogie1_rear_left",))
    lines = orders.lines(metro, constant_speed(5.0), np.random.default_rng(1))
    time = np.arange(0, 4.0, 1e-4)
    moved = np.sum([line.at(time, np.random.default_rng(0)) for line in lines], axis=0)
    assert np.flatnonzero(moved.any(axis=1)).tolist() == [2]
    drop, turn = moved[2], 1 / next(line.orders[0] for line in lines if len(line.orders) > 1)
    assert turn == pytest.approx(2 * math.pi * radius, rel=0.01)
    deepest = time[np.argmin(drop[: round(turn / 5.0 * 1e4)])] * 5.0
    x = (5.0 * time - deepest + turn / 2) % turn - turn / 2
    expected = -(np.maximum(flat / 2 - np.abs(x), 0) ** 2) / (2 * radius)
    assert np.ptp(drop) == pytest.approx(flat**2 / (8 * radius), rel=0.03)
    assert drop - drop.mean() == pytest.approx(expected - expected.mean(), abs=0.03 * np.ptp(expected))


@pytest.mark.slow
def test_the_soft_spring_of_a_bogie_that_slides_is_the_softest_in_a_linear_fit() -> None:
    """Friction of a tenth of the load reads as damping: more than the file's, as the truth's equivalent is."""
    y25 = read_vehicle("y25")
    y25 = y25.model_copy(update={"kind": "rail", "sensor": y25.sensor[:4]})
    drive = RailDrive(
        duration=120.0,
        sampling_rate=100.0,
        snr=50.0,
        suspension=SuspensionConditions(force_laws=rail_force_laws(y25)),
        faults=(parse_fault("rear_left.spring=-0.2"),),
    )
    simulated = simulate_drive(y25, drive, seed=4)
    equivalents = simulated.truth["conditions"]["suspension"]["equivalents"]
    assert equivalents["rear_left.spring"] == pytest.approx(0.8 * 2.44e6, rel=0.02)
    assert equivalents["front_right.damper"] > 1.5 * 3000
    window = observe_window(simulated.recording, y25)
    springs = [row for row, part in enumerate(window.components) if part.kind == "spring"]
    softest = springs[int(np.argmin(window.log_ratios[springs]))]
    assert str(window.components[softest]) == "rear_left.spring"
    dampers = [row for row, part in enumerate(window.components) if part.kind == "damper"]
    assert np.mean(window.log_ratios[dampers]) > 0.2


def test_unbalance_grows_with_the_square_of_the_speed(hatchback):
    lines = WheelOrders(unbalance=2e-3, radius=0.3).lines(hatchback, constant_speed(20.0), np.random.default_rng(1))
    motion = lines[0].samples(4000, sampling_rate=1000.0, generator=np.random.default_rng(0))
    stiffness = hatchback.axle[0].tyre_stiffness
    size = np.abs(motion[0]).max() * stiffness / (2e-3 * (20.0 / 0.3) ** 2)
    assert 0.3 <= size <= 1.7
    assert size * 2e-3 * (10 / 0.3) ** 2 / stiffness == pytest.approx(lines[0].amplitudes[0], rel=1e-3)


@pytest.mark.parametrize(
    ("without", "settings", "message"),
    [
        (
            {"tyre_stiffness": None, "unsprung_mass": None},
            {"wheel_orders": WheelOrders(unbalance=1e-3)},
            "has no tyres that could be unbalanced",
        ),
        ({}, {"faults": (parse_fault("front_left.wing=-0.2"),)}, r"component 'front_left.wing' is not one of"),
    ],
)
def test_what_the_vehicle_lacks_is_refused(hatchback, without, settings, message):
    axles = tuple(axle.model_copy(update=without) for axle in hatchback.axle)
    with pytest.raises(ParameterError, match=message):
        drive(hatchback.model_copy(update={"axle": axles}), **settings)


def test_braking_decelerates_and_pitches(hatchback):
    """Slow longitudinal acceleration makes the pitch of statics, which a horizontal sensor reads with gravity."""
    sensors = (
        Sensor(channel="acc_x", quantity="acceleration", unit="m/s^2", position=(0.0, 0.0, 0.0), direction=(1, 0, 0)),
        Sensor(channel="pitch", quantity="angle", unit="rad", direction=(0, 1, 0)),
    )
    car = hatchback.model_copy(update={"sensor": sensors})
    driving = Driving(braking=4.0, height=0.6)
    run = drive(car, duration=200.0, driving=driving, road=RoadConditions("A"), seed=4)
    acc_x, pitch, speed = run.recording.samples
    longitudinal = np.gradient(speed) * run.recording.sampling_rate
    assert longitudinal.min() < -2.0
    rotation = structure(car).coordinates.index("pitch")
    stiffness = 1 / np.linalg.inv(structure(car).system.stiffness)[rotation, rotation]
    window = np.ones(200) / 200
    smooth = [np.convolve(values, window, mode="valid") for values in (acc_x, pitch, longitudinal)]
    static = 880 * 0.6 / stiffness
    assert np.polyfit(smooth[2], smooth[1], 1)[0] == pytest.approx(-static, rel=0.05)
    assert np.polyfit(smooth[2], smooth[0], 1)[0] == pytest.approx(1 + 9.81 * static, rel=0.02)
    assert run.truth["conditions"]["driving"]["height"] == 0.6


def test_the_height_of_the_vehicle_file_counts(hatchback):
    tall = hatchback.model_copy(update={"body": hatchback.body.model_copy(update={"height": 0.9})})
    for car, height in ((tall, 0.9), (hatchback, 0.55)):
        truth = drive(car, duration=2.0, driving=Driving(cornering=1.0)).truth
        assert truth["conditions"]["driving"]["height"] == height


def test_a_slope_is_read_as_roll(hatchback):
    sensors = (
        Sensor(channel="roll", quantity="angle", unit="rad", direction=(1, 0, 0)),
        Sensor(channel="acc_y", quantity="acceleration", unit="m/s^2", position=(0.0, 0.0, 0.0), direction=(0, 1, 0)),
    )
    car = hatchback.model_copy(update={"sensor": sensors})
    run = drive(car, duration=120.0, driving=Driving(cross_slope=0.05), road=RoadConditions("A"))
    roll, acc_y = (np.convolve(values, np.ones(400) / 400, mode="valid") for values in run.recording.samples[:2])
    assert 0.03 < np.abs(roll).max() < 0.08  # the slope, and the body's lean down it
    assert acc_y == pytest.approx(9.81 * roll, abs=0.02)


def test_the_speed_is_late_and_held(hatchback):
    settings: Any = {"duration": 120.0, "driving": Driving(braking=4.0)}
    true = drive(hatchback, **settings).recording.samples[4]
    late = drive(hatchback, **settings, imperfections=(partial(held, channel="speed", rate=1.0, delay=1.0),))
    values = late.recording.samples[4]
    assert np.unique(values).size <= 121
    assert np.all(np.ptp(values.reshape(-1, 200), axis=1) == 0)
    lags = np.arange(0, 600)
    errors = [np.mean((values[600:] - true[600 - lag : true.size - lag]) ** 2) for lag in lags]
    assert lags[np.argmin(errors)] / 200 == pytest.approx(1.5, abs=0.05)


def test_temperatures_change_dampers_and_tyres(hatchback):
    cold, hot = (
        drive(
            hatchback, duration=2.0, suspension=SuspensionConditions(temperature=degrees, tyre_temperature=degrees)
        ).truth["components"]["rear_left"]
        for degrees in (20.0, 50.0)
    )
    assert hot["damper"]["value"] / cold["damper"]["value"] == pytest.approx(math.exp(-0.15))
    # gauge pressure 2.2 bar and 1.013 bar outside, in proportion to 293 and 323 K
    assert hot["tyre"]["value"] / cold["tyre"]["value"] == pytest.approx(
        1 + 0.8 * (3.213 * 323.15 / 293.15 - 3.213) / 2.2
    )
    assert hot["spring"] == cold["spring"]


def test_conditions_are_recorded_where_the_file_has_their_sensors(hatchback):
    sensors = (
        *hatchback.sensor,
        Sensor(channel="ambient", quantity="temperature", unit="degC"),
        Sensor(channel="tyre_temperature", quantity="temperature", unit="degC", on="wheel_front_left"),
        Sensor(channel="pressure_fl", quantity="pressure", unit="bar", on="wheel_front_left"),
        Sensor(channel="pressure_rr", quantity="pressure", unit="bar", on="wheel_rear_right"),
        Sensor(channel="speed_fl", quantity="speed", unit="m/s", on="wheel_front_left"),
        Sensor(channel="turns_rr", quantity="wheel_speed", unit="rad/s", on="wheel_rear_right"),
    )
    axles = tuple(axle.model_copy(update={"rolling_radius": 0.3}) for axle in hatchback.axle)
    car = hatchback.model_copy(update={"sensor": sensors, "axle": axles})
    run = drive(
        car,
        duration=60.0,
        driving=Driving(cornering=3.0),
        faults=(parse_fault("front_left.tyre=-0.2"),),
        suspension=SuspensionConditions(temperature=35.0, tyre_temperature=20.0),
    ).recording
    values = dict(zip(run.names, run.samples, strict=True))
    assert values["ambient"] == pytest.approx(35.0)
    assert values["tyre_temperature"] == pytest.approx(20.0)
    assert values["pressure_fl"] == pytest.approx(2.2e5 * 0.75)  # four fifths of the stiffness follow the pressure
    assert values["pressure_rr"] == pytest.approx(2.2e5)
    left, right = values["speed_fl"] - values["speed"], values["turns_rr"] * 0.3 - values["speed"]
    assert np.abs(left).max() > 0.05
    assert left / 0.63 == pytest.approx(-right / 0.6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: Driving(braking=20.0), "braking=20 must be at least 0 and at most 10"),
        (lambda: Driving(height=0.0), "height=0 must be above 0"),
        (lambda: WheelOrders(unbalance=-1.0), "unbalance=-1 must be at least 0"),
        (lambda: RoadConditions(right_rougher_db=30.0), "right_rougher_db=30 must be at least -20 and at most 20"),
        (lambda: Payload(80.0, math.nan, 0.0), "x of the payload=nan must be finite"),
        (lambda: Payload(-1.0), "mass of the payload=-1 must be at least 0"),
        (lambda: mems_accelerometers(bits=0), "bits=0 must be at least 1"),
        (lambda: RoadConditions("K"), "road class 'K' is not one of A, B"),
        (lambda: RigRun(driven=cast("Any", "rear")), "driven 'rear' is not one of all, front"),
        (lambda: RigRun(wheel_orders=WheelOrders()), "wheel_orders are for drives on a road or a track"),
        (lambda: damping_factor(300.0), "temperature=300 must be"),
        (lambda: ForceLaw(asymmetry=1.5), "asymmetry=1.5 must be"),
        (lambda: ForceLaw(friction=-1.0), "friction=-1 must be"),
        (lambda: ForceLaw(friction_velocity=0.0), "friction_velocity=0 must be"),
    ],
)
def test_impossible_conditions_are_refused(call, message):
    with pytest.raises(ParameterError, match=message):
        call()
