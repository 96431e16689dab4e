"""Hypotheses of a change: one part, two, both of an axle, all of a kind, or a change that no part explains."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from sprung._arrays import Real
from sprung.vehicles import Component

#: Prior shares of one or two components, both of an axle, all corners, and an unmodelled change.
_SHARES = {"parts": 0.78, "axle": 0.15, "all": 0.02, "else": 0.05}
#: ln of the prior probability of two given components over that of a given single one.
_LOG_PAIR = -3.0


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """Part or parts that may have changed.

    Parameters
    ----------
    scope
        "single", "pair" (two parts, each by a size of its own), "axle" (both sides of it by the same factor), "all"
        (corners by the same factor) or "else" (an unmodelled change).
    corner
        "front_left", "front" for an axle, "all", or "vehicle" for an unmodelled change.
    component
        "spring", "damper" or "tyre"; "unmodelled".
    second
        Second part of a pair; None otherwise.
    """

    scope: str
    corner: str
    component: str
    second: Component | None = None

    @property
    def name(self) -> str:
        """Name, such as "front_left.spring", "front_left.spring+rear_right.tyre", "front.spring" or "unmodelled"."""
        if self.scope == "else":
            return self.component
        first = f"{self.corner}.{self.component}"
        return first if self.second is None else f"{first}+{self.second}"

    @property
    def changes(self) -> tuple["Hypothesis", ...]:
        """Hypotheses with one size each that make it up: two for a pair, none for an unmodelled change."""
        if self.second is not None:
            return (
                Hypothesis("single", self.corner, self.component),
                Hypothesis("single", self.second.corner, self.second.kind),
            )
        return () if self.scope == "else" else (self,)

    def parts(self, components: tuple[Component, ...]) -> tuple[Component, ...]:
        """Return the components that it changes; none for an unmodelled change."""
        return tuple(
            component
            for component in components
            if component == self.second
            or (component.kind == self.component and self.corner in {component.corner, component.axle, "all"})
        )

    def direction(self, components: tuple[Component, ...]) -> Real:
        """Return 1 for each component that it changes and 0 for the others, shape (components,)."""
        parts = self.parts(components)
        return np.array([float(component in parts) for component in components])

    def directions(self, components: tuple[Component, ...]) -> Real:
        """Return the direction of each of its sizes, shape (sizes, components)."""
        rows = [change.direction(components) for change in self.changes]
        return np.array(rows).reshape(len(rows), len(components))


def hypotheses_of(components: tuple[Component, ...]) -> tuple[Hypothesis, ...]:
    """Return all hypotheses: single components, both of an axle, all of a kind, an unmodelled change, and pairs."""
    axles = sorted({(component.axle, component.kind) for component in components})
    kinds = sorted({component.kind for component in components})
    return (
        *(Hypothesis("single", component.corner, component.kind) for component in components),
        *(Hypothesis("axle", axle, kind) for axle, kind in axles),
        *(Hypothesis("all", "all", kind) for kind in kinds),
        Hypothesis("else", "vehicle", "unmodelled"),
        *(Hypothesis("pair", first.corner, first.kind, second) for first, second in combinations(components, 2)),
    )


def log_prior(hypotheses: Sequence[Hypothesis]) -> Real:
    """Return ln of the prior probability of each hypothesis; their sum is 1.

    Those of one scope are equally probable, and a given pair is e^3 times less probable than a given single component.
    """
    scopes = [hypothesis.scope for hypothesis in hypotheses]
    weights = np.array([np.exp(_LOG_PAIR) if scope == "pair" else 1.0 for scope in scopes])
    shares = np.array(["parts" if scope in {"single", "pair"} else scope for scope in scopes])
    totals = {share: float(np.sum(weights[shares == share])) for share in set(shares.tolist())}
    return np.log([_SHARES[share] * weight / totals[share] for share, weight in zip(shares, weights, strict=True)])
