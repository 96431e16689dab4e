"""Recordings of phones: JSON of Sensor Logger, and archives with a CSV for each sensor (Sensor Logger, phyphox)."""

import csv as text_fields
import io
import json
import re
import zipfile
from array import array
from collections.abc import Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path, PurePosixPath
from typing import IO, Any

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Real
from sprung.errors import FormatError
from sprung.formats import csv
from sprung.formats.dialects import parsed
from sprung.formats.settings import TIME_UNITS, ReadSettings
from sprung.formats.stated import column_group, decoded, described, distinct, plain
from sprung.formats.table import (
    Block,
    Column,
    Group,
    arrow_values,
    column,
    is_time,
    reported,
    split_heading,
    stated_column,
    within,
)

NAME, EXTRA = "a phone recording", None
ENDINGS = (".json", ".zip")

_RECORDS = re.compile(rb"(\xef\xbb\xbf)?\s*\[\s*\{[^{}]*\"(sensor|seconds_elapsed)\"")
_ZIP = b"PK\x03\x04"
_BETWEEN = re.compile(r"[\s,]*")
_NANOSECONDS, _SECONDS = "time", "seconds_elapsed"
_NOT_CHANNELS = {"sensor", _NANOSECONDS, _SECONDS}
#: Units of Sensor Logger by sensor and value; those that depend on the phone's settings are left open.
_UNITS = {
    **{(sensor, axis): "m/s^2" for sensor in ("accelerometer", "gravity", "totalacceleration") for axis in "xyz"},
    **{(sensor, axis): "rad/s" for sensor in ("gyroscope", "gyroscopeuncalibrated") for axis in "xyz"},
    **{(sensor, axis): "uT" for sensor in ("magnetometer", "magnetometeruncalibrated") for axis in "xyz"},
    **{("orientation", angle): "rad" for angle in ("pitch", "roll", "yaw")},
    ("location", "speed"): "m/s",
    ("barometer", "pressure"): "mbar",
    ("batterytemp", "temperature"): "degC",
}


@dataclass(frozen=True, slots=True)
class _Limits:
    """What a recording of a phone does not exceed; other files would take memory without end."""

    piece: int = 1 << 20  # characters that are read at once
    record: int = 1 << 16  # characters of a record, or of a description in an archive
    archive: int = 1 << 30  # bytes of text in an archive: the numbers are held in memory
    members: int = 1000  # files in an archive
    sensors: int = 500  # of one phone
    columns: int = 500  # values of one sensor


_LIMITS = _Limits()


@dataclass(slots=True)
class _Sensor:
    """Samples of one sensor: columns of the same length, and times (numbers of the unit, or UTC)."""

    name: str
    columns: list[Column] = field(default_factory=list)
    values: list[Real] = field(default_factory=list)
    time: str = "time"
    stamps: NDArray[Any] = field(default_factory=lambda: np.empty(0))


def recognises(head: bytes) -> bool:
    """Return whether a file begins with records of sensors, or as an archive of other members than arrays."""
    if head.startswith(_ZIP):
        return not head[30 : 30 + int.from_bytes(head[26:28], "little")].endswith(b".npy")
    return _RECORDS.match(head) is not None


