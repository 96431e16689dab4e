"""Vehicles on bogies: file, refusals, matrices and modes against energies, sensors against kinematics."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.likelihood import CornerSettings, fit_corners
from sprung.modal import Modes
from sprung.simulation import RailDrive, RigRun, RoadDrive, driven_structure, simulate_drive
from sprung.vehicles import (
    Vehicle,
    parse_fault,
    parse_vehicle,
    read_vehicle,
    structure,
    vehicle_from_text,
    vehicle_text,
    wheel_hop_frequencies,
)
from sprung.vehicles.labels import labelled

BOGIE = {
    "x": 7.2,
    "mass": 4800.0,
    "pitch_inertia": 3600.0,
    "roll_inertia": 3100.0,
    "half_wheelbase": 1.1,
    "half_spacing": [1.0, 0.95],
    "wheelset_mass": 1450.0,
    "primary_stiffness": 1.05e6,
    "primary_damping": 1.1e4,
    "secondary_stiffness": 2.9e5,
    "secondary_damping": 2.4e4,
    "anti_roll_stiffness": 1.2e6,
}
BODY = {"mass": 27000.0, "pitch_inertia": 850e3, "roll_inertia": 42e3}
LEVEL = {"quantity": "acceleration", "unit": "m/s^2", "direction": [0.0, 0.0, 1.0]}


def fields(rear=None, **changes):
    """Fields of a vehicle with two bogies, which differ in `rear`."""
    bogies = [BOGIE, BOGIE | {"x": -6.8} | (rear or {})]
    return {"name": "car", "kind": "rail", "body": BODY, "bogie": bogies} | changes


def vehicle(rear=None, **changes) -> Vehicle:
    """A vehicle with two bogies, which differ in `rear`."""
    parsed = parse_vehicle(fields(rear, **changes))
    assert isinstance(parsed, Vehicle)
    return parsed


AIR = {
    "pressure": 350e3,
    "area": 0.19,
    "area_rate": 0.05,
    "volume": 0.02,
    "reservoir_volume": 0.04,
    "pipe_damping": 9e4,
}
UNEVEN = {
    "mass": 3900.0,
    "half_wheelbase": 1.25,
    "half_spacing": [1.05, 0.9],
    "primary_stiffness": 8e5,
    "primary_damping": 7e3,
    "secondary_stiffness": 3.6e5,
    "secondary_damping": 1.9e4,
    "anti_roll_stiffness": 0.8e6,
    "wheelset_mass": 1600.0,
    "wheelset_roll_inertia": 1010.0,
    "contact_stiffness": 1.3e9,
    "contact_half_spacing": 0.76,
}


def plane(motions, x, y):
    """Height of the point (x, y) of a rigid body that rises, pitches nose down and rolls left side up."""
    bounce, pitch, roll = motions
    return bounce - x * pitch + y * roll


def energies(car: Vehicle, q, rails):
    """Twice the potential energy and, with rates for coordinates, twice kinetic energy and dissipation.

    `q` in the order body, then for each bogie frame and its two wheelsets; `rails` are the heights of the rails.
    """
    body, potential, dissipation, kinetic = q[:3], 0.0, 0.0, 0.0
    kinetic += car.body.mass * q[0] ** 2 + car.body.pitch_inertia * q[1] ** 2 + car.body.roll_inertia * q[2] ** 2
    for number, bogie in enumerate(car.bogie):
        at = 3 + 7 * number
        frame = q[at : at + 3]
        kinetic += bogie.mass * frame[0] ** 2 + bogie.pitch_inertia * frame[1] ** 2 + bogie.roll_inertia * frame[2] ** 2
        potential += bogie.anti_roll_stiffness * (body[2] - frame[2]) ** 2
        inner, outer = bogie.half_spacing
        for side in (1, -1):
            travel = plane(body, bogie.x, side * outer) - plane(frame, 0.0, side * outer)
            potential += bogie.secondary_stiffness * travel**2
            dissipation += bogie.secondary_damping * travel**2
        for which, ahead in enumerate((bogie.half_wheelbase, -bogie.half_wheelbase)):
            rise, roll = q[at + 3 + 2 * which : at + 5 + 2 * which]
            inertia = bogie.wheelset_roll_inertia or 0.786**2 * bogie.wheelset_mass
            kinetic += bogie.wheelset_mass * rise**2 + inertia * roll**2
            for row, side in enumerate((1, -1)):
                travel = plane(frame, ahead, side * inner) - (rise + side * inner * roll)
                potential += bogie.primary_stiffness * travel**2
                dissipation += bogie.primary_damping * travel**2
                dent = rise + side * bogie.contact_half_spacing * roll - rails[4 * number + 2 * which + row]
                potential += bogie.contact_stiffness * dent**2
    return potential, dissipation, kinetic


def hessian(function, n):
    """Second derivatives of half a quadratic form, by differences, which are exact for it."""
    unit = np.eye(n)
    own = [function(unit[i]) for i in range(n)]
    return np.array([[(function(unit[i] + unit[j]) - own[i] - own[j]) / 2 for j in range(n)] for i in range(n)])


@pytest.mark.parametrize("rear", [{}, UNEVEN], ids=["alike", "uneven"])
def test_matrices_and_poles_are_those_of_the_energies(rear) -> None:
    """Lagrange's equations of energies written down by themselves: poles agree to 1e-9."""
    car = vehicle(rear)
    system, n, still = structure(car).system, 17, np.zeros(8)
    assert system.n_coordinates == n
    K, C, M = (hessian(lambda q, which=which: energies(car, q, still)[which], n) for which in range(3))
    for ours, theirs in ((system.stiffness, K), (system.damping, C), (system.mass, M)):
        assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-12 * np.abs(theirs).max())
    state = np.block([[np.zeros((n, n)), np.eye(n)], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]])
    expected = np.linalg.eigvals(state)
    expected = expected[expected.imag > 1e-9 * np.abs(expected)]
    found = structure(car).modes().poles
    assert len(found) == len(expected)
    assert np.sort(np.abs(found)) == pytest.approx(np.sort(np.abs(expected)), rel=1e-9)
    errors = np.abs(found[:, None] - expected).min(axis=1) / np.abs(found)
    assert errors.max() < 1e-9


