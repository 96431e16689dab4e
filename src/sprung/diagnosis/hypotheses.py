"""Hypotheses of a change: one part, two, both of an axle, all of a kind, or a change that no part explains."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations

import numpy as np

from sprung._arrays import Real
from sprung._checks import frozen_array
from sprung.vehicles import Component


@dataclass(frozen=True, slots=True)
class ChangePriors:
    """What is known of a change before any window. The shares of the scopes add up to 1."""

    #: Share of changes of one or two components.
    parts: float = 0.78
    #: Share of changes of both sides of an axle.
    axle: float = 0.15
    #: Share of changes of all corners.
    all_corners: float = 0.02
    #: Share of unmodelled changes.
    unmodelled: float = 0.05
    #: ln of the probability of two given components over that of a given single one.
    log_pair: float = -3.0
    #: Standard deviation of the size of a change, ln values.
    size: float = 0.15
    #: The same of an anti-roll bar, which loses all of its stiffness by a broken link.
    size_of_bars: float = 1.0
    #: Standard deviation of an unmodelled change, ln values of each component.
    unmodelled_size: float = 0.04


PRIORS = ChangePriors()


@dataclass(frozen=True, slots=True)
class Hypothesis:
    """Part or parts that may have changed.

    Parameters
    ----------
    scope
        "single", "pair" (two parts, each by a size of its own), "axle" (both sides of it by the same factor), "all"
        (corners by the same factor) or "else" (an unmodelled change).
    corner
        "front_left", "front" for both sides of an axle, "front_axle" for its anti-roll bar, "all", or "vehicle" for an
        unmodelled change.
    component
        "spring", "damper", "tyre" or "anti_roll"; "unmodelled".
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


def typical_sizes(components: tuple[Component, ...]) -> Real:
    """Return the typical size of a change of each component over that of a spring, shape (components,)."""
    bars = [component.kind == "anti_roll" for component in components]
    return np.where(bars, PRIORS.size_of_bars / PRIORS.size, 1.0)


@lru_cache(maxsize=16)
def hypotheses_of(components: tuple[Component, ...]) -> tuple[Hypothesis, ...]:
    """Return all hypotheses: single components, both of an axle, all of a kind, an unmodelled change, and pairs."""
    sided = [component for component in components if component.side]
    axles = sorted({(component.axle, component.kind) for component in sided})
    kinds = sorted({component.kind for component in sided})
    return (
        *(Hypothesis("single", component.corner, component.kind) for component in components),
        *(Hypothesis("axle", axle, kind) for axle, kind in axles),
        *(Hypothesis("all", "all", kind) for kind in kinds),
        Hypothesis("else", "vehicle", "unmodelled"),
        *(Hypothesis("pair", first.corner, first.kind, second) for first, second in combinations(components, 2)),
    )


@lru_cache(maxsize=16)
def typical_directions(components: tuple[Component, ...]) -> Real:
    """Return the directions of hypotheses with one size, as large as is typical, shape (hypotheses, components).

    These are the first ones of `hypotheses_of`.
    """
    rows = [each.direction(components) for each in hypotheses_of(components) if len(each.changes) == 1]
    sizes = np.array(rows).reshape(-1, len(components)) * typical_sizes(components)
    return frozen_array("directions", sizes, ndim=2)


def log_prior(hypotheses: Sequence[Hypothesis]) -> Real:
    """Return ln of the prior probability of each hypothesis; their sum is 1.

    Those of one scope are equally probable, and a given pair is e^3 times less probable than a given single component.
    """
    shares = {"parts": PRIORS.parts, "axle": PRIORS.axle, "all": PRIORS.all_corners, "else": PRIORS.unmodelled}
    weights = np.array([np.exp(PRIORS.log_pair) if each.scope == "pair" else 1.0 for each in hypotheses])
    groups = np.array(["parts" if each.scope in {"single", "pair"} else each.scope for each in hypotheses])
    totals = {group: float(np.sum(weights[groups == group])) for group in shares}
    return np.log([shares[group] * weight / totals[group] for group, weight in zip(groups, weights, strict=True)])
