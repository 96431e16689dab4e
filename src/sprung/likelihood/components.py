"""Springs, dampers and tyres as parameters."""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np

from sprung._arrays import Complex, Real
from sprung.errors import ParameterError
from sprung.likelihood.blocks import ParameterBlock
from sprung.likelihood.terms import Terms
from sprung.likelihood.transfer import TermGradients, Transfer
from sprung.vehicles import Component, Structure, Vehicle


@dataclass(frozen=True, eq=False, slots=True)
class FreeComponents(ParameterBlock):
    """Springs, dampers and tyres; the parameters are ln(value / nominal value).

    Parameters
    ----------
    structure
        Nominal vehicle.
    components
        Components to fit; the others keep their nominal values.
    log_std
        Standard deviation of the prior of every parameter.

    Notes
    -----
    Dynamic stiffness z of an element: dz / d ln k = k and dz / d ln c as `Element.damping_derivative`; so the gradient
    is Re sum over frequencies of (gradient with respect to z) dz / d ln(value).
    """

    structure: Structure
    components: tuple[Component, ...]
    log_std: float = 0.7

    group: ClassVar[str] = "components"

    @property
    def names(self) -> tuple[str, ...]:
        """Components as CORNER.KIND."""
        return tuple(map(str, self.components))

    @property
    def prior_std(self) -> Real:
        """The same for all components."""
        return np.full(len(self.components), self.log_std)

    def contribute(self, parameters: Real, terms: Terms) -> Terms:
        """Return the terms with the dynamic stiffness of the elements."""
        s, factor = terms.s, self._factors(parameters)
        stiffness = [
            element.dynamic_stiffness(
                s, spring=factor.get(spring, 1.0), damper=factor.get(damper, 1.0) if damper else 1.0
            )
            for element in self.structure.elements
            for spring, damper in [element.components]
        ]
        return replace(terms, stiffness=np.array(stiffness))

    def gradient(self, parameters: Real, gradients: TermGradients) -> Real:
        """Return the gradient of the objective."""
        changes, gradient = list(self._changes(parameters, gradients.transfer.terms)), np.zeros(len(self.components))
        for (row, _, change), each in zip(changes, gradients.stiffness([e for _, e, _ in changes]), strict=True):
            gradient[row] += np.sum((each * change).real)
        return gradient

    def derivatives(self, parameters: Real, response: Transfer) -> list[Real]:
        """Return the derivatives of the spectral matrix."""
        derivatives: list[Real] = [np.zeros(())] * len(self.components)
        for row, element, change in self._changes(parameters, response.terms):
            derivatives[row] = derivatives[row] + response.change_by_element(element, change)
        return derivatives

    def values(self, parameters: Real) -> dict[str, float]:
        """Return stiffnesses [N/m] and damping [N s/m]."""
        nominal, factors = self.structure.components(), self._factors(parameters)
        return {str(component): nominal[component] * factors[component] for component in self.components}

    def fitted(self, parameters: Real, structure: Structure) -> Structure:
        """Return the structure with the fitted components."""
        return structure.changed(self._factors(parameters))

    def _factors(self, parameters: Real) -> dict[Component, float]:
        """Value over nominal value of each component."""
        return dict(zip(self.components, np.exp(parameters).tolist(), strict=True))

    def _changes(self, parameters: Real, terms: Terms) -> Iterator[tuple[int, int, Complex]]:
        """Yield row of a parameter, number of an element, and the derivative of the element's dynamic stiffness."""
        s, factor = terms.s, self._factors(parameters)
        rows = {component: row for row, component in enumerate(self.components)}
        for number, element in enumerate(self.structure.elements):
            spring, damper = element.components
            if spring in rows:
                yield rows[spring], number, np.full_like(s, factor[spring] * element.stiffness)
            if damper is not None and damper in rows:
                yield rows[damper], number, element.damping_derivative(s, damper=factor[damper])


def free_components(
    nominal: Structure, vehicle: Vehicle, names: tuple[str, ...] | None, *, kind: str
) -> tuple[Component, ...]:
    """Return the components of the corners that are to be fitted.

    Parameters
    ----------
    nominal
        Nominal vehicle.
    vehicle
        Its description, whose axles have the corners.
    names
        Kinds ("spring", "damper", "tyre") and single components ("rear_left.damper"); None: all, but for the contact of
        wheel and rail on a track, which is hundreds of times stiffer than a spring and does not wear out.
    kind
        Excitation of the wheels: "road", "rail" or "rig".

    Raises
    ------
    ParameterError
        If a name is neither a kind nor a component of a corner.
    """
    corners = vehicle.suspensions
    every = tuple(
        component for component, value in nominal.components().items() if component.corner in corners and value > 0
    )
    if names is None:
        return tuple(component for component in every if kind != "rail" or component.kind != "tyre")
    for name in names:
        if not any(name in {component.kind, str(component)} for component in every):
            known = ", ".join(map(str, every))
            raise ParameterError(f"free component {name!r} is none of spring, damper, tyre, {known}")
    return tuple(component for component in every if {component.kind, str(component)} & set(names))
