"""Options and files of several commands."""

import csv
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from sprung.errors import ParameterError

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from sprung.recording import Recording

#: Total size [bytes] above which files are read in blocks, each a record of its own.
LARGE = 256 * 2**20
#: Samples in such a block.
BLOCK_SAMPLES = 1 << 19

INPUT, OUTPUT = "Input", "Output"


def option(metavar: str, text: str, *names: str, panel: str | None = None, **rules: Any) -> Any:
    """Return an option of a command: placeholder of its value, help text, and names if not that of its variable."""
    return typer.Option(*names, metavar=metavar, help=text, rich_help_panel=panel, **rules)


Files = Annotated[
    list[Path], typer.Argument(metavar="FILE", help="Recordings: CSV, Parquet, NPZ or MAT.", show_default=False)
]
SamplingRate = Annotated[float | None, option("HZ", "Sampling rate of files without a time column.", panel=INPUT)]
Channels = Annotated[
    str | None,
    option("A,B,..", "Channels to read, including the speed channel if it is needed. Default: all.", panel=INPUT),
]
VehicleFile = Annotated[
    Path,
    option("V.toml|NAME", "Vehicle file or name of a shipped vehicle: geometry, masses, sensors, nominal components."),
]
Minutes = Annotated[float, option("MINUTES", "Length of a window.", "--window", panel=INPUT)]
Figures = Annotated[Path | None, option("DIR", "Write figures to this folder.", panel=OUTPUT)]
Json = Annotated[
    str | None,
    option(
        "PATH", "Write the result as JSON; use - for standard output (nothing else is printed there).", panel=OUTPUT
    ),
]


def names(text: str | None) -> tuple[str, ...] | None:
    """Return the names in a comma-separated list; a name that contains a comma is written in double quotes."""
    if text is None:
        return None
    parts = [part.strip() for part in next(csv.reader([text], skipinitialspace=True), [])]
    if not parts or not all(parts) or len(set(parts)) < len(parts):
        raise ParameterError(f"{text!r} is not a list of different names: separate them by commas, as in acc_fl,acc_fr")
    return tuple(parts)


def check_file(option: str, path: str | Path | None, *, inputs: Sequence[str | Path] = ()) -> None:
    """Refuse an output file without a folder, or one that would overwrite an input, before any long computation."""
    if path is None or str(path) == "-":
        return
    if Path(path).exists() and any(Path(name).exists() and Path(path).samefile(name) for name in inputs):
        raise ParameterError(f"{option} {path} would overwrite an input: give another name")
    if Path(path).is_dir():
        raise ParameterError(f"{option} {path} is a folder: give the name of a file")
    if not Path(path).parent.is_dir():
        raise ParameterError(f"{option} {path}: there is no folder {Path(path).parent}: create it")


def is_large(files: Sequence[Path]) -> bool:
    """Whether the files together are too large to be held in memory."""
    return sum(path.stat().st_size for path in files if path.is_file()) > LARGE


def records(
    files: Sequence[Path],
    *,
    sampling_rate: float | None,
    channels: Sequence[str] | None,
    report: Callable[[str, float], None],
) -> "Iterable[Recording]":
    """Return the recordings in files: as a list, or one at a time where they are large together.

    Parameters
    ----------
    files
        Paths in the order of the records.
    sampling_rate, channels
        Options of `sprung.formats.read`.
    report
        Callback that receives the current step and the share that is done (0 to 1).
    """
    recordings = _read(files, sampling_rate, channels, report)
    return recordings if is_large(files) else list(recordings)


def _read(
    files: Sequence[Path],
    sampling_rate: float | None,
    channels: Sequence[str] | None,
    report: Callable[[str, float], None],
) -> "Iterator[Recording]":
    """Yield the recording in each file; a large one in blocks."""
    from sprung.formats import read, read_blocks

    for path in files:
        report(f"reading {path.name}", 0.0)
        if is_large([path]):
            yield from read_blocks(path, sampling_rate=sampling_rate, channels=channels, block_samples=BLOCK_SAMPLES)
        else:
            yield read(path, sampling_rate=sampling_rate, channels=channels)


def save_figures(figures: "Mapping[str, Figure]", folder: Path) -> list[Path]:
    """Write figures by name as PNG files, and return their paths."""
    folder.mkdir(parents=True, exist_ok=True)
    paths = [folder / f"{name}.png" for name in figures]
    for path, figure in zip(paths, figures.values(), strict=True):
        figure.savefig(path, dpi=150)
    return paths