def test_rails_push_through_the_contacts() -> None:
    """Generalised forces are minus the derivative of the potential energy by the coordinates."""
    car = vehicle(UNEVEN)
    nominal = structure(car)
    assert nominal.inputs[:5] == (
        "road_bogie1_front_left",
        "road_bogie1_front_right",
        "road_bogie1_rear_left",
        "road_bogie1_rear_right",
        "road_bogie2_front_left",
    )
    unit = np.eye(17)
    for column, rails in enumerate(np.eye(8)):
        forces = [
            (energies(car, -q, rails)[0] - energies(car, q, rails)[0]) / 4 for q in unit
        ]  # central difference of a quadratic
        assert nominal.system.input_matrix[:, column] == pytest.approx(np.array(forces), rel=1e-9, abs=1e-3)


def test_places_of_the_wheels_and_their_hop() -> None:
    car = vehicle(UNEVEN)
    assert [wheel.x for wheel in car.wheels[::2]] == pytest.approx([8.3, 6.1, -5.55, -8.05])
    assert [wheel.y for wheel in car.wheels] == [0.75, -0.75] * 2 + [0.76, -0.76] * 2
    assert car.wheelbase == pytest.approx(16.35)
    hops = np.sqrt([(1.05e6 + 1e9) / 725] * 2 + [(8e5 + 1.3e9) / 800] * 2) / (2 * np.pi)
    assert wheel_hop_frequencies(car) == pytest.approx(hops)


