"""Linear mechanical systems: matrices, state space and exact correlations."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sprung._arrays import Complex, Indices, Real
from sprung._checks import check_number, freeze, frozen_array
from sprung.errors import ParameterError
from sprung.modal import damping_ratio, natural_frequency, unit_shapes
from sprung.recording import Channel


@dataclass(frozen=True, eq=False, slots=True)
class MechanicalSystem:
    """Mass, damping and stiffness matrices of a system, and its inputs.

    Parameters
    ----------
    mass
        Mass matrix [kg; kg m^2 for rotations], symmetric and positive definite, shape (n, n).
    damping, stiffness
        Damping matrix [N s/m; N m s for rotations] and stiffness matrix [N/m; N m], shape (n, n).
    input_matrix
        Generalised forces for one unit of each input, shape (n, inputs): ones and zeros for forces [N], tyre stiffness
        [N/m] for base displacements [m].
    coordinates
        Names of the n coordinates.
    inputs
        Names of the inputs.
    arm_elongations
        Elongation of each damper in series with a bushing for one unit of each coordinate, shape (arms, n).
    arm_stiffness, arm_damping
        Stiffness of the bushing [N/m] and damping of the damper [N s/m] of each arm, above 0, shape (arms,).

    Raises
    ------
    ParameterError
        If shapes or names are inconsistent, or the mass matrix is not symmetric and positive definite.

    Notes
    -----
    The equation of motion is M q'' + C q' + K q + A^T k (A q - z) = B u, with the elongation z of the dampers behind
    bushings: c z' = k (A q - z).
    """

    mass: Real
    damping: Real
    stiffness: Real
    input_matrix: Real
    coordinates: tuple[str, ...]
    inputs: tuple[str, ...]
    arm_elongations: Real = field(default_factory=lambda: np.zeros((0, 0)))
    arm_stiffness: Real = field(default_factory=lambda: np.zeros(0))
    arm_damping: Real = field(default_factory=lambda: np.zeros(0))

    def __post_init__(self) -> None:
        n = len(self.coordinates)
        if self.arm_elongations.size == 0:
            object.__setattr__(self, "arm_elongations", np.zeros((0, n)))
        freeze(self, mass=2, damping=2, stiffness=2, input_matrix=2, arm_elongations=2)
        freeze(self, arm_stiffness=1, arm_damping=1)
        shapes = {"mass": (n, n), "damping": (n, n), "stiffness": (n, n), "input_matrix": (n, len(self.inputs))}
        _check_shapes(self, shapes, reason=f"{n} coordinates and {len(self.inputs)} inputs are named")
        if not np.allclose(self.mass, self.mass.T) or np.linalg.eigvalsh(self.mass)[0] <= 0:
            raise ParameterError(
                "the mass matrix is not symmetric and positive definite: give every coordinate a mass above 0"
            )

    @property
    def n_coordinates(self) -> int:
        """Number of degrees of freedom."""
        return len(self.coordinates)

    def accelerations(self) -> Real:
        """Return q'' for one unit of each state of [q, q', z], shape (n, 2 n + arms)."""
        held = (self.arm_elongations.T * self.arm_stiffness) @ self.arm_elongations
        released = -self.arm_elongations.T * self.arm_stiffness
        return np.asarray(-np.linalg.solve(self.mass, np.hstack([self.stiffness + held, self.damping, released])))

    def state_matrix(self) -> Real:
        """Return A of x' = A x + B u with the state [q, q', z], shape (2 n + arms, 2 n + arms)."""
        n, n_arms = self.n_coordinates, self.arm_damping.size
        rates = self.arm_stiffness / self.arm_damping
        arms = np.hstack([rates[:, None] * self.arm_elongations, np.zeros((n_arms, n)), -np.diag(rates)])
        return np.vstack([np.eye(n, 2 * n + n_arms, k=n), self.accelerations(), arms])


@dataclass(frozen=True, eq=False, slots=True)
class Outputs:
    """Output matrices of the sensors: y = Ya q'' + Yv q' + Yd q.

    Parameters
    ----------
    channels
        Channel of each row of the matrices.
    acceleration, velocity, displacement
        Matrices Ya, Yv and Yd, shape (channels, n); each sensor has its row in one of them, and an accelerometer shares
        of its velocity and its angle in the others (of a body that turns, of gravity), else zeros.
    """

    channels: tuple[Channel, ...]
    acceleration: Real
    velocity: Real
    displacement: Real

    def __post_init__(self) -> None:
        freeze(self, acceleration=2, velocity=2, displacement=2)
        shape = (len(self.channels), self.acceleration.shape[1])
        shapes = {"acceleration": shape, "velocity": shape, "displacement": shape}
        _check_shapes(self, shapes, reason=f"{len(self.channels)} channels are described")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the channels, in the order of the rows."""
        return tuple(channel.name for channel in self.channels)

    @property
    def orders(self) -> Indices:
        """Order of the time derivative that each sensor measures, shape (channels,)."""
        matrices = (self.displacement, self.velocity, self.acceleration)
        return np.max([order * matrix.any(axis=1) for order, matrix in enumerate(matrices)], axis=0)

    @property
    def motion(self) -> Real:
        """Reading of each sensor, differentiated to an acceleration, for that of each coordinate, (channels, n)."""
        matrices = np.array((self.displacement, self.velocity, self.acceleration))
        return np.asarray(matrices[self.orders, np.arange(len(self.channels))], dtype=np.float64)


@dataclass(frozen=True, eq=False, slots=True)
class StateSpace:
    """State matrix A, input matrix B, output matrix C and feed-through matrix D.

    Parameters
    ----------
    state_matrix, input_matrix, output_matrix, feedthrough
        Matrices A, B, C and D, shapes (states, states), (states, inputs), (channels, states) and (channels, inputs).
    sampling_rate
        Sampling rate [Hz] of x[k+1] = A x[k] + B u[k]; None for x' = A x + B u. In both y = C x + D u.
    """

    state_matrix: Real
    input_matrix: Real
    output_matrix: Real
    feedthrough: Real
    sampling_rate: float | None = None

    def __post_init__(self) -> None:
        freeze(self, state_matrix=2, input_matrix=2, output_matrix=2, feedthrough=2)
        states, inputs = self.input_matrix.shape
        channels = self.output_matrix.shape[0]
        shapes = {
            "state_matrix": (states, states),
            "output_matrix": (channels, states),
            "feedthrough": (channels, inputs),
        }
        _check_shapes(self, shapes, reason=f"there are {states} states and {inputs} inputs")


def state_space(system: MechanicalSystem, outputs: Outputs) -> StateSpace:
    """Return the continuous state space of `system` with the state [q, q', z].

    Notes
    -----
    Without bushings A = [[0, I], [-M^-1 K, -M^-1 C]] and B = [0, M^-1 B]; an acceleration output adds its row of
    -M^-1 K, -M^-1 C to the output matrix and of M^-1 B to the feed-through.

    Examples
    --------
    >>> from sprung.vehicles import chain
    >>> one = chain(1, mass=2.0, stiffness=50.0, damping=3.0)
    >>> space = state_space(one.system, one.outputs)
    >>> space.state_matrix.tolist()
    [[0.0, 1.0], [-25.0, -1.5]]
    """
    n_arms = system.arm_damping.size
    forces = np.linalg.solve(system.mass, system.input_matrix)
    return StateSpace(
        state_matrix=system.state_matrix(),
        input_matrix=np.vstack([np.zeros_like(forces), forces, np.zeros((n_arms, forces.shape[1]))]),
        output_matrix=outputs.acceleration @ system.accelerations()
        + np.hstack([outputs.displacement, outputs.velocity, np.zeros((len(outputs.channels), n_arms))]),
        feedthrough=outputs.acceleration @ forces,
    )


def discretised(continuous: StateSpace, *, sampling_rate: float) -> StateSpace:
    """Return the state space sampled at `sampling_rate` [Hz] with inputs held between samples (zero-order hold).

    Raises
    ------
    ParameterError
        If the sampling rate is not above 0.

    Notes
    -----
    One matrix exponential of [[A, B], [0, 0]] / sampling_rate gives both matrices, also where A is singular.

    References
    ----------
    C. F. Van Loan, Computing integrals involving the matrix exponential, IEEE Trans. Automatic Control 23 (1978).

    Examples
    --------
    >>> from sprung.vehicles import chain
    >>> continuous = chain().state_space()
    >>> sampled = discretised(continuous, sampling_rate=500.0)
    >>> poles = np.log(np.linalg.eigvals(sampled.state_matrix)) * 500.0
    >>> exact = np.linalg.eigvals(continuous.state_matrix)
    >>> np.allclose(np.sort(np.abs(poles)), np.sort(np.abs(exact)))
    True
    """
    from scipy.linalg import expm

    check_number("sampling_rate", sampling_rate, above=0)
    states, inputs = continuous.input_matrix.shape
    augmented = np.zeros((states + inputs, states + inputs))
    augmented[:states] = np.hstack([continuous.state_matrix, continuous.input_matrix])
    exponential = expm(augmented / sampling_rate)
    return StateSpace(
        state_matrix=exponential[:states, :states],
        input_matrix=exponential[:states, states:],
        output_matrix=continuous.output_matrix,
        feedthrough=continuous.feedthrough,
        sampling_rate=sampling_rate,
    )


def exact_correlations(
    discrete: StateSpace,
    *,
    n_lags: int,
    references: ArrayLike | None = None,
    input_covariance: ArrayLike | None = None,
) -> Real:
    """Return the output correlations of a stable discrete system driven by white noise.

    Parameters
    ----------
    discrete
        Sampled state space with all eigenvalues inside the unit circle.
    n_lags
        Number of lags, at least 1; lags 0 to n_lags - 1.
    references
        Indices of the reference channels; default: all channels.
    input_covariance
        Covariance Q of one sample of the inputs, shape (inputs, inputs); default: the unit matrix.

    Returns
    -------
    ndarray
        Correlations E[y(k+m) y_ref(k)^T] at lags m, shape (channels, references, lags).

    Raises
    ------
    ParameterError
        If the system is not stable, so that it has no stationary response.

    Notes
    -----
    P = A P A^T + B Q B^T; lag 0: C P C^T + D Q D^T; lag m: C A^(m-1) G with G = A P C^T + B Q D^T.

    References
    ----------
    P. Van Overschee and B. De Moor, Subspace Identification for Linear Systems (1996), section 3.1.

    Examples
    --------
    >>> one = np.ones((1, 1))
    >>> first_order = StateSpace(0.5 * one, one, one, 0 * one, sampling_rate=1.0)  # 0.5^m / (1 - 0.5^2)
    >>> exact_correlations(first_order, n_lags=3)[0, 0].round(6).tolist()
    [1.333333, 0.666667, 0.333333]
    """
    check_number("n_lags", n_lags, at_least=1)
    A, B, C, D = discrete.state_matrix, discrete.input_matrix, discrete.output_matrix, discrete.feedthrough
    Q = np.eye(B.shape[1]) if input_covariance is None else np.asarray(input_covariance, dtype=np.float64)
    rows = slice(None) if references is None else np.asarray(references, dtype=np.intp)
    P = stationary_covariance(A, B @ Q @ B.T)
    correlations = np.empty((C.shape[0], C[rows].shape[0], n_lags))
    correlations[:, :, 0] = C @ P @ C[rows].T + D @ Q @ D[rows].T
    state = A @ P @ C[rows].T + B @ Q @ D[rows].T
    for lag in range(1, n_lags):
        correlations[:, :, lag] = C @ state
        state = A @ state
    return correlations


def stationary_covariance(state_matrix: Real, noise_covariance: Real) -> Real:
    """Return P of P = A P A^T + W, the covariance of the state under white noise of covariance W.

    Parameters
    ----------
    state_matrix
        State matrix A, shape (states, states), with all eigenvalues inside the unit circle.
    noise_covariance
        Covariance W, shape (states, states), symmetric and positive semi-definite.

    Returns
    -------
    ndarray
        Covariance P, shape (states, states).

    Raises
    ------
    ParameterError
        If an eigenvalue lies on or outside the unit circle.

    Notes
    -----
    P = sum A^n W A^nT, with the number of terms doubled in each step. Only covariances are added, so that small and
    large states (displacements and velocities) keep the same relative accuracy; the bilinear method of
    `scipy.linalg.solve_discrete_lyapunov` is a thousand times less accurate for stiff wheels.

    References
    ----------
    R. A. Smith, Matrix equation XA + BX = C, SIAM J. Applied Mathematics 16 (1968), 198-201.

    Examples
    --------
    >>> stationary_covariance(np.array([[0.5]]), np.array([[3.0]])).tolist()
    [[4.0]]
    """
    radius = float(np.max(np.abs(np.linalg.eigvals(state_matrix))))
    if radius >= 1 - 1e-12:
        raise ParameterError(
            f"the largest eigenvalue has size {radius:.12g}, but must be below 1: "
            "give every coordinate a spring and a damper to the ground"
        )
    covariance, power = np.array(noise_covariance), np.array(state_matrix)
    while np.any(power):
        covariance = covariance + power @ covariance @ power.T
        power = power @ power
        power[np.abs(power) < np.finfo(float).tiny] = 0.0
    return (covariance + covariance.T) / 2


def _check_shapes(value: Any, shapes: dict[str, tuple[int, int]], *, reason: str) -> None:
    """Raise if a matrix does not have its shape; `reason` is why it must have that shape."""
    for name, shape in shapes.items():
        if getattr(value, name).shape != shape:
            raise ParameterError(f"{name} has shape {getattr(value, name).shape}, but must be {shape}: {reason}")


# Largest imaginary part of a pole that does not oscillate, relative to its modulus.
_REAL_POLE = 1e-9

# Coordinates of the body, which label modes.
_OF_BODY = {"bounce", "pitch", "roll", "sway", "yaw", "torsion", "bending"}

# Smallest reading of the sensors for a mode that they observe, relative to their reading for its largest motion.
_UNSEEN = 1e-9


@dataclass(frozen=True, eq=False, slots=True)
class ExactModes:
    """Modes computed from the matrices of a system, by rising natural frequency.

    Parameters
    ----------
    poles
        Continuous poles [rad/s], one of each conjugate pair (positive imaginary part), shape (modes,). Poles without
        oscillation (overdamped motion) are left out.
    mode_shapes
        Mode shapes, 1 at the largest channel, shape (modes, channels). Zeros for a mode that no sensor observes, such
        as the diagonal motion of the wheels of a symmetric vehicle, front left with rear right, observed on its body.
    channels
        Names of the channels of the mode shapes.
    labels
        "bounce", "pitch", "roll", "sway", "yaw", "torsion", "bending", "wheel_hop" or None for each mode.
    """

    poles: Complex
    mode_shapes: Complex
    channels: tuple[str, ...]
    labels: tuple[str | None, ...]

    def __post_init__(self) -> None:
        freeze(self, poles=1, dtype=np.complex128)
        shapes = frozen_array("mode_shapes", self.mode_shapes, ndim=2, dtype=np.complex128)
        object.__setattr__(self, "mode_shapes", shapes)

    @property
    def natural_frequency(self) -> Real:
        """Undamped natural frequencies abs(pole) / 2 pi [Hz]."""
        return natural_frequency(self.poles)

    @property
    def damping_ratio(self) -> Real:
        """Damping ratios -Re(pole) / abs(pole)."""
        return damping_ratio(self.poles)


def modes(system: MechanicalSystem, outputs: Outputs) -> ExactModes:
    """Return the exact modes of a system, as observed by the sensors of `outputs`.

    Notes
    -----
    The shape of pole s with coordinate vector q is (s^2 Ya + s Yv + Yd) q, divided by its largest component.

    Examples
    --------
    >>> from sprung.vehicles import read_description, structure
    >>> quarter = structure(read_description("quarter"))
    >>> modes(quarter.system, quarter.outputs).natural_frequency.round(2).tolist()
    [13.21, 56.35]
    """
    n = system.n_coordinates
    eigenvalues, vectors = np.linalg.eig(system.state_matrix())
    oscillating = np.flatnonzero(eigenvalues.imag > _REAL_POLE * np.abs(eigenvalues))
    order = oscillating[np.argsort(np.abs(eigenvalues[oscillating]))]
    poles, coordinates = eigenvalues[order], vectors[:n, order]
    shapes, reach = np.zeros((len(outputs.channels), poles.size), dtype=np.complex128), np.zeros(poles.size)
    for power, matrix in enumerate((outputs.displacement, outputs.velocity, outputs.acceleration)):
        shapes += (matrix @ coordinates) * poles**power
        reach += np.abs(matrix).max(initial=0.0) * np.abs(poles) ** power * np.abs(coordinates).max(axis=0)
    is_seen = np.abs(shapes).max(axis=0, initial=0.0) > _UNSEEN * reach
    return ExactModes(
        poles=poles,
        mode_shapes=unit_shapes((shapes * is_seen).T) if shapes.size else shapes.T,
        channels=outputs.names,
        labels=_labels(system, coordinates.T),
    )


def participation(mass: Real, shapes: Complex) -> Real:
    """Return the share of each coordinate in the kinetic energy of each mode.

    Parameters
    ----------
    mass
        Mass matrix, shape (n, n).
    shapes
        Mode shapes in coordinates, shape (modes, n).

    Returns
    -------
    ndarray
        Shares, shape (modes, n); rows sum to 1.

    Notes
    -----
    The share of coordinate i is Re(conj(q_i) (M q)_i) / (q^H M q).

    Examples
    --------
    >>> shapes = np.array([[1.0, 0.1], [-0.01, 1.0]], dtype=complex)
    >>> participation(np.diag([400.0, 40.0]), shapes).round(3).tolist()
    [[0.999, 0.001], [0.001, 0.999]]
    """
    energy = (shapes.conj() * (shapes @ mass)).real
    return energy / energy.sum(axis=1, keepdims=True)


def _shares(system: MechanicalSystem, shapes: Complex) -> Real:
    """Return the participation of the coordinates; on tyres that hold the body sideways, sway is that of the tyres."""
    sways = [index for index, name in enumerate(system.coordinates) if name == "sway"]
    held = [arm for arm in system.arm_elongations if np.any(arm[sways])]
    if not held:
        return participation(system.mass, shapes)
    change = np.eye(len(system.coordinates))
    change[sways] = np.mean(held, axis=0)
    inverse = np.linalg.inv(change)
    return participation(inverse.T @ system.mass @ inverse, shapes @ change.T)


def _labels(system: MechanicalSystem, shapes: Complex) -> tuple[str | None, ...]:
    """Return the label of each mode, the motion of largest energy; a body motion labels only its strongest mode."""
    shares = _shares(system, shapes)
    labels: list[str | None] = [None] * len(shapes)
    wheels = [name.startswith("wheel") and not name.endswith(("_sway", "_yaw")) for name in system.coordinates]
    body = [index for index, name in enumerate(system.coordinates) if name in _OF_BODY]
    is_body = shares[:, body].sum(axis=1) > 0.5
    for mode in np.flatnonzero(shares[:, wheels].sum(axis=1) > 0.5):
        labels[mode] = "wheel_hop"
    strongest_first = sorted(
        ((shares[mode, index], mode, index) for mode in np.flatnonzero(is_body) for index in body), reverse=True
    )
    for _, mode, index in strongest_first:
        if labels[mode] is None and system.coordinates[index] not in labels:
            labels[mode] = system.coordinates[index]
    return tuple(labels)
