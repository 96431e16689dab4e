"""MATLAB files: version 5 to 7 through SciPy, version 7.3 (HDF5) through h5py."""

import math
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from sprung.errors import FormatError
from sprung.formats import hdf5
from sprung.formats.arrays import Arrays, array_groups, check_size, plain_arrays, written_arrays
from sprung.formats.hdf5 import own_items, stored
from sprung.formats.settings import ReadSettings
from sprung.formats.table import Group, reported
from sprung.recording import Recording

NAME, EXTRA = "MAT", None
ENDINGS = (".mat",)

#: Size of a value of a matrix in memory [bytes].
_VALUE = 8


def recognises(head: bytes) -> bool:
    """Return whether a file begins as MAT files of version 5 to 7.3 do."""
    return head.startswith(b"MATLAB ")


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the only table of a MAT file; the fields of a structure count as variables.

    Raises
    ------
    FormatError
        If the file is not a MAT file of version 5 or later.
    """
    with path.open("rb") as file:
        head = file.read(4096)
    with reported(path, "MAT file"):
        if hdf5.recognises(head):
            variables = _version_7_3(path)
        elif head.startswith(b"MATLAB 5.0"):
            variables = _version_5(path)
        else:
            raise FormatError(f"{path} is not a MAT file of version 5 or later: save it with save(..., '-v7')")
    return array_groups(path, _containers(variables), time=settings.time)


def _version_5(path: Path) -> dict[str, Any]:
    """Return the variables of a file of version 5 to 7."""
    from scipy.io import loadmat, whosmat

    check_size(path, sum(_VALUE * math.prod(shape) for _, shape, _ in whosmat(path)))
    content: dict[str, Any] = loadmat(path, simplify_cells=True)
    return {name: value for name, value in content.items() if not name.startswith("__")}


def _version_7_3(path: Path) -> dict[str, Any]:
    """Return the variables of a file of version 7.3; h5py transposes the matrices of MATLAB."""
    import h5py

    with h5py.File(path, "r") as file:
        return {name: _hdf5_value(path, file, item) for name, item in own_items(path, file) if not name.startswith("#")}


def _hdf5_value(path: Path, file: Any, item: Any) -> Any:
    """Return a dataset as numbers (read in part) or texts, a group one level down as a dictionary."""
    import h5py

    if isinstance(item, h5py.Group):
        fields = own_items(path, item)
        return {name: _hdf5_value(path, file, field) for name, field in fields if isinstance(field, h5py.Dataset)}
    if item.dtype == h5py.ref_dtype:
        return [_text(file[reference]) for reference in np.ravel(item[()])]
    if item.attrs.get("MATLAB_class") == b"char":
        return _text(item)
    return stored(path, item) if item.dtype.kind in "biuf" else item[()]


def _text(item: Any) -> str:
    """Return a dataset of character codes as text."""
    codes = np.ravel(item[()])
    return "".join(map(chr, codes)) if codes.dtype.kind in "ui" else str(codes)


def _containers(variables: Mapping[str, Any]) -> dict[str, Arrays]:
    """Return the variables outside structures, then the fields of each structure."""
    containers = {"": {name: value for name, value in variables.items() if not isinstance(value, Mapping)}}
    containers |= {name: dict(value) for name, value in variables.items() if isinstance(value, Mapping)}
    return {name: plain_arrays(values) for name, values in containers.items()}


def write(recording: Recording, path: Path) -> None:
    """Write a recording as a MAT file of version 5: data, channels, units and time."""
    from scipy.io import savemat

    arrays = written_arrays(recording)
    for name in {"channels", "units", "comments", "calibrations", "comment"} & arrays.keys():
        arrays[name] = arrays[name].astype(object)
    if "timestamp" in arrays:
        arrays["timestamp"] = arrays["timestamp"].view(np.int64)
    savemat(path, {name.replace("samples", "data"): array for name, array in arrays.items()}, do_compression=True)
