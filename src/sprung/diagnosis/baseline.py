"""What is normal for one vehicle: the mean of its corners, how they scatter, and how they follow conditions."""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from sprung._arrays import Real
from sprung._checks import check_number, frozen_array
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.residuals import (
    FEWEST as FEWEST_RESIDUALS,
)
from sprung.diagnosis.residuals import (
    ResidualReference,
    learn_reference,
    residual_reference_from_dict,
)
from sprung.errors import DataError, ParameterError
from sprung.vehicles import Component

SCHEMA = "sprung.baseline/1"
#: Fewest windows that a baseline is learnt from.
FEWEST = 6
#: Conditions that contrasts may follow, and one unit of each: kg, ln of the road's roughness, m/s.
CONDITIONS = {"payload": 100.0, "roughness": 1.4, "speed": 5.0}
#: Standard deviation of the change of ln values with one unit of a condition, before any window.
_SLOPE = 0.01
#: Information about slopes that are 0 by assumption.
_NO_SLOPE = 1e9
#: Usual change of all components of a kind together from window to window (payload, temperature, road), and between
#: front and rear, in ln values.
_COMMON = {"spring": 0.08, "damper": 0.25, "tyre": 0.06}
_ENDS = {"spring": 0.008, "damper": 0.012, "tyre": 0.005}
#: Windows that the usual scatter of axles is worth when the vehicle's own is estimated, and the scatter that windows
#: report.
_PRIOR_WINDOWS, _PRIOR_SCATTER = 8.0, 2.0
#: Chance that a healthy window is left out of learning.
_SUSPECT = 1e-3
#: Model error of the windows from which on a note says that the vehicle file is in error, and up to which values can be
#: compared with the vehicle file itself.
_IMPERFECT, _TRUSTED = 0.25, 0.15
#: Standard deviations of a new vehicle about its file: left against right, front against rear.
_UNLIKE, _UNLIKE_ENDS = 0.04, 0.15


