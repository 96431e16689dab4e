"""Scatter of windows about their mean: as they report it, as they show it, and common changes of a kind."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache

import numpy as np
from scipy.special import gammaln, stdtrit

from sprung._arrays import Real
from sprung._checks import frozen_array
from sprung.diagnosis.hypotheses import typical_directions
from sprung.vehicles import Component
from sprung.vehicles.structure import DAMPERS

#: Kinds of parts by what they are of: steel, rubber of mounts and axle guides, and oil.
STEEL = ("secondary_spring", "lateral_spring")
RUBBER = ("spring", "primary_spring", "primary_longitudinal_spring", "primary_lateral_spring")
OIL = (*DAMPERS, "lateral_damper", "yaw_damper")
#: Common change of all components of a kind from window to window (payload, temperature, road), ln values, where the
#: temperature is unknown. Steel changes by 1 % over 40 K, and the load of secondary springs is fitted.
COMMON = {"tyre": 0.06, "anti_roll": 0.08, "conicity": 0.1, **dict.fromkeys(OIL, 0.25)}
COMMON |= dict.fromkeys(RUBBER, 0.08) | dict.fromkeys(STEEL, 0.02)
#: The part of it that is left where the temperature is known.
COMMON_AT_A_TEMPERATURE = COMMON | {"tyre": 0.03, **dict.fromkeys(OIL, 0.06)}
COMMON_AT_A_TEMPERATURE |= dict.fromkeys((*RUBBER, "anti_roll"), 0.04)
#: Common change of front against rear, ln values.
FRONT_REAR_STD = {"tyre": 0.005, **dict.fromkeys((*STEEL, *RUBBER, "anti_roll"), 0.008), **dict.fromkeys(OIL, 0.012)}


def shared_covariance(
    components: tuple[Component, ...],
    front_rear: Mapping[str, float],
    common: Mapping[str, float] = COMMON,
    *,
    left_right: Mapping[str, float] | None = None,
) -> Real:
    """Return the covariance of what components of a kind share, from window to window or from vehicle to vehicle.

    Parameters
    ----------
    components
        Springs, dampers and tyres.
    front_rear
        Standard deviation between front and rear of each kind, ln values.
    common
        Standard deviation of all components of each kind together, ln values.
    left_right
        Standard deviation of ln(left / right) of each kind; None: 0.

    Returns
    -------
    numpy.ndarray
        Covariance, shape (components, components): all components of a kind by the same factor, the axles against each
        other, and left against right.
    """
    pairs, ends, together = directions(components)
    of_ends = np.array([front_rear.get(kind, max(front_rear.values())) for kind in kinds_of(ends, components)])
    of_all = np.array([common.get(kind, 0.2) for kind in kinds_of(together, components)])
    covariance = (ends.T * of_ends**2) @ ends + (together.T * of_all**2) @ together
    if left_right is not None:
        of_pairs = np.array([left_right[kind] for kind in kinds_of(pairs, components)]) / 2
        covariance = covariance + (pairs.T * of_pairs**2) @ pairs
    return np.asarray(covariance, dtype=np.float64)


@lru_cache(maxsize=64)
def directions(components: tuple[Component, ...]) -> tuple[Real, Real, Real]:
    """Return directions as rows, each of shape (rows, components).

    Parameters
    ----------
    components
        Springs, dampers and tyres of corners.

    Returns
    -------
    tuple
        Left against right for each axle and kind, and each component without a side by itself; each axle against the
        next one; all components of a kind together.
    """
    kinds = sorted({component.kind for component in components})
    left = np.array([-1.0 if component.side == "right" else 1.0 for component in components])
    pairs, ends, together = [], [], []
    for kind in kinds:
        axles = sorted({component.axle for component in components if component.kind == kind})
        of_axle = [np.array([float((c.axle, c.kind) == (axle, kind)) for c in components]) for axle in axles]
        pairs += [row * left for row in of_axle]
        ends += [of_axle[k] / 2 - of_axle[k + 1] / 2 for k in range(len(axles) - 1)]
        together.append(np.sum(of_axle, axis=0))
    size = len(components)
    first, second, third = (
        frozen_array("rows", np.array(rows).reshape(-1, size), ndim=2) for rows in (pairs, ends, together)
    )
    return first, second, third


def kinds_of(rows: Real, components: tuple[Component, ...]) -> list[str]:
    """Return the kind of components that each direction moves, of rows from `directions`."""
    return [components[int(np.flatnonzero(row)[0])].kind for row in rows]


#: Rounds of regression and scatter, which need each other.
ROUNDS = 3


@dataclass(frozen=True, slots=True)
class ScatterWeights:
    """Weights of what is known before any window."""

    #: Scatter that windows report, in degrees of freedom of all pairs.
    reported: float = 1.0
    #: Scatter of all pairs for one of them, in windows.
    pairs: float = 4.0
    #: Typical scatter of front against rear, in windows.
    front_rear: float = 8.0
    #: Typical scatter of all of a kind together, in windows.
    common: float = 4.0
    #: Probability at which a variance with few degrees of freedom is widened to the quantile of the common one.
    tail: float = 1e-5


WEIGHTS = ScatterWeights()


@dataclass(frozen=True, slots=True)
class LastingSettings:
    """What is known before any window of the scatter of parts and of the correlation of consecutive windows."""

    #: Degrees of freedom of the variance of a coordinate about that of all, where parts scatter unequally: ln of a
    #: standard deviation scatters by 0.32 from one to the other.
    spread: float = 6.0
    #: The same where they scatter alike.
    same: float = 400.0
    #: Correlations that are weighed against each other.
    correlations: tuple[float, ...] = (0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7)
    #: Probability that parts scatter alike, and that consecutive windows are independent; the other correlations are
    #: equally probable.
    alike: float = 0.7
    independent: float = 0.7
    #: Ratio of probability after to before any window below which one of these counts for less against a change: a
    #: ninth. All ratios are less by a tenth in return.
    caution: float = 9.0
    #: Least that each of these counts for against a change: a vehicle may be unlike the others of its type.
    rare: float = 1e-3

    @property
    def prior(self) -> Real:
        """Probability of parts that scatter alike or unequally, and of each of `correlations`, shape (2, 8)."""
        others = len(self.correlations) - 1
        serial = [self.independent, *[(1 - self.independent) / others] * others]
        return np.outer([self.alike, 1 - self.alike], serial)


LASTING = LastingSettings()


@dataclass(frozen=True, eq=False, slots=True)
class Deviations:
    """Deviations of windows from a regression on conditions, and the degrees of freedom that it leaves to them.

    Parameters
    ----------
    values
        Deviation of each window, ln values, shape (windows, components).
    rows
        Explanatory values of each window, shape (windows, coefficients): 1 for its vehicle, and last the conditions.
    covariance
        Covariance of a window, shape (components, components).
    slope_covariances
        Covariance of the slopes with each condition before any window.
    """

    values: Real
    rows: Real
    covariance: Real
    slope_covariances: Sequence[Real]

    def degrees(self, direction: Real) -> float:
        """Return the degrees of freedom of a direction, shape (components,); at least 1.

        Notes
        -----
        n - tr[(X^T X + L)^-1 X^T X], with L the variance of a window over that of each slope before any window.
        """
        variance = direction @ self.covariance @ direction
        ridge = [variance / (direction @ slopes @ direction) for slopes in self.slope_covariances]
        squares = self.rows.T @ self.rows
        free = np.zeros(len(squares) - len(ridge))
        used = np.trace(np.linalg.solve(squares + np.diag([*free, *ridge]), squares))
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
    front_rear_std, common_std
        Standard deviation of front against rear and of all components of each kind, beyond what the fits explain.
    has_temperature
        Whether the temperature of every window is known, so that common changes can be learnt.
    degrees_of_freedom
        Degrees of freedom of all pairs together; as the start of an estimate, their weight in it.
    """

    components: tuple[Component, ...]
    reported: Real
    scales: Real
    front_rear_std: dict[str, float]
    common_std: dict[str, float]
    has_temperature: bool
    degrees_of_freedom: float = WEIGHTS.reported

    @classmethod
    def typical(cls, components: tuple[Component, ...], reported: Real, *, with_temperature: bool) -> "Scatter":
        """Return the scatter as windows report it, with the usual common changes."""
        kinds = {component.kind for component in components}
        common = COMMON_AT_A_TEMPERATURE if with_temperature else COMMON
        ends = {kind: FRONT_REAR_STD.get(kind, 0.02) for kind in kinds}
        together = {kind: common.get(kind, 0.2) for kind in kinds}
        return cls(components, reported, np.ones(len(components)), ends, together, with_temperature)

    @property
    def covariance(self) -> Real:
        """Covariance of a window without common changes."""
        return np.asarray(self.reported * np.outer(self.scales, self.scales), dtype=np.float64)

    @property
    def nuisance(self) -> Real:
        """Covariance of common changes."""
        return shared_covariance(self.components, self.front_rear_std, self.common_std)

    @property
    def whole(self) -> Real:
        """Covariance of a window."""
        return np.asarray(self.covariance + self.nuisance, dtype=np.float64)

    def learnt(self, deviations: Deviations, *, is_widened: bool = False) -> "Scatter":
        """Return the scatter that windows show, shrunk to this one.

        Parameters
        ----------
        deviations
            Deviations of the windows from a regression.
        is_widened
            Whether variances with few degrees of freedom are widened to what their Student's t implies.
        """
        pairs, ends, together = directions(self.components)
        squares = np.sum((deviations.values @ pairs.T) ** 2, axis=0) / np.diag(pairs @ self.covariance @ pairs.T)
        left = np.array([deviations.degrees(row) for row in pairs])
        degrees = float(np.sum(left)) + self.degrees_of_freedom
        common = (float(np.sum(squares)) + self.degrees_of_freedom) / degrees
        weight = WEIGHTS.pairs + self.degrees_of_freedom / max(len(pairs), 1)
        own = (squares + weight * common) / (left + weight)
        if is_widened:
            own = own * _widening(left + weight, degrees)
        scaled = replace(self, scales=self.scales * np.sqrt(pairs.T**2 @ own), degrees_of_freedom=degrees)
        ends_std = scaled._beyond_chance(
            deviations, scaled._as_known(ends, ends), self.front_rear_std, WEIGHTS.front_rear, is_widened
        )
        scaled = replace(scaled, front_rear_std=ends_std)
        usual = {kind: std for kind, std in self.common_std.items() if self.has_temperature or kind in STEEL}
        means = scaled._as_known(together, together / together.sum(axis=1, keepdims=True))
        common_std = scaled._beyond_chance(deviations, means, usual, WEIGHTS.common, is_widened)
        return replace(scaled, common_std=self.common_std | common_std)

    def _as_known(self, directions: Real, plain: Real) -> Real:
        """Return rows by which deviations give sizes along directions: generalised least squares on bogies.

        Two sensors hardly see the far bogie of a rail vehicle, and plain means would be its errors.
        """
        weighted = directions @ np.linalg.inv(self.whole)
        weighted /= np.sum(weighted * directions, axis=1, keepdims=True)
        kinds = kinds_of(directions, self.components)
        is_staged = [kind.startswith(("primary_", "secondary_", "lateral_", "yaw_")) for kind in kinds]
        return np.where(np.array(is_staged, dtype=np.bool_)[:, None], weighted, plain)

    def _beyond_chance(
        self, deviations: Deviations, rows: Real, usual: dict[str, float], weight: float, is_widened: bool
    ) -> dict[str, float]:
        """Return the standard deviation of each kind along directions: beyond the fits' own, and the usual one.

        The vehicle's own is weighted by its degrees of freedom, the usual one by some windows.
        """
        stds = dict(usual)
        for kind in stds:
            of_kind = rows[[name == kind for name in kinds_of(rows, self.components)]]
            if not len(of_kind):
                continue
            left = float(np.mean([deviations.degrees(row) for row in of_kind]))
            own = float(np.mean(np.sum((deviations.values @ of_kind.T) ** 2, axis=0))) / left
            chance = float(np.mean(np.diag(of_kind @ self.covariance @ of_kind.T)))
            share = left / (left + weight)
            variance = share * max(0.0, own - chance) + (1 - share) * usual[kind] ** 2
            widening = float(_widening(len(of_kind) * (left + weight), self.degrees_of_freedom)) if is_widened else 1.0
            stds[kind] = float(np.sqrt(variance * widening))
        return stds


