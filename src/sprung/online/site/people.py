"""People and programs: log in and out, accounts, tokens, and the audit trail of what they did."""

import json
from typing import Annotated, Any

from fastapi import APIRouter, HTTPException, Query, Request
from fastapi.concurrency import run_in_threadpool
from fastapi.responses import RedirectResponse, Response
from pydantic import Field

from sprung.errors import ParameterError
from sprung.online.site import accounts
from sprung.online.site.accounts import Admin, AdminForm, Engineer, Person, Role, Viewer, ViewerForm
from sprung.online.site.rendering import page
from sprung.online.site.shared import LIMITS, Answer, Context, Done, Given, Line, Name, Number, Outcome, Shared
from sprung.online.store import AuditRow
from sprung.online.store.schema import LARGEST
from sprung.results.documents.monitoring import AccountEntry

api = APIRouter(tags=["people"])
pages = APIRouter(include_in_schema=False)

Before = Annotated[int | None, Query(ge=1, le=LARGEST, description="id of an entry: earlier ones only")]
#: Result of an action, by the word in the address.
_DONE = {
    "account": "The account is saved. It can log in now; its previous sessions have ended.",
    "role": "The role is changed; the sessions of the account have ended.",
    "removed": "The account is removed; its sessions have ended.",
    "revoked": "The token is revoked and no longer valid.",
}


class LogIn(Given):
    """Name and password."""

    name: Line
    password: str = Field(max_length=200)


class NewAccount(LogIn):
    """A person."""

    role: Line


class NewRole(Given):
    """Another role of a person."""

    role: Line


class NewToken(Given):
    """A program; days until its token expires, null: never."""

    name: Line
    role: Line
    days: float | None = None


class TokenEntry(Answer):
    """A program's token; its secret is not stored."""

    id: int
    name: str
    role: str
    created: int
    created_by: str
    expires: int | None


class TokenMade(Answer):
    """A new token; its secret is shown only once."""

    number: int
    secret: str


class WhoAmI(Answer):
    """Who makes this request; csrf_token: value of the header X-CSRF-Token of requests that change something."""

    name: str
    role: str
    has_account: bool
    csrf_token: str


@api.get("/session")
def who_am_i(person: Viewer) -> WhoAmI:
    """Who makes this request."""
    return WhoAmI.model_validate(person)


@api.post("/session")
def log_in(context: Shared, request: Request, response: Response, given: LogIn) -> WhoAmI:
    """Log in: the answer sets the cookie of the session."""
    person = accounts.enter(request, given.name, given.password)
    accounts.set_session(response, context, person.secret)
    return WhoAmI.model_validate(person)


@api.delete("/session")
def log_out(context: Shared, request: Request, response: Response, _: Viewer) -> Done:
    """Log out."""
    accounts.log_out(context.store, request.cookies.get(accounts.cookie_name(context), ""))
    response.delete_cookie(accounts.cookie_name(context))
    return Done(sentence="logged out")


@pages.get("/log-in")
def show_log_in(
    request: Request, context: Shared, wanted: Annotated[str, Query(alias="next", max_length=2000)] = "/"
) -> Response:
    """Show the form."""
    if context.is_open:
        return RedirectResponse("/", 303)
    return page(request, "log-in.html", problem="", name="", next=_inside(wanted))


@pages.post("/log-in")
async def log_in_by_form(request: Request, context: Shared) -> Response:
    """Log in, and continue to the requested page."""
    fields = await accounts.form_fields(request)
    name = fields.get("name", "")
    following = _inside(fields.get("next", "/"))
    try:
        person = await run_in_threadpool(accounts.enter, request, name, fields.get("password", ""))
    except HTTPException as error:
        values = {"problem": error.detail, "name": name, "next": following}
        return await run_in_threadpool(page, request, "log-in.html", status=error.status_code, **values)
    answer = RedirectResponse(following, 303)
    accounts.set_session(answer, context, person.secret)
    return answer


@pages.post("/log-out")
def log_out_by_form(request: Request, context: Shared, form: ViewerForm) -> Response:
    """Log out."""
    answer = RedirectResponse("/log-in", 303)
    log_out(context, request, answer, form.person)
    return answer


def _inside(path: str) -> str:
    """Return a path of this site; the fleet for any other address."""
    is_inside = path.startswith("/") and not path.startswith(("//", "/\\")) and path.isprintable()
    return path if is_inside else "/"


@api.get("/audit")
def audit(
    context: Shared,
    _: Engineer,
    before: Before = None,
    limit: Annotated[int, Query(ge=1, le=1000)] = 100,
) -> list[AuditRow]:
    """The latest entries of the audit trail, in order of time."""
    return context.store.requests.audited(before=before, limit=limit)


@pages.get("/audit")
def show_audit(request: Request, context: Shared, person: Engineer, before: Before = None) -> Response:
    """Show the audit trail, the latest action first."""
    entries = audit(context, person, before, LIMITS.page_entries + 1)[::-1]
    return page(
        request,
        "audit.html",
        section="/audit",
        entries=entries[: LIMITS.page_entries],
        following=entries[LIMITS.page_entries - 1].id if len(entries) > LIMITS.page_entries else None,
        before=before,
        limit=LIMITS.page_entries,
        days=context.site.keep.audit_days,
        written=_written,
    )


