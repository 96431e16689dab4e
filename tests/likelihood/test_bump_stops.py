"""Stiffening of springs: a body on four springs, integrated here, one of them on a stop that stiffens it."""

import numpy as np
import pytest

from sprung._arrays import Real
from sprung.likelihood import rigid_layout
from sprung.likelihood.bump_stops import SETTINGS, Stiffening, stiffening
from sprung.recording import Channel, Recording
from sprung.vehicles import read_vehicle, structure

STEP, EVERY = 0.005, 8


def drive(stop: float, gap: float, seed: int, corner: int = 0) -> tuple[Stiffening, Real]:
    """Return what is found of a body over white velocity of its feet in one plane, and the travels, (4, samples)."""
    vehicle = structure(read_vehicle("zafira"))
    springs = [element for element in vehicle.elements if element.part == "suspension"]
    E = np.array([spring.elongation[:3] for spring in springs])
    k = np.array([spring.stiffness for spring in springs])
    c = SETTINGS.lag * k
    flexibility = np.linalg.inv(vehicle.mass[:3, :3])
    n = round(300 / STEP)
    feet = np.cumsum(0.001 * np.random.default_rng(seed).standard_normal((n, 4)), axis=0) @ np.linalg.pinv(E).T @ E.T
    speeds = np.gradient(feet, STEP, axis=0)
    stops = stop * k * (np.arange(4) == corner)
    q, rate = np.zeros(3), np.zeros(3)
    accelerations, travels = np.empty((n, 3)), np.empty((n, 4))
    for step in range(n):
        inwards = feet[step] - E @ q  # positive as the wheel moves up
        force = k * inwards + c * (speeds[step] - E @ rate) + stops * np.maximum(inwards - gap, 0)
        accelerations[step], travels[step] = flexibility @ E.T @ force, inwards
        rate = rate + STEP * accelerations[step]
        q = q + STEP * rate
    outputs = vehicle.outputs.acceleration[:, :3] @ accelerations.T
    rows = tuple(Channel(name, "acceleration") for name in vehicle.outputs.names)
    means = outputs.reshape(len(outputs), -1, EVERY).mean(axis=2)
    run = Recording(means, 1 / STEP / EVERY, rows)
    found = stiffening(run, rigid_layout(vehicle), vehicle)
    assert found is not None
    return found, travels


@pytest.mark.slow  # three drives of five minutes, a step of the integration at a time
def test_a_stop_shows_at_its_corner_by_the_expansion_of_hermite() -> None:
    linear, _ = drive(0.0, 0.0, seed=1)
    assert np.all(np.abs(linear.values) < 4 * np.sqrt(np.diag(linear.covariance)))
    for seed, gap, corner in ((2, 0.0, 1), (3, 0.03, 2)):
        found, travels = drive(1.0, gap, seed=seed, corner=corner)
        own = travels[:, corner]
        # The stop pushes the wheel out, so that the middle of the travel is not at rest.
        expected = np.exp(-((gap - own.mean()) ** 2) / (2 * own.var())) / np.sqrt(2 * np.pi)
        assert found.values[corner] == pytest.approx(expected, abs=0.08)
        others = np.delete(found.values, corner)
        assert np.all(np.abs(others) < 4 * np.sqrt(np.delete(np.diag(found.covariance), corner)))


def test_springs_of_bogies_and_short_drives_have_none() -> None:
    vehicle = structure(read_vehicle("zafira"))
    short = Recording(np.ones((4, 2000)), 25.0, tuple(Channel(name, "acceleration") for name in vehicle.outputs.names))
    assert stiffening(short, rigid_layout(vehicle), vehicle) is None
    coach = structure(read_vehicle("coach"))
    assert stiffening(short, rigid_layout(coach), coach) is None
