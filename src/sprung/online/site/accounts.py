"""People and programs: roles, passwords, sessions and tokens."""

import hashlib
import hmac
import secrets
import threading
from dataclasses import dataclass, replace
from enum import StrEnum
from functools import cache

from pwdlib import PasswordHash
from pwdlib.hashers.argon2 import Argon2Hasher

from sprung.errors import ParameterError
from sprung.online.site.shared import LIMITS
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
