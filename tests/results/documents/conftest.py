"""Drives and windows of which documents are written, and comparisons of what is read again."""

import json
from collections.abc import Callable
from dataclasses import fields
from typing import Any

import numpy as np
import pytest

import sprung
from sprung.results.documents import document_text
from sprung.simulation import SimulatedDrive
from sprung.vehicles import Component

_COMPONENTS = tuple(
    Component(f"{axle}_{side}", kind)
    for axle in ("front", "rear")
    for side in ("left", "right")
    for kind in ("spring", "damper", "tyre")
)


def _window(generator, time, *, change=0.0):
    values = 0.02 * generator.standard_normal(12)
    values[0] += change
    conditions = {name: float(generator.uniform(1, 2)) for name in ("payload", "roughness", "speed")}
    modes = {"roll": (2.0, 0.2)}
    return sprung.Observation(time, _COMPONENTS, values, 0.02**2 * np.eye(12), conditions, modes, (), vehicle="car")


@pytest.fixture(scope="session")
def drive() -> SimulatedDrive:
    """Two minutes with a soft spring."""
    fault = sprung.parse_fault("front_left.spring=-0.3")
    settings = sprung.RoadDrive(duration=120.0, faults=(fault,), snr=50.0)
    return sprung.simulate_drive(sprung.read_vehicle("zafira"), settings, seed=1)


@pytest.fixture(scope="session")
def observations() -> list[sprung.Observation]:
    """Eight healthy windows and six with a softer spring."""
    generator = np.random.default_rng(1)
    return [_window(generator, 600.0 * k, change=-0.4 if k >= 8 else 0.0) for k in range(14)]


@pytest.fixture(scope="session")
def baseline(observations) -> sprung.Baseline:
    """Learnt from the healthy windows."""
    return sprung.learn(observations[:8])


def _same(one: Any, other: Any) -> bool:
    """Whether two values are equal, field by field and array by array; NaN equals NaN."""
    if hasattr(one, "__dataclass_fields__"):
        return type(one) is type(other) and all(
            _same(getattr(one, field.name), getattr(other, field.name)) for field in fields(one)
        )
    if isinstance(one, np.ndarray):
        return np.array_equal(one, other, equal_nan=True)
    if isinstance(one, tuple | list):
        return len(one) == len(other) and all(map(_same, one, other))
    return one == other


@pytest.fixture(scope="session")
def same() -> Callable[[Any, Any], bool]:
    """Return a function that compares two values field by field and array by array; NaN equals NaN."""
    return _same


@pytest.fixture(scope="session")
def plain(check_document) -> Callable[[Any], Any]:
    """Return a function from a document to its fields as a reader of its JSON text has them, checked by its schema."""
    return lambda document: check_document(json.loads(document_text(document)))


@pytest.fixture(scope="session")
def identification() -> sprung.Identification:
    """Two subsets of a minute of the chain of three masses."""
    chain = sprung.structure(sprung.read_description("chain3"))
    run = sprung.simulate(chain, sprung.usual_excitation(chain), duration=60.0, sampling_rate=200.0, snr=10, seed=1)
    return sprung.coss_ssi(run, settings=sprung.IdentificationSettings(n_subsets=2, lifter=sprung.ShortPass(2.0)))