@lru_cache(maxsize=64)
def independent_directions(components: tuple[Component, ...]) -> tuple[Real, int]:
    """Return `directions` of length 1 that are linearly independent, and how many come before all of a kind together.

    The rows have the shape (components, components): left against right first, then front against rear.
    """
    pairs, ends, together = directions(components)
    kept: list[Real] = []
    n_before = len(components)
    for number, row in enumerate(np.vstack([pairs, ends, together, np.eye(len(components))])):
        if number == len(pairs) + len(ends):
            n_before = len(kept)
        if np.linalg.matrix_rank(np.array([*kept, row])) > len(kept):
            kept.append(row / np.linalg.norm(row))
    return frozen_array("rows", np.array(kept), ndim=2), n_before


def coordinates(components: tuple[Component, ...], covariance: Real) -> Real:
    """Return coordinates of deviations that have the variance 1, as rows, shape (components + hypotheses, components).

    Parameters
    ----------
    components
        Springs, dampers and tyres of corners.
    covariance
        Covariance of the deviations, shape (components, components).

    Returns
    -------
    numpy.ndarray
        First uncorrelated ones: each of the independent directions, less what those before predict of it, left against
        right of each axle and kind first. Then for each of `typical_directions` the estimate of such a change alone.
    """
    rows, _ = independent_directions(components)
    T = np.linalg.solve(np.linalg.cholesky(rows @ covariance @ rows.T), rows)
    moved = typical_directions(components) @ T.T
    return np.vstack([T, moved / np.linalg.norm(moved, axis=1, keepdims=True) @ T])


