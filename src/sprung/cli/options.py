"""Options of several commands."""

from pathlib import Path
from typing import Annotated, Any, Literal

import typer

from sprung.cli.completion import documents, recordings, vehicles

INPUT, OUTPUT = "Input", "Output"


def option(metavar: str | None, text: str, *names: str, panel: str | None = None, **rules: Any) -> Any:
    """Return an option of a command: placeholder of its value, help text, and names if not that of its variable."""
    return typer.Option(*names, metavar=metavar, help=text, rich_help_panel=panel, **rules)


Files = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILE",
        help="Recordings: CSV, Parquet, MAT, MDF, TDMS, UFF and others.",
        show_default=False,
        autocompletion=recordings,
    ),
]
SamplingRate = Annotated[float | None, option("HZ", "Sampling rate of files without a time column.", panel=INPUT)]
AllowMissing = Annotated[
    bool,
    typer.Option(
        "--allow-missing",
        help="Continue without sensors of the vehicle file that the recordings lack; the results list them.",
        rich_help_panel=INPUT,
    ),
]
VehicleFile = Annotated[
    Path,
    option(
        "V.toml|NAME",
        "Vehicle file or name of a shipped vehicle: geometry, masses, sensors, nominal components.",
        autocompletion=vehicles,
    ),
]
TypeFile = Annotated[
    Path | None,
    option("T.json", "Baseline of the vehicle's type, from sprung fleet rank.", "--type", autocompletion=documents),
]
Minutes = Annotated[float, option("MINUTES", "Length of a window.", "--window", panel=INPUT)]
Figures = Annotated[Path | None, option("DIR", "Write figures to this folder.", panel=OUTPUT)]
FileFormat = Annotated[
    Literal["png", "svg", "pdf"],
    typer.Option("--format", help="Format of the figures.", rich_help_panel=OUTPUT),
]
Page = Annotated[
    Path | None,
    option(
        "FILE.html",
        "Write a report: one page with results, figures, quality of the data, and limits.",
        "--report",
        panel=OUTPUT,
    ),
]
Json = Annotated[
    str | None,
    option(
        "PATH", "Write the result as JSON; use - for standard output (nothing else is printed there).", panel=OUTPUT
    ),
]
Since = Annotated[
    str | None, option("TIME", "Start of the period, such as 2026-11-21 or 2026-11-21T08:30 (UTC).", "--since")
]
Until = Annotated[str | None, option("TIME", "End of the period, in the same form.", "--until")]
