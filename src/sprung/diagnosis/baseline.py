"""Normal state of one vehicle: means of its components, their scatter, and their dependence on conditions."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np
from scipy.linalg import block_diag, helmert

from sprung._arrays import Real
from sprung._checks import freeze, frozen_array
from sprung._display import Savable, Tabular, counted, in_short, listed
from sprung.diagnosis.observation import LAYOUT_CONDITIONS, Observation
from sprung.diagnosis.residuals import ResidualReference
from sprung.diagnosis.scatter import (
    FRONT_REAR_STD,
    LASTING,
    ROUNDS,
    coordinates,
    directions,
    pooled,
    shared_covariance,
)
from sprung.errors import ParameterError
from sprung.likelihood import Expected
from sprung.vehicles import Component

#: Conditions on which components may depend, and one unit of each: kg, ln of the road's roughness, m/s, K, kg m.
CONDITIONS = {
    "payload": 100.0,
    "roughness": 1.4,
    "speed": 5.0,
    "temperature": 10.0,
    **{name: LAYOUT_CONDITIONS[name] for name in ("payload_x_moment", "payload_y_moment")},
}


@dataclass(frozen=True, slots=True)
class BaselineSettings:
    """What is known of a vehicle before any window, and of its file."""

    #: Standard deviation of the change of a component's ln value with one unit of a condition.
    slope: float = 0.01
    #: Standard deviation of the change of all components of a kind together with one unit of each of `CONDITIONS`: the
    #: oil of a damper loses up to 1 % of its damping per kelvin.
    common_slopes: tuple[float, ...] = (0.05, 0.05, 0.05, 0.1)
    #: The same of a component by itself with one unit of a moment of the payload, over the model error.
    slope_of_moments: float = 0.1
    #: Model error of the best of files.
    perfect: float = 0.01
    #: Largest distance from the middle of a condition that counts, in units.
    farthest: float = 5.0
    #: Model error of the windows above which a note states that the vehicle file is in error.
    imperfect: float = 0.25
    #: Model error up to which values can be compared with the vehicle file itself.
    trusted: float = 0.15
    #: Least standard deviation over the corners of the rise of their stiffening off their bump stops, and multiple of
    #: its variance that is usual.
    stiffening: float = 0.02
    usual: float = 1.5
    #: Stiffness of a spring or tyre over that of the baseline that no fault explains: the fit did not determine it.
    stiffest: float = 2.5


SETTINGS = BaselineSettings()


@dataclass(frozen=True, eq=False, slots=True)
class Baseline(Tabular, Savable):
    """Normal state of one vehicle over the conditions it meets.

    Parameters
    ----------
    vehicle
        Name of the vehicle in its file.
    components
        Springs, dampers and tyres of its windows.
    mean
        Mean of ln(value / nominal value) at the middle of the conditions, shape (components,).
    covariance
        Covariance of one window about that mean, shape (components, components), without common changes of all corners
        or of both sides of an axle; as the windows scatter, which may be more or less than they report.
    reported
        Mean covariance that the windows report, shape (components, components).
    slopes
        Change of the mean with one unit of each of `CONDITIONS`, shape (components, conditions).
    centre
        Median of each condition of the windows, where known.
    ranges
        Lowest and highest value of each condition of the windows, and of those of `LAYOUT_CONDITIONS`, where known.
    nuisance
        Covariance of the common changes of components from window to window (payload, temperature, road), shape
        (components, components).
    information
        Information about the mean and the slopes (the mean of all components first, then the slopes of all components
        with the first condition ...), shape ((1 + conditions) components, the same).
    degrees_of_freedom
        Degrees of freedom of the scatter of windows in `covariance`.
    n_windows
        Number of windows that it was learnt from; 0: the vehicle file only.
    n_refused
        Number of windows that were inconclusive, had failing sensors or were suspect.
    version, reason
        Number of the learning, from 1, and why it was done.
    residuals
        Reference of the subspace residual test; None: not learnt.
    model_error
        Median model error of the windows that it was learnt from, see `CornerFit`.
    learning_times
        Times of the windows that it was learnt from [s].
    vehicle_file
        Text of the vehicle file that a calibration completed, in terms of which the windows were observed; empty: the
        file as given.
    missing
        Sensors of motion of the vehicle file that its windows lack.
    weights
        Probability that parts scatter alike or unequally, and of each of the correlations of consecutive windows 0, 0.1
        ... 0.7, shape (2, 8).
    coordinates
        Coordinates of deviations as rows, shape (components + hypotheses, components), of variance 1 where windows
        scatter as they report: uncorrelated ones, then the estimate of each change with one size; empty: those by
        `reported` and `nuisance`.
    squares
        Sum of squares of its windows, whitened by each of these correlations, along each of the coordinates, shape (8,
        rows); empty: no window.
    degrees
        Degrees of freedom of these sums, shape (rows,); empty: 0.
    stiffenings
        Stiffening of the springs in its windows, see `Observation.of_stiffening`.
    run_outs
        Largest run-out of each wheel of a rail vehicle in its windows, with two standard deviations [m]; empty where no
        line of the wheels stood out.

    Raises
    ------
    ParameterError
        If an array has another shape, or holds numbers that are not finite.
    """

    vehicle: str
    components: tuple[Component, ...]
    mean: Real
    covariance: Real
    reported: Real
    slopes: Real
    centre: dict[str, float]
    ranges: dict[str, tuple[float, float]]
    nuisance: Real
    information: Real
    degrees_of_freedom: float
    n_windows: int
    n_refused: int
    version: int
    reason: str
    residuals: ResidualReference | None = None
    model_error: float = 0.0
    learning_times: tuple[float, ...] = ()
    vehicle_file: str = ""
    missing: tuple[str, ...] = ()
    weights: Real = field(default_factory=lambda: LASTING.prior)
    coordinates: Real = field(default_factory=lambda: np.zeros((0, 0)))
    squares: Real = field(default_factory=lambda: np.zeros((0, 0)))
    degrees: Real = field(default_factory=lambda: np.zeros(0))
    stiffenings: tuple[Observation, ...] = ()
    run_outs: dict[str, float] = field(default_factory=dict)

    def __post_init__(self) -> None:
        size, more = len(self.components), 1 + len(CONDITIONS)
        square, every = (size, size), (size * more, size * more)
        n_correlations = len(LASTING.correlations)
        if not np.size(self.coordinates):
            rows = coordinates(self.components, np.asarray(self.reported) + np.asarray(self.nuisance))
            object.__setattr__(self, "coordinates", rows)
            object.__setattr__(self, "squares", np.zeros((n_correlations, len(rows))))
            object.__setattr__(self, "degrees", np.zeros(len(rows)))
        count = len(self.coordinates)
        of_rows = {"coordinates": (count, size), "squares": (n_correlations, count), "degrees": (count,)}
        freeze_shapes(self, "a baseline", weights=LASTING.prior.shape, **of_rows)
        shapes = {"mean": (size,), "covariance": square, "reported": square, "nuisance": square}
        freeze_shapes(self, "a baseline", **shapes, slopes=(size, more - 1), information=every)

    def __repr__(self) -> str:
        """Return the vehicle, the learning, the conditions and limits."""
        windows = f"{counted(self.n_windows, 'window')}, {self.n_refused} left out"
        head = f"Baseline {self.version} of {self.vehicle!r} ({self.reason}): {len(self.components)} components from "
        known = (f"{name} {low:.3g} to {high:.3g}" for name, (low, high) in self.ranges.items())
        return in_short(head + windows, listed(known), *self.notes[:1])

    @property
    def doubt(self) -> Real:
        """Covariance of `mean` about the vehicle's own one, shape (components, components)."""
        size = len(self.components)
        return np.asarray(_doubts(self)[0][:size, :size], dtype=np.float64)

    @property
    def expected(self) -> Expected:
        """What fits of further windows may start from."""
        return Expected(dict(zip(self.components, self.mean.tolist(), strict=True)), self.model_error)

    @property
    def notes(self) -> tuple[str, ...]:
        """Limits of the baseline, one sentence each."""
        if self.n_windows == 0:
            return (
                "no baseline: left is compared with right by production scatter (standard deviation 4 % for springs, "
                "5 % for dampers, 3 % for tyres); a change of both sides of an axle alike is not found",
            )
        if self.version == 0:
            return (f"no baseline of the vehicle itself: compared with {self.reason}",)
        without = (
            (f"the baseline was learnt without the sensors {', '.join(self.missing)} of the vehicle file",)
            if self.missing
            else ()
        )
        if self.model_error < SETTINGS.imperfect:
            return without
        return (
            *without,
            f"the vehicle file deviates by {100 * self.model_error:.0f} % on the windows of the baseline, so that "
            "small changes are found late or not at all: check masses, geometry and positions of sensors, and add what "
            "it lacks, such as an engine on mounts",
        )

    def accepts(self, observation: Observation) -> bool:
        """Return whether a window can be compared: conclusive, from valid sensors, with the same components.

        The effect of a failing sensor on a fit is unknown. Without a learnt baseline, the vehicle file must also
        explain the window well. A window that hardly determines a spring or tyre has deviations which are not normal.
        """
        is_alike = observation.components == self.components and self.has_sensors_of(observation)
        is_sound = observation.is_valid and is_alike and self.is_trusted_on(observation)
        return is_sound and not self.too_stiff_in(observation)

    def too_stiff_in(self, observation: Observation) -> tuple[Component, ...]:
        """Return the springs and tyres that are too stiff for any fault, in a window with the same components."""
        ratios = zip(self.components, observation.log_ratios - self.mean, strict=True)
        limit = np.log(SETTINGS.stiffest)
        return tuple(part for part, ratio in ratios if ratio > limit and part.kind in {"spring", "tyre"})

    def has_sensors_of(self, observation: Observation) -> bool:
        """Return whether a window lacks the same sensors as those that the baseline was learnt from, if it was."""
        return self.version == 0 or observation.missing == self.missing

    def is_trusted_on(self, observation: Observation) -> bool:
        """Return whether the baseline was learnt from windows, or the vehicle file explains this one well."""
        return self.n_windows > 0 or observation.conditions.get("model_error", 0.0) <= SETTINGS.trusted

    def residual(self, observation: Observation) -> Real:
        """Return the deviation of a window from the normal state under its conditions, ln values, shape (components,).

        Raises
        ------
        ParameterError
            If the window has other components.
        """
        if observation.components != self.components:
            raise ParameterError("the components differ from those of the baseline: fit the same ones, or learn again")
        return observation.log_ratios - self.mean - self.slopes @ self.units(observation)

    def covariance_of(self, observation: Observation) -> Real:
        """Return the covariance of a window's residual about the normal state, shape (components, components).

        Notes
        -----
        That of the baseline's windows, wider where this window reports more than they did. Without a temperature that
        the baseline's windows had, all components of a kind may have changed as much as is usual without one. Beyond
        the conditions that these met, the effect of a condition need not be linear: each window has its own.
        """
        around = self.nuisance_of(observation) + self.unmet_of(observation)
        return np.asarray(self.scatter_of(observation) + around, dtype=np.float64)

    def unmet_of(self, observation: Observation) -> Real:
        """Return the covariance of a window beyond the conditions of its windows, shape (components, components)."""
        if self.n_windows == 0:
            return np.zeros_like(self.nuisance)
        slopes = np.array(slope_covariances(self.components, self.model_error))
        return np.asarray(np.tensordot(self.beyond(self.units(observation)) ** 2, slopes, 1), dtype=np.float64)

    def nuisance_of(self, observation: Observation) -> Real:
        """Return the covariance of what moves components of a window together, shape (components, components)."""
        if self.n_windows == 0 or "temperature" not in self.centre or "temperature" in observation.conditions:
            return self.nuisance
        return np.asarray(self.nuisance + shared_covariance(self.components, FRONT_REAR_STD), dtype=np.float64)

    def scatter_of(self, observation: Observation) -> Real:
        """Return the covariance of a window's scatter alone, which may be correlated with that of the one before.

        Notes
        -----
        Where some corners meet their bump stops more than others, beyond what is usual, the linear fit is wrong at all
        springs: each is less certain by the standard deviation of the rises of their stiffening inwards.
        """
        scatter = observation.covariance
        if self.n_windows:
            own = np.sqrt(np.maximum(np.diag(observation.covariance) / np.diag(self.reported), 1.0))
            scatter = self.covariance * np.outer(own, own)
        is_spring = np.array([part.kind == "spring" for part in self.components])
        by_stops = unequal_stiffening(self.stiffenings, observation) * np.diag(is_spring)
        return np.asarray(scatter + by_stops, dtype=np.float64)

    def units(self, observation: Observation) -> Real:
        """Return the conditions of a window in units away from the middle, at most 5, shape (conditions,).

        An unknown condition is 0.
        """
        return units_of(observation.conditions, self.centre)

    def beyond(self, units: Real) -> Real:
        """Return how far conditions in units are outside of those of its windows, shape (conditions,); inside 0."""
        return np.asarray(units - np.clip(units, *_ends(self)), dtype=np.float64)

    def doubt_beyond(self, correlation: float = 0.0) -> Real:
        """Return the covariance of the mean, the slopes, and their changes beyond the conditions of its windows.

        Parameters
        ----------
        correlation
            Correlation of consecutive windows, from 0 and below 1.

        Notes
        -----
        The mean of n windows of correlation rho has the information (n - (n - 2) rho) / (1 + rho) / n of that of
        independent ones (1^T R^-1 1), and so have the slopes, whose conditions may change as slowly.
        """
        is_own = self.n_windows > 0 and self.version > 0
        share = (1 - correlation * (1 - 2 / self.n_windows)) / (1 + correlation) if is_own else 1.0
        of_windows, beyond = _doubts(self)
        return np.asarray(of_windows / share + beyond, dtype=np.float64)


