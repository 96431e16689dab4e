"""People and programs: accounts and tokens."""

from typing import Annotated

from fastapi import APIRouter, HTTPException, Path, Query, Request
from fastapi.responses import RedirectResponse, Response

from sprung.errors import ParameterError
from sprung.online.site import people
from sprung.online.site.access import Admin
from sprung.online.site.context import Context, Shared
from sprung.online.site.models import AccountEntry, TokenEntry
from sprung.online.site.pages.forms import AdminForm
from sprung.online.site.pages.rendering import page
from sprung.online.site.people import Role

router = APIRouter()

#: Result of an action, by the word in the address.
_DONE = {
    "account": "The account is saved. It can log in now; its previous sessions have ended.",
    "role": "The role is changed; the sessions of the account have ended.",
    "removed": "The account is removed; its sessions have ended.",
    "revoked": "The token is revoked and no longer valid.",
}


@router.get("/people")
def show(request: Request, context: Shared, _: Admin, done: Annotated[str, Query(max_length=20)] = "") -> Response:
    """Show accounts and tokens."""
    return _page(request, context, notice=_DONE.get(done, ""))


@router.post("/people/accounts")
def put_account(context: Shared, form: AdminForm) -> Response:
    """Add an account, or change the role and password of one."""
    role = form.text("role")
    if fault := people.fault_of_first(form.person, role):
        raise HTTPException(400, fault)
    password = form.fields.get("password", "")
    people.add_account(context.store, form.text("name"), role, password, who=form.person.name, now=context.clock())
    return RedirectResponse("/people?done=account", 303)


@router.post("/people/accounts/role")
def change_role(context: Shared, form: AdminForm) -> Response:
    """Give an account another role."""
    name, role = form.text("name"), form.text("role")
    people.change_role(context.store, name, role, who=form.person.name, now=context.clock())
    return RedirectResponse("/people?done=role", 303)


@router.post("/people/accounts/remove")
def remove_account(context: Shared, form: AdminForm) -> Response:
    """Remove an account."""
    people.remove_account(context.store, form.text("name"), who=form.person.name, now=context.clock())
    return RedirectResponse("/people?done=removed", 303)


@router.post("/people/tokens")
def add_token(request: Request, context: Shared, form: AdminForm) -> Response:
    """Create a token, and show its secret, which is not stored."""
    days = _days(form.text("days"))
    _, secret = people.add_token(
        context.store, form.text("name"), form.text("role"), days=days, who=form.person.name, now=context.clock()
    )
    return _page(request, context, secret=secret, secret_of=form.text("name"))


@router.post("/people/tokens/{number}/revoke")
def revoke_token(context: Shared, form: AdminForm, number: Annotated[int, Path(ge=1, lt=2**63)]) -> Response:
    """Revoke a token."""
    people.remove_token(context.store, number, who=form.person.name, now=context.clock())
    return RedirectResponse("/people?done=revoked", 303)


def _page(request: Request, context: Context, *, notice: str = "", secret: str = "", secret_of: str = "") -> Response:
    """Return the page."""
    return page(
        request,
        "people.html",
        section="/people",
        notice=notice,
        secret=secret,
        secret_of=secret_of,
        is_open=context.is_open,
        roles=list(Role),
        accounts=[AccountEntry.model_validate(row) for row in context.store.accounts.all()],
        tokens=[TokenEntry.model_validate(row) for row in context.store.accounts.tokens()],
    )


def _days(text: str) -> float | None:
    """Return a number of days; None for an empty field.

    Raises
    ------
    ParameterError
        If it is no number.
    """
    try:
        return float(text) if text else None
    except ValueError:
        raise ParameterError(f"days={text!r} must be a number, such as 365, or be left out") from None
