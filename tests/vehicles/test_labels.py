"""Names of modes from exact modes of vehicles, for every layout of sensors that distinguishes them."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sprung.modal import Modes
from sprung.recording import Channel
from sprung.vehicles import VEHICLES, parse_vehicle, read_description, read_vehicle, structure, wheel_hop_frequencies
from sprung.vehicles.labels import MOTIONS, labelled, plausibility_notes, rigid_body_participation

CAR = read_vehicle("zafira")
BODY = ("bounce", "pitch", "roll")
HOPS = ("wheel_hop",) * 4
CORNERS = ((1.22, 0.702), (1.22, -0.702), (-1.58, 0.702), (-1.58, -0.702))


def accelerometer(name, x, y, z=0.0, direction=(0.0, 0.0, 1.0)):
    return Channel(name, "acceleration", (x, y, z), direction)


def six_axis(x, y, z):
    """Accelerations and angular velocities along the three axes at one place."""
    axes = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
    return [
        *(accelerometer(f"a{name}", x, y, z, axis) for name, axis in axes.items()),
        *(Channel(f"g{name}", "angular_velocity", (x, y, z), axis) for name, axis in axes.items()),
    ]


def upright(x, y, z):
    """The three axes of an inertial unit that distinguish bounce, pitch and roll."""
    return [channel for channel in six_axis(x, y, z) if channel.name in {"az", "gx", "gy"}]


LAYOUTS = {
    "four corners": [accelerometer(f"a{k}", x, y) for k, (x, y) in enumerate(CORNERS)],
    "three corners": [accelerometer(f"a{k}", x, y) for k, (x, y) in enumerate(CORNERS[:3])],
    "inertial unit at the centre": upright(0.0, 0.0, 0.0),
    "inertial unit at the dashboard": upright(0.8, 0.3, 0.2),
    "inertial unit in the boot": upright(-1.9, -0.4, 0.3),
    "six axes at the dashboard": [c for c in six_axis(0.8, 0.3, 0.2) if c.name != "gz"],
}


def exact_modes(channels, vehicle=CAR):
    """Exact modes of the vehicle as these channels see them."""
    sensors = [
        {
            "channel": channel.name,
            "quantity": channel.quantity,
            "unit": channel.unit,
            "position": list(channel.position),
            "direction": list(channel.direction),
        }
        for channel in channels
    ]
    fields = {**vehicle.model_dump(exclude_defaults=True), "sensor": sensors}
    exact = structure(parse_vehicle(fields)).modes()
    return as_modes(exact.poles, exact.mode_shapes, exact.channels)


def as_modes(poles, shapes, names):
    unknown = np.full(len(poles), np.nan)
    return Modes(poles, shapes, tuple(names), unknown, unknown, np.ones(len(poles)), (None,) * len(poles))


def body_mass(vehicle=CAR):
    return structure(vehicle).mass[:3, :3]


@pytest.mark.parametrize("layout", LAYOUTS)
def test_every_layout_names_the_modes_of_the_car(layout) -> None:
    channels = LAYOUTS[layout]
    assert labelled(exact_modes(channels), channels, vehicle=CAR).labels == (*BODY, *HOPS)


@pytest.mark.parametrize("name", ["zafira", "zafira-printed", "scale-bogie"])
def test_names_agree_with_those_of_the_full_model(name) -> None:
    """There by the kinetic energy of all seven coordinates, here from the sensors on the body alone."""
    vehicle = read_vehicle(name)
    channels = [sensor.as_channel() for sensor in vehicle.sensor]
    if not channels:
        x, y = vehicle.axle[0].x, vehicle.axle[0].half_track
        channels = [
            accelerometer(f"a{k}", i * x, j * y) for k, (i, j) in enumerate([(1, 1), (1, -1), (-1, 1), (-1, -1)])
        ]
    modes = exact_modes(channels, vehicle)
    is_seen = np.abs(modes.mode_shapes).max(axis=1) > 0
    labels = labelled(modes.take(np.flatnonzero(is_seen)), channels, vehicle=vehicle).labels
    assert labels == tuple(np.array(structure(vehicle).modes().labels)[is_seen])


@pytest.mark.parametrize("layout", LAYOUTS)
def test_the_body_explains_all_of_its_own_motion_and_energy_shares_agree_between_layouts(layout) -> None:
    channels = LAYOUTS[layout]
    shares, explained = rigid_body_participation(exact_modes(channels), channels, mass=body_mass())
    reference, _ = rigid_body_participation(
        exact_modes(LAYOUTS["four corners"]), LAYOUTS["four corners"], mass=body_mass()
    )
    np.testing.assert_allclose(explained, 1, atol=1e-9)
    np.testing.assert_allclose(shares, reference, atol=1e-6)
    np.testing.assert_allclose(shares.sum(axis=1), 1)


def test_more_axes_than_motions_expose_a_wrong_sign() -> None:
    """Two accelerometers at each end and a pitch rate against them: the rigid body explains it only rightly signed."""
    channels = [*LAYOUTS["four corners"], Channel("gy", "angular_velocity", None, (0.0, 1.0, 0.0))]
    placed = [replace(channel, position=channel.position or (0.0, 0.0, 0.0)) for channel in channels]
    modes = exact_modes(placed)
    _, right = rigid_body_participation(modes, channels, mass=body_mass())
    sign = np.array([1, 1, 1, 1, -1])
    _, wrong = rigid_body_participation(
        replace(modes, mode_shapes=modes.mode_shapes * sign), channels, mass=body_mass()
    )
    np.testing.assert_allclose(right, 1, atol=1e-9)
    assert wrong[1] < right[1] - 1e-3


@pytest.mark.parametrize(("motion", "row"), [("bounce", (1, 0, 0)), ("pitch", (0, 1, 0)), ("roll", (0, 0, 1))])
def test_pure_motions_have_all_of_the_share(motion, row) -> None:
    """z - x pitch + y roll at the corners; positive pitch is nose down, positive roll is left side up."""
    channels = LAYOUTS["four corners"]
    shape = np.array([[z - x * p + y * r for (x, y) in CORNERS] for z, p, r in [row]], dtype=complex)
    modes = as_modes(2j * np.pi * np.ones(1), shape, "abcd")
    for mass in (None, body_mass()):
        shares, explained = rigid_body_participation(modes, channels, mass=mass)
        np.testing.assert_allclose(shares, [row], atol=1e-12)
        assert explained == pytest.approx([1])
    assert labelled(modes, channels).labels == (motion,)


@settings(deadline=None)
@given(size=st.floats(1e-6, 1e6), phase=st.floats(0, 6.3))
def test_names_do_not_depend_on_the_scale_of_shapes(size, phase) -> None:
    channels = LAYOUTS["inertial unit at the dashboard"]
    modes = exact_modes(channels)
    turned = replace(modes, mode_shapes=size * np.exp(1j * phase) * modes.mode_shapes)
    assert labelled(turned, channels, vehicle=CAR).labels == (*BODY, *HOPS)


def test_without_a_vehicle_four_corners_name_the_body_modes_and_no_wheel_hop() -> None:
    channels = LAYOUTS["four corners"]
    assert labelled(exact_modes(channels), channels).labels == (*BODY, None, None, None, None)


@pytest.mark.parametrize(
    "channels",
    [
        [Channel("a", "acceleration"), Channel("b", "acceleration"), Channel("c", "acceleration")],
        [Channel("a"), Channel("b"), Channel("c")],
        [accelerometer("a", 1, 1), accelerometer("b", 0, 1), Channel("t", "temperature", (0, 0, 0), (0, 0, 1))],
        [accelerometer("a", 1, 0), accelerometer("b", 0, 0), accelerometer("c", -1, 0)],
        [accelerometer("a", 1, 1), accelerometer("b", -1, 1)],
    ],
    ids=["without places", "without quantities", "with a temperature", "on one line", "two only"],
)
def test_layouts_that_do_not_distinguish_the_motions_give_no_names(channels) -> None:
    modes = as_modes(2j * np.pi * np.ones(1), np.ones((1, len(channels))), [c.name for c in channels])
    shares, explained = rigid_body_participation(modes, channels)
    assert np.isnan(shares).all()
    assert explained.tolist() == [0]
    assert labelled(modes, channels).labels == (None,)


def test_the_chain_has_no_names() -> None:
    chain = structure(read_description("chain3"))
    exact = chain.modes()
    modes = as_modes(exact.poles, exact.mode_shapes, exact.channels)
    assert labelled(modes, chain.outputs.channels).labels == (None, None, None)


def test_a_bending_body_has_no_name() -> None:
    """Diagonal corners up, the others down: nothing of it is rigid."""
    modes = as_modes(2j * np.pi * np.ones(1), np.array([[1, -1, -1, 1]], dtype=complex), "abcd")
    shares, explained = rigid_body_participation(modes, LAYOUTS["four corners"])
    assert np.isnan(shares).all()
    assert explained.tolist() == [0]
    assert labelled(modes, LAYOUTS["four corners"]).labels == (None,)


def test_wheel_hop_is_named_by_frequency_within_a_fifth() -> None:
    front = wheel_hop_frequencies(CAR)[0]
    rear = wheel_hop_frequencies(CAR)[1]
    frequencies = np.array([0.79 * rear, 0.81 * rear, 1.19 * front, 1.21 * front])
    modes = as_modes(2j * np.pi * frequencies, np.ones((4, 1)), "a")
    labels = labelled(modes, [Channel("a", "acceleration")], vehicle=CAR).labels
    assert labels == (None, "wheel_hop", "wheel_hop", None)


def test_each_motion_names_its_lowest_mode_only() -> None:
    shapes = np.ones((2, 4), dtype=complex)
    modes = as_modes(2j * np.pi * np.array([1.0, 5.0]), shapes, "abcd")
    assert labelled(modes, LAYOUTS["four corners"]).labels == ("bounce", None)


def shapes_at_the_corners(*motions):
    """Shapes at four corners of bounce, pitch, roll and twist."""
    rows = [[z - x * p + y * r + x * y * t for (x, y) in CORNERS] for z, p, r, t in motions]
    return np.array(rows, dtype=complex)


BOUNCE, PITCH, ROLL, TWIST = (1, 0, 0, 0), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)


@pytest.mark.parametrize("vehicle", [CAR, None], ids=["with its file", "without a file"])
def test_a_shape_alone_is_no_motion_of_the_body(vehicle) -> None:
    """Rigid shapes at 17.6 and 23.7 Hz next to a car whose body moves at 1.5 to 2.2 Hz."""
    modes = as_modes(2j * np.pi * np.array([1.5, 17.6, 23.7]), shapes_at_the_corners(BOUNCE, ROLL, PITCH), "abcd")
    assert labelled(modes, LAYOUTS["four corners"], vehicle=vehicle).labels == ("bounce", None, None)


def test_a_loaded_car_and_one_with_locked_springs_keep_their_names() -> None:
    exact = structure(CAR).modes()
    for factor in (0.7, 1.5):
        modes = as_modes(factor * exact.poles[:3], exact.mode_shapes[:3], exact.channels)
        channels = [sensor.as_channel() for sensor in CAR.sensor]
        assert labelled(modes, channels, vehicle=CAR).labels == BODY


def test_the_body_of_a_scale_model_moves_far_faster_than_that_of_a_car() -> None:
    """Without a file only the ratio of the frequencies counts: 19, 22 and 25 Hz."""
    shapes = shapes_at_the_corners(BOUNCE, PITCH, ROLL)
    modes = as_modes(2j * np.pi * np.array([19.0, 22.0, 25.0]), shapes, "abcd")
    assert labelled(modes, LAYOUTS["four corners"]).labels == BODY


def test_a_twist_of_the_body_near_wheel_hop_is_none() -> None:
    hop = wheel_hop_frequencies(CAR)[0]
    shapes = shapes_at_the_corners(TWIST, BOUNCE)
    modes = as_modes(2j * np.pi * hop * np.array([1.0, 1.01]), shapes, "abcd")
    assert labelled(modes, LAYOUTS["four corners"], vehicle=CAR).labels == (None, "wheel_hop")


def test_no_modes_are_named_without_complaint() -> None:
    modes = as_modes(np.zeros(0), np.zeros((0, 4)), "abcd")
    assert labelled(modes, LAYOUTS["four corners"], vehicle=CAR).labels == ()
    assert MOTIONS == BODY


USUAL_DAMPING = "2 to 100 % is usual: check damping, and its unit (N s/m)"


def car(**axle):
    """The file of a car with other values for both axles."""
    fields = read_vehicle("zafira").model_dump(exclude_defaults=True)
    return parse_vehicle({**fields, "kind": "road", "axle": [{**one, **axle} for one in fields["axle"]]})


@pytest.mark.parametrize("name", VEHICLES)
def test_shipped_vehicles_are_usual(name) -> None:
    assert plausibility_notes(read_description(name)) == ()


def test_an_undamped_body_is_unusual() -> None:
    (note,) = plausibility_notes(car(damping=0.0))
    assert note == f"unusual damping of the vehicle file's body: bounce 0 %, pitch 0 %, roll 0 %; {USUAL_DAMPING}"


def test_strong_dampers_are_unusual_although_they_leave_no_mode() -> None:
    """4 c / (2 sqrt(4 k m)) of a body above its suspension: 2 sqrt(k m) = c at 100 %."""
    stiffness, mass = 40e3, 1480.0
    damping = 1.5 * np.sqrt(stiffness * mass)
    (note,) = plausibility_notes(car(spring_stiffness=stiffness, damping=damping))
    assert note == f"unusual damping of the vehicle file's body: bounce 150 %; {USUAL_DAMPING}"


def test_a_body_that_vibrates_like_a_bogie_is_unusual_in_full_size_alone() -> None:
    """Springs 900 times as stiff move the modes up by a factor of about 30; at a scale of 1 to 25, by 5 at most."""
    fast = car(spring_stiffness=900 * 40e3, damping=30 * 1781.0, tyre_stiffness=900 * 190900.0)
    note, *_ = plausibility_notes(fast)
    assert note.startswith("unusual frequencies of the vehicle file's body: bounce 4")
    assert note.endswith("0.5 to 20 Hz is usual: check masses, inertias and spring stiffness, and their units")
