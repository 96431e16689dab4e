"""Cramer-Rao bound of the natural frequencies and damping ratios of the 3-DOF chain from one record."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from sprung.vehicles import chain

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, slots=True)
class Bound:
    """Natural frequencies [Hz] and damping ratios, or the least standard deviations of them, shape (modes,)."""

    natural_frequency: Array
    damping_ratio: Array


def chain_bound(
    *, snr: float, duration: float = 60.0, sampling_rate: float = 500.0, has_free_forces: bool = True
) -> Bound:
    """Return the bound for accelerations of the three masses under white forces, with white sensor noise.

    The Fisher information of the Whittle likelihood: over the frequencies k / duration, the sum of
    tr(S^-1 dS/da S^-1 dS/db). The spectral matrix is S = Phi H P H^H Phi^T + N with the zero-order-hold response H
    of the modes to modal forces of spectral matrix P. Unknown are the three frequencies, damping ratios and shapes
    (columns of Phi), the three noise levels in N, and of P either all six entries, or (`has_free_forces` False) its
    scale only. What is not identifiable (the scales of shapes and forces) is left out by the pseudo-inverse.
    """
    exact = chain().modes()
    frequencies = np.arange(1, int(duration * sampling_rate / 2)) / duration
    stiffness = 9800.0 * np.array([[2.0, -1.0, 0.0], [-1.0, 2.0, -1.0], [0.0, -1.0, 1.0]])
    return modal_bound(
        Bound(exact.natural_frequency, exact.damping_ratio),
        np.linalg.eigh(stiffness)[1],
        frequencies,
        snr=snr,
        sampling_rate=sampling_rate,
        has_free_forces=has_free_forces,
    )


def modal_bound(
    truth: Bound,
    shapes: Array,
    frequencies: Array,
    *,
    snr: float,
    sampling_rate: float,
    powers: Array | None = None,
    has_free_forces: bool = True,
) -> Bound:
    """Return the bound for modes of any real shapes (channels, modes) under white forces of the given powers.

    As `chain_bound`, for lines at the given frequencies; the noise of each channel is white, of its power over the
    squared signal-to-noise ratio. `truth` holds the natural frequencies [Hz] and damping ratios.
    """
    n_channels, n = shapes.shape
    upper = np.triu_indices(n)
    powers = np.ones(n) if powers is None else powers

    def spectra(parameters: Array) -> NDArray[np.complex128]:
        ends = np.cumsum([n, n, n_channels * n, n * (n + 1) // 2 if has_free_forces else 1])
        natural, damping, phi, forces, noise = np.split(parameters, ends)
        P = np.diag(powers) * forces[0]
        if has_free_forces:
            P[upper] = forces
            P = np.triu(P) + np.triu(P, 1).T
        H = np.array([_response(f, xi, frequencies, sampling_rate) for f, xi in zip(natural, damping, strict=True)])
        moved = np.einsum("cm,mf->fcm", phi.reshape(n_channels, n), H)
        return moved @ P @ np.conj(np.swapaxes(moved, 1, 2)) + np.diag(noise)

    forces = np.diag(powers)[upper] if has_free_forces else np.ones(1)
    known = np.concatenate([truth.natural_frequency, truth.damping_ratio, shapes.ravel(), forces])
    silent = spectra(np.concatenate([known, np.zeros(n_channels)]))
    power = np.einsum("fcc->c", silent).real / len(frequencies)
    at = np.concatenate([known, power / snr**2])
    inverse = np.linalg.inv(spectra(at))
    slopes = np.array([inverse @ _slope(spectra, at, k) for k in range(len(at))])
    transposed = np.swapaxes(slopes, 2, 3).reshape(len(at), -1)
    information = (slopes.reshape(len(at), -1) @ transposed.T).real
    scale = np.sqrt(np.diag(information))
    covariance = np.linalg.pinv(information / np.outer(scale, scale), rcond=1e-10) / np.outer(scale, scale)
    deviations = np.sqrt(np.diag(covariance))
    return Bound(deviations[:n], deviations[n : 2 * n])


def _response(
    natural_frequency: float, damping: float, frequencies: Array, sampling_rate: float
) -> NDArray[np.complex128]:
    """Return the acceleration of a mode of unit mass per force held from sample to sample."""
    omega = 2 * np.pi * natural_frequency
    motion = np.array([[0.0, 1.0, 0.0], [-(omega**2), -2 * damping * omega, 1.0], [0.0, 0.0, 0.0]])
    step = expm(motion / sampling_rate)
    (a, b, e), (c, d, g) = step[:2]
    z = np.exp(2j * np.pi * frequencies / sampling_rate)
    determinant = (z - a) * (z - d) - b * c
    displacement = ((z - d) * e + b * g) / determinant
    velocity = (c * e + (z - a) * g) / determinant
    return np.asarray(1 - omega**2 * displacement - 2 * damping * omega * velocity)


def _slope(function: Callable[[Array], NDArray[np.complex128]], at: Array, k: int) -> NDArray[np.complex128]:
    """Return the central difference of a function by its k-th argument."""
    step = np.zeros(len(at))
    step[k] = 1e-5 * (abs(at[k]) if at[k] else 1.0)
    return (function(at + step) - function(at - step)) / (2 * step[k])


if __name__ == "__main__":
    print("| SNR | forces | f, Hz | xi, % |\n|---|---|---|---|")
    for snr in (10.0, 0.5):
        for has_free_forces in (True, False):
            bound = chain_bound(snr=snr, has_free_forces=has_free_forces)
            forces = "spectral matrix free" if has_free_forces else "known up to scale"
            damping = 100 * bound.damping_ratio
            print(f"| {snr:g} | {forces} | {bound.natural_frequency.round(5)} | {damping.round(4)} |")
