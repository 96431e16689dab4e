"""Hypotheses of a change: one part, both of an axle, all of a kind, or a change that no part explains."""

from dataclasses import dataclass

import numpy as np

from sprung._arrays import Real
from sprung.vehicles import Component

#: Prior shares of a single component, both of an axle, all corners, and an unmodelled change.
_SHARES = {"single": 0.78, "axle": 0.15, "all": 0.02, "else": 0.05}


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """Part or parts that may have changed.

    Parameters
    ----------
    scope
        "single", "axle" (both sides of it), "all" (corners) or "else" (an unmodelled change).
    corner
        "front_left", "front" for an axle, "all", or "vehicle" for an unmodelled change.
    component
        "spring", "damper" or "tyre"; "unmodelled".
    """

    scope: str
    corner: str
    component: str

    @property
    def name(self) -> str:
        """Name, such as "front_left.spring", "front.spring" (both of an axle), "all.spring", or "unmodelled"."""
        return self.component if self.scope == "else" else f"{self.corner}.{self.component}"

    def parts(self, components: tuple[Component, ...]) -> tuple[Component, ...]:
        """Return the components that it changes together; none for an unmodelled change."""
        return tuple(
            component
            for component in components
            if component.kind == self.component and self.corner in {component.corner, component.axle, "all"}
        )

    def direction(self, components: tuple[Component, ...]) -> Real:
        """Return 1 for each component that it changes and 0 for the others, shape (components,)."""
        parts = self.parts(components)
        return np.array([float(component in parts) for component in components])


def hypotheses_of(components: tuple[Component, ...]) -> tuple[Hypothesis, ...]:
    """Return the hypotheses of single components, both of an axle, all of a kind, and last an unmodelled change."""
    axles = sorted({(component.axle, component.kind) for component in components})
    kinds = sorted({component.kind for component in components})
    return (
        *(Hypothesis("single", component.corner, component.kind) for component in components),
        *(Hypothesis("axle", axle, kind) for axle, kind in axles),
        *(Hypothesis("all", "all", kind) for kind in kinds),
        Hypothesis("else", "vehicle", "unmodelled"),
    )


def log_prior(hypotheses: tuple[Hypothesis, ...]) -> Real:
    """Return ln of the prior probability of each hypothesis; those of one scope share it equally."""
    scopes = [hypothesis.scope for hypothesis in hypotheses]
    return np.log([_SHARES[scope] / scopes.count(scope) for scope in scopes])
