"""Who makes a request, and whether that role may."""

import hmac
import math
import secrets
from typing import Annotated

from fastapi import HTTPException, Request, Response, Security
from fastapi.openapi.models import HTTPBearer
from fastapi.security.base import SecurityBase

from sprung.online.site.context import Context, context_of
from sprung.online.site.people import SESSION, Person, Role, log_in, of_session, of_token

#: Cookie of the session; the prefix makes browsers keep it to this host, and to TLS.
_COOKIE, _SECURE_COOKIE = "sprung_session", "__Host-sprung_session"
#: Methods that change nothing.
_READING = {"GET", "HEAD", "OPTIONS"}
#: Field of a form, and header of a request, with the CSRF token of the session.
CSRF_FIELD, CSRF_HEADER = "csrf_token", "x-csrf-token"
#: Greatest length of the secrets of browsers without an account.
_LONGEST_SECRET = 64


def cookie_name(context: Context) -> str:
    """Return the name of the session's cookie."""
    return _SECURE_COOKIE if context.is_secure else _COOKIE


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
    kind, _, token = request.headers.get("authorization", "").partition(" ")
    if token:
        return of_token(context.store, token.strip(), now=now) if kind.lower() == "bearer" else None
    secret = request.cookies.get(cookie_name(context), "")
    if context.is_open:
        is_kept = 20 <= len(secret) <= _LONGEST_SECRET
        return Person("local", Role.ADMIN, secret if is_kept else "", has_account=False)
    return of_session(context.store, secret, now=now) if secret else None


def enter(request: Request, name: str, password: str) -> Person:
    """Return the person who logs in.

    Raises
    ------
    HTTPException
        If name or password are wrong, or there were too many attempts.
    """
    context = context_of(request)
    address = request.client.host if request.client else ""
    wait = context.attempts.wait(address, name)
    if wait:
        seconds = math.ceil(wait)
        sentence = f"too many attempts: try again in {seconds} s"
        raise HTTPException(429, sentence, headers={"retry-after": str(seconds)})
    now = context.clock()
    secret = log_in(context.store, name, password, now=now)
    person = None if secret is None else of_session(context.store, secret, now=now)
    if person is None:
        raise HTTPException(401, "name or password is wrong: try again, or ask an administrator")
    return person


def new_secret() -> str:
    """Return a secret for a browser without an account."""
    return secrets.token_urlsafe(32)


def check_csrf_token(request: Request, person: Person, given: str) -> None:
    """Refuse a request that changes something and does not come from a page of this session."""
    if request.method in _READING or "authorization" in request.headers:
        return
    if not (person.csrf_token and hmac.compare_digest(person.csrf_token, given)):
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
        person = find_person(request)
        if person is None:
            headers = {"www-authenticate": "Bearer"}
            raise HTTPException(401, "log in, or send a token: Authorization: Bearer TOKEN", headers=headers)
        if not person.role.includes(self.role):
            raise HTTPException(403, f"this requires the role {self.role}, but {person.name} is {person.role}")
        check_csrf_token(request, person, request.headers.get(CSRF_HEADER, ""))
        return person


Viewer = Annotated[Person, Security(Allowed(Role.VIEWER), scopes=[Role.VIEWER])]
Engineer = Annotated[Person, Security(Allowed(Role.ENGINEER), scopes=[Role.ENGINEER])]
Admin = Annotated[Person, Security(Allowed(Role.ADMIN), scopes=[Role.ADMIN])]
