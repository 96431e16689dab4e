"""Stiffness and damping of elements beyond the corners as parameters: anti-roll bars, mounts, flexible modes."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sprung._arrays import Complex, Real
from sprung.errors import ParameterError
from sprung.likelihood.blocks import ParameterBlock
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer
from sprung.vehicles import Element, Structure


@dataclass(frozen=True, slots=True)
class ElementParameter:
    """Logarithm of a factor of elements: stiffness and damping are multiplied by powers of it.

    Parameters
    ----------
    name
        Name of the parameter.
    owner
        Owner of the elements, such as "mounted_mass_1" or "front_axle", or owner and part, such as "body.torsion".
    stiffness_power, damping_power
        Powers of the factor in the stiffness and in the damping.
    std
        Standard deviation of the logarithm about 0 before any data.
    """

    name: str
    owner: str
    stiffness_power: float
    damping_power: float
    std: float


@dataclass(frozen=True, eq=False, slots=True)
class ElementScales(ParameterBlock):
    """Factors of stiffness and damping of elements whose components are not otherwise fitted.

    Parameters
    ----------
    structure
        Nominal vehicle.
    parts
        Parameters; several may act on one element.

    Raises
    ------
    ParameterError
        If the structure has no element of an owner.

    Notes
    -----
    ln k = ln k_nominal + sum a p and ln c = ln c_nominal + sum b p over the parameters p of an element's owner, with
    the powers a and b. Put after `FreeComponents`, whose dynamic stiffness of these elements it replaces.
    """

    structure: Structure
    parts: tuple[ElementParameter, ...]

    group: ClassVar[str] = "elements"

    def __post_init__(self) -> None:
        owners = {name for element in self.structure.elements for name in _names(element)}
        for part in self.parts:
            if part.owner not in owners:
                known = ", ".join(sorted(owners))
                raise ParameterError(f"owner {part.owner!r} of parameter {part.name!r} is none of {known}: correct it")

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the parameters."""
        return tuple(part.name for part in self.parts)

    @property
    def prior_std(self) -> Real:
        """Standard deviations of the parameters."""
        return np.array([part.std for part in self.parts])

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the dynamic stiffness of the elements."""
        stiffness = terms.stiffness.copy()
        for number, own, _ in self._elements(parameters, terms):
            stiffness[number] = own
        return replace(terms, stiffness=stiffness)

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        by_element, terms, gradient = gradients.stiffness, gradients.transfer.terms, np.zeros(len(self.parts))
        for number, own, changes in self._elements(parameters, terms):
            scaled = by_element[number] * terms.stiffness[number] / own
            for row, change in changes:
                gradient[row] += np.sum((scaled * change).real)
        return gradient

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        derivatives: list[Real] = [np.zeros(())] * len(self.parts)
        for number, own, changes in self._elements(parameters, response.terms):
            scale = response.terms.stiffness[number] / own
            for row, change in changes:
                derivatives[row] = derivatives[row] + response.change_by_element(number, scale * change)
        return derivatives

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the factors."""
        return dict(zip(self.names, np.exp(parameters).tolist(), strict=True))

    def fitted(self, parameters: Real, structure: Structure) -> Structure:
        """Return the structure with the factors applied to the elements."""
        elements = list(structure.elements)
        for number, element in enumerate(elements):
            spring, damper = self._factors(parameters, element)
            elements[number] = replace(element, stiffness=spring * element.stiffness, damping=damper * element.damping)
        return replace(structure, elements=tuple(elements))

    def _factors(self, parameters: Real, element: Element) -> tuple[float, float]:
        """Factors of the stiffness and of the damping of an element."""
        powers = [
            (p * part.stiffness_power, p * part.damping_power)
            for p, part in zip(parameters.tolist(), self.parts, strict=True)
            if part.owner in _names(element)
        ]
        logarithms = np.sum(powers, axis=0) if powers else np.zeros(2)
        return float(np.exp(logarithms[0])), float(np.exp(logarithms[1]))

    def _elements(self, parameters: Real, terms: Terms) -> Iterator[tuple[int, Complex, list[tuple[int, Complex]]]]:
        """Yield each element's number, its dynamic stiffness, and rows of its parameters with the derivatives."""
        s = terms.s
        for number, element in enumerate(self.structure.elements):
            rows = [(row, part) for row, part in enumerate(self.parts) if part.owner in _names(element)]
            if rows:
                spring, damper = self._factors(parameters, element)
                by_stiffness = np.full_like(s, spring * element.stiffness)
                by_damping = element.damping_derivative(s, damper=damper)
                changes = [
                    (row, part.stiffness_power * by_stiffness + part.damping_power * by_damping) for row, part in rows
                ]
                yield number, element.dynamic_stiffness(s, spring=spring, damper=damper), changes


def _names(element: Element) -> tuple[str, str]:
    """Names by which a parameter finds an element: its owner, and owner and part."""
    return element.owner, f"{element.owner}.{element.part}"


def stiffness_scales(
    structure: Structure, owners: Sequence[str], *, std: float = 0.3, has_damping: bool = False
) -> ElementScales:
    """Return the stiffness of elements as parameters, around the file's values.

    Parameters
    ----------
    structure
        Nominal vehicle.
    owners
        Owners of the springs, such as "front_axle" for its anti-roll bar.
    std
        Standard deviation of ln of a stiffness.
    has_damping
        Whether the damping changes with it.

    Examples
    --------
    An anti-roll bar at the front that is 20 % stiffer than in the file:

    >>> import numpy as np
    >>> from sprung.vehicles import read_vehicle, structure
    >>> car = read_vehicle("zafira")
    >>> axles = tuple(axle.model_copy(update={"anti_roll_stiffness": 10e3}) for axle in car.axle)
    >>> nominal = structure(car.model_copy(update={"axle": axles}))
    >>> bars = stiffness_scales(nominal, ["front_axle"])
    >>> fitted = bars.fitted(np.log([1.2]), nominal)
    >>> [round(element.stiffness) for element in fitted.elements if element.part == "anti_roll"]
    [12000, 10000]
    """
    return ElementScales(
        structure,
        tuple(ElementParameter(f"{owner}_stiffness", owner, 1.0, float(has_damping), std) for owner in owners),
    )
