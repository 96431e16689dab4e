"""The command `sprung fleet`: lakes, runs and streams of many vehicles."""

import typer

from sprung.fleet.commands import lake, runs


def register(application: typer.Typer) -> None:
    """Add the command to the application."""
    fleet = typer.Typer(
        no_args_is_help=True,
        help="Keep and analyse a fleet's archive and streams. Compares its vehicles.",
    )
    fleet.command("import")(lake.import_files)
    for command in (lake.archive, runs.run, runs.explain, runs.stream, runs.road, lake.rank):
        fleet.command()(command)
    application.add_typer(fleet, name="fleet")
