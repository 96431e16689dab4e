"""The application of the pages and the interface: its routes, errors and server."""

import asyncio
import socket
import threading
from collections.abc import AsyncIterator, Iterator, Mapping
from contextlib import asynccontextmanager
from http import HTTPStatus
from typing import Any
from urllib.parse import urlencode

import uvicorn
from fastapi import APIRouter, Depends, FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import FileResponse, JSONResponse, RedirectResponse, Response
from fastapi.staticfiles import StaticFiles
from pydantic import BaseModel, Field
from starlette.exceptions import HTTPException
from starlette.types import ASGIApp
from uvicorn.protocols.http.h11_impl import H11Protocol

from sprung import __version__
from sprung.errors import ParameterError, SprungError
from sprung.online.site import alert, alerts, fleet, job_card, live, people, runs, site
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
_SUBJECTS = (fleet, overview, windows, baselines, diagrams, files, alerts, alert, runs, people, site)
#: All routes, by what their paths begin with.
ROUTERS = (
    *(("/api/v1", subject.api) for subject in (*_SUBJECTS, trends, live)),
    ("", live.router),
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


class Server:
    """Serves pages, interface, figures and health.

    Parameters
    ----------
    context
        Store, settings and running monitor.

    Raises
    ------
    ParameterError
        If other machines could reach it without accounts or TLS.
    """

    def __init__(self, context: Context) -> None:
        check_exposure(context)
        self._context = context
        self._socket: socket.socket | None = None
        self._server: uvicorn.Server | None = None
        self._thread: threading.Thread | None = None

    @property
    def address(self) -> tuple[str, int]:
        """Host and port; for a free port of any number, known once the server is open."""
        host, port = self._context.site.http_address
        return host, port if self._socket is None else int(self._socket.getsockname()[1])

    def open(self) -> None:
        """Start answering.

        Raises
        ------
        ParameterError
            If the address, the certificate or its key cannot be used.
        """
        host, port = self._context.site.http_address
        web = self._context.site.web
        try:
            family = socket.AF_INET6 if ":" in host else socket.AF_INET
            self._socket = socket.create_server((host, port), family=family, backlog=128)
        except OSError as error:
            raise ParameterError(f"cannot listen at {host}:{port} ({error.strerror}): give another --http") from None
        config = uvicorn.Config(
            application(self._context),
            http=_Patient,
            ws="none",
            lifespan="on",
            log_config=None,
            log_level="error",  # requests that cannot be read are the fault of their senders
            access_log=False,
            server_header=False,
            proxy_headers=web.behind_proxy,
            timeout_keep_alive=LIMITS.keep_alive,
            timeout_graceful_shutdown=LIMITS.grace,
            limit_concurrency=LIMITS.max_connections,
            h11_max_incomplete_event_size=LIMITS.max_head,
            ssl_certfile=web.certificate,
            ssl_keyfile=web.key,
        )
        try:
            config.load()
        except OSError as error:
            self._socket.close()
            raise ParameterError(f"certificate {web.certificate} or key {web.key} cannot be used: {error}") from None
        self._server = uvicorn.Server(config)
        serving = self._server.serve([self._socket])
        self._thread = threading.Thread(target=asyncio.run, args=(serving,), name="http", daemon=True)
        self._thread.start()

    def close(self) -> None:
        """Stop."""
        if self._server is not None and self._thread is not None and self._socket is not None:
            self._server.should_exit = True
            self._thread.join(2.0 * LIMITS.grace)
            self._socket.close()
            self._socket = self._server = self._thread = None


def check_exposure(context: Context) -> None:
    """Refuse to serve other machines without accounts, or without TLS.

    Raises
    ------
    ParameterError
        If the site's address is not of this machine alone, and it has no accounts, or neither TLS nor a proxy.
    """
    host, web = context.site.http_address[0], context.site.web
    if is_loopback(host):
        return
    if not context.store.accounts.n_accounts():
        raise ParameterError(
            f"http {context.site.http} would let every machine that reaches {host} act without a password: add an "
            "account first (sprung accounts add NAME --role admin), or listen at 127.0.0.1"
        )
    if web.certificate is None and not web.behind_proxy:
        raise ParameterError(
            f"http {context.site.http} would send passwords unencrypted: give certificate and key in [web] of the "
            "site file, or set behind_proxy = true where a proxy provides TLS"
        )


class _Patient(H11Protocol):
    """A connection that ends if no request comes, or if what was sent is not taken, after a while."""

    _heads: asyncio.TimerHandle | None = None
    _writes: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Any) -> None:
        """Begin a connection."""
        super().connection_made(transport)
        self._await_head()

    def on_response_complete(self) -> None:
        """Wait for the next request."""
        super().on_response_complete()
        self._await_head()

    def pause_writing(self) -> None:
        """Begin to wait for the client to take what was sent."""
        super().pause_writing()
        self._writes = self.loop.call_later(LIMITS.write_timeout, self.transport.abort)

    def resume_writing(self) -> None:
        """Resume, as the client took what was sent."""
        super().resume_writing()
        _cancel(self._writes)

    def connection_lost(self, exc: Exception | None) -> None:
        """End a connection."""
        _cancel(self._heads)
        _cancel(self._writes)
        super().connection_lost(exc)

    def _await_head(self) -> None:
        """Limit the time until the next request, however slowly its head comes."""
        _cancel(self._heads)
        self._heads = self.loop.call_later(LIMITS.head_timeout, self._give_up)

    def _give_up(self) -> None:
        """End the connection if there is no request, when the client has what was sent, or after a while."""
        if self.cycle is None or self.cycle.response_complete:
            self._heads = self.loop.call_later(LIMITS.write_timeout, self.transport.abort)
            self.transport.close()


def _cancel(timer: asyncio.TimerHandle | None) -> None:
    if timer is not None:
        timer.cancel()
