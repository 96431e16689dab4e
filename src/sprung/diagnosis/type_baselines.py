"""Vehicles of one type: their mean, and their covariance between and within vehicles."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats
from scipy.linalg import block_diag

from sprung._arrays import Real
from sprung._checks import check_each, check_type
from sprung._display import Savable, counted, in_short
from sprung.diagnosis.baseline import (
    CONDITIONS,
    Baseline,
    freeze_shapes,
    medians,
    prior_information,
    ranges,
    slope_covariances,
    units_of,
    vehicle_of,
)
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.scatter import (
    FRONT_REAR_STD,
    ROUNDS,
    FreeDegrees,
    Scatter,
    directions,
    kinds_of,
    regression,
    typical_nuisance,
)
from sprung.errors import DataError
from sprung.vehicles import Component

#: Production scatter: standard deviation of ln(left / right) of healthy parts of each kind; also of an axle, and of all
#: corners, from vehicle to vehicle of a type.
PRODUCTION_SCATTER = {"spring": 0.04, "damper": 0.05, "tyre": 0.03}


@dataclass(frozen=True, slots=True)
class TypeSettings:
    """Settings of the baseline of a type."""

    #: Standard deviation of front against rear and of all of a kind about the vehicle file.
    file_front_rear: float = 0.15
    file_common: float = 0.25
    #: Weight of production scatter in vehicles.
    production: float = 4.0
    #: Largest weight of the scatter of a type's windows, in degrees of freedom.
    max_degrees: float = 48.0
    #: Information about the slopes of a vehicle when those of its type are known, over the typical one.
    slopes: float = 25.0
    #: Clipping of Huber's proposal 2 in standard deviations, and its rounds.
    clip: float = 1.5
    rounds: int = 50


SETTINGS = TypeSettings()

#: Smallest number of vehicles of a type.
MIN_VEHICLES = 4


@dataclass(frozen=True, eq=False, slots=True)
class TypeBaseline(Savable):
    """Normal state of the vehicles of a type.

    Parameters
    ----------
    name
        Name of the type: that of the vehicle file.
    components
        Springs, dampers and tyres.
    mean
        Mean over vehicles of ln(value / nominal value) at the middle of the conditions, shape (components,).
    between
        Covariance of vehicles about that mean, shape (components, components).
    slopes, centre, ranges
        Dependence on conditions, as in `Baseline`.
    scales, front_rear_std, common_std
        Scatter of windows of one vehicle: standard deviations of components over the reported ones, and of front
        against rear and of all components of each kind beyond them.
    has_temperature
        Whether the temperature of all windows was known.
    degrees_of_freedom
        Degrees of freedom of the scatter of windows.
    n_vehicles, n_windows
        Numbers of vehicles and windows that it was learnt from; 0: production scatter only.

    Raises
    ------
    ParameterError
        If an array has another shape, or holds numbers that are not finite.
    """

    name: str
    components: tuple[Component, ...]
    mean: Real
    between: Real
    slopes: Real
    centre: dict[str, float]
    ranges: dict[str, tuple[float, float]]
    scales: Real
    front_rear_std: dict[str, float]
    common_std: dict[str, float]
    has_temperature: bool
    degrees_of_freedom: float
    n_vehicles: int
    n_windows: int

    def __post_init__(self) -> None:
        size = len(self.components)
        shapes = {"mean": (size,), "between": (size, size), "slopes": (size, len(CONDITIONS)), "scales": (size,)}
        freeze_shapes(self, "a type's baseline", **shapes)

    def __repr__(self) -> str:
        """Return the type, and the numbers of vehicles and windows."""
        size = f"{counted(self.n_vehicles, 'vehicle')}, {counted(self.n_windows, 'window')}"
        return in_short(f"TypeBaseline of {self.name!r}: {len(self.components)} components from {size}")

    @property
    def information(self) -> Real:
        """Information about mean and slopes of a vehicle before any window, shape as `Baseline.information`."""
        return self._information(1.0)

    @property
    def single_vehicle_covariance(self) -> Real:
        """Covariance of a further vehicle about the mean, which its vehicles determine up to chance."""
        return self.between * (1 + 1 / self.n_vehicles) if self.n_vehicles else self.between

    def scatter(self, reported: Real, *, with_temperature: bool) -> Scatter:
        """Return the scatter of the windows of a vehicle before any, from the covariance that they report."""
        typical = Scatter.typical(self.components, reported, with_temperature=with_temperature)
        if not self.n_vehicles:
            return typical
        is_learnt = with_temperature and self.has_temperature
        return replace(
            typical,
            scales=self.scales,
            front_rear_std=self.front_rear_std,
            common_std=self.common_std if is_learnt else typical.common_std,
            has_temperature=is_learnt,
            degrees_of_freedom=min(self.degrees_of_freedom, SETTINGS.max_degrees),
        )

    def baseline(self, observations: Sequence[Observation], *, widening: float = 1.0) -> Baseline:
        """Return the baseline of a vehicle of the type before any window of its own.

        Parameters
        ----------
        observations
            Windows to compare, at least one with the type's components.
        widening
            Factor of the standard deviations between vehicles.
        """
        reported = _mean_covariance(observations, self.components)
        scatter = self.scatter(reported, with_temperature=has_temperature(observations))
        return Baseline(
            vehicle=vehicle_of(observations),
            components=self.components,
            mean=self.mean,
            covariance=scatter.covariance,
            reported=reported,
            slopes=self.slopes,
            centre=self.centre,
            ranges=self.ranges,
            nuisance=scatter.nuisance,
            information=self._information(widening),
            degrees_of_freedom=max(scatter.degrees_of_freedom, 2.0 * len(directions(self.components)[0])),
            n_windows=self.n_windows,
            n_refused=0,
            version=0,
            reason=f"{self.n_vehicles} vehicles of the type {self.name}"
            if self.n_vehicles
            else "the vehicle file only",
        )

    def _information(self, widening: float) -> Real:
        """Return `information` for wider deviations between vehicles."""
        of_mean = np.asarray(np.linalg.inv(widening**2 * self.single_vehicle_covariance), dtype=np.float64)
        return prior_information(self.components, of_mean, of_slopes=SETTINGS.slopes if self.n_vehicles else 1.0)


def nominal_type(components: tuple[Component, ...], *, name: str) -> TypeBaseline:
    """Return what is known of a type without any of its vehicles: production scatter of left against right.

    Parameters
    ----------
    components
        Springs, dampers and tyres of the windows to compare.
    name
        Name of the type.

    Examples
    --------
    Before any vehicle, parts are at the values of the file, and left is as right but for production scatter:

    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> of_type = nominal_type(parts, name="zafira")
    >>> of_type.n_vehicles, bool(abs(of_type.mean).max() == 0)
    (0, True)
    """
    kinds = sorted({component.kind for component in components})
    wide = dict.fromkeys(kinds, SETTINGS.file_front_rear), dict.fromkeys(kinds, SETTINGS.file_common)
    usual = Scatter.typical(components, np.eye(len(components)), with_temperature=False)
    return TypeBaseline(
        name=name,
        components=components,
        mean=np.zeros(len(components)),
        between=_between(components, {kind: PRODUCTION_SCATTER.get(kind, 0.05) for kind in kinds}, *wide),
        slopes=np.zeros((len(components), len(CONDITIONS))),
        centre={},
        ranges={},
        scales=usual.scales,
        front_rear_std=usual.front_rear_std,
        common_std=usual.common_std,
        has_temperature=False,
        degrees_of_freedom=usual.degrees_of_freedom,
        n_vehicles=0,
        n_windows=0,
    )


def learn_type(windows: Mapping[str, Iterable[Observation]], *, name: str = "") -> TypeBaseline:
    """Learn the baseline of a type from a few windows each of many of its vehicles, a minority of which may be faulty.

    Parameters
    ----------
    windows
        Windows of each vehicle, by its name.
    name
        Name of the type; empty: the name in the vehicle file of the windows, where it is the same for all.

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
    by Huber's proposal 2, so that a minority of faulty vehicles moves neither; V / n_i is subtracted from the squared
    scale, and production scatter weighs as much as four vehicles.

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
    return Fleet.of(usable).type_of(usable, name=name or (names.pop() if len(names) == 1 else ""))


