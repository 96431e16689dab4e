"""Options and files that several commands share."""

import csv
from collections.abc import Callable, Iterable, Iterator, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from sprung.errors import ParameterError

if TYPE_CHECKING:
    from sprung.recording import Recording

#: Files that together are larger [bytes] are read in blocks, each of which is a record of its own.
LARGE = 256 * 2**20
#: Samples of such a block.
BLOCK_SAMPLES = 1 << 19

INPUT, OUTPUT = "Input", "Output"

Files = Annotated[
    list[Path], typer.Argument(metavar="FILE", help="Recordings: CSV, Parquet, NPZ or MAT.", show_default=False)
]
SamplingRate = Annotated[
    float | None,
    typer.Option(
        "--sampling-rate", metavar="HZ", help="Sampling rate of files without a time column.", rich_help_panel=INPUT
    ),
]
Channels = Annotated[
    str | None,
    typer.Option(
        "--channels",
        metavar="A,B,..",
        help="Channels to read, the speed channel among them if it is to be used. Default: all.",
        rich_help_panel=INPUT,
    ),
]
VehicleFile = Annotated[
    Path,
    typer.Option(
        metavar="V.toml|NAME",
        help="Vehicle file: geometry, masses, sensors, nominal components.",
        show_default=False,
    ),
]
Json = Annotated[
    str | None,
    typer.Option(
        "--json",
        metavar="PATH",
        help="Write the result as JSON; - is standard output, where then nothing else goes.",
        rich_help_panel=OUTPUT,
    ),
]


def names(text: str | None) -> tuple[str, ...] | None:
    """Return the names in a list with commas; a name with a comma stands in double quotes."""
    if text is None:
        return None
    found = [name.strip() for name in next(csv.reader([text], skipinitialspace=True), [])]
    if not found or not all(found) or len(set(found)) < len(found):
        raise ParameterError(
            f"{text!r} is no list of different names: write them with commas between, as in acc_fl,acc_fr"
        )
    return tuple(found)


def check_file(option: str, path: str | Path | None, *, inputs: Sequence[str | Path] = ()) -> None:
    """Refuse a file that has no folder, or that would be written over what the command reads, before any long work."""
    if path is None or str(path) == "-":
        return
    if Path(path).exists() and any(Path(name).exists() and Path(path).samefile(name) for name in inputs):
        raise ParameterError(f"{option} {path} would be written over what is read: give another name")
    if Path(path).is_dir():
        raise ParameterError(f"{option} {path} is a folder: give the name of a file in it")
    if not Path(path).parent.is_dir():
        raise ParameterError(f"{option} {path}: there is no folder {Path(path).parent}: create it")


def is_large(files: Sequence[Path]) -> bool:
    """Tell whether files are too large to be held in memory together."""
    return sum(path.stat().st_size for path in files if path.is_file()) > LARGE


def records(
    files: Sequence[Path],
    *,
    sampling_rate: float | None,
    channels: Sequence[str] | None,
    report: Callable[[str, float], None],
) -> "Iterable[Recording]":
    """Return the recordings in files: a list, or one after the other where they are large together.

    Parameters
    ----------
    files
        In the order of the records.
    sampling_rate, channels
        As for `sprung.formats.read`.
    report
        Called with what is being done and how far it is.
    """
    found = _read(files, sampling_rate, channels, report)
    return found if is_large(files) else list(found)


def _read(
    files: Sequence[Path],
    sampling_rate: float | None,
    channels: Sequence[str] | None,
    report: Callable[[str, float], None],
) -> "Iterator[Recording]":
    """Yield the recording in each file, that in a large one in blocks."""
    from sprung.formats import read, read_blocks

    for path in files:
        report(f"reading {path.name}", 0.0)
        if is_large([path]):
            yield from read_blocks(path, sampling_rate=sampling_rate, channels=channels, block_samples=BLOCK_SAMPLES)
        else:
            yield read(path, sampling_rate=sampling_rate, channels=channels)
