"""People and programs: roles, passwords, sessions and tokens."""

import hashlib
import hmac
import math
import secrets
import threading
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache
from typing import Annotated, NamedTuple, TypeVar
from urllib.parse import parse_qsl, urlsplit

from fastapi import Depends, HTTPException, Request, Response, Security
from fastapi.concurrency import run_in_threadpool
from fastapi.openapi.models import HTTPBearer
from fastapi.security.base import SecurityBase
from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher
from pydantic import BaseModel, ValidationError

from sprung.errors import ParameterError
from sprung.online.site.shared import LIMITS, Context, context_of, describe_faults
from sprung.online.store import AccountRow, Store, TokenRow
from sprung.online.store.schema import DAY

#: Length of a session [ns].
SESSION = DAY // 2
#: Beginning of every token, by which programs that look for secrets know them.
_TOKEN = "sprung_"
#: Passwords that are verified at once: each takes 64 MB, and a processor.
_VERIFYING = threading.BoundedSemaphore(2)


class Role(StrEnum):
    """Permissions of a person: each role includes those before it."""

    VIEWER = "viewer"  # look at everything but accounts
    ENGINEER = "engineer"  # act on alerts, baselines and vehicles
    ADMIN = "admin"  # manage accounts and tokens

    def includes(self, other: "Role") -> bool:
        """Return whether this role may do what another may."""
        return list(Role).index(self) >= list(Role).index(other)


@dataclass(frozen=True, slots=True)
class Person:
    """Who makes a request.

    Parameters
    ----------
    name
        Name for the audit trail.
    role
        Role.
    secret
        Secret of the browser's session, from which its CSRF token is derived; empty for a program with a token.
    has_account
        Whether the person logged in; False on a machine without accounts.
    """

    name: str
    role: Role
    secret: str = ""
    has_account: bool = True

    @property
    def csrf_token(self) -> str:
        """Token of the forms of this session: another site can neither read nor guess it."""
        return hmac.new(self.secret.encode(), b"form", hashlib.sha256).hexdigest() if self.secret else ""


def add_account(store: Store, name: str, role: str, password: str, *, who: str, now: int) -> None:
    """Add an account, or give an existing one another role and password, which ends its sessions.

    Raises
    ------
    ParameterError
        If the name, role or password cannot be used.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from sprung.online.store import open_store
    >>> with TemporaryDirectory() as folder, open_store(f"sqlite:///{folder}/sprung.sqlite") as store:
    ...     add_account(store, "ada", "admin", "correct horse battery", who="install", now=0)
    ...     [(row.name, row.role) for row in store.accounts.all()]
    [('ada', 'admin')]
    """
    if not name.strip() or name != name.strip() or len(name) > LIMITS.max_name or not name.isprintable():
        raise ParameterError(
            f"name {name!r} must have 1 to {LIMITS.max_name} printable characters, no blank at either end"
        )
    _check_role(role)
    if not LIMITS.min_password <= len(password) <= LIMITS.max_password:
        raise ParameterError(
            f"a password must have {LIMITS.min_password} to {LIMITS.max_password} characters: give another"
        )
    known = store.accounts.find(name)
    if known is not None:
        _check_administrator_stays(store, known, role)
    created = now if known is None else known.created
    store.accounts.put(AccountRow(name, role, _hasher().hash(password), created))
    store.requests.audit(who, "account", name, {"role": role}, now=now)


def remove_account(store: Store, name: str, *, who: str, now: int) -> None:
    """Remove an account.

    Raises
    ------
    ParameterError
        If no account has that name, or it is the last administrator among other accounts.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from sprung.online.store import open_store
    >>> with TemporaryDirectory() as folder, open_store(f"sqlite:///{folder}/sprung.sqlite") as store:
    ...     add_account(store, "ada", "admin", "correct horse battery", who="install", now=0)
    ...     remove_account(store, "ada", who="install", now=0)
    ...     store.accounts.n_accounts()
    0
    """
    known = _require_account(store, name)
    if store.accounts.n_accounts() > 1:
        _check_administrator_stays(store, known, None)
    store.accounts.remove(name)
    store.requests.audit(who, "account removed", name, now=now)


def change_role(store: Store, name: str, role: str, *, who: str, now: int) -> None:
    """Give an account another role, which ends its sessions; its password stays.

    Raises
    ------
    ParameterError
        If no account has that name, the role is unknown, or it is the last administrator.
    """
    _check_role(role)
    known = _require_account(store, name)
    _check_administrator_stays(store, known, role)
    store.accounts.put(replace(known, role=role))
    store.requests.audit(who, "role", name, {"role": role}, now=now)


def log_in(store: Store, name: str, password: str, *, now: int) -> str | None:
    """Return the secret of a new session; None if name or password are wrong, which takes the same time."""
    row = store.accounts.find(name)
    known = _unknown() if row is None else row.password
    with _VERIFYING:
        is_right = _hasher().verify(password[: LIMITS.max_password], known)
    if not is_right or row is None:
        return None
    secret = secrets.token_urlsafe(32)
    store.accounts.add_session(_digest(secret), row.name, now=now, expires=now + SESSION)
    store.requests.audit(row.name, "logged in", row.name, now=now)
    return secret


def log_out(store: Store, secret: str) -> None:
    """End a session."""
    store.accounts.end_session(_digest(secret))


