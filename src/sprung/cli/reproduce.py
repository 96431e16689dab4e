"""The command `sprung reproduce`."""

from pathlib import Path
from typing import Annotated

import typer

from sprung.cli.options import OUTPUT, Json, check_file, check_folder, option
from sprung.cli.output import progress_bar, show, write_result, written


def reproduce(
    chapters: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="CHAPTER", help="Chapters: 4, 5, 6, 7, 8 or comparison. Default: all.", show_default=False
        ),
    ] = None,
    *,
    out: Annotated[
        Path, option("DIR", "Folder for the pages; created if it does not exist.", panel=OUTPUT, show_default=False)
    ],
    seeds: Annotated[int, option("N", "Number of runs where the thesis shows one.", min=2, max=10_000)] = 50,
    processes: Annotated[
        int | None, option("N", "Number of processes. Default: one for each processor.", min=1, max=1000)
    ] = None,
    json: Json = None,
) -> None:
    """Recompute the tables and figures of F. Liu's thesis: a page for each chapter, published values next to ours."""
    from sprung.reproduce import reproduce

    check_file("--json", json)
    check_folder("--out", out)
    with progress_bar() as report:
        paths = reproduce(chapters or (), directory=out, n_seeds=seeds, n_processes=processes, on_progress=report)
    document = {"schema": "sprung.reproduction/1", "seeds": seeds, "files": [str(path) for path in paths]}
    if write_result(document, json):
        show(written(paths, json))