def _written(detail: Any) -> str:
    """Return the detail of an entry of the audit trail in words."""
    if isinstance(detail, dict):
        return ", ".join(
            f"{name}: {value if isinstance(value, str) else json.dumps(value)}" for name, value in detail.items()
        )
    return detail or "" if detail is None or isinstance(detail, str) else json.dumps(detail)


@api.get("/accounts")
def list_accounts(context: Shared, _: Admin) -> list[AccountEntry]:
    """All accounts, by name."""
    return [AccountEntry.model_validate(row, from_attributes=True) for row in context.store.accounts.all()]


@api.put("/accounts")
def put_account(context: Shared, person: Admin, given: NewAccount) -> Done:
    """Add an account, or change the role and password of one."""
    if not person.has_account and given.role != Role.ADMIN:
        raise HTTPException(400, "the first account must have the role admin: it manages the others")
    accounts.add_account(context.store, given.name, given.role, given.password, who=person.name, now=context.clock())
    return Done(sentence=f"{given.name} can log in as {given.role}")


@api.patch("/accounts/{name}")
def change_role(context: Shared, person: Admin, name: Name, given: NewRole) -> Done:
    """Give an account another role."""
    accounts.change_role(context.store, name, given.role, who=person.name, now=context.clock())
    return Done(sentence=f"{name} is now {given.role}")


@api.delete("/accounts/{name}")
def remove_account(context: Shared, person: Admin, name: Name) -> Done:
    """Remove an account."""
    accounts.remove_account(context.store, name, who=person.name, now=context.clock())
    return Done(sentence=f"{name} can no longer log in")


@api.get("/tokens")
def list_tokens(context: Shared, _: Admin) -> list[TokenEntry]:
    """All tokens, the oldest first."""
    return [TokenEntry.model_validate(row) for row in context.store.accounts.tokens()]


@api.post("/tokens", status_code=201)
def add_token(context: Shared, person: Admin, given: NewToken) -> TokenMade:
    """Create a token for a program."""
    number, secret = accounts.add_token(
        context.store, given.name, given.role, days=given.days, who=person.name, now=context.clock()
    )
    return TokenMade(number=number, secret=secret)


@api.delete("/tokens/{number}")
def remove_token(context: Shared, person: Admin, number: Number) -> Done:
    """Revoke a token."""
    accounts.remove_token(context.store, number, who=person.name, now=context.clock())
    return Done(sentence=f"token {number} is revoked")


@pages.get("/people")
def show(request: Request, context: Shared, person: Admin, done: Outcome = "") -> Response:
    """Show accounts and tokens."""
    return _page(request, context, person, notice=_DONE.get(done, ""))


@pages.post("/people/accounts")
def put_account_by_form(context: Shared, form: AdminForm) -> Response:
    """Add an account, or change the role and password of one."""
    given = NewAccount.model_construct(
        name=form.text("name"), role=form.text("role"), password=form.fields.get("password", "")
    )
    put_account(context, form.person, given)
    return RedirectResponse("/people?done=account", 303)


@pages.post("/people/accounts/role")
def change_role_by_form(context: Shared, form: AdminForm) -> Response:
    """Give an account another role."""
    change_role(context, form.person, form.text("name"), NewRole.model_construct(role=form.text("role")))
    return RedirectResponse("/people?done=role", 303)


@pages.post("/people/accounts/remove")
def remove_account_by_form(context: Shared, form: AdminForm) -> Response:
    """Remove an account."""
    remove_account(context, form.person, form.text("name"))
    return RedirectResponse("/people?done=removed", 303)


@pages.post("/people/tokens")
def add_token_by_form(request: Request, context: Shared, form: AdminForm) -> Response:
    """Create a token, and show its secret, which is not stored."""
    name = form.text("name")
    days = form.text("days")
    try:
        number = float(days) if days else None
    except ValueError:
        raise ParameterError(f"days={days!r} must be a number, such as 365, or be left out") from None
    given = NewToken.model_construct(name=name, role=form.text("role"), days=number)
    made = add_token(context, form.person, given)
    return _page(request, context, form.person, secret=made.secret, secret_of=name)


@pages.post("/people/tokens/{number}/revoke")
def remove_token_by_form(context: Shared, form: AdminForm, number: Number) -> Response:
    """Revoke a token."""
    remove_token(context, form.person, number)
    return RedirectResponse("/people?done=revoked", 303)


def _page(
    request: Request, context: Context, person: Person, *, notice: str = "", secret: str = "", secret_of: str = ""
) -> Response:
    """Return the page of accounts and tokens."""
    return page(
        request,
        "people.html",
        section="/people",
        notice=notice,
        secret=secret,
        secret_of=secret_of,
        is_open=context.is_open,
        roles=list(Role),
        accounts=list_accounts(context, person),
        tokens=list_tokens(context, person),
    )
