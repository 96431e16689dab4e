"""The interface under /api/v1 for alerts: lists, evidence, work orders, and the site's precision."""

from typing import Annotated

from fastapi import APIRouter, Query, Request
from fastapi.responses import JSONResponse
from pydantic import Field

from sprung.errors import ParameterError
from sprung.online.monitor.operations import send_work_order, work_order
from sprung.online.site import alert_views
from sprung.online.site.access import Engineer, Viewer
from sprung.online.site.alert_views import AlertCounts, Evidence, WantedAlerts
from sprung.online.site.api import Number
from sprung.online.site.context import Context, Shared
from sprung.online.site.models import Alerts, Done
from sprung.online.site.precision import Precision, precision
from sprung.results.documents import WorkOrderDocument

router = APIRouter(tags=["alerts"])


class _Page(WantedAlerts):
    """Which alerts are listed, and how many of them."""

    cursor: str | None = Field(None, pattern=alert_views.CURSOR)
    limit: int = Field(50, ge=1, le=200)


@router.get("/alerts")
def alerts(context: Shared, _: Viewer, wanted: Annotated[_Page, Query()]) -> Alerts:
    """Alerts, the most severe first."""
    return alert_views.alert_page(context, wanted, cursor=wanted.cursor, limit=wanted.limit)


@router.get("/alert-counts")
def counts(context: Shared, _: Viewer, wanted: Annotated[WantedAlerts, Query()]) -> AlertCounts:
    """Numbers of alerts by state and by step of severity."""
    return alert_views.alert_counts(context, wanted)


@router.get("/alerts/{number}/evidence")
def evidence(context: Shared, _: Viewer, number: Number) -> Evidence:
    """The evidence behind an alert: change, hypotheses, course of the evidence, windows."""
    return alert_views.evidence_of(context, number)


@router.get("/alerts/{number}/work-order", response_model=WorkOrderDocument)
def order(request: Request, context: Shared, person: Viewer, number: Number) -> JSONResponse:
    """The work order of an alert, `sprung.work-order/1`."""
    link = context.site.alert_url(number) or f"{request.base_url}alerts/{number}"
    document = work_order(context.store, number, who=person.name, now=context.clock(), link=link)
    return JSONResponse(document.as_json())


@router.post("/alerts/{number}/work-order")
def send(context: Shared, person: Engineer, number: Number) -> Done:
    """Send the work order of an alert through the webhooks of the site file."""
    return Done(sentence=send_order(context, number, who=person.name), number=number)


@router.get("/precision")
def site_precision(context: Shared, _: Viewer) -> Precision:
    """Precision of the alerts and times to repair, from the verdicts of the workshop."""
    return precision(context.store)


def send_order(context: Context, number: int, *, who: str) -> str:
    """Send the work order of an alert through the webhooks of the site file, and return the outcome in words.

    Raises
    ------
    ParameterError
        If there is no such work order, no webhook, or one that failed.
    """
    hooks = [hook.as_sender(f"webhook {k}") for k, hook in enumerate(context.site.send.webhook, start=1)]
    link = context.site.alert_url(number)
    results = send_work_order(context.store, number, hooks, who=who, now=context.clock(), link=link)
    words = "; ".join(f"{name}: {error or 'sent'}" for name, error in results.items())
    if any(results.values()):
        raise ParameterError(
            f"the work order was not delivered everywhere ({words}): correct the site file, or download it"
        )
    return f"the work order was sent ({words})"
