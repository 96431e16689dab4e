"""The interface to files about a vehicle and period."""

from typing import Annotated

from fastapi import APIRouter, HTTPException, Query
from fastapi.responses import HTMLResponse, StreamingResponse

from sprung.errors import ParameterError
from sprung.online.monitor.exports import MEDIA_TYPES, FileFormat, What
from sprung.online.site.access import Viewer
from sprung.online.site.api import Time, VehicleName
from sprung.online.site.busy import BusyError
from sprung.online.site.context import Shared
from sprung.online.site.files import RETRY, disposition, export_pieces, report_page
from sprung.results.periods import Period

router = APIRouter()


@router.get("/vehicles/{vehicle}/report", tags=["files"], response_class=HTMLResponse)
def report(context: Shared, _: Viewer, vehicle: VehicleName, *, since: Time = None, until: Time = None) -> HTMLResponse:
    """Report of a vehicle and period, one page that needs no network."""
    try:
        page = report_page(context, vehicle, period=_period(since, until))
    except BusyError as error:
        raise HTTPException(503, str(error), headers={"retry-after": str(RETRY)}) from None
    headers = {"content-disposition": disposition("attachment", f"{vehicle}-report.html"), "cache-control": "no-store"}
    return HTMLResponse(page, headers=headers)


@router.get(
    "/vehicles/{vehicle}/export",
    tags=["files"],
    response_class=StreamingResponse,
    responses={200: {"content": {kind: {} for kind in MEDIA_TYPES.values()}}},
)
def export(
    context: Shared,
    _: Viewer,
    vehicle: VehicleName,
    *,
    what: What = "windows",
    file_format: Annotated[FileFormat, Query(alias="format")] = "csv",
    since: Time = None,
    until: Time = None,
) -> StreamingResponse:
    """Windows, modes, findings or alerts of a vehicle and period as a table."""
    pieces = export_pieces(context, vehicle, what, file_format=file_format, period=_period(since, until))
    headers = {
        "content-disposition": disposition("attachment", f"{vehicle}-{what}.{file_format}"),
        "cache-control": "no-store",
    }
    return StreamingResponse(pieces, media_type=MEDIA_TYPES[file_format], headers=headers)


def _period(since: int | None, until: int | None) -> Period:
    """Return a period, or refuse one that ends before it begins."""
    try:
        return Period(since, until)
    except ParameterError as error:
        raise HTTPException(422, str(error)) from None
