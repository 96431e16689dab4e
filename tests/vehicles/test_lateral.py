"""Lateral motion of rail vehicles: energies of moved bodies, wavelength of Klingel, critical speed, refusals."""

import numpy as np
import pytest

from sprung.errors import ParameterError
from sprung.simulation import RailDrive, simulate_drive
from sprung.units import STANDARD_GRAVITY
from sprung.vehicles import (
    Sensor,
    Vehicle,
    read_vehicle,
    state_space,
    structure,
    vehicle_from_text,
    vehicle_text,
)
from sprung.vehicles.lateral import (
    critical_speed,
    lateral_components,
    lateral_modes,
    lateral_outputs,
    lateral_system,
    with_lateral,
)
from sprung.vehicles.sensor_checks import check_sensors
from sprung.vehicles.window import window_of


@pytest.fixture(scope="module")
def coach() -> Vehicle:
    return read_vehicle("coach")


def to_the_left(channel: str, on: str, x: float, h: float) -> Sensor:
    """Return an accelerometer to the left on a part."""
    place, left = (x, 0.0, h), (0.0, 1.0, 0.0)
    return Sensor(channel=channel, quantity="acceleration", unit="m/s^2", position=place, direction=left, on=on)


def turned(roll: float, yaw: float) -> np.ndarray:
    """Return the rotation of a rigid body that rolls and then yaws."""
    c, s = np.cos(roll), np.sin(roll)
    about_x = np.array([[1, 0, 0], [0, c, -s], [0, s, c]])
    c, s = np.cos(yaw), np.sin(yaw)
    return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) @ about_x


def spring_energy(vehicle: Vehicle, motion: dict[str, float]) -> float:
    """Return the energy of all springs of a vehicle whose rigid bodies have moved, and of the rails under its wheels.

    Springs have the axes of the part below them, and carry what is above.
    """
    body = np.array([0.0, 0.0, vehicle.body.height])

    def of(
        ends: tuple[str, str], homes: tuple[np.ndarray, np.ndarray], place: np.ndarray, k: tuple, load: float
    ) -> float:
        places, rotation = [], np.eye(3)
        for part, home in zip(ends, homes, strict=True):
            prefix = "" if part == "body" else f"{part}_"
            sway, roll, yaw = (motion.get(f"{prefix}{name}", 0.0) for name in ("sway", "roll", "yaw"))
            rotation = turned(roll, yaw)
            places.append(home + np.array([0.0, sway, 0.0]) + rotation @ (place - home))
        stretch = rotation.T @ (places[0] - places[1])
        return 0.5 * float(np.sum(np.array(k) * stretch**2)) - load * float(stretch[2])

    energy = 0.0
    for number, bogie in enumerate(vehicle.bogie, start=1):
        lateral, name = bogie.lateral, f"bogie{number}"
        assert lateral is not None
        frame = np.array([bogie.x, 0.0, lateral.frame_height])
        carried = STANDARD_GRAVITY * vehicle.body.mass / 4
        for side in (1, -1):
            place = np.array([bogie.x, side * bogie.half_spacing[1], lateral.secondary_height])
            k = (*lateral.secondary_stiffness, bogie.secondary_stiffness)
            energy += of(("body", name), (body, frame), place, k, carried)
            for wheelset, along in ((2 * number - 1, 1), (2 * number, -1)):
                axle = np.array([bogie.x + along * bogie.half_wheelbase, 0.0, lateral.wheel_radius])
                place = axle + np.array([0.0, side * bogie.half_spacing[0], 0.0])
                k = (*lateral.primary_stiffness, bogie.primary_stiffness)
                load = carried / 2 + STANDARD_GRAVITY * bogie.mass / 4
                energy += of((name, f"wheelset{wheelset}"), (frame, axle), place, k, load)
                lift = bogie.contact_half_spacing * motion.get(f"wheelset{wheelset}_roll", 0.0)
                energy += 0.5 * bogie.contact_stiffness * lift**2
        turn = motion.get("roll", 0.0) - motion.get(f"{name}_roll", 0.0)
        energy += 0.5 * bogie.anti_roll_stiffness * turn**2
    return energy


