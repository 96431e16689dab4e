"""Payload as parameters of the mass matrix."""

import numpy as np
import pytest

from sprung.likelihood import CornerSettings, rigid_layout, vehicle_model
from sprung.likelihood.corners import CornerFit
from sprung.likelihood.masses import SeatLoads, payload, unsprung_masses
from sprung.likelihood.search import minimised
from sprung.likelihood.spectra import OVERCOUNT
from sprung.vehicles import MountedMass, Seat, read_vehicle, structure


@pytest.mark.parametrize("place", [{"x": -1.0}, {"y": 0.4}, {}, {"x": -1.3, "y": -0.35}])
def test_a_point_mass_is_mass_moments_inertias_and_product(car, place) -> None:
    """m, m x, m y, m x^2, m y^2 and m x y in their units: the mass matrix of the structure with that payload."""
    nominal = structure(car)
    block = payload(nominal)
    x, y, mass = place.get("x", 0.0), place.get("y", 0.0), 120.0
    wanted = np.array([mass, -mass * x, mass * y, mass * x**2, mass * y**2, -mass * x * y])
    parameters = wanted / [part.unit for part in block.parts]
    expected = nominal.with_payload(mass, **place).mass
    np.testing.assert_allclose(block.fitted(parameters, nominal).mass, expected, rtol=1e-9, atol=1e-9)
    assert block.values(parameters) == pytest.approx(dict(zip(block.names, wanted, strict=True)))


def test_a_point_mass_ahead_and_above_moves_a_body_that_sways(car) -> None:
    """It moves up by [1, -x] with bounce and pitch, and to the left by [1, x, -z] with sway, yaw and roll."""
    tyres = tuple(axle.model_copy(update={"cornering_stiffness": 60e3}) for axle in car.axle)
    body = car.body.model_copy(update={"height": 0.55})
    nominal = structure(car.model_copy(update={"axle": tyres, "body": body}))
    m, x, z = 90.0, 0.8, 0.4
    added = payload(nominal)
    sizes = dict(zip(added.names, [part.unit for part in added.parts], strict=True))
    known = {"payload_mass": m, "payload_x_moment": -m * x, "payload_pitch_inertia": m * x**2}
    known |= {"payload_roll_inertia": m * z**2, "payload_z_moment": m * z}
    parameters = np.array([known.get(name, 0.0) / size for name, size in sizes.items()])
    upwards, sideways = np.array([1, -x, 0, 0, 0]), np.array([0, 0, -z, 1, x])
    expected = m * (np.outer(upwards, upwards) + np.outer(sideways, sideways))
    expected[2, 4] = expected[4, 2] = 0.0  # roll with yaw is left out
    assert nominal.coordinates[:5] == ("bounce", "pitch", "roll", "sway", "yaw")
    assert (added.fitted(parameters, nominal).mass - nominal.mass)[:5, :5] == pytest.approx(expected, abs=1e-9)


def test_the_prior_is_a_fifth_of_the_body(car) -> None:
    block = payload(structure(car))
    sizes = block.values(block.prior_std)
    assert sizes["payload_mass"] == pytest.approx(0.2 * car.body.mass)
    assert sizes["payload_roll_inertia"] == pytest.approx(0.2 * car.body.roll_inertia)
    between = np.sqrt(car.body.pitch_inertia * car.body.roll_inertia)
    assert sizes["payload_product"] == pytest.approx(0.1 * between)
    assert sizes["payload_x_moment"] == pytest.approx(0.1 * np.sqrt(car.body.mass * car.body.pitch_inertia))


def test_unsprung_masses_are_those_of_wheels_or_wheelsets(car) -> None:
    nominal = structure(car)
    block = unsprung_masses(nominal)
    assert block.names == ("front_unsprung_mass", "rear_unsprung_mass")
    heavier = block.fitted(np.array([0.1, 0.0]), nominal).mass - nominal.mass
    assert np.diag(heavier) == pytest.approx([0, 0, 0, 4.05, 4.05, 0, 0], abs=1e-9)
    assert block.values(np.array([0.1, 0.2])) == pytest.approx({"front_unsprung_mass": 4.05, "rear_unsprung_mass": 8.1})
    wagon = structure(read_vehicle("y25"))
    parts = unsprung_masses(wagon)
    grown = parts.fitted(np.ones(len(parts.names)), wagon).mass
    rows = [row for row, name in enumerate(wagon.coordinates) if name.startswith("wheelset")]
    assert np.diag(grown)[rows] == pytest.approx(2 * np.diag(wagon.mass)[rows])


