"""NumPy files: named arrays in NPZ, one array in NPY."""

from pathlib import Path
from typing import Any

import numpy as np

from sprung.errors import FormatError
from sprung.formats.arrays import array_groups, check_size, plain_arrays, written_arrays
from sprung.formats.settings import ReadSettings
from sprung.formats.table import Group, reported
from sprung.recording import Recording

NAME, EXTRA = "NumPy", None
ENDINGS = (".npz", ".npy")


def recognises(head: bytes) -> bool:
    """Return whether a file begins as NPY, or as an archive of such files."""
    is_archive = head.startswith(b"PK\x03\x04")
    return head.startswith(b"\x93NUMPY") or (
        is_archive and head[30 : 30 + int.from_bytes(head[26:28], "little")].endswith(b".npy")
    )


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the only table of an NPZ or NPY file."""
    with reported(path, "NumPy file"):
        if path.suffix.lower() == ".npy":
            arrays: dict[str, Any] = {"samples": np.load(path, allow_pickle=False, mmap_mode="r")}
        else:
            with path.open("rb") as file, np.lib.npyio.NpzFile(file) as content:
                members = content.zip.infolist() if content.zip else []
                check_size(path, sum(member.file_size for member in members))
                arrays = {name: _array(path, name, content) for name in content.files}
    return array_groups(path, {"": plain_arrays(arrays)}, time=settings.time)


def _array(path: Path, name: str, content: "np.lib.npyio.NpzFile") -> np.ndarray:
    """Return one array; pickled objects are an error, as loading them may run any code."""
    try:
        array: np.ndarray = content[name]
    except ValueError as error:
        raise FormatError(f"{path}: array {name!r} cannot be read ({error}): store numbers and texts only") from error
    return array


def write(recording: Recording, path: Path) -> None:
    """Write a recording as NPZ: samples, channels, units and time."""
    arrays: dict[str, Any] = written_arrays(recording)
    with path.open("wb") as file:
        np.savez_compressed(file, **arrays)
