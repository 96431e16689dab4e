"""The interface under /api/v1: everything that pages show and do, for programs."""

from typing import Annotated

from fastapi import APIRouter, Header, Path, Query
from fastapi.responses import StreamingResponse

from sprung.online.monitor import operations
from sprung.online.site import views
from sprung.online.site.access import Engineer, Viewer
from sprung.online.site.context import Shared
from sprung.online.site.live import Mark
from sprung.online.site.models import (
    AlertDetail,
    Assignment,
    Comment,
    Done,
    FleetCount,
    FleetPage,
    Learning,
    Shelf,
    VehicleDetail,
    WindowPage,
    WorkshopVerdict,
)

router = APIRouter()

#: Numbers of rows and times, as columns hold them.
Number = Annotated[int, Path(ge=1, lt=2**63)]
Time = Annotated[int | None, Query(ge=0, lt=2**63, description="UTC ns")]
Limit = Annotated[int, Query(ge=1, le=200)]
VehicleName = Annotated[str, Path(min_length=1, max_length=64)]


@router.get("/vehicles", tags=["vehicles"])
def vehicles(
    context: Shared,
    _: Viewer,
    *,
    text: Annotated[str, Query(max_length=64, description="part of the name")] = "",
    step: Annotated[list[str] | None, Query(description="note, low, medium, high, critical or none")] = None,
    assignee: Annotated[str | None, Query(max_length=200)] = None,
    is_unacknowledged: bool = False,
    is_learning: bool = False,
    is_silent: bool = False,
    cursor: Annotated[str | None, Query(pattern=views.CURSOR)] = None,
    limit: Limit = 50,
) -> FleetPage:
    """Vehicles, the most urgent first."""
    wanted = views.fleet_filter(
        context,
        text=text,
        step=step or (),
        assignee=assignee,
        is_unacknowledged=is_unacknowledged,
        is_learning=is_learning,
        is_silent=is_silent,
    )
    return views.fleet_page(context, wanted, cursor=cursor, limit=limit)


@router.get("/counts", tags=["vehicles"])
def counts(context: Shared, _: Viewer) -> FleetCount:
    """Numbers of vehicles in each state."""
    return FleetCount.model_validate(context.store.fleet.counts(silent_before=context.silent_before))


@router.get("/vehicles/{vehicle}", tags=["vehicles"])
def vehicle_detail(context: Shared, _: Viewer, vehicle: VehicleName) -> VehicleDetail:
    """A vehicle."""
    return views.vehicle_detail(context, vehicle)[0]


@router.get("/vehicles/{vehicle}/windows", tags=["vehicles"])
def windows(
    context: Shared, _: Viewer, vehicle: VehicleName, *, since: Time = None, until: Time = None, limit: Limit = 100
) -> WindowPage:
    """Observations of windows in order of time, the last before `until`."""
    entries = context.store.results.observations(vehicle, since=since, until=until, limit=limit + 1)
    return views.window_page(entries, limit=limit)


@router.get("/vehicles/{vehicle}/modes", tags=["vehicles"])
def modes(
    context: Shared, _: Viewer, vehicle: VehicleName, *, since: Time = None, until: Time = None, limit: Limit = 100
) -> WindowPage:
    """Identified modes in order of time, the last before `until`."""
    entries = context.store.results.modes(vehicle, since=since, until=until, limit=limit + 1)
    return views.window_page(entries, limit=limit)


@router.get("/vehicles/{vehicle}/findings", tags=["vehicles"])
def findings(
    context: Shared, _: Viewer, vehicle: VehicleName, *, since: Time = None, until: Time = None, limit: Limit = 100
) -> WindowPage:
    """Findings in order of time, the last before `until`."""
    entries = context.store.results.findings(vehicle, since=since, until=until, limit=limit + 1)
    return views.window_page(entries, limit=limit)


