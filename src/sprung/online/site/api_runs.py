"""The interface for the results of a run over the fleet."""

from typing import Annotated

from fastapi import APIRouter, Query
from pydantic import Field

from sprung.online.site.access import Viewer
from sprung.online.site.context import Shared, known_vehicles
from sprung.online.site.runs import CURSOR, RunPage, WantedRuns, run_page

router = APIRouter(tags=["runs"])


class _Page(WantedRuns):
    """Which vehicles are listed, and how many of them."""

    cursor: str | None = Field(None, pattern=CURSOR)
    limit: int = Field(50, ge=1, le=200)


@router.get("/runs")
def runs(context: Shared, _: Viewer, wanted: Annotated[_Page, Query()]) -> RunPage:
    """Vehicles by the last run over the fleet (`keep.results`): discoveries first, then by severity."""
    known = known_vehicles(context)
    return run_page(context.runs.rows(), wanted, cursor=wanted.cursor, limit=wanted.limit, known=known)