@lru_cache(maxsize=16)
def _doubts(baseline: Baseline) -> tuple[Real, Real]:
    """Return the covariance of mean and slopes, and that of the changes of these: two parts of one matrix."""
    inverse = np.linalg.inv(baseline.information)
    beyond = slope_covariances(baseline.components, baseline.model_error)
    of_windows = block_diag(inverse, *(0 * each for each in beyond))
    of_changes = block_diag(0 * inverse, *beyond)
    return frozen_array("of_windows", of_windows, ndim=2), frozen_array("of_changes", of_changes, ndim=2)


@lru_cache(maxsize=16)
def _ends(baseline: Baseline) -> tuple[Real, Real]:
    """Return the lowest and highest conditions of the windows of a baseline in units, shape (conditions,) each."""
    low, high = zip(*baseline.ranges.values(), strict=True) if baseline.ranges else ((), ())
    lowest, highest = (dict(zip(baseline.ranges, ends, strict=True)) for ends in (low, high))
    return units_of(lowest, baseline.centre), units_of(highest, baseline.centre)


def freeze_shapes(value: object, what: str, **shapes: tuple[int, ...]) -> None:
    """Make arrays of a value read-only, row by row; a message refuses those of another shape, or not finite."""
    for name, shape in shapes.items():
        array = frozen_array(name, np.ascontiguousarray(getattr(value, name)), ndim=len(shape))
        if array.shape != shape or not np.all(np.isfinite(array)):
            raise ParameterError(f"{name} of {what} must be {shape} finite numbers: learn it again")
        object.__setattr__(value, name, array)