@dataclass(frozen=True, eq=False, slots=True)
class Fleet:
    """Windows of vehicles: slopes and scatter within them, and the mean of each with its number of windows."""

    components: tuple[Component, ...]
    centre: dict[str, float]
    slopes: Real
    scatter: Scatter
    ranges: dict[str, tuple[float, float]]
    means: dict[str, Real]
    counts: dict[str, int]

    @classmethod
    def of(cls, windows: Mapping[str, Sequence[Observation]]) -> "Fleet":
        """Return the fleet of usable windows, by vehicle."""
        every = [window for of_vehicle in windows.values() for window in of_vehicle]
        components, middle = every[0].components, medians(every)
        reported = _mean_covariance(every, components)
        values = np.array([window.log_ratios for window in every])
        units = np.array([units_of(window, middle) for window in every])
        owner = np.repeat(np.eye(len(windows)), [len(of_vehicle) for of_vehicle in windows.values()], axis=0)
        counts = owner.sum(axis=0)
        inside = np.eye(len(every)) - (owner / counts) @ owner.T
        before = slope_covariances(components)
        prior: Real = np.asarray(block_diag(*map(np.linalg.inv, before)), dtype=np.float64)
        scatter = usual = Scatter.typical(components, reported, with_temperature=has_temperature(every))
        for _ in range(ROUNDS):
            slopes, _ = regression(inside @ units, inside @ values, scatter.whole, prior)
            away = inside @ (values - units @ slopes)
            scatter = usual.learnt(away, FreeDegrees(np.column_stack([owner, units]), scatter.whole, before))
        means = (owner / counts).T @ (values - units @ slopes)
        return cls(
            components,
            middle,
            slopes.T,
            scatter,
            ranges(every),
            dict(zip(windows, means, strict=True)),
            dict(zip(windows, map(int, counts), strict=True)),
        )

    def type_of(self, vehicles: Iterable[str], *, name: str) -> TypeBaseline:
        """Return the baseline of the type from some of the vehicles."""
        chosen = list(vehicles)
        means = np.array([self.means[vehicle] for vehicle in chosen])
        noise = self.scatter.whole * float(np.mean([1 / self.counts[vehicle] for vehicle in chosen]))
        pairs, ends, together = directions(self.components)
        rows = np.vstack([pairs, ends, together / together.sum(axis=1, keepdims=True)])
        groups = np.repeat([0, 1, 2], [len(pairs), len(ends), len(together)])
        locations = [_huber_location(means @ row) for row in rows]
        along = np.array([location for location, _ in locations])
        stds: list[dict[str, float]] = [{}, {}, {}]
        of_rows = list(zip(groups, kinds_of(rows, self.components), rows, locations, strict=True))
        for group, kind in sorted({(int(group), kind) for group, kind, _, _ in of_rows}):
            alike = [(row, scale) for g, k, row, (_, scale) in of_rows if (g, k) == (group, kind)]
            own = float(np.mean([max(0.0, scale**2 - row @ noise @ row) for row, scale in alike]))
            count, known = len(alike) * (len(chosen) - 1), SETTINGS.production
            squares = count * own + known * PRODUCTION_SCATTER.get(kind, 0.05) ** 2
            stds[group][kind] = float(np.sqrt(squares / (count + known)))
        return TypeBaseline(
            name=name,
            components=self.components,
            mean=np.linalg.lstsq(rows, along)[0],
            between=_between(self.components, *stds),
            slopes=self.slopes,
            centre=self.centre,
            ranges=self.ranges,
            scales=self.scatter.scales,
            front_rear_std=self.scatter.front_rear_std,
            common_std=self.scatter.common_std,
            has_temperature=self.scatter.has_temperature,
            degrees_of_freedom=self.scatter.degrees_of_freedom,
            n_vehicles=len(chosen),
            n_windows=sum(self.counts[vehicle] for vehicle in chosen),
        )


