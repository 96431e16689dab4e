"""What a kit of sensors will see on a vehicle, before it is bought."""

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import product
from typing import TYPE_CHECKING

import numpy as np

from sprung._arrays import Real
from sprung._checks import check_number, check_one_of
from sprung.calibration.data_sheet import accelerometer, gyroscope
from sprung.errors import ParameterError
from sprung.likelihood.expected import ExpectedDrive, ExpectedFit, expected_fit
from sprung.vehicles import Component, Sensor, Vehicle, check_on_axles

if TYPE_CHECKING:
    from sprung.diagnosis.baseline import Baseline

__all__ = ["KitPlan", "PlannedComponent", "PlannedSensor", "best_places", "candidates", "kit_of", "plan"]

#: Names of the usual kits.
KITS = ("four", "three", "two", "imu")
#: Relative changes for which the time to a finding is stated.
CHANGES = (0.05, 0.1, 0.2)


@dataclass(frozen=True, slots=True)
class PlanSettings:
    """Settings of the time to a finding."""

    #: Numbers of windows that are tried; a change that needs more is not found in a useful time.
    n_windows: tuple[int, ...] = (1, 2, 3, 4, 6, 8, 12, 16, 24, 32, 48, 64)
    #: Probability that a change is found within the time stated: its median.
    power: float = 0.5
    #: Standard deviation above which precision differs over the scatter of estimates, and pairs of them for its mean.
    weak: float = 0.1
    n_pairs: int = 4


PLAN = PlanSettings()


@dataclass(frozen=True, slots=True)
class PlannedComponent:
    """What a kit will see of one component.

    Parameters
    ----------
    component
        Spring, damper or tyre.
    std
        Expected standard deviation of its value from one window, relative.
    contrast_std
        The same of its ratio to the other side of the axle; None where there is no other side.
    axle_std
        The same of the ratio of its axle, both sides, to the others; None where there is no other.
    minutes
        Median driving time until each change of `CHANGES` is found and named [min]; None: not within 64 windows.
    is_identifiable
        Whether the drives determine it.
    """

    component: Component
    std: float
    contrast_std: float | None
    axle_std: float | None
    minutes: dict[float, float | None]
    is_identifiable: bool


@dataclass(frozen=True, slots=True)
class PlannedSensor:
    """What one sensor of a kit contributes.

    Parameters
    ----------
    channel
        Name of its channel.
    gain
        Share by which it reduces the standard deviations, geometric mean over the components; nearly 0 for a sensor
        that repeats what the others measure, which buys the check of the sensors and no precision.
    """

    channel: str
    gain: float


@dataclass(frozen=True, slots=True)
class KitPlan:
    """What a kit will see.

    Parameters
    ----------
    vehicle
        Vehicle with the sensors of the kit.
    drive
        Conditions of a window.
    components, sensors
        Precision of each component, and contribution of each sensor.
    notes
        Limits, one sentence each.
    """

    vehicle: Vehicle
    drive: ExpectedDrive
    components: tuple[PlannedComponent, ...]
    sensors: tuple[PlannedSensor, ...]
    notes: tuple[str, ...]


def kit_of(vehicle: Vehicle, name: str) -> Vehicle:
    """Return a vehicle with the sensors of a kit.

    Parameters
    ----------
    vehicle
        Vehicle with a body on axles.
    name
        "four" accelerometers above the wheels of the first and last axle, "three" (without the last one), "two" (front
        left and rear right), or "imu": vertical acceleration, pitch and roll rate at the centre of gravity.

    Raises
    ------
    ParameterError
        If there is no such kit.
    """
    check_on_axles(vehicle, "a plan of sensors")
    check_one_of("kit", name, KITS)
    if name == "imu":
        rates = [("pitch_rate", (0.0, 1.0, 0.0)), ("roll_rate", (1.0, 0.0, 0.0))]
        upright = accelerometer("acc_z", 0.0, 0.0)
        sensors = [upright, *(gyroscope(channel, direction) for channel, direction in rates)]
    else:
        corners = [
            accelerometer(f"acc_{end}{side}", axle.x, sign * axle.half_track)
            for (end, axle), (side, sign) in product(
                (("f", vehicle.axle[0]), ("r", vehicle.axle[-1])), (("l", 1.0), ("r", -1.0))
            )
        ]
        sensors = {"four": corners, "three": corners[:3], "two": [corners[0], corners[3]]}[name]
    return vehicle.model_copy(update={"sensor": tuple(sensors)})


