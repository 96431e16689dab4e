"""Rules for files of named arrays (NPZ, MAT, HDF5): which arrays are channels, which is time, and their names."""

import hashlib
import itertools
import re
from collections.abc import Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung.errors import FormatError, MixedRatesError
from sprung.formats.settings import TIME_UNITS
from sprung.formats.table import (
    Block,
    Column,
    Group,
    Table,
    chosen_columns,
    is_time,
    row_pieces,
    stated_column,
    time_column,
    written,
)
from sprung.recording import Recording

_RATES = ("sampling_rate", "fs", "fs_hz")
_MATRICES = ("samples", "data")
_NAMES = ("channels", "channel_names", "names")
_UNITS = ("units", "unit")
_COMMENTS, _CALIBRATIONS = ("comments",), ("calibrations",)
# A time array of some of the channels: their common prefix, "t" or "time", and perhaps its unit.
_PREFIXED_TIME = re.compile(rf"(?P<prefix>.+_)(t|time|timestamp)(_({'|'.join(TIME_UNITS)}))?", re.IGNORECASE)


@dataclass(frozen=True, slots=True)
class InMemory:
    """Limits of arrays that are read as a whole."""

    #: Largest size [bytes]: an hour of 128 channels at 1 kHz.
    largest: int = 2**32
    #: Size that every file may have [bytes], and size over that of the file: measured signals are packed to a tenth.
    small: int = 2**28
    ratio: int = 200
    #: Fewer values than this in an array are parameters.
    fewest: int = 10


IN_MEMORY = InMemory()


#: Array of NumPy, or another with shape and type that is read in part, such as `hdf5.Stored`.
Array = Any


@dataclass(frozen=True, eq=False, slots=True)
class Row:
    """Samples of one channel: an array of one dimension, or a row or column of one of two."""

    array: Array
    axis: int
    index: int | None

    @property
    def size(self) -> int:
        """Number of samples."""
        return int(self.array.shape[self.axis])


@dataclass(frozen=True, eq=False, slots=True)
class Arrays:
    """Named arrays of a file that belong together.

    Parameters
    ----------
    values
        Arrays, numbers and texts by name.
    facts
        What the file states about an array apart from it: "unit", "comment" and "calibration", by its name.
    start
        Time of the first sample, UTC in nanoseconds since 1970; None where unknown.
    comment
        Comment on the measurement.
    """

    values: Mapping[str, Any]
    facts: Mapping[str, Mapping[str, str]]
    start: int | None = None
    comment: str = ""


def check_size(path: Path, n_bytes: int) -> None:
    """Refuse arrays that are read as a whole, by the size that the file states for them.

    Raises
    ------
    FormatError
        If they take more than the limits of `InMemory`: a damaged or hostile archive can state any size.
    """
    limit = min(IN_MEMORY.largest, max(IN_MEMORY.small, IN_MEMORY.ratio * path.stat().st_size))
    if n_bytes > limit:
        raise FormatError(
            f"{path} holds {n_bytes / 1e9:.1f} GB of arrays, but at most {limit / 1e9:.1f} GB of it are read at once: "
            "divide it, or store it as Parquet or HDF5, which are read in parts"
        )


def plain_arrays(values: Mapping[str, Any]) -> Arrays:
    """Return named arrays about which the file states nothing but in other arrays."""
    start = values.get("start_ns")
    stated = int(np.ravel(start)[0]) if start is not None and np.size(start) == 1 else None
    return Arrays(values, {}, stated, " ".join(_texts(values, ("comment",))))


def array_groups(path: Path, containers: Mapping[str, Arrays], *, time: str | None = None) -> tuple[Group, ...]:
    """Return the groups of named arrays.

    Parameters
    ----------
    path
        Path of the file.
    containers
        Arrays by the name of their folder or structure. What is in the first one (time, rate, names, units) holds for
        those that state nothing else.
    time
        Name of the array of time stamps, where there are several; None: found by its name.

    Returns
    -------
    tuple of Group
        A group for each container with channels, and within it for each array of time stamps.

    Raises
    ------
    FormatError
        If there are no arrays with samples.

    Notes
    -----
    Channels are the rows of `samples` or `data` (the longer axis is time), otherwise all arrays as long as the time
    stamps, or as the longest array if there are no time stamps. `channels` and `units` name them; `sampling_rate` or
    `fs` is the rate; `time`, `t`, `t_s`, `time_s` or `timestamp` holds time stamps, `left_t` or `left_time_us` those of
    the arrays whose names begin with `left_`.
    """
    groups = []
    for name, arrays in _inheriting(containers).items():
        for prefix, part in _by_time(arrays).items():
            group_name = " ".join(filter(None, (name, prefix.strip("_")))) or path.name
            groups += _group(path, group_name, part, time)
    if not groups:
        raise FormatError(f"{path} holds no arrays of numbers with a channel's samples")
    return tuple(groups)


