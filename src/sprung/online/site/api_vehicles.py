"""The interface under /api/v1 about one vehicle: what its pages show."""

from typing import Annotated

from fastapi import APIRouter, Path

from sprung.online.monitor import operations
from sprung.online.monitor.requests import rolling_back_in_words
from sprung.online.site import vehicle_data, vehicle_trends, views
from sprung.online.site.access import Engineer, Viewer
from sprung.online.site.api import Time, VehicleName
from sprung.online.site.context import Shared
from sprung.online.site.models import Done, Learning
from sprung.online.site.vehicle_models import BaselineDetail, BodyModes, Changes, DataQuality, Trends, WindowDetail

router = APIRouter(tags=["vehicles"])

#: Versions of baselines.
Version = Annotated[int, Path(ge=1, lt=2**31)]
#: Numbers of boots and windows, as columns hold them.
Place = Annotated[int, Path(ge=0, lt=2**63)]


@router.get("/vehicles/{vehicle}/changes")
def changes(context: Shared, _: Viewer, vehicle: VehicleName) -> Changes:
    """Changes of springs, dampers and tyres against the baseline, with 95 % intervals."""
    return Changes.model_validate(views.vehicle_detail(context, vehicle)[1])


@router.get("/vehicles/{vehicle}/trends")
def trends(context: Shared, _: Viewer, vehicle: VehicleName, *, since: Time = None, until: Time = None) -> Trends:
    """Springs, dampers, tyres and modes of the body over time, at most the last 1000 windows."""
    vehicle_data.require_vehicle(context.store, vehicle)
    end = context.clock() if until is None else until
    return vehicle_trends.trends(context.store, vehicle, since=since, until=end)


@router.get("/vehicles/{vehicle}/body-modes")
def body_modes(context: Shared, _: Viewer, vehicle: VehicleName) -> BodyModes:
    """Motion of the body in bounce, pitch and roll, as last identified."""
    return vehicle_data.body_modes(context.store, vehicle)


@router.get("/vehicles/{vehicle}/data-quality")
def data_quality(context: Shared, _: Viewer, vehicle: VehicleName) -> DataQuality:
    """Data quality of each channel over the last windows."""
    return vehicle_data.data_quality(context.store, vehicle)


@router.get("/vehicles/{vehicle}/baseline")
def baseline(context: Shared, _: Viewer, vehicle: VehicleName) -> BaselineDetail:
    """Progress of learning, versions and limits of the baseline."""
    return vehicle_data.baseline_detail(context.store, vehicle)


@router.post("/vehicles/{vehicle}/baselines/{version}/rollback", status_code=202)
def roll_back(context: Shared, person: Engineer, vehicle: VehicleName, version: Version, given: Learning) -> Done:
    """Return to an earlier baseline, which becomes the newest version; the next windows are compared with it."""
    reason, now = given.reason, context.clock()
    number = operations.roll_back(context.store, vehicle, version=version, reason=reason, who=person.name, now=now)
    return Done(sentence=rolling_back_in_words(vehicle, version, reason), number=number)


@router.get("/vehicles/{vehicle}/windows/{boot}/{number}")
def window(context: Shared, _: Viewer, vehicle: VehicleName, boot: Place, number: Place) -> WindowDetail:
    """A window: conditions, parts, modes, findings and sensor faults."""
    return vehicle_data.window_detail(context.store, vehicle, boot, number)
