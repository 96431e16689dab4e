"""Options of several commands, and the shell completion of their values."""

import inspect
from collections.abc import Callable, Collection
from dataclasses import MISSING, field, fields
from functools import wraps
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


def vehicle_file(text: str) -> Any:
    """Return the option of an optional vehicle file, of which a command takes what the text says."""
    words = f"Vehicle file or name of a shipped vehicle: {text}"
    return option("V.toml|NAME", words, autocompletion=complete_vehicles, panel=INPUT)


class Group:
    """Options that several commands share: a dataclass whose fields are the options."""


def declared(metavar: str | None, text: str, *names: str, default: Any = None, **rules: Any) -> Any:
    """Return a field of a group: an option with its default."""
    return field(default=default, metadata={"option": option(metavar, text, *names, **rules)})


def shares_options(command: Callable[..., None]) -> Callable[..., None]:
    """Give a command the options of each of its parameters that is a `Group`, in the place of that parameter."""
    signature = inspect.signature(command)
    kinds = {name: parameter.annotation for name, parameter in signature.parameters.items()}
    groups = {name: kind for name, kind in kinds.items() if isinstance(kind, type) and issubclass(kind, Group)}
    options = {name: [each for each in fields(kind) if each.init] for name, kind in groups.items()}  # type: ignore[arg-type]
    parameters: list[inspect.Parameter] = []
    for name, parameter in signature.parameters.items():
        parameters += [parameter] * (name not in groups)
        parameters += [
            inspect.Parameter(
                each.name,
                inspect.Parameter.KEYWORD_ONLY,
                default=inspect.Parameter.empty if each.default is MISSING else each.default,
                annotation=Annotated[each.type, each.metadata["option"]] if each.metadata else each.type,
            )
            for each in options.get(name, ())
        ]

    @wraps(command)
    def run(**arguments: Any) -> None:
        for name, kind in groups.items():
            arguments[name] = kind(**{each.name: arguments.pop(each.name) for each in options[name]})
        command(**arguments)

    vars(run)["__signature__"] = signature.replace(parameters=parameters)
    run.__annotations__ = {parameter.name: parameter.annotation for parameter in parameters}
    return run


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
    option(
        None,
        "Continue without sensors of the vehicle file that the recordings lack; the results list them.",
        "--allow-missing",
        panel=INPUT,
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
FileFormat = Annotated[Literal["png", "svg", "pdf"], option(None, "Format of the figures.", "--format", panel=OUTPUT)]
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