def without_contact(vehicle: Vehicle) -> Vehicle:
    """Return the vehicle with wheels that neither creep nor guide."""
    return with_lateral(vehicle, {"creep": -60.0, "conicity": -60.0})


def test_stiffness_is_the_curvature_of_the_energy_of_moved_bodies(coach) -> None:
    system = lateral_system(without_contact(coach), speed=20.0)
    names, step = system.coordinates, 1e-4
    curvature = np.zeros((len(names), len(names)))
    for i, first in enumerate(names):
        for j, second in enumerate(names[: i + 1]):
            for a, b in ((1, 1), (1, -1), (-1, 1), (-1, -1)):
                motion = dict.fromkeys(names, 0.0)
                motion[first] += a * step
                motion[second] += b * step
                curvature[i, j] += a * b * spring_energy(coach, motion) / (4 * step**2)
            curvature[j, i] = curvature[i, j]
    bogie = coach.bogie[0]
    axle_load = STANDARD_GRAVITY * (bogie.wheelset_mass + bogie.mass / 2 + coach.body.mass / 4)
    for number in range(1, 5):  # the forces of the rails lean with the wheelset
        curvature[names.index(f"wheelset{number}_sway"), names.index(f"wheelset{number}_roll")] += axle_load
    assert np.allclose(system.stiffness, curvature, rtol=1e-5, atol=1e-6 * curvature.max())


def test_modes_and_responses_are_those_of_a_multibody_engine(coach) -> None:
    """Of `benchmarks.multibody.coach`: modes at 45 m/s, and readings over alignment and roll of the track."""
    exact = lateral_modes(coach, speed=45.0)
    frequencies = [0.597, 0.862, 1.210, 2.004, 2.022, 9.758, 9.780, 12.807, 12.808, 13.810, 13.819]
    assert exact.natural_frequency[:11] == pytest.approx(frequencies, rel=1e-3)
    ratios = [0.222, 0.527, 0.378, 0.195, 0.203, 0.313, 0.311, 0.672, 0.672, 0.253, 0.251]
    assert exact.damping_ratio[:11] == pytest.approx(ratios, abs=1e-3)
    places = (("bogie1", 1.28, 0.1), ("bogie1", -1.28, 0.1), ("body", 9.5, -0.7), ("body", -9.5, -0.7))
    sensors = tuple(to_the_left(f"{on}{x}", on, x, h) for on, x, h in places)
    outputs = lateral_outputs(coach.model_copy(update={"sensor": sensors}))
    system = lateral_system(coach, speed=45.0)
    space = state_space(system, outputs)
    behind = np.array([coach.wheels[0].x - wheel.x for wheel in coach.wheels[::2]])
    for frequency, aside, rolled in (
        (1.0, (53.00, 54.90, 65.74, 59.49), (28.62, 33.82, 32.48, 51.51)),
        (3.0, (325.86, 354.23, 95.65, 96.85), (440.41, 457.47, 149.56, 123.84)),
        (10.0, (147.41, 296.75, 8.78, 6.26), (657.32, 2160.34, 96.42, 71.30)),
    ):
        omega = 2 * np.pi * frequency
        resolvent = 1j * omega * np.eye(len(space.state_matrix)) - space.state_matrix
        response = space.output_matrix @ np.linalg.solve(resolvent, space.input_matrix) + space.feedthrough
        phases = np.exp(-1j * omega * behind / 45.0)
        assert np.abs(response[:, :4] @ phases) == pytest.approx(aside, rel=0.02)
        assert np.abs(response[:, 4:] @ phases) == pytest.approx(rolled, rel=0.02)


