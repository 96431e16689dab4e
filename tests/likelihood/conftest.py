"""Models of a car with every block of parameters, and spectra that they give themselves."""

from collections.abc import Callable
from dataclasses import replace
from typing import Literal

import numpy as np
import pytest

from sprung._arrays import Real
from sprung.likelihood import (
    AddedMass,
    ClassRoughness,
    ClassSpectra,
    CornerSettings,
    FreeComponents,
    MassParameter,
    Model,
    ParameterBlock,
    RailInputs,
    RigInputs,
    RoadInputs,
    SensorNoise,
    rigid_layout,
    unsprung_masses,
    vehicle_model,
)
from sprung.likelihood.search import minimised
from sprung.likelihood.spectra import onto_grid, through_window
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, term_gradients, transfer
from sprung.likelihood.whittle import minus_log_likelihood
from sprung.vehicles import MountedMass, Seat, Sensor, Vehicle, read_vehicle, structure

SEGMENT = 5.12


@pytest.fixture(scope="session")
def car() -> Vehicle:
    """A car with an accelerometer above every wheel."""
    return read_vehicle("zafira")


def _classes(n_coordinates: int, *, counts: float = 9.0, n_classes: int = 6) -> ClassSpectra:
    """Speed classes without data."""
    f = np.arange(4, 100) / SEGMENT
    unit = np.broadcast_to(np.eye(n_coordinates, dtype=complex), (n_classes, f.size, n_coordinates, n_coordinates))
    speeds, spreads = np.geomspace(5, 20, n_classes), np.full(n_classes, 0.02)
    return ClassSpectra(f, np.full(n_classes, counts), speeds, spreads, unit, SEGMENT, np.full(unit.shape[:2], counts))


def _road_model(
    vehicle: Vehicle,
    *,
    spectra: ClassSpectra | None = None,
    parts: tuple[MassParameter, ...] = (),
    kind: Literal["road", "rail", "rig"] = "road",
) -> Model:
    """The model of a vehicle with all its corners free, and its inputs as parameters."""
    nominal = structure(vehicle)
    layout = rigid_layout(nominal)
    spectra = _classes(len(layout.rows)) if spectra is None else spectra
    free = tuple(component for component in nominal.components() if component.side)
    blocks: list[ParameterBlock] = [FreeComponents(nominal, free), *([AddedMass(parts)] if parts else [])]
    if kind == "rig":
        blocks.append(RigInputs(spectra, nominal.inputs, 1e-7))
    else:
        surface = RoadInputs if kind == "road" else RailInputs
        positions = np.repeat([axle.x for axle in vehicle.axle], 2)
        road = surface(spectra, positions, np.array([1.0, -1.0, 1.0, -1.0]))
        blocks += [road, ClassRoughness(spectra.counts.size)]
    return Model(nominal, layout, spectra, (*blocks, SensorNoise(layout)))


def _with_data(
    model: Model,
    parameters: Real,
    *,
    counts: float | None = None,
    generator: np.random.Generator | None = None,
) -> Model:
    """The model with the spectra that its own parameters give, exactly or drawn as Wishart matrices."""
    matrices = model.matrix(parameters)
    if generator is not None:
        n, size = int(model.spectra.counts[0]), matrices.shape[-1]
        draws = generator.standard_normal((2, *matrices.shape[:2], size, n)) / np.sqrt(2 * n)
        values = np.linalg.cholesky(matrices) @ (draws[0] + 1j * draws[1])
        matrices = values @ values.conj().swapaxes(-1, -2)
    spectra = replace(model.spectra, matrices=matrices)
    if counts is not None:
        spectra = replace(
            spectra, counts=np.full(spectra.counts.size, counts), weights=np.full(spectra.weights.shape, counts)
        )
    return replace(model, spectra=spectra)


def _somewhere(model: Model, seed: int = 0, size: float = 0.1) -> Real:
    """Random parameters near the start."""
    return model.start + size * np.random.default_rng(seed).standard_normal(model.start.size)