def vehicle_of(observations: Iterable[Observation]) -> str:
    """Return the name of the vehicle of windows; "" if they carry none.

    Raises
    ------
    ParameterError
        If the windows are of several vehicles.
    """
    names = sorted({observation.vehicle for observation in observations if observation.vehicle})
    if len(names) > 1:
        raise ParameterError(f"the windows are of the vehicles {', '.join(names)}: give those of one")
    return names[0] if names else ""


def prior_information(
    components: tuple[Component, ...], of_mean: Real, *, of_slopes: float = 1.0, model_error: float = 0.0
) -> Real:
    """Return the information about mean and slopes before any window, shape as `Baseline.information`.

    Parameters
    ----------
    components
        Springs, dampers and tyres.
    of_mean
        Information about the mean, shape (components, components).
    of_slopes
        Factor of the usual information about the slopes.
    model_error
        Model error of the windows.
    """
    slopes = [of_slopes * np.linalg.inv(covariance) for covariance in slope_covariances(components, model_error)]
    return np.asarray(block_diag(of_mean, *slopes), dtype=np.float64)


@lru_cache(maxsize=64)
def slope_covariances(components: tuple[Component, ...], model_error: float = 0.0) -> tuple[Real, ...]:
    """Return the covariance of the slopes with each condition before any window, each (components, components).

    Notes
    -----
    A model of an error e takes a load over one axle, or friction on another road, partly for other parts there: one
    unit of a condition changes ln(front / rear) or ln(left / right) of each kind with the standard deviation e.
    """
    pairs, ends, together = directions(components)
    each, error = np.eye(len(components)), max(model_error, SETTINGS.perfect)
    stds = [SETTINGS.slope] * 4 + [SETTINGS.slope_of_moments * error] * 2
    alike = zip(stds, (*SETTINGS.common_slopes, 0.0, 0.0), strict=True)
    covariances = [own**2 * each + common**2 * together.T @ together for own, common in alike]
    moved = {"payload": ends, "roughness": ends, "payload_x_moment": ends, "payload_y_moment": pairs / 2}
    for name, rows in moved.items():
        covariances[list(CONDITIONS).index(name)] += model_error**2 * rows.T @ rows
    return tuple(frozen_array("slopes", covariance, ndim=2) for covariance in covariances)


