"""The command `sprung reproduce`."""

from pathlib import Path
from typing import Annotated

import typer

from sprung.cli.documents import write_json
from sprung.cli.files import OUTPUT, Json, check_file
from sprung.cli.printing import console, notes
from sprung.cli.progress import progress_bar


def reproduce(
    chapters: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[CHAPTER]", help="Chapters: 4, 5, 6, 7, 8 or comparison. Default: all.", show_default=False
        ),
    ] = None,
    *,
    out: Annotated[
        Path,
        typer.Option(
            metavar="DIR",
            help="Folder for the pages; created where it does not exist.",
            show_default=False,
            rich_help_panel=OUTPUT,
        ),
    ],
    seeds: Annotated[
        int, typer.Option(metavar="N", min=2, max=10_000, help="Number of runs where the thesis shows one.")
    ] = 50,
    processes: Annotated[
        int | None,
        typer.Option(
            metavar="N",
            min=1,
            max=1000,
            help="Number of processes. Default: one for each processor.",
            show_default=False,
        ),
    ] = None,
    json: Json = None,
) -> None:
    """Recompute the tables and figures of F. Liu's thesis: a page for each chapter, published values next to ours."""
    from sprung.errors import ParameterError
    from sprung.reproduce import reproduce

    check_file("--json", json)
    if out.exists() and not out.is_dir():
        raise ParameterError(f"--out {out} is a file: give the name of a folder")
    with progress_bar() as report:
        paths = reproduce(chapters or (), directory=out, n_seeds=seeds, n_processes=processes, on_progress=report)
    if json is not None:
        write_json({"schema": "sprung.reproduction/1", "seeds": seeds, "files": [str(path) for path in paths]}, json)
    if json != "-":
        console().print(notes(f"wrote {path}" for path in paths))
