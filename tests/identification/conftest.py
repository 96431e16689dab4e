"""Exact correlations of vehicles and measured ones of the chain."""

import functools
from collections.abc import Callable

import numpy as np
import pytest

from sprung import vehicles
from sprung._arrays import Complex
from sprung.identification.correlation import Correlations, average, correlate_segments, exact_correlations
from sprung.simulation import simulate, usual_excitation

BLOCK_ROWS = 20


@functools.cache
def _vehicle(name: str) -> vehicles.Structure:
    """A shipped vehicle, or the car with dampers that bring its body and wheels to 30 % and more."""
    if name != "zafira-firm":
        return vehicles.structure(vehicles.read_description(name))
    car = vehicles.read_vehicle("zafira")
    axles = tuple(axle.model_copy(update={"damping": 1.45 * axle.damping}) for axle in car.axle)
    return vehicles.structure(car.model_copy(update={"axle": axles}))


@functools.cache
def _known(name: str, rate: float, n_lags: int = 4 * BLOCK_ROWS) -> tuple[Correlations, Complex, Complex]:
    """Exact correlations of all sensors, each scaled to an RMS of 1, with the exact poles and shapes."""
    structure = _vehicle(name)
    values = vehicles.exact_correlations(structure.discretised(rate), n_lags=n_lags)
    rms = np.sqrt(np.diag(values[:, :, 0]))
    exact = structure.modes()
    correlations = exact_correlations(values / np.outer(rms, rms)[:, :, None], sampling_rate=rate)
    return correlations, exact.poles, exact.mode_shapes / rms


def _measured(
    seed: int, *, duration: float = 60.0, n_lags: int = 40, segment: float = 2.0, snr: float = 10.0
) -> Correlations:
    """Estimated correlations of a run of the chain, decimated by taking a rate of 125 Hz at once."""
    chain = _vehicle("chain3")
    run = simulate(chain, usual_excitation(chain), duration=duration, sampling_rate=125.0, snr=snr, seed=seed)
    return average(correlate_segments(run, n_lags=n_lags, segment=segment, is_continued=True))


@pytest.fixture(scope="session")
def vehicle() -> Callable[[str], vehicles.Structure]:
    """Return a function from a name to a vehicle."""
    return _vehicle


@pytest.fixture(scope="session")
def known() -> Callable[..., tuple[Correlations, Complex, Complex]]:
    """Return a function from a vehicle and a sampling rate to its exact correlations, poles and shapes."""
    return _known


@pytest.fixture(scope="session")
def measured() -> Callable[..., Correlations]:
    """Return a function from a seed to estimated correlations of the chain."""
    return _measured