#: Size of a file, and of a table that is alone in an archive; of several the members are limited.
unpacked_size = csv.unpacked_size


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the sensors of a phone, those with the same times in one group when they are read together.

    JSON is read record by record, an archive member by member; the numbers are held in memory, eight bytes each.

    Raises
    ------
    FormatError
        If the file is damaged, a record is longer than 64 KiB, or an archive holds more than 1 GiB of text.
    """
    with path.open("rb") as file:
        is_archive = file.read(4) == _ZIP
    with reported(path, NAME):
        if is_archive:
            with zipfile.ZipFile(path) as archive:
                if len(archive.infolist()) == 1:
                    return csv.groups(path, settings)
                sensors, comment = _archive_sensors(path, archive)
        else:
            sensors, comment = _json_sensors(path)
    sensors = [sensor for sensor in sensors if sensor.columns and sensor.stamps.size]
    if not sensors:
        raise FormatError(f"{path} holds no samples: no sensor has times and numbers")
    named = zip(distinct([sensor.name for sensor in sensors]), sensors, strict=True)
    return tuple(_group(path, name, sensor, comment, is_alone=len(sensors) == 1) for name, sensor in named)


def _group(path: Path, name: str, sensor: _Sensor, comment: str, *, is_alone: bool) -> Group:
    """Return the channels of a sensor; where there are several, they are named after it."""
    columns = sensor.columns
    if not is_alone:
        columns = [replace(each, heading=f"{name}_{each.name}", name=f"{name}_{each.name}") for each in columns]

    def rows(indices: Sequence[int], first: int = 0, last: int | None = None) -> Iterator[Block]:
        yield from within([Block(1, sensor.stamps, np.array([sensor.values[k] for k in indices]))], first, last)

    return column_group(
        path,
        name,
        columns,
        rows,
        clock=hash((sensor.time, sensor.stamps.dtype.str, sensor.stamps.tobytes())),
        n_rows=sensor.stamps.size,
        time_heading=sensor.time,
        comment=comment,
    )


def _json_sensors(path: Path) -> tuple[list[_Sensor], str]:
    """Return the sensors of a list of records, and the comment."""
    series: dict[str, _Series] = {}
    metadata: Mapping[str, Any] = {}
    for record in _records(path):
        name = plain(str(record.get("sensor", path.stem)))
        if name.lower() == "metadata":
            metadata = record
            continue
        if name not in series and len(series) == _LIMITS.sensors:
            raise FormatError(f"{path} names more than {_LIMITS.sensors} sensors: this is not a recording of a phone")
        series.setdefault(name, _Series()).add(record)
    is_android = str(metadata.get("platform", "")).lower() == "android"
    sensors = [each.sensor(name, is_android=is_android) for name, each in series.items()]
    return sensors, described(*map(metadata.get, ("device name", "platform", "recording time")))


def _records(path: Path) -> Iterator[Mapping[str, Any]]:
    """Yield the records of a JSON list without reading it as a whole."""
    decoder = json.JSONDecoder()
    with path.open(encoding="utf-8-sig") as file:
        text, n_before = file.read(_LIMITS.piece), 0
        position = text.index("[") + 1
        while True:
            between = _BETWEEN.match(text, position)
            position = between.end() if between else position
            if len(text) - position < _LIMITS.record and (piece := file.read(_LIMITS.piece)):
                n_before += position
                text, position = text[position:] + piece, 0
                continue
            if text[position : position + 1] == "]":
                return
            try:
                record, end = decoder.raw_decode(text, position)
            except (json.JSONDecodeError, RecursionError) as error:
                problem = error.msg if isinstance(error, json.JSONDecodeError) else "brackets within brackets"
                raise FormatError(
                    f"{path}, character {n_before + position}: this is not a record of a sensor ({problem}): the file "
                    "is damaged or incomplete"
                ) from None
            if not isinstance(record, dict) or end - position > _LIMITS.record:
                raise FormatError(
                    f"{path}, character {n_before + position}: this is not a record of a sensor: records have up to "
                    f"{_LIMITS.record} characters"
                )
            yield record
            position = end


class _Series:
    """Collects the records of one sensor as columns of numbers."""

    def __init__(self) -> None:
        self._n_records = 0
        self._times = array("q")
        self._columns: dict[str, array[float]] = {}

    def add(self, record: Mapping[str, Any]) -> None:
        """Add one record; what is not a number is missing."""
        self._times.append(_integer(record.get(_NANOSECONDS)))
        for name, value in record.items():
            if name in self._columns or len(self._columns) < _LIMITS.columns:
                values = self._columns.setdefault(name, array("d"))
                values.extend([np.nan] * (self._n_records - len(values)))
                values.append(_number(value))
        self._n_records += 1

    def sensor(self, name: str, *, is_android: bool) -> _Sensor:
        """Return the columns in which there are numbers."""
        columns = {}
        for heading, values in self._columns.items():
            values.extend([np.nan] * (self._n_records - len(values)))
            columns[heading] = np.array(values)
        times = np.array(self._times, dtype=np.int64)
        return _logged(name, columns, times if (times > 0).all() else None, is_android=is_android)


def _integer(value: Any) -> int:
    """Return a number of nanoseconds since 1970; 0 where there is none."""
    with suppress(TypeError, ValueError, OverflowError):
        number = int(value)
        return number if 0 < number < 2**62 else 0
    return 0


def _number(value: Any) -> float:
    """Return a number, NaN for anything else."""
    with suppress(TypeError, ValueError, OverflowError):
        return float(value) if not isinstance(value, bool) else np.nan
    return np.nan


def _logged(name: str, columns: Mapping[str, Real], times: NDArray[Any] | None, *, is_android: bool) -> _Sensor:
    """Return a sensor of Sensor Logger: times in nanoseconds since 1970, or seconds since the start."""
    sensor = _Sensor(name)
    if times is not None:
        sensor.stamps = times.astype("M8[ns]")
    elif _SECONDS in columns:
        sensor.time, sensor.stamps = f"{_SECONDS} [s]", columns[_SECONDS]
    letters = re.sub(r"[^a-z]", "", name.lower())
    if is_android and letters == "accelerometeruncalibrated":
        letters = "accelerometer"
    for heading, values in columns.items():
        if heading not in _NOT_CHANNELS and np.isfinite(values).any():
            label = plain(heading) or "unnamed"
            sensor.columns.append(stated_column(label, label, _UNITS.get((letters, heading), "")))
            sensor.values.append(values)
    return sensor


def _archive_sensors(path: Path, archive: zipfile.ZipFile) -> tuple[list[_Sensor], str]:
    """Return the sensors in an archive, and the comment.

    Raises
    ------
    FormatError
        If the archive has too many members, or holds too much.
    """
    members = archive.infolist()
    tables = [each for each in members if each.filename.lower().endswith((".csv", ".txt", ".tsv"))]
    if len(members) > _LIMITS.members or sum(each.file_size for each in tables) > _LIMITS.archive:
        raise FormatError(
            f"{path} holds {len(members)} files of {sum(each.file_size for each in members)} bytes: unpack it, and "
            "read its tables one by one"
        )
    properties, starts = _properties(archive), _starts(archive)
    is_android = properties.get("platform", "").lower() == "android"
    sensors = []
    for member in tables:
        place = PurePosixPath(member.filename.lower())
        is_about = "meta" in place.parts[:-1] or place.stem in {"metadata", "annotation"}
        if is_about or place.parts[0] == "__macosx":
            continue
        with archive.open(member) as file:
            columns = _numbers(path, member.filename, file)
        name = plain(PurePosixPath(member.filename).stem) or "unnamed"
        if _SECONDS in columns:
            times = columns.get(_NANOSECONDS)
            whole = times if times is not None and times.dtype.kind == "i" else None
            sensors.append(_logged(name, columns, whole, is_android=is_android))
        elif any(map(is_time, columns)):
            sensors.append(_timed(path, name, columns, starts))
    keys = ("deviceBrand", "deviceModel", "device name", "platform", "recording time")
    return sensors, described(*(properties.get(key, "") for key in keys))


def _numbers(path: Path, member: str, file: IO[bytes]) -> dict[str, NDArray[Any]]:
    """Return the columns of numbers in a table of text; nothing where it has no header."""
    import pyarrow as pa

    content = file.read()
    first, _, rest = content.partition(b"\n")
    delimiter = next((character for character in ";\t" if character.encode() in first), ",")
    headings = [
        heading.strip() for heading in next(text_fields.reader([decoded(first).strip()], delimiter=delimiter), [])
    ]
    if not rest.strip() or len(set(headings)) < len(headings) or not all(headings):
        return {}
    decimal = "," if delimiter != "," and b"," in rest[:1000] else "."
    try:
        table = parsed(rest, headings, {}, delimiter, decimal)
    except pa.ArrowInvalid as error:
        raise FormatError(f"{path}, {member}: {' '.join(str(error).split())[:120]}: the table is damaged") from None
    columns: dict[str, NDArray[Any]] = {}
    for heading, values in zip(headings, table.columns, strict=True):
        if pa.types.is_integer(values.type) or pa.types.is_floating(values.type):
            columns[heading] = arrow_values(values)
    return columns


def _timed(path: Path, name: str, columns: Mapping[str, NDArray[Any]], starts: Real) -> _Sensor:
    """Return a sensor of phyphox: times since the start, which counts on where the recording was paused."""
    time = next(heading for heading in columns if is_time(heading))
    sensor = _Sensor(name, time=time, stamps=columns[time].astype(np.float64))
    seconds = sensor.stamps * TIME_UNITS.get(split_heading(time)[1] or "s", 1.0)
    if starts.size and np.isfinite(seconds).all():
        own = starts[np.maximum(0, np.searchsorted(starts[:, 0], seconds, side="right") - 1)]
        whole = np.floor(own[:, 1])
        fractions = own[:, 1] - whole + seconds - own[:, 0]
        nanoseconds = whole.astype(np.int64) * 10**9 + np.round(1e9 * fractions).astype(np.int64)
        sensor.stamps = nanoseconds.astype("M8[ns]")
    for heading, values in columns.items():
        if heading != time:
            sensor.columns.append(column(plain(heading), path=path))
            sensor.values.append(values.astype(np.float64))
    return sensor


def _rows(archive: zipfile.ZipFile, ending: str) -> list[list[str]]:
    """Return the rows of a description in the archive, without its header; none without such a member."""
    for member in archive.infolist():
        if member.filename.lower().endswith(ending) and member.file_size <= _LIMITS.record:
            text = decoded(archive.read(member))
            delimiter = next((character for character in ";\t" if character in text.partition("\n")[0]), ",")
            return list(text_fields.reader(io.StringIO(text), delimiter=delimiter))
    return []


def _properties(archive: zipfile.ZipFile) -> dict[str, str]:
    """Return properties of phone and recording."""
    properties = {row[0]: row[1] for row in _rows(archive, "meta/device.csv")[1:] if len(row) > 1}
    table = _rows(archive, "metadata.csv")
    return properties | (dict(zip(table[0], table[1], strict=False)) if len(table) > 1 else {})


def _starts(archive: zipfile.ZipFile) -> Real:
    """Return experiment time and time since 1970 of each start [s], shape (starts, 2)."""
    starts = []
    for row in _rows(archive, "meta/time.csv")[1:]:
        with suppress(ValueError):
            if len(row) > 2 and row[0] == "START":
                times = [float(entry.replace(",", ".")) for entry in row[1:3]]
                if 0 <= times[0] < 1e9 and 0 < times[1] < 9e9:
                    starts.append(times)
    ordered: Real = np.array(sorted(starts), dtype=np.float64).reshape(-1, 2)
    return ordered
