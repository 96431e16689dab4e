from dataclasses import replace

import numpy as np
import pytest

from sprung.likelihood import ClassSpectra, Model, RoadInputs, SensorChange, rigid_layout
from sprung.vehicles import read_vehicle, structure

SEGMENT = 5.12


@pytest.fixture(scope="session")
def car():
    return read_vehicle("zafira")


def _classes(n_coordinates, *, counts=9.0, n_classes=6):
    """Speed classes without data."""
    f = np.arange(4, 100) / SEGMENT
    unit = np.broadcast_to(np.eye(n_coordinates), (n_classes, f.size, n_coordinates, n_coordinates))
    speeds, spreads = np.geomspace(5, 20, n_classes), np.full(n_classes, 0.02)
    return ClassSpectra(f, np.full(n_classes, counts), speeds, spreads, unit, SEGMENT, np.full(unit.shape[:2], counts))


def _road_model(vehicle, *, spectra=None, masses=(), model=None, sensors=False, **options):
    """The model of a vehicle on a road with all its corners free."""
    model = structure(vehicle) if model is None else model
    layout = rigid_layout(model)
    spectra = _classes(len(layout.rows)) if spectra is None else spectra
    free = tuple(component for component in model.components() if component.side)
    inputs = RoadInputs(spectra, np.repeat([axle.x for axle in vehicle.axle], 2), np.array([1.0, -1.0, 1.0, -1.0]))
    changes = ()
    if sensors:
        ahead = np.zeros(layout.motion.shape)
        ahead[0, model.coordinates.index("pitch")] = -1.0
        changes = (SensorChange("ahead", 0.1, motion=ahead), SensorChange("lag", 0.01, channel=1))
    return Model(model, layout, spectra, inputs, free, masses=masses, sensors=changes, **options)


def _with_data(model, parameters, *, counts=None, generator=None):
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
    return replace(model, spectra=spectra, inputs=replace(model.inputs, spectra=spectra))


@pytest.fixture(scope="session")
def classes():
    return _classes


@pytest.fixture(scope="session")
def road_model():
    return _road_model


@pytest.fixture(scope="session")
def with_data():
    return _with_data
