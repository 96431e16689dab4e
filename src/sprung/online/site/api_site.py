"""The interface for the site: settings and state of the monitor, and tests of the senders."""

from typing import Annotated

from fastapi import APIRouter, Path

from sprung.online.site import site_views
from sprung.online.site.access import Engineer, Viewer
from sprung.online.site.context import Shared
from sprung.online.site.models import Done
from sprung.online.site.site_models import SiteDetail

router = APIRouter(tags=["site"])


@router.get("/site")
def site(context: Shared, _: Viewer) -> SiteDetail:
    """Settings, store, senders and state of the monitor itself."""
    return site_views.site_detail(context)


@router.post("/site/senders/{name}/test")
def try_sender(context: Shared, person: Engineer, name: Annotated[str, Path(max_length=64)]) -> Done:
    """Send a test message through a sender of the site file; the response states the outcome."""
    problem = site_views.try_sender(context, name, who=person.name)
    return Done(sentence=f"{name} failed: {problem}" if problem else f"{name} sent a test message")
