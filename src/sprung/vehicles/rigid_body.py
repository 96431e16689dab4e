"""Faults that show in the residual: the part of the channels that rigid-body motion cannot explain."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from sprung._arrays import Complex, Real
from sprung.signals.spectrum import SpectralMatrix
from sprung.vehicles import Structure
from sprung.vehicles.channel_faults import SensorFault
from sprung.vehicles.labels import MOTIONS, highest_of_body
from sprung.vehicles.structure import FLEXIBLE_SHAPES
from sprung.vehicles.window import is_upright


@dataclass(frozen=True, slots=True)
class RigidBodyLimits:
    """Limits of the comparison with a rigid body; shares are those of the residual that something explains."""

    #: Smallest power of the residual over the mean power of the channels for a fault of one channel.
    residual: float = 2e-4
    #: The same for a disagreement of several channels.
    disagreement: float = 1e-3
    #: Error of places [m] that is no reason to refuse a window.
    place: float = 0.25
    #: Share of one faulty channel.
    explained: float = 0.4
    #: Its ratio to that of any other channel.
    over_others: float = 1.1
    #: Its ratio to the share that other signs, gains, places and delays of several channels explain.
    over_together: float = 0.9
    #: Smallest share of several channels for a disagreement.
    together: float = 0.7
    #: Share of a channel with noise of its own.
    alone: float = 0.03
    #: Its ratio to that of any other channel.
    far_over_others: float = 5.0
    #: Residual after an exchange of two channels, over that before, below which they are swapped.
    swapped: float = 0.05
    #: Lowest frequency of the comparison [Hz].
    lowest: float = 0.5
    #: Its highest frequency over half the sampling rate.
    over_rate: float = 0.5
    #: Its highest frequency over the highest natural frequency of bounce, pitch and roll: a car's body twists at 18 to
    #: 30 Hz, and moves little of that below.
    over_body: float = 2.0
    #: Deviation of a gain from 1 that is tolerated.
    gain: float = 0.03
    #: Delay that is tolerated [s].
    delay: float = 1.5e-3
    #: Longest delay sought [s].
    longest_delay: float = 0.1
    #: Number of delays sought, in steps of 0.25 ms.
    delays: int = 801
    #: Share of 1/G that neither gain nor delay explains above which a channel is noisy.
    unexplained: float = 0.3


LIMITS = RigidBodyLimits()
NOISY = ("noisy", "has a signal of its own that the other channels lack")


def rigid_body_faults(spectra: SpectralMatrix, structure: Structure) -> tuple[list[SensorFault], float]:
    """Find inverted, swapped, wrongly scaled, late and noisy channels by their residual against a rigid body.

    Parameters
    ----------
    spectra
        Spectral matrix of channels of motion of the structure, in SI units.
    structure
        Structure with the places and directions of its sensors.

    Returns
    -------
    tuple
        Faults of single channels, and the ratio of the RMS of the residual to that of the channels if several channels
        explain it and no single one does; otherwise 0.

    Notes
    -----
    Accelerations of a rigid body are y = T q'' with q its bounce, pitch and roll. The rows of N in the residual n = N y
    are an orthonormal basis of the left null space, N T = 0, so that n is noise while all sensors are right. A faulty
    channel k, measured as G times what it should be, makes the residual N_k (1 - 1/G) y_k: coherent with y_k at all
    frequencies, and its transfer function gives G. Angular velocities and displacements would need differentiation and
    are left out, and so are sensors that do not measure upwards.

    Only frequencies up to twice the highest natural frequency of the body's rigid motions count: there a body that
    twists and bends far above is rigid, and what little it deflects is coherent with no channel. Flexible modes of the
    vehicle file are motions in T, too, where more channels than motions are left.

    Sensors k that are misplaced by (dx, dy) make the residual a p'' + b r'' of pitch and roll, a = -sum N_k dx_k and
    b = sum N_k dy_k. A residual of that form with a and b up to 25 cm is no disagreement: a calibration can learn it.

    References
    ----------
    E. Y. Chow, A. S. Willsky, Analytical redundancy and the design of robust failure detection systems, IEEE
    Transactions on Automatic Control 29 (1984) 603-614 (parity relations).
    """
    outputs = structure.outputs
    places = {row: outputs.names.index(name) for row, name in enumerate(spectra.names)}
    rows = [row for row, k in places.items() if np.any(outputs.acceleration[k]) and is_upright(outputs.channels[k])]
    T = outputs.acceleration[[places[row] for row in rows]]
    null = _null_space(T)
    if not len(null):  # too few sensors for a flexible body's own shapes
        null = _null_space(T[:, [name not in FLEXIBLE_SHAPES for name in structure.coordinates]])
    if not len(null):
        return [], 0.0
    names = tuple(spectra.names[row] for row in rows)
    frequencies = spectra.frequencies
    highest = min(LIMITS.over_rate * frequencies[-1], LIMITS.over_body * highest_of_body(structure))
    band = (frequencies > LIMITS.lowest) & (frequencies < highest)
    S, frequencies = spectra.matrix[np.ix_(rows, rows, band)].transpose(2, 0, 1), frequencies[band]
    mean_power = np.einsum("fii->", S).real / len(names)
    residual = _residual_power(S, null) / len(null)
    if residual < LIMITS.residual * mean_power:
        return [], 0.0
    together = 1 - _least_power(S, frequencies, len(null)) / residual
    faults = _swapped(S, null, residual, names) or _single_fault(S, null, names, frequencies, together)
    if faults or together < LIMITS.together:
        return faults, 0.0
    place, rest = _place_error(S, null, T[:, [structure.coordinates.index(name) for name in MOTIONS]])
    if place > LIMITS.place:
        rest = residual
    return [], 0.0 if rest < LIMITS.disagreement * mean_power else float(np.sqrt(residual / mean_power))


def _null_space(T: Real) -> Real:
    """Return the rows N of N T = 0, shape (residuals, channels); none without channels."""
    if not len(T):
        return T
    left, values, _ = np.linalg.svd(T[:, np.abs(T).max(axis=0) > 0], full_matrices=True)
    return left[:, np.count_nonzero(values > 1e-6 * values[0]) :].T


def _place_error(S: Complex, null: Real, T: Real) -> tuple[float, float]:
    """Return the size [m] of the places' errors that explain the residual best, and the mean power that remains.

    `T` maps bounce, pitch and roll to the channels, shape (channels, 3).
    """
    total, motions = S.sum(axis=0).real, np.linalg.pinv(T)[1:]
    own, cross = motions @ total @ motions.T, null @ total @ motions.T
    errors = cross @ np.linalg.pinv(own, hermitian=True)
    rest = np.trace(null @ total @ null.T - errors @ cross.T) / len(null)
    return float(np.abs(errors).max(initial=0.0)), float(rest)


def _residual_power(S: Complex, null: Real) -> float:
    """Return the power of N y over all frequencies and residuals."""
    return float(np.einsum("ki,fij,kj->", null, S, null).real)


def _least_power(S: Complex, frequencies: Real, count: int) -> float:
    """Return the least mean power of `count` orthogonal combinations (a + b d/dt)^T y with a of length 1."""
    omega = 2 * np.pi * frequencies
    own, slopes = S.sum(axis=0).real, np.einsum("f,fij->ij", omega**2, S).real
    cross = np.einsum("f,fij->ij", -1j * omega, S).real
    powers = np.linalg.eigvalsh(own - cross @ np.linalg.pinv(slopes, hermitian=True) @ cross.T)
    return float(powers[:count].mean())


def _swapped(S: Complex, null: Real, residual: float, names: tuple[str, ...]) -> list[SensorFault]:
    """Return the pairs of channels whose exchange makes the residual vanish."""
    pairs = []
    for first, second in combinations(range(len(names)), 2):
        order = np.arange(len(names))
        order[[first, second]] = second, first
        if _residual_power(S, null[:, order]) / len(null) < LIMITS.swapped * residual:
            pairs.append((names[first], names[second]))
    words = " or ".join(f"{first} with {second}" for first, second in pairs)
    return [SensorFault(name, "swapped", words) for pair in pairs for name in pair]


def _single_fault(
    S: Complex, null: Real, names: tuple[str, ...], frequencies: Real, together: float
) -> list[SensorFault]:
    """Return the fault of the one channel that explains the residual as well as errors of several channels do."""
    shares = [_explained_share(S, null, row) for row in range(len(names))]
    worst, second = int(np.argmax(shares)), np.sort(shares)[-2]
    if shares[worst] >= max(LIMITS.explained, LIMITS.over_others * second, LIMITS.over_together * together):
        kind, detail = _kind_and_size(S, null, worst, frequencies)
        is_certain = kind != "noisy" or shares[worst] >= LIMITS.together
        return [SensorFault(names[worst], kind, detail)] if is_certain else []
    if shares[worst] > LIMITS.alone and shares[worst] > LIMITS.far_over_others * second:
        return [SensorFault(names[worst], *NOISY)]
    return []


def _transfer(S: Complex, null: Real, row: int) -> tuple[Complex, Real, Real]:
    """Return residual over channel, the power of the channel, and the power it explains, all over frequency."""
    direction = null[:, row] / max(np.sum(null[:, row] ** 2), 1e-300)
    cross = np.einsum("k,ki,fi->f", direction, null, S[:, :, row])
    own = S[:, row, row].real
    return cross / own, own, np.abs(cross) ** 2 / own


def _explained_share(S: Complex, null: Real, row: int) -> float:
    """Return the share of the residual's power that a fault of one channel explains."""
    return float(np.sum(_transfer(S, null, row)[2]) * np.sum(null[:, row] ** 2) / _residual_power(S, null))


