"""The job card of an alert, to print for the workshop: what to inspect, where, why and how."""

import re
from importlib.util import find_spec

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse, Response

from sprung.online.monitor.histories import mileage_of
from sprung.online.monitor.operations import require_alert, work_order
from sprung.online.site.accounts import Viewer
from sprung.online.site.guard import policy
from sprung.online.site.rendering import page
from sprung.online.site.shared import LIMITS, Context, Number, Shared
from sprung.results.page import pdf_of
from sprung.state import AlertState
from sprung.vehicles import Component

pages = APIRouter(include_in_schema=False)

#: What to inspect of each kind of part, and how.
_INSPECTIONS = {
    "spring": (
        "Ride height left and right, unloaded on level ground",
        "Broken coil or cracked leaf, spring seats; an air spring: leaks, levelling valve, pressure",
        "Stops and bump rubber: marks of contact",
    ),
    "damper": (
        "Oil on the body or rod of the damper, bent rod, dents",
        "Mounts and bushings: play, cracked rubber",
        "Damping left and right on a suspension tester; renew dampers of an axle in pairs",
    ),
    "tyre": (
        "Cold pressure of all tyres of the axle, against the plate",
        "Tread, cuts, bulges, flat spots; size and make alike on both sides",
        "Wheel bearing and wheel nuts: play",
    ),
    "sensor": (
        "Plug, cable and strain relief of the sensor",
        "Mounting: tight, at its stated place, axis as in the vehicle file",
        "Reading at rest: gravity on the vertical axis, 0 on the others",
    ),
}
_INSPECTIONS_OF_OTHERS = (
    "Play, wear and damage of the part and of its mounts",
    "The same part on the other side, for comparison",
)
#: Parts of a vehicle without a window that states them.
_OF_FOUR_WHEELS = [
    Component(corner, kind)
    for corner in ("front_left", "front_right", "rear_left", "rear_right")
    for kind in ("spring", "damper", "tyre")
]


@pages.get("/alerts/{number}/job-card")
def show(request: Request, context: Shared, person: Viewer, number: Number) -> HTMLResponse:
    """Show the job card of an alert, without anything that a printer could not show."""
    alert = require_alert(context.store, number)
    link = context.site.alert_url(number)
    order = work_order(context.store, number, who=person.name, now=context.clock(), link=link)
    kind = order.part.partition(" ")[0]
    answer = page(
        request,
        "job-card.html",
        alert=alert,
        order=order,
        has_pdf=find_spec("weasyprint") is not None,
        part=alert.name if alert.is_of_suspension else order.part,
        inspections=_INSPECTIONS.get(kind, _INSPECTIONS_OF_OTHERS),
        axles=_axles(context, alert),
        mileage=mileage_of(context.store, alert.vehicle, limit=LIMITS.max_windows),
    )
    styles = re.findall(r"<style>(.*?)</style>", bytes(answer.body).decode(), re.DOTALL)
    answer.headers["content-security-policy"] = policy(*styles)
    return answer


@pages.get("/alerts/{number}/job-card.pdf")
def show_pdf(request: Request, context: Shared, person: Viewer, number: Number) -> Response:
    """Give the job card of an alert as PDF."""
    content = pdf_of(bytes(show(request, context, person, number).body).decode())
    headers = {"content-disposition": f'attachment; filename="job-card-{number}.pdf"', "cache-control": "no-store"}
    return Response(content, media_type="application/pdf", headers=headers)


def _axles(context: Context, alert: AlertState) -> list[tuple[str, bool, bool]]:
    """Return the axles of a vehicle from front to rear, and whether the alert names their left and right side."""
    last = context.store.results.observations(alert.vehicle, limit=1)
    known = [Component.parse(name) for entry in last for name in entry.document.get("components") or ()]
    components = known or _OF_FOUR_WHEELS
    named = {(part.axle, part.side) for part in alert.names(components)}
    axles = dict.fromkeys(part.axle for part in components if part.side is not None)
    return [(axle, (axle, "left") in named, (axle, "right") in named) for axle in axles]
