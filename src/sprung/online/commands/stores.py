"""The store of a monitor as an option of several commands, and groups of them."""

import getpass
import inspect
from collections.abc import Callable
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sprung.cli.options import option
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.online.store import Store

StoreUrl = Annotated[str, option("URL", "Store: sqlite:///FILE or postgresql://USER@HOST/NAME.", "--store")]
Who = Annotated[
    str, option("NAME", "Name of the operator.", "--who", show_default="the user", default_factory=getpass.getuser)
]
DEFAULT_STORE = "sqlite:///sprung-data/sprung.sqlite"


def existing_store(url: str) -> "Store":
    """Open a store that exists."""
    from sprung.online.store import open_store

    if url.startswith("sqlite:///") and not Path(url.removeprefix("sqlite:///")).exists():
        raise ParameterError(f"no store at {url}: pass the monitor's store with --store")
    return open_store(url)


def group(listing: Callable[..., None], text: str) -> typer.Typer:
    """Return a group of sub-commands, of which the first is "list"; without a sub-command it lists, too.

    Options in front of a sub-command are refused, as they would have no effect.
    """

    @wraps(listing)
    def alone(context: typer.Context, **options: Any) -> None:
        for parameter in context.command.params:
            source = context.get_parameter_source(parameter.name or "")
            if context.invoked_subcommand is not None and source is not None and source.name == "COMMANDLINE":
                option, command = parameter.opts[0], f"{context.command_path} {context.invoked_subcommand}"
                raise ParameterError(f"{option} must follow the sub-command: write {command} .. {option} ..")
        if context.invoked_subcommand is None:
            listing(**options)

    signature = inspect.signature(listing)
    first = inspect.Parameter("context", inspect.Parameter.POSITIONAL_OR_KEYWORD, annotation=typer.Context)
    alone.__dict__["__signature__"] = signature.replace(parameters=[first, *signature.parameters.values()])
    alone.__annotations__ = {"context": typer.Context, **listing.__annotations__}
    application = typer.Typer(invoke_without_command=True)
    application.callback(help=text)(alone)
    application.command("list")(listing)
    return application
