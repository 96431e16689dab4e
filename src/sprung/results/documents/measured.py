"""Documents of plans, roads, rides and bounce tests."""

from typing import Any, Literal

import numpy as np
from pydantic import AliasChoices, Field

from sprung.bounce_tests import Bounce, BounceTest
from sprung.kits import KitPlan, PlannedSensor
from sprung.results.documents.document import Document, Number, Pair
from sprung.results.documents.identification import IdentifiedMode, ModeValues, identified_modes
from sprung.ride import Histogram, Ride, RidePoint
from sprung.road import RoadSurvey


class CoulombDocument(ModeValues):
    """Viscous damping and dry friction of a swing, apart."""

    sticking: float
    sticking_std: Number
    channel: str
    is_significant: bool


class BounceMode(IdentifiedMode):
    """A mode of one test, with its friction where that is told apart."""

    coulomb: CoulombDocument | None = None


class BounceTestDocument(Document):
    """One push, drop or release."""

    recording: int
    onset: float
    begin: float
    end: float
    residual: float
    modes: tuple[BounceMode, ...]


class CornerEstimate(Document):
    """A spring or damper by the modes of the body."""

    value: Number
    std: Number
    relative_to_nominal: Number
    is_identifiable: bool


class BounceChangeDocument(Document):
    """Difference of one number between two series of tests."""

    part: str
    quantity: Literal["natural_frequency", "damping_ratio", "value"]
    change: float
    interval: Pair
    score: float
    is_significant: bool


class BounceDocument(Document):
    """Modes, springs and dampers by bounce tests."""

    schema_name: Literal["sprung.bounce/1"] = Field(alias="schema")
    channels: tuple[str, ...]
    tests: tuple[BounceTestDocument, ...]
    modes: tuple[IdentifiedMode, ...]
    corners: dict[str, dict[str, CornerEstimate]]
    changes: tuple[BounceChangeDocument, ...]
    notes: tuple[str, ...]


def bounce_document(bounce: Bounce) -> BounceDocument:
    """Return the document of bounce tests.

    Examples
    --------
    >>> import sprung
    >>> time = np.arange(300) / 100
    >>> swing = np.exp(-0.2 * 2 * np.pi * 1.5 * time) * np.sin(2 * np.pi * 1.5 * np.sqrt(1 - 0.2**2) * time)
    >>> rest = np.zeros(300)
    >>> motion = np.concatenate([rest, swing, rest]) + 0.01 * np.random.default_rng(1).standard_normal(900)
    >>> tests = sprung.bounce(sprung.Recording(motion[None], 100.0, (sprung.Channel("acc", "acceleration"),)))
    >>> document = bounce_document(tests)
    >>> document.schema_name, round(document.modes[0].natural_frequency, 1), document.tests[0].modes[0].coulomb
    ('sprung.bounce/1', 1.5, None)
    """
    corners: dict[str, dict[str, Any]] = {}
    for value in bounce.corners:
        known = value.is_identifiable
        corners.setdefault(str(value.component.corner), {})[str(value.component.kind)] = {
            "value": value.value if known else np.nan,
            "std": value.value * value.std if known else np.nan,
            "relative_to_nominal": value.value / value.nominal if known else np.nan,
            "is_identifiable": known,
        }
    return BounceDocument.of(
        bounce,
        channels=bounce.modes.channels,
        tests=[_test(test) for test in bounce.tests],
        modes=identified_modes(bounce.modes),
        corners=corners,
    )


def _test(test: BounceTest) -> BounceTestDocument:
    modes = []
    for mode, fit in zip(identified_modes(test.modes), test.frictions, strict=True):
        coulomb = None
        if fit is not None:
            largest = int(np.argmax(np.abs(fit.amplitudes)))
            names = [name for name, entry in zip(test.modes.channels, mode.mode_shape, strict=True) if entry != 0]
            coulomb = CoulombDocument.of(
                fit,
                sticking=fit.sticking[largest],
                sticking_std=fit.friction_std * abs(fit.amplitudes[largest]),
                channel=names[largest],
            )
        modes.append(BounceMode(**{**dict(mode), "coulomb": coulomb}))
    times = {name: getattr(test.transient, name) for name in ("onset", "begin", "end")}
    return BounceTestDocument.of(test, modes=modes, **times)


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


class StretchDocument(Document):
    """A stretch of the road, from and to a distance [m]; place where the recordings have it [degrees]."""

    begin: float = _renamed("from", "begin")
    end: float = _renamed("to", "end")
    left: TrackDocument
    right: TrackDocument
    n_passes: int
    begin_place: Pair | None = Field(default=None, exclude_if=lambda place: place is None)
    end_place: Pair | None = Field(default=None, exclude_if=lambda place: place is None)


class EventDocument(Document):
    """A pothole, bump or joint: distance, depth and length [m]; a step has the length 0."""

    at: float
    side: Literal["left", "right", "both"]
    kind: Literal["pothole", "bump", "joint"]
    depth: float
    length: float
    n_passes: int = 1
    place: Pair | None = Field(default=None, exclude_if=lambda place: place is None)


class RoadDocument(Document):
    """The road under a vehicle."""

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
    notes: tuple[str, ...]


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
