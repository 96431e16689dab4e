"""The true vehicle against its file."""

import math

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.simulation import Deviations, PartScatter, SensorErrors, Wear, true_vehicle
from sprung.vehicles import Component, FlexibleMode, MountedMass, Vehicle, structure


def channels(vehicle):
    """Return the channels of the sensors."""
    return structure(vehicle).outputs.channels


def keywords(imperfections):
    """Return the options of each imperfection."""
    return [part.keywords for part in imperfections]


def test_without_deviations_the_vehicle_is_the_same(other_car):
    same = structure(true_vehicle(other_car, Deviations()))
    nominal = structure(other_car)
    assert np.array_equal(same.mass, nominal.mass)
    assert np.array_equal(same.outputs.acceleration, nominal.outputs.acceleration)
    assert same.components() == nominal.components()


def test_values_differ_by_their_share(other_car):
    values = {"mass": 0.07, "pitch_inertia": -0.1, "roll_inertia": 0.1, "wheelbase": 0.02, "track": -0.01}
    true = true_vehicle(other_car, Deviations(values=values | {"unsprung_mass": 0.2}))
    body = other_car.body
    assert true.body.mass == pytest.approx(1.07 * body.mass)
    assert (true.body.pitch_inertia, true.body.roll_inertia) == pytest.approx(
        (0.9 * body.pitch_inertia, 1.1 * body.roll_inertia)
    )
    for axle, nominal in zip(true.axle, other_car.axle, strict=True):
        assert (axle.x, axle.half_track) == pytest.approx((1.02 * nominal.x, 0.99 * nominal.half_track))
        assert axle.unsprung_mass == pytest.approx(1.2 * nominal.unsprung_mass)
        assert axle.spring_stiffness == nominal.spring_stiffness
    assert true.sensor == other_car.sensor


def test_estimated_inertias_stay_where_only_the_mass_differs(hatchback):
    fields = hatchback.model_dump() | {"body": {"mass": 880.0}}
    estimated = Vehicle.model_validate(fields)
    heavier = true_vehicle(estimated, Deviations(values={"mass": 0.1}))
    assert heavier.inertias == pytest.approx(estimated.inertias)
    assert heavier.body.mass == pytest.approx(968.0)


def test_mounted_masses_and_flexible_modes_are_added(hatchback):
    engine = MountedMass(mass=120.0, x=0.9, frequency=12.0, damping_ratio=0.1)
    torsion = FlexibleMode(shape="torsion", frequency=25.0, damping_ratio=0.03)
    true = structure(true_vehicle(hatchback, Deviations(mounted_masses=(engine,), flexible_modes=(torsion,))))
    assert true.coordinates[-2:] == ("mounted_mass_1", "torsion")
    frequencies = true.modes().natural_frequency
    assert np.abs(frequencies - 12.0).min() < 1.5
    assert np.abs(frequencies - 25.0).min() < 2.0


def test_scatter_of_parts_has_its_standard_deviations(hatchback):
    vehicle = structure(hatchback)
    logs: dict[str, list[float]] = {kind: [] for kind in ("spring", "damper", "tyre")}
    for number in range(400):
        for part, factor in Deviations(scatter=PartScatter(), individual=number).factors(vehicle).items():
            logs[part.kind].append(math.log(factor))
    for kind, std in (("spring", 0.04), ("damper", 0.05), ("tyre", 0.03)):
        assert len(logs[kind]) == 1600
        assert np.std(logs[kind]) == pytest.approx(std, rel=0.06)
        assert np.mean(logs[kind]) == pytest.approx(0, abs=3 * std / 40)


def test_an_individual_is_the_same_on_all_its_drives(hatchback):
    one, again, other = (
        Deviations(scatter=PartScatter(), sensors=SensorErrors(tilt=0.03), individual=number) for number in (5, 5, 6)
    )
    vehicle = structure(hatchback)
    assert one.factors(vehicle) == again.factors(vehicle) != other.factors(vehicle)
    assert true_vehicle(hatchback, one) == true_vehicle(hatchback, again) != true_vehicle(hatchback, other)


