"""A vehicle file from a data sheet: sums and frequencies are those of the sheet."""

from typing import Any

import numpy as np
import pytest

from sprung.calibration import DataSheet, described, tyre_stiffness
from sprung.calibration.data_sheet import tyre_size
from sprung.errors import ParameterError
from sprung.vehicles import parse_vehicle, structure, vehicle_from_text, vehicle_text

SHEET: dict[str, Any] = {"mass": 1350.0, "wheelbase": 2.65, "track": 1.5, "tyre": "205/55R16"}


def stated(value: float | None) -> float:
    """Return a value that a file must state."""
    assert value is not None
    return value


def test_masses_and_centre_of_gravity_are_those_of_the_sheet() -> None:
    vehicle = described(DataSheet(**SHEET, front_share=0.6))
    front, rear = vehicle.axle
    total = vehicle.body.mass + 2 * (stated(front.unsprung_mass) + stated(rear.unsprung_mass))
    assert total == pytest.approx(1350, abs=0.1)
    assert front.x - rear.x == pytest.approx(2.65, abs=1e-3)
    on_front = vehicle.body.mass * -rear.x / 2.65 + 2 * stated(front.unsprung_mass)
    assert on_front / total == pytest.approx(0.6, abs=1e-3)


def test_spring_and_tyre_together_have_the_ride_frequency() -> None:
    vehicle = described(DataSheet(**SHEET, ride_frequencies=(1.1, 1.5)))
    loads = vehicle.body.mass * np.array([-vehicle.axle[1].x, vehicle.axle[0].x]) / 2.65 / 2
    for axle, load, frequency in zip(vehicle.axle, loads, (1.1, 1.5), strict=True):
        ride = 1 / (1 / stated(axle.spring_stiffness) + 1 / stated(axle.tyre_stiffness))
        assert np.sqrt(ride / load) / (2 * np.pi) == pytest.approx(frequency, rel=1e-3)


BUS: dict[str, Any] = {
    "mass": 16_240.0,
    "wheelbase": (6.8, 8.2),
    "track": 2.0,
    "tyre": ("275/70R22.5", "2x275/70R22.5", "275/70R22.5"),
    "axle_loads": (5400.0, 7000.0, 3840.0),
    "height": 3.1,
    "pressure": 8e5,
}


def test_a_bus_of_three_axles_stands_on_its_axles_as_stated() -> None:
    vehicle = described(DataSheet(**BUS))
    assert [round(vehicle.axle[0].x - axle.x, 3) for axle in vehicle.axle] == [0, 6.8, 8.2]
    moment = 0.0
    for axle, load, frequency in zip(vehicle.axle, BUS["axle_loads"], (1.2, 1.4, 1.4), strict=True):
        above = load - stated(axle.wheelset_mass)
        ride = 1 / (1 / stated(axle.spring_stiffness) + 1 / stated(axle.tyre_stiffness))
        assert np.sqrt(ride / (above / 2)) / (2 * np.pi) == pytest.approx(frequency, rel=1e-3)
        moment += above * axle.x
    assert moment == pytest.approx(0, abs=2)
    front, drive, _ = (stated(axle.tyre_stiffness) for axle in vehicle.axle)
    assert drive == pytest.approx(2 * front, abs=1)
    assert [sensor.channel for sensor in vehicle.sensor] == ["acc_fl", "acc_fr", "acc_2l", "acc_2r", "acc_rl", "acc_rr"]
    assert {entry.name for entry in vehicle.learnt} >= {"axle2.tyre_stiffness", "rear.damping", "body.centre_x"}
    assert {"bounce", "pitch", "roll"} <= set(structure(vehicle).modes().labels)


def test_inertias_height_and_tyres_of_a_bus_are_within_their_width_of_those_of_another_engine() -> None:
    """The single-deck bus of the multibody benchmark."""
    guess = {entry.name: entry for entry in described(DataSheet(**BUS)).learnt}
    true = {"body.roll_inertia": 14_500.0, "body.pitch_inertia": 165_000.0, "body.height": 1.25}
    true |= {"front.cornering_stiffness": 260e3, "axle2.cornering_stiffness": 480e3}
    for name, value in true.items():
        assert abs(guess[name].value - value) < 2 * guess[name].std, name


