"""Cramer-Rao bounds of natural frequencies and damping ratios, by quadrature of the exact spectral matrices.

The Fisher information of N samples of a stationary Gaussian process with the spectral matrix S over frequency nu in
cycles per sample is N times the integral from 0 to 1/2 of tr(S^-1 dS/da S^-1 dS/db) (Whittle 1953). S holds the motion
as it is sampled, aliases included. Unknown are frequencies, damping ratios and real shapes of the modes, the covariance
of the modal forces, and the level (with correlated noise also the correlation) of every sensor's noise; a tone of
unknown frequency, amplitude and phase occupies single lines and costs nothing in the limit.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial

import numpy as np
from benchmarks.certified.records import Decay, Friction, Record
from benchmarks.certified.systems import Array, noise_factor, velocities
from numpy.typing import NDArray
from scipy.linalg import block_diag, expm, solve_discrete_lyapunov

Complex = NDArray[np.complex128]
#: Panels of the quadrature around each mode, in half-widths from its frequency.
_DISTANCES = 2.0 ** np.arange(-1, 14)
#: Nodes whose derivatives are held in memory together.
_N_AT_ONCE = 1000


@dataclass(frozen=True, eq=False)
class Bound:
    """Least standard deviations of natural frequencies [Hz] and damping ratios."""

    natural_frequency: Array
    damping_ratio: Array


class Parameters:
    """Unknowns of a stationary record, packed into one vector.

    They are the natural frequencies, damping ratios, shapes but for the largest entry of each, covariance of the modal
    forces, powers of the noise, and correlations of the sensors whose noise is correlated.
    """

    def __init__(self, record: Record) -> None:
        frequency, damping, self.shapes, forces = record.system.modal()
        n = len(frequency)
        self.is_free = np.ones(self.shapes.shape, dtype=bool)
        self.is_free[np.argmax(np.abs(self.shapes), axis=0), np.arange(n)] = False
        self.upper = np.triu_indices(n)
        self.colours = np.array([each.correlation for each in record.noise])
        self.is_coloured = self.colours != 0
        noise = (record.sampled(record.system, record.rate).rms() * [each.level for each in record.noise]) ** 2
        start = [frequency, damping, self.shapes[self.is_free], forces[self.upper], noise]
        start.append(self.colours[self.is_coloured])
        typical = [0.1 * frequency * damping, 0.1 * damping, np.full(self.is_free.sum(), np.abs(self.shapes).max())]
        typical += [np.full(len(self.upper[0]), np.abs(forces).max()), noise, np.full(self.is_coloured.sum(), 0.1)]
        self.ends = np.cumsum([len(part) for part in start])[:-1]
        self.start, self.typical = np.concatenate(start), np.concatenate(typical)

    def unpacked(self, vector: Array) -> tuple[Array, Array, Array, Array, Array, Array]:
        """Return frequencies, damping ratios, shapes, covariance of forces, powers and correlations of the noise."""
        natural, damping, free, covariance, powers, coloured = np.split(vector, self.ends)
        shapes, colours, P = self.shapes.copy(), self.colours.copy(), np.zeros((len(natural), len(natural)))
        shapes[self.is_free], colours[self.is_coloured], P[self.upper] = free, coloured, covariance
        return natural, damping, shapes, P + np.triu(P, 1).T, powers, colours

    def bound(self, inverse_information: Array) -> Bound:
        """Return the bound from the covariance of all unknowns."""
        deviations, n = np.sqrt(np.diag(inverse_information)), self.shapes.shape[1]
        return Bound(deviations[:n], deviations[n : 2 * n])


def modal_bound(record: Record, *, n_nodes: int = 16) -> Bound:
    """Return the bound of a long stationary record; `n_nodes` in each panel of the quadrature."""
    unknown = Parameters(record)
    frequency, damping, *_ = unknown.unpacked(unknown.start)
    nu, weights = quadrature(frequency / record.rate, frequency * damping / record.rate, n_nodes=n_nodes)
    z = np.exp(2j * np.pi * nu)

    def spectra(some: slice, vector: Array) -> Complex:
        natural, xi, shapes, P, powers, colours = unknown.unpacked(vector)
        S = shapes @ modal_spectra(natural, xi, P, z[some], record) @ shapes.T
        rows = np.arange(len(powers))
        S[:, rows, rows] += powers * (1 - colours**2) / np.abs(1 - colours / z[some, None]) ** 2
        return S

    stretches = [slice(k, k + _N_AT_ONCE) for k in range(0, len(z), _N_AT_ONCE)]
    known = sum(
        information(partial(spectra, some), unknown.start, unknown.typical, record.n_samples * weights[some])
        for some in stretches
    )
    return unknown.bound(np.linalg.inv(known))


def exact_bound(record: Record) -> Bound:
    """Return the bound of a short record of velocities with white noise, from the covariance of all its samples.

    The Fisher information of a Gaussian vector of covariance V is tr(V^-1 dV/da V^-1 dV/db) / 2. It needs no lines of a
    spectrum, which are too coarse where a record is shorter than a few hundred periods.
    """
    unknown, n = Parameters(record), record.n_samples

    def covariance(vector: Array) -> Complex:
        natural, xi, shapes, P, powers, _ = unknown.unpacked(vector)
        correlations = shapes @ modal_correlations(natural, xi, P, record) @ shapes.T
        lags = np.arange(n)[:, None] - np.arange(n)
        V = np.where(
            (lags >= 0)[..., None, None], correlations[np.abs(lags)], correlations[np.abs(lags)].swapaxes(2, 3)
        )
        V = V.swapaxes(1, 2).reshape(n * len(powers), n * len(powers))
        return (V + np.diag(np.tile(powers, n)))[None].astype(complex)

    known = information(covariance, unknown.start, unknown.typical, np.array([0.5]))
    return unknown.bound(np.linalg.inv(known))


def modal_correlations(frequency: Array, damping: Array, P: Array, record: Record) -> Array:
    """Return correlations of the sampled modal velocities, shape (lags, modes, modes)."""
    states = [_state(f, xi) for f, xi in zip(frequency, damping, strict=True)]
    A = block_diag(*(expm(each / record.rate) for each in states))
    factors = [noise_factor(each, np.array([[0.0], [1.0]]), 1 / record.rate) for each in states]
    Q = np.block([[P[i, j] * a @ b.T for j, b in enumerate(factors)] for i, a in enumerate(factors)])
    C = np.kron(np.eye(len(states)), [[0.0, 1.0]])
    moved = solve_discrete_lyapunov(A, Q) @ C.T
    correlations = []
    for _ in range(record.n_samples):
        correlations.append(C @ moved)
        moved = A @ moved
    return np.array(correlations)


def modal_spectra(frequency: Array, damping: Array, P: Array, z: Complex, record: Record) -> Complex:
    """Return the spectral matrix of the modal motions as they are sampled, shape (len(z), modes, modes)."""
    n = len(frequency)
    responses = []
    for f, xi in zip(frequency, damping, strict=True):
        A, G = _state(f, xi), np.array([[0.0], [1.0]])
        if record.sampled is velocities:
            a, B, C, D = expm(A / record.rate), noise_factor(A, G, 1 / record.rate), np.array([[0.0, 1.0]]), None
        else:
            both = expm(np.block([[A, G], [np.zeros((1, 3))]]) / record.rate)
            a, B, C, D = both[:2, :2], both[:2, 2:], A[1:], 1.0
        (p, q), (r, s) = a
        inverse = np.array([[z - s, np.full_like(z, q)], [np.full_like(z, r), z - p]]) / ((z - p) * (z - s) - q * r)
        response = np.einsum("j,jkz,kb->zb", C[0], inverse, B)
        responses.append(response if D is None else response + D)
    H = np.array(responses)  # columns of B belong to the same nodes in time, so that modes are correlated as they are
    return P * np.einsum("izb,jzb->zij", H, H.conj()).reshape(len(z), n, n)


def _state(frequency: float, damping: float) -> Array:
    """Return the state matrix of one mode."""
    omega = 2 * np.pi * frequency
    return np.array([[0.0, 1.0], [-(omega**2), -2 * damping * omega]])


def quadrature(centres: Array, half_widths: Array, *, n_nodes: int, highest: float = 0.5) -> tuple[Array, Array]:
    """Return Gauss-Legendre nodes and weights from 0 to `highest`, in panels that narrow towards the centres."""
    steps = np.outer(half_widths, np.concatenate([-_DISTANCES, [0.0], _DISTANCES]))
    edges = np.concatenate([[0.0, highest], np.linspace(0, highest, 33), (centres[:, None] + steps).ravel()])
    edges = np.unique(edges[(edges >= 0) & (edges <= highest)])
    nodes, weights = np.polynomial.legendre.leggauss(n_nodes)
    half, middle = np.diff(edges)[:, None] / 2, (edges[1:] + edges[:-1])[:, None] / 2
    return (middle + half * nodes).ravel(), (half * weights).ravel()


def information(spectra: Callable[[Array], Complex], at: Array, typical: Array, weights: Array) -> Array:
    """Return the weighted sum of tr(S^-1 dS/da S^-1 dS/db) over frequencies, shape (parameters, parameters)."""
    inverse = np.linalg.inv(spectra(at))
    slopes = np.array([inverse @ slope(spectra, at, typical, k) for k in range(len(at))])
    flat = (slopes * np.sqrt(weights)[:, None, None]).reshape(len(at), -1)
    turned = (np.swapaxes(slopes, 2, 3) * np.sqrt(weights)[:, None, None]).reshape(len(at), -1)
    return (flat @ turned.T).real


def slope(function: Callable[[Array], Complex], at: Array, typical: Array, k: int) -> Complex:
    """Return the derivative by the k-th parameter: central differences with an error of the fourth order."""
    step = np.zeros(len(at))
    step[k] = 0.02 * typical[k]
    near = function(at + step) - function(at - step)
    far = function(at + 2 * step) - function(at - 2 * step)
    return (8 * near - far) / (12 * step[k])


def decay_bound(record: Decay) -> Bound:
    """Return the bound of a free decay in white noise: unknown modes, shapes and amplitudes (Gaussian likelihood)."""
    frequency, damping, shapes, _ = record.system.modal()
    n, largest = len(frequency), np.argmax(np.abs(shapes), axis=0)
    is_free = np.ones(shapes.shape, dtype=bool)
    is_free[largest, np.arange(n)] = False

    def motion(parameters: Array) -> Complex:
        natural, xi, free, begin = np.split(parameters, np.cumsum([n, n, is_free.sum()]))
        phi = shapes.copy()
        phi[is_free] = free
        return record.motion(natural, xi, phi, begin.reshape(n, 2)).astype(complex)

    at = np.concatenate([frequency, damping, shapes[is_free], record.begin.ravel()])
    scales = [np.full(is_free.sum(), np.abs(shapes).max()), np.full(record.begin.size, np.abs(record.begin).max())]
    typical = np.concatenate([0.1 * frequency * damping, 0.1 * damping, *scales])
    slopes = np.array([slope(motion, at, typical, k).real.ravel() for k in range(len(at))]) / record.noise
    deviations = np.sqrt(np.diag(np.linalg.inv(slopes @ slopes.T)))
    return Bound(deviations[:n], deviations[n : 2 * n])


def friction_bound(record: Friction) -> tuple[Bound, float]:
    """Return the bounds of frequency, damping ratio and sticking displacement: unknown gains, offsets and start too."""
    frequency, damping, shapes, _ = record.system.modal()
    gains = shapes[:, 0] / shapes[0, 0]
    n = len(gains)

    def motion(parameters: Array) -> Complex:
        f, xi, sticking, late, *rest = parameters
        factors, offsets = np.array(rest[:n]), np.array(rest[n:])
        moved = record.motion(f, xi, sticking, factors)
        # A later start is the motion less its velocity times the delay: that vanishes at the turn itself.
        shifted = moved - late * np.gradient(moved, 1 / record.rate, axis=1)
        return (shifted + offsets[:, None]).astype(complex)

    at = np.concatenate([[frequency[0], damping[0], record.sticking, 0.0], gains, np.zeros(n)])
    typical = np.concatenate([[0.01 * frequency[0], 0.1 * damping[0], 0.1 * record.sticking, 1e-2], gains, [1e-3] * n])
    slopes = np.array([slope(motion, at, typical, k).real.ravel() for k in range(len(at))]) / record.noise
    deviations = np.sqrt(np.diag(np.linalg.inv(slopes @ slopes.T)))
    return Bound(deviations[:1], deviations[1:2]), float(deviations[2])
