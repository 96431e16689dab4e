"""Scatter of windows about their mean: as they report it, as they show it, and common changes of a kind."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from sprung._arrays import Real
from sprung.diagnosis.directions import (
    COMMON,
    COMMON_AT_A_TEMPERATURE,
    USUAL_ENDS,
    directions,
    kinds_of,
    usual_nuisance,
)
from sprung.vehicles import Component

#: Weight of the scatter that windows report, in degrees of freedom of all pairs.
_REPORTED = 1.0
#: Weights of prior scatters in windows: of one pair, as all pairs scatter; of front against rear and of all of a kind
#: together, as is usual.
_OF_PAIRS, _OF_ENDS, _OF_ALL = 4.0, 8.0, 4.0
#: Probability at which a variance with few degrees of freedom is widened to the quantile of the common one.
_TAIL = 1e-5


@dataclass(frozen=True, eq=False, slots=True)
class FreeDegrees:
    """Degrees of freedom that a regression on conditions leaves to the windows.

    Parameters
    ----------
    rows
        1 and the conditions of each window, shape (windows, 1 + conditions).
    covariance
        Covariance of a window, shape (components, components).
    slope_covariances
        Covariance of the slopes with each condition before any window.
    """

    rows: Real
    covariance: Real
    slope_covariances: Sequence[Real]

    def of(self, direction: Real) -> float:
        """Return the degrees of freedom of a direction, shape (components,); at least 1.

        Notes
        -----
        n - tr[(X^T X + L)^-1 X^T X], with L the variance of a window over that of each slope before any window.
        """
        variance = direction @ self.covariance @ direction
        ridge = [variance / (direction @ slopes @ direction) for slopes in self.slope_covariances]
        squares = self.rows.T @ self.rows
        used = np.trace(np.linalg.solve(squares + np.diag([0.0, *ridge]), squares))
        return max(len(self.rows) - float(used), 1.0)


@dataclass(frozen=True, eq=False, slots=True)
class Scatter:
    """Scatter of the windows of a vehicle about their mean under their conditions.

    Parameters
    ----------
    components
        Springs, dampers and tyres.
    reported
        Mean covariance that windows report, shape (components, components).
    scales
        Standard deviation of each component over the reported one, shape (components,).
    ends, together
        Standard deviation of front against rear and of all components of each kind, beyond what the fits explain.
    is_warm
        Whether the temperature of every window is known, so that common changes can be learnt.
    degrees
        Degrees of freedom of all pairs together.
    """

    components: tuple[Component, ...]
    reported: Real
    scales: Real
    ends: dict[str, float]
    together: dict[str, float]
    is_warm: bool
    degrees: float

    @classmethod
    def usual(cls, components: tuple[Component, ...], reported: Real, *, with_temperature: bool) -> "Scatter":
        """Return the scatter as windows report it, with the usual common changes."""
        kinds = {component.kind for component in components}
        common = COMMON_AT_A_TEMPERATURE if with_temperature else COMMON
        ends = {kind: USUAL_ENDS.get(kind, 0.02) for kind in kinds}
        together = {kind: common.get(kind, 0.2) for kind in kinds}
        return cls(components, reported, np.ones(len(components)), ends, together, with_temperature, 0.0)

    @property
    def covariance(self) -> Real:
        """Covariance of a window without common changes."""
        return np.asarray(self.reported * np.outer(self.scales, self.scales), dtype=np.float64)

    @property
    def nuisance(self) -> Real:
        """Covariance of common changes."""
        return usual_nuisance(self.components, self.ends, self.together)

    @property
    def whole(self) -> Real:
        """Covariance of a window."""
        return np.asarray(self.covariance + self.nuisance, dtype=np.float64)

    def learnt(self, away: Real, free: FreeDegrees) -> "Scatter":
        """Return the scatter that windows show.

        Parameters
        ----------
        away
            Residuals of a regression, shape (windows, components).
        free
            Degrees of freedom that it left.
        """
        pairs, ends, together = directions(self.components)
        usual = Scatter.usual(self.components, self.reported, with_temperature=self.is_warm)
        variances = np.diag(pairs @ self.reported @ pairs.T)
        squares = np.sum((away @ pairs.T) ** 2, axis=0) / variances
        left = np.array([free.of(row) for row in pairs])
        degrees = float(np.sum(left)) + _REPORTED
        common = (float(np.sum(squares)) + _REPORTED) / degrees
        own = (squares + _OF_PAIRS * common) / (left + _OF_PAIRS) * _widened(left + _OF_PAIRS, degrees)
        scaled = replace(self, scales=np.sqrt(pairs.T**2 @ own), degrees=degrees)
        if not self.is_warm:
            return replace(scaled, ends=scaled._beyond_chance(away, free, ends, usual.ends, _OF_ENDS))
        means = together / together.sum(axis=1, keepdims=True)
        return replace(
            scaled,
            ends=scaled._beyond_chance(away, free, ends, usual.ends, _OF_ENDS),
            together=scaled._beyond_chance(away, free, means, usual.together, _OF_ALL),
        )

    def _beyond_chance(
        self, away: Real, free: FreeDegrees, rows: Real, usual: dict[str, float], weight: float
    ) -> dict[str, float]:
        """Return the standard deviation of each kind along directions: beyond the fits' own, and the usual one.

        The vehicle's own is weighted by its degrees of freedom, the usual one by some windows.
        """
        stds = dict(usual)
        for kind in stds:
            of_kind = rows[[name == kind for name in kinds_of(rows, self.components)]]
            if not len(of_kind):
                continue
            left = float(np.mean([free.of(row) for row in of_kind]))
            own = float(np.mean(np.sum((away @ of_kind.T) ** 2, axis=0))) / left
            chance = float(np.mean(np.diag(of_kind @ self.covariance @ of_kind.T)))
            share = left / (left + weight)
            variance = share * max(0.0, own - chance) + (1 - share) * usual[kind] ** 2
            stds[kind] = float(np.sqrt(variance * _widened(len(of_kind) * (left + weight), self.degrees)))
        return stds


def _widened(own: Real | float, common: float) -> Real:
    """Return the ratio of variances at which the tails of Student's t with few degrees of freedom and many agree."""
    ratio = stats.t.isf(_TAIL, own) / stats.t.isf(_TAIL, common)
    return np.asarray(np.maximum(ratio, 1.0) ** 2, dtype=np.float64)


def regression(
    rows: Real, values: Real, covariance: Real, prior: Real, centre: Real | None = None
) -> tuple[Real, Real]:
    """Return the coefficients of a Bayesian linear regression, shape (rows, components), and their information.

    Parameters
    ----------
    rows
        Explanatory values of each window, shape (windows, coefficients).
    values
        Values of each window, shape (windows, components).
    covariance
        Covariance of a window, shape (components, components).
    prior
        Information about the coefficients before any window, shape (coefficients components, the same).
    centre
        Coefficients before any window, shape (coefficients, components); None: 0.
    """
    inverse = np.linalg.inv(covariance)
    information = np.kron(rows.T @ rows, inverse) + prior
    pulls = (rows.T @ values @ inverse).ravel()
    if centre is not None:
        pulls = pulls + prior @ centre.ravel()
    coefficients = np.linalg.solve(information, pulls).reshape(rows.shape[1], values.shape[1])
    return np.asarray(coefficients, dtype=np.float64), np.asarray(information, dtype=np.float64)