@router.post("/vehicles/{vehicle}/baselines", tags=["vehicles"], status_code=202)
def learn(context: Shared, person: Engineer, vehicle: VehicleName, given: Learning) -> Done:
    """Learn a new baseline from the next windows."""
    number = operations.relearn(context.store, vehicle, reason=given.reason, who=person.name, now=context.clock())
    return Done(sentence=f"{vehicle} will relearn its baseline from its next usable windows", number=number)


@router.get("/alerts/{number}", tags=["alerts"])
def alert_detail(context: Shared, _: Viewer, number: Number) -> AlertDetail:
    """An alert with its evidence, history and verdicts."""
    return views.alert_detail(context, number)


@router.post("/alerts/{number}/acknowledge", tags=["alerts"])
def acknowledge(context: Shared, person: Engineer, number: Number, given: Comment) -> AlertDetail:
    """Acknowledge an alert."""
    operations.acknowledge(context.store, number, who=person.name, comment=given.comment, now=context.clock())
    return views.alert_detail(context, number)


@router.post("/alerts/{number}/comment", tags=["alerts"])
def comment(context: Shared, person: Engineer, number: Number, given: Comment) -> AlertDetail:
    """Comment on an alert."""
    operations.add_comment(context.store, number, who=person.name, comment=given.comment, now=context.clock())
    return views.alert_detail(context, number)


@router.post("/alerts/{number}/assign", tags=["alerts"])
def assign(context: Shared, person: Engineer, number: Number, given: Assignment) -> AlertDetail:
    """Assign an alert to a person, or to nobody."""
    operations.assign(
        context.store,
        number,
        assignee=given.assignee,
        who=person.name,
        comment=given.comment,
        now=context.clock(),
    )
    return views.alert_detail(context, number)


@router.post("/alerts/{number}/shelve", tags=["alerts"])
def shelve(context: Shared, person: Engineer, number: Number, given: Shelf) -> AlertDetail:
    """Shelve an alert for some hours."""
    operations.shelve(
        context.store, number, hours=given.hours, who=person.name, comment=given.comment, now=context.clock()
    )
    return views.alert_detail(context, number)


@router.post("/alerts/{number}/unshelve", tags=["alerts"])
def unshelve(context: Shared, person: Engineer, number: Number, given: Comment) -> AlertDetail:
    """End the shelving of an alert."""
    operations.unshelve(context.store, number, who=person.name, comment=given.comment, now=context.clock())
    return views.alert_detail(context, number)


@router.post("/alerts/{number}/close", tags=["alerts"])
def close(context: Shared, person: Engineer, number: Number, given: Comment) -> AlertDetail:
    """Clear an alert whose cause was removed."""
    operations.close(context.store, number, who=person.name, comment=given.comment, now=context.clock())
    return views.alert_detail(context, number)


@router.post("/alerts/{number}/verdict", tags=["alerts"])
def verdict(context: Shared, person: Engineer, number: Number, given: WorkshopVerdict) -> AlertDetail:
    """Record what the workshop found and did, and learn a new baseline if requested."""
    operations.add_verdict(
        context.store,
        number,
        verdict=given.verdict,
        part=given.part,
        action=given.action,
        is_new_baseline=given.new_baseline,
        who=person.name,
        now=context.clock(),
    )
    return views.alert_detail(context, number)


@router.get(
    "/events", tags=["live"], response_class=StreamingResponse, responses={200: {"content": {"text/event-stream": {}}}}
)
async def events(
    context: Shared, _: Viewer, last_event_id: Annotated[str | None, Header(max_length=40)] = None
) -> StreamingResponse:
    """Changes of alerts ("alert") and analysed windows ("window") as server-sent events, as they happen."""
    after = None if last_event_id is None else Mark.parse(last_event_id)
    headers = {"cache-control": "no-store", "x-accel-buffering": "no"}
    return StreamingResponse(context.feed.listen(after), media_type="text/event-stream", headers=headers)
