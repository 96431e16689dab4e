"""Documents of plans, roads, rides and running stability."""

from typing import Any, Literal

from pydantic import AliasChoices, Field

from sprung.kits import KitPlan, PlannedSensor
from sprung.likelihood.lateral import LateralFit, LeastDamping
from sprung.results.documents.document import Document, Number, Pair
from sprung.ride import Histogram, Ride, RidePoint
from sprung.road import RoadSurvey


def _renamed(key: str, name: str) -> Any:
    """Return a field with a key in JSON that is no name in Python."""
    return Field(validation_alias=AliasChoices(key, name), serialization_alias=key)


class PlannedPart(Document):
    """What a kit will see of a component; minutes by the change as text, null where it is not found in time."""

    std: float
    contrast_std: float | None
    axle_std: float | None
    minutes: dict[str, float | None]
    is_identifiable: bool


class PlanDocument(Document):
    """What a kit of sensors will see on a vehicle."""

    schema_name: Literal["sprung.plan/1"] = Field(alias="schema")
    components: dict[str, PlannedPart]
    sensors: tuple[PlannedSensor, ...]
    notes: tuple[str, ...]


class TrackDocument(Document):
    """Roughness of a track on a stretch: index [m/km], its scatter between passes, G(n0) [m^3], class of ISO 8608."""

    iri: float
    iri_std: float
    road_class: str = _renamed("class", "road_class")
    roughness: float
    waviness: float
    iri_scatter: float | None = Field(default=None, exclude_if=lambda scatter: scatter is None)


class LevelDocument(Document):
    """Standard deviations of a level or the alignment in D1 and D2 of EN 13848 [m], scatter of D1 between passes."""

    d1: float
    d1_std: float
    d2: float | None
    d2_std: float | None
    d1_scatter: float | None = Field(default=None, exclude_if=lambda scatter: scatter is None)


class StretchDocument(Document):
    """A stretch of a road or track, from and to a distance [m]; place where the recordings have it [degrees]."""

    begin: float = _renamed("from", "begin")
    end: float = _renamed("to", "end")
    left: TrackDocument | LevelDocument
    right: TrackDocument | LevelDocument
    n_passes: int
    begin_place: Pair | None = Field(default=None, exclude_if=lambda place: place is None)
    end_place: Pair | None = Field(default=None, exclude_if=lambda place: place is None)
    alignment: LevelDocument | None = Field(default=None, exclude_if=lambda alignment: alignment is None)


class EventDocument(Document):
    """A pothole, bump or joint, or a dip or hump of a track: distance, depth and length [m], 0 of a step."""

    at: float
    side: Literal["left", "right", "both"]
    kind: Literal["pothole", "bump", "joint", "dip", "hump"]
    depth: float
    length: float
    n_passes: int = 1
    place: Pair | None = Field(default=None, exclude_if=lambda place: place is None)


class RoadDocument(Document):
    """The road or track under a vehicle."""

    schema_name: Literal["sprung.road/1"] = Field(alias="schema")
    stretches: tuple[StretchDocument, ...]
    events: tuple[EventDocument, ...]
    notes: tuple[str, ...]


class TravelDocument(Document):
    """Use of the travel of a suspension [m, m/s]."""

    channel: str
    lowest: float
    highest: float
    share_used: Number
    n_bottomed: int
    quantiles: tuple[float, ...]
    rebound_speed: float
    bump_speed: float
    travel_histogram: Histogram
    speed_histogram: Histogram


class RideDocument(Document):
    """Ride of a vehicle."""

    schema_name: Literal["sprung.ride/1"] = Field(alias="schema")
    points: tuple[RidePoint, ...]
    travel: tuple[TravelDocument, ...]
    mean_comfort: float | None
    vibration_total: float | None
    notes: tuple[str, ...]


class LateralComponent(Document):
    """Value of a lateral component, its 95 % interval, and the value of the vehicle file [N/m, N s/m, N]."""

    value: float
    interval: Pair
    nominal: float


class StabilityDocument(Document):
    """Lateral suspension and running stability of a rail vehicle."""

    schema_name: Literal["sprung.stability/1"] = Field(alias="schema")
    components: dict[str, LateralComponent]
    least_damping: tuple[LeastDamping, ...]
    speeds: Pair
    critical_speed: float | None
    critical_speed_interval: Pair | None
    margin: float | None
    model_error: float
    n_segments: int
    notes: tuple[str, ...]


def stability_document(fit: LateralFit) -> StabilityDocument:
    """Return the running stability of a rail vehicle as `sprung.stability/1`."""
    speed, *interval = fit.critical_speed or (None, None, None)
    return StabilityDocument.of(
        fit,
        components={name: LateralComponent.of(part) for name, part in fit.estimates.items()},
        critical_speed=speed,
        critical_speed_interval=None if speed is None else interval,
    )


def plan_document(plan: KitPlan) -> PlanDocument:
    """Return a plan as `sprung.plan/1`."""
    components = {
        str(part.component): PlannedPart.of(
            part, minutes={f"{change:g}": minutes for change, minutes in part.minutes.items()}
        )
        for part in plan.components
    }
    return PlanDocument.of(plan, components=components)


def road_document(survey: RoadSurvey) -> RoadDocument:
    """Return the road under a vehicle as `sprung.road/1`."""
    return RoadDocument.of(survey)


def ride_document(ride: Ride) -> RideDocument:
    """Return the ride of a vehicle as `sprung.ride/1`."""
    return RideDocument.of(ride)
