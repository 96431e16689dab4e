"""The store of a monitor, as an option of several commands."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.cli.options import option
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.online.store import Store

StoreUrl = Annotated[str, option("URL", "Store: sqlite:///FILE or postgresql://USER@HOST/NAME.", "--store")]
Who = Annotated[str | None, option("NAME", "Name of the operator.", "--who", show_default="the user")]
DEFAULT_STORE = "sqlite:///sprung-data/sprung.sqlite"


def existing_store(url: str) -> "Store":
    """Open a store that exists."""
    from sprung.online.store import open_store

    if url.startswith("sqlite:///") and not Path(url.removeprefix("sqlite:///")).exists():
        raise ParameterError(f"no store at {url}: pass the monitor's store with --store")
    return open_store(url)


def check_options_follow(context: typer.Context) -> None:
    """Refuse options in front of a sub-command: they would have no effect."""
    for parameter in context.command.params:
        source = context.get_parameter_source(parameter.name or "")
        if context.invoked_subcommand is not None and source is not None and source.name == "COMMANDLINE":
            option, command = parameter.opts[0], f"{context.command_path} {context.invoked_subcommand}"
            raise ParameterError(f"{option} must follow the sub-command: write {command} .. {option} ..")
