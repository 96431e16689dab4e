"""Springs and dampers of every corner from identified modes: a check of a fit, and another start of its search."""

import numpy as np

from sprung._arrays import Complex, Real
from sprung.errors import ParameterError
from sprung.likelihood.coordinates import RigidLayout
from sprung.modal import Modes
from sprung.vehicles import Component, Structure


def corners_from_modes(
    modes: Modes,
    structure: Structure,
    layout: RigidLayout,
    components: tuple[Component, ...],
    *,
    prior_std: float = 0.7,
    pole_error: float = 0.02,
) -> Real:
    """Return ln(value / nominal value) of components from poles and mode shapes.

    Parameters
    ----------
    modes
        Bounce, pitch and roll, or some of them, with the channels of the layout (other channels are ignored).
    structure
        Vehicle with nominal components.
    layout
        Coordinates of the channels, which must be motions of the body.
    components
        Components to fit; those that the modes do not determine stay near nominal.
    prior_std
        Standard deviation of ln(value / nominal value) before any mode.
    pole_error
        Relative error of an identified pole.

    Returns
    -------
    ndarray
        ln(value / nominal value), shape (components,).

    Raises
    ------
    ParameterError
        If a coordinate of the layout is not a motion of the body, or the modes lack one of its channels.

    Notes
    -----
    A mode of pole s and shape q of the body satisfies (M s^2 + C(s) s + K(s)) q = 0 on the rigid body's coordinates,
    where C(s) and K(s) hold wheels, mounted masses and tyres by elimination: with the dynamic stiffness D(s) in blocks
    of the body (b) and the others (o), the Schur complement gives (D_bb - D_bo D_oo^-1 D_ob) q = 0. With tyres much
    stiffer than springs these are the M^-1 K and M^-1 C of the thesis. Least squares over all modes, weighted for an
    error of a pole, and over the prior.

    References
    ----------
    F. Liu, Online Identification of Vehicle Dynamic Systems for Condition Monitoring, thesis, University of
    Huddersfield, 2020, section 4.3.2.
    F. Zhang (editor), The Schur Complement and Its Applications, Springer, 2005.

    Examples
    --------
    The exact modes of the body of a car with a soft spring give the loss of stiffness:

    >>> import numpy as np
    >>> from sprung.likelihood import rigid_layout
    >>> from sprung.modal import Modes
    >>> from sprung.vehicles import parse_fault, read_vehicle, structure, with_faults
    >>> nominal = structure(read_vehicle("zafira"))
    >>> exact = with_faults(nominal, [parse_fault("front_left.spring=-0.3")]).modes()
    >>> poles, shapes, std = exact.poles[:3], exact.mode_shapes[:3], np.full(3, np.nan)
    >>> modes = Modes(poles, shapes, exact.channels, std, std, np.ones(3), exact.labels[:3])
    >>> springs = tuple(component for component in nominal.components() if component.kind == "spring")
    >>> ratios = corners_from_modes(modes, nominal, rigid_layout(nominal), springs)
    >>> dict(zip(map(str, springs), np.expm1(ratios).round(2).tolist()))["front_left.spring"]
    -0.3
    """
    body = [structure.coordinates.index(name) for name in layout.coordinates if name in structure.coordinates]
    if len(body) != len(layout.coordinates):
        raise ParameterError(
            "the sensors observe more than the motion of the body: corners from modes need sensors on the body only"
        )
    try:
        rows = [modes.channels.index(name) for name in layout.names]
    except ValueError:
        wanted = ", ".join(layout.names)
        raise ParameterError(f"modes lack one of the channels {wanted}: identify all of them") from None
    poles = np.asarray(modes.poles)
    shapes = np.asarray(modes.mode_shapes)[:, rows] * poles[:, None] ** (2 - layout.orders)
    motions = shapes @ layout.reduction.T
    size = np.sqrt(np.diag(structure.mass)[body])
    motions /= np.linalg.norm(motions * size, axis=1, keepdims=True)

    def errors(logarithms: Real) -> Real:
        residuals = [logarithms / prior_std]
        changed = structure.changed(dict(zip(components, np.exp(logarithms).tolist(), strict=True)))
        for pole, motion in zip(poles, motions, strict=True):
            reduced = _reduced(_dynamic_stiffness(changed, complex(pole)), body)
            force = (reduced @ motion) / size / (2 * np.abs(pole) ** 2 * pole_error)
            residuals += [force.real, force.imag]
        return np.concatenate(residuals)

    from scipy.optimize import least_squares

    return least_squares(errors, np.zeros(len(components)), method="trf").x


def _dynamic_stiffness(structure: Structure, pole: complex) -> Complex:
    """D(s) = M s^2 + C(s) s + K at a pole."""
    stiffness = np.array([element.dynamic_stiffness(pole) for element in structure.elements])
    D = structure.elongations
    return np.asarray(structure.mass * pole**2 + (D.T * stiffness) @ D, dtype=np.complex128)


def _reduced(stiffness: Complex, kept: list[int]) -> Complex:
    """Dynamic stiffness of some coordinates with no force on the others, D_bb - D_bo D_oo^-1 D_ob."""
    others = [row for row in range(len(stiffness)) if row not in kept]
    coupling = stiffness[np.ix_(kept, others)]
    return stiffness[np.ix_(kept, kept)] - coupling @ np.linalg.solve(
        stiffness[np.ix_(others, others)], stiffness[np.ix_(others, kept)]
    )