def _inheriting(containers: Mapping[str, Arrays]) -> dict[str, Arrays]:
    """Return the containers that hold samples; one without time takes those of the first with times as long as it."""
    clocks = [
        {name: value for name, value in arrays.values.items() if _is_shared(name)} for arrays in containers.values()
    ]
    result = {}
    for name, arrays in containers.items():
        lengths = {max(value.shape) for key, value in arrays.values.items() if _is_signal(key, value)}
        if not lengths:
            continue
        own = dict(arrays.values)
        if not any(is_time(key) or key.lower() in _RATES for key in own):
            own = {**next((clock for clock in clocks if _fits(clock, lengths)), {}), **own}
        result[name] = replace(arrays, values=own)
    return result or dict(itertools.islice(containers.items(), 1))


def _is_signal(name: str, value: Any) -> bool:
    """Return whether a value may hold the samples of channels."""
    return _is_numeric(value) and not _is_shared(name) and max(np.shape(value), default=0) > 1


def _fits(clock: Mapping[str, Any], lengths: Collection[int]) -> bool:
    """Return whether time stamps are as long as one of some arrays, or a rate is stated."""
    return any(
        max(np.shape(value), default=0) in lengths if is_time(name) else name.lower() in _RATES
        for name, value in clock.items()
    )


def _is_shared(name: str) -> bool:
    """Return whether an array is about channels rather than one."""
    return is_time(name) or name.lower() in (*_RATES, *_NAMES, *_UNITS, *_COMMENTS, *_CALIBRATIONS)


def _by_time(arrays: Arrays) -> dict[str, Arrays]:
    """Return the arrays by the prefix that they share with an array of time stamps; all together without one."""
    found = [(name, match) for name in arrays.values if (match := _PREFIXED_TIME.fullmatch(name)) and not is_time(name)]
    prefixes = {match["prefix"]: name for name, match in found if _is_numeric(arrays.values[name])}
    parts = {}
    for prefix in prefixes:
        own = {name: value for name, value in arrays.values.items() if name.startswith(prefix)}
        if len(own) > 1:
            parts[prefix] = own
    if not parts:
        return {"": arrays}
    taken = {name for own in parts.values() for name in own}
    rest = {name: value for name, value in arrays.values.items() if name not in taken}
    if any(_is_signal(name, value) for name, value in rest.items()):
        parts[""] = rest
    return {prefix: replace(arrays, values=own) for prefix, own in parts.items()}


def _group(path: Path, name: str, arrays: Arrays, time: str | None) -> list[Group]:
    """Return the group of some arrays; none if they hold no samples."""
    numeric = {key: _squeezed(key, value) for key, value in arrays.values.items() if _is_numeric(value)}
    times = [key for key, value in numeric.items() if len(value.shape) == 1 and _is_time_array(key)]
    stamped = times[0] if len(times) == 1 else time_column(times, stated=time)
    signals = {
        key: value
        for key, value in numeric.items()
        if key != stamped and value.dtype.kind in "biuf" and key.lower() not in _RATES
    }
    if not any(key.lower() in _MATRICES or np.prod(value.shape) > 1 for key, value in signals.items()):
        return []
    stamps = None if stamped is None else np.asarray(numeric[stamped][:])
    source = _Source(path, arrays, signals, stamped, stamps, _rate(numeric))
    clock = (source.rate, arrays.start) if stamps is None else hashlib.sha256(stamps.tobytes()).hexdigest()
    n_rows = None if stamps is None else stamps.size
    return [Group(name, tuple(signals), clock, source.table, source.rate, n_rows)]


