"""Frequency responses of a structure, and sensitivities of its modes to each component."""

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sprung._arrays import Complex, Real
from sprung._checks import freeze, frozen_array
from sprung.errors import ParameterError
from sprung.vehicles.components import Component
from sprung.vehicles.structure import Structure


def frequency_response(structure: Structure, frequencies: ArrayLike) -> Complex:
    """Return the frequency responses of the sensors to the inputs.

    Parameters
    ----------
    structure
        Masses, elements and sensors of a vehicle.
    frequencies
        Frequencies [Hz], at least 0, shape (frequencies,).

    Returns
    -------
    ndarray
        Output over input, such as m/s^2 over m, shape (frequencies, channels, inputs).

    Raises
    ------
    ParameterError
        If a frequency is negative or not finite.

    Notes
    -----
    H(f) = C (i w I - A)^-1 B + D with w = 2 pi f.

    Examples
    --------
    >>> from sprung.vehicles import read_description, structure
    >>> quarter = structure(read_description("quarter"))
    >>> f = np.array([0.5, 13.21])
    >>> body = np.abs(frequency_response(quarter, f)[:, 0, 0]) / (2 * np.pi * f) ** 2  # over the height of the road
    >>> body.round(2).tolist()  # far below its mode, and at it
    [1.0, 4.2]
    """
    f = frozen_array("frequencies", frequencies, ndim=1)
    if not np.all(np.isfinite(f)) or np.any(f < 0):
        raise ParameterError("frequencies must be finite and at least 0: correct them")
    space = structure.state_space()
    resolvent = 2j * np.pi * f[:, None, None] * np.eye(len(space.state_matrix)) - space.state_matrix
    states = np.linalg.solve(resolvent, np.broadcast_to(space.input_matrix, (f.size, *space.input_matrix.shape)))
    return np.asarray(space.output_matrix @ states + space.feedthrough, dtype=np.complex128)


@dataclass(frozen=True, eq=False, slots=True)
class Sensitivities:
    """How natural frequencies and damping ratios change with each component.

    Parameters
    ----------
    components
        The vehicle's springs, dampers and tyres.
    natural_frequency
        Derivatives d f / d ln(value) [Hz], shape (modes, components); times 0.01: the change for 1 % of the component.
    damping_ratio
        Derivatives d xi / d ln(value), shape (modes, components).
    """

    components: tuple[Component, ...]
    natural_frequency: Real
    damping_ratio: Real

    def __post_init__(self) -> None:
        freeze(self, natural_frequency=2, damping_ratio=2)


def sensitivities(structure: Structure) -> Sensitivities:
    """Return the sensitivities of the modes of a structure to each of its components.

    Parameters
    ----------
    structure
        Masses, elements and sensors of a vehicle.

    Returns
    -------
    Sensitivities
        Modes in the order of `Structure.modes`, components in the order of `Structure.components`.

    Notes
    -----
    With the dynamic stiffness D(s) = s^2 M + sum z(s) d d^T, symmetric, and D(s) q = 0: ds / dp =
    -(q^T dD/dp q) / (q^T dD/ds q).

    References
    ----------
    R. L. Fox and M. P. Kapoor, Rates of change of eigenvalues and eigenvectors, AIAA Journal 6 (1968), 2426-2429.

    Examples
    --------
    >>> from sprung.vehicles import chain
    >>> three_masses = chain()
    >>> changes = sensitivities(three_masses)
    >>> springs = [component.kind == "spring" for component in changes.components]
    >>> halves = three_masses.modes().natural_frequency / 2  # the frequency rises with the root of all stiffnesses
    >>> np.allclose(changes.natural_frequency[:, springs].sum(axis=1), halves, rtol=1e-2)
    True
    """
    poles = structure.modes().poles
    shapes = _coordinate_shapes(structure, poles)
    elongations = np.einsum("mi,ei->me", shapes, structure.elongations) ** 2
    slope = 2 * poles * np.einsum("mi,ij,mj->m", shapes, structure.mass, shapes)
    for number, element in enumerate(structure.elements):
        slope = slope + element.damping_derivative(poles) / poles * elongations[:, number]
    by_component: dict[Component, Complex] = {}
    for number, element in enumerate(structure.elements):
        spring, damper = element.components
        by_component[spring] = -element.stiffness * elongations[:, number] / slope
        if damper is not None:
            by_component[damper] = -element.damping_derivative(poles) * elongations[:, number] / slope
    change = np.array(list(by_component.values())).T.reshape(poles.size, len(by_component))
    size = np.abs(poles)[:, None]
    growth = (poles.conj()[:, None] * change).real / size
    damping = -change.real / size + poles.real[:, None] * growth / size**2
    return Sensitivities(tuple(by_component), growth / (2 * np.pi), damping)


def _coordinate_shapes(structure: Structure, poles: Complex) -> Complex:
    """Shapes of the poles in the coordinates, shape (modes, n)."""
    eigenvalues, vectors = np.linalg.eig(structure.system.state_matrix())
    order = np.argmin(np.abs(eigenvalues[:, None] - poles), axis=0)
    return vectors[: len(structure.coordinates), order].T