def of_session(store: Store, secret: str, *, now: int) -> Person | None:
    """Return who has a session; None if it does not exist or has ended."""
    row = store.accounts.of_session(_digest(secret), now=now)
    return None if row is None else Person(row.name, Role(row.role), secret)


def add_token(store: Store, name: str, role: str, *, days: float | None, who: str, now: int) -> tuple[int, str]:
    """Return number and secret of a new token for a program; the secret is shown only once.

    Parameters
    ----------
    store
        Store of the monitor.
    name
        Name of the program, for the audit trail.
    role
        Role of the program.
    days
        Time until it expires [days]; None: never.
    who
        Name of the operator.
    now
        Present time, UTC ns.

    Raises
    ------
    ParameterError
        If the name, role or time cannot be used.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from sprung.online.store import open_store
    >>> with TemporaryDirectory() as folder, open_store(f"sqlite:///{folder}/sprung.sqlite") as store:
    ...     number, secret = add_token(store, "dashboard", "viewer", days=30.0, who="ada", now=0)
    ...     [(row.name, row.role, row.expires) for row in store.accounts.tokens()]
    [('dashboard', 'viewer', 2592000000000000)]
    """
    if not name.strip() or len(name) > LIMITS.max_name or not name.isprintable():
        raise ParameterError(f"name {name!r} must have 1 to {LIMITS.max_name} printable characters")
    _check_role(role)
    if days is not None and not 0 < days <= 3660:
        raise ParameterError(f"days={days:g} must be above 0 and at most 3660")
    secret = _TOKEN + secrets.token_urlsafe(32)
    expires = None if days is None else now + round(days * 86400e9)
    number = store.accounts.add_token(TokenRow(_digest(secret), name.strip(), role, now, who, expires))
    store.requests.audit(who, "token", name.strip(), {"role": role, "number": number}, now=now)
    return number, secret


def remove_token(store: Store, number: int, *, who: str, now: int) -> None:
    """Revoke a token.

    Raises
    ------
    ParameterError
        If no token has that number.

    Examples
    --------
    >>> from tempfile import TemporaryDirectory
    >>> from sprung.online.store import open_store
    >>> with TemporaryDirectory() as folder, open_store(f"sqlite:///{folder}/sprung.sqlite") as store:
    ...     number, secret = add_token(store, "dashboard", "viewer", days=None, who="ada", now=0)
    ...     remove_token(store, number, who="ada", now=0)
    ...     store.accounts.tokens()
    []
    """
    if not store.accounts.remove_token(number):
        raise ParameterError(f"unknown token {number}: sprung tokens list shows all tokens")
    store.requests.audit(who, "token revoked", str(number), now=now)


def of_token(store: Store, secret: str, *, now: int) -> Person | None:
    """Return the program that has a token; None if it does not exist or has expired."""
    row = store.accounts.of_token(_digest(secret), now=now) if secret.startswith(_TOKEN) else None
    return None if row is None else Person(f"token {row.name}", Role(row.role))


def _check_role(role: str) -> None:
    """Refuse a role that does not exist."""
    if role not in list(Role):
        raise ParameterError(f"role {role!r} is unknown: give viewer, engineer or admin")


def _require_account(store: Store, name: str) -> AccountRow:
    known = store.accounts.find(name)
    if known is None:
        raise ParameterError(f"unknown account {name!r}: sprung accounts list shows all accounts")
    return known


def _check_administrator_stays(store: Store, known: AccountRow, role: str | None) -> None:
    """Refuse to take the role admin from the last account that has it."""
    others = [row for row in store.accounts.all() if row.role == Role.ADMIN and row.name != known.name]
    if known.role == Role.ADMIN and role != Role.ADMIN and not others:
        raise ParameterError(f"{known.name} is the last administrator: give another account the role admin first")


def _digest(secret: str) -> str:
    """Return the hash by which a secret is stored: one of 256 random bits needs no salt."""
    return hashlib.sha256(secret.encode()).hexdigest()


@cache
def _hasher() -> PasswordHash:
    return PasswordHash((Argon2Hasher(),))


@cache
def _unknown() -> str:
    """Return the hash of a password that nobody has."""
    return _hasher().hash(secrets.token_urlsafe(32))


T = TypeVar("T", bound=BaseModel)

#: Field of a form, and header of a request, with the CSRF token of the session.
CSRF_FIELD = "csrf_token"
CSRF_HEADER = "x-csrf-token"
_BEARER = "Authorization: Bearer TOKEN, with a token that `sprung tokens add NAME --role engineer` prints"


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
        raise HTTPException(401, f"log in, or send {_BEARER}", headers=headers)
    if not person.role.includes(role):
        raise HTTPException(403, f"this requires the role {role}, but {person.name} is {person.role}")
    return person


def check_csrf_token(request: Request, person: Person, given: str) -> None:
    """Refuse a request that changes something and does not come from a page of this session."""
    if request.method in {"GET", "HEAD", "OPTIONS"} or "authorization" in request.headers:
        return
    if not (person.csrf_token and hmac.compare_digest(person.csrf_token, given)):
        if request.url.path.startswith("/api/"):
            raise HTTPException(403, f"send {_BEARER}, or a session with its {CSRF_HEADER}; on a page: reload it")
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
