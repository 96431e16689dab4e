"""The commands `sprung accounts` and `sprung tokens`: who may use the pages and the interface of a monitor."""

import sys
import time
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.options import Json, option
from sprung.cli.output import show, write_result, written
from sprung.errors import ParameterError
from sprung.online.commands.stores import DEFAULT_STORE, StoreUrl, Who, existing_store, group

if TYPE_CHECKING:
    from sprung.online.store import Store

Role = Annotated[
    str,
    option("ROLE", "viewer (reads), engineer (also acts on alerts and baselines) or admin (also manages accounts)."),
]


def list_accounts(*, store: StoreUrl = DEFAULT_STORE, json: Json = None) -> None:
    """List accounts by name."""
    with existing_store(store) as opened:
        _print_accounts(opened, json)


accounts_application = group(list_accounts, "List the people who may log in; sub-commands add and remove them.")


@accounts_application.command("add")
def add_account(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the person.", show_default=False)],
    *,
    role: Role = "viewer",
    password_file: Annotated[
        Path | None, option("FILE", "File whose first line is the password; - for standard input; omit to be prompted.")
    ] = None,
    store: StoreUrl = DEFAULT_STORE,
    who: Who,
    json: Json = None,
) -> None:
    """Add an account, or change the role and password of one; the store is created if needed."""
    from sprung.online import site
    from sprung.online.store import open_store

    password = _password(password_file)
    with open_store(store) as opened:
        site.add_account(opened, name, role, password, who=who, now=time.time_ns())
        _print_accounts(opened, json)


@accounts_application.command("remove")
def remove_account(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the person.", show_default=False)],
    *,
    store: StoreUrl = DEFAULT_STORE,
    who: Who,
    json: Json = None,
) -> None:
    """Remove an account; its sessions end."""
    from sprung.online import site

    with existing_store(store) as opened:
        site.remove_account(opened, name, who=who, now=time.time_ns())
        _print_accounts(opened, json)


def list_tokens(*, store: StoreUrl = DEFAULT_STORE, json: Json = None) -> None:
    """List tokens, the oldest first."""
    with existing_store(store) as opened:
        _print_tokens(opened, json)


tokens_application = group(
    list_tokens, "List the programs that may use the interface; sub-commands add and remove them."
)


@tokens_application.command("add")
def add_token(
    name: Annotated[str, typer.Argument(metavar="NAME", help="Name of the program.", show_default=False)],
    *,
    role: Role = "viewer",
    days: Annotated[float | None, option("D", "Days until the token expires; omit for no expiry.")] = None,
    store: StoreUrl = DEFAULT_STORE,
    who: Who,
    json: Json = None,
) -> None:
    """Create a token for a program, and print its secret, which is not stored."""
    from sprung.online import site

    with existing_store(store) as opened:
        number, secret = site.add_token(opened, name, role, days=days, who=who, now=time.time_ns())
        _print_tokens(opened, json, made=(number, secret))


@tokens_application.command("remove")
def remove_token(
    number: Annotated[int, typer.Argument(metavar="NUMBER", help="Token number.", show_default=False)],
    *,
    store: StoreUrl = DEFAULT_STORE,
    who: Who,
    json: Json = None,
) -> None:
    """Revoke a token."""
    from sprung.online import site

    with existing_store(store) as opened:
        site.remove_token(opened, number, who=who, now=time.time_ns())
        _print_tokens(opened, json)


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


def _print_accounts(store: "Store", json: str | None) -> None:
    """Print accounts as a table, as JSON, or both."""
    from sprung.results import tables

    entries = [{"name": row.name, "role": row.role, "created": row.created} for row in store.accounts.all()]
    document = {"schema": "sprung.accounts/1", "accounts": entries}
    if write_result(document, json):
        empty = ["no accounts: the monitor serves this machine only, and anybody on it may act"]
        show(tables.accounts_table(document) if entries else empty, written([], json))


def _print_tokens(store: "Store", json: str | None, *, made: tuple[int, str] | None = None) -> None:
    """Print tokens as a table, as JSON, or both, with the secret of a new one."""
    from sprung.results import tables

    facts = ("name", "role", "created", "created_by", "expires")
    entries = [{"number": row.id, **{name: getattr(row, name) for name in facts}} for row in store.accounts.tokens()]
    for entry in entries:
        if made is not None and entry["number"] == made[0]:
            entry["secret"] = made[1]
    document = {"schema": "sprung.tokens/1", "tokens": entries}
    if write_result(document, json):
        secret = [] if made is None else [f"secret of token {made[0]}, shown only once: {made[1]}"]
        show(tables.tokens_table(document) if entries else ["no tokens"], [*secret, *written([], json)])
