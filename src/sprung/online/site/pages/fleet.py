"""The fleet: every vehicle, the most urgent first."""

from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request, Response
from pydantic import BaseModel, Field

from sprung.online.monitor import embedded_port
from sprung.online.site import views
from sprung.online.site.access import Viewer
from sprung.online.site.context import Context, Shared
from sprung.online.site.models import FleetCount
from sprung.online.site.pages.rendering import page
from sprung.results.tables import counted

router = APIRouter()

#: Vehicles on a page.
_LIMIT = 50


class Wanted(BaseModel):
    """Which vehicles are shown; the address of the page states it."""

    text: str = Field("", max_length=64)
    step: list[str] = []
    assignee: str | None = Field(None, max_length=64)
    is_unacknowledged: bool = False
    is_learning: bool = False
    is_silent: bool = False
    cursor: str | None = Field(None, max_length=200)


@router.get("/")
def fleet(request: Request, context: Shared, _: Viewer, wanted: Annotated[Wanted, Query()]) -> Response:
    """Show the fleet."""
    counts = FleetCount.model_validate(context.store.fleet.counts(silent_before=context.silent_before))
    given = wanted.model_dump(exclude_defaults=True)
    cursor = given.pop("cursor", None)

    def link(**changes: Any) -> str:
        kept = {name: value for name, value in (given | changes).items() if value not in (None, [], "", False)}
        return "/" + (f"?{urlencode(kept, doseq=True)}" if kept else "")

    found = views.fleet_page(
        context, views.fleet_filter(context, **wanted.model_dump(exclude={"cursor"})), cursor=cursor, limit=_LIMIT
    )
    return page(
        request,
        "fleet.html",
        section="/",
        sentence=_sentence(counts),
        counts=counts,
        page=found,
        wanted=wanted,
        is_all=not given,
        cursor=cursor,
        limit=_LIMIT,
        link=link,
        broker=_broker(context),
    )


def _broker(context: Context) -> str:
    """Return the address of the broker for programs of this machine."""
    port = embedded_port(context.site.broker)
    return context.site.broker if port is None else f"mqtt://127.0.0.1:{port}"


def _sentence(counts: FleetCount) -> str:
    """Return the state of the fleet in words."""
    if not counts.vehicles:
        return "No vehicle is known yet."
    urgent, of = counts.unacknowledged, f"of {counted(counts.vehicles, 'vehicle')}"
    parts = [f"{urgent or 'None'} {of} {'needs' if urgent < 2 else 'need'} attention."]
    for number, word in ((counts.silent, "silent"), (counts.learning, "still learning")):
        if number:
            parts.append(f"{number} {'is' if number == 1 else 'are'} {word}.")
    return " ".join(parts)
