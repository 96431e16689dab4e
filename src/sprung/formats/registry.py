"""Formats of files: which module reads a file, by its content, then by its name."""

from collections.abc import Callable
from importlib.metadata import entry_points
from pathlib import Path
from typing import Protocol, cast

from sprung.errors import FormatError
from sprung.formats import (
    csv,
    dewesoft,
    hdf5,
    ide,
    lvm,
    mat,
    mdf,
    npz,
    parquet,
    phone,
    seismic,
    sst,
    tdms,
    universal,
    wav,
)
from sprung.formats.settings import ReadSettings
from sprung.formats.table import Group, reported
from sprung.recording import Recording

#: First bytes of a file by which a format is recognised.
_HEAD_BYTES = 4096
_PACKED = (b"PK\x03\x04", b"\x1f\x8b")


class Format(Protocol):
    """Module of a format."""

    __name__: str
    NAME: str  #: Name of the format in messages, with an article where it needs one.
    EXTRA: str | None  #: Extra of the package that installs its reader.
    ENDINGS: tuple[str, ...]  #: Endings of file names, in lower case.
    recognises: Callable[[bytes], bool]  #: Whether the first bytes are those of such a file.
    groups: Callable[[Path, ReadSettings], tuple[Group, ...]]  #: Groups of channels in a file.


class Writer(Protocol):
    """Module of a format that is written."""

    write: Callable[[Recording, Path], None]


#: Formats that are read, the most specific first: any text may be a table.
FORMATS = cast(
    tuple[Format, ...],
    (parquet, mat, hdf5, npz, mdf, tdms, ide, dewesoft, universal, lvm, wav, sst, seismic, phone, csv),
)

#: Those whose readers a file may crash: they run in a process of their own.
FOREIGN = cast(tuple[Format, ...], (mat, hdf5, mdf, tdms, ide, dewesoft, universal, seismic))

#: Those whose files begin in no certain way.
_WITHOUT_SIGNATURE = cast(tuple[Format, ...], (mat, hdf5, csv))

#: Module that writes each ending.
WRITERS = cast(
    dict[str, Writer],
    {
        ".csv": csv,
        ".parquet": parquet,
        ".npz": npz,
        ".mat": mat,
        ".h5": hdf5,
        ".uff": universal,
        ".unv": universal,
    },
)

#: Endings of the files that are read.
ENDINGS = tuple(ending for module in FORMATS for ending in module.ENDINGS)


def own_formats() -> tuple[Format, ...]:
    """Return the formats of other packages: those that they name as entry points of the group `sprung.formats`."""
    return tuple(point.load() for point in entry_points(group="sprung.formats"))


def writer_of(ending: str) -> Writer | None:
    """Return the module that writes files with an ending; None without one."""
    others = (module for module in own_formats() if ending in module.ENDINGS and hasattr(module, "write"))
    return WRITERS.get(ending) or cast("Writer | None", next(others, None))


def format_of(path: Path) -> Format:
    """Return the format of an existing file.

    Raises
    ------
    FormatError
        If the file does not exist, is empty, or of no known format, or does not begin as its name says.

    Notes
    -----
    Formats of other packages are looked up only where none of this one fits both content and name.
    """
    if not path.exists():
        raise FormatError(f"{path}: there is no such file")
    if not path.is_file():
        raise FormatError(f"{path} is not a file: name a file with one of the endings {', '.join(ENDINGS)}")
    with reported(path, "file"), path.open("rb") as file:
        head = file.read(_HEAD_BYTES)
    if not head:
        raise FormatError(f"{path} is empty")
    named = [module for module in FORMATS if path.name.lower().endswith(module.ENDINGS)]
    recognised = [module for module in FORMATS if module.recognises(head)]
    both = [module for module in recognised if module in named]
    if not both:
        others = [module for module in own_formats() if path.name.lower().endswith(module.ENDINGS)]
        both = [module for module in others if module.recognises(head)]
    elif {module.NAME for module in both} == {csv.NAME} and not head.startswith(_PACKED):
        both = [module for module in recognised if module.NAME != csv.NAME]  # any text may be a table
    candidates = both or recognised or named
    if not candidates:
        raise FormatError(
            f"{path} is in an unknown format: files in {', '.join(ENDINGS)} are read; export it as CSV, MAT or UFF 58 "
            "from the program that wrote it"
        )
    if candidates[0] not in (*recognised, *both, *_WITHOUT_SIGNATURE):
        raise FormatError(f"{path} cannot be read as {candidates[0].NAME}: it does not begin as such a file")
    return candidates[0]
