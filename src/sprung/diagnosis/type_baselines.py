"""Vehicles of one type: their mean, their covariance between and within vehicles, and one vehicle against them."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats
from scipy.linalg import block_diag

from sprung._arrays import Indices, Real
from sprung._checks import check_each, check_number, check_type, frozen_array
from sprung._display import Savable, counted, in_short
from sprung.diagnosis.baseline import (
    CONDITIONS,
    Baseline,
    medians,
    prior_information,
    ranges,
    slope_covariances,
    units_of,
    vehicle_of,
)
from sprung.diagnosis.changes import INTERVAL_95, Candidate, ChangeDetector, Detection, Size, false_discoveries
from sprung.diagnosis.detectability import POWER, losses
from sprung.diagnosis.directions import USUAL_ENDS, directions, kinds_of, usual_nuisance
from sprung.diagnosis.hypotheses import Hypothesis, hypotheses_of, log_prior
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.scatter import ROUNDS, FreeDegrees, Scatter, regression
from sprung.errors import DataError, ParameterError
from sprung.vehicles import Component

#: Makers' scatter: standard deviation of ln(left / right) of sound parts of each kind; also of an axle, and of all
#: corners, from vehicle to vehicle of a type.
MAKERS = {"spring": 0.04, "damper": 0.05, "tyre": 0.03}
#: Standard deviation of front against rear and of all of a kind about the vehicle file.
_FILE_ENDS, _FILE_ALL = 0.15, 0.25
#: Smallest number of vehicles of a type.
LEAST_VEHICLES = 4
#: Weight of makers' scatter in vehicles; largest weight of the scatter of a type's windows, in degrees of freedom.
_OF_MAKERS, _OF_TYPE = 4.0, 48.0
#: Information about the slopes of a vehicle when those of its type are known, over the usual one.
_OF_SLOPES = 25.0
#: Clipping of Huber's proposal 2 in standard deviations, and its rounds.
_CLIP, _CLIP_ROUNDS = 1.5, 50
#: Size that comparisons are most powerful for, ln values; share of losses among changes, and of unmodelled deviations
#: in the probability of a false alarm; correlation above which two hypotheses are the same test.
_SIZE, _LOSSES, _UNMODELLED, _SAME = float(-np.log(0.8)), 0.9, 0.05, 0.9
#: Largest loss that is sought as the smallest detectable one [ln], and number of times that its range is halved.
_LARGEST, _HALVINGS = 3.0, 10
#: Widening of the deviations between vehicles where changes are sought between the windows of one vehicle.
_WIDE = 3.0


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
    slopes, middle, ranges
        Dependence on conditions, as in `Baseline`.
    scales, ends, together
        Scatter of windows of one vehicle: standard deviations of components over the reported ones, and of front
        against rear and of all components of each kind beyond them.
    is_warm
        Whether the temperature of all windows was known.
    degrees
        Degrees of freedom of the scatter of windows.
    n_vehicles, n_windows
        Numbers of vehicles and windows that it was learnt from; 0: makers' scatter only.

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
    middle: dict[str, float]
    ranges: dict[str, tuple[float, float]]
    scales: Real
    ends: dict[str, float]
    together: dict[str, float]
    is_warm: bool
    degrees: float
    n_vehicles: int
    n_windows: int

    def __post_init__(self) -> None:
        size = len(self.components)
        shapes = {"mean": (size,), "between": (size, size), "slopes": (size, len(CONDITIONS)), "scales": (size,)}
        for name, shape in shapes.items():
            values = frozen_array(name, getattr(self, name), ndim=len(shape))
            if values.shape != shape or not np.all(np.isfinite(values)):
                raise ParameterError(f"{name} of a type's baseline must be {shape} finite numbers: learn it again")
            object.__setattr__(self, name, values)

    def __repr__(self) -> str:
        """Return the type, and the numbers of vehicles and windows."""
        size = f"{counted(self.n_vehicles, 'vehicle')}, {counted(self.n_windows, 'window')}"
        return in_short(f"TypeBaseline of {self.name!r}: {len(self.components)} components from {size}")

    @property
    def information(self) -> Real:
        """Information about mean and slopes of a vehicle before any window, shape as `Baseline.information`."""
        return self._information(1.0)

    @property
    def of_a_vehicle(self) -> Real:
        """Covariance of a further vehicle about the mean, which its vehicles determine up to chance."""
        return self.between * (1 + 1 / self.n_vehicles) if self.n_vehicles else self.between

    def scatter(self, reported: Real, *, with_temperature: bool) -> Scatter:
        """Return the scatter of the windows of a vehicle before any, from the covariance that they report."""
        usual = Scatter.usual(self.components, reported, with_temperature=with_temperature)
        if not self.n_vehicles:
            return usual
        together = self.together if with_temperature and self.is_warm else usual.together
        is_warm, degrees = with_temperature and self.is_warm, min(self.degrees, _OF_TYPE)
        return Scatter(self.components, reported, self.scales, self.ends, together, is_warm, degrees)

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
        scatter = self.scatter(reported, with_temperature=_is_warm(observations))
        return Baseline(
            vehicle=vehicle_of(observations),
            components=self.components,
            mean=self.mean,
            covariance=scatter.covariance,
            reported=reported,
            slopes=self.slopes,
            middle=self.middle,
            ranges=self.ranges,
            nuisance=scatter.nuisance,
            information=self._information(widening),
            degrees=max(scatter.degrees, 2.0 * len(directions(self.components)[0])),
            n_windows=self.n_windows,
            n_refused=0,
            version=0,
            reason=f"{self.n_vehicles} vehicles of the type {self.name}"
            if self.n_vehicles
            else "the vehicle file only",
        )

    def _information(self, widening: float) -> Real:
        """Return `information` for wider deviations between vehicles."""
        of_mean = _inverse(widening**2 * self.of_a_vehicle)
        return prior_information(self.components, of_mean, of_slopes=_OF_SLOPES if self.n_vehicles else 1.0)


def nominal_type(components: tuple[Component, ...], *, name: str) -> TypeBaseline:
    """Return what is known of a type without any of its vehicles: makers' scatter of left against right.

    Parameters
    ----------
    components
        Springs, dampers and tyres of the windows to compare.
    name
        Name of the type.

    Examples
    --------
    Before any vehicle, parts are at the values of the file, and left is as right but for makers' scatter:

    >>> import sprung
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> of_type = nominal_type(parts, name="zafira")
    >>> of_type.n_vehicles, bool(abs(of_type.mean).max() == 0)
    (0, True)
    """
    kinds = sorted({component.kind for component in components})
    wide = dict.fromkeys(kinds, _FILE_ENDS), dict.fromkeys(kinds, _FILE_ALL)
    usual = Scatter.usual(components, np.eye(len(components)), with_temperature=False)
    return TypeBaseline(
        name=name,
        components=components,
        mean=np.zeros(len(components)),
        between=_between(components, {kind: _makers(kind) for kind in kinds}, *wide),
        slopes=np.zeros((len(components), len(CONDITIONS))),
        middle={},
        ranges={},
        scales=usual.scales,
        ends=usual.ends,
        together=usual.together,
        is_warm=False,
        degrees=usual.degrees,
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
    scale, and makers' scatter weighs as much as four vehicles.

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
    usable = _usable(windows)
    if len(usable) < LEAST_VEHICLES:
        raise DataError(
            f"{len(usable)} vehicles have usable windows, and {LEAST_VEHICLES} are needed: give more vehicles"
        )
    names = {window.vehicle for own in usable.values() for window in own}
    return _Fleet.of(usable).type_of(usable, name=name or (names.pop() if len(names) == 1 else ""))


@dataclass(frozen=True, eq=False, slots=True)
class _Fleet:
    """Windows of vehicles: slopes and scatter within them, and the mean of each with its number of windows."""

    components: tuple[Component, ...]
    middle: dict[str, float]
    slopes: Real
    scatter: Scatter
    ranges: dict[str, tuple[float, float]]
    means: dict[str, Real]
    counts: dict[str, int]

    @classmethod
    def of(cls, windows: Mapping[str, Sequence[Observation]]) -> "_Fleet":
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
        scatter = usual = Scatter.usual(components, reported, with_temperature=_is_warm(every))
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
        located = [_located(means @ row) for row in rows]
        along = np.array([location for location, _ in located])
        stds: list[dict[str, float]] = [{}, {}, {}]
        of_rows = list(zip(groups, kinds_of(rows, self.components), rows, located, strict=True))
        for group, kind in sorted({(int(group), kind) for group, kind, _, _ in of_rows}):
            alike = [(row, scale) for g, k, row, (_, scale) in of_rows if (g, k) == (group, kind)]
            own = float(np.mean([max(0.0, scale**2 - row @ noise @ row) for row, scale in alike]))
            count = len(alike) * (len(chosen) - 1)
            stds[group][kind] = float(np.sqrt((count * own + _OF_MAKERS * _makers(kind) ** 2) / (count + _OF_MAKERS)))
        return TypeBaseline(
            name=name,
            components=self.components,
            mean=np.linalg.lstsq(rows, along)[0],
            between=_between(self.components, *stds),
            slopes=self.slopes,
            middle=self.middle,
            ranges=self.ranges,
            scales=self.scatter.scales,
            ends=self.scatter.ends,
            together=self.scatter.together,
            is_warm=self.scatter.is_warm,
            degrees=self.scatter.degrees,
            n_vehicles=len(chosen),
            n_windows=sum(self.counts[vehicle] for vehicle in chosen),
        )


class TypeDetector:
    """Compares the windows of a vehicle that has no baseline of its own with its type, one after the other.

    Parameters
    ----------
    type_baseline
        Baseline of the type, or `nominal_type`: makers' scatter.
    false_alarms
        Probability that a sound vehicle raises an alert at first, and rate of false alarms per day afterwards; above 0.
    windows_per_day
        Windows in a day of driving, above 0.

    Raises
    ------
    ParameterError
        If a number is out of its range.

    Notes
    -----
    The mean of the windows, r ~ N(0, S) with S = D + V / n, is compared with the type: for hypothesis h with direction
    d, its deviation is z = d^T S^-1 r / sqrt(d^T S^-1 d), and a change of 20 % would make it delta. The test that is
    most powerful against such changes of all parts on average rejects above z = delta / 2 + c / delta (the likelihood
    ratio e^c, with prior shares of hypotheses); its evidence is -ln p, with p the sum of the tails of all distinct
    hypotheses at the c observed. Where left and right alone can be compared, a loss on one side and a gain on the other
    are the same test, and the loss is named first.

    A change between the windows is sought by a `ChangeDetector` with wide limits on the vehicle's mean.

    References
    ----------
    K. Roeder, L. Wasserman, Genome-wide significance levels and weighted hypothesis testing, Statistical Science 24
    (2009) 398-413 (section 3).
    """

    def __init__(
        self, type_baseline: TypeBaseline, *, false_alarms: float = 1e-3, windows_per_day: float = 48.0
    ) -> None:
        check_number("false_alarms", false_alarms, above=0)
        check_number("windows_per_day", windows_per_day, above=0)
        self._type, self._false_alarms, self._per_day = type_baseline, false_alarms, windows_per_day
        self._observations: list[Observation] = []
        self._evidence: list[float] = []
        self._detection: Detection | None = None

    @property
    def type_baseline(self) -> TypeBaseline:
        """Normal state of the vehicles of the type."""
        return self._type

    @property
    def false_alarms(self) -> float:
        """Probability of a false alarm."""
        return self._false_alarms

    @property
    def observations(self) -> tuple[Observation, ...]:
        """Windows held, oldest first, comparable or not."""
        return tuple(self._observations)

    @property
    def baseline(self) -> Baseline:
        """Normal state of a vehicle of the type that has no windows."""
        return self._type.baseline(self._observations)

    @property
    def evidence(self) -> Real:
        """Evidence after each window compared, -ln p."""
        return np.array(self._evidence)

    @property
    def threshold(self) -> float:
        """Evidence at which an alert is raised."""
        return float(-np.log(min(self._false_alarms, 1.0)))

    @property
    def is_alert(self) -> bool:
        """Whether the alert is active after the last window."""
        detection = self.detection
        return detection is not None and detection.is_alert

    @property
    def candidates(self) -> tuple[Candidate, ...]:
        """All hypotheses, the best first; none before the first window that can be compared."""
        detection = self.detection
        return () if detection is None else detection.candidates

    @property
    def detection(self) -> Detection | None:
        """Evidence after the last window, of a deviation from the type or of a change since; None before any."""
        if self._detection is None:
            self._detection = self._detect()
        return self._detection

    def _detect(self) -> Detection | None:
        """Return the evidence after the last window, None before any that can be compared."""
        compared = self._compared()
        if not compared:
            return None
        evidence, candidates = _against_type(self._type, compared)
        times = np.array([window.time for window in compared])
        above = np.flatnonzero(self.evidence >= self.threshold)
        first = float(times[above[0]]) if above.size else None
        least = _detectable(self._type, compared, self.threshold)
        deviation = Detection(times, self.evidence, evidence, self.threshold, candidates, first, least)
        if deviation.is_alert:
            return deviation
        since = self._changes()
        return since.detection if since.is_alert else deviation

    def update(self, observation: Observation) -> None:
        """Add the next window; one that cannot be compared adds no evidence.

        Parameters
        ----------
        observation
            Window that follows the earlier ones in time.
        """
        before = len(self._compared())
        self._detection = None
        self._observations.append(observation)
        compared = self._compared()
        if len(compared) > before:
            self._evidence.append(_against_type(self._type, compared)[0])

    def _compared(self) -> list[Observation]:
        """Return the windows that can be compared; none where a vehicle file explains most of them poorly."""
        sound = [window for window in self._observations if window.is_conclusive and not window.sensor_faults]
        alike = [window for window in sound if window.components == self._type.components]
        if not alike:
            return []
        accepts = self.baseline.accepts
        compared = [window for window in alike if accepts(window)]
        return compared if 2 * len(compared) > len(alike) else []

    def _changes(self) -> ChangeDetector:
        """Return a detector of changes between the windows."""
        wide = self._type.baseline(self._observations, widening=_WIDE)
        detector = ChangeDetector(wide, false_alarms=self._false_alarms, windows_per_day=self._per_day)
        for observation in self._observations:
            detector.update(observation)
        return detector


@dataclass(frozen=True, slots=True)
class RankedVehicle:
    """A vehicle of a fleet against its type.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    detection
        Evidence that it deviates from the others, and of what.
    is_discovery
        Whether it is among the vehicles that deviate, see `rank_fleet`.
    n_windows
        Number of windows compared.
    """

    vehicle: str
    detection: Detection
    is_discovery: bool
    n_windows: int


def rank_fleet(windows: Mapping[str, Iterable[Observation]], *, rate: float = 0.05) -> tuple[RankedVehicle, ...]:
    """Rank the vehicles of a type by how much each deviates from the others.

    Parameters
    ----------
    windows
        Windows of each vehicle, by its name.
    rate
        Expected share of sound vehicles among the discoveries, above 0 and up to 1.

    Returns
    -------
    tuple of RankedVehicle
        Vehicles with usable windows, the most deviating first.

    Raises
    ------
    DataError
        If fewer than five vehicles have usable windows.
    ParameterError
        If the rate is not above 0 and at most 1.

    Notes
    -----
    Each vehicle is compared as by `TypeDetector` with the type of the others. `false_discoveries` of -ln p is the
    procedure of Benjamini and Hochberg, which holds for independent vehicles.

    References
    ----------
    Y. Benjamini, Y. Hochberg, Controlling the false discovery rate: a practical and powerful approach to multiple
    testing, Journal of the Royal Statistical Society B 57 (1995) 289-300.

    Examples
    --------
    One of eight vehicles has a spring that has lost 30 % of its stiffness:

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
    >>> ranked = rank_fleet(fleet)
    >>> ranked[0].vehicle, [vehicle.vehicle for vehicle in ranked if vehicle.is_discovery]
    ('car-2', ['car-2'])
    """
    check_number("rate", rate, above=0, at_most=1)
    usable = _usable(windows)
    if len(usable) <= LEAST_VEHICLES:
        raise DataError(
            f"{len(usable)} vehicles have usable windows, and {LEAST_VEHICLES + 1} are needed: give more vehicles"
        )
    fleet = _Fleet.of(usable)
    detections: dict[str, Detection] = {}
    for vehicle, own in usable.items():
        of_type = fleet.type_of((other for other in usable if other != vehicle), name="")
        evidence, candidates = _against_type(of_type, own)
        times = np.array([own[-1].time])
        threshold = float(-np.log(rate))
        least = _detectable(of_type, own, threshold)
        detections[vehicle] = Detection(times, np.array([evidence]), evidence, threshold, candidates, None, least)
    chosen = false_discoveries([detection.e_value for detection in detections.values()], rate=rate)
    ranked = [
        RankedVehicle(vehicle, detection, number in chosen, len(usable[vehicle]))
        for number, (vehicle, detection) in enumerate(detections.items())
    ]
    return tuple(sorted(ranked, key=lambda one: -one.detection.e_value))


@dataclass(frozen=True, eq=False, slots=True)
class _Comparison:
    """Tests of all hypotheses on the mean of windows: directions (rows), inverse covariance, and prior shares."""

    hypotheses: tuple[Hypothesis, ...]
    rows: Real
    inverse: Real
    shares: Real
    degrees: float
    #: Standard deviation of the size of each hypothesis.
    stds: Real
    #: Signed hypotheses, losses first, none of which is nearly the same test as one before it.
    distinct: Indices

    @classmethod
    def of(cls, of_type: TypeBaseline, covariance: Real) -> "_Comparison":
        """Return the comparison of a mean of windows, of the covariance given, with a type."""
        parts = tuple(hypothesis for hypothesis in hypotheses_of(of_type.components) if len(hypothesis.changes) == 1)
        degrees = of_type.n_vehicles + _OF_MAKERS if of_type.n_vehicles else np.inf
        rows = np.array([hypothesis.direction(of_type.components) for hypothesis in parts])
        inverse = _inverse(of_type.of_a_vehicle + covariance)
        likeness = rows @ inverse @ rows.T
        stds = 1 / np.sqrt(np.diag(likeness))
        return cls(parts, rows, inverse, log_prior(parts), degrees, stds, _distinct(likeness * np.outer(stds, stds)))

    def sizes(self, residuals: Real) -> Real:
        """Return the size of each hypothesis in residuals of shape (..., components), ln values."""
        return np.asarray(self.stds**2 * (residuals @ self.inverse @ self.rows.T), dtype=np.float64)

    def evidence(self, residuals: Real) -> Real:
        """Return -ln p of each hypothesis in residuals of shape (..., components)."""
        return np.asarray(-np.log(self._tails(self.sizes(residuals) / self.stds)), dtype=np.float64)

    def _tails(self, z: Real) -> Real:
        """Return the probability of evidence as strong as that of each hypothesis, from any of them."""
        deltas = np.tile(_SIZE / self.stds, 2)
        of_signs = np.concatenate([self.shares + np.log(_LOSSES), self.shares + np.log(1 - _LOSSES)])
        both = np.concatenate([-z, z], axis=-1) * deltas - deltas**2 / 2 + of_signs
        strength = both.reshape(*z.shape[:-1], 2, -1).max(axis=-2)
        deltas, of_signs = deltas[self.distinct], of_signs[self.distinct]
        limits = deltas / 2 + (strength[..., None] - of_signs) / deltas
        tails = stats.norm.sf(limits) if np.isinf(self.degrees) else stats.t.sf(limits, self.degrees)
        return np.asarray(np.clip(tails.sum(axis=-1) / (1 - _UNMODELLED), 1e-300, 1.0), dtype=np.float64)


def _distinct(cosines: Real) -> Indices:
    """Return the signed hypotheses, losses first, that are no test nearly the same as an earlier one."""
    signs = np.repeat([-1.0, 1.0], len(cosines))
    alike = np.outer(signs, signs) * np.tile(cosines, (2, 2))
    distinct: list[int] = []
    for number in range(len(signs)):
        if not np.any(alike[number, distinct] > _SAME):
            distinct.append(number)
    return np.array(distinct)


def _against_type(of_type: TypeBaseline, windows: Sequence[Observation]) -> tuple[float, tuple[Candidate, ...]]:
    """Return -ln p that a vehicle belongs to a type, and what may be different, the most likely first."""
    residual, covariance = _mean_residual(of_type, windows)
    comparison = _Comparison.of(of_type, covariance)
    degrees = comparison.degrees
    times = windows[0].time, windows[-1].time
    half = stats.t.isf(0.025, degrees) if np.isfinite(degrees) else INTERVAL_95
    candidates = [
        Candidate(hypothesis, float(log), float((size / std) ** 2), (_size(size, std, half),), times[0], times)
        for hypothesis, log, size, std in zip(
            comparison.hypotheses,
            comparison.evidence(residual).tolist(),
            comparison.sizes(residual).tolist(),
            comparison.stds.tolist(),
            strict=True,
        )
    ]
    explained = float(residual @ comparison.inverse @ residual)
    count = len(residual)
    rest = stats.chi2.sf(explained, count) if np.isinf(degrees) else stats.f.sf(explained / count, count, degrees)
    unmodelled = float(-np.log(np.clip(rest / _UNMODELLED, 1e-300, 1.0)))
    candidates.append(
        Candidate(Hypothesis("else", "vehicle", "unmodelled"), unmodelled, explained, (), times[0], times)
    )
    candidates.sort(key=lambda candidate: (-candidate.log_evidence, -candidate.explained))
    return candidates[0].log_evidence, tuple(candidates)


def _size(size: float, std: float, half: float) -> Size:
    """Return the size of a change [ln] with its interval, `half` standard deviations on either side."""
    interval = float(np.expm1(size - half * std)), float(np.expm1(size + half * std))
    return Size(float(np.expm1(size)), interval, abs(size) / std)


def _detectable(of_type: TypeBaseline, windows: Sequence[Observation], threshold: float) -> dict[Component, float]:
    """Return the smallest relative loss of each component that is found with 95 % power.

    The size is found by bisection: that at which the evidence reaches the threshold, and 1.645 standard deviations.
    """
    comparison = _Comparison.of(of_type, _mean_residual(of_type, windows)[1])
    count = len(of_type.components)
    low, high = np.zeros(count), np.full(count, _LARGEST)
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        evidence = comparison.evidence(-middle[:, None] * comparison.rows[:count])
        is_found = evidence.max(axis=1) >= threshold
        low, high = np.where(is_found, low, middle), np.where(is_found, middle, high)
    changes = high + stats.norm.ppf(POWER) * comparison.stds[:count]
    return dict(zip(of_type.components, losses(changes), strict=True))


def _mean_residual(of_type: TypeBaseline, windows: Sequence[Observation]) -> tuple[Real, Real]:
    """Return the mean of the windows' residuals and its covariance, at least as wide as they scatter.

    A common change with an unknown temperature, or beyond the conditions of the type, is the same in all windows.
    """
    baseline = of_type.baseline(windows)
    away = np.array([baseline.residual(window) for window in windows])
    own = np.mean([baseline.covariance_of(window) for window in windows], axis=0)
    pairs, ends, _ = directions(baseline.components)
    scatter = (away - away.mean(axis=0)) @ pairs.T
    free = max((len(away) - 1) * len(pairs), 1)
    excess = max(1.0, float(np.sum(scatter**2 / np.diag(pairs @ own @ pairs.T))) / free)
    covariance = excess * own / len(away)
    if not (of_type.is_warm and _is_warm(windows)):
        no_ends = dict.fromkeys(kinds_of(ends, baseline.components), 0.0)
        covariance = covariance + usual_nuisance(baseline.components, no_ends or USUAL_ENDS)
    for beyond, slope in zip(_beyond(of_type, baseline, windows), slope_covariances(baseline.components), strict=True):
        covariance = covariance + beyond**2 * slope
    return away.mean(axis=0), np.asarray(covariance, dtype=np.float64)


def _beyond(of_type: TypeBaseline, baseline: Baseline, windows: Sequence[Observation]) -> Real:
    """Return how far the mean conditions of windows are beyond those of the type, in units, shape (conditions,)."""
    ends = [
        baseline.units(replace(windows[0], conditions={name: end[side] for name, end in of_type.ranges.items()}))
        for side in (0, 1)
    ]
    units = np.mean([baseline.units(window) for window in windows], axis=0)
    return np.asarray(units - np.clip(units, *ends), dtype=np.float64)


def _inverse(matrix: Real) -> Real:
    return np.asarray(np.linalg.inv(matrix), dtype=np.float64)


def _located(values: Real) -> tuple[float, float]:
    """Return location and scale of values by Huber's proposal 2, both as for normal values."""
    location = float(np.median(values))
    scale = float(stats.median_abs_deviation(values, scale="normal")) or float(np.std(values)) or 1e-12
    density, tail = stats.norm.pdf(_CLIP), stats.norm.sf(_CLIP)
    expected = 1 - 2 * tail - 2 * _CLIP * density + 2 * _CLIP**2 * tail
    for _ in range(_CLIP_ROUNDS):
        clipped = np.clip(values, location - _CLIP * scale, location + _CLIP * scale)
        scale = float(np.sqrt(np.sum((clipped - location) ** 2) / (len(values) - 1) / expected))
        location = float(np.mean(clipped))
    return location, scale


