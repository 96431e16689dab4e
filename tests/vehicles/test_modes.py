"""Exact modes of a mechanical system, in closed form."""

import numpy as np
import pytest

from sprung.recording import Channel
from sprung.vehicles import (
    MechanicalSystem,
    Outputs,
    chain,
    modes,
    participation,
)


def oscillator(mass, damping, stiffness, quantity="acceleration"):
    """A single mass on the ground with one sensor and one force."""
    order = {"acceleration": 0, "velocity": 1, "displacement": 2}[quantity]
    rows = [np.zeros((1, 1)) for _ in range(3)]
    rows[order] = np.ones((1, 1))
    m, c, k, b = (np.array([[value]]) for value in (mass, damping, stiffness, 1.0))
    system = MechanicalSystem(m, c, k, b, ("mass_1",), ("force_1",))
    return system, Outputs((Channel("y", quantity),), *rows)


def test_oscillator_has_its_textbook_pole() -> None:
    system, outputs = oscillator(2.0, 12.0, 800.0)
    found = modes(system, outputs)
    assert found.poles == pytest.approx([-3.0 + 1j * np.sqrt(400.0 - 9.0)])
    assert found.natural_frequency == pytest.approx([20.0 / (2 * np.pi)])
    assert found.damping_ratio == pytest.approx([0.15])


@pytest.mark.parametrize("damping", [80.0, 500.0])
def test_motion_without_oscillation_is_not_a_mode(damping) -> None:
    found = modes(*oscillator(2.0, damping, 800.0))
    assert found.poles.shape == (0,)
    assert found.mode_shapes.shape == (0, 1)
    assert found.labels == ()


def test_undamped_chain_has_the_closed_form_frequencies() -> None:
    """omega_j = 2 sqrt(k/m) sin((2j-1)/(2n+1) pi/2), R. D. Blevins, table 8-1."""
    n, number = 6, np.arange(1, 7)
    found = chain(n, mass=2.0, stiffness=450.0, damping=0.0).modes()
    expected = 2 * 15.0 * np.sin((2 * number - 1) / (2 * n + 1) * np.pi / 2) / (2 * np.pi)
    assert found.natural_frequency == pytest.approx(expected, rel=1e-12)
    assert found.damping_ratio == pytest.approx(np.zeros(n), abs=1e-12)


def test_stiffness_proportional_damping_gives_damping_ratios_that_rise_with_frequency() -> None:
    found = chain(4).modes()
    assert found.damping_ratio == pytest.approx(5.0 / 9800.0 / 2 * 2 * np.pi * found.natural_frequency, rel=1e-12)


def test_mode_shape_of_mixed_sensors_holds_powers_of_the_pole() -> None:
    """Acceleration, velocity and displacement of one mass are as s^2 to s to 1."""
    system, _ = oscillator(2.0, 12.0, 800.0)
    channels = tuple(Channel(name, name) for name in ("acceleration", "velocity", "displacement"))
    found = modes(system, Outputs(channels, *np.eye(3)[:, :, None]))
    s = found.poles[0]
    assert found.mode_shapes[0] == pytest.approx([1.0, 1 / s, 1 / s**2], rel=1e-12)


def test_mode_shapes_of_proportional_damping_are_real_and_orthogonal() -> None:
    shapes = chain(5).modes().mode_shapes
    assert np.abs(shapes.imag).max() < 1e-12
    gram = shapes.real @ shapes.real.T
    assert gram - np.diag(np.diag(gram)) == pytest.approx(np.zeros((5, 5)), abs=1e-12)
    assert np.abs(shapes).max(axis=1) == pytest.approx(np.ones(5))


def test_participation_sums_to_one() -> None:
    shares = participation(np.diag([2.0, 1.0]), np.array([[1.0, 1j], [0.0, 2.0]]))
    assert shares == pytest.approx(np.array([[2 / 3, 1 / 3], [0.0, 1.0]]))
