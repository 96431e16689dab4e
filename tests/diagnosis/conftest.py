"""Windows drawn from the model of the change tests."""

from collections.abc import Callable, Mapping
from typing import Any

import numpy as np
import pytest

from sprung._arrays import Real
from sprung.diagnosis import Baseline, Observation, learn
from sprung.diagnosis.scatter import shared_covariance
from sprung.vehicles import Component, read_vehicle, structure

COMPONENTS = tuple(structure(read_vehicle("zafira")).components())
COVARIANCE = 0.012**2 * (np.eye(12) + 0.3)
ENDS = {"spring": 0.004, "damper": 0.006, "tyre": 0.003}
NO_CHANGE: Mapping[str, float] = {}


def drawn_values(generator: np.random.Generator, covariance: Real) -> Real:
    """Values of a covariance; by Cholesky, as directions of equal variance come out differently from every library."""
    return np.linalg.cholesky(covariance) @ generator.standard_normal(len(covariance))


def drawn_window(
    generator: np.random.Generator, time: float, change: Mapping[str, float] = NO_CHANGE, **fields: Any
) -> Observation:
    values = drawn_values(generator, COVARIANCE + shared_covariance(COMPONENTS, ENDS))
    for name, size in change.items():
        values[COMPONENTS.index(Component.parse(name))] += np.log1p(size)
    conditions = {
        "payload": float(generator.uniform(0, 300)),
        "roughness": float(np.exp(generator.normal(-8, 1))),
        "speed": 12.0,
    }
    return Observation(time, COMPONENTS, values, COVARIANCE, conditions, {}, (), **fields)


@pytest.fixture(scope="session")
def drawn() -> Callable[[np.random.Generator, Real], Real]:
    """Return a function from a generator and a covariance to values."""
    return drawn_values


@pytest.fixture(scope="session")
def window() -> Callable[..., Observation]:
    """Return a function from a generator, a time [s] and changes by component to a window."""
    return drawn_window


@pytest.fixture(scope="session")
def healthy() -> Callable[..., list[Observation]]:
    """Return a function from a number and a seed to that many healthy windows."""

    def drawn_healthy(count: int, seed: int = 0) -> list[Observation]:
        generator = np.random.default_rng(seed)
        return [drawn_window(generator, 600.0 * k) for k in range(count)]

    return drawn_healthy


@pytest.fixture(scope="session")
def faulty() -> Callable[..., list[Observation]]:
    """Return a function from a seed and changes by component to healthy windows and then changed ones."""

    def drawn_faulty(seed: int, change: Mapping[str, float], *, before: int = 4, after: int = 6) -> list[Observation]:
        generator = np.random.default_rng([seed, 1])
        return [drawn_window(generator, 600.0 * k, change if k >= before else {}) for k in range(before + after)]

    return drawn_faulty


@pytest.fixture(scope="session")
def baseline(healthy) -> Baseline:
    """Twelve healthy windows."""
    return learn(healthy(12))


@pytest.fixture(scope="session")
def silent() -> Callable[[str], Observation]:
    """Return a function from a reason to an inconclusive window."""
    return lambda reason: Observation(0.0, (), np.zeros(0), np.zeros((0, 0)), {}, {}, (), reason=reason)
