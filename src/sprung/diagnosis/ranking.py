"""The vehicles of a fleet, ranked by the evidence that each has changed, or deviates from the others."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass

import numpy as np

from sprung._checks import check_number, check_type
from sprung.diagnosis.baseline import Baseline
from sprung.diagnosis.changes import Detection, detect, false_discoveries
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.type_baselines import MIN_VEHICLES
from sprung.diagnosis.type_comparison import TypeComparison
from sprung.diagnosis.type_learning import Fleet, usable_windows
from sprung.errors import DataError


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
    known, every = baselines or {}, {vehicle: tuple(own) for vehicle, own in windows.items()}
    found = {vehicle: detect(known[vehicle], own) for vehicle, own in every.items() if vehicle in known}
    detections = {vehicle: detection for vehicle, detection in found.items() if detection is not None}
    # Estimates of a vehicle whose file a calibration completed are relative to that file.
    completed = {vehicle for vehicle, baseline in known.items() if baseline.vehicle_file}
    usable = usable_windows({vehicle: own for vehicle, own in every.items() if vehicle not in completed})
    if len(usable) > MIN_VEHICLES:
        fleet = Fleet.of(usable)
        for vehicle in (vehicle for vehicle in usable if vehicle not in known):
            of_others = fleet.type_of((other for other in usable if other != vehicle), name="")
            comparison = TypeComparison.of(of_others, usable[vehicle])
            detections[vehicle] = comparison.detection(
                times=np.array([usable[vehicle][-1].time]),
                evidence=np.array([comparison.candidates()[0].log_evidence]),
                threshold=float(-np.log(rate)),
            )
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