def _is_time_array(name: str) -> bool:
    return is_time(name) or _PREFIXED_TIME.fullmatch(name) is not None


@dataclass(frozen=True, eq=False, slots=True)
class _Source:
    """Arrays of a group: those with samples, the time stamps, and the rate."""

    path: Path
    arrays: Arrays
    signals: Mapping[str, Array]
    stamped: str | None
    stamps: NDArray[Any] | None
    rate: float | None

    def table(self, channels: Sequence[str] | None) -> Table:
        """Return the table of some channels."""
        path, stamps = self.path, self.stamps
        rows = _main_matrix(path, self.signals, self.arrays.values)
        left_out: tuple[tuple[str, str], ...] = ()
        if not rows:
            rows, left_out = _all_of_one_length(path, self.signals, stamps, channels)
        columns = chosen_columns(list(rows), channels, units=self._units(list(rows)), path=path)
        wanted = [rows[column.heading] for column in columns]
        n_rows = wanted[0].size
        if stamps is not None and stamps.size != n_rows:
            raise FormatError(f"{path}: {self.stamped!r} has {stamps.size} time stamps for {n_rows} samples")

        def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
            for part in row_pieces(n_rows, first, last):
                yield Block(1 + part.start, None if stamps is None else stamps[part], _values(wanted, part))

        return Table(
            path,
            tuple(self._described(column, list(rows)) for column in columns),
            self._time_heading(),
            blocks,
            row_word="sample",
            sampling_rate=self.rate,
            start=self.arrays.start,
            comment=self.arrays.comment,
            left_out=left_out,
        )

    def _time_heading(self) -> str | None:
        """Return the name of the time stamps with their unit, if the file states one apart."""
        unit = self.arrays.facts.get(self.stamped or "", {}).get("unit")
        return f"{self.stamped} [{unit}]" if self.stamped and unit in TIME_UNITS else self.stamped

    def _units(self, names: Sequence[str]) -> Sequence[str] | None:
        """Return the unit of each channel from the array of units; None without one."""
        units = _texts(self.arrays.values, _UNITS)
        if units and len(units) != len(names):
            raise FormatError(f"{self.path} holds {len(units)} units for {len(names)} channels: give one for each")
        return units or None

    def _described(self, column: Column, names: Sequence[str]) -> Column:
        """Return a channel with the unit, the comment and the calibration that the file states apart."""
        heading, index = column.heading, names.index(column.heading)
        facts = self.arrays.facts.get(heading if heading in self.signals else heading.rpartition("_")[0], {})
        if "unit" in facts:
            column = stated_column(heading, column.name, facts["unit"])
        for key, names_of_array in (("comment", _COMMENTS), ("calibration", _CALIBRATIONS)):
            texts = _texts(self.arrays.values, names_of_array)
            if len(texts) == len(names):
                facts = {**facts, key: texts[index]}
        return column.with_facts(facts)


def _values(rows: Sequence[Row], part: slice) -> NDArray[np.float64]:
    """Return some samples of each row; an array of several rows is read once."""
    values = np.empty((len(rows), part.stop - part.start))
    read: dict[int, Any] = {}
    for number, row in enumerate(rows):
        key = id(row.array)
        if key not in read:
            read[key] = np.asarray(row.array[part] if row.axis == 0 else row.array[:, part])
        samples = read[key]
        if row.index is not None:
            samples = samples[:, row.index] if row.axis == 0 else samples[row.index]
        values[number] = samples
    return values


def _is_numeric(value: Any) -> bool:
    """Return whether a value is an array of real numbers or times."""
    if isinstance(value, np.ndarray | np.number | int | float):
        return np.asarray(value).dtype.kind in "biufmM"
    return hasattr(value, "dtype") and hasattr(value, "shape") and value.dtype.kind in "biuf"


def _squeezed(name: str, value: Any) -> Array:
    """Return an array without axes of one value; samples that are read in part stay as they are."""
    is_in_memory = isinstance(value, np.ndarray | np.number | int | float)
    if is_in_memory or np.prod(value.shape) <= 1 or (_is_time_array(name) and len(value.shape) > 1):
        return np.squeeze(np.asarray(value if is_in_memory else value[...]))
    return value


