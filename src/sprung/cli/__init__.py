"""The command line `sprung`: each command in a module of its own, imported without numerics until it runs."""

import os
import sys
from collections.abc import Sequence
from io import TextIOWrapper
from typing import Annotated, TextIO

import typer
from typer.main import get_command

from sprung import __version__
from sprung.cli import (
    alerts,
    baseline,
    box,
    corners,
    demo,
    diagnose,
    identify,
    info,
    monitor,
    replay,
    reproduce,
    simulate,
    vehicles,
)
from sprung.cli.failures import explained
from sprung.cli.help import Command, Group


def main(arguments: Sequence[str] | None = None) -> int:
    """Run the command line.

    Parameters
    ----------
    arguments
        Words after the program's name; default: those of the process.

    Returns
    -------
    int
        Exit code: 0 done, 2 bad usage or input, 3 not enough good data to answer, 130 interrupted.
    """
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the matrices are small: more threads are slower
    sys.stdout, sys.stderr = _tolerant(sys.stdout), _tolerant(sys.stderr)
    command = get_command(_application())
    return explained(lambda: command.main(arguments, prog_name="sprung", standalone_mode=False))


def _tolerant(stream: TextIO | None) -> TextIO:
    """Return a stream that shows a question mark for what its encoding lacks; nowhere where it is closed."""
    if stream is None:
        return open(os.devnull, "w", encoding="utf-8")
    if isinstance(stream, TextIOWrapper):
        stream.reconfigure(errors="replace")
    return stream


def _application() -> typer.Typer:
    """Return the application with all its commands."""
    application = typer.Typer(
        cls=Group,
        add_completion=False,
        context_settings={"help_option_names": ["-h", "--help"]},
        pretty_exceptions_enable=False,
    )
    application.callback()(_common)
    commands = (
        info.info,
        identify.identify,
        corners.corners,
        baseline.baseline,
        diagnose.diagnose,
        simulate.simulate,
        reproduce.reproduce,
        monitor.monitor,
        box.box,
        replay.replay,
        demo.demo,
    )
    for command in commands:
        application.command(cls=Command)(command)
    application.add_typer(alerts.application, name="alerts")
    application.add_typer(vehicles.application, name="vehicles")
    return application


def _print_version(is_wanted: bool) -> None:
    """Print the version and leave, where it is wanted."""
    if is_wanted:
        typer.echo(f"sprung {__version__}")
        raise typer.Exit


def _common(
    version: Annotated[
        bool, typer.Option("--version", help="Print the version and leave.", is_eager=True, callback=_print_version)
    ] = False,
) -> None:
    """Watch a vehicle's suspension from sensors on its body."""
