"""The report of a vehicle and period, to read, to print and to keep."""

from typing import Annotated

from fastapi import APIRouter, HTTPException, Query, Request, Response
from fastapi.responses import HTMLResponse, StreamingResponse

from sprung.errors import ParameterError
from sprung.online.monitor.exports import MEDIA_TYPES, FileFormat, What
from sprung.online.site.access import Viewer
from sprung.online.site.api import VehicleName
from sprung.online.site.busy import BusyError
from sprung.online.site.context import Shared
from sprung.online.site.files import RETRY, disposition, export_pieces, report_page
from sprung.online.site.pages.rendering import page
from sprung.results.periods import Period, parse_period

router = APIRouter()

#: A date or time as people and forms write it, or UTC ns.
Moment = Annotated[str | None, Query(max_length=40)]


@router.get("/vehicles/{vehicle}/export")
def table(
    context: Shared,
    _: Viewer,
    vehicle: VehicleName,
    *,
    what: What = "windows",
    file_format: Annotated[FileFormat, Query(alias="format")] = "csv",
    since: Moment = None,
    until: Moment = None,
) -> Response:
    """Save windows, modes, findings or alerts of a period as a table."""
    pieces = export_pieces(context, vehicle, what, file_format=file_format, period=_period(since, until))
    name = disposition("attachment", f"{vehicle}-{what}.{file_format}")
    headers = {"content-disposition": name, "cache-control": "no-store"}
    return StreamingResponse(pieces, media_type=MEDIA_TYPES[file_format], headers=headers)


@router.get("/vehicles/{vehicle}/report")
def report(
    request: Request,
    context: Shared,
    _: Viewer,
    vehicle: VehicleName,
    *,
    since: Moment = None,
    until: Moment = None,
) -> Response:
    """Show the report."""
    try:
        text = report_page(context, vehicle, period=_period(since, until))
    except BusyError as error:
        answer = page(request, "trouble.html", status=503, title="One report at a time", sentence=str(error))
        answer.headers["retry-after"] = str(RETRY)
        return answer
    headers = {"content-disposition": disposition("inline", f"{vehicle}-report.html"), "cache-control": "no-store"}
    return HTMLResponse(text, headers=headers)


def _period(since: str | None, until: str | None) -> Period:
    """Return the period of a form, or refuse a text that is not a time."""
    try:
        return parse_period(since, until)
    except ParameterError as error:
        raise HTTPException(422, str(error)) from None
