"""Mass and place of a mass on mounts as parameters."""

from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sprung._arrays import Complex, Real
from sprung.likelihood.blocks import ParameterBlock
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer
from sprung.vehicles import Structure

#: Standard deviations of ln of the mass and of its place ahead and to the left [m].
_MASS, _AHEAD, _LEFT = 0.3, 0.2, 0.1


@dataclass(frozen=True, eq=False, slots=True)
class MountedMassParameters(ParameterBlock):
    """Mass of a mounted mass, ln of it over nominal, and its place ahead and to the left, over nominal [m].

    Parameters
    ----------
    structure
        Nominal vehicle.
    coordinate
        Coordinate of the mass, such as "mounted_mass_1".
    std
        Standard deviations of ln of the mass and of both coordinates of the place [m].

    Raises
    ------
    ValueError
        If the structure lacks the coordinate.

    Notes
    -----
    Frequency and damping ratio on the mounts stay (`ModeScales` has them): stiffness and damping grow with the mass. A
    mass that moves u upwards on mounts displaced by (dx, dy) has the elongation e = u - r0 q - d q, r0 q the motion of
    the body at the nominal place and d q = -dx pitch + dy roll. With u' = u - d q as its coordinate the elongation is
    nominal, and only the kinetic energy m (u' + d q)^2 / 2 changes: the mass matrix has m g g^T, g = 1 for u' and d for
    the body, in place of the nominal mass; a sensor on the mass reads u' + d q.
    """

    structure: Structure
    coordinate: str
    std: tuple[float, float, float] = (_MASS, _AHEAD, _LEFT)

    group: ClassVar[str] = "mounts"

    def __post_init__(self) -> None:
        self.structure.coordinates.index(self.coordinate)

    @property
    def names(self) -> tuple[str, ...]:
        """Mass and place."""
        return tuple(f"{self.coordinate}_{name}" for name in ("mass", "x", "y"))

    @property
    def start(self) -> Real:
        """Nominal mass and place."""
        return np.zeros(3)

    @property
    def prior_std(self) -> Real:
        """Standard deviations of mass and place."""
        return np.array(self.std)

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the mass changed and moved."""
        stiffness = terms.stiffness.copy()
        stiffness[self._elements] *= np.exp(parameters[0])
        motion = terms.motion + np.outer(self._readings(terms), self._moved(parameters) - self._moved(np.zeros(3)))
        return replace(terms, mass=terms.mass + self._added(parameters), stiffness=stiffness, motion=motion)

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        terms, by_mass = gradients.transfer.terms, gradients.mass.real
        gradient = np.array([np.sum(by_mass * change) for change in self._mass_changes(parameters)])
        rows = self._elements
        gradient[0] += np.sum((gradients.stiffness[rows] * terms.stiffness[rows]).real)
        readings = self._readings(terms)
        if readings.any():
            gradient[1:] += readings @ gradients.motion.real @ self._place_changes().T
        return gradient

    def derivatives(self, parameters: Real, response: Transfer) -> list[Complex]:
        """Return the derivatives of the spectral matrix."""
        derivatives = [response.change_by_mass(change) for change in self._mass_changes(parameters)]
        for element in self._elements:
            derivatives[0] = derivatives[0] + response.change_by_element(element, response.terms.stiffness[element])
        readings = self._readings(response.terms)
        if readings.any():
            for number, change in enumerate(self._place_changes(), start=1):
                derivatives[number] = derivatives[number] + response.change_by_motion(np.outer(readings, change))
        return derivatives

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the mass over nominal, and the displacements of its place [m]."""
        return dict(zip(self.names, (float(np.exp(parameters[0])), *parameters[1:].tolist()), strict=True))

    def fitted(self, parameters: Real, structure: Structure) -> Structure:
        """Return the structure with the mass changed and moved."""
        factor, elements = float(np.exp(parameters[0])), list(structure.elements)
        moved = parameters[1:] @ self._place_changes()
        for number in self._elements:
            element = elements[number]
            elements[number] = replace(
                element,
                elongation=element.elongation - moved,
                stiffness=factor * element.stiffness,
                damping=factor * element.damping,
            )
        mass = structure.mass.copy()
        mass[self._column, self._column] *= factor
        return replace(structure, mass=mass, elements=tuple(elements))

    @property
    def _column(self) -> int:
        """Number of the mass' coordinate."""
        return self.structure.coordinates.index(self.coordinate)

    @property
    def _elements(self) -> list[int]:
        """Numbers of its mounts."""
        return [number for number, part in enumerate(self.structure.elements) if part.owner == self.coordinate]

    @property
    def _nominal(self) -> float:
        """Nominal mass [kg]."""
        return float(self.structure.mass[self._column, self._column])

    def _place_changes(self) -> Real:
        """Upward motion of the mass for 1 m ahead and 1 m to the left, shape (2, n)."""
        changes = np.zeros((2, len(self.structure.coordinates)))
        changes[0, self.structure.coordinates.index("pitch")] = -1.0
        changes[1, self.structure.coordinates.index("roll")] = 1.0
        return changes

    def _moved(self, parameters: Real) -> Real:
        """Upward motion of the mass for one unit of each coordinate, shape (n,)."""
        moved = parameters[1:] @ self._place_changes()
        moved[self._column] += 1.0
        return np.asarray(moved, dtype=np.float64)

    def _added(self, parameters: Real) -> Real:
        """Change of the mass matrix."""
        moved, before = self._moved(parameters), self._moved(np.zeros(3))
        return self._nominal * (np.exp(parameters[0]) * np.outer(moved, moved) - np.outer(before, before))

    def _mass_changes(self, parameters: Real) -> Real:
        """Derivatives of the mass matrix, shape (3, n, n)."""
        mass, moved = self._nominal * np.exp(parameters[0]), self._moved(parameters)
        changes = [np.outer(moved, moved)]
        changes += [np.outer(moved, place) + np.outer(place, moved) for place in self._place_changes()]
        return mass * np.array(changes)

    def _readings(self, terms: Terms) -> Real:
        """Reading of each channel for one unit of the mass' coordinate, shape (channels,)."""
        return np.asarray(terms.motion[:, self._column], dtype=np.float64)
