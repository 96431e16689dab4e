"""Pages for people."""

from fastapi import APIRouter, HTTPException
from fastapi.responses import PlainTextResponse

from sprung.monitor import desk
from sprung.service.access import Viewer
from sprung.service.api import Number
from sprung.service.context import Shared

router = APIRouter(include_in_schema=False)


@router.get("/alerts/{number}")
def alert(context: Shared, _: Viewer, number: Number) -> PlainTextResponse:
    """Show an alert, to which notifications lead."""
    text = desk.alert_in_words(context.store, number)
    if text is None:
        raise HTTPException(404, f"unknown alert {number}: sprung alerts list --all shows all alerts")
    return PlainTextResponse(text)
