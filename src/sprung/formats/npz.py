"""NumPy files: named arrays in NPZ, one array in NPY."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from sprung.errors import FormatError
from sprung.formats.arrays import array_table, written_arrays
from sprung.formats.table import Table, reported
from sprung.recording import Recording

ENDINGS = (".npz", ".npy")


def open_table(path: Path, *, channels: Sequence[str] | None = None) -> Table:
    """Return the table in an NPZ or NPY file."""
    with reported(path, "NumPy file"):
        if path.suffix.lower() == ".npy":
            return array_table(path, {"samples": np.load(path, allow_pickle=False, mmap_mode="r")}, channels=channels)
        with path.open("rb") as file, np.lib.npyio.NpzFile(file) as content:
            return array_table(path, {name: _array(path, name, content) for name in content.files}, channels=channels)


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