def test_sensors_on_frames_and_wheelsets_read_the_motion_of_their_own_body() -> None:
    """By kinematics of rigid bodies: positions are relative to the centre of the body that carries the sensor."""
    gyro = {"channel": "gyro", "quantity": "angular_velocity", "unit": "rad/s", "direction": [0.0, 1.0, 0.0]}
    sensors = [
        {**LEVEL, "channel": "corner", "position": [1.1, -1.0, 0.3], "body": "bogie2"},
        {**LEVEL, "channel": "forward", "position": [0.4, 0.2, 0.3], "direction": [1.0, 0.0, 0.0], "on": "bogie1"},
        {**gyro, "on": "bogie1"},
        {**LEVEL, "channel": "box", "position": [0.0, 1.1, 0.0], "on": "wheelset3"},
        {"channel": "level", "quantity": "travel", "unit": "mm", "between": "bogie2_left"},
        {"channel": "box_level", "quantity": "travel", "unit": "mm", "between": "bogie1_rear_right"},
    ]
    nominal = structure(vehicle(sensor=sensors))
    outputs, names = nominal.outputs, nominal.coordinates
    read = dict(zip(outputs.names, outputs.acceleration + outputs.velocity + outputs.displacement, strict=True))

    def reading(channel):
        return {name: round(value, 9) for name, value in zip(names, read[channel], strict=True) if value}

    assert reading("corner") == {"bogie2": 1.0, "bogie2_pitch": -1.1, "bogie2_roll": -1.0}
    assert reading("forward") == {"bogie1_pitch": 0.3}
    assert reading("gyro") == {"bogie1_pitch": 1.0}
    assert reading("box") == {"wheelset3": 1.0, "wheelset3_roll": 1.1}
    side = {"bounce": 1.0, "pitch": 6.8, "roll": 0.95, "bogie2": -1.0, "bogie2_roll": -0.95}
    assert reading("level") == side
    frame = {"bogie1": 1.0, "bogie1_pitch": 1.1, "bogie1_roll": -1.0}
    assert reading("box_level") == {**frame, "wheelset2": -1.0, "wheelset2_roll": 1.0}


@pytest.mark.parametrize("name", ["coach", "metro", "metro-b", "y25-wagon"])
def test_shipped_vehicles_come_back_from_their_text(name) -> None:
    car = read_vehicle(name)
    assert vehicle_from_text(vehicle_text(car), source=name) == car
    assert Vehicle.model_validate(car.model_dump()) == car


def test_coach_has_the_published_numbers() -> None:
    """Iwnicki 1998, Manchester Benchmarks for Rail Vehicle Simulation, Vehicle System Dynamics 30, 295-313."""
    coach = read_vehicle("coach")
    assert (coach.body.mass, coach.body.pitch_inertia, coach.body.roll_inertia) == (32000.0, 1.97e6, 56800.0)
    for bogie, x in zip(coach.bogie, (9.5, -9.5), strict=True):
        assert (bogie.x, bogie.half_wheelbase, bogie.half_spacing) == (x, 1.28, (1.0, 1.0))
        assert (bogie.mass, bogie.pitch_inertia, bogie.roll_inertia) == (2615.0, 1476.0, 1722.0)
        assert (bogie.wheelset_mass, bogie.wheelset_roll_inertia) == (1813.0, 1120.0)
        assert (bogie.primary_stiffness, bogie.primary_damping) == (1.22e6, 4e3)
        assert (bogie.secondary_stiffness, bogie.secondary_damping) == (430e3, 20e3)
        assert bogie.anti_roll_stiffness == 940e3


def test_metro_of_type_b_has_the_published_numbers() -> None:
    """Mathematical Problems in Engineering 2020, 1584624, table 6: trailer, personnel quota; t, t m^2 and MN/m."""
    metro = read_vehicle("metro-b")
    body = metro.body
    assert (body.mass, body.roll_inertia, body.pitch_inertia, body.yaw_inertia) == (35.8e3, 29335, 1202387, 1192428)
    for bogie in metro.bogie:
        lateral = bogie.lateral
        assert lateral is not None
        assert (bogie.mass, bogie.roll_inertia, bogie.pitch_inertia, lateral.yaw_inertia) == (2560, 1050, 1750, 1980)
        assert (bogie.wheelset_mass, bogie.wheelset_roll_inertia) == (1420, 739)
        assert (lateral.wheelset_spin_inertia, lateral.wheelset_yaw_inertia) == (96, 751)
        assert (*lateral.primary_stiffness, bogie.primary_stiffness) == (6.6e6, 5.2e6, 1.7e6)
        assert lateral.secondary_stiffness[0] == 0.21e6


def test_the_wagon_stands_on_the_bogies_of_the_thesis() -> None:
    wagon, alone = read_vehicle("y25-wagon"), read_vehicle("y25")
    axle = alone.axle[0]
    for bogie in wagon.bogie:
        assert (bogie.mass, bogie.pitch_inertia, bogie.roll_inertia) == (2219.0, 1557.0, 1976.0)
        assert bogie.wheelset_mass == (axle.wheelset_mass or 0.0) + 2 * (axle.unsprung_mass or 0.0)
        assert (bogie.primary_stiffness, bogie.primary_damping) == (axle.spring_stiffness, axle.damping)


