"""Linear systems under white noise, sampled exactly. Numpy and scipy only."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag, eigh, expm

Array = NDArray[np.float64]
#: Nodes of the Gauss-Legendre rule over one sampling interval: its error is below rounding as long as no state changes
#: by more than about a radian between samples.
_N_NODES = 12


@dataclass(frozen=True, eq=False)
class System:
    """Masses M, dampers C and springs K, M q'' + C q' + K q = F u, with sensors that read rows of q.

    Matrices (n, n), forces (n, inputs), sensors (channels, n). The damping must leave the undamped modes uncoupled.
    """

    mass: Array
    damping: Array
    stiffness: Array
    forces: Array
    sensors: Array

    def modal(self) -> tuple[Array, Array, Array, Array]:
        """Return natural frequencies [Hz], damping ratios, shapes (channels, modes) and covariance of modal forces."""
        squares, shapes = eigh(self.stiffness, self.mass)
        omega = np.sqrt(squares)
        damping = shapes.T @ self.damping @ shapes
        assert np.allclose(damping, np.diag(np.diag(damping)), atol=1e-9 * np.abs(damping).max())
        moved = shapes.T @ self.forces
        return omega / (2 * np.pi), np.diag(damping) / (2 * omega), self.sensors @ shapes, moved @ moved.T


@dataclass(frozen=True, eq=False)
class Sampled:
    """x[k+1] = A x[k] + B e[k], y[k] = C x[k] + D e[k], with independent e of variance 1."""

    A: Array
    B: Array
    C: Array
    D: Array

    def covariance(self) -> Array:
        """Return the stationary covariance of the state, by doubling the sum of A^n B B^T A^nT."""
        total, power = self.B @ self.B.T, self.A
        while np.abs(power).max() > 1e-20:
            total, power = total + power @ total @ power.T, power @ power
        return (total + total.T) / 2

    def rms(self) -> Array:
        """Return the stationary RMS of each channel."""
        return np.sqrt(np.diag(self.C @ self.covariance() @ self.C.T + self.D @ self.D.T))

    def run(self, n: int, rng: np.random.Generator) -> Array:
        """Return n samples of the stationary response, shape (channels, n)."""
        # The symmetric root is free of the signs of eigenvectors, which differ between libraries.
        values, vectors = np.linalg.eigh(self.covariance())
        state = vectors @ (np.sqrt(np.maximum(values, 0.0)) * (vectors.T @ rng.standard_normal(len(values))))
        noise = rng.standard_normal((n, self.B.shape[1]))
        states = np.empty((n, len(state)))
        for k, step in enumerate(noise @ self.B.T):
            states[k] = state
            state = self.A @ state + step
        return self.C @ states.T + self.D @ noise.T


def noise_factor(state_matrix: Array, inputs: Array, interval: float) -> Array:
    """Return L with L L^T = integral of exp(A s) G G^T exp(A^T s) ds over the interval, by Gauss-Legendre quadrature.

    The integral is the covariance that continuous white noise of unit intensity adds to the state (Van Loan 1978).
    """
    nodes, weights = np.polynomial.legendre.leggauss(_N_NODES)
    times, weights = (nodes + 1) / 2 * interval, weights / 2 * interval
    return np.hstack([np.sqrt(w) * expm(state_matrix * t) @ inputs for t, w in zip(times, weights, strict=True)])


def velocities(system: System, rate: float) -> Sampled:
    """Return velocities under forces that are continuous white noise of unit intensity."""
    A, G = _first_order(system)
    n = len(system.mass)
    C = np.hstack([np.zeros((len(system.sensors), n)), system.sensors])
    B = noise_factor(A, G, 1 / rate)
    return Sampled(expm(A / rate), B, C, np.zeros((len(C), B.shape[1])))


def accelerations(system: System, rate: float) -> Sampled:
    """Return accelerations under forces that are white from sample to sample and constant between."""
    A, G = _first_order(system)
    n, m = G.shape
    both = expm(np.vstack([np.hstack([A, G]), np.zeros((m, n + m))]) / rate)
    half = n // 2
    return Sampled(both[:n, :n], both[:n, n:], system.sensors @ A[half:], system.sensors @ G[half:])


def _first_order(system: System) -> tuple[Array, Array]:
    """Return A and G of x' = A x + G u with the state [q, q']."""
    n = len(system.mass)
    inverse = np.linalg.inv(system.mass)
    A = np.block([[np.zeros((n, n)), np.eye(n)], [-inverse @ system.stiffness, -inverse @ system.damping]])
    return A, np.vstack([np.zeros((n, system.forces.shape[1])), inverse @ system.forces])


def with_modes(frequencies: Array, damping: Array, shapes: Array, sensors: Array) -> System:
    """Return unit masses with modes of the given orthonormal shapes, shape (n, n), and a force on each mass."""
    omega = 2 * np.pi * np.asarray(frequencies)
    return System(
        np.eye(len(shapes)),
        (shapes * (2 * np.asarray(damping) * omega)) @ shapes.T,
        (shapes * omega**2) @ shapes.T,
        np.eye(len(shapes)),
        sensors,
    )


def chain(masses: Array, stiffness: Array, damping: Array) -> System:
    """Return masses in a row, each on the one before, the first on the ground; a force and a sensor on each."""
    elongations = np.eye(len(masses)) - np.eye(len(masses), k=-1)
    return System(
        np.diag(masses),
        (elongations.T * damping) @ elongations,
        (elongations.T * stiffness) @ elongations,
        np.eye(len(masses)),
        np.eye(len(masses)),
    )


def delayed_pair(state_matrix: Array, front: Array, rear: Array, interval: float) -> Array:
    """Return the factor of what one path of white noise adds to the state by the front and by the rear input."""
    return noise_factor(block_diag(state_matrix, state_matrix), np.vstack([front, rear]), interval)
