"""Springs that stiffen as the wheel moves up, such as on their bump stops: from the body's accelerations alone."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung._checks import freeze
from sprung.likelihood.coordinates import RigidLayout
from sprung.recording import Recording
from sprung.vehicles import Structure


@dataclass(frozen=True, slots=True)
class StiffeningSettings:
    """How the stiffening of springs is estimated."""

    #: Length of a segment [s].
    segment: float = 10.0
    #: Lowest frequency of the travel: below it, accelerations hardly show it [Hz].
    lowest: float = 0.3
    #: Band in which accelerations are explained: above the body's modes, where the square of their motion is [Hz].
    band: tuple[float, float] = (1.5, 6.0)
    #: Viscous damping over stiffness, by which the travel lags behind the force [s].
    lag: float = 0.03
    #: Least segments for each line of the spectra.
    min_segments: int = 20


SETTINGS = StiffeningSettings()


@dataclass(frozen=True, eq=False, slots=True)
class Stiffening:
    """How much stiffer each spring is one RMS of its travel further in, over its stiffness.

    Parameters
    ----------
    corners
        Corners, such as "front_left".
    values
        Rise of the stiffness with one RMS of travel, over the stiffness, shape (corners,); 0 of a linear spring.
    covariance
        Covariance of `values` by chance, shape (corners, corners).
    """

    corners: tuple[str, ...]
    values: Real
    covariance: Real

    def __post_init__(self) -> None:
        freeze(self, values=1, covariance=2)


def stiffening(motion: Recording, layout: RigidLayout, structure: Structure) -> Stiffening | None:
    """Return the stiffening of the springs of a vehicle's corners.

    Parameters
    ----------
    motion
        Channels of motion, at a rate of a few times the band, such as 25 Hz.
    layout
        Motions of the body that the channels show.
    structure
        Vehicle as its file describes it.

    Returns
    -------
    Stiffening or None
        None where accelerometers do not show the body's roll, springs do not stand at corners, or time is short.

    Notes
    -----
    Accelerations a of bounce, pitch and roll are M^-1 E^T F of the forces F between body and wheels, with the springs'
    elongations E; of the forces that explain a, those of least squares over k (1 + s c / k) are the travels u. A force
    b u^2 beside k u is the first that a linear suspension on a Gaussian road has not: least squares of a by M^-1 E^T
    times u^2, weighted by the inverse of the spectra of a, gives b for all corners at once, and 2 b u_RMS / k is the
    value. A bump stop of stiffness K, beyond a gap g of travel with standard deviation u_RMS, has by Hermite's
    expansion the value K / k exp(-g^2 / (2 u_RMS^2)) / sqrt(2 pi): it is a question of the gap over the travel, so that
    a load that lowers both sides of an axle does the same to both.

    References
    ----------
    J. B. Roberts, P. D. Spanos, Random Vibration and Statistical Linearization (1990), chapter 5 (equivalent
    polynomials). D. R. Brillinger, Time Series: Data Analysis and Theory (1981), chapter 5.
    """
    springs = [element for element in structure.elements if element.part == "suspension"]
    at_corners = bool(springs) and all(element.components[0].side for element in springs)
    is_seen = "roll" in layout.coordinates and set(layout.coordinates) <= set(structure.coordinates)
    if not at_corners or not is_seen or np.any(layout.orders != 2):
        return None
    rate = motion.sampling_rate
    length = round(SETTINGS.segment * rate)
    body = [structure.coordinates.index(name) for name in layout.coordinates]
    by_force = np.linalg.solve(
        structure.mass[np.ix_(body, body)], np.array([element.elongation[body] for element in springs]).T
    )
    stiffness = np.array([element.stiffness for element in springs])
    pieces = []
    for stretch in motion.stretches():
        samples = layout.reduction @ motion.select(layout.names).samples[:, stretch]
        n, count = samples.shape[1], 2 * (samples.shape[1] // length) - 1
        if count < 1:
            continue
        frequencies = np.fft.rfftfreq(n, 1 / rate)
        to_travel = (frequencies > SETTINGS.lowest) / (1 + 2j * np.pi * frequencies * SETTINGS.lag)
        forces = np.fft.rfft(np.linalg.pinv(by_force) @ samples, axis=1)
        travel = np.fft.irfft(forces * to_travel, n, axis=1) / stiffness[:, None]
        starts = np.arange(count) * (length // 2)
        pieces.append(np.concatenate([samples, travel])[:, starts[:, None] + np.arange(length)])
    if not pieces or sum(piece.shape[1] for piece in pieces) < SETTINGS.min_segments:
        return None
    segments, m = np.concatenate(pieces, axis=1), len(body)
    rms = np.sqrt(np.mean(segments[m:] ** 2, axis=(1, 2)))
    segments[m:] **= 2
    low, high = (round(edge * length / rate) for edge in SETTINGS.band)
    centred = segments - segments.mean(axis=(1, 2), keepdims=True)
    lines = np.fft.rfft(centred * np.hanning(length), axis=-1)[..., low : high + 1].transpose(2, 0, 1)
    products = lines @ lines.conj().transpose(0, 2, 1)  # sums over segments of accelerations and squares, by frequency
    weighted = by_force.T @ np.linalg.inv(products[:, :m, :m] / segments.shape[1])
    information = np.sum((weighted @ by_force * products[:, m:, m:].transpose(0, 2, 1)).real, axis=0)
    explained = np.einsum("fia,fai->i", weighted, products[:, :m, m:]).real
    covariance = np.linalg.pinv((information + information.T) / 2, hermitian=True)
    scale = 2 * rms / stiffness
    values, covariance = scale * (covariance @ explained), covariance * np.outer(scale, scale)
    return Stiffening(tuple(element.owner for element in springs), values, covariance)
