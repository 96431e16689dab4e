"""Published modes, geometry and signs of the vehicle models.

F. Liu, Online Identification of Vehicle Dynamic Systems for Condition Monitoring, Huddersfield (2020), is "the thesis".
"""

import numpy as np
import pytest
from tests.vehicles.cars import car

from sprung.errors import ParameterError
from sprung.recording import Channel
from sprung.vehicles import (
    Component,
    Vehicle,
    chain,
    corner_names,
    parse_vehicle,
    read_description,
    read_vehicle,
    sensor_outputs,
    structure,
    wheel_hop_frequencies,
)

SENSOR = {"channel": "a", "quantity": "acceleration", "unit": "g", "position": [0, 0, 0], "direction": [0, 0, 1]}


def parsed(**changes) -> Vehicle:
    """The small symmetric car with changed fields."""
    vehicle = parse_vehicle(car(**changes))
    assert isinstance(vehicle, Vehicle)
    return vehicle


def test_chain_has_the_published_modes() -> None:
    """Table 4-1 of the thesis, to the digits printed."""
    modes = structure(read_description("chain3")).modes()
    assert modes.natural_frequency.round(2).tolist() == [7.01, 19.65, 28.39]
    assert (100 * modes.damping_ratio).round(2).tolist() == [1.12, 3.15, 4.55]
    assert modes.labels == (None, None, None)


def test_chain_function_is_the_shipped_chain() -> None:
    shipped, built = structure(read_description("chain3")), chain()
    assert built.coordinates == shipped.coordinates == ("mass_1", "mass_2", "mass_3")
    assert built.outputs.channels == shipped.outputs.channels
    for name in ("mass", "damping", "stiffness", "input_matrix"):
        np.testing.assert_array_equal(getattr(built.system, name), getattr(shipped.system, name))


def test_quarter_has_the_published_modes() -> None:
    """Section 5.3.1 of the thesis, to the digits printed."""
    modes = structure(read_description("quarter")).modes()
    assert modes.natural_frequency.round(2).tolist() == [13.21, 56.35]
    assert (100 * modes.damping_ratio).round(2).tolist() == [13.10, 6.33]
    assert modes.labels == ("bounce", "wheel_hop")


@pytest.mark.parametrize(
    ("name", "frequencies", "damping", "tolerance"),
    [
        ("scale-bogie", (19.15, 20.1, 25.4), (6.99, 7.34, 9.27), 0.006),  # table 7-1; 7.38 is 0.51 % over 7.34
        ("zafira", (1.53, 1.77, 2.17), (16.3, 20.5, 23.8), 0.015),  # table 6-3
        ("zafira-printed", (1.12, 1.33, 1.64), (20.9, 26.5, 31.5), 0.0025),  # of the printed parameters
    ],
)
def test_body_modes_of_the_shipped_vehicles(name, frequencies, damping, tolerance) -> None:
    modes = structure(read_description(name)).modes()
    assert modes.labels[:3] == ("bounce", "pitch", "roll")
    assert modes.natural_frequency[:3] == pytest.approx(frequencies, rel=tolerance)
    assert 100 * modes.damping_ratio[:3] == pytest.approx(damping, rel=tolerance)
    assert modes.labels[3:] == ("wheel_hop",) * 4


def test_wheels_moving_crosswise_do_not_move_a_symmetric_body() -> None:
    """The fourth wheel hop mode of the bogie is seen by sensors on the wheels only."""
    bogie = read_vehicle("scale-bogie")
    assert sorted(np.abs(structure(bogie).modes().mode_shapes[3:]).max(axis=1).round(9).tolist()) == [0, 1, 1, 1]
    fields = bogie.model_dump(exclude_defaults=True)
    fields["sensor"] = [{**SENSOR, "channel": corner, "on": f"wheel_{corner}"} for corner in corner_names(2)]
    shapes = structure(parse_vehicle(fields)).modes().mode_shapes[3:].real
    assert [1, -1, -1, 1] in (np.sign(shapes) * np.sign(shapes[:, :1])).tolist()


