"""The interface to the diagrams of a window, which are computed from its samples on demand."""

import gzip
from typing import Literal

from fastapi import APIRouter, HTTPException, Request, Response

from sprung.online.site import diagram_views
from sprung.online.site.access import Viewer
from sprung.online.site.api import VehicleName
from sprung.online.site.api_vehicles import Place
from sprung.online.site.busy import BusyError
from sprung.online.site.context import Shared, context_of
from sprung.online.site.diagram_models import WindowDiagrams
from sprung.online.site.diagrams import RETRY, NoSamplesError

router = APIRouter(tags=["vehicles"])

Figure = Literal["spectra", "fit", "stabilisation", "levels"]


@router.get("/vehicles/{vehicle}/windows/{boot}/{number}/diagrams")
def diagrams(context: Shared, _: Viewer, vehicle: VehicleName, boot: Place, number: Place) -> WindowDiagrams:
    """Spectra, stabilisation diagram and subsets by level of a window; 503 with retry-after while they are computed."""
    try:
        return diagram_views.window_diagrams(context, vehicle, boot, number)
    except NoSamplesError as error:
        raise HTTPException(404, str(error)) from None
    except BusyError as error:
        raise HTTPException(503, str(error), headers={"retry-after": str(RETRY)}) from None


@router.get("/vehicles/{vehicle}/windows/{boot}/{number}/figures/{figure}", response_class=Response)
def figure(
    request: Request, _: Viewer, *, vehicle: VehicleName, boot: Place, number: Place, figure: Figure
) -> Response:
    """Figure of the diagrams of a window as SVG; 503 with retry-after while they are computed."""
    try:
        computed = diagram_views.computed_diagrams(context_of(request), vehicle, boot, number)
    except NoSamplesError as error:
        raise HTTPException(404, str(error)) from None
    except BusyError as error:
        raise HTTPException(503, str(error), headers={"retry-after": str(RETRY)}) from None
    if figure not in computed.pictures:
        notes = computed.error or "; ".join(computed.values.get("notes", ()))
        raise HTTPException(404, f"there is no figure {figure}: {notes}")
    picture, headers = computed.pictures[figure].encode(), {"cache-control": "no-store", "vary": "accept-encoding"}
    if "gzip" in request.headers.get("accept-encoding", ""):
        picture, headers["content-encoding"] = gzip.compress(picture, 6), "gzip"
    return Response(picture, media_type="image/svg+xml", headers=headers)