def unequal_stiffening(usual: tuple[Observation, ...], observation: Observation) -> float:
    """Return the variance over the corners of the rise of their stiffening, beyond that of usual windows, at least 0.

    Parameters
    ----------
    usual
        Stiffening of usual windows, see `Observation.of_stiffening`; fewer than two: that of springs off their stops.
    observation
        Window.

    Notes
    -----
    Contrasts of the corners are at least as uncertain as the window states: those that it hardly determines, as of two
    axles near each other, count little. The variance that is added to that of each is found by Fisher scoring.
    """
    own = observation.of_stiffening()
    if own is None or len(own.components) < 2:
        return 0.0
    mean, variance = _usual_stiffening(usual, own.components)
    contrasts = helmert(len(mean))
    stated, axes = np.linalg.eigh(contrasts @ own.covariance @ contrasts.T)
    known = SETTINGS.usual * np.maximum(stated, max(variance, SETTINGS.stiffening**2))
    squares = (axes.T @ contrasts @ (own.log_ratios - mean)) ** 2
    risen = SETTINGS.stiffening**2
    for _ in range(ROUNDS):
        weights = 1 / (known + risen) ** 2
        risen = max(0.0, float(np.sum(weights * (squares - known)) / np.sum(weights)))
    return risen


@lru_cache(maxsize=16)
def _usual_stiffening(usual: tuple[Observation, ...], components: tuple[Component, ...]) -> tuple[Real, float]:
    """Return the mean stiffening of each corner in windows, and the variance over corners about it."""
    values = np.array([window.log_ratios for window in usual if window.components == components])
    if len(values) < 2:
        return np.zeros(len(components)), 0.0
    mean = values.mean(axis=0)
    return mean, float(np.var(values - mean, axis=1, ddof=1).sum() / (len(values) - 1))


