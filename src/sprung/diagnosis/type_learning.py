"""Learning of the baseline of a type from a few windows each of many vehicles."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.linalg import block_diag
from scipy.special import ndtr, ndtri

from sprung._arrays import Booleans, Real
from sprung._checks import check_each, check_type
from sprung.diagnosis.baseline import medians, model_error_of, ranges, slope_covariances, units_of
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.scatter import ROUNDS, Deviations, Scatter, directions, kinds_of, regression
from sprung.diagnosis.type_baselines import (
    MIN_VEHICLES,
    OTHER_SCATTER,
    PRODUCTION_SCATTER,
    TYPES,
    TypeBaseline,
    between_vehicles,
    has_temperature,
    nominal_type,
)
from sprung.errors import DataError


def learn_type(
    windows: Mapping[str, Iterable[Observation]], *, name: str = "", healthy: Collection[str] = ()
) -> TypeBaseline:
    """Learn the baseline of a type from a few windows each of many of its vehicles, a minority of which may be faulty.

    Parameters
    ----------
    windows
        Windows of each vehicle, by its name.
    name
        Name of the type; empty: the name in the vehicle file of the windows, where it is the same for all.
    healthy
        Vehicles that were inspected and found healthy: however far they are from the others, they belong to the type.

    Returns
    -------
    TypeBaseline
        Mean of the vehicles, and the covariance between and within them.

    Raises
    ------
    DataError
        If fewer than four vehicles have usable windows.

    Notes
    -----
    y_iw = m + d_i + B u_iw + e_iw for window w of vehicle i, with d_i ~ N(0, D) between vehicles and e_iw ~ N(0, V)
    within one. B and V are those of a regression within vehicles, as in `learn`. The means of vehicles along left
    against right, front against rear and all of a kind together, independent of each other, have a location and a scale
    by Huber's proposal 2, so that a minority of faulty vehicles moves neither; vehicles known to be healthy are not
    clipped. V / n_i is subtracted from the squared scale, and production scatter weighs as much as four vehicles.

    References
    ----------
    N. M. Laird, J. H. Ware, Random-effects models for longitudinal data, Biometrics 38 (1982) 963-974.
    P. J. Huber, Robust estimation of a location parameter, Annals of Mathematical Statistics 35 (1964) 73-101
    (proposal 2).

    Examples
    --------
    One of eight vehicles has a spring that has lost 30 % of its stiffness, which hardly moves the mean of the type:

    >>> import numpy as np
    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((8, 3, 12))
    >>> values[2, :, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> fleet = {
    ...     f"car-{n}": [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(of_car)]
    ...     for n, of_car in enumerate(values)
    ... }
    >>> of_type = learn_type(fleet, name="zafira")
    >>> of_type.n_vehicles, bool(abs(of_type.mean[0]) < 0.02)
    (8, True)
    """
    usable = usable_windows(windows)
    if len(usable) < MIN_VEHICLES:
        raise DataError(
            f"{len(usable)} vehicles have usable windows, and {MIN_VEHICLES} are needed: give more vehicles"
        )
    names = {window.vehicle for own in usable.values() for window in own}
    return Fleet.of(usable).type_of(usable, name=name or (names.pop() if len(names) == 1 else ""), healthy=healthy)


@dataclass(frozen=True, eq=False, slots=True)
class Fleet:
    """Windows of vehicles: slopes and scatter within them, and the mean of each with its number of windows.

    Parameters
    ----------
    within
        Baseline of a type with what was learnt within the vehicles, and production scatter between them.
    covariance
        Covariance of a window about the mean of its vehicle, shape (components, components).
    means
        Mean of each vehicle at the middle of the conditions, by its name, shape (components,).
    counts
        Number of windows of each vehicle.
    """

    within: TypeBaseline
    covariance: Real
    means: dict[str, Real]
    counts: dict[str, int]

    @classmethod
    def of(cls, windows: Mapping[str, Sequence[Observation]]) -> "Fleet":
        """Return the fleet of usable windows, by vehicle."""
        every = [window for of_vehicle in windows.values() for window in of_vehicle]
        components, centre = every[0].components, medians(every)
        reported = np.asarray(np.mean([window.covariance for window in every], axis=0), dtype=np.float64)
        values = np.array([window.log_ratios for window in every])
        units = np.array([units_of(window.conditions, centre) for window in every])
        owner = np.repeat(np.eye(len(windows)), [len(of_vehicle) for of_vehicle in windows.values()], axis=0)
        counts = owner.sum(axis=0)
        inside = np.eye(len(every)) - (owner / counts) @ owner.T
        error = model_error_of(every)
        before = slope_covariances(components, error)
        prior: Real = np.asarray(block_diag(*map(np.linalg.inv, before)), dtype=np.float64)
        scatter = usual = Scatter.typical(components, reported, with_temperature=has_temperature(every))
        for _ in range(ROUNDS):
            slopes, _ = regression(inside @ units, inside @ values, scatter.whole, prior)
            away = inside @ (values - units @ slopes)
            scatter = usual.learnt(Deviations(away, np.column_stack([owner, units]), scatter.whole, before))
        within = replace(
            nominal_type(components, name=""),
            slopes=slopes.T,
            centre=centre,
            ranges=ranges(every),
            scales=scatter.scales,
            front_rear_std=scatter.front_rear_std,
            common_std=scatter.common_std,
            has_temperature=scatter.has_temperature,
            degrees_of_freedom=scatter.degrees_of_freedom,
            model_error=error,
        )
        means = dict(zip(windows, (owner / counts).T @ (values - units @ slopes), strict=True))
        return cls(within, scatter.whole, means, {vehicle: len(own) for vehicle, own in windows.items()})

    def type_of(self, vehicles: Iterable[str], *, name: str, healthy: Collection[str] = ()) -> TypeBaseline:
        """Return the baseline of the type from some of the vehicles, of which some are known to be healthy."""
        chosen, components = list(vehicles), self.within.components
        known = np.array([vehicle in healthy for vehicle in chosen])
        means = np.array([self.means[vehicle] for vehicle in chosen])
        noise = self.covariance * float(np.mean([1 / self.counts[vehicle] for vehicle in chosen]))
        pairs, ends, together = directions(components)
        rows = (pairs, ends, together / together.sum(axis=1, keepdims=True))
        located = [[_huber_location(means @ row, known) for row in group] for group in rows]
        along = np.array([location for group in located for location, _ in group])
        left_right, front_rear, common = (
            _shrunk_stds(group, [scale for _, scale in scales], kinds_of(group, components), noise, len(chosen))
            for group, scales in zip(rows, located, strict=True)
        )
        return replace(
            self.within,
            name=name,
            mean=np.linalg.lstsq(np.vstack(rows), along)[0],
            between=between_vehicles(components, left_right=left_right, front_rear=front_rear, common=common),
            n_vehicles=len(chosen),
            n_windows=sum(self.counts[vehicle] for vehicle in chosen),
        )


def _shrunk_stds(
    rows: Real, scales: Sequence[float], kinds: Sequence[str], noise: Real, n_vehicles: int
) -> dict[str, float]:
    """Return the standard deviation of vehicles along rows by kind, without noise, shrunk to production scatter."""
    variances = np.array([max(0.0, scale**2 - row @ noise @ row) for row, scale in zip(rows, scales, strict=True)])
    stds = {}
    for kind in dict.fromkeys(kinds):
        own = variances[[name == kind for name in kinds]]
        count, known = own.size * (n_vehicles - 1), TYPES.production
        squares = count * float(np.mean(own)) + known * PRODUCTION_SCATTER.get(kind, OTHER_SCATTER) ** 2
        stds[kind] = float(np.sqrt(squares / (count + known)))
    return stds


def _huber_location(values: Real, known: Booleans) -> tuple[float, float]:
    """Return location and scale of values by Huber's proposal 2, both as for normal values; known ones are whole."""
    location = float(np.median(values))
    scale = float(np.median(np.abs(values - location)) / ndtri(0.75)) or float(np.std(values)) or 1e-12
    clip = TYPES.clip
    density, tail = np.exp(-(clip**2) / 2) / np.sqrt(2 * np.pi), ndtr(-clip)
    expected = 1 - 2 * tail - 2 * clip * density + 2 * clip**2 * tail
    share = float(np.mean(np.where(known, 1.0, expected)))
    for _ in range(TYPES.rounds):
        clipped = np.where(known, values, np.clip(values, location - clip * scale, location + clip * scale))
        scale = float(np.sqrt(np.sum((clipped - location) ** 2) / (len(values) - 1) / share))
        location = float(np.mean(clipped))
    return location, scale


def usable_windows(windows: Mapping[str, Iterable[Observation]]) -> dict[str, list[Observation]]:
    """Return the windows that can be learnt from, with the commonest components, of vehicles that have any."""
    check_type("windows", windows, Mapping, advice="{'car-1': sprung.observe(recordings, vehicle), ..}")
    every = {vehicle: check_each(f"windows[{vehicle!r}]", own, Observation) for vehicle, own in windows.items()}
    valid = {vehicle: [window for window in own if window.is_valid] for vehicle, own in every.items()}
    kinds = [window.components for own in valid.values() for window in own]
    common = max(dict.fromkeys(kinds), key=kinds.count, default=())
    alike = {vehicle: [window for window in own if window.components == common] for vehicle, own in valid.items()}
    return {vehicle: own for vehicle, own in alike.items() if own}