def plan(vehicle: Vehicle, *, drive: ExpectedDrive | None = None, false_alarms: float = 1e-3) -> KitPlan:
    """Return what the sensors of a vehicle will see of its suspension.

    Parameters
    ----------
    vehicle
        Vehicle with the planned sensors, such as `kit_of(vehicle, "three")`.
    drive
        Conditions of a window; None: ten minutes at 8 to 25 m/s on a road of class B.
    false_alarms
        Rate of false alarms of a healthy vehicle, per day; above 0.

    Returns
    -------
    KitPlan

    Raises
    ------
    ParameterError
        If the vehicle has no sensors of its motion, or a number is out of range.

    Notes
    -----
    Standard deviations are those of the Fisher information of the likelihood that the fit uses (`expected_fit`), where
    one is above 10 % their mean over the scatter of estimates. The time to a finding is the number of windows after
    which the change test, with a baseline of twelve such windows at one temperature and under the same conditions,
    reaches its threshold in half of the cases (`detectable`). Friction, temperature and loads that the baseline has not
    met add to both on a real vehicle.

    References
    ----------
    A. Mendler, M. Döhler, C. E. Ventura, A reliability-based approach to determine the minimum detectable damage for
    statistical damage detection, Mechanical Systems and Signal Processing 154 (2021) 107561.

    Examples
    --------
    One of four accelerometers above the wheels repeats what the other three measure of a rigid body:

    >>> from sprung.vehicles import read_vehicle
    >>> four = plan(kit_of(read_vehicle("zafira"), "four"))
    >>> all(sensor.gain < 0.1 for sensor in four.sensors), all(part.is_identifiable for part in four.components)
    (True, True)
    """
    check_on_axles(vehicle, "a plan of sensors")
    check_number("false_alarms", false_alarms, above=0)
    drive = drive or ExpectedDrive()
    expected = expected_fit(vehicle, drive)
    if max(expected.std.values()) > PLAN.weak:
        expected = expected_fit(vehicle, drive, n_pairs=PLAN.n_pairs)
    contrasts, axles, identifiable = expected.contrast_std, expected.axle_std, expected.is_identifiable
    minutes = _minutes(expected, drive, false_alarms)
    components = tuple(
        PlannedComponent(part, std, contrasts.get(part), axles.get(part), minutes[part], identifiable[part])
        for part, std in expected.std.items()
    )
    return KitPlan(vehicle, drive, components, _sensors(vehicle, drive, expected), _notes(components))


def _minutes(
    expected: ExpectedFit, drive: ExpectedDrive, false_alarms: float
) -> dict[Component, dict[float, float | None]]:
    """Return the median time to a finding of each component and change [min]."""
    from sprung.diagnosis.detectability import detectable

    baseline = _expected_baseline(expected)
    per_day = 24 * 60 / drive.minutes
    losses = [
        detectable(baseline, n_windows=n, false_alarms=false_alarms, windows_per_day=per_day, power=PLAN.power)
        for n in PLAN.n_windows
    ]
    return {
        part: {change: _time([loss[part] for loss in losses], change, drive.minutes) for change in CHANGES}
        for part in expected.components
    }


def _time(losses: Sequence[float], change: float, minutes: float) -> float | None:
    """Return the time after which a change is found, given the smallest one after each number of windows."""
    if min(losses) > change:
        return None
    logs = np.log(np.minimum.accumulate(losses)[::-1])
    windows = np.exp(np.interp(np.log(change), logs, np.log(PLAN.n_windows)[::-1]))
    return float(minutes * max(1.0, windows))


def _expected_baseline(expected: ExpectedFit) -> "Baseline":
    """Return the baseline of windows of the expected precision, at one temperature and in the same conditions."""
    from sprung.diagnosis.baseline import CONDITIONS, Baseline, prior_information
    from sprung.diagnosis.learning import LEARNING_WINDOWS
    from sprung.diagnosis.scatter import Scatter

    components, size = expected.components, len(expected.components)
    scatter = Scatter.typical(components, expected.covariance, with_temperature=True)
    seen = np.zeros((1 + len(CONDITIONS),) * 2)
    seen[0, 0] = LEARNING_WINDOWS
    information = np.kron(seen, np.linalg.inv(scatter.whole)) + prior_information(components, np.zeros((size, size)))
    return Baseline(
        vehicle="",
        components=components,
        mean=np.zeros(size),
        covariance=scatter.covariance,
        reported=expected.covariance,
        slopes=np.zeros((size, len(CONDITIONS))),
        centre={},
        ranges={},
        nuisance=scatter.nuisance,
        information=information,
        degrees_of_freedom=float(LEARNING_WINDOWS - 1),
        n_windows=LEARNING_WINDOWS,
        n_refused=0,
        version=1,
        reason="planned",
    )