def _with_engine(car: Vehicle) -> Vehicle:
    """The car with a bar, bushings, tyres that corner, an engine with a sensor, seats, a gyroscope, raised sensors."""
    engine = MountedMass(mass=180.0, x=1.1, y=0.1, frequency=11.0, damping_ratio=0.08)
    front = {"anti_roll_stiffness": 10e3, "damper_bushing_stiffness": 60e3}
    tyres = {"cornering_stiffness": 60e3, "roll_centre_height": 0.1}
    axles = (car.axle[0].model_copy(update=front | tyres), *(axle.model_copy(update=tyres) for axle in car.axle[1:]))
    sensors = [
        sensor.model_copy(update={"position": (sensor.position[0], sensor.position[1], 0.3)})
        for sensor in car.sensor
        if sensor.position is not None
    ]
    on_engine = Sensor(channel="acc_engine", quantity="acceleration", unit="m/s^2", on="mounted_mass_1")
    roll = Sensor(channel="wx", quantity="angular_velocity", unit="deg/s", direction=(1.0, 0.0, 0.0))
    body = car.body.model_copy(update={"height": 0.55})
    seats = Seat(x=0.2, y=0.4, load=75.0), Seat(x=-0.7, load=100.0)
    whole = {
        "body": body,
        "mounted_mass": (engine,),
        "seat": seats,
        "axle": axles,
        "sensor": (*sensors, on_engine, roll),
    }
    return car.model_copy(update=whole)


@pytest.fixture(scope="session")
def somewhere() -> Callable[..., Real]:
    """Return a function from a model to random parameters near its start."""
    return _somewhere


@pytest.fixture(scope="session")
def classes() -> Callable[..., ClassSpectra]:
    """Return a function from a number of coordinates to speed classes without data."""
    return _classes


@pytest.fixture(scope="session")
def road_model() -> Callable[..., Model]:
    """Return a function from a vehicle to its model on a road."""
    return _road_model


@pytest.fixture(scope="session")
def with_data() -> Callable[..., Model]:
    """Return a function from a model and parameters to the model with the spectra that these give."""
    return _with_data


@pytest.fixture(scope="session")
def whole_model() -> Callable[..., Model]:
    """Return a function from a shipped vehicle and what drives it to a model with every block that it can have."""

    def model(name, kind):
        vehicle = read_vehicle(name)
        if name == "zafira":
            vehicle = _with_engine(vehicle)
        nominal = structure(vehicle)
        layout = rigid_layout(nominal)
        settings = CornerSettings(has_payload=True, has_free_sensors=True)
        spectra = _classes(len(layout.rows), n_classes=3)
        joints = {"joint_pitch": 18.0, "joint_offset": 0.3} if kind == "rail" else {}
        usual = vehicle_model(spectra, layout, vehicle, nominal, settings=settings, kind=kind, **joints)
        wheels = unsprung_masses(nominal)
        extra: tuple[ParameterBlock, ...] = (wheels,) if kind != "road" and wheels.parts else ()
        return replace(usual, blocks=(*usual.blocks[:-1], *extra, usual.blocks[-1]))

    return model


@pytest.fixture(scope="session")
def misfit() -> Callable[[Model, Terms], float]:
    """Return a function from a model and terms to their likelihood, without a prior."""
    return lambda model, terms: minus_log_likelihood(through_window(transfer(terms).spectral_matrix), model.spectra)[0]


@pytest.fixture(scope="session")
def gradients_of() -> Callable[[Model, Terms], TermGradients]:
    """Return a function from a model and terms to the gradients of the likelihood with respect to the terms."""

    def gradients(model, terms):
        response = transfer(terms)
        weight = minus_log_likelihood(through_window(response.spectral_matrix), model.spectra)[1]
        return term_gradients(response, onto_grid(weight))

    return gradients


@pytest.fixture(scope="session")
def recovered() -> Callable[..., Real]:
    """Return a function from a model and parameters to those that the exact spectra of these give, as the prior fades.

    By the search, and then by steps of Fisher scoring, which need no difference of large numbers.
    """

    def parameters(model, truth, largest=1e12):
        weak = _with_data(model, truth, counts=100.0)
        found = minimised(weak, weak.scaled_start())
        for counts in (*np.geomspace(1e2, largest, 8), *4 * [largest]):
            exact = _with_data(model, truth, counts=counts)
            information = exact.information(found) + np.diag(1 / exact.prior_std**2)
            found = found - np.linalg.solve(information, exact.objective(found)[1])
        return found

    return parameters
