"""Stiffness and damping of elements beyond the corners as parameters: anti-roll bars, side forces of tyres."""

from abc import abstractmethod
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sprung._arrays import Complex, Real
from sprung.likelihood.blocks import ParameterBlock
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer
from sprung.vehicles import Element, Structure


@dataclass(frozen=True, eq=False, slots=True)
class ElementFactors(ParameterBlock):
    """A factor of stiffness and damping of each element of a part, whose components are not otherwise fitted.

    Parameters
    ----------
    structure
        Nominal vehicle.
    std
        Standard deviation of a parameter before any data.

    Notes
    -----
    Put after `FreeComponents`, whose nominal dynamic stiffness of these elements it replaces.
    """

    structure: Structure
    std: float

    group: ClassVar[str] = "elements"
    #: Part of the elements.
    part: ClassVar[str]
    #: End of the names of the parameters.
    suffix: ClassVar[str]

    @staticmethod
    @abstractmethod
    def factors(parameters: Real) -> tuple[Real, Real]:
        """Return the factor of each element, and its derivative."""

    @property
    def names(self) -> tuple[str, ...]:
        """Owner of each element, such as "front_axle", with the suffix."""
        return tuple(f"{element.owner}{self.suffix}" for _, element in self._elements())

    @property
    def prior_std(self) -> Real:
        """The same for all elements."""
        return np.full(len(self.names), self.std)

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the dynamic stiffness of the elements."""
        stiffness = terms.stiffness.copy()
        for factor, (number, element) in zip(self.factors(parameters)[0].tolist(), self._elements(), strict=True):
            stiffness[number] = element.dynamic_stiffness(terms.s, spring=factor, damper=factor)
        return replace(terms, stiffness=stiffness)

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        changes = self._changes(parameters, gradients.transfer.terms)
        by_element = gradients.stiffness([number for number, _ in changes])
        return np.array([np.sum((each * change).real) for each, (_, change) in zip(by_element, changes, strict=True)])

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        changes = self._changes(parameters, response.terms)
        return [response.change_by_element(number, change) for number, change in changes]

    def values(self, parameters: Real) -> dict[str, float]:
        """Return the factors."""
        return dict(zip(self.names, self.factors(parameters)[0].tolist(), strict=True))

    def fitted(self, parameters: Real, structure: Structure) -> Structure:
        """Return the structure with the factors applied to the elements, at least 0."""
        elements = list(structure.elements)
        for factor, (number, _) in zip(self.factors(parameters)[0].tolist(), self._elements(), strict=True):
            old, scale = elements[number], max(0.0, factor)
            elements[number] = replace(old, stiffness=scale * old.stiffness, damping=scale * old.damping)
        return replace(structure, elements=tuple(elements))

    def _elements(self) -> list[tuple[int, Element]]:
        """Return the number and each element of the part."""
        return [pair for pair in enumerate(self.structure.elements) if pair[1].part == self.part]

    def _changes(self, parameters: Real, terms: Terms) -> list[tuple[int, Complex]]:
        """Return the number of each element, and the derivative of its dynamic stiffness."""
        changes = []
        for factor, slope, (number, element) in zip(*self.factors(parameters), self._elements(), strict=True):
            by_damping = element.damping_derivative(terms.s, damper=factor) / factor if element.damping else 0.0
            changes.append((number, slope * (element.stiffness + by_damping + np.zeros_like(terms.s))))
        return changes


class CorneringStiffness(ElementFactors):
    """Side forces of the tyres of each axle; the parameters are ln(value / nominal value)."""

    __slots__ = ()

    part: ClassVar[str] = "cornering"
    suffix: ClassVar[str] = ".cornering_stiffness"

    @staticmethod
    def factors(parameters: Real) -> tuple[Real, Real]:
        """Return the exponential, and its derivative."""
        return np.exp(parameters), np.exp(parameters)


class BarStiffness(ElementFactors):
    """Anti-roll bars; the parameters are the change of the stiffness over its nominal value, -1 where a link is broken.

    Notes
    -----
    Linear, unlike the other components: sensors on the body see the sum of the bars far better than each of them. With
    the logarithm a bar that is lost would be infinitely far from the prior, and another one would be made stiffer, or
    weaker, in its place.

    Examples
    --------
    An anti-roll bar at the front that is 20 % stiffer than in the file:

    >>> import numpy as np
    >>> from sprung.vehicles import read_vehicle, structure
    >>> car = read_vehicle("zafira")
    >>> axles = tuple(axle.model_copy(update={"anti_roll_stiffness": 10e3}) for axle in car.axle)
    >>> nominal = structure(car.model_copy(update={"axle": axles}))
    >>> fitted = BarStiffness(nominal, std=0.5).fitted(np.array([0.2, 0.0]), nominal)
    >>> [round(element.stiffness) for element in fitted.elements if element.part == "anti_roll"]
    [12000, 10000]
    """

    __slots__ = ()

    part: ClassVar[str] = "anti_roll"
    suffix: ClassVar[str] = "_stiffness"

    @staticmethod
    def factors(parameters: Real) -> tuple[Real, Real]:
        """Return 1 and the change, and its derivative."""
        return 1 + parameters, np.ones_like(parameters)


def log_of_bars(changes: Real) -> tuple[Real, Real]:
    """Return ln of the stiffness of anti-roll bars over nominal, and its slope.

    Parameters
    ----------
    changes
        Parameters of `BarStiffness`, shape (bars,).

    Notes
    -----
    ln(1 + p), and below a half its tangent, ln(1/2) + 2 (p + 1/2): a bar that is lost has -1.69, a loss of 82 %, in
    place of minus infinity, and its standard deviation stays finite.

    Examples
    --------
    >>> import numpy as np
    >>> ratios, slopes = log_of_bars(np.array([0.2, -0.5, -1.0]))
    >>> np.expm1(ratios).round(2).tolist(), slopes.round(2).tolist()
    ([0.2, -0.5, -0.82], [0.83, 2.0, 2.0])
    """
    upper = np.maximum(changes, -0.5)
    return np.log1p(upper) + 2 * (changes - upper), 1 / (1 + upper)