def test_wear_is_compound():
    wear = Wear(Component("rear_left", "damper"), -0.01)
    assert wear.fault(30).change == pytest.approx(-0.2603, abs=5e-5)
    assert Deviations(wear=(wear,), n_drives=1).worn[0].change == pytest.approx(-0.01)
    assert Deviations(wear=(wear,)).worn[0].change == 0


def test_sensors_are_as_far_off_and_tilted_as_stated(other_car):
    errors = SensorErrors(places=0.05, tilt=math.radians(2), moved={"acc_rl": (0.3, 0.0, -0.1)})
    true = true_vehicle(other_car, Deviations(sensors=errors))
    for sensor, nominal in zip(channels(true), channels(other_car), strict=True):
        moved = (0.3, 0.0, -0.1) if sensor.name == "acc_rl" else (0.0, 0.0, 0.0)
        offset = np.subtract(sensor.position, nominal.position) - moved
        assert math.hypot(*offset) == pytest.approx(0.05)
        assert offset[2] == pytest.approx(0)
        assert np.dot(sensor.direction, nominal.direction) == pytest.approx(math.cos(math.radians(2)))
        assert math.hypot(*sensor.direction) == pytest.approx(1)
    directions = [np.arctan2(sensor.direction[1], sensor.direction[0]) for sensor in channels(true)]
    assert np.ptp(directions) > 0.5  # about axes of their own


def test_gains_and_lags_become_imperfections(hatchback):
    none = Deviations().sensor_imperfections(hatchback)
    assert none == ()
    deviations = Deviations(sensors=SensorErrors(gain=0.02, lag=0.004))
    imperfections = deviations.sensor_imperfections(hatchback)
    factors = [options["factor"] for options in keywords(imperfections) if "factor" in options]
    delays = [options["delay"] for options in keywords(imperfections) if "delay" in options]
    assert (len(factors), len(delays)) == (4, 4)
    assert 0 < np.std(factors) < 0.06
    assert 0 <= min(delays) < max(delays) <= 0.004


def test_a_calibrated_file_describes_its_channels(hatchback):
    """A channel that the file scales and advances is recorded small and late."""
    sensors = (hatchback.sensor[0].model_copy(update={"scale": 1.25, "delay": 0.01}), *hatchback.sensor[1:])
    calibrated = hatchback.model_copy(update={"sensor": sensors, "speed_scale": 0.5, "speed_delay": 0.7})
    assert keywords(Deviations().sensor_imperfections(calibrated)) == [
        {"channel": "acc_fl", "factor": 0.8},
        {"channel": "speed", "factor": 2.0},
        {"channel": "acc_fl", "delay": 0.01},
        {"channel": "speed", "delay": 0.7},
    ]


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda car: Deviations(values={"colour": 0.1}), "value of the vehicle file 'colour' is not one of"),
        (lambda car: Deviations(values={"mass": -1.0}), "difference of mass=-1 must be above -0.9"),
        (lambda car: SensorErrors(tilt=4.0), "tilt=4 must be at least 0 and at most 1.5708"),
        (lambda car: PartScatter(spring=-0.1), "scatter of every spring=-0.1"),
        (lambda car: Wear(Component("front_left", "spring"), -1.0), "wear of front_left.spring=-1 must be above -1"),
        (
            lambda car: true_vehicle(car, Deviations(sensors=SensorErrors(moved={"nose": (0.1, 0.0, 0.0)}))),
            "moved sensor 'nose' is not one of acc_fl",
        ),
        (
            lambda car: true_vehicle(
                car.model_copy(
                    update={
                        "axle": tuple(axle.model_copy(update={"anti_roll_stiffness": 0.0}) for axle in car.axle),
                    }
                ),
                Deviations(values={"anti_roll_stiffness": 0.1}),
            ),
            "has no anti_roll_stiffness that could differ",
        ),
    ],
)
def test_impossible_deviations_are_refused(hatchback, call, message):
    with pytest.raises(ParameterError, match=message):
        call(hatchback)
