"""The commands `sprung accounts` and `sprung tokens`: who may use the pages and the interface of a monitor."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.options import Json, option
from sprung.errors import ParameterError
from sprung.online.commands.stores import DEFAULT_STORE, Found, StoreUrl, Who, group, on_store

if TYPE_CHECKING:
    from sprung.online.store import Store

Person = Annotated[str, typer.Argument(metavar="NAME", help="Name of the person.", show_default=False)]
Role = Annotated[
    str,
    option("ROLE", "viewer (reads), engineer (also acts on alerts and baselines) or admin (also manages accounts)."),
]


@on_store
def list_accounts(store: "Store") -> Found:
    """List accounts by name."""
    return _accounts(store)


accounts_application = group(list_accounts, "List the people who may log in. Sub-commands add and remove them.")


@accounts_application.command("add")
def add_account(
    name: Person,
    *,
    role: Role = "viewer",
    password_file: Annotated[
        Path | None, option("FILE", "File whose first line is the password; - for standard input; omit to be prompted.")
    ] = None,
    store: StoreUrl = DEFAULT_STORE,
    who: Who,
    json: Json = None,
) -> None:
    """Add an account, or change its role and password. The store is created if needed."""
    from sprung.online import site
    from sprung.online.store import open_store

    password = _password(password_file)
    with open_store(store) as opened:
        site.add_account(opened, name, role, password, who=who, now=time.time_ns())
        _accounts(opened).print(json)


@accounts_application.command("remove")
@on_store
def remove_account(store: "Store", name: Person, *, who: str) -> Found:
    """Remove an account; its sessions end."""
    from sprung.online import site

    site.remove_account(store, name, who=who, now=time.time_ns())
    return _accounts(store)


@on_store
def list_tokens(store: "Store") -> Found:
    """List tokens, the oldest first."""
    return _tokens(store)


tokens_application = group(list_tokens, "List the programs that may use the API. Sub-commands add and remove them.")


@tokens_application.command("add")
@on_store
def add_token(
    store: "Store",
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the program.", show_default=False)],
    *,
    role: Role = "viewer",
    days: Annotated[float | None, option("D", "Days until the token expires; omit for no expiry.")] = None,
    who: str,
) -> Found:
    """Create a token for a program, and print its secret. The secret is not stored."""
    from sprung.online import site

    number, secret = site.add_token(store, name, role, days=days, who=who, now=time.time_ns())
    found = _tokens(store)
    found.document["tokens"][-1]["secret"] = secret
    return found._replace(sentences=[f"secret of token {number}, shown only once: {secret}"])


@tokens_application.command("remove")
@on_store
def remove_token(
    store: "Store",
    number: Annotated[int, typer.Argument(metavar="NUMBER", help="Token number.", show_default=False)],
    *,
    who: str,
) -> Found:
    """Revoke a token."""
    from sprung.online import site

    site.remove_token(store, number, who=who, now=time.time_ns())
    return _tokens(store)


def _password(file: Path | None) -> str:
    """Return the password from a file, or from a prompt at the terminal."""
    if file is None and not sys.stdin.isatty():
        raise ParameterError("no terminal to prompt for a password: give --password-file FILE, or - for standard input")
    if file is None:
        return str(typer.prompt("Password", hide_input=True, confirmation_prompt=True, err=True))
    try:
        text = sys.stdin.read() if str(file) == "-" else file.read_text(encoding="utf-8")
    except (OSError, UnicodeError) as error:
        raise ParameterError(f"{file} cannot be read ({error}): give a file with the password") from None
    return text.split("\n", 1)[0].rstrip("\r")


def _accounts(store: "Store") -> Found:
    from sprung.results import tables

    entries = [{"name": row.name, "role": row.role, "created": row.created} for row in store.accounts.all()]
    document = {"schema": "sprung.accounts/1", "accounts": entries}
    empty = ["no accounts: the monitor serves this machine only, and anybody on it may act"]
    return Found(document, [tables.accounts_table(document) if entries else empty])


def _tokens(store: "Store") -> Found:
    from sprung.results import tables

    facts = ("name", "role", "created", "created_by", "expires")
    entries = [{"number": row.id, **{name: getattr(row, name) for name in facts}} for row in store.accounts.tokens()]
    document = {"schema": "sprung.tokens/1", "tokens": entries}
    return Found(document, [tables.tokens_table(document) if entries else ["no tokens"]])
