"""Errors as one line on standard error and an exit code."""

from collections.abc import Callable

import typer

from sprung.cli.output import printable
from sprung.errors import DataError, IdentificationError, SprungError

DONE, BAD_INPUT, NO_ANSWER, INTERRUPTED = 0, 2, 3, 130


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