def _between(
    components: tuple[Component, ...], sides: dict[str, float], ends: dict[str, float], together: dict[str, float]
) -> Real:
    """Return a covariance from the deviations of left against right, front against rear, and all of each kind."""
    pairs, _, _ = directions(components)
    of_pairs = np.array([sides[kind] for kind in kinds_of(pairs, components)]) / 2
    rest = usual_nuisance(components, ends or USUAL_ENDS, together)
    return np.asarray((pairs.T * of_pairs**2) @ pairs + rest + 1e-8 * np.eye(len(components)), dtype=np.float64)


def _makers(kind: str) -> float:
    return MAKERS.get(kind, max(MAKERS.values()))


def _is_warm(observations: Iterable[Observation]) -> bool:
    return all("temperature" in window.conditions for window in observations if window.is_conclusive)


def _mean_covariance(observations: Iterable[Observation], components: tuple[Component, ...]) -> Real:
    alike = [window.covariance for window in observations if window.components == components]
    return np.asarray(np.mean(alike, axis=0), dtype=np.float64)


def _usable(windows: Mapping[str, Iterable[Observation]]) -> dict[str, list[Observation]]:
    """Return the windows that can be learnt from, with the commonest components, of vehicles that have any."""
    check_type("windows", windows, Mapping, advice="{'car-1': sprung.observe(recordings, vehicle), ..}")
    every = {vehicle: check_each(f"windows[{vehicle!r}]", own, Observation) for vehicle, own in windows.items()}
    sound = {
        vehicle: [window for window in own if window.is_conclusive and not window.sensor_faults]
        for vehicle, own in every.items()
    }
    kinds = [window.components for own in sound.values() for window in own]
    common = max(kinds, key=kinds.count, default=())
    alike = {vehicle: [window for window in own if window.components == common] for vehicle, own in sound.items()}
    return {vehicle: own for vehicle, own in alike.items() if own}