def _huber_location(values: Real) -> tuple[float, float]:
    """Return location and scale of values by Huber's proposal 2, both as for normal values."""
    location = float(np.median(values))
    scale = float(stats.median_abs_deviation(values, scale="normal")) or float(np.std(values)) or 1e-12
    density, tail = stats.norm.pdf(SETTINGS.clip), stats.norm.sf(SETTINGS.clip)
    expected = 1 - 2 * tail - 2 * SETTINGS.clip * density + 2 * SETTINGS.clip**2 * tail
    for _ in range(SETTINGS.rounds):
        clipped = np.clip(values, location - SETTINGS.clip * scale, location + SETTINGS.clip * scale)
        scale = float(np.sqrt(np.sum((clipped - location) ** 2) / (len(values) - 1) / expected))
        location = float(np.mean(clipped))
    return location, scale


def _between(
    components: tuple[Component, ...], sides: dict[str, float], ends: dict[str, float], together: dict[str, float]
) -> Real:
    """Return a covariance from the deviations of left against right, front against rear, and all of each kind."""
    pairs, _, _ = directions(components)
    of_pairs = np.array([sides[kind] for kind in kinds_of(pairs, components)]) / 2
    rest = typical_nuisance(components, ends or FRONT_REAR_STD, together)
    return np.asarray((pairs.T * of_pairs**2) @ pairs + rest + 1e-8 * np.eye(len(components)), dtype=np.float64)


def has_temperature(observations: Iterable[Observation]) -> bool:
    """Return whether the temperature of all conclusive windows is known."""
    return all("temperature" in window.conditions for window in observations if window.is_conclusive)


def _mean_covariance(observations: Iterable[Observation], components: tuple[Component, ...]) -> Real:
    alike = [window.covariance for window in observations if window.components == components]
    return np.asarray(np.mean(alike, axis=0), dtype=np.float64)


def usable_windows(windows: Mapping[str, Iterable[Observation]]) -> dict[str, list[Observation]]:
    """Return the windows that can be learnt from, with the commonest components, of vehicles that have any."""
    check_type("windows", windows, Mapping, advice="{'car-1': sprung.observe(recordings, vehicle), ..}")
    every = {vehicle: check_each(f"windows[{vehicle!r}]", own, Observation) for vehicle, own in windows.items()}
    valid = {
        vehicle: [window for window in own if window.is_conclusive and not window.sensor_faults]
        for vehicle, own in every.items()
    }
    kinds = [window.components for own in valid.values() for window in own]
    common = max(kinds, key=kinds.count, default=())
    alike = {vehicle: [window for window in own if window.components == common] for vehicle, own in valid.items()}
    return {vehicle: own for vehicle, own in alike.items() if own}
