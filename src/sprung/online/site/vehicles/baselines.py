"""Learning and baselines of a vehicle: progress, versions, and requests to learn anew or to return to one."""

from typing import Annotated, Any, Self

from fastapi import APIRouter, Path, Query, Request, Response
from fastapi.responses import RedirectResponse
from pydantic import Field

from sprung.diagnosis import Baseline
from sprung.diagnosis.baseline import CONDITIONS
from sprung.diagnosis.observation import CONDITION_UNITS
from sprung.errors import FormatError, ParameterError
from sprung.online.monitor import VehicleStatus, operations
from sprung.online.monitor.histories import LEARN, ROLL_BACK, reference_of
from sprung.online.monitor.operations import describe_rollback
from sprung.online.site.accounts import Engineer, EngineerForm, Person, Role, Viewer
from sprung.online.site.rendering import path_of, vehicle_page
from sprung.online.site.shared import (
    LIMITS,
    Answer,
    Context,
    Done,
    Given,
    KnownVehicle,
    Line,
    Mileage,
    Outcome,
    Shared,
    VehicleName,
    require_vehicle,
)
from sprung.online.store import BaselineRow, Store
from sprung.results.documents import baseline_from_document
from sprung.state import progress_in_words

api = APIRouter(tags=["vehicles"])
pages = APIRouter(include_in_schema=False)

#: Versions of baselines.
Version = Annotated[int, Path(ge=1, lt=2**31)]


class Learning(Given):
    """Why another baseline is used."""

    reason: Line = Field(min_length=1)


class Reset(Learning):
    """Why a new baseline is learnt, and the mileage [km]; null: unknown."""

    mileage: Mileage | None = None


class BaselineEntry(Answer):
    """A version of a baseline."""

    version: int
    created: int
    reason: str
    windows: int | None

    @classmethod
    def of(cls, row: BaselineRow, **fields: Any) -> Self:
        """Return a version from its row, and what else is known about it."""
        stated = row.document.get("n_windows")
        return cls(version=row.version, created=row.created, reason=row.reason, windows=stated, **fields)


class ConditionRange(Answer):
    """Lowest and highest value of a condition in the windows of a baseline."""

    name: str
    low: float
    high: float
    unit: str


class BaselineVersion(BaselineEntry):
    """A version of a baseline: start of use, reason, requester, and conditions met."""

    who: str | None = Field(description="who requested it; null: the monitor by itself, or no longer known")
    refused: int | None = Field(description="windows not used for learning")
    ranges: tuple[ConditionRange, ...] = Field(description="conditions of its windows")
    is_restorable: bool = Field(description="whether it can be returned to")


class BaselineDetail(Answer):
    """Learning and baselines of a vehicle."""

    is_learning: bool
    windows_learnt: int
    windows_needed: int
    progress: str = Field(description="progress of learning in words")
    is_requested: bool = Field(description="whether a request for a new baseline is pending")
    requested_version: int | None = Field(description="earlier version to which a return is pending")
    versions: tuple[BaselineVersion, ...]
    ranges: tuple[ConditionRange, ...]
    detectable: dict[str, dict[str, float]] = Field(
        description="smallest relative loss of each part by number of windows"
    )
    notes: tuple[str, ...]


@api.get("/vehicles/{vehicle}/baseline")
def baseline(context: Shared, _: Viewer, row: KnownVehicle) -> BaselineDetail:
    """Progress of learning, versions and limits of the baseline."""
    store = context.store
    vehicle = row.vehicle
    status = VehicleStatus(**(store.results.status(vehicle) or {}))
    rows = store.results.baselines(vehicle)
    reference = reference_of(rows)
    is_learning = status.is_learning or reference.baseline is None
    waiting = [each for each in store.requests.open_commands() if each.vehicle == vehicle]
    returns = [each.detail["version"] for each in waiting if each.act == ROLL_BACK]
    return BaselineDetail(
        is_learning=is_learning,
        windows_learnt=status.n_learnt,
        windows_needed=status.n_needed,
        progress="; ".join(filter(None, (progress_in_words(status), status.coverage))) if is_learning else "",
        is_requested=any(each.act == LEARN for each in waiting),
        requested_version=returns[-1] if returns else None,
        versions=_versions(store, vehicle, rows, is_learning=is_learning),
        ranges=_ranges(reference.baseline),
        detectable={str(count): losses for count, losses in sorted(reference.detectable.items())},
        notes=reference.notes,
    )


