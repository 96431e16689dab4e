"""The application: interface, pages, figures and health behind one guard."""

from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Any
from urllib.parse import urlencode

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse, RedirectResponse, Response
from fastapi.staticfiles import StaticFiles
from starlette.exceptions import HTTPException

from sprung import __version__
from sprung.errors import SprungError
from sprung.online.site import (
    api,
    api_alerts,
    api_diagrams,
    api_files,
    api_people,
    api_runs,
    api_site,
    api_vehicles,
    pages,
    probes,
)
from sprung.online.site.context import Context, is_loopback
from sprung.online.site.guard import App, Guard, RateLimit
from sprung.online.site.refusals import with_refusals
from sprung.online.store import RefusedError, StoreError

#: All routes, by what their paths begin with.
ROUTERS = (
    ("/api/v1", api.router),
    ("/api/v1", api_vehicles.router),
    ("/api/v1", api_diagrams.router),
    ("/api/v1", api_alerts.router),
    ("/api/v1", api_files.router),
    ("/api/v1", api_runs.router),
    ("/api/v1", api_people.router),
    ("/api/v1", api_site.router),
    ("", probes.router),
    ("", pages.router),
)
#: Titles of error pages.
_TITLES = {403: "Not allowed", 404: "Not found", 422: "Invalid address", 503: "The store does not answer"}
#: Requests of one address: in the long run [1/s], and at once.
_RATE, _BURST = 50.0, 300.0


def application(context: Context) -> App:
    """Return the application that answers all requests.

    Parameters
    ----------
    context
        Store, settings and running monitor.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from starlette.testclient import TestClient
    >>> from sprung.online.monitor import Site
    >>> from sprung.online.site import Context
    >>> from sprung.online.store import open_store
    >>> with TemporaryDirectory() as folder, open_store(f"sqlite:///{folder}/sprung.sqlite") as store:
    ...     context = Context(store, Site(), figures=dict, troubles=list)
    ...     client = TestClient(application(context), base_url="http://127.0.0.1:8737")
    ...     client.get("/health").json()
    {'healthy': True, 'troubles': []}
    """
    app = _Application(
        title="Sprung",
        version=__version__,
        summary="Vehicles, alerts and baselines of a monitor.",
        docs_url=None,
        redoc_url=None,
        openapi_url="/api/v1/openapi.json",
        lifespan=_lifespan,
    )
    app.state.context = context
    for prefix, router in ROUTERS:
        app.include_router(router, prefix=prefix)
    app.mount("/static", StaticFiles(packages=[("sprung.online.site", "static")]))
    app.add_exception_handler(HTTPException, _refused)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(SprungError, _impossible)
    limit = RateLimit(_RATE, _BURST, context.timer)
    return Guard(app, limit=limit, hosts=_hosts(context), is_secure=context.is_secure)


class _Application(FastAPI):
    """An application whose OpenAPI document states all refusals."""

    def openapi(self) -> dict[str, Any]:
        """Return the OpenAPI document."""
        if self.openapi_schema is None:
            self.openapi_schema = with_refusals(super().openapi())
        return self.openapi_schema


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    """End the live events and the computing of diagrams with the application."""
    yield
    app.state.context.diagrams.close()
    await app.state.context.feed.close()


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
    faults = [f"{'.'.join(map(str, fault['loc'][1:])) or 'body'}: {fault['msg']}" for fault in error.errors()]
    return _answer(request, "; ".join(faults), 422)


def _impossible(request: Request, error: Exception) -> Response:
    """Answer a request for an impossible action, or if the store does not answer."""
    if isinstance(error, StoreError) and not isinstance(error, RefusedError):
        return _answer(request, str(error), 503, {"retry-after": "5"})
    return _answer(request, str(error), 404 if str(error).startswith("unknown ") else 409)


def _answer(request: Request, sentence: str, status: int, headers: Mapping[str, str] | None = None) -> Response:
    """Return a sentence as JSON, or as a page for a browser."""
    if _is_for_people(request):
        title = _TITLES.get(status, "This is not possible")
        return pages.trouble(request, status, title, sentence)
    return JSONResponse({"detail": sentence}, status, headers=headers)


def _is_for_people(request: Request) -> bool:
    """Return whether a browser shows the answer."""
    return not request.url.path.startswith("/api/") and "text/html" in request.headers.get("accept", "")