@dataclass(frozen=True, eq=False, slots=True)
class Baseline:
    """What is normal for one vehicle.

    Parameters
    ----------
    vehicle
        Name of the vehicle in its file.
    components
        Springs, dampers and tyres of its windows.
    mean
        Mean of ln(value / nominal value) in the middle of the conditions, shape (components,).
    covariance
        Covariance of one window about that, shape (components, components), without what moves all corners or both of
        an axle together.
    slopes
        Change of the mean with one unit of each of `CONDITIONS`, shape (components, conditions).
    middle
        Median of each condition of the windows, where known.
    ranges
        Lowest and highest value of each condition of the windows, where known.
    nuisance
        Covariance of what moves components together from window to window (payload, temperature, road), shape
        (components, components).
    design
        Information of the windows about mean and slopes, for a covariance of one, shape (1 + conditions, same).
    degrees
        Degrees of freedom of the scatter of windows in `covariance`.
    n_windows
        Number of windows that it was learnt from; 0: from nothing but the vehicle file.
    n_refused
        Number of windows that were inconclusive, had failing sensors or were suspect.
    version, reason
        Number of the learning, from 1, and why it was done.
    residuals
        Reference of the subspace residual test; None: not learnt.
    model_error
        Median of the model error of the windows that it was learnt from, see `CornerFit`.
    taught
        Times of those windows [s].
    """

    vehicle: str
    components: tuple[Component, ...]
    mean: Real
    covariance: Real
    slopes: Real
    middle: dict[str, float]
    ranges: dict[str, tuple[float, float]]
    nuisance: Real
    design: Real
    degrees: float
    n_windows: int
    n_refused: int
    version: int
    reason: str
    residuals: ResidualReference | None = None
    model_error: float = 0.0
    taught: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        size, more = len(self.components), 1 + len(CONDITIONS)
        shapes = {"mean": (size,), "covariance": (size, size), "nuisance": (size, size), "slopes": (size, more - 1)}
        for name, shape in (shapes | {"design": (more, more)}).items():
            values = frozen_array(name, getattr(self, name), ndim=len(shape))
            if values.shape != shape or not np.all(np.isfinite(values)):
                raise ParameterError(f"{name} of a baseline must be {shape} finite numbers: learn it again")
            object.__setattr__(self, name, values)

    @property
    def notes(self) -> tuple[str, ...]:
        """Limits of the baseline, one sentence each."""
        if self.model_error < _IMPERFECT:
            return ()
        return (
            f"the vehicle file is off by {100 * self.model_error:.0f} % on the windows of the baseline, so that small "
            "changes are found late or not at all: check masses, geometry and places of sensors, and add what it "
            "lacks, such as an engine on mounts",
        )

    def accepts(self, observation: Observation) -> bool:
        """Return whether a window can be compared: conclusive, without failing sensors, with the same components.

        What a failing sensor does to a fit is unknown. Where nothing but the vehicle file is known, the file must
        explain the window well, too.
        """
        is_sound = observation.is_conclusive and not observation.sensor_faults
        return is_sound and observation.components == self.components and self.is_trusted_on(observation)

    def is_trusted_on(self, observation: Observation) -> bool:
        """Return whether the baseline was learnt from windows, or the vehicle file explains this one well."""
        return self.n_windows > 0 or observation.conditions.get("model_error", 0.0) <= _TRUSTED

    def residual(self, observation: Observation) -> Real:
        """Return the deviation of a window from what is normal under its conditions, ln values, shape (components,).

        Raises
        ------
        ParameterError
            Where the window has other components.
        """
        if observation.components != self.components:
            raise ParameterError("the window has other components than the baseline: fit the same ones, or learn again")
        return observation.log_ratios - self.mean - self.slopes @ self.units(observation)

    def units(self, observation: Observation) -> Real:
        """Return the conditions of a window in units away from the middle, at most 5, shape (conditions,).

        A condition that is unknown is 0.
        """
        return _units(observation, self.middle)

    def to_dict(self) -> dict[str, Any]:
        """Return the baseline as plain values for JSON."""
        return {
            "schema": SCHEMA,
            "vehicle": self.vehicle,
            "version": self.version,
            "reason": self.reason,
            "n_windows": self.n_windows,
            "n_refused": self.n_refused,
            "model_error": self.model_error,
            "components": list(map(str, self.components)),
            "mean": self.mean.tolist(),
            "covariance": self.covariance.tolist(),
            "nuisance": self.nuisance.tolist(),
            "design": self.design.tolist(),
            "degrees": self.degrees,
            "taught": list(self.taught),
            "conditions": {
                name: {
                    "middle": self.middle.get(name),
                    "range": list(self.ranges[name]) if name in self.ranges else None,
                    "slopes": self.slopes[:, k].tolist(),
                }
                for k, name in enumerate(CONDITIONS)
            },
            "residuals": None if self.residuals is None else self.residuals.to_dict(),
        }


def baseline_from_dict(document: dict[str, Any]) -> Baseline:
    """Return the baseline of plain values.

    Raises
    ------
    ParameterError
        Where the document is not a baseline.
    """
    if document.get("schema") != SCHEMA:
        raise ParameterError(f"the baseline has the schema {document.get('schema')!r}, not {SCHEMA!r}: learn it again")
    try:
        conditions = document["conditions"]
        return Baseline(
            vehicle=str(document["vehicle"]),
            components=tuple(map(Component.parse, document["components"])),
            mean=np.array(document["mean"], dtype=np.float64),
            covariance=np.array(document["covariance"], dtype=np.float64),
            slopes=np.array([conditions[name]["slopes"] for name in CONDITIONS], dtype=np.float64).T,
            middle={name: one["middle"] for name, one in conditions.items() if one["middle"] is not None},
            ranges={name: (one["range"][0], one["range"][1]) for name, one in conditions.items() if one["range"]},
            nuisance=np.array(document["nuisance"], dtype=np.float64),
            design=np.array(document["design"], dtype=np.float64),
            degrees=float(document["degrees"]),
            taught=tuple(map(float, document["taught"])),
            n_windows=int(document["n_windows"]),
            n_refused=int(document["n_refused"]),
            version=int(document["version"]),
            reason=str(document["reason"]),
            model_error=float(document.get("model_error", 0.0)),
            residuals=residual_reference_from_dict(document["residuals"]) if document.get("residuals") else None,
        )
    except (KeyError, TypeError, ValueError, IndexError) as error:
        raise ParameterError(f"the baseline is incomplete or invalid ({error}): learn it again") from None


