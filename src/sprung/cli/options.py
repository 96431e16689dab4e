"""Options of several commands, and the shell completion of their values."""

from collections.abc import Collection
from pathlib import Path
from typing import Annotated, Any, Literal

import typer

INPUT, OUTPUT = "Input", "Output"


def complete_vehicles(incomplete: str) -> list[str]:
    """Return the shipped vehicles and vehicle files that begin with a text."""
    from sprung.vehicles.files import VEHICLES

    return [*(name for name in VEHICLES if name.startswith(incomplete)), *_paths(incomplete, (".toml",))]


def complete_recordings(incomplete: str) -> list[str]:
    """Return the files of known formats that begin with a text."""
    from sprung.formats import ENDINGS

    return _paths(incomplete, ENDINGS)


def complete_recordings_or_documents(incomplete: str) -> list[str]:
    """Return the files of known formats and JSON files that begin with a text."""
    from sprung.formats import ENDINGS

    return _paths(incomplete, (*ENDINGS, ".json"))


def complete_documents(incomplete: str) -> list[str]:
    """Return the JSON files that begin with a text."""
    return _paths(incomplete, (".json",))


def _paths(incomplete: str, endings: Collection[str]) -> list[str]:
    """Return folders, and files with one of the endings; hidden ones only after a dot."""
    head, separator, start = incomplete.rpartition("/")
    folder = Path(f"{head}{separator}" or ".").expanduser()
    names = []
    try:
        entries = sorted(folder.iterdir())
    except OSError:
        return []
    for entry in entries:
        is_hidden = entry.name.startswith(".") and not start.startswith(".")
        if not entry.name.startswith(start) or is_hidden:
            continue
        if entry.is_dir():
            names.append(f"{head}{separator}{entry.name}/")
        elif entry.name.lower().endswith(tuple(endings)):
            names.append(f"{head}{separator}{entry.name}")
    return names


def option(metavar: str | None, text: str, *names: str, panel: str | None = None, **rules: Any) -> Any:
    """Return an option of a command: placeholder of its value, help text, and names if not that of its variable."""
    return typer.Option(*names, metavar=metavar, help=text, rich_help_panel=panel, **rules)


Files = Annotated[
    list[Path],
    typer.Argument(
        metavar="FILE",
        help="Recordings: CSV, Parquet, MAT, MDF, TDMS, UFF and others.",
        show_default=False,
        autocompletion=complete_recordings,
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
        autocompletion=complete_vehicles,
    ),
]
TypeFile = Annotated[
    Path | None,
    option(
        "T.json", "Baseline of the vehicle's type, from sprung fleet rank.", "--type", autocompletion=complete_documents
    ),
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
