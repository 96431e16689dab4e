"""What the commands on the store of a monitor share: their options, what they print, and groups of them."""

import getpass
import inspect
from collections.abc import Callable, Mapping, Sequence
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, NamedTuple

import typer

from sprung.cli.options import Json, option
from sprung.cli.output import show, write_result, written
from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.online.store import Store
    from sprung.results.tables import Table

StoreUrl = Annotated[str, option("URL", "Store: sqlite:///FILE or postgresql://USER@HOST/NAME.", "--store")]
Who = Annotated[
    str, option("NAME", "Name of the operator.", "--who", show_default="the user", default_factory=getpass.getuser)
]
DEFAULT_STORE = "sqlite:///sprung-data/sprung.sqlite"
_KEYWORD = inspect.Parameter.KEYWORD_ONLY
_STORE = inspect.Parameter("store", _KEYWORD, default=DEFAULT_STORE, annotation=StoreUrl)
_WHO = inspect.Parameter("who", _KEYWORD, annotation=Who)
_JSON = inspect.Parameter("json", _KEYWORD, default=None, annotation=Json)


class Found(NamedTuple):
    """What a command found.

    Parameters
    ----------
    document
        What `--json` writes.
    tables
        Tables of it, or what is printed in place of an empty one.
    sentences
        Sentences below them.
    """

    document: Mapping[str, Any]
    tables: "Sequence[Table | Sequence[str]]"
    sentences: Sequence[str] = ()

    def print(self, json: str | None) -> None:
        """Print tables and sentences, or the document as JSON, or both."""
        if write_result(self.document, json):
            show(*self.tables, [*self.sentences, *written([], json)])


def existing_store(url: str) -> "Store":
    """Open a store that exists."""
    from sprung.online.store import open_store

    if url.startswith("sqlite:///") and not Path(url.removeprefix("sqlite:///")).exists():
        raise ParameterError(f"no store at {url}: pass the monitor's store with --store")
    return open_store(url)


def on_store(command: Callable[..., Found]) -> Callable[..., None]:
    """Make a command of a function of an open store: with --store and --json, and --who where it takes a `who`."""
    signature = inspect.signature(command)
    own = [parameter for name, parameter in signature.parameters.items() if name not in {"store", "who"}]
    parameters = [*own, _STORE, *([_WHO] if "who" in signature.parameters else []), _JSON]

    @wraps(command)
    def run(*, store: str, json: str | None, **given: Any) -> None:
        with existing_store(store) as opened:
            command(opened, **given).print(json)

    vars(run)["__signature__"] = signature.replace(parameters=parameters, return_annotation=None)
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


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