def test_modes_of_the_body_have_labels() -> None:
    assert structure(read_vehicle("metro")).modes().labels[:3] == ("bounce", "roll", "pitch")


@pytest.mark.parametrize("name", ["coach", "metro"])
def test_identified_modes_are_labelled_by_their_shapes(name) -> None:
    """Frequencies that are off by 3 % one way and the other do not mislead; the coach sways and yaws, too."""
    car = read_vehicle(name)
    exact = structure(car).modes()
    poles, shapes = exact.poles[:9] * np.where(np.arange(9) % 2, 0.97, 1.03), exact.mode_shapes[:9]
    unknown = np.full(9, np.nan)
    modes = Modes(poles, shapes, exact.channels, unknown, unknown, np.ones(9), (None,) * 9)
    found = labelled(modes, structure(car).outputs.channels, vehicle=car).labels
    assert found == exact.labels[:9]
    assert {"bounce", "roll", "pitch"} <= set(found[:7])  # wheelsets of the coach hunt at such frequencies, too
    bare = car.model_copy(update={"sensor": ()})
    assert labelled(modes, structure(car).outputs.channels, vehicle=bare).labels == (None,) * 9


def on_air(**changes) -> Vehicle:
    """The vehicle on air springs whose body bends."""
    bogie = {key: value for key, value in BOGIE.items() if not key.startswith("secondary_")} | {"air_spring": AIR}
    bending = {"shape": "bending", "frequency": 9.0, "damping_ratio": 0.02}
    return vehicle(bogie=[bogie, bogie | {"x": -7.2}], flexible_mode=[bending], **changes)


def test_an_air_spring_is_two_volumes_and_a_pipe() -> None:
    """The gas law of both volumes and the flow through the pipe, written down by themselves and solved: 1e-12."""
    s = np.asarray(2j * np.pi * np.geomspace(0.01, 50.0, 9), dtype=np.complex128)
    absolute, area = 350e3 + 101325.0, 0.19
    forces = []
    for each in s:
        # Unknowns: pressures of bellows and reservoir, and travel of a piston of the area that moves the air between.
        equations = np.array(
            [
                [0.02, 0.0, -1.4 * absolute * area],
                [0.0, 0.04, 1.4 * absolute * area],
                [area, -area, each * 9e4],
            ]
        )
        bellows, _, _ = np.linalg.solve(equations, [1.4 * absolute * area, 0.0, 0.0])
        forces.append(area * bellows + 350e3 * 0.05)
    spring = next(element for element in structure(on_air()).elements if element.part == "secondary")
    assert spring.dynamic_stiffness(s) == pytest.approx(np.array(forces), rel=1e-12)


def test_the_body_on_bogies_bends() -> None:
    """Free of its springs the body has the mode of the file; its middle moves, the radius of gyration does not."""
    places = {"middle": 0.0, "node": np.sqrt(850e3 / 27000.0)}
    sensors = [{**LEVEL, "channel": name, "position": [x, 0.0, 0.0]} for name, x in places.items()]
    nominal = structure(on_air(sensor=sensors))
    free = nominal.changed({part: 0.0 for part in nominal.components() if part.kind.startswith("secondary")})
    secondary = {element.owner for element in nominal.elements if element.part == "secondary"}
    assert secondary == {"bogie1_left", "bogie1_right", "bogie2_left", "bogie2_right"}
    modes = free.modes()
    (row,) = [k for k, label in enumerate(modes.labels) if label == "bending"]
    assert modes.natural_frequency[row] == pytest.approx(9.0, rel=1e-9)
    assert modes.damping_ratio[row] == pytest.approx(0.02, rel=1e-9)
    assert nominal.outputs.acceleration[:, -1] == pytest.approx([1.0, 0.0])


