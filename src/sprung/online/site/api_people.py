"""The interface for people and programs: log in and out, accounts, tokens, audit trail."""

from typing import Annotated

from fastapi import APIRouter, HTTPException, Path, Query, Request, Response

from sprung.online.site import people
from sprung.online.site.access import Admin, Engineer, Viewer, cookie_name, enter, set_session
from sprung.online.site.context import Shared
from sprung.online.site.models import (
    AccountEntry,
    AuditEntry,
    Done,
    LogIn,
    NewAccount,
    NewRole,
    NewToken,
    TokenEntry,
    TokenMade,
    WhoAmI,
)

router = APIRouter(tags=["people"])


@router.get("/session")
def who_am_i(person: Viewer) -> WhoAmI:
    """Who makes this request."""
    return WhoAmI(name=person.name, role=person.role, has_account=person.has_account, csrf_token=person.csrf_token)


@router.post("/session")
def log_in(context: Shared, request: Request, response: Response, given: LogIn) -> WhoAmI:
    """Log in: the answer sets the cookie of the session."""
    person = enter(request, given.name, given.password)
    set_session(response, context, person.secret)
    return WhoAmI(name=person.name, role=person.role, has_account=True, csrf_token=person.csrf_token)


@router.delete("/session")
def log_out(context: Shared, request: Request, response: Response, _: Viewer) -> Done:
    """Log out."""
    people.log_out(context.store, request.cookies.get(cookie_name(context), ""))
    response.delete_cookie(cookie_name(context))
    return Done(sentence="logged out")


@router.get("/audit")
def audit(
    context: Shared,
    _: Engineer,
    before: Annotated[int | None, Query(ge=1, lt=2**63, description="id of an entry: earlier ones only")] = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> list[AuditEntry]:
    """The latest entries of the audit trail, in order of time."""
    rows = context.store.requests.audited(before=before, limit=limit)
    return [AuditEntry.model_validate(row) for row in rows]


@router.get("/accounts")
def accounts(context: Shared, _: Admin) -> list[AccountEntry]:
    """All accounts, by name."""
    return [AccountEntry.model_validate(row) for row in context.store.accounts.all()]


@router.put("/accounts")
def put_account(context: Shared, person: Admin, given: NewAccount) -> Done:
    """Add an account, or change the role and password of one."""
    if fault := people.fault_of_first(person, given.role):
        raise HTTPException(400, fault)
    people.add_account(context.store, given.name, given.role, given.password, who=person.name, now=context.clock())
    return Done(sentence=f"{given.name} can log in as {given.role}")


@router.patch("/accounts/{name}")
def change_role(context: Shared, person: Admin, name: Annotated[str, Path(max_length=64)], given: NewRole) -> Done:
    """Give an account another role."""
    people.change_role(context.store, name, given.role, who=person.name, now=context.clock())
    return Done(sentence=f"{name} is now {given.role}")


@router.delete("/accounts/{name}")
def remove_account(context: Shared, person: Admin, name: Annotated[str, Path(max_length=64)]) -> Done:
    """Remove an account."""
    people.remove_account(context.store, name, who=person.name, now=context.clock())
    return Done(sentence=f"{name} can no longer log in")


@router.get("/tokens")
def tokens(context: Shared, _: Admin) -> list[TokenEntry]:
    """All tokens, the oldest first."""
    return [TokenEntry.model_validate(row) for row in context.store.accounts.tokens()]


@router.post("/tokens", status_code=201)
def add_token(context: Shared, person: Admin, given: NewToken) -> TokenMade:
    """Create a token for a program."""
    number, secret = people.add_token(
        context.store, given.name, given.role, days=given.days, who=person.name, now=context.clock()
    )
    return TokenMade(number=number, secret=secret)


@router.delete("/tokens/{number}")
def remove_token(context: Shared, person: Admin, number: Annotated[int, Path(ge=1, lt=2**63)]) -> Done:
    """Revoke a token."""
    people.remove_token(context.store, number, who=person.name, now=context.clock())
    return Done(sentence=f"token {number} is revoked")