def test_axles_are_rigid_where_the_sheet_says_so_and_by_default_under_heavy_vehicles() -> None:
    def rigid(**changes: Any) -> list[bool]:
        return [axle.wheelset_mass is not None for axle in described(DataSheet(**{**SHEET, **changes})).axle]

    van = {"mass": 2600.0, "wheelbase": 3.3, "height": 2.5, "pressure": 3.5e5}
    assert (rigid(), rigid(**van), rigid(**BUS)) == ([False, False], [False, True], [True, True, True])
    assert rigid(rigid_axles=("front", "rear")) == [True, True]
    assert rigid(**BUS, rigid_axles=()) == [False, False, False]
    rear = described(DataSheet(**{**SHEET, "rigid_axles": ("rear",)})).axle[1]
    assert rear.half_track < stated(rear.contact_half_track) == 0.75


def test_seats_are_between_the_axles_for_as_many_people_as_stated() -> None:
    def seats(**changes: Any) -> list[tuple[float, float, float]]:
        vehicle = described(DataSheet(**{**SHEET, **changes}))
        return [(round(vehicle.axle[0].x - seat.x, 2), seat.y, seat.load) for seat in vehicle.seat]

    van = {"mass": 2600.0, "wheelbase": 3.3, "height": 2.5, "pressure": 3.5e5}
    assert seats() == [(1.27, 0.36, 75.0), (1.27, -0.36, 75.0), (2.17, 0.0, 130.0)]
    assert seats(seats=1) == [(1.27, 0.36, 75.0)]
    assert [place[0] for place in seats(**van)] == [0.99, 0.99]
    assert seats(**BUS) == seats(seats=0) == []
    assert seats(**BUS, seats=40) == [(x, y, 750.0) for x in (1.64, 6.56) for y in (0.48, -0.48)]


def test_guesses_are_within_their_width_of_a_measured_car(hatchback) -> None:
    """The hatchback of the tests, and the tyres of the shipped car."""
    sheet = DataSheet(mass=1194.0, wheelbase=2.55, track=1.47, tyre="185/60R15", front_share=0.597)
    guess = {entry.name: entry for entry in described(sheet).learnt}
    for where, axle in zip(("front", "rear"), hatchback.axle, strict=True):
        for field in ("spring_stiffness", "damping", "tyre_stiffness", "unsprung_mass"):
            entry = guess[f"{where}.{field}"]
            assert abs(getattr(axle, field) - entry.value) < 2 * entry.std
    assert tyre_stiffness("205/55R16") == pytest.approx(191e3, rel=0.2)


def test_a_description_is_a_vehicle_file() -> None:
    for sensors, n_outputs in (("corners", 4), ("imu", 3), ("travel", 4)):
        vehicle = described(DataSheet(**{**SHEET, "sensors": sensors}))
        assert vehicle_from_text(vehicle_text(vehicle), source="text") == vehicle
        assert len(structure(vehicle).outputs.names) == n_outputs
        assert parse_vehicle(vehicle.model_dump(mode="json", exclude_defaults=True) | {"kind": "road"}) == vehicle


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"tyre": "16 inch"}, "tyre='16 inch' is not a size: write width/aspect ratio R rim"),
        ({"mass": 12.0}, "mass"),
        ({"ride_frequencies": (1.2, 9.0)}, "ride_frequencies"),
        ({"sensors": "all"}, "sensors"),
        ({"wheelbase": (6.8, 8.2)}, "3 axles need the mass on each of them"),
        ({"axle_loads": (800.0,)}, "axle_loads has 1 value for 2 axles"),
        ({"axle_loads": (800.0, 800.0)}, "axle_loads add up to 1600 kg, but the mass is 1350 kg"),
        ({"wheelbase": (6.8, 6.9)}, "wheelbase"),
        ({"rigid_axles": ("axle2",)}, "rigid_axles"),
        ({"seats": -1}, "seats"),
    ],
)
def test_impossible_sheets_are_refused(change, message) -> None:
    with pytest.raises(ParameterError, match=message):
        DataSheet(**{**SHEET, **change})


def test_soft_tyres_are_refused() -> None:
    with pytest.raises(ParameterError, match="need a stiffness of"):
        described(DataSheet(**{**SHEET, "mass": 4000.0}, ride_frequencies=(2.5, 2.5)))


def test_sizes_of_vans_and_sports_cars_are_read() -> None:
    assert tyre_size("225/40 ZR18") == pytest.approx((0.225, 0.6372))
    assert tyre_size("205/65R16C")[0] == 0.205