def learn(
    observations: Iterable[Observation],
    *,
    reason: str = "first learning",
    previous: Baseline | None = None,
    n_windows: int = FEWEST,
) -> Baseline:
    """Learn what is normal for a vehicle.

    Parameters
    ----------
    observations
        Windows of one healthy vehicle over the conditions it meets.
    reason
        Why it is learnt: "first learning", "new dampers" ...
    previous
        Baseline that this one replaces.
    n_windows
        Fewest windows that it is learnt from, at least 2.

    Returns
    -------
    Baseline
        With the reference of the residual test, where three windows or more carry what it needs.

    Raises
    ------
    DataError
        Where too few windows are conclusive and alike.
    ParameterError
        Where the windows are of several vehicles.

    Notes
    -----
    Rows x_w = (1, conditions in units away from their median) and y_w = ln(value / nominal value) of n windows give
    means and slopes by ridge regression: B = (X^T X + L)^-1 X^T Y, with L = diag(0, l, ...) and l the variance of a
    window over that of a slope before any window. The degrees of freedom that remain are n - tr[(X^T X + L)^-1 X^T X].

    The covariance of a window is what windows report on average, widened by the scatter of left against right about the
    fit over what they report (with two windows' worth of the latter); it is never narrowed. The scatter of axles and of
    all corners together is nuisance, see `usual_nuisance`.

    A window is left out where its distance from what the others make normal is beyond the 99.9 % quantile of chance,
    worst first: with m components, d^2 = r^T (S + Q)^-1 r / (1 + x^T (X^T X + L)^-1 x) follows m F(m, degrees), as
    the prediction is Student's.

    References
    ----------
    A. E. Hoerl, R. W. Kennard, Ridge regression: biased estimation for nonorthogonal problems, Technometrics 12 (1970)
    55-67.
    T. Hastie, R. Tibshirani, J. Friedman, The Elements of Statistical Learning, 2nd edition (2009), section 3.4.1
    (degrees of freedom).
    H. Hotelling, The generalization of Student's ratio, Annals of Mathematical Statistics 2 (1931) 360-378.
    A. Gelman et al., Bayesian Data Analysis, 3rd edition (2013), chapter 14 (Student's t prediction).
    """
    check_number("n_windows", n_windows, at_least=2)
    every = list(observations)
    vehicle = vehicle_of(every)
    sound = [observation for observation in every if observation.is_conclusive and not observation.sensor_faults]
    common = [observation for observation in sound if observation.components == sound[0].components]
    while True:
        if len(common) < n_windows:
            raise DataError(
                f"{len(common)} of {len(every)} windows can be learnt from, and {n_windows} are needed: give more "
                f"drives{_commonest_reason(every)}"
            )
        estimate = _Estimate.of(common)
        distances = [estimate.distance(observation) for observation in common]
        worst = int(np.argmax(distances))
        suspect = common[worst]
        others = [*common[:worst], *common[worst + 1 :]]
        if _is_like(suspect, others, chance=_SUSPECT / len(distances)):
            break
        common = others
    return Baseline(
        vehicle=vehicle,
        components=estimate.components,
        mean=estimate.mean,
        covariance=estimate.covariance,
        slopes=estimate.slopes,
        middle=estimate.middle,
        ranges=_ranges(common),
        nuisance=estimate.nuisance,
        design=estimate.design,
        degrees=estimate.degrees,
        n_windows=len(common),
        n_refused=len(every) - len(common),
        version=1 if previous is None else previous.version + 1,
        reason=reason,
        residuals=_residual_reference(common),
        model_error=float(np.median([one.conditions.get("model_error", 0.0) for one in common])),
        taught=tuple(sorted(observation.time for observation in common)),
    )


def vehicle_of(observations: Iterable[Observation]) -> str:
    """Return the name of the vehicle of windows; "" where they carry none.

    Raises
    ------
    ParameterError
        Where the windows are of several vehicles.
    """
    names = sorted({observation.vehicle for observation in observations if observation.vehicle})
    if len(names) > 1:
        raise ParameterError(f"the windows are of the vehicles {', '.join(names)}: give those of one")
    return names[0] if names else ""


