"""Pages for people: plain HTML from templates, which works without scripts; scripts only add movement and charts."""

from fastapi import APIRouter, Request
from fastapi.responses import HTMLResponse

from sprung.online.site.pages import (
    alerts,
    audit,
    charts,
    diagrams,
    fleet,
    interface,
    people,
    report,
    runs,
    session,
    site,
    vehicles,
)
from sprung.online.site.pages.rendering import page

#: Routes of all pages.
router = APIRouter(include_in_schema=False)
for part in (fleet, vehicles, diagrams, charts, alerts, runs, site, people, audit, interface, report, session):
    router.include_router(part.router)


def trouble(request: Request, status: int, title: str, sentence: str) -> HTMLResponse:
    """Return an error page."""
    return page(request, "trouble.html", status=status, title=title, sentence=sentence)
