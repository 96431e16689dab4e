"""Who makes a request or sends a form, and whether that role may."""

import hmac
import math
from typing import Annotated, NamedTuple, TypeVar
from urllib.parse import parse_qsl, urlsplit

from fastapi import Depends, HTTPException, Request, Response, Security
from fastapi.concurrency import run_in_threadpool
from fastapi.openapi.models import HTTPBearer
from fastapi.security.base import SecurityBase
from pydantic import BaseModel, ValidationError

from sprung.errors import ParameterError
from sprung.online.site.accounts import SESSION, Person, Role, log_in, of_session, of_token
from sprung.online.site.shared import LIMITS, Context, context_of, describe_faults

T = TypeVar("T", bound=BaseModel)

#: Field of a form, and header of a request, with the CSRF token of the session.
CSRF_FIELD = "csrf_token"
CSRF_HEADER = "x-csrf-token"
_TOKEN = "Authorization: Bearer TOKEN, with a token that `sprung tokens add NAME --role engineer` prints"


def cookie_name(context: Context) -> str:
    """Return the name of the session's cookie; its prefix makes browsers keep it to this host, and to TLS."""
    return "__Host-sprung_session" if context.is_secure else "sprung_session"


def set_session(response: Response, context: Context, secret: str) -> None:
    """Give a browser the secret of its session."""
    response.set_cookie(
        cookie_name(context),
        secret,
        max_age=SESSION // 10**9,
        secure=context.is_secure,
        httponly=True,
        samesite="strict",
    )


def find_person(request: Request) -> Person | None:
    """Return the person who makes a request; None if unknown."""
    context = context_of(request)
    now = context.clock()
    given = request.headers.get("authorization")
    if given is not None:  # never the session as well, which would escape the check of its CSRF token
        kind, _, token = given.partition(" ")
        return of_token(context.store, token.strip(), now=now) if kind.lower() == "bearer" else None
    secret = request.cookies.get(cookie_name(context), "")
    if context.is_open:
        is_kept = LIMITS.min_secret <= len(secret) <= LIMITS.max_secret
        return Person("local", Role.ADMIN, secret if is_kept else "", has_account=False)
    return of_session(context.store, secret, now=now) if secret else None


def enter(request: Request, name: str, password: str) -> Person:
    """Return the person who logs in.

    Raises
    ------
    HTTPException
        If name or password are wrong, there were too many attempts, or a page of another site asks.
    """
    context = context_of(request)
    origin, own = (
        request.headers.get("origin"),
        (request.headers.get("host", ""), urlsplit(context.site.url or "").netloc),
    )
    if origin is not None and urlsplit(origin).netloc.lower() not in {name.lower() for name in own if name}:
        raise HTTPException(403, "a page of another site asks to log in: open this site, and set url in the site file")
    wait = math.ceil(request.app.state.attempts.wait(request.client.host if request.client else "", name))
    if wait:
        raise HTTPException(429, f"too many attempts: try again in {wait} s", headers={"retry-after": str(wait)})
    now = context.clock()
    secret = log_in(context.store, name, password, now=now)
    person = None if secret is None else of_session(context.store, secret, now=now)
    if person is None:
        raise HTTPException(401, "name or password is wrong: try again, or ask an administrator")
    return person


def require_role(request: Request, role: Role) -> Person:
    """Return who makes a request.

    Raises
    ------
    HTTPException
        If that is not known, or the role does not include another.
    """
    person = find_person(request)
    if person is None:
        headers = {"www-authenticate": "Bearer"}
        raise HTTPException(401, f"log in, or send {_TOKEN}", headers=headers)
    if not person.role.includes(role):
        raise HTTPException(403, f"this requires the role {role}, but {person.name} is {person.role}")
    return person


def check_csrf_token(request: Request, person: Person, given: str) -> None:
    """Refuse a request that changes something and does not come from a page of this session."""
    if request.method in {"GET", "HEAD", "OPTIONS"} or "authorization" in request.headers:
        return
    if not (person.csrf_token and hmac.compare_digest(person.csrf_token, given)):
        if request.url.path.startswith("/api/"):
            raise HTTPException(403, f"send {_TOKEN}, or a session with its {CSRF_HEADER}; on a page: reload it")
        raise HTTPException(403, "this form does not belong to your session: reload the page and try again")


class Allowed(SecurityBase):
    """Dependency that gives the person of a request, and refuses one whose role does not include another.

    Parameters
    ----------
    role
        Minimum role.
    """

    # How the interface describes it.
    scheme_name = "token"
    model = HTTPBearer(description="A token, or the session of a browser, with at least the role required.")

    def __init__(self, role: Role) -> None:
        self.role = role

    def __call__(self, request: Request) -> Person:
        """Return who makes a request."""
        person = require_role(request, self.role)
        check_csrf_token(request, person, request.headers.get(CSRF_HEADER, ""))
        return person


class Form(NamedTuple):
    """A form that was sent.

    Parameters
    ----------
    person
        Who sent it.
    fields
        Its fields by name; of several of one name the last.
    """

    person: Person
    fields: dict[str, str]

    def text(self, name: str) -> str:
        """Return a field, without blanks around; empty if it is not there."""
        return self.fields.get(name, "").strip()

    def body(self, kind: type[T]) -> T:
        """Return the fields as the body of a request: empty ones are left out, or null where they are required.

        Raises
        ------
        ParameterError
            If a value is out of range.
        """
        values = {name: self.text(name) or None for name in kind.model_fields}
        required = {name for name, field in kind.model_fields.items() if field.is_required()}
        try:
            return kind.model_validate({name: values[name] for name in values if values[name] or name in required})
        except ValidationError as error:
            raise ParameterError(describe_faults(error.errors())) from None


class FormOf:
    """Dependency that gives the form of a request, and refuses a person whose role does not include another.

    Parameters
    ----------
    role
        Minimum role.
    """

    def __init__(self, role: Role) -> None:
        self.role = role

    async def __call__(self, request: Request) -> Form:
        """Return the form of a request."""
        fields = await form_fields(request)
        person = await run_in_threadpool(require_role, request, self.role)
        check_csrf_token(request, person, fields.get(CSRF_FIELD, ""))
        return Form(person, fields)


async def form_fields(request: Request) -> dict[str, str]:
    """Return the fields of a form."""
    try:
        text = (await request.body()).decode()
        return dict(parse_qsl(text, keep_blank_values=True, max_num_fields=LIMITS.max_fields))
    except ValueError:
        raise HTTPException(400, "the form cannot be read: reload the page and try again") from None


Viewer = Annotated[Person, Security(Allowed(Role.VIEWER), scopes=[Role.VIEWER])]
Engineer = Annotated[Person, Security(Allowed(Role.ENGINEER), scopes=[Role.ENGINEER])]
Admin = Annotated[Person, Security(Allowed(Role.ADMIN), scopes=[Role.ADMIN])]
ViewerForm = Annotated[Form, Depends(FormOf(Role.VIEWER))]
EngineerForm = Annotated[Form, Depends(FormOf(Role.ENGINEER))]
AdminForm = Annotated[Form, Depends(FormOf(Role.ADMIN))]
