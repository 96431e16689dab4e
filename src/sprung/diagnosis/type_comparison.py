"""A vehicle, or each vehicle of a fleet, against its type."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from sprung._arrays import Indices, Real
from sprung._checks import check_each, check_number, check_type
from sprung.diagnosis.baseline import Baseline, slope_covariances
from sprung.diagnosis.changes import Candidate, Detection, Size, detect, false_discoveries
from sprung.diagnosis.detectability import POWER, losses
from sprung.diagnosis.hypotheses import Hypothesis, hypotheses_of, log_prior
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.scatter import FRONT_REAR_STD, directions, kinds_of, typical_nuisance
from sprung.diagnosis.type_baselines import (
    MIN_VEHICLES,
    Fleet,
    TypeBaseline,
    has_temperature,
    usable_windows,
)
from sprung.diagnosis.type_baselines import (
    SETTINGS as OF_TYPES,
)
from sprung.errors import DataError
from sprung.modal import INTERVAL_95
from sprung.vehicles import Component


@dataclass(frozen=True, slots=True)
class TypeTest:
    """Settings of the comparison with a type."""

    #: Size that the tests are most powerful for, a loss of 20 % [ln], and share of losses among changes.
    size: float = float(-np.log(0.8))
    losses: float = 0.9
    #: Share of unmodelled deviations in the probability of a false alarm.
    unmodelled: float = 0.05
    #: Correlation above which two hypotheses are the same test.
    same: float = 0.9
    #: Largest loss that is sought as the smallest detectable one [ln], and number of times that its range is halved.
    largest: float = 3.0
    halvings: int = 10
    #: Widening of the deviations between vehicles where changes are sought between the windows of one vehicle.
    wide: float = 3.0


TEST = TypeTest()


def compare_with_type(
    observations: Iterable[Observation],
    type_baseline: TypeBaseline,
    *,
    false_alarms: float = 1e-3,
    windows_per_day: float = 48.0,
) -> Detection | None:
    """Compare the windows of a vehicle that has no baseline of its own with its type.

    Parameters
    ----------
    observations
        Windows of one vehicle in the order of time.
    type_baseline
        Baseline of the type, or `nominal_type`: production scatter.
    false_alarms
        Probability that a healthy vehicle raises an alert at first, and rate of false alarms per day afterwards; above
        0.
    windows_per_day
        Windows in a day of driving, above 0.

    Returns
    -------
    Detection or None
        Deviation from the type, or where there is none a change between the windows; None where no window can be
        compared.

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

    The evidence after each window is that of all windows up to it, so that the cost grows with the square of their
    number. A change between the windows is sought by a `ChangeDetector` with wide limits on the vehicle's mean.

    References
    ----------
    K. Roeder, L. Wasserman, Genome-wide significance levels and weighted hypothesis testing, Statistical Science 24
    (2009) 398-413 (section 3).

    Examples
    --------
    Six windows of a vehicle with a front-left spring that has lost 30 % of its stiffness, against the vehicle file:

    >>> import numpy as np
    >>> import sprung
    >>> from sprung.diagnosis import nominal_type
    >>> parts = tuple(sprung.structure(sprung.read_vehicle("zafira")).components())
    >>> values = 0.02 * np.random.default_rng(1).standard_normal((6, 12))
    >>> values[:, 0] += np.log(0.7)
    >>> C = 0.02**2 * np.eye(12)
    >>> windows = [sprung.Observation(600.0 * k, parts, x, C, {}, {}, ()) for k, x in enumerate(values)]
    >>> detection = compare_with_type(windows, nominal_type(parts, name="zafira"))
    >>> detection.is_alert, detection.candidates[0].hypothesis.name
    (True, 'front_left.spring')
    """
    check_type("type_baseline", type_baseline, TypeBaseline)
    check_number("false_alarms", false_alarms, above=0)
    check_number("windows_per_day", windows_per_day, above=0)
    every = tuple(check_each("observations", observations, Observation))
    threshold = float(-np.log(min(false_alarms, 1.0)))
    compared = _comparable(type_baseline, every)
    if not compared:
        return None
    counts = range(1, len(compared) + 1)
    evidence = np.array([_against_type(type_baseline, compared[:count])[0] for count in counts])
    deviation = _deviation(type_baseline, compared, evidence, threshold)
    if deviation.is_alert:
        return deviation
    wide = type_baseline.baseline(every, widening=TEST.wide)
    detection = detect(wide, every, false_alarms=false_alarms, windows_per_day=windows_per_day)
    return detection if detection is not None and detection.is_alert else deviation


def _comparable(of_type: TypeBaseline, windows: Sequence[Observation]) -> list[Observation]:
    """Return the windows that can be compared; none where a vehicle file explains most of them poorly."""
    alike = [
        window
        for window in windows
        if window.is_conclusive and not window.sensor_faults and window.components == of_type.components
    ]
    if not alike:
        return []
    accepts = of_type.baseline(alike).accepts
    compared = [window for window in alike if accepts(window)]
    return compared if 2 * len(compared) > len(alike) else []


def _deviation(of_type: TypeBaseline, windows: Sequence[Observation], evidence: Real, threshold: float) -> Detection:
    """Return the deviation of windows from a type; times and evidence of the last ones, which may be fewer."""
    times = np.array([window.time for window in windows[-len(evidence) :]])
    last, candidates = _against_type(of_type, windows)
    above = np.flatnonzero(evidence >= threshold)
    first = float(times[above[0]]) if above.size else None
    return Detection(times, evidence, last, threshold, candidates, first, _detectable(of_type, windows, threshold))


@dataclass(frozen=True, slots=True)
class RankedVehicle:
    """A vehicle of a fleet against its baseline, or against its type.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    detection
        Evidence that it has changed, or deviates from the others, and what.
    is_discovery
        Whether it is among the vehicles that have changed or deviate, see `rank_fleet`.
    n_windows
        Number of windows compared.
    """

    vehicle: str
    detection: Detection
    is_discovery: bool
    n_windows: int


def rank_fleet(
    windows: Mapping[str, Iterable[Observation]],
    *,
    baselines: Mapping[str, Baseline] | None = None,
    rate: float = 0.05,
) -> tuple[RankedVehicle, ...]:
    """Rank the vehicles of a type by the evidence that each has changed, or deviates from the others.

    Parameters
    ----------
    windows
        Windows of each vehicle, by its name.
    baselines
        Baselines of those vehicles that have one: they are compared with themselves, the others with their type.
    rate
        Expected share of healthy vehicles among the discoveries, above 0 and up to 1.

    Returns
    -------
    tuple of RankedVehicle
        Vehicles whose windows can be compared, those with the strongest evidence first. Vehicles without a baseline are
        left out where fewer than five vehicles have usable windows.

    Raises
    ------
    DataError
        If no vehicle can be compared.
    ParameterError
        If the rate is not above 0 and at most 1.

    Notes
    -----
    The evidence is that of the diagnosis of each vehicle: the e-value e of its change test, or -ln p of the comparison
    with the type of the others, as by `compare_with_type`. As 1 / e is a p-value, `false_discoveries` of all of them is
    the procedure of Benjamini and Hochberg, which holds for independent vehicles; where all have a baseline it is that
    of e-values, which holds under any dependence. A run over an archive (`sprung fleet run`) chooses in the same way.

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
    check_type("windows", windows, Mapping, advice="{'bus-17': sprung.observe(recordings, vehicle), ..}")
    baselines, every = baselines or {}, {vehicle: tuple(own) for vehicle, own in windows.items()}
    found = {vehicle: detect(baselines[vehicle], own) for vehicle, own in every.items() if vehicle in baselines}
    detections = {vehicle: detection for vehicle, detection in found.items() if detection is not None}
    # Estimates of a vehicle whose file a calibration completed are relative to that file.
    usable = usable_windows(
        {
            vehicle: own
            for vehicle, own in every.items()
            if vehicle not in baselines or not baselines[vehicle].vehicle_file
        }
    )
    if len(usable) > MIN_VEHICLES:
        fleet, threshold = Fleet.of(usable), float(-np.log(rate))
        for vehicle in (vehicle for vehicle in usable if vehicle not in baselines):
            of_type = fleet.type_of((other for other in usable if other != vehicle), name="")
            evidence = np.array([_against_type(of_type, usable[vehicle])[0]])
            detection = _deviation(of_type, usable[vehicle], evidence, threshold)
            detections[vehicle] = replace(detection, first_alert=None)
    if not detections:
        raise DataError(
            f"{len(usable)} vehicles have usable windows, and {MIN_VEHICLES + 1} are needed: give more vehicles"
        )
    chosen = false_discoveries([detection.e_value for detection in detections.values()], rate=rate)
    ranked = [
        RankedVehicle(vehicle, detection, number in chosen, len(usable.get(vehicle, detection.times)))
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
        degrees = of_type.n_vehicles + OF_TYPES.production if of_type.n_vehicles else np.inf
        rows = np.array([hypothesis.direction(of_type.components) for hypothesis in parts])
        inverse = np.linalg.inv(of_type.single_vehicle_covariance + covariance)
        likeness = rows @ inverse @ rows.T
        stds = 1 / np.sqrt(np.diag(likeness))
        return cls(
            parts,
            rows,
            np.asarray(inverse, dtype=np.float64),
            log_prior(parts),
            degrees,
            stds,
            _distinct(likeness * np.outer(stds, stds)),
        )

    def sizes(self, residuals: Real) -> Real:
        """Return the size of each hypothesis in residuals of shape (..., components), ln values."""
        return np.asarray(self.stds**2 * (residuals @ self.inverse @ self.rows.T), dtype=np.float64)

    def evidence(self, residuals: Real) -> Real:
        """Return -ln p of each hypothesis in residuals of shape (..., components)."""
        return np.asarray(-np.log(self._tails(self.sizes(residuals) / self.stds)), dtype=np.float64)

    def _tails(self, z: Real) -> Real:
        """Return the probability of evidence as strong as that of each hypothesis, from any of them."""
        deltas = np.tile(TEST.size / self.stds, 2)
        of_signs = np.concatenate([self.shares + np.log(TEST.losses), self.shares + np.log(1 - TEST.losses)])
        both = np.concatenate([-z, z], axis=-1) * deltas - deltas**2 / 2 + of_signs
        strength = both.reshape(*z.shape[:-1], 2, -1).max(axis=-2)
        deltas, of_signs = deltas[self.distinct], of_signs[self.distinct]
        limits = deltas / 2 + (strength[..., None] - of_signs) / deltas
        tails = stats.norm.sf(limits) if np.isinf(self.degrees) else stats.t.sf(limits, self.degrees)
        return np.asarray(np.clip(tails.sum(axis=-1) / (1 - TEST.unmodelled), 1e-300, 1.0), dtype=np.float64)


def _distinct(cosines: Real) -> Indices:
    """Return the signed hypotheses, losses first, that are no test nearly the same as an earlier one."""
    signs = np.repeat([-1.0, 1.0], len(cosines))
    alike = np.outer(signs, signs) * np.tile(cosines, (2, 2))
    distinct: list[int] = []
    for number in range(len(signs)):
        if not np.any(alike[number, distinct] > TEST.same):
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
    unmodelled = float(-np.log(np.clip(rest / TEST.unmodelled, 1e-300, 1.0)))
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
    low, high = np.zeros(count), np.full(count, TEST.largest)
    for _ in range(TEST.halvings):
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
    if not (of_type.has_temperature and has_temperature(windows)):
        no_ends = dict.fromkeys(kinds_of(ends, baseline.components), 0.0)
        covariance = covariance + typical_nuisance(baseline.components, no_ends or FRONT_REAR_STD)
    for beyond, slope in zip(
        _extrapolation(of_type, baseline, windows), slope_covariances(baseline.components), strict=True
    ):
        covariance = covariance + beyond**2 * slope
    return away.mean(axis=0), np.asarray(covariance, dtype=np.float64)


def _extrapolation(of_type: TypeBaseline, baseline: Baseline, windows: Sequence[Observation]) -> Real:
    """Return how far the mean conditions of windows are beyond those of the type, in units, shape (conditions,)."""
    ends = [
        baseline.units(replace(windows[0], conditions={name: end[side] for name, end in of_type.ranges.items()}))
        for side in (0, 1)
    ]
    units = np.mean([baseline.units(window) for window in windows], axis=0)
    return np.asarray(units - np.clip(units, *ends), dtype=np.float64)