def test_people_on_seats_are_masses_on_mounts_without_coordinates(car, classes) -> None:
    """The spectra of a car whose seats carry 150 and 60 kg are those of one with these masses on mounts."""
    places = ({"x": 0.3, "y": 0.4}, {"x": -0.8, "y": -0.3})
    seats = tuple(Seat(load=75.0, frequency=4.2, damping_ratio=0.25, **place) for place in places)
    people = tuple(
        MountedMass(mass=mass, frequency=4.2, damping_ratio=0.25, **place)
        for mass, place in zip((150.0, 60.0), places, strict=True)
    )
    matrices = []
    for carried, loads in (({"seat": seats}, [2.0, 0.8]), ({"mounted_mass": people}, [])):
        vehicle = car.model_copy(update=carried)
        nominal = structure(vehicle)
        layout = rigid_layout(nominal)
        spectra = classes(len(layout.rows))
        model = vehicle_model(spectra, layout, vehicle, nominal, settings=CornerSettings(), kind="road")
        parameters = model.start.copy()
        parameters[[row for row, name in enumerate(model.names) if name.startswith("seat_")]] = loads
        matrices.append(model.matrix(parameters))
    on_seats, on_mounts = matrices
    np.testing.assert_allclose(on_seats, on_mounts, rtol=1e-9, atol=1e-12 * np.abs(on_mounts).max())


def test_people_on_a_seat_move_sideways_with_the_body(car) -> None:
    """In sway and yaw they are a mass m at x, as in the fitted structure they are upwards."""
    tyres = tuple(axle.model_copy(update={"cornering_stiffness": 60e3}) for axle in car.axle)
    nominal = structure(car.model_copy(update={"axle": tyres, "body": car.body.model_copy(update={"height": 0.55})}))
    x, y = 0.8, -0.4
    seats = SeatLoads(nominal, (Seat(x=x, y=y, load=50.0),))
    upwards, sideways = np.array([1, -x, y, 0, 0]), np.array([0, 0, 0, 1, x])
    expected = 90.0 * (np.outer(upwards, upwards) + np.outer(sideways, sideways))
    found = (seats.fitted(np.array([1.8]), nominal).mass - nominal.mass)[:5, :5]
    assert found == pytest.approx(expected, abs=1e-9)


def test_a_payload_is_stated_with_the_people_on_seats(car, classes, with_data) -> None:
    """The fitted payload is the sum, with the deviation of the sum; each seat is stated by itself."""
    vehicle = car.model_copy(update={"seat": (Seat(x=0.3, y=0.4, load=75.0),)})
    nominal = structure(vehicle)
    layout = rigid_layout(nominal)
    model = vehicle_model(classes(len(layout.rows)), layout, vehicle, nominal, settings=CornerSettings(), kind="road")
    rows = [model.names.index(name) for name in ("payload_mass", "seat_1")]
    parameters, covariance = model.start.copy(), 0.01 * np.eye(model.start.size)
    parameters[rows] = 0.05, 1.2
    covariance[rows[0], rows[1]] = covariance[rows[1], rows[0]] = -0.004
    fit = CornerFit(model, parameters, covariance, np.zeros((3, 1)), 0.0, 1, 0, notes=())
    body = car.body.mass
    expected = np.sqrt(0.01 * body**2 + 0.01 * 75.0**2 - 2 * 0.004 * body * 75.0)
    assert fit.payload["payload_mass"] == pytest.approx({"value": 0.05 * body + 90.0, "std": expected})
    assert fit.payload["seat_1"] == pytest.approx({"value": 90.0, "std": 7.5})
    assert fit.payload["payload_y_moment"]["value"] == pytest.approx(36.0)


@pytest.mark.slow
@pytest.mark.parametrize("heavier", [0.08, -0.08])
def test_wheels_heavier_than_the_file_states_are_in_the_uncertainty(car, classes, with_data, heavier) -> None:
    """Every stiffness and damping is within 1.96 standard deviations, with exact spectra of ten minutes."""
    nominal = structure(car)
    layout = rigid_layout(nominal)
    spectra = classes(len(layout.rows), counts=20.0)
    model = vehicle_model(spectra, layout, car, nominal, settings=CornerSettings(), kind="road")
    truth = model.start.copy()
    truth[model.rows("unsprung")] = heavier
    exact = with_data(model, truth)
    fit = minimised(exact, exact.scaled_start())
    information = exact.information(fit) / OVERCOUNT
    std = np.sqrt(np.diag(np.linalg.inv(information + np.diag(1 / exact.prior_std**2))))
    rows = model.rows("components")
    assert np.abs(fit[rows]).min() > 0.03  # the file's masses make all of them wrong together
    assert np.all(np.abs(fit[rows]) < 1.96 * std[rows])
