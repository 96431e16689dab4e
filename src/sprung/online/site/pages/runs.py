"""Results of a run over the fleet: every vehicle of it, those that stand out first."""

from typing import Annotated, Any
from urllib.parse import urlencode

from fastapi import APIRouter, Query, Request, Response
from pydantic import Field

from sprung.online.site.access import Viewer
from sprung.online.site.context import Shared, known_vehicles
from sprung.online.site.pages.rendering import page
from sprung.online.site.runs import CURSOR, RunPage, WantedRuns, run_page
from sprung.results.tables import counted

router = APIRouter()

#: Vehicles on a page.
_LIMIT = 50


class Wanted(WantedRuns):
    """Which vehicles are shown."""

    cursor: str | None = Field(None, pattern=CURSOR)


@router.get("/runs")
def runs(request: Request, context: Shared, _: Viewer, wanted: Annotated[Wanted, Query()]) -> Response:
    """Show the results of the last run."""
    known = known_vehicles(context)
    found = run_page(context.runs.rows(), wanted, cursor=wanted.cursor, limit=_LIMIT, known=known)
    given = wanted.model_dump(exclude_defaults=True, exclude={"cursor"})
    return page(
        request,
        "runs.html",
        section="/runs",
        sentence=_sentence(found),
        page=found,
        wanted=wanted,
        given=given,
        limit=_LIMIT,
        link=_link,
        results=context.site.keep.results,
    )


def _link(**wanted: Any) -> str:
    """Return the address of the page with a filter."""
    return "/runs?" + urlencode(wanted, doseq=True)


def _sentence(found: RunPage) -> str:
    """Return the main result of a run."""
    if not found.total:
        return "No run has stored results yet."
    stands = "stands" if found.discoveries == 1 else "stand"
    return f"{found.discoveries} of {counted(found.total, 'vehicle')} {stands} out from the fleet."
