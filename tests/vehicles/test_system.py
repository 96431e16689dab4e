"""Matrices, state space, modes and correlations against closed forms and other routes."""

import numpy as np
import pytest
import scipy.signal

from sprung.errors import ParameterError
from sprung.recording import Channel
from sprung.vehicles import (
    VEHICLES,
    MechanicalSystem,
    Outputs,
    StateSpace,
    chain,
    discretised,
    exact_correlations,
    modes,
    parse_vehicle,
    read_description,
    state_space,
    stationary_covariance,
    structure,
)

RATES = {
    "chain3": 500.0,
    "quarter": 1000.0,
    "zafira": 200.0,
    "zafira-printed": 200.0,
    "scale-bogie": 1500.0,
    "plate": 50.0,
    "y25": 600.0,
    "coach": 600.0,
    "metro": 600.0,
    "metro-b": 600.0,
    "y25-wagon": 600.0,
}
# Without vehicles on bogies: 34 states between 1 and 170 Hz, pairs of them alike, are too many for these references,
# which give bounce and pitch of a symmetric car a correlation of 5e-6. Their poles are tested in test_bogies.
ON_AXLES = [name for name in VEHICLES if name not in {"coach", "metro", "metro-b", "y25-wagon"}]


def oscillator(mass, damping, stiffness, quantity="acceleration"):
    """A single mass on the ground with one sensor and one force."""
    order = {"acceleration": 0, "velocity": 1, "displacement": 2}[quantity]
    rows = [np.zeros((1, 1)) for _ in range(3)]
    rows[order] = np.ones((1, 1))
    m, c, k, b = (np.array([[value]]) for value in (mass, damping, stiffness, 1.0))
    system = MechanicalSystem(m, c, k, b, ("mass_1",), ("force_1",))
    return system, Outputs((Channel("y", quantity),), *rows)


def with_wheel_sensors(name):
    """A shipped vehicle with sensors on its wheels too, so that every mode is seen."""
    fields = read_description(name).model_dump(exclude_defaults=True)
    wheels = [part for part in read_description(name).parts if part.startswith("wheel_")]
    extra = [
        {"channel": part, "quantity": "acceleration", "unit": "m/s^2", "on": part, "direction": [0.0, 0.0, 1.0]}
        for part in wheels
    ]
    return structure(parse_vehicle({**fields, "sensor": [*fields["sensor"], *extra]}))


def realised_poles(correlations, sampling_rate, order, block_rows):
    """Poles from correlations by a plain shift of the block Hankel matrix's column space."""
    n_channels = correlations.shape[0]
    hankel = np.block([[correlations[:, :, 1 + i + j] for j in range(block_rows)] for i in range(block_rows)])
    basis = np.linalg.svd(hankel)[0][:, :order]
    shift = np.linalg.lstsq(basis[:-n_channels], basis[n_channels:], rcond=None)[0]
    return np.log(np.linalg.eigvals(shift)) * sampling_rate


@pytest.mark.parametrize("quantity", ["acceleration", "velocity", "displacement"])
def test_transfer_function_of_every_motion(quantity) -> None:
    """(j w)^order / (k - m w^2 + j c w), the receptance, mobility and accelerance of an oscillator."""
    space = state_space(*oscillator(2.0, 12.0, 800.0, quantity))
    order = {"displacement": 0, "velocity": 1, "acceleration": 2}[quantity]
    for frequency in (0.3, 3.0, 30.0):
        s = 2j * np.pi * frequency
        gain = space.output_matrix @ np.linalg.solve(s * np.eye(2) - space.state_matrix, space.input_matrix)
        expected = s**order / (2.0 * s**2 + 12.0 * s + 800.0)
        assert (gain + space.feedthrough)[0, 0] == pytest.approx(expected, rel=1e-12)


@pytest.mark.parametrize("name", ON_AXLES)
def test_zero_order_hold_agrees_with_scipy(name) -> None:
    continuous = structure(read_description(name)).state_space()
    discrete = discretised(continuous, sampling_rate=RATES[name])
    matrices = (
        continuous.state_matrix,
        continuous.input_matrix,
        continuous.output_matrix,
        continuous.feedthrough,
    )
    expected = scipy.signal.cont2discrete(matrices, 1 / RATES[name], method="zoh")
    for ours, theirs in ((discrete.state_matrix, expected[0]), (discrete.input_matrix, expected[1])):
        assert ours == pytest.approx(theirs, rel=1e-9, abs=1e-13 * np.abs(theirs).max())


