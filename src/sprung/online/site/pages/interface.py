"""The interface for programs, described by this server."""

from fastapi import APIRouter, Request
from fastapi.responses import Response

from sprung.online.site.access import Viewer
from sprung.online.site.context import Shared
from sprung.online.site.interface import operations, shapes
from sprung.online.site.pages.rendering import page

router = APIRouter()


@router.get("/api")
def show(request: Request, context: Shared, _: Viewer) -> Response:
    """Show all operations and what they take and return."""
    document = request.app.openapi()
    return page(
        request,
        "interface.html",
        section="/api",
        groups=operations(document, address=context.site.url or str(request.base_url)),
        shapes=shapes(document),
        document=request.app.openapi_url,
    )