def test_shapes_on_the_corners_follow_the_axes() -> None:
    """Bounce: all alike. Pitch: front against rear. Roll: left against right. Order FL, FR, RL, RR."""
    shapes = structure(read_vehicle("scale-bogie")).modes().mode_shapes.real
    signs = np.sign(shapes[:3] * np.sign(shapes[:3, :1]))
    assert signs.tolist() == [[1, 1, 1, 1], [1, 1, -1, -1], [1, -1, 1, -1]]


def test_stiffness_is_the_energy_of_springs_in_the_given_places() -> None:
    """q^T K q / 2 against the sum of k e^2 / 2 with elongations written out for the two-axle car."""
    vehicle = read_vehicle("zafira")
    system = structure(vehicle).system
    q = np.random.default_rng(1).standard_normal(7)
    z, p, r, *wheels = q
    energy = damping = 0.0
    for number, (x, y) in enumerate([(1.22, 0.702), (1.22, -0.702), (-1.58, 0.702), (-1.58, -0.702)]):
        axle = vehicle.axle[number // 2]
        elongation = z - x * p + y * r - wheels[number]
        energy += axle.spring_stiffness * elongation**2 + axle.tyre_stiffness * wheels[number] ** 2
        damping += axle.damping * elongation**2
    assert q @ system.stiffness @ q == pytest.approx(energy)
    assert q @ system.damping @ q == pytest.approx(damping)
    np.testing.assert_allclose(system.input_matrix[3:], 190900.0 * np.eye(4))
    np.testing.assert_array_equal(system.input_matrix[:3], 0.0)


@pytest.mark.parametrize("name", ["chain3", "quarter", "zafira", "scale-bogie"])
def test_matrices_are_symmetric_and_definite(name) -> None:
    system = structure(read_description(name)).system
    np.testing.assert_array_equal(system.stiffness, system.stiffness.T)
    np.testing.assert_array_equal(system.damping, system.damping.T)
    assert np.linalg.eigvalsh(system.stiffness).min() > 0
    assert np.linalg.eigvalsh(system.damping).min() > -1e-9 * system.damping.max()


def test_body_follows_a_lifted_road() -> None:
    """All wheels lifted by 1 at rest lift body and wheels by 1, without pitch or roll."""
    system = structure(read_vehicle("zafira")).system
    lifted = np.linalg.solve(system.stiffness, system.input_matrix @ np.ones(4))
    assert lifted == pytest.approx([1, 0, 0, 1, 1, 1, 1], abs=1e-12)


def test_wheel_hop_frequencies() -> None:
    found = wheel_hop_frequencies(read_vehicle("zafira"))
    assert found == pytest.approx(np.sqrt([235079.0 / 40.5, 227195.0 / 40.5]) / (2 * np.pi))
    undamped = parsed(axle=[{**axle, "damping": 0.0} for axle in car()["axle"]])
    exact = structure(undamped).modes().natural_frequency[3:]
    assert exact == pytest.approx(np.repeat(wheel_hop_frequencies(undamped)[0], 4), rel=0.01)


def test_wheels_of_infinite_stiffness_leave_three_closed_form_modes() -> None:
    """Without wheels: bounce sqrt(sum k/m), pitch sqrt(sum k x^2/I), roll sqrt(sum k y^2/I)."""
    axle = {"half_track": 0.15, "spring_stiffness": 126.0, "damping": 0.5}
    plate = parsed(
        kind="rig",
        body={"mass": 1.7138, "pitch_inertia": 0.03, "roll_inertia": 0.02},
        axle=[{"x": 0.2, **axle}, {"x": -0.2, **axle}],
    )
    vehicle = structure(plate)
    assert vehicle.coordinates == ("bounce", "pitch", "roll")
    assert vehicle.inputs[0] == "force_front_left"
    np.testing.assert_allclose(vehicle.system.input_matrix[:, 0], [1.0, -0.2, 0.15])
    expected = np.sqrt(4 * 126.0 * np.array([1 / 1.7138, 0.2**2 / 0.03, 0.15**2 / 0.02])) / (2 * np.pi)
    modes = vehicle.modes()
    found = dict(zip(modes.labels, modes.natural_frequency, strict=True))
    assert [found["bounce"], found["pitch"], found["roll"]] == pytest.approx(expected)
    assert found["bounce"] == pytest.approx(2.73, abs=0.005)  # published, section 6.2 of the thesis
    assert np.isnan(wheel_hop_frequencies(plate)).all()


def test_anti_roll_bar_stiffens_roll_only() -> None:
    """A bar of stiffness b adds b (2 y)^2 to the roll stiffness of the body and nothing to bounce and pitch."""
    plain, barred = (
        structure(parse_vehicle(car(axle=[{**axle, "anti_roll_stiffness": bar} for axle in car()["axle"]])))
        for bar in (0.0, 12e3)
    )
    added = barred.system.stiffness - plain.system.stiffness
    assert added[2, 2] == pytest.approx(2 * 12e3 * 1.4**2)
    assert added[:2] == pytest.approx(np.zeros((2, 7)))
    assert barred.modes().natural_frequency[:2] == pytest.approx(plain.modes().natural_frequency[:2])
    assert barred.components()[Component("front_axle", "anti_roll")] == 12e3


def test_mounted_mass_has_its_frequency_on_a_held_body() -> None:
    mount = {"mass": 180.0, "x": 1.1, "y": 0.1, "frequency": 11.0, "damping_ratio": 0.08}
    vehicle = structure(parse_vehicle(car(mounted_mass=[mount])))
    system = vehicle.system
    assert vehicle.coordinates[-1] == "mounted_mass_1"
    assert np.sqrt(system.stiffness[-1, -1] / 180.0) / (2 * np.pi) == pytest.approx(11.0)
    assert system.damping[-1, -1] / (2 * 180.0 * 2 * np.pi * 11.0) == pytest.approx(0.08)
    lifted = np.linalg.solve(system.stiffness, system.input_matrix @ np.ones(4))
    assert lifted == pytest.approx([1, 0, 0, 1, 1, 1, 1, 1], abs=1e-12)


def test_three_axles_have_six_corners() -> None:
    axle = car()["axle"][0]
    vehicle = structure(parse_vehicle(car(axle=[axle, {**axle, "x": -0.9}, {**axle, "x": -1.9}])))
    assert vehicle.system.n_coordinates == 9
    assert vehicle.inputs[2] == "road_axle2_left"
    assert list(dict.fromkeys(c.corner for c in vehicle.components())) == list(corner_names(3))
    assert vehicle.modes().labels.count("wheel_hop") == 6


def test_left_out_masses_make_everything_per_kilogram_of_body() -> None:
    """Dividing every mass, stiffness and damping by the body's mass leaves the modes as they are."""
    full = read_vehicle("zafira")
    fields = full.model_dump(exclude_defaults=True)
    mass = fields["body"].pop("mass")
    fields["body"] = {name: inertia / mass for name, inertia in fields["body"].items()}
    for axle in fields["axle"]:
        for name in ("unsprung_mass", "spring_stiffness", "damping", "tyre_stiffness"):
            axle[name] /= mass
    assert structure(parse_vehicle(fields)).modes().poles == pytest.approx(structure(full).modes().poles)


@pytest.mark.parametrize("name", ["zafira", "scale-bogie"])
def test_estimates_for_left_out_inertias_and_wheels_are_of_the_right_size(name) -> None:
    full = read_vehicle(name)
    fields = full.model_dump(exclude_defaults=True)
    fields["body"] = {"mass": full.body.mass}
    estimated, exact = (np.diag(structure(vehicle).mass) for vehicle in (parse_vehicle(fields), full))
    assert estimated[1:3] == pytest.approx(exact[1:3], rel=0.15)
    for axle in fields["axle"]:
        del axle["unsprung_mass"]
    assert np.diag(structure(parse_vehicle(fields)).mass)[3:] == pytest.approx(full.body.mass / 36 * np.ones(4))


def test_labels_follow_the_motion_not_the_order() -> None:
    stiff_bounce = car(body={"mass": 1400.0, "pitch_inertia": 8000.0, "roll_inertia": 4000.0})
    modes = structure(parse_vehicle(stiff_bounce)).modes()
    assert set(modes.labels[:3]) == {"bounce", "pitch", "roll"}
    assert modes.labels[0] == "roll"
    assert modes.labels[2] == "bounce"


def test_components_are_those_of_the_file() -> None:
    components = structure(read_vehicle("zafira")).components()
    rear_left = {c.kind: value for c, value in components.items() if c.corner == "rear_left"}
    assert rear_left == {"spring": 36295.0, "damper": 1688.0, "tyre": 190900.0}
    assert chain(2).components() == {
        Component("mass_1", "spring"): 9800.0,
        Component("mass_1", "damper"): 5.0,
        Component("mass_2", "spring"): 9800.0,
        Component("mass_2", "damper"): 5.0,
    }


def test_chain_of_unequal_masses() -> None:
    vehicle = chain(2, mass=[1.0, 3.0], stiffness=[10.0, 20.0], damping=0.5)
    np.testing.assert_allclose(vehicle.system.stiffness, [[30.0, -20.0], [-20.0, 20.0]])
    np.testing.assert_allclose(vehicle.system.mass, np.diag([1.0, 3.0]))
    with pytest.raises(ParameterError, match=r"mass has shape \(2,\), but must be one value or 3"):
        chain(3, mass=[1.0, 2.0])
    with pytest.raises(ParameterError, match=r"\[\[mass\]\] 1, mass=-1.0 must be above 0"):
        chain(1, mass=-1.0)


def test_sensors_of_other_quantities_are_not_outputs() -> None:
    temperature = {"channel": "t", "quantity": "temperature", "unit": "degC"}
    vehicle = structure(parse_vehicle(car(sensor=[temperature, SENSOR])))
    assert vehicle.outputs.names == ("a",)
    with pytest.raises(ParameterError, match="quantity 'temperature' of channel 't' is not a motion"):
        sensor_outputs(("bounce",), sensors=[Channel("t", "temperature")], carriers=["body"])


def test_sensor_on_a_wheel_reads_the_wheel() -> None:
    sensor = {**SENSOR, "on": "wheel_rear_left", "direction": [0, 0, -1]}
    outputs = structure(parse_vehicle(car(sensor=[sensor]))).outputs
    assert outputs.acceleration.tolist() == [[0, 0, 0, 0, 0, -1.0, 0]]
    with pytest.raises(ParameterError, match="channel 'a' is on 'roof', but the parts are body, bounce"):
        sensor_outputs(("bounce",), sensors=[Channel("a", "acceleration")], carriers=["roof"])


def with_bushing(name, stiffness):
    vehicle = read_vehicle(name)
    axles = tuple(axle.model_copy(update={"damper_bushing_stiffness": stiffness}) for axle in vehicle.axle)
    return structure(vehicle.model_copy(update={"axle": axles}))


def test_a_hard_bushing_is_none_and_a_soft_one_takes_the_damping_away() -> None:
    plain, hard, soft = (
        structure(read_vehicle("zafira")).modes(),
        *(with_bushing("zafira", k).modes() for k in (1e9, 1e-3)),
    )
    assert hard.natural_frequency == pytest.approx(plain.natural_frequency, rel=1e-4)
    assert hard.damping_ratio == pytest.approx(plain.damping_ratio, rel=1e-4)
    assert np.all(soft.damping_ratio < 1e-6)


def test_plate_has_the_published_frequencies() -> None:
    """Section 6.2 of the thesis; stiffness and dimensions are chosen so, see the file."""
    modes = structure(read_vehicle("plate")).modes()
    assert modes.natural_frequency == pytest.approx([2.73, 3.81, 4.53], abs=0.005)
    assert modes.labels == ("bounce", "pitch", "roll")


def test_y25_comes_within_a_fifth_of_the_published_frequencies() -> None:
    """Figure 8-3: bounce 11.42, roll 13.59, pitch 14.77 Hz; the geometry is not published."""
    modes = structure(read_vehicle("y25")).modes()
    found = dict(zip(modes.labels, modes.natural_frequency, strict=True))
    assert [found["bounce"], found["roll"], found["pitch"]] == pytest.approx([11.42, 13.59, 14.77], rel=0.2)
    assert found["bounce"] < found["roll"] < found["pitch"]


def test_wheelset_on_rails_in_closed_form() -> None:
    """A frame that is too heavy to move leaves wheelsets that bounce and roll between two pairs of springs."""
    y25 = read_vehicle("y25")
    heavy = y25.body.model_copy(update={"mass": 1e9, "pitch_inertia": 1e9, "roll_inertia": 1e9})
    axles = tuple(axle.model_copy(update={"damping": 0.0}) for axle in y25.axle)
    modes = structure(y25.model_copy(update={"body": heavy, "axle": axles, "mounted_mass": ()})).modes()
    bounce = (2 * 1e9 + 2 * 2.44e6) / (1300 + 2 * 160)
    roll = (2 * 1e9 * 0.75**2 + 2 * 2.44e6 * 1.0**2) / (688 + 2 * 160 * 1.0**2)
    expected = np.sort(np.repeat(np.sqrt([bounce, roll]) / (2 * np.pi), 2))
    assert modes.natural_frequency[-4:] == pytest.approx(expected, rel=1e-4)


def lateral(**axle):
    fields = {"half_track": 0.7, "spring_stiffness": 30e3, "damping": 0.0, "lateral_stiffness": 50e3, **axle}
    front, rear = {**fields, "x": 1.2}, {**fields, "x": -1.5}
    body = {"mass": 1000.0, "pitch_inertia": 1500.0, "roll_inertia": 300.0, "yaw_inertia": 1600.0}
    return structure(parse_vehicle({"name": "l", "kind": "road", "body": body, "axle": [front, rear]}))


def test_sway_and_yaw_in_closed_form() -> None:
    """Two coordinates, uncoupled from the others at height 0: [m, I] and lateral springs at x = 1.2 and -1.5 m."""
    modes = lateral().modes()
    stiffness = 2 * 50e3 * np.array([[2, 1.2 - 1.5], [1.2 - 1.5, 1.2**2 + 1.5**2]])
    expected = np.sqrt(np.linalg.eigvals(np.diag([1 / 1000, 1 / 1600]) @ stiffness)) / (2 * np.pi)
    for label in ("sway", "yaw"):
        assert np.abs(modes.natural_frequency[modes.labels.index(label)] - expected).min() < 1e-9
    assert {"bounce", "pitch", "roll"} <= set(modes.labels)


def test_low_suspension_couples_roll_with_sway() -> None:
    system = lateral(height=-0.4).system
    names = system.coordinates
    roll, sway = names.index("roll"), names.index("sway")
    assert system.stiffness[roll, sway] == pytest.approx(4 * 50e3 * 0.4)
    flat = lateral().system.stiffness
    assert system.stiffness[roll, roll] - flat[roll, roll] == pytest.approx(4 * 50e3 * 0.4**2)
    assert np.linalg.eigvalsh(system.stiffness)[0] > 0


def test_a_lateral_sensor_reads_sway_yaw_and_roll() -> None:
    sensor = {"channel": "y", "quantity": "displacement", "unit": "m"}
    fields = {"half_track": 0.7, "spring_stiffness": 30e3, "damping": 0.0, "lateral_stiffness": 50e3}
    vehicle = parse_vehicle(
        {
            "name": "l",
            "kind": "road",
            "body": {"mass": 1000.0},
            "axle": [{**fields, "x": 1.2}, {**fields, "x": -1.5}],
            "sensor": [{**sensor, "position": [2.0, 0.5, 0.3], "direction": [0.0, 1.0, 0.0]}],
        }
    )
    row = dict(zip(vehicle.coordinates, structure(vehicle).outputs.displacement[0], strict=True))
    assert row == {"bounce": 0, "pitch": 0, "roll": pytest.approx(-0.3), "sway": 1.0, "yaw": 2.0}
