"""What is normal for one vehicle: the mean of its corners, how they scatter, and how they follow conditions."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy import stats

from sprung._arrays import Real
from sprung._checks import check_number, frozen_array
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.residuals import ResidualReference, residual_reference_from_dict
from sprung.errors import DataError, ParameterError
from sprung.vehicles import Component

SCHEMA = "sprung.baseline/1"
#: Fewest windows that teach.
FEWEST = 6
#: Conditions that contrasts may follow, what is one unit of each, and how much a unit usually changes ln values.
CONDITIONS = {"payload": 100.0, "level": 1.4, "speed": 5.0}
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
#: Misfit of the windows from which on the vehicle file is remarked on.
_IMPERFECT = 0.25
#: Standard deviations of a new vehicle about its file: left against right, front against rear.
_UNLIKE, _UNLIKE_ENDS = 0.04, 0.15


@dataclass(frozen=True, eq=False, slots=True)
class Baseline:
    """What is normal for one vehicle.

    Parameters
    ----------
    vehicle
        Name in its file.
    components
        The springs, dampers and tyres of its windows.
    mean
        Of ln(value / nominal value), shape (components,), in the middle of the conditions.
    covariance
        Of one window about that, without what moves all corners or both of an axle together.
    slopes
        Change of the mean with each of `CONDITIONS`, shape (components, conditions).
    middle
        Of the conditions met.
    ranges
        Lowest and highest of the conditions met.
    nuisance
        Covariance of what moves components together from window to window (payload, temperature, road).
    design
        Information of the windows about mean and slopes, for a covariance of one, shape (1 + conditions, same).
    degrees
        Of freedom in what `covariance` says of the scatter of windows.
    n_windows
        That taught it; 0: nothing but the vehicle file.
    n_refused
        Windows that could not tell or were suspect.
    version, reason
        Counts up with every new learning, and why it was learnt.
    residuals
        Reference of the subspace residual test; None: not learnt.
    model_error
        By how much the vehicle file is off on the windows that taught it, in the median, see `CornerFit`.
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
        """What a reader should know, one sentence each."""
        if self.model_error < _IMPERFECT:
            return ()
        return (
            f"the vehicle file is off by {100 * self.model_error:.0f} % on the windows that taught the baseline, so "
            "that small changes are found late or not at all: check masses, geometry and places of sensors, and add "
            "what it lacks, such as an engine on mounts",
        )

    def residual(self, observation: Observation) -> Real:
        """Return how far a window is from what its conditions make normal."""
        if observation.components != self.components:
            raise ParameterError("the window has other components than the baseline: fit the same ones, or learn again")
        return observation.log_ratios - self.mean - self.slopes @ self.units(observation)

    def units(self, observation: Observation) -> Real:
        """Return the conditions of a window as units away from the middle; 0 where unknown."""
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
        Where the document is no baseline.
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
        raise ParameterError(f"the baseline lacks or garbles {error}: learn it again") from None


def learn(
    observations: Sequence[Observation],
    *,
    vehicle: str,
    reason: str = "first learning",
    previous: Baseline | None = None,
    n_windows: int = FEWEST,
) -> Baseline:
    """Learn what is normal.

    Parameters
    ----------
    observations
        Windows of a healthy vehicle over the conditions it meets.
    vehicle
        Its name.
    reason
        Why: "first learning", "new dampers" ...
    previous
        The baseline that this one replaces.
    n_windows
        Fewest windows that teach.

    Raises
    ------
    DataError
        Where too few windows can teach.

    Notes
    -----
    Means, and slopes over the conditions with a prior about 0, by ridge regression. Windows beyond the 99.9 % quantile
    of chance about the others are left out, worst first. The scatter of left against right about the fit widens
    what the windows report (two windows' worth of what they report beside it).
    """
    check_number("n_windows", n_windows, at_least=2)
    telling = [one for one in observations if one.is_conclusive and not one.sensor_faults]
    common = [one for one in telling if one.components == telling[0].components]
    while True:
        if len(common) < n_windows:
            raise DataError(
                f"{len(common)} of {len(observations)} windows can teach a baseline, and {n_windows} are needed: "
                f"give more drives{_why_not(observations)}"
            )
        found = _taught(common, vehicle, reason, previous, len(observations))
        distances = np.array([_distance(found, one) for one in common])
        worst = int(np.argmax(distances))
        one = common.pop(worst)
        others = _taught(common, vehicle, reason, previous, len(observations))
        size = len(others.components)
        if _distance(others, one) <= size * stats.f.isf(_SUSPECT / len(distances), size, others.degrees):
            return found


def nominal_baseline(components: tuple[Component, ...], *, vehicle: str) -> Baseline:
    """Return the baseline of a vehicle that taught nothing: like its file, left like right, with wide limits."""
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
        reason="nothing but the vehicle file",
    )