def nominal_baseline(components: tuple[Component, ...], *, vehicle: str) -> Baseline:
    """Return the baseline of a vehicle without any window: as its file, left as right, with wide limits.

    Parameters
    ----------
    components
        Springs, dampers and tyres of the windows to compare.
    vehicle
        Name of the vehicle.
    """
    pairs, ends, _ = _directions(components)
    covariance = _UNLIKE**2 * pairs.T @ pairs / 2 + _UNLIKE_ENDS**2 * ends.T @ ends
    size = len(components)
    return Baseline(
        vehicle=vehicle,
        components=components,
        mean=np.zeros(size),
        covariance=covariance + 1e-8 * np.eye(size),
        slopes=np.zeros((size, len(CONDITIONS))),
        middle={},
        ranges={},
        nuisance=usual_nuisance(components, _ENDS),
        design=np.diag([1.0, *([_NO_SLOPE] * len(CONDITIONS))]),
        degrees=_PRIOR_SCATTER * len(pairs),
        n_windows=0,
        n_refused=0,
        version=0,
        reason="the vehicle file only",
    )


def usual_nuisance(components: tuple[Component, ...], ends: dict[str, float]) -> Real:
    """Return the covariance of what moves components together from window to window.

    Parameters
    ----------
    components
        Springs, dampers and tyres.
    ends
        Standard deviation between front and rear of each kind, ln values.

    Returns
    -------
    numpy.ndarray
        Shape (components, components): all of a kind by the same factor, and its axles against each other.
    """
    _, between, together = _directions(components)
    kinds = sorted({component.kind for component in components})
    of_ends = np.array([ends.get(kind, max(ends.values())) for kind in _kinds_of(between, components)])
    of_all = np.array([_COMMON.get(kind, 0.2) for kind in kinds])
    return np.asarray((between.T * of_ends**2) @ between + (together.T * of_all**2) @ together, dtype=np.float64)


def _directions(components: tuple[Component, ...]) -> tuple[Real, Real, Real]:
    """Return rows: left up and right down for each axle and kind; axles against each other; all of a kind."""
    kinds = sorted({component.kind for component in components})
    left = np.array([1.0 if component.side == "left" else -1.0 for component in components])
    pairs, ends, together = [], [], []
    for kind in kinds:
        axles = sorted({component.axle for component in components if component.kind == kind})
        of_axle = [np.array([float((c.axle, c.kind) == (axle, kind)) for c in components]) for axle in axles]
        pairs += [row * left for row in of_axle]
        ends += [of_axle[k] / 2 - of_axle[k + 1] / 2 for k in range(len(axles) - 1)]
        together.append(np.sum(of_axle, axis=0))
    size = len(components)
    first, second, third = (np.array(rows).reshape(-1, size) for rows in (pairs, ends, together))
    return first, second, third


def _kinds_of(rows: Real, components: tuple[Component, ...]) -> list[str]:
    """Return the kind of components that each direction moves."""
    return [components[int(np.flatnonzero(row)[0])].kind for row in rows]


def _units(observation: Observation, middle: dict[str, float]) -> Real:
    """Return conditions in units away from the middle; 0 where unknown."""
    units = []
    for name, unit in CONDITIONS.items():
        value = observation.conditions.get(name)
        if value is None or name not in middle:
            units.append(0.0)
        elif name == "roughness":
            units.append(float(np.log(value / middle[name])) / unit)
        else:
            units.append((value - middle[name]) / unit)
    return np.asarray(np.clip(np.array(units), -5.0, 5.0), dtype=np.float64)


