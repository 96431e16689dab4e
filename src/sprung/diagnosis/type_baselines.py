"""Normal state of the vehicles of one type: their mean, and their covariance between and within vehicles."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from sprung._arrays import Real
from sprung._display import Savable, counted, in_short
from sprung.diagnosis.baseline import CONDITIONS, Baseline, freeze_shapes, prior_information, vehicle_of
from sprung.diagnosis.observation import Observation
from sprung.diagnosis.scatter import Scatter, directions, shared_covariance
from sprung.vehicles import Component

#: Production scatter: standard deviation of ln(left / right) of healthy parts of each kind; also of an axle, and of all
#: corners, from vehicle to vehicle of a type.
PRODUCTION_SCATTER = {"spring": 0.04, "damper": 0.05, "tyre": 0.03}
#: Production scatter of other kinds.
OTHER_SCATTER = 0.05
#: The same where a vehicle file alone is known: it states an anti-roll bar by a factor of two or three.
_OF_FILE = PRODUCTION_SCATTER | {"anti_roll": 2.0}


@dataclass(frozen=True, slots=True)
class TypeSettings:
    """Settings of the baseline of a type."""

    #: Standard deviation of front against rear about the vehicle file.
    file_front_rear: float = 0.15
    #: Standard deviation of all of a kind about the vehicle file.
    file_common: float = 0.25
    #: Weight of production scatter in vehicles.
    production: float = 4.0
    #: Largest weight of the scatter of a type's windows, in degrees of freedom.
    max_degrees: float = 48.0
    #: Information about the slopes of a vehicle when those of its type are known, over the typical one.
    slopes: float = 25.0
    #: Clipping of Huber's proposal 2 in standard deviations.
    clip: float = 1.5
    #: Rounds of Huber's proposal 2.
    rounds: int = 50


TYPES = TypeSettings()
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
    model_error
        Median model error of these windows, see `CornerFit`.

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
    model_error: float = 0.0

    def __post_init__(self) -> None:
        size = len(self.components)
        shapes = {"mean": (size,), "between": (size, size), "slopes": (size, len(CONDITIONS)), "scales": (size,)}
        freeze_shapes(self, "a type's baseline", **shapes)

    def __repr__(self) -> str:
        """Return the type, and the numbers of vehicles and windows."""
        size = f"{counted(self.n_vehicles, 'vehicle')}, {counted(self.n_windows, 'window')}"
        return in_short(f"TypeBaseline of {self.name!r}: {len(self.components)} components from {size}")

    @property
    def single_vehicle_covariance(self) -> Real:
        """Covariance of a further vehicle about the mean, which its vehicles determine up to chance."""
        return self.between * (1 + 1 / self.n_vehicles) if self.n_vehicles else self.between

    @property
    def information(self) -> Real:
        """Information about mean and slopes of a vehicle before any window, shape as `Baseline.information`."""
        of_mean = np.asarray(np.linalg.inv(self.single_vehicle_covariance), dtype=np.float64)
        of_slopes = TYPES.slopes if self.n_vehicles else 1.0
        return prior_information(self.components, of_mean, of_slopes=of_slopes, model_error=self.model_error)

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
            degrees_of_freedom=min(self.degrees_of_freedom, TYPES.max_degrees),
        )

    def baseline(self, observations: Sequence[Observation]) -> Baseline:
        """Return the baseline of a vehicle of the type before any window of its own.

        Parameters
        ----------
        observations
            Windows to compare, at least one with the type's components.
        """
        alike = [window.covariance for window in observations if window.components == self.components]
        reported = np.asarray(np.mean(alike, axis=0), dtype=np.float64)
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
            information=self.information,
            degrees_of_freedom=max(scatter.degrees_of_freedom, 2.0 * len(directions(self.components)[0])),
            n_windows=self.n_windows,
            n_refused=0,
            version=0,
            reason=f"{self.n_vehicles} vehicles of the type {self.name}"
            if self.n_vehicles
            else "the vehicle file only",
            model_error=self.model_error,
        )


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
    kinds = {component.kind for component in components}
    usual = Scatter.typical(components, np.eye(len(components)), with_temperature=False)
    return TypeBaseline(
        name=name,
        components=components,
        mean=np.zeros(len(components)),
        between=between_vehicles(
            components,
            left_right={kind: _OF_FILE.get(kind, OTHER_SCATTER) for kind in kinds},
            front_rear=dict.fromkeys(kinds, TYPES.file_front_rear),
            common=dict.fromkeys(kinds, TYPES.file_common),
        ),
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


def between_vehicles(
    components: tuple[Component, ...],
    *,
    left_right: Mapping[str, float],
    front_rear: Mapping[str, float],
    common: Mapping[str, float],
) -> Real:
    """Return the covariance of vehicles from what components of each kind share, never singular."""
    shared = shared_covariance(components, front_rear, common, left_right=left_right)
    return np.asarray(shared + 1e-8 * np.eye(len(components)), dtype=np.float64)


def has_temperature(observations: Iterable[Observation]) -> bool:
    """Return whether the temperature of all conclusive windows is known."""
    return all("temperature" in window.conditions for window in observations if window.is_conclusive)