@pytest.mark.slow
def test_a_leaking_air_spring_is_found_under_a_body_that_bends() -> None:
    """Air at a lower pressure is a softer spring; the sound sensor in the middle of the body is no fault."""
    places = [(name, x, 0.95 * y) for name, x, y in (("a", 7.2, 1), ("b", 7.2, -1), ("c", -7.2, 1), ("d", -7.2, -1))]
    sensors = [{**LEVEL, "channel": name, "position": [x, y, 0.0]} for name, x, y in [*places, ("middle", 0.0, 0.0)]]
    frames = [sensor.model_dump() for sensor in read_vehicle("metro").sensor if sensor.on != "body"]
    car = on_air(sensor=[*sensors, *frames])
    leak = parse_fault("bogie1_left.secondary_spring=-0.3")
    drive = RailDrive(duration=60.0, sampling_rate=100.0, snr=50.0, welded=True, faults=(leak,))
    fit = fit_corners(
        simulate_drive(car, drive, seed=3).recording, car, settings=CornerSettings(free=("secondary_spring",))
    )
    assert not [note for note in fit.notes if "middle" in note]
    expected = [np.log(0.7) if part.corner == "bogie1_left" else 0.0 for part in fit.components]
    assert len(expected) == 4
    assert fit.log_ratios_std.max() < 0.05
    assert np.abs((fit.log_ratios - expected) / fit.log_ratios_std).max() < 4


@pytest.mark.parametrize(
    ("changed", "sentence"),
    [
        ({"kind": "road"}, "kind='road' must be \"rail\" for a vehicle with [[bogie]] tables: correct it"),
        ({"bogie": [BOGIE]}, "bogie has 1 entries, but must have at least 2"),
        ({"bogie": [BOGIE, BOGIE]}, "x of the bogies is [7.2, 7.2], but must fall from front to rear"),
        ({"axle": [{"x": 1.0, "half_track": 1.0, "spring_stiffness": 1e6, "damping": 1e4}] * 2}, "keep those of one"),
        ({"bogie": [BOGIE, BOGIE | {"x": -7.0, "stiffness": 1.0}]}, "[[bogie]] 2, stiffness is not known here"),
        ({"bogie": [BOGIE, BOGIE | {"x": -7.0, "primary_stiffness": 1050.0}]}, "is that N/mm? Give N/m"),
        ({"bogie": [BOGIE, BOGIE | {"x": -7.0, "secondary_stiffness": 290.0}]}, "is that N/mm? Give N/m"),
        ({"bogie": [BOGIE, BOGIE | {"x": -7.0, "half_spacing": [1000.0, 950.0]}]}, "half_spacing[1]=1000 m of a veh"),
        ({"body": {"mass": 27.0}}, "is that g, or is the mass of the body missing? Give kilograms"),
        ({"body": BODY | {"roll_inertia": 42.0}}, "body, roll_inertia=42 kg m2 must be"),
        (
            {"sensor": [{**LEVEL, "channel": "a", "position": [0.0, 0.0, 0.0], "body": "bogie3"}]},
            "[[sensor]] 1, on='bogie3' must be one of body, bogie1, wheelset1, wheelset2, bogie2",
        ),
        ({"sensor": [{**LEVEL, "channel": "a", "body": "bogie2"}]}, "sensor 'a' has no position"),
        (
            {"sensor": [{"channel": "w", "quantity": "wheel_speed", "unit": "rad/s", "on": "wheelset1"}]},
            "give the speed in m/s",
        ),
        (
            {"flexible_mode": [{"shape": "torsion", "frequency": 9.0, "damping_ratio": 0.02}]},
            'shape = "torsion" is for bodies on [[axle]] tables: remove it',
        ),
        (
            {"bogie": [BOGIE, BOGIE | {"x": -7.0, "air_spring": AIR}]},
            "secondary_stiffness is that of the air_spring: leave one of them out",
        ),
        (
            {"bogie": [BOGIE, {k: v for k, v in BOGIE.items() if k != "secondary_damping"} | {"x": -7.0}]},
            "secondary_damping is missing: add it, or a [bogie.air_spring] table",
        ),
    ],
)
def test_what_no_vehicle_on_bogies_can_be_is_refused(changed, sentence) -> None:
    with pytest.raises(ParameterError) as refusal:
        parse_vehicle(fields() | changed)
    assert sentence in str(refusal.value)


def test_what_needs_axles_refuses_bogies() -> None:
    car = read_vehicle("metro")
    for settings in (RoadDrive(duration=5.0), RigRun(duration=5.0)):
        with pytest.raises(ParameterError, match="'metro' stands on bogies, which run on a track only"):
            simulate_drive(car, settings)
    with pytest.raises(ParameterError, match=r"'metro' stands on \[\[bogie\]\] tables, but a vehicle that brakes"):
        driven_structure(car)