@dataclass(frozen=True, eq=False, slots=True)
class _Estimate:
    """What windows make normal, see `learn` for the equations and `Baseline` for the fields."""

    components: tuple[Component, ...]
    middle: dict[str, float]
    mean: Real
    slopes: Real
    covariance: Real
    nuisance: Real
    design: Real
    degrees: float

    @classmethod
    def of(cls, observations: Sequence[Observation]) -> "_Estimate":
        """Return the estimate from windows with the same components."""
        components = observations[0].components
        middle = {name: float(np.median(values)) for name, values in _conditions_met(observations).items()}
        values = np.array([observation.log_ratios for observation in observations])
        reported = np.mean([observation.covariance for observation in observations], axis=0)
        rows = np.array([np.concatenate([[1.0], _units(observation, middle)]) for observation in observations])
        penalty = float(np.diag(reported).mean()) / _SLOPE**2
        design = rows.T @ rows + np.diag([0.0, *([penalty] * (rows.shape[1] - 1))])
        coefficients = np.linalg.solve(design, rows.T @ values)
        scatter = values - rows @ coefficients
        free = max(len(values) - float(np.trace(np.linalg.solve(design, rows.T @ rows))), 1.0)
        pairs, _, _ = _directions(components)
        inflation = _inflation(scatter @ pairs.T, np.diag(pairs @ reported @ pairs.T), free)
        ends = _scatter_of_ends(scatter, inflation * reported, components, free)
        return cls(
            components=components,
            middle=middle,
            mean=coefficients[0],
            slopes=coefficients[1:].T,
            covariance=inflation * reported,
            nuisance=usual_nuisance(components, ends),
            design=design,
            degrees=len(pairs) * (free + _PRIOR_SCATTER),
        )

    def distance(self, observation: Observation) -> float:
        """Return the squared Mahalanobis distance of a window from the prediction for its conditions."""
        units = _units(observation, self.middle)
        away = observation.log_ratios - self.mean - self.slopes @ units
        row = np.concatenate([[1.0], units])
        doubt = 1 + row @ np.linalg.solve(self.design, row)
        return float(away @ np.linalg.solve(self.covariance + self.nuisance, away) / doubt)


def _inflation(contrasts: Real, variances: Real, free: float) -> float:
    """Return the variance of left against right over that which windows report, at least 1; (windows, pairs)."""
    own = float(np.sum(contrasts**2 / variances)) / contrasts.shape[1]
    return max(1.0, (own + _PRIOR_SCATTER) / (free + _PRIOR_SCATTER))


def _scatter_of_ends(
    scatter: Real, covariance: Real, components: tuple[Component, ...], free: float
) -> dict[str, float]:
    """Return the standard deviation of front against rear by kind: the vehicle's own beyond chance, and the usual one.

    The vehicle's own counts for its degrees of freedom, the usual one for eight windows.
    """
    _, ends, _ = _directions(components)
    kinds = sorted({component.kind for component in components})
    share = free / (free + _PRIOR_WINDOWS)
    usual = {kind: _ENDS.get(kind, 0.02) for kind in kinds}
    kinds_of_ends = np.array(_kinds_of(ends, components))
    for kind in kinds:
        rows = ends[kinds_of_ends == kind]
        if not len(rows):
            continue
        own = float(np.mean(np.sum((scatter @ rows.T) ** 2, axis=0))) / free
        chance = float(np.mean(np.diag(rows @ covariance @ rows.T)))
        usual[kind] = float(np.sqrt(share * max(0.0, own - chance) + (1 - share) * usual[kind] ** 2))
    return usual


def _is_like(observation: Observation, others: Sequence[Observation], *, chance: float) -> bool:
    """Return whether a window is within what others make normal but for a chance."""
    estimate = _Estimate.of(others)
    size = len(estimate.components)
    return estimate.distance(observation) <= size * stats.f.isf(chance, size, estimate.degrees)


def _conditions_met(observations: Sequence[Observation]) -> dict[str, list[float]]:
    """Return the values of each condition that is known."""
    met = {name: [one.conditions[name] for one in observations if name in one.conditions] for name in CONDITIONS}
    return {name: values for name, values in met.items() if values}


def _ranges(observations: Sequence[Observation]) -> dict[str, tuple[float, float]]:
    return {name: (min(values), max(values)) for name, values in _conditions_met(observations).items()}


def _residual_reference(observations: Sequence[Observation]) -> ResidualReference | None:
    """Return the reference of the residual test from the windows with the first one's channels; None from too few."""
    known = [one.residuals for one in observations if one.residuals is not None and one.residuals.segments is not None]
    alike = [statistics for statistics in known if statistics.is_like(known[0])]
    return learn_reference(alike) if len(alike) >= FEWEST_RESIDUALS else None


def _commonest_reason(observations: Sequence[Observation]) -> str:
    """Return the commonest reason why windows cannot be learnt from, in brackets."""
    reasons = [
        one.reason or f"{one.sensor_faults[0].channel} is {one.sensor_faults[0].kind}"
        for one in observations
        if not one.is_conclusive or one.sensor_faults
    ]
    return f" ({max(set(reasons), key=reasons.count)})" if reasons else ""
