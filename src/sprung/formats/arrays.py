"""Rules for files of named arrays (NPZ, MAT): which arrays are channels, which is time, and their names."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung.errors import FormatError
from sprung.formats.table import (
    Block,
    Group,
    Table,
    chosen_columns,
    is_time,
    single_group,
    time_column,
    within,
    written_headings,
    written_stamps,
    written_unit,
    written_values,
)
from sprung.recording import Recording

_RATES = ("sampling_rate", "fs")
_MATRICES = ("samples", "data")
_NAMES = ("channels", "channel_names", "names")
_UNITS = ("units", "unit")


def array_groups(path: Path, arrays: Mapping[str, Any]) -> tuple[Group, ...]:
    """Return the only group of named arrays."""
    names = [name for name, value in arrays.items() if _is_numeric(value)]
    return single_group(path, names, lambda channels: array_table(path, arrays, channels=channels))


def array_table(path: Path, arrays: Mapping[str, Any], *, channels: Sequence[str] | None) -> Table:
    """Return the table of named arrays.

    Channels are the rows of `samples` or `data` (the longer axis is time), otherwise all arrays as long as the time
    stamps, or as the longest array if there are no time stamps. `channels` and `units` name them; `sampling_rate` or
    `fs` is the rate; `time`, `t`, `t_s`, `time_s` or `timestamp` holds time stamps.

    Raises
    ------
    FormatError
        If names, units or time stamps do not match the channels.
    """
    numeric = {name: np.squeeze(value) for name, value in arrays.items() if _is_numeric(value)}
    stamped = time_column([name for name, value in numeric.items() if is_time(name) and value.ndim == 1], path=path)
    stamps = None if stamped is None else numeric[stamped]
    signals = {name: value for name, value in numeric.items() if name != stamped and value.dtype.kind in "biuf"}
    rows = _main_matrix(path, signals, arrays) or _all_of_one_length(path, signals, stamps, channels)
    names, values = list(rows), list(rows.values())
    units = _texts(arrays, _UNITS)
    if units and len(units) != len(names):
        raise FormatError(f"{path} holds {len(units)} units for {len(names)} channels: give one for each")
    columns = chosen_columns(names, channels, units=units or None, path=path)
    samples = np.stack([values[names.index(column.heading)] for column in columns]).astype(np.float64)
    if stamps is not None and stamps.size != samples.shape[1]:
        raise FormatError(f"{path}: {stamped!r} has {stamps.size} time stamps for {samples.shape[1]} samples")

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        yield from within([Block(1, stamps, samples)], first, last)

    return Table(path, columns, stamped, blocks, row_word="sample", sampling_rate=_rate(numeric))


def _is_numeric(value: Any) -> bool:
    """Return whether a value is an array of real numbers or times."""
    return isinstance(value, np.ndarray | np.number | int | float) and np.asarray(value).dtype.kind in "biufmM"


def _texts(arrays: Mapping[str, Any], keys: Sequence[str]) -> list[str]:
    """Return the texts of the first array whose name is one of `keys`; none without such an array."""
    for name, value in arrays.items():
        if name.lower() in keys:
            return [str(item).strip() if np.size(item) else "" for item in np.ravel(np.asarray(value, dtype=object))]
    return []


def _rate(numeric: Mapping[str, NDArray[Any]]) -> float | None:
    """Return the stored sampling rate."""
    for name, value in numeric.items():
        if name.lower() in _RATES and value.size == 1 and float(value) > 0:
            return float(value)
    return None


def _main_matrix(path: Path, signals: Mapping[str, NDArray[Any]], arrays: Mapping[str, Any]) -> dict[str, NDArray[Any]]:
    """Return the named rows of the array called `samples` or `data`; nothing without such an array."""
    matrices = [value for name, value in signals.items() if name.lower() in _MATRICES]
    if not matrices:
        return {}
    rows = as_rows(path, matrices[0])
    names = _texts(arrays, _NAMES) or [f"channel_{number}" for number in range(1, len(rows) + 1)]
    if len(names) != len(rows):
        raise FormatError(f"{path} holds {len(names)} channel names for {len(rows)} channels: give one for each")
    if len(set(names)) < len(names):
        raise FormatError(f"{path}: a channel name occurs more than once among {', '.join(names)}: rename one of them")
    return dict(zip(names, rows, strict=True))


def as_rows(path: Path, matrix: NDArray[Any]) -> NDArray[Any]:
    """Return a vector or matrix as (channels, samples): the longer axis is time.

    Raises
    ------
    FormatError
        If the array has more than two dimensions.
    """
    if matrix.ndim not in {1, 2} or matrix.size == 0:
        raise FormatError(
            f"{path} holds an array of shape {matrix.shape}: two dimensions, channels and samples, are read"
        )
    matrix = np.atleast_2d(matrix)
    return matrix.T if matrix.shape[0] > matrix.shape[1] else matrix


def _all_of_one_length(
    path: Path, signals: Mapping[str, NDArray[Any]], stamps: NDArray[Any] | None, channels: Sequence[str] | None
) -> dict[str, NDArray[Any]]:
    """Return every array as long as the time stamps or the longest array, its rows numbered.

    Short arrays are parameters. An array of a similar but different length is a channel of another rate, an error.
    """
    arrays = {name: as_rows(path, value) for name, value in signals.items() if value.ndim in {1, 2} and value.size > 1}
    rows: dict[str, NDArray[Any]] = {}
    for name, array in arrays.items():
        numbered = [name] if len(array) == 1 else [f"{name}_{number}" for number in range(1, len(array) + 1)]
        rows.update((key, row) for key, row in zip(numbered, array, strict=True) if channels is None or key in channels)
    if not rows:
        raise FormatError(f"{path} holds no arrays of numbers with a channel's samples")
    length = max(row.size for row in rows.values()) if stamps is None else stamps.size
    for name, row in rows.items():
        if row.size != length and row.size > length / 2:
            raise FormatError(
                f"{path}: {name!r} has {row.size} samples, others have {length}: keep the channels of one rate with "
                "--channels"
            )
    return {name: row for name, row in rows.items() if row.size == length}


def written_arrays(recording: Recording) -> dict[str, NDArray[Any]]:
    """Return named arrays from which the recording can be read."""
    written_headings(recording, has_units=False)  # raises on names that would not be read back
    name, stamps = written_stamps(recording)
    return {
        name: stamps,
        "samples": written_values(recording),
        "channels": np.array(recording.names),
        "units": np.array([written_unit(channel.quantity)[0] for channel in recording.channels]),
    }