def _kind_and_size(S: Complex, null: Real, row: int, frequencies: Real) -> tuple[str, str]:
    """Return what is wrong with a channel y = G x, 1/G = 1 - residual over channel = e^(i w delay) / gain."""
    ratio, own, _ = _transfer(S, null, row)
    inverse = 1 - ratio
    omega = 2 * np.pi * frequencies
    delays = np.linspace(-LIMITS.longest_delay, LIMITS.longest_delay, LIMITS.delays)
    sums = np.exp(-1j * delays[:, None] * omega) @ (own * inverse) / own.sum()
    best = int(np.argmax(np.abs(sums.real)))
    delay, amplitude = float(delays[best]), float(sums[best].real)
    error = inverse - amplitude * np.exp(1j * omega * delay)
    if np.sum(own * np.abs(error) ** 2) > LIMITS.unexplained * np.sum(own * np.abs(inverse) ** 2):
        return NOISY
    if amplitude < 0:
        return "inverted", f"{-1 / amplitude:.2f} times the opposite of what the others measure"
    if abs(delay) > LIMITS.delay:
        return "time_shifted", f"{1e3 * abs(delay):.1f} ms {'late' if delay > 0 else 'early'}"
    if abs(1 / amplitude - 1) > LIMITS.gain:
        return "wrong_gain", f"{1 / amplitude:.2f} times what the others measure"
    return NOISY
