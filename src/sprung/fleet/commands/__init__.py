"""The command `sprung fleet`: lakes, runs and streams of many vehicles."""

import typer

from sprung.fleet.commands import fleet


def register(application: typer.Typer) -> None:
    """Add the command to the application."""
    application.add_typer(fleet.application, name="fleet")
