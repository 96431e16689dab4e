"""Files about a vehicle and period: reports, one at a time, and tables."""

import re
import threading
from typing import Annotated
from urllib.parse import quote

from fastapi import APIRouter, HTTPException, Query, Request, Response
from fastapi.responses import HTMLResponse, StreamingResponse

from sprung.errors import ParameterError
from sprung.online.monitor import exports
from sprung.online.monitor.exports import MEDIA_TYPES, FileFormat, What
from sprung.online.monitor.vehicle_report import vehicle_report
from sprung.online.site.accounts import Viewer
from sprung.online.site.guard import policy
from sprung.online.site.rendering import page
from sprung.online.site.shared import LIMITS, Context, Shared, VehicleName
from sprung.results.page import render
from sprung.results.tables.wording import Period, parse_period

api = APIRouter(tags=["files"])
pages = APIRouter(include_in_schema=False)

#: A date or time as people and forms write it, or UTC ns.
Moment = Annotated[str | None, Query(max_length=40, description="date or time of ISO 8601, or UTC ns")]
#: Figures take memory and a processor.
_DRAWING = threading.Lock()


@api.get("/vehicles/{vehicle}/report", response_class=HTMLResponse)
def report(
    context: Shared, _: Viewer, vehicle: VehicleName, *, since: Moment = None, until: Moment = None
) -> HTMLResponse:
    """Report of a vehicle and period, one page that needs no network."""
    return _report(context, vehicle, _period(since, until), kind="attachment")


@pages.get("/vehicles/{vehicle}/export")
@api.get(
    "/vehicles/{vehicle}/export",
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
    since: Moment = None,
    until: Moment = None,
) -> StreamingResponse:
    """Windows, modes, findings or alerts of a vehicle and period as a table."""
    period = _period(since, until)
    pieces = exports.export(context.store, vehicle, what, file_format=file_format, period=period)
    headers = _headers("attachment", f"{vehicle}-{what}.{file_format}")
    return StreamingResponse(pieces, media_type=MEDIA_TYPES[file_format], headers=headers)


@pages.get("/vehicles/{vehicle}/report")
def show(
    request: Request, context: Shared, _: Viewer, vehicle: VehicleName, *, since: Moment = None, until: Moment = None
) -> Response:
    """Show the report."""
    period = _period(since, until)
    try:
        return _report(context, vehicle, period, kind="inline")
    except HTTPException as error:
        answer = page(request, "problem.html", status=503, title="One report at a time", sentence=error.detail)
        answer.headers.update(error.headers or {})
        return answer


def _report(context: Context, vehicle: str, period: Period, *, kind: str) -> HTMLResponse:
    """Return the report of a vehicle and period, or refuse it while another one is being written."""
    if not _DRAWING.acquire(blocking=False):
        sentence = f"another report is being written: try again in {LIMITS.retry_report} s"
        raise HTTPException(503, sentence, headers={"retry-after": str(LIMITS.retry_report)})
    try:
        text = render(vehicle_report(context.store, vehicle, period=period, now=context.clock()))
    finally:
        _DRAWING.release()
    styles = re.findall(r"<style[^>]*>(.*?)</style>", text, re.DOTALL)
    headers = _headers(kind, f"{vehicle}-report.html") | {"content-security-policy": policy(*sorted(set(styles)))}
    return HTMLResponse(text, headers=headers)


def _headers(kind: str, name: str) -> dict[str, str]:
    """Return the headers of a file: "attachment" is saved, "inline" is shown."""
    plain = "".join(letter if letter.isascii() and (letter.isalnum() or letter in "-_.") else "_" for letter in name)
    disposition = f"{kind}; filename=\"{plain}\"; filename*=UTF-8''{quote(name, safe='')}"
    return {"content-disposition": disposition, "cache-control": "no-store"}


def _period(since: str | None, until: str | None) -> Period:
    """Return a period, or refuse one that ends before it begins, or a text that is not a time."""
    try:
        return parse_period(since, until)
    except ParameterError as error:
        raise HTTPException(422, str(error)) from None
