"""The application: interface, pages, figures and health behind one guard, and the description of the interface."""

from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager
from http import HTTPStatus
from typing import Any
from urllib.parse import urlencode

from fastapi import APIRouter, Depends, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, JSONResponse, RedirectResponse, Response
from fastapi.staticfiles import StaticFiles
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp

from sprung import __version__
from sprung.errors import SprungError
from sprung.online.site import alert, alerts, fleet, job_card, live, outcomes, people, probes, runs, site
from sprung.online.site.accounts import Viewer
from sprung.online.site.guard import Attempts, Guard, RateLimit
from sprung.online.site.live import Feed
from sprung.online.site.rendering import page, plotly_file
from sprung.online.site.runs import RunResults
from sprung.online.site.shared import LIMITS, Context, Shared, describe_faults, is_loopback
from sprung.online.site.vehicles import baselines, diagrams, files, overview, trends, windows
from sprung.online.site.vehicles.diagrams import DiagramDesk
from sprung.online.store import RefusedError, StoreError

_pages = APIRouter(include_in_schema=False)
_SUBJECTS = (fleet, overview, windows, baselines, diagrams, files, alerts, alert, outcomes, runs, people, site)
#: All routes, by what their paths begin with.
ROUTERS = (
    *(("/api/v1", subject.api) for subject in (*_SUBJECTS, trends, live)),
    ("", probes.router),
    *(("", subject.pages) for subject in (*_SUBJECTS, job_card)),
    ("", _pages),
)
#: Titles of error pages.
_TITLES = {
    HTTPStatus.FORBIDDEN: "Not allowed",
    HTTPStatus.NOT_FOUND: "Not found",
    HTTPStatus.UNPROCESSABLE_ENTITY: "Invalid address",
    HTTPStatus.SERVICE_UNAVAILABLE: "The store does not answer",
}
#: Refusals that operations can meet.
_REFUSALS = {
    HTTPStatus.BAD_REQUEST: "The body cannot be read, or what it asks for is not allowed.",
    HTTPStatus.UNAUTHORIZED: "There is no valid token or session, or name or password is wrong.",
    HTTPStatus.FORBIDDEN: "The role does not include this, or the CSRF token of the session is missing.",
    HTTPStatus.NOT_FOUND: "Nothing has that name or number.",
    HTTPStatus.REQUEST_TIMEOUT: "The request took too long.",
    HTTPStatus.CONFLICT: "The action is impossible at present.",
    HTTPStatus.REQUEST_ENTITY_TOO_LARGE: "The request is too large.",
    HTTPStatus.MISDIRECTED_REQUEST: "The server does not answer to the name in Host.",
    HTTPStatus.UNPROCESSABLE_ENTITY: "A value is out of range, or is missing.",
    HTTPStatus.TOO_MANY_REQUESTS: "There were too many requests: Retry-After states how long to wait.",
    HTTPStatus.SERVICE_UNAVAILABLE: "The store does not answer.",
}


class Refusal(BaseModel):
    """Why a request was refused."""

    detail: str = Field(description="what is wrong, and what to do")


def application(context: Context, *, diagrams: DiagramDesk | None = None) -> ASGIApp:
    """Return the application that answers all requests.

    Parameters
    ----------
    context
        Store, settings and running monitor.
    diagrams
        Computes the diagrams of windows; None: one of its own.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from starlette.testclient import TestClient
    >>> from sprung.online.monitor import Site
    >>> from sprung.online.site import Context
    >>> from sprung.online.store import open_store
    >>> with TemporaryDirectory() as folder, open_store(f"sqlite:///{folder}/sprung.sqlite") as store:
    ...     context = Context(store, Site(), figures=dict, problems=list)
    ...     client = TestClient(application(context), base_url="http://127.0.0.1:8737")
    ...     client.get("/health").json()
    {'healthy': True, 'problems': []}
    """
    app = FastAPI(
        title="Sprung",
        version=__version__,
        summary="Vehicles, alerts and baselines of a monitor.",
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/v1/openapi.json",
        lifespan=_lifespan,
        responses={status.value: {"model": Refusal, "description": text} for status, text in _REFUSALS.items()},
    )
    app.state.context = context
    app.state.attempts = Attempts(context.timer)
    app.state.diagrams = DiagramDesk() if diagrams is None else diagrams
    app.state.feed = Feed(context.store)
    app.state.runs = RunResults(context.site.keep.results, context.timer)
    for prefix, router in ROUTERS:
        app.include_router(router, prefix=prefix, dependencies=[Depends(_check_query)] if prefix else [])
    app.mount("/static", StaticFiles(packages=[("sprung.online.site", "static")]))
    app.add_exception_handler(HTTPException, _refused)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(SprungError, _impossible)
    limit = RateLimit(LIMITS.rate, LIMITS.burst, context.timer)
    return Guard(app, limit=limit, hosts=_hosts(context), is_secure=context.is_secure)


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    """End the live events and the computing of diagrams with the application."""
    yield
    app.state.diagrams.close()
    await app.state.feed.close()