def units_of(conditions: Mapping[str, float], centre: Mapping[str, float]) -> Real:
    """Return the conditions of a window in units of `CONDITIONS` away from a middle, at most 5, shape (conditions,).

    Parameters
    ----------
    conditions
        Conditions of the window; one that is unknown is 0.
    centre
        Value of each condition in the middle, where known.
    """
    units = []
    for name, unit in CONDITIONS.items():
        value = conditions.get(name)
        if value is None or name not in centre:
            units.append(0.0)
        elif name == "roughness":
            units.append(float(np.log(value / centre[name])) / unit)
        else:
            units.append((value - centre[name]) / unit)
    return np.asarray(np.clip(np.array(units), -SETTINGS.farthest, SETTINGS.farthest), dtype=np.float64)


def model_error_of(observations: Sequence[Observation]) -> float:
    """Return the median model error of windows; 0 where it is unknown."""
    return float(np.median([window.conditions.get("model_error", 0.0) for window in observations]))


def of_one_type(baselines: Mapping[str, Baseline]) -> dict[str, Baseline]:
    """Return the baselines of vehicles of a type with `weights` that all of them show together."""
    weights = pooled(baseline.weights for baseline in baselines.values())
    return {vehicle: replace(baseline, weights=weights) for vehicle, baseline in baselines.items()}


