"""The application: interface, pages, figures and health behind one guard."""

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from fastapi import FastAPI, Request
from fastapi.exceptions import RequestValidationError
from fastapi.responses import JSONResponse
from starlette.exceptions import HTTPException

from sprung import __version__
from sprung.errors import SprungError
from sprung.service import api, api_people, pages, probes
from sprung.service.context import Context, is_loopback
from sprung.service.guard import App, Guard, RateLimit
from sprung.storage import RefusedError, StoreError

#: All routes, by what their paths begin with.
ROUTERS = (("/api/v1", api.router), ("/api/v1", api_people.router), ("", probes.router), ("", pages.router))
#: Requests of one address: in the long run [1/s], and at once.
_RATE, _BURST = 50.0, 300.0


def application(context: Context) -> App:
    """Return the application that answers all requests.

    Parameters
    ----------
    context
        Store, settings and running monitor.
    """
    app = FastAPI(
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
    app.add_exception_handler(HTTPException, _refused)
    app.add_exception_handler(RequestValidationError, _invalid)
    app.add_exception_handler(SprungError, _impossible)
    limit = RateLimit(_RATE, _BURST, context.timer)
    return Guard(app, limit=limit, hosts=_hosts(context), is_secure=context.is_secure)


@asynccontextmanager
async def _lifespan(app: FastAPI) -> AsyncIterator[None]:
    """End the live events with the application."""
    yield
    await app.state.context.feed.close()


def _hosts(context: Context) -> frozenset[str] | None:
    """Return the names by which a server of this machine alone may be called; None: any."""
    host, _ = context.site.http_address
    if not is_loopback(host):
        return None
    own = context.site.url_host
    return frozenset({"localhost", "127.0.0.1", "[::1]", f"[{host}]" if ":" in host else host, *([own] if own else [])})


async def _refused(_: Request, error: Exception) -> JSONResponse:
    """Answer a request that is not allowed or has no answer."""
    assert isinstance(error, HTTPException)
    return JSONResponse({"detail": error.detail}, error.status_code, headers=error.headers)


async def _invalid(_: Request, error: Exception) -> JSONResponse:
    """Answer a request with values out of range."""
    assert isinstance(error, RequestValidationError)
    faults = [f"{'.'.join(map(str, fault['loc'][1:])) or 'body'}: {fault['msg']}" for fault in error.errors()]
    return JSONResponse({"detail": "; ".join(faults)}, 422)


async def _impossible(_: Request, error: Exception) -> JSONResponse:
    """Answer an act that is impossible, or a store that does not answer."""
    if isinstance(error, StoreError) and not isinstance(error, RefusedError):
        return JSONResponse({"detail": str(error)}, 503, headers={"retry-after": "5"})
    is_unknown = str(error).startswith("unknown ")
    return JSONResponse({"detail": str(error)}, 404 if is_unknown else 409)