@_pages.get("/api")
def interface(request: Request, context: Shared, _: Viewer) -> Response:
    """Show the routes with the roles on which they insist; the OpenAPI document says what they take and return."""
    return page(
        request,
        "interface.html",
        section="/api",
        routes=sorted(routes_of(request.app.openapi()), key=lambda route: (route[0], route[2])),
        address=(context.site.url or str(request.base_url)).rstrip("/"),
    )


@_pages.get("/static/plotly.js")
def plotly(_: Viewer) -> FileResponse:
    """Send the library of the charts from the installed package; browsers keep it for a day."""
    return FileResponse(
        str(plotly_file()), media_type="text/javascript", headers={"cache-control": "private, max-age=86400"}
    )


def routes_of(document: Mapping[str, Any]) -> Iterator[tuple[str, str, str, str, str]]:
    """Yield tag, method, path, meaning and minimum role of every operation of an OpenAPI document."""
    for path, methods in document["paths"].items():
        for method, given in methods.items():
            scopes = [scope for entry in given.get("security", ()) for names in entry.values() for scope in names]
            yield given["tags"][0], method.upper(), path, given["description"], str(scopes[0]) if scopes else ""


async def _check_query(request: Request) -> None:
    """Refuse parameters of a query that the description of the interface does not name."""
    if not request.query_params:
        return
    path = "/api/v1" + request.scope["route"].path_format.removeprefix("/api/v1")  # with or without, by release
    described = request.app.openapi()["paths"][path][request.method.lower()].get("parameters", ())
    allowed = [given["name"] for given in described if given["in"] == "query"]
    unknown = [name for name in request.query_params if name not in allowed]
    if unknown:
        takes = f"use {', '.join(allowed)}" if allowed else "this route takes none"
        raise HTTPException(422, f"unknown query parameter {', '.join(map(repr, unknown))}: {takes}")


def _hosts(context: Context) -> frozenset[str] | None:
    """Return the names by which a server of this machine alone may be called; None: any."""
    host, _ = context.site.http_address
    if not is_loopback(host):
        return None
    own = context.site.url_host
    return frozenset({"localhost", "127.0.0.1", "[::1]", f"[{host}]" if ":" in host else host, *([own] if own else [])})


def _refused(request: Request, error: Exception) -> Response:
    """Answer a request that is not allowed or has no answer."""
    assert isinstance(error, HTTPException)
    if error.status_code == 401 and request.method == "GET" and _is_for_people(request):
        following = request.url.path + (f"?{request.url.query}" if request.url.query else "")
        return RedirectResponse(f"/log-in?{urlencode({'next': following})}", 303)
    return _answer(request, str(error.detail), error.status_code, error.headers)


def _invalid(request: Request, error: Exception) -> Response:
    """Answer a request with values out of range."""
    assert isinstance(error, RequestValidationError)
    faults = [{**fault, "loc": fault["loc"][1:]} for fault in error.errors()]
    return _answer(request, describe_faults(faults), 422)


def _impossible(request: Request, error: Exception) -> Response:
    """Answer a request for an impossible action, or if the store does not answer."""
    if isinstance(error, StoreError) and not isinstance(error, RefusedError):
        return _answer(request, str(error), 503, {"retry-after": "5"})
    return _answer(request, str(error), 404 if str(error).startswith("unknown ") else 409)


def _answer(request: Request, sentence: str, status: int, headers: Mapping[str, str] | None = None) -> Response:
    """Return a sentence as JSON, or as a page for a browser."""
    if _is_for_people(request):
        title = _TITLES.get(HTTPStatus(status), "This is not possible")
        return page(request, "problem.html", status=status, title=title, sentence=sentence)
    return JSONResponse({"detail": sentence}, status, headers=headers)


def _is_for_people(request: Request) -> bool:
    """Return whether a browser shows the answer."""
    return not request.url.path.startswith("/api/") and "text/html" in request.headers.get("accept", "")
