"""Windows drawn from the model of the change tests."""

import numpy as np
import pytest

from sprung.diagnosis import Observation
from sprung.diagnosis.directions import usual_nuisance
from sprung.vehicles import Component

CORNERS = ("front_left", "front_right", "rear_left", "rear_right")
COMPONENTS = tuple(Component(corner, kind) for corner in CORNERS for kind in ("spring", "damper", "tyre"))
COVARIANCE = 0.012**2 * (np.eye(12) + 0.3)
ENDS = {"spring": 0.004, "damper": 0.006, "tyre": 0.003}


def drawn_window(generator, time, change=(), **fields):
    scatter = np.linalg.cholesky(COVARIANCE + usual_nuisance(COMPONENTS, ENDS))
    values = scatter @ generator.standard_normal(len(COMPONENTS))
    for name, size in dict(change).items():
        values[COMPONENTS.index(Component.parse(name))] += np.log1p(size)
    conditions = {
        "payload": float(generator.uniform(0, 300)),
        "roughness": float(np.exp(generator.normal(-8, 1))),
        "speed": 12.0,
    }
    return Observation(time, COMPONENTS, values, COVARIANCE, conditions, {}, (), **fields)


@pytest.fixture(scope="session")
def window():
    """Return a function from a generator, a time [s] and changes by component to a window."""
    return drawn_window


@pytest.fixture(scope="session")
def healthy():
    """Return a function from a number and a seed to that many healthy windows."""

    def drawn(count, seed=0):
        generator = np.random.default_rng(seed)
        return [drawn_window(generator, 600.0 * k) for k in range(count)]

    return drawn