def _sensors(vehicle: Vehicle, drive: ExpectedDrive, expected: ExpectedFit) -> tuple[PlannedSensor, ...]:
    """Return the contribution of each sensor; of a mix of roads, on their mean, as it differs little between roads."""
    mean = drive.on_mean_road
    precision = _precision(expected if len(drive.roads) == 1 else expected_fit(vehicle, mean))
    return tuple(
        PlannedSensor(sensor.channel, 1 - precision / _precision_without(vehicle, mean, sensor))
        for sensor in vehicle.sensor
        if sensor.quantity in {"acceleration", "angular_velocity"}
    )


def _precision(expected: ExpectedFit) -> float:
    """Return the geometric mean of the standard deviations of contrasts, or of the values where there are none."""
    stds: Real = np.array(list(expected.contrast_std.values() or expected.std.values()))
    return float(np.exp(np.mean(np.log(stds))))


def _precision_without(vehicle: Vehicle, drive: ExpectedDrive, sensor: Sensor) -> float:
    others = tuple(other for other in vehicle.sensor if other != sensor)
    try:
        return _precision(expected_fit(vehicle.model_copy(update={"sensor": others}), drive))
    except ParameterError:  # the last sensor
        return float("inf")


def candidates(vehicle: Vehicle) -> tuple[Sensor, ...]:
    """Return places for accelerometers: above each wheel, between the wheels of each axle, and in the middle."""
    places = [
        (f"acc_axle{number}_{name}", axle.x, side * axle.half_track)
        for number, axle in enumerate(vehicle.axle, start=1)
        for name, side in (("left", 1.0), ("middle", 0.0), ("right", -1.0))
    ]
    return tuple(accelerometer(*place) for place in (*places, ("acc_middle", 0.0, 0.0)))


def best_places(
    vehicle: Vehicle, candidates: Sequence[Sensor], n_sensors: int, *, drive: ExpectedDrive | None = None
) -> tuple[Sensor, ...]:
    """Return the places of a number of sensors that make the comparison of left and right most precise.

    Parameters
    ----------
    vehicle
        Vehicle; its own sensors take no part.
    candidates
        Sensors that may be mounted.
    n_sensors
        Number of sensors, from 1 to that of the candidates.
    drive
        Conditions of a window, as for `plan`.

    Raises
    ------
    ParameterError
        If the number of sensors is out of range.

    Notes
    -----
    Greedy choice, then exchanges of one chosen sensor for another while they help. The criterion is the geometric mean
    of the standard deviations.

    References
    ----------
    V. V. Fedorov, Theory of Optimal Experiments, Academic Press, 1972 (exchange of points).
    """
    check_on_axles(vehicle, "a plan of sensors")
    check_number("n_sensors", n_sensors, at_least=1, at_most=len(candidates))
    conditions = (drive or ExpectedDrive()).on_mean_road
    known: dict[frozenset[str], float] = {}

    def criterion(chosen: Sequence[Sensor]) -> float:
        names = frozenset(sensor.channel for sensor in chosen)
        if names not in known:
            with_chosen = vehicle.model_copy(update={"sensor": tuple(chosen)})
            known[names] = _precision(expected_fit(with_chosen, conditions))
        return known[names]

    chosen: list[Sensor] = []
    while len(chosen) < n_sensors:
        left = [sensor for sensor in candidates if sensor not in chosen]
        chosen.append(min(left, key=lambda sensor: criterion([*chosen, sensor])))
    while True:
        exchanges = [
            [*chosen[:row], sensor, *chosen[row + 1 :]]
            for row in range(n_sensors)
            for sensor in candidates
            if sensor not in chosen
        ]
        best = min(exchanges, key=criterion, default=chosen)
        if criterion(best) >= criterion(chosen):
            return tuple(chosen)
        chosen = best


def _notes(components: Sequence[PlannedComponent]) -> tuple[str, ...]:
    """Return notes on what the kit does not determine."""
    weak = [str(part.component) for part in components if not part.is_identifiable]
    late = [str(part.component) for part in components if part.minutes[CHANGES[-1]] is None]
    notes = []
    if weak:
        notes.append(f"not determined by these drives and sensors: {', '.join(weak)}")
    if late:
        change = f"a change of {100 * CHANGES[-1]:.0f} %"
        notes.append(f"{change} is not found within {PLAN.n_windows[-1]} windows: {', '.join(late)}")
    return (*notes, "friction, and temperatures and loads that a baseline has not met, add to these figures")
