"""Options of several commands, their checks, and the shell completion of their values."""

import csv
import inspect
from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import MISSING, dataclass, field, fields
from functools import wraps
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import typer

from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.formats import ReadSettings
    from sprung.recording import Recording
    from sprung.vehicles.sensor_layout import AnyVehicle


def names(text: str | None) -> tuple[str, ...] | None:
    """Return the names in a comma-separated list; a name that contains a comma is written in double quotes."""
    if text is None:
        return None
    parts = [part.strip() for part in next(csv.reader([text], skipinitialspace=True), [])]
    if not parts or not all(parts) or len(set(parts)) < len(parts):
        raise ParameterError(f"{text!r} is not a list of distinct names: separate them by commas, as in acc_fl,acc_fr")
    return tuple(parts)


def check_file(option: str, path: str | Path | None, *, inputs: Sequence[str | Path] = ()) -> None:
    """Refuse an output file without a folder, or one that would overwrite an input."""
    if path is None or str(path) == "-":
        return
    if Path(path).exists() and any(Path(name).exists() and Path(path).samefile(name) for name in inputs):
        raise ParameterError(f"{option} {path} would overwrite an input: give another name")
    if Path(path).is_dir():
        raise ParameterError(f"{option} {path} is a folder: give the name of a file")
    if not Path(path).parent.is_dir():
        raise ParameterError(f"{option} {path} needs the folder {Path(path).parent}, which does not exist: create it")


def check_folder(option: str, path: Path | None) -> None:
    """Refuse a folder for output that is a file."""
    if path is not None and path.exists() and not path.is_dir():
        raise ParameterError(f"{option} {path} is a file: give the name of a folder")


INPUT, OUTPUT = "Input", "Output"


def complete_vehicles(incomplete: str) -> list[str]:
    """Return the shipped vehicles and vehicle files that begin with a text."""
    from sprung.vehicles.models import VEHICLES

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


_READING = "Reading"


@dataclass(frozen=True, slots=True)
class Reading(Group):
    """What to read of recordings, and how."""

    channels: str | None = declared(
        "A,B,..", "Channels to read, including the speed channel if it is needed. Default: all.", panel=_READING
    )
    group: str | None = declared(
        "A,B,..",
        "Groups of channels to read from a file with several; the first sets the times. sprung info lists them.",
        panel=_READING,
    )
    begin: float | None = declared("SECONDS", "Start of the part to read.", "--from", panel=_READING)
    end: float | None = declared("SECONDS", "End of the part to read.", "--to", panel=_READING)
    sampling_rate: float | None = declared(
        "HZ", "Sampling rate of files without a time column, or with an inconsistent one.", panel=_READING
    )
    time: str | None = declared("NAME", "Time column. Default: found by name and steps.", panel=_READING)
    time_unit: str | None = declared("UNIT", "Unit of the time column: s, ms, us, ns or HHMMSS.", panel=_READING)
    bridge: float | None = declared("SECONDS", "Longest gap to interpolate across. Default: 0.", panel=_READING)
    dbc: list[Path] | None = declared("F.dbc", "Database that decodes raw CAN frames; may be repeated.", panel=_READING)
    name_table: Path | None = declared(
        "F.toml", "Names of channels and what they measure, in addition to those known.", "--names", panel=_READING
    )

    @property
    def settings(self) -> "ReadSettings":
        """Settings of the readers."""
        from sprung.formats import ReadSettings

        return ReadSettings(
            channels=names(self.channels),
            groups=names(self.group) or (),
            start=self.begin,
            end=self.end,
            sampling_rate=self.sampling_rate,
            time=self.time,
            time_unit=self.time_unit,
            bridge=self.bridge or 0.0,
            databases=tuple(self.dbc or ()),
            names=self.name_table,
        )

    def records(self, files: Iterable[Path], report: Callable[[str, float], None]) -> "Iterable[Recording]":
        """Return the recordings of files, read one after the other."""
        from sprung.formats import read_records

        return read_records(list(files), settings=self.settings, on_progress=report)

    def may_lack(self, vehicle: "AnyVehicle | None", *, allow_missing: bool) -> bool:
        """Return whether recordings may lack sensors of a vehicle: as allowed, or left out with --channels.

        Raises
        ------
        ParameterError
            If one of the chosen channels looks like a sensor that is not among them, without permission.
        """
        from sprung.vehicles.sensor_layout import check_present

        chosen = names(self.channels)
        if chosen is not None and vehicle is not None:
            check_present(chosen, vehicle.sensor, allow_missing=allow_missing, is_choice=True)
        return allow_missing or chosen is not None
