"""The command line `sprung`: a module for each subject, which imports numerics only when a command runs."""

import os
import sys
from collections.abc import Callable, Sequence
from functools import update_wrapper
from importlib.metadata import distribution
from io import TextIOWrapper
from typing import Annotated, Any, TextIO

import typer
from typer.main import get_command, get_command_name, solve_typer_info_help

from sprung import __version__
from sprung.cli import diagnosis, identify, measured, recordings, simulate, vehicle_files
from sprung.cli.output import printable
from sprung.errors import DataError, IdentificationError, SprungError

DONE = 0
BAD_INPUT = 2
NO_ANSWER = 3
INTERRUPTED = 130
_HELP: dict[str, Any] = {"help_option_names": ["-h", "--help"]}


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments
        Words after the name of the program; default: those of the process.

    Returns
    -------
    int
        Exit code: 0 done, 2 bad usage or input, 3 not enough good data to answer, 130 interrupted.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small: more threads are slower
    os.environ.setdefault("PYDANTIC_DISABLE_PLUGINS", "__all__")  # the search for them reads every installed package
    sys.stdout, sys.stderr = _tolerant(sys.stdout), _tolerant(sys.stderr)
    words = sys.argv[1:] if arguments is None else arguments
    application = _application()
    if "_SPRUNG_COMPLETE" not in os.environ:
        _name_others(application, next((word for word in words if not word.startswith("-")), ""))
    command = get_command(application)
    _hide_types(command)
    return explained(lambda: command.main(arguments, prog_name="sprung", standalone_mode=False))


def explained(run: Callable[[], object]) -> int:
    """Call `run` and return its exit code; an error meant for users becomes one line on standard error."""
    try:
        code = run()
    except KeyboardInterrupt:
        return INTERRUPTED
    except (SprungError, typer.TyperException, MemoryError, OSError) as error:
        typer.echo(f"sprung: {printable(_sentence(error))}", err=True)
        return NO_ANSWER if isinstance(error, DataError | IdentificationError) else BAD_INPUT
    return code if isinstance(code, int) else DONE


def _sentence(error: Exception) -> str:
    """Return an error as a sentence: what, where, what to do."""
    if isinstance(error, typer.TyperException):
        context = getattr(error, "ctx", None)
        command = "sprung" if context is None else context.command_path
        problem = error.format_message().replace("Value error, ", "").rstrip(".")
        return f"{problem}: see {command} --help"
    if isinstance(error, MemoryError):
        return "not enough memory: give shorter records, or fewer channels with --channels"
    if isinstance(error, OSError):
        where = "" if error.filename is None else f"{error.filename}: "
        return f"{where}{error.strerror or error}: check the path"
    return str(error)


def _tolerant(stream: TextIO | None) -> TextIO:
    """Return a stream that writes "?" for characters that its encoding lacks; a closed one discards its text."""
    if stream is None:
        return open(os.devnull, "w", encoding="utf-8")
    if isinstance(stream, TextIOWrapper):
        stream.reconfigure(errors="replace")
    return stream


def _application() -> typer.Typer:
    """Return the application with its commands and those that the wings register by entry point."""
    application = typer.Typer(context_settings=_HELP, pretty_exceptions_enable=False)
    application.callback()(_common)
    for command in (
        recordings.info,
        recordings.convert,
        identify.identify,
        identify.track,
        measured.corners,
        measured.bounce,
        vehicle_files.describe,
        vehicle_files.calibrate,
        vehicle_files.fmu,
        diagnosis.baseline,
        diagnosis.diagnose,
        measured.plan,
        measured.road,
        measured.stability,
        measured.ride,
        diagnosis.compare,
        simulate.reproduce,
    ):
        application.command()(command)
    application.add_typer(simulate.simulate, name="simulate")
    for wing in sorted(distribution("sprung").entry_points.select(group="sprung.commands"), key=lambda each: each.name):
        wing.load()(application)
    return application


def _name_others(application: typer.Typer, word: str) -> None:
    """Leave of the commands that `word` does not call their names and first lines: options take a while to make."""
    for command in application.registered_commands:
        if command.callback is not None and word != (command.name or get_command_name(command.callback.__name__)):
            command.callback = update_wrapper(lambda: None, command.callback, ("__name__", "__doc__"), ())
            del command.callback.__wrapped__
    for group in application.registered_groups:
        if group.typer_instance is not None and word != group.name:
            group.typer_instance = typer.Typer(help=solve_typer_info_help(group))


def _hide_types(command: Any) -> None:
    """Show neither <bool> after flags nor <list[Path]> after arguments in the help of all commands.

    Lists of commands are plain text: what draws boxes takes half of the time of `sprung --help` to import.
    """
    if subcommands := getattr(command, "commands", {}):
        command.rich_markup_mode = None
    for parameter in (*command.params, command.get_help_option(typer.Context(command, **_HELP))):
        if getattr(parameter, "is_flag", False):
            parameter.metavar = ""
        if parameter.param_type_name == "argument":
            parameter.display_type_rich = lambda ctx: None
    for subcommand in subcommands.values():
        _hide_types(subcommand)


def _print_version(is_given: bool) -> None:
    """Print the version and exit if the option is given."""
    if is_given:
        typer.echo(f"sprung {__version__}")
        raise typer.Exit


def _common(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and exit.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Monitor a vehicle's suspension from sensors on its body."""