def test_free_mass_is_discretised_though_its_state_matrix_is_singular() -> None:
    """A constant force on a free mass: x = F t^2 / 2 m, v = F t / m."""
    system, outputs = oscillator(2.0, 0.0, 0.0)
    discrete = discretised(state_space(system, outputs), sampling_rate=10.0)
    assert discrete.state_matrix == pytest.approx(np.array([[1.0, 0.1], [0.0, 1.0]]))
    assert discrete.input_matrix.ravel() == pytest.approx([0.1**2 / 4, 0.1 / 2])
    with pytest.raises(ParameterError, match="give every coordinate a spring and a damper"):
        exact_correlations(discrete, n_lags=4)


@pytest.mark.parametrize("name", sorted(set(ON_AXLES) - {"y25"}))  # its load at 2 Hz is lost next to wheels at 177 Hz
def test_poles_come_back_from_exact_correlations(name) -> None:
    vehicle = with_wheel_sensors(name)
    correlations = exact_correlations(vehicle.discretised(RATES[name]), n_lags=24)
    exact = vehicle.modes().poles
    found = realised_poles(correlations, RATES[name], 2 * len(exact), 10)
    found = found[found.imag > 0]
    errors = np.abs(found[None] - exact[:, None]).min(axis=1) / np.abs(exact)
    assert errors.max() < 1e-9


@pytest.mark.parametrize("name", ON_AXLES)
def test_covariance_of_the_state_agrees_with_the_kronecker_solution(name) -> None:
    discrete = structure(read_description(name)).discretised(RATES[name])
    A, B = discrete.state_matrix, discrete.input_matrix
    found = stationary_covariance(A, B @ B.T)
    size = len(A)
    stacked = np.linalg.solve(np.eye(size**2) - np.kron(A, A), (B @ B.T).ravel()).reshape(size, size)
    scale = np.sqrt(np.outer(np.diag(stacked), np.diag(stacked)))
    assert found / scale == pytest.approx(stacked / scale, abs=1e-9)


def test_references_and_input_covariance() -> None:
    discrete = chain().discretised(500.0)
    covariance = np.diag([1.0, 4.0, 9.0])
    full = exact_correlations(discrete, n_lags=6, input_covariance=covariance)
    some = exact_correlations(discrete, n_lags=6, input_covariance=covariance, references=[2, 0])
    np.testing.assert_array_equal(some, full[:, [2, 0]])
    single = [
        exact_correlations(discrete, n_lags=6, input_covariance=np.diag(np.eye(3)[number])) for number in range(3)
    ]
    assert single[0] + 4 * single[1] + 9 * single[2] == pytest.approx(full)


def test_matrices_are_read_only() -> None:
    system = chain().system
    with pytest.raises(ValueError, match="read-only"):
        system.mass[0, 0] = 2.0


def test_contradicting_shapes_are_refused() -> None:
    eye = np.eye(2)
    with pytest.raises(ParameterError, match=r"damping has shape \(3, 3\), but must be \(2, 2\): 2 coordinates"):
        MechanicalSystem(eye, np.eye(3), eye, eye, ("a", "b"), ("f", "g"))
    with pytest.raises(ParameterError, match="not symmetric and positive definite: give every coordinate a mass"):
        MechanicalSystem(np.diag([1.0, 0.0]), eye, eye, eye, ("a", "b"), ("f", "g"))
    with pytest.raises(ParameterError, match=r"velocity has shape \(1, 2\), but must be \(2, 2\)"):
        Outputs((Channel("a"), Channel("b")), eye, np.ones((1, 2)), eye)
    with pytest.raises(ParameterError, match=r"feedthrough has shape \(2, 2\), but must be \(2, 1\)"):
        StateSpace(eye, np.ones((2, 1)), eye, eye)


@pytest.mark.parametrize("rate", [0.0, -1.0, np.nan])
def test_sampling_rate_must_be_positive(rate) -> None:
    with pytest.raises(ParameterError, match="sampling_rate"):
        chain().discretised(rate)


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
