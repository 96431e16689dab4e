"""The library of the charts, from the installed package."""

from importlib import resources

from fastapi import APIRouter
from fastapi.responses import FileResponse

from sprung.online.site.access import Viewer

router = APIRouter()


@router.get("/static/plotly.js")
def plotly(_: Viewer) -> FileResponse:
    """Send the library, which browsers keep for a day."""
    path = resources.files("plotly") / "package_data" / "plotly.min.js"
    return FileResponse(str(path), media_type="text/javascript", headers={"cache-control": "private, max-age=86400"})
