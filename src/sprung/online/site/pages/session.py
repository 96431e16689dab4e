"""Log in and out."""

from typing import Annotated

from fastapi import APIRouter, HTTPException, Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import RedirectResponse, Response

from sprung.online.site import people
from sprung.online.site.access import cookie_name, enter, set_session
from sprung.online.site.context import Shared
from sprung.online.site.pages.forms import ViewerForm, form_fields
from sprung.online.site.pages.rendering import page

router = APIRouter()


@router.get("/log-in")
def show(
    request: Request, context: Shared, wanted: Annotated[str, Query(alias="next", max_length=2000)] = "/"
) -> Response:
    """Show the form."""
    if context.is_open:
        return RedirectResponse("/", 303)
    return page(request, "log-in.html", trouble="", name="", next=_inside(wanted))


@router.post("/log-in")
async def log_in(request: Request, context: Shared) -> Response:
    """Log in, and continue to the requested page."""
    fields = await form_fields(request)
    name, following = fields.get("name", ""), _inside(fields.get("next", "/"))
    try:
        person = await run_in_threadpool(enter, request, name, fields.get("password", ""))
    except HTTPException as error:
        values = {"trouble": error.detail, "name": name, "next": following}
        return await run_in_threadpool(page, request, "log-in.html", status=error.status_code, **values)
    answer = RedirectResponse(following, 303)
    set_session(answer, context, person.secret)
    return answer


@router.post("/log-out")
def log_out(request: Request, context: Shared, _: ViewerForm) -> Response:
    """Log out."""
    people.log_out(context.store, request.cookies.get(cookie_name(context), ""))
    answer = RedirectResponse("/log-in", 303)
    answer.delete_cookie(cookie_name(context))
    return answer


def _inside(path: str) -> str:
    """Return a path of this site; the fleet for any other address."""
    is_inside = path.startswith("/") and not path.startswith(("//", "/\\")) and path.isprintable()
    return path if is_inside else "/"