def own_scatter(deviations: Deviations, rows: Real, n_pairs: int) -> tuple[Real, Real, Real]:
    """Return what windows say of the scatter of each coordinate and of the correlation of consecutive ones.

    Parameters
    ----------
    deviations
        Values of windows in the order of time, less those of slopes that were known before any window.
    rows
        Coordinates, from `coordinates`, shape (rows, components).
    n_pairs
        Number of the first coordinates that are left against right, which alone state the correlation and the common
        scale: common changes are not learnt without a temperature.

    Returns
    -------
    tuple
        Probabilities of parts that scatter alike or unequally and of `LASTING.correlations`, shape (2, 8); sums of
        squares of the windows whitened by each correlation, shape (8, rows); their degrees of freedom, shape (rows,).

    Notes
    -----
    With windows whitened by rho, x_w - rho x_(w - 1), over (1 - rho^2)^(1/2) after the first, the rest S_k of the
    regression of coordinate k, with what is known of its slopes, has m = n - 1 degrees of freedom. Its variance is
    drawn about a common one c, an inverse gamma variable with f degrees of freedom: the marginal likelihood is the
    integral over ln c of the product over left against right of (1 - rho^2)^(-m / 2) |J_k|^(-1/2) Gamma((f + m) / 2) /
    Gamma(f / 2) (f c)^(f / 2) (f c + S_k)^(-(f + m) / 2).
    """
    slopes = np.array([np.einsum("ki,ij,kj->k", rows, each, rows) for each in deviations.slope_covariances])
    known = np.zeros((len(rows), *2 * (deviations.rows.shape[1],)))
    at = np.arange(known.shape[-1] - len(slopes), known.shape[-1])
    known[:, at, at] = 1 / slopes.T
    m, logs, squares = len(deviations.rows) - 1, [], []
    f = np.array([LASTING.same, LASTING.spread])[:, None, None]
    # Nodes of ln c about that of all, in its standard deviation: steps of a half, as long for each rho.
    nodes = np.sqrt((2 / max(m, 1) + 2 / f) / n_pairs) * np.arange(-6, 6.5, 0.5)[:, None]
    for correlation in LASTING.correlations:
        X, y = whitened(deviations.rows, correlation), whitened(deviations.values, correlation) @ rows.T
        J, pulled = X.T @ X + known, (X.T @ y).T
        rest = np.sum(y**2, axis=0) - np.sum(pulled * np.linalg.solve(J, pulled[..., None])[..., 0], axis=-1)
        squares.append(rest)
        volume = np.sum(np.linalg.slogdet(J[:n_pairs])[1]) + n_pairs * m * np.log1p(-(correlation**2))
        common = (np.sum(rest[:n_pairs]) + WEIGHTS.reported) / (n_pairs * m + WEIGHTS.reported)
        scaled = f * common * np.exp(nodes)
        each = gammaln((f + m) / 2) - gammaln(f / 2) + f / 2 * np.log(scaled)
        each = np.sum(each - (f + m) / 2 * np.log(scaled + rest[:n_pairs]), axis=-1)
        logs.append(np.logaddexp.reduce(each, axis=1) + np.log(np.ptp(nodes, axis=1)[:, 0]) - volume / 2)
    likelihoods = np.array(logs).T
    weights = LASTING.prior * np.exp(likelihoods - likelihoods.max())
    return weights / np.sum(weights), np.array(squares), np.full(len(rows), float(m))


def pooled(weights: Iterable[Real]) -> Real:
    """Return the probabilities of `own_scatter` by the windows of vehicles that are alike in both, shape (2, 8).

    Parameters
    ----------
    weights
        Probabilities by the windows of each vehicle alone.
    """
    logs = np.log(LASTING.prior)
    logs = logs + np.sum([np.log(np.maximum(own, np.finfo(float).tiny)) - logs for own in weights], axis=0)
    return np.asarray(np.exp(logs - np.logaddexp.reduce(logs, axis=None)), dtype=np.float64)


def whitened(rows: Real, correlation: float) -> Real:
    """Return the innovations of rows of which consecutive ones are correlated, over their standard deviation."""
    steps = (rows[1:] - correlation * rows[:-1]) / np.sqrt(1 - correlation**2)
    return np.concatenate([rows[:1], steps])


def _widening(own: Real | float, common: float) -> Real:
    """Return the ratio of variances at which the tails of Student's t with few degrees of freedom and many agree."""
    ratio = stdtrit(own, WEIGHTS.tail) / stdtrit(common, WEIGHTS.tail)
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
