"""Exact modes of a mechanical system, as observed by its sensors."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Complex, Real
from sprung._checks import freeze, frozen_array
from sprung.modal import damping_ratio, natural_frequency, unit_shapes
from sprung.vehicles.system import MechanicalSystem, Outputs

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
    shapes = (
        (outputs.acceleration @ coordinates) * poles**2
        + (outputs.velocity @ coordinates) * poles
        + outputs.displacement @ coordinates
    ).T
    return ExactModes(
        poles=poles,
        mode_shapes=_seen_shapes(shapes, np.abs(coordinates).max(axis=0) * _reach(outputs, np.abs(poles))),
        channels=outputs.names,
        labels=_labels(system, coordinates.T),
    )


def _reach(outputs: Outputs, pulsation: Real) -> Real:
    """Return the largest reading of any sensor for motions of unit size at each angular frequency [rad/s]."""
    matrices = (outputs.displacement, outputs.velocity, outputs.acceleration)
    sizes = [np.abs(matrix).max(initial=0.0) * pulsation**order for order, matrix in enumerate(matrices)]
    return np.sum(sizes, axis=0)


def _seen_shapes(shapes: Complex, reach: Real) -> Complex:
    """Return shapes scaled to 1 at their largest channel; zeros where no sensor observes the mode."""
    if shapes.size == 0:
        return shapes
    is_seen = np.abs(shapes).max(axis=1) > _UNSEEN * reach
    return unit_shapes(shapes * is_seen[:, None])


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


def _labels(system: MechanicalSystem, shapes: Complex) -> tuple[str | None, ...]:
    """Return the label of each mode, the motion of largest energy; a body motion labels only its strongest mode."""
    shares = participation(system.mass, shapes)
    labels: list[str | None] = [None] * len(shapes)
    wheels = [name.startswith("wheel") for name in system.coordinates]
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