def _texts(arrays: Mapping[str, Any], keys: Sequence[str]) -> list[str]:
    """Return the texts of the first array whose name is one of `keys`; none without such an array."""
    for name, value in arrays.items():
        if name.lower() in keys:
            return [str(item).strip() if np.size(item) else "" for item in np.ravel(np.asarray(value, dtype=object))]
    return []


def _rate(numeric: Mapping[str, Array]) -> float | None:
    """Return the stored sampling rate."""
    for name, value in numeric.items():
        if name.lower() in _RATES and np.prod(value.shape) == 1:
            rate = float(np.ravel(np.asarray(value[...]))[0])
            return rate if rate > 0 else None
    return None


def _main_matrix(path: Path, signals: Mapping[str, Array], arrays: Mapping[str, Any]) -> dict[str, Row]:
    """Return the named rows of the array called `samples` or `data`; nothing without such an array."""
    matrices = [value for name, value in signals.items() if name.lower() in _MATRICES]
    if not matrices:
        return {}
    rows = _rows(path, matrices[0])
    names = _texts(arrays, _NAMES) or [f"channel_{number}" for number in range(1, len(rows) + 1)]
    if len(names) != len(rows):
        raise FormatError(f"{path} holds {len(names)} channel names for {len(rows)} channels: give one for each")
    if len(set(names)) < len(names):
        raise FormatError(f"{path}: a channel name occurs more than once among {', '.join(names)}: rename one of them")
    return dict(zip(names, rows, strict=True))


def _rows(path: Path, array: Array) -> list[Row]:
    """Return the rows of a vector or matrix: its longer axis is time."""
    shape = array.shape
    if len(shape) not in {0, 1, 2} or 0 in shape:
        raise FormatError(f"{path} holds an array of shape {shape}: two dimensions, channels and samples, are read")
    if len(shape) == 0:
        return [Row(np.atleast_1d(np.asarray(array[()])), 0, None)]
    if len(shape) == 1:
        return [Row(array, 0, None)]
    axis = 0 if shape[0] > shape[1] else 1
    return [Row(array, axis, index) for index in range(shape[1 - axis])]


def _all_of_one_length(
    path: Path, signals: Mapping[str, Array], stamps: NDArray[Any] | None, channels: Sequence[str] | None
) -> tuple[dict[str, Row], tuple[tuple[str, str], ...]]:
    """Return every array as long as the time stamps or the longest array, its rows numbered, and why others are not.

    Shorter arrays may be parameters. One of a similar but different length is a channel of another rate, an error.
    """
    every: dict[str, Row] = {}
    for name, array in signals.items():
        if len(array.shape) not in {1, 2} or np.prod(array.shape) <= 1:
            continue
        own = _rows(path, array)
        numbered = [name] if len(own) == 1 else [f"{name}_{number}" for number in range(1, len(own) + 1)]
        every |= dict(zip(numbered, own, strict=True))
    rows = {name: row for name, row in every.items() if channels is None or name in channels}
    if not rows:
        raise FormatError(f"{path} holds no arrays of numbers with a channel's samples")
    length = max(row.size for row in rows.values()) if stamps is None else stamps.size
    kept = {name: row for name, row in rows.items() if row.size == length}
    left_out = tuple(
        (name, f"{row.size} samples, others have {length}")
        for name, row in every.items()
        if row.size != length and row.size >= IN_MEMORY.fewest
    )
    for name, row in rows.items():
        if row.size != length and row.size > length / 2:
            raise MixedRatesError(
                f"{path}: {name!r} has {row.size} samples, others have {length}: keep the channels of one rate with "
                "--channels",
                tuple(kept),
                left_out,
            )
    return kept, left_out


def written_arrays(recording: Recording) -> dict[str, NDArray[Any]]:
    """Return named arrays from which the recording can be read."""
    columns, channels = written(recording, has_units=False), recording.channels
    arrays = {
        columns.time: columns.stamps,
        "samples": columns.values,
        "channels": np.array(recording.names),
        "units": np.array(columns.units),
    }
    if any(channel.comment for channel in channels):
        arrays["comments"] = np.array([channel.comment for channel in channels])
    if any(channel.calibration for channel in channels):
        arrays["calibrations"] = np.array([channel.calibration for channel in channels])
    if recording.comment:
        arrays["comment"] = np.array([recording.comment])
    return arrays