def usual_nuisance(components: tuple[Component, ...], ends: dict[str, float]) -> Real:
    """Return the covariance of what moves components together from window to window."""
    _, between, together = _directions(components)
    kinds = sorted({component.kind for component in components})
    of_ends = np.array(
        [ends.get(kind, max(ends.values())) for kind in kinds for _ in range(len(between) // len(kinds))]
    )
    of_all = np.array([_COMMON.get(kind, 0.2) for kind in kinds])
    return np.asarray((between.T * of_ends**2) @ between + (together.T * of_all**2) @ together, dtype=np.float64)


def _directions(components: tuple[Component, ...]) -> tuple[Real, Real, Real]:
    """Return rows: left up and right down for each axle and kind; axles against each other; all of a kind."""
    kinds = sorted({component.kind for component in components})
    pairs, ends, together = [], [], []
    for kind in kinds:
        axles = sorted({component.axle for component in components if component.kind == kind})
        of_axle = [np.array([float((c.axle, c.kind) == (axle, kind)) for c in components]) for axle in axles]
        left = np.array([1.0 if component.side == "left" else -1.0 for component in components])
        pairs += [row * left for row in of_axle]
        ends += [of_axle[k] / 2 - of_axle[k + 1] / 2 for k in range(len(axles) - 1)]
        together.append(np.sum(of_axle, axis=0))
    size = len(components)
    return tuple(np.array(rows).reshape(-1, size) for rows in (pairs, ends, together))  # type: ignore[return-value]


def _units(observation: Observation, middle: dict[str, float]) -> Real:
    """Return conditions as units away from the middle; 0 where unknown."""
    found = []
    for name, unit in CONDITIONS.items():
        value = observation.conditions.get(name)
        if value is None or name not in middle:
            found.append(0.0)
        elif name == "level":
            found.append(float(np.log(value / middle[name])) / unit)
        else:
            found.append((value - middle[name]) / unit)
    return np.asarray(np.clip(np.array(found), -5.0, 5.0), dtype=np.float64)


def _taught(
    observations: Sequence[Observation], vehicle: str, reason: str, previous: Baseline | None, n_all: int
) -> Baseline:
    """Return the baseline that windows teach, whatever they are."""
    components = observations[0].components
    met = {name: [one.conditions[name] for one in observations if name in one.conditions] for name in CONDITIONS}
    middle = {name: float(np.median(values)) for name, values in met.items() if values}
    values = np.array([one.log_ratios for one in observations])
    units = np.array([_units(one, middle) for one in observations])
    reported = np.mean([one.covariance for one in observations], axis=0)
    rows = np.column_stack([np.ones(len(units)), units])
    design = rows.T @ rows + np.diag([0.0, *([np.diag(reported).mean() / _SLOPE**2] * units.shape[1])])
    mean, *slopes = np.linalg.solve(design, rows.T @ values)
    scatter = values - mean - units @ np.array(slopes)
    pairs, ends, _ = _directions(components)
    free = max(len(values) - float(np.trace(np.linalg.solve(design, rows.T @ rows))), 1.0)
    variances = np.diag(pairs @ reported @ pairs.T)
    own = float(np.sum((scatter @ pairs.T) ** 2 / variances)) / len(pairs)
    inflation = max(1.0, (own + _PRIOR_SCATTER) / (free + _PRIOR_SCATTER))
    kinds = sorted({component.kind for component in components})
    per_kind = len(ends) // max(len(kinds), 1)
    usual = {}
    for k, kind in enumerate(kinds):
        usual[kind] = _ENDS.get(kind, 0.02)
        if per_kind:
            these = ends[k * per_kind : (k + 1) * per_kind]
            own = float(np.mean(np.sum((scatter @ these.T) ** 2, axis=0))) / free
            chance = inflation * np.mean(np.diag(these @ reported @ these.T))
            extra = max(0.0, float(own - chance))
            share = free / (free + _PRIOR_WINDOWS)
            usual[kind] = float(np.sqrt(share * extra + (1 - share) * usual[kind] ** 2))
    return Baseline(
        vehicle=vehicle,
        components=components,
        mean=mean,
        covariance=inflation * reported,
        slopes=np.array(slopes).T,
        middle=middle,
        ranges={name: (min(values_), max(values_)) for name, values_ in met.items() if values_},
        nuisance=usual_nuisance(components, usual),
        design=design,
        degrees=len(pairs) * (free + _PRIOR_SCATTER),
        n_windows=len(observations),
        n_refused=n_all - len(observations),
        version=1 if previous is None else previous.version + 1,
        reason=reason,
        model_error=float(np.median([one.conditions.get("model_error", 0.0) for one in observations])),
        taught=tuple(sorted(one.time for one in observations)),
    )


def _distance(baseline: Baseline, observation: Observation) -> float:
    """Return the squared Mahalanobis distance of a window from what others make normal."""
    away = baseline.residual(observation)
    u = np.concatenate([[1.0], baseline.units(observation)])
    doubt = 1 + u @ np.linalg.solve(baseline.design, u)
    return float(away @ np.linalg.solve(baseline.covariance + baseline.nuisance, away) / doubt)


def _why_not(observations: Sequence[Observation]) -> str:
    """Return the commonest reason why windows cannot teach, in brackets."""
    reasons = [
        one.reason or f"{one.sensor_faults[0].channel} is {one.sensor_faults[0].kind}"
        for one in observations
        if not one.is_conclusive or one.sensor_faults
    ]
    if not reasons:
        return ""
    return f" ({max(set(reasons), key=reasons.count)})"