def medians(observations: Sequence[Observation]) -> dict[str, float]:
    """Return the median of each known condition of windows."""
    return {name: float(np.median(values)) for name, values in _conditions_met(observations, CONDITIONS).items()}


def ranges(observations: Sequence[Observation]) -> dict[str, tuple[float, float]]:
    """Return the lowest and the highest value of each known condition of windows."""
    every = (*CONDITIONS, *LAYOUT_CONDITIONS)
    return {name: (min(values), max(values)) for name, values in _conditions_met(observations, every).items()}


def _conditions_met(observations: Sequence[Observation], names: Iterable[str]) -> dict[str, list[float]]:
    """Return the values of each known condition of some."""
    met = {name: [window.conditions[name] for window in observations if name in window.conditions] for name in names}
    return {name: values for name, values in met.items() if values}


@dataclass(frozen=True, eq=False, slots=True)
class MeanDeviation:
    """Mean deviation of windows from a baseline.

    Parameters
    ----------
    components
        Springs, dampers and tyres of the baseline.
    log_ratios
        Mean deviation from the baseline under the conditions of each window, ln values, shape (components,).
    std
        Standard deviation of `log_ratios` with the effects that corners share, shape (components,).
    std_by_chance
        Part of `std` that is independent from window to window, shape (components,).
    n_windows
        Number of windows.
    """

    components: tuple[Component, ...]
    log_ratios: Real
    std: Real
    std_by_chance: Real
    n_windows: int

    def __post_init__(self) -> None:
        freeze(self, log_ratios=1, std=1, std_by_chance=1)


def mean_deviation(baseline: Baseline, observations: Sequence[Observation]) -> MeanDeviation:
    """Return the mean deviation of windows from a baseline.

    Parameters
    ----------
    baseline
        Baseline of the vehicle or its type, or of the vehicle file.
    observations
        Conclusive windows with the components of the baseline, at least one.

    Raises
    ------
    ParameterError
        If there is no window, or one has other components.

    Notes
    -----
    By chance the mean of n windows has the variance C (1 / n + 1 / m) with the covariance C of the m windows of the
    baseline, or the mean of what the windows report without one. Common effects such as that of a payload may persist:
    averaging over windows does not remove them.
    """
    if not observations:
        raise ParameterError("observations is empty, but a mean needs at least one conclusive window")
    count = len(observations)
    mean = np.mean([baseline.residual(window) for window in observations], axis=0)
    by_chance = np.mean([window.covariance for window in observations], axis=0) / count
    if baseline.version:
        by_chance = baseline.covariance * (1 / count + 1 / baseline.n_windows)
    whole = by_chance + baseline.nuisance + _between(baseline)
    return MeanDeviation(baseline.components, mean, np.sqrt(np.diag(whole)), np.sqrt(np.diag(by_chance)), count)


def typical_std(baseline: Baseline) -> Real:
    """Return the standard deviation of single windows about a baseline, ln values, shape (components,)."""
    return np.sqrt(np.diag(baseline.covariance + baseline.nuisance + _between(baseline)))


def _between(baseline: Baseline) -> Real:
    """Return the covariance between vehicles, of a baseline that is not the vehicle's own."""
    return baseline.doubt if baseline.version == 0 else np.zeros_like(baseline.covariance)