@api.post("/vehicles/{vehicle}/baselines", status_code=202)
def learn(context: Shared, person: Engineer, vehicle: VehicleName, given: Reset) -> Done:
    """Learn a new baseline from the next windows."""
    now = context.clock()
    number = operations.relearn(context.store, vehicle, **given.model_dump(), who=person.name, now=now)
    return Done(sentence=f"{vehicle} will relearn its baseline from its next usable windows", number=number)


@api.post("/vehicles/{vehicle}/baselines/{version}/rollback", status_code=202)
def roll_back(context: Shared, person: Engineer, vehicle: VehicleName, version: Version, given: Learning) -> Done:
    """Return to an earlier baseline, which becomes the newest version; the next windows are compared with it."""
    reason, now = given.reason, context.clock()
    number = operations.roll_back(context.store, vehicle, version=version, reason=reason, who=person.name, now=now)
    return Done(sentence=describe_rollback(vehicle, version, reason), number=number)


@pages.get("/vehicles/{vehicle}/baseline")
def show(
    request: Request,
    context: Shared,
    person: Viewer,
    vehicle: VehicleName,
    *,
    notice: Outcome = "",
    version: Annotated[int, Query(ge=0, lt=2**31)] = 0,
) -> Response:
    """Show learning and baselines of a vehicle."""
    sentences = {
        "learn": f"{vehicle} will learn a new baseline from its next usable windows.",
        "rollback": f"{vehicle} will return to the earlier baseline before its next window.",
    }
    return _page(request, context, person, vehicle, notice=sentences.get(notice, ""), wanted=version)


@pages.post("/vehicles/{vehicle}/baseline")
@pages.post("/vehicles/{vehicle}/baseline/rollback")
def change_by_form(request: Request, context: Shared, form: EngineerForm, vehicle: VehicleName) -> Response:
    """Learn a new baseline, or return to an earlier one; the page states what makes that impossible."""
    is_return = request.url.path.endswith("/rollback")
    done, example = ("rollback", "learnt with a broken spring") if is_return else ("learn", "new dampers")
    number = form.text("version")
    version = int(number) if number.isascii() and number.isdecimal() and len(number) < LIMITS.max_digits else 0
    try:
        if not form.text("reason"):
            raise ParameterError(f"Give a reason, such as {example}: it is stored with the baseline.")
        if is_return:
            roll_back(context, form.person, vehicle, version, form.body(Learning))
        else:
            learn(context, form.person, vehicle, form.body(Reset))
    except ParameterError as error:
        require_vehicle(context, vehicle)
        problems = {done: str(error)}
        return _page(request, context, form.person, vehicle, problems=problems, wanted=version, status=422)
    return RedirectResponse(f"{path_of(vehicle)}/baseline?notice={done}", 303)


def _page(
    request: Request,
    context: Context,
    person: Person,
    vehicle: str,
    *,
    problems: dict[str, str] | None = None,
    **values: Any,
) -> Response:
    """Return the page of the baselines."""
    return vehicle_page(
        request,
        "vehicle-baseline.html",
        vehicle,
        tab="/baseline",
        problems=problems or {},
        baseline=baseline(context, person, require_vehicle(context, vehicle)),
        may_learn=person.role.includes(Role.ENGINEER),
        **values,
    )


def _versions(store: Store, vehicle: str, rows: list[BaselineRow], *, is_learning: bool) -> tuple[BaselineVersion, ...]:
    """Return the versions of the baseline, the present one first; a return to that one ends learning."""
    requests = [each for each in store.requests.commands_of(vehicle) if each.act in operations.BASELINE_ACTS]
    entries, before = [], 0
    for row in rows:
        asked = [each.who for each in requests if before < each.created <= row.created]
        before = row.created
        try:
            found = baseline_from_document(row.document)
        except FormatError:
            found = None
        entries.append(
            BaselineVersion.of(
                row,
                who=asked[-1] if asked else None,
                refused=row.document.get("n_refused"),
                ranges=_ranges(found),
                is_restorable=found is not None and (row is not rows[-1] or is_learning),
            )
        )
    return tuple(reversed(entries))


def _ranges(baseline: Baseline | None) -> tuple[ConditionRange, ...]:
    """Return the ranges of the conditions that the windows of a baseline met."""
    ranges = {} if baseline is None else baseline.ranges
    return tuple(
        ConditionRange(name=name, low=low, high=high, unit=CONDITION_UNITS.get(name, ""))
        for name, (low, high) in ranges.items()
        if name in CONDITIONS
    )