def test_a_vehicle_stands_where_the_track_lies(coach) -> None:
    """A track that is moved to the left by 1 cm moves all parts by as much; one that rolls rolls them the same way."""
    system = lateral_system(coach, speed=20.0)
    n_wheelsets = 2 * len(coach.bogie)
    aside, rolled = (
        dict(zip(system.coordinates, np.linalg.solve(system.stiffness, system.input_matrix @ track), strict=True))
        for track in 0.01 * np.repeat(np.eye(2), n_wheelsets, axis=1)
    )
    sways = [value for name, value in aside.items() if name.endswith("sway")]
    assert np.allclose(sways, 0.01, rtol=1e-6)
    assert np.allclose([value for name, value in aside.items() if not name.endswith("sway")], 0.0, atol=1e-8)
    assert 0.01 < rolled["bogie1_roll"] < rolled["roll"] < 0.013  # the weight above the springs leans further


def test_a_free_wheelset_rolls_with_the_wavelength_of_klingel(coach) -> None:
    names = [name for name in lateral_components(coach) if "spring" in name or "damper" in name]
    loose = with_lateral(coach, dict.fromkeys(names, -14.0))
    lateral, speed = coach.bogie[0].lateral, 1.0
    length = 2 * np.pi * np.sqrt(lateral.wheel_radius * coach.bogie[0].contact_half_spacing / lateral.conicity)
    frequencies = lateral_modes(loose, speed=speed).natural_frequency
    assert np.min(np.abs(frequencies / (speed / length) - 1)) < 0.01


def test_the_least_damped_mode_grows_beyond_the_critical_speed_alone(coach) -> None:
    speed = critical_speed(coach)
    assert speed is not None
    assert lateral_modes(coach, speed=0.999 * speed).damping_ratio.min() > 0
    assert lateral_modes(coach, speed=1.001 * speed).damping_ratio.min() < 0
    names = [f"bogie{number}.primary_longitudinal_spring" for number in (1, 2)]
    hunting = critical_speed(with_lateral(coach, dict.fromkeys(names, -2.5)))
    assert hunting is not None
    assert hunting < speed  # soft guidance hunts earlier
    assert critical_speed(with_lateral(coach, {"conicity": -0.7}), highest=0.8 * speed) is None


def test_the_body_sways_as_it_rolls_on_vertical_irregularities(coach) -> None:
    """Modes of the multibody engine, whose wheelsets steer; wheelsets held by the rails swayed at 13.2 Hz, 14 %."""
    exact, engine = structure(coach, speed=45.0).modes(), (0.597, 1.210, 9.758, 9.780, 13.810, 13.819)
    order = [int(np.argmin(np.abs(exact.natural_frequency - f))) for f in engine]
    assert exact.natural_frequency[order] == pytest.approx(engine, rel=1e-3)
    assert exact.damping_ratio[order] == pytest.approx([0.222, 0.378, 0.313, 0.311, 0.253, 0.251], abs=1e-3)


def test_frames_pitch_on_wheelsets_that_roll_along_the_track(coach) -> None:
    """Pitch of frames of the multibody engine with rods and yaw dampers; without surge 11.71 Hz, 12.0 % damped.

    On a body that does not surge, and yaw dampers beside the springs, 11.43 Hz, 13.4 % damped, both.
    """
    bogies = []
    for bogie in coach.bogie:
        assert bogie.lateral is not None
        held = {"traction_rod": (5e6, 2.5e4, 0.6), "secondary_damping": (2.5e5 / 1.3**2, 32000.0)}
        held["yaw_damper_place"] = (1.3, 0.65)
        bogies.append(bogie.model_copy(update={"lateral": bogie.lateral.model_copy(update=held)}))
    exact = structure(coach.model_copy(update={"bogie": tuple(bogies)})).modes()
    pitching = (np.abs(exact.natural_frequency - 11.4) < 0.3).nonzero()[0]
    assert exact.natural_frequency[pitching] == pytest.approx([11.386, 11.456], rel=0.004)
    assert exact.damping_ratio[pitching] == pytest.approx([0.142, 0.149], rel=0.02)


