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
