"""The interface for programs: its routes, and where its description is."""

from collections.abc import Iterator, Mapping
from typing import Any

from fastapi import APIRouter, Request
from fastapi.responses import Response

from sprung.online.site.access import Viewer
from sprung.online.site.context import Shared
from sprung.online.site.pages.rendering import page

router = APIRouter()


@router.get("/api")
def show(request: Request, context: Shared, _: Viewer) -> Response:
    """Show the routes with the roles on which they insist; the OpenAPI document says what they take and return."""
    return page(
        request,
        "interface.html",
        section="/api",
        routes=sorted(routes_of(request.app.openapi()), key=lambda route: (route[0], route[2])),
        document=request.app.openapi_url,
        address=(context.site.url or str(request.base_url)).rstrip("/"),
    )


def routes_of(document: Mapping[str, Any]) -> Iterator[tuple[str, str, str, str, str]]:
    """Yield tag, method, path, meaning and least role of every operation of an OpenAPI document."""
    for path, methods in document["paths"].items():
        for method, given in methods.items():
            tag = (given.get("tags") or ["other"])[0]
            scopes = [scope for entry in given.get("security", ()) for names in entry.values() for scope in names]
            meaning = given.get("description", given.get("summary", ""))
            yield tag, method.upper(), path, meaning, str(scopes[0]) if scopes else ""