def test_vertical_fits_and_lateral_motion_have_one_model(coach) -> None:
    """On equal sides roll, sway and yaw move by themselves, as cross level and alignment of the track move them."""
    whole, alone = structure(coach, speed=30.0).system, lateral_system(coach, speed=30.0)
    rows = np.array([whole.coordinates.index(name) for name in alone.coordinates])
    others = np.setdiff1d(np.arange(len(whole.coordinates)), rows)
    for name in ("mass", "damping", "stiffness"):
        matrix, largest = getattr(whole, name), np.abs(getattr(alone, name)).max()
        assert np.allclose(matrix[np.ix_(rows, rows)], getattr(alone, name), rtol=0, atol=1e-12 * largest)
        assert np.abs(matrix[np.ix_(others, rows)]).max() < 1e-12 * largest
    left, right = whole.input_matrix[rows, ::2], whole.input_matrix[rows, 1::2]
    rolled = coach.bogie[0].contact_half_spacing * (left - right)
    assert np.allclose(rolled, alone.input_matrix[:, 4:], rtol=1e-12)


def test_sensors_to_the_left_are_not_compared_with_a_rigid_body_that_only_rolls(coach) -> None:
    high = tuple(to_the_left(f"y{x}", "bogie1", x, 0.4) for x in (-1.2, 1.2))
    vehicle = coach.model_copy(update={"sensor": (*coach.sensor, *high)})
    run = simulate_drive(vehicle, RailDrive(duration=20.0, sampling_rate=50.0, speed=(30.0, 31.0)), seed=1).recording
    assert check_sensors(window_of(run, vehicle)).disagreement == 0


def test_an_accelerometer_to_the_left_reads_sway_yaw_roll_and_gravity(coach) -> None:
    sensor = Sensor(
        channel="y",
        quantity="acceleration",
        unit="m/s^2",
        position=(2.0, 0.0, 0.5),
        direction=(0.0, 1.0, 0.0),
        on="bogie1",
    )
    outputs = lateral_outputs(coach.model_copy(update={"sensor": (sensor, *coach.sensor)}))
    names = lateral_system(coach, speed=1.0).coordinates
    assert outputs.names == ("y",)  # vertical ones are no lateral sensors
    row = dict(zip(names, outputs.acceleration[0], strict=True))
    assert (row["bogie1_sway"], row["bogie1_roll"], row["bogie1_yaw"]) == (1.0, -0.5, 2.0)
    assert outputs.displacement[0][names.index("bogie1_roll")] == pytest.approx(STANDARD_GRAVITY)


def test_a_file_keeps_its_lateral_tables(coach) -> None:
    assert vehicle_from_text(vehicle_text(coach), source="text") == coach


def test_a_metro_car_hunts_beyond_its_speeds_and_sooner_with_worn_wheels() -> None:
    """Bisection ends where the least damped of the exact eigenvalues crosses the axis."""
    metro = read_vehicle("metro-b")
    critical = critical_speed(metro)
    assert critical is not None
    assert critical > 3 * 80 / 3.6
    assert lateral_modes(metro, speed=0.999 * critical).damping_ratio.min() > 0
    assert lateral_modes(metro, speed=1.001 * critical).damping_ratio.min() < 0
    worn = critical_speed(with_lateral(metro, {"conicity": np.log(3.0)}))
    assert worn is not None
    assert worn < critical


def test_what_a_file_lacks_is_said(coach) -> None:
    with pytest.raises(ParameterError, match=r"'zafira' has no \[\[bogie\]\] tables"):
        lateral_system(read_vehicle("zafira"), speed=10.0)
    with pytest.raises(ParameterError, match=r"'metro' has no \[bogie.lateral\] table for each"):
        lateral_system(read_vehicle("metro"), speed=10.0)
    flat = coach.model_copy(update={"body": coach.body.model_copy(update={"height": None})})
    with pytest.raises(ParameterError, match="has no height"):
        lateral_system(flat, speed=10.0)
    with pytest.raises(ParameterError, match="no lateral sensor: add"):
        lateral_outputs(coach)
