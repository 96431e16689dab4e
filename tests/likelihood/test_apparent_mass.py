"""Side forces and people on seats: vehicles that have them as coordinates of their own give their components."""

from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood import CornerSettings, rigid_layout, vehicle_model
from sprung.likelihood.apparent_mass import Seats, side_forces
from sprung.likelihood.search import minimised
from sprung.vehicles import Element, MountedMass, structure

MASS, HEIGHT, GRIP = 1480.0, 0.45, 170.0
PEOPLE = {"x": 0.3, "y": 0.25, "mass": 140.0}


@pytest.fixture
def model(car, classes):
    """Everything of a car on a road, at 12 and 13 m/s."""
    nominal = structure(car)
    layout = rigid_layout(nominal)
    return vehicle_model(
        classes(len(layout.rows), counts=200.0), layout, car, nominal, settings=CornerSettings(), kind="road"
    )


def swaying(car, speed):
    """Sway s of the centre of gravity; a damper m C' / v holds the tyres on the ground: elongation s + h r."""
    nominal = structure(car)
    elongation = np.array([HEIGHT * float(name == "roll") for name in nominal.coordinates] + [1.0])
    damper = Element("tyres", "lateral", elongation, 0.0, MASS * GRIP / speed)
    return nominal.with_coordinate("sway", damper, mass=MASS, motion=np.eye(elongation.size)[-1])


def seated(car):
    """People as a mass on mounts of a vehicle file."""
    return structure(
        car.model_copy(update={"mounted_mass": (MountedMass(**PEOPLE, frequency=4.8, damping_ratio=0.3),)})
    )


def with_spectra_of(model, vehicle):
    """The model with the exact spectra of a vehicle with one more coordinate on the same road."""
    layout = replace(model.layout, motion=np.pad(model.layout.motion, [(0, 0), (0, 1)]))
    blocks = tuple(block for block in model.blocks if block.group in {"inputs", "class_roughness", "noise"})
    real = replace(model, structure=vehicle, layout=layout, blocks=blocks)
    spectra = replace(model.spectra, matrices=real.matrix(real.start))
    return replace(model, spectra=spectra)


def errors(model):
    """Largest error of ln of a component, and the parameters."""
    parameters = minimised(model, model.scaled_start())
    return np.abs(parameters[model.rows("components")]).max(), parameters


def without(model, group):
    return replace(model, blocks=tuple(block for block in model.blocks if block.group != group))


def test_a_body_that_sways_over_its_tyres_gives_its_springs_and_dampers(car, model) -> None:
    speed = float(np.average(model.spectra.speeds, weights=model.spectra.counts))
    exact = with_spectra_of(model, swaying(car, speed))
    error, parameters = errors(exact)
    block, own = next((block, own) for block, own in exact.by_block(parameters) if block.group == "side_forces")
    assert block.values(own) == pytest.approx({"roll_height": HEIGHT, "cornering_stiffness": GRIP}, rel=0.1)
    assert error < 0.02
    assert errors(without(exact, "side_forces"))[0] > 0.1


def test_the_fitted_vehicle_rolls_as_over_its_tyres(car, model) -> None:
    """The poles of sway as a coordinate at the roll axis are those of sway at the centre of gravity; roll swings."""
    block = side_forces(model.structure, car.axle[0].x - car.axle[-1].x, 15.0)
    parameters = np.array([(HEIGHT / block.height) ** 2, np.log(GRIP / 150.0)])
    modes, expected = block.fitted(parameters, model.structure).modes(), swaying(car, 15.0).modes()
    assert modes.poles == pytest.approx(expected.poles, rel=1e-9)
    roll = modes.labels.index("roll")
    plain = model.structure.modes()
    assert modes.natural_frequency[roll] < 0.85 * plain.natural_frequency[plain.labels.index("roll")]
    assert modes.damping_ratio[roll] < 0.6


def test_people_on_seats_give_the_springs_and_dampers_of_the_vehicle(car, model) -> None:
    exact = with_spectra_of(model, seated(car))
    error, parameters = errors(exact)
    block, own = next((block, own) for block, own in exact.by_block(parameters) if block.group == "seats")
    expected = {"seat_mass": 140.0, "seat_x": 0.3, "seat_y": 0.25, "seat_frequency": 4.8}
    assert block.values(own) == pytest.approx(expected, rel=0.2)
    assert error < 0.03
    assert errors(without(exact, "seats"))[0] > 0.05


def test_neither_imitates_stiffness_by_a_mass_below_zero(car, model) -> None:
    """However far below 0 a parameter is, the mass matrix loses 5 % of the standard deviation at most."""
    terms = model.terms(model.start)
    body = float(model.structure.mass[0, 0])
    for block in (Seats(model.structure, 2.7, 1.5), side_forces(model.structure, 2.7, 15.0)):
        away = block.start.copy()
        away[0] = -10.0
        lost = block.contribute(away, terms).apparent_mass - terms.apparent_mass
        assert 0 > lost.real.min() > -0.05 * body * max(0.1, (0.17 * 2.7) ** 2)
        assert block.fitted(away, model.structure).coordinates == model.structure.coordinates
