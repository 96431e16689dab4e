"""NI TDMS: npTDMS reads what the file holds and how raw values are scaled; samples are taken from where they lie.

A segment may hold all samples of a channel in one chunk, which npTDMS reads as a whole; views of the mapped file read
no more than is wanted.
"""

import mmap
import sys
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from itertools import accumulate
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung._checks import required
from sprung.errors import FormatError
from sprung.formats.settings import TIME_UNITS, ReadSettings
from sprung.formats.stated import chosen, distinct, linear, plain, silenced
from sprung.formats.table import Block, Column, Group, Table, is_time, reported, stated_column

NAME, EXTRA = "TDMS", "tdms"
ENDINGS = (".tdms",)

_SIGNATURE = b"TDSm"
_PIECE_ROWS = 1 << 16
#: Loggers of npTDMS that print warnings on damaged files.
_LOGGERS = tuple(f"nptdms.{name}" for name in ("reader", "tdms_segment", "base_segment", "scaling", "types", "tdms"))
#: Marks of a segment: big-endian numbers, and a size that was never written.
_BIG_ENDIAN, _UNKNOWN_SIZE = 1 << 6, b"\xff" * 8
#: Types of time stamps and of the raw values of DAQmx, which have scalers.
_STAMPS, _DAQMX, _NO_SCALER = "TimeStamp", "DaqMxRawData", -1
#: Seconds from 1904, from which the format counts, to 1970.
_EPOCH = 2_082_844_800
_LARGEST_TIME = 1 << 63
#: Sample intervals [s] that are plausible.
_SHORTEST, _LONGEST = 1e-12, 1e9
_UNITS = ("unit_string", "NI_UnitDescription", "unit")
_COMMENTS = ("description", "Description", "comment", "Comment")
_ABOUT = ("title", "author", "project")
_SENSOR = ("sensitivity", "calibration", "serial")
#: Scales that npTDMS applies, and the largest number of them that is plausible.
_SCALES = (
    "Linear",
    "Polynomial",
    "RTD",
    "Strain",
    "Table",
    "Thermistor",
    "Thermocouple",
    "Add",
    "Subtract",
    "AdvancedAPI",
)
_MOST_SCALES = 64


def recognises(head: bytes) -> bool:
    """Return whether a file begins as TDMS files do."""
    return head.startswith(_SIGNATURE)


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the groups of a TDMS file, each split where its channels differ in length, rate or start.

    Raises
    ------
    FormatError
        If the file is damaged or holds no channel of numbers.
    MissingPackageError
        If npTDMS is not installed.
    """
    with path.open("rb") as file:
        if not recognises(file.read(len(_SIGNATURE))):
            raise FormatError(f"{path} is not a TDMS file: it does not begin with TDSm")
    with _opened(path) as tdms:
        about = _about(tdms.properties, (*_COMMENTS, *_ABOUT))
        note = _check_end(path, tdms)
        comment = "; ".join(filter(None, (about, note)))
        parts = [part for group in tdms.groups() for part in _parts(path, group, comment)]
    if not parts:
        raise FormatError(f"{path} holds no channel of numbers with samples")
    names = distinct(_names(parts))
    return tuple(_group(part, name) for part, name in zip(parts, names, strict=True))


@dataclass(frozen=True, slots=True)
class _Part:
    """Channels of a group with equal times: paths of the channels in the file, and their clock."""

    path: Path
    group: str
    columns: tuple[Column, ...]
    channels: tuple[str, ...]
    n_rows: int
    sampling_rate: float | None
    start: int | None
    time_heading: str | None
    time_channel: str | None
    comment: str


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a file with npTDMS, without the index file that may lie next to it; its errors become sentences."""
    nptdms = required("nptdms", purpose="reading TDMS files", extra="tdms")
    with reported(path, "TDMS file"), silenced(*_LOGGERS), path.open("rb") as file:
        yield nptdms.TdmsFile.open(file, raw_timestamps=True)


def _check_end(path: Path, tdms: Any) -> str:
    """Return a note if the logger never finished the last segment; raise if the file was cut short.

    Raises
    ------
    FormatError
        If the file ends before its last segment does.
    """
    segments = tdms._reader._segments
    if not segments:
        raise FormatError(f"{path} holds no segment: it ends after its first bytes")
    last = segments[-1]
    with path.open("rb") as file:
        file.seek(last.position + 12)
        is_open = file.read(8) == _UNKNOWN_SIZE
        file.seek(last.next_segment_pos)
        rest = file.read(20)
    if (last.segment_incomplete and not is_open) or (rest and rest[12:] != _UNKNOWN_SIZE):
        raise FormatError(f"{path} ends within the segment at byte {last.position}: check that the file is complete")
    return "the logger did not finish the last segment" if is_open or rest else ""


def _parts(path: Path, group: Any, comment: str) -> list[_Part]:
    """Return the parts of a group that have equal times."""
    numbers = [
        channel for channel in group.channels() if len(channel) and _is_number(channel) and not _is_clock(channel)
    ]
    names = distinct([channel.name for channel in numbers])
    clocks: dict[tuple[int, float | None, int | None], list[tuple[Any, str]]] = {}
    for channel, name in zip(numbers, names, strict=True):
        _check_size(path, channel)
        clocks.setdefault((len(channel), *_waveform(channel.properties)), []).append((channel, name))
    about = "; ".join(filter(None, (comment, _about(group.properties, _COMMENTS))))
    parts = []
    for (n_rows, rate, start), own in clocks.items():
        times = [
            channel for channel in group.channels() if rate is None and len(channel) == n_rows and _is_clock(channel)
        ]
        time = times[0] if times else None
        parts.append(
            _Part(
                path,
                plain(group.name) or "group",
                tuple(_column(channel, name) for channel, name in own),
                tuple(channel.path for channel, _ in own),
                n_rows,
                rate,
                start,
                None if time is None else _time_heading(time),
                None if time is None else time.path,
                about,
            )
        )
    return parts


def _is_number(channel: Any) -> bool:
    """Return whether a channel holds real numbers, raw or scaled."""
    if channel.scaler_data_types:
        return True
    kind = getattr(channel.data_type, "nptype", None)
    return kind is not None and kind.kind in "biuf"


def _is_clock(channel: Any) -> bool:
    """Return whether a channel holds time stamps."""
    return channel.data_type.__name__ == _STAMPS or is_time(plain(channel.name))


def _time_heading(channel: Any) -> str:
    """Return the heading of a channel of time stamps, with its unit."""
    name, unit = plain(channel.name) or "time", _property(channel.properties, _UNITS)
    return f"{name} [{unit}]" if unit in TIME_UNITS and channel.data_type.__name__ != _STAMPS else name


def _check_size(path: Path, channel: Any) -> None:
    """Raise if a header declares more values or scales than there can be."""
    if len(channel) > 8 * path.stat().st_size:
        raise FormatError(
            f"{path} cannot be read as TDMS (a header declares {len(channel)} values): check that the file is complete"
        )
    if not 0 <= int(channel.properties.get("NI_Number_Of_Scales", 0)) <= _MOST_SCALES:
        raise FormatError(f"{path} cannot be read as TDMS (channel {plain(channel.name)!r} has too many scales)")


def _waveform(properties: Mapping[str, Any]) -> tuple[float | None, int | None]:
    """Return sampling rate [Hz] and time of the first sample [UTC ns] of a waveform; None where they are not stated."""
    increment = properties.get("wf_increment")
    if not isinstance(increment, float | int) or not _SHORTEST < increment < _LONGEST:
        return None, None
    start = _nanoseconds(properties.get("wf_start_time"))
    offset = properties.get("wf_start_offset", 0.0)
    if start is not None and isinstance(offset, float | int) and abs(offset) < _LONGEST:
        start += round(1e9 * offset)
    return 1 / increment, start


def _nanoseconds(stamp: Any) -> int | None:
    """Return a time stamp as ns since 1970, UTC; None for none and for the default of 1904."""
    if not hasattr(stamp, "second_fractions"):
        return None
    result = (int(stamp.seconds) - _EPOCH) * 10**9 + round(int(stamp.second_fractions) * 10**9 / 2**64)
    return result if 0 < result < _LARGEST_TIME else None


def _column(channel: Any, name: str) -> Column:
    """Return a channel with its unit, description and calibration."""
    properties = channel.properties
    return stated_column(
        name,
        name,
        _property(properties, _UNITS),
        comment=_about(properties, _COMMENTS),
        calibration=_calibration(properties),
    )


def _property(properties: Mapping[str, Any], names: Sequence[str]) -> str:
    """Return the text of the first property that has one."""
    return next((text for text in (plain(properties.get(name)) for name in names) if text), "")


def _about(properties: Mapping[str, Any], names: Sequence[str]) -> str:
    """Return a description, and the other properties of some names with them."""
    stated = [_property(properties, _COMMENTS)]
    stated += [f"{name}: {plain(properties[name])}" for name in names if name not in _COMMENTS and name in properties]
    return "; ".join(filter(None, stated))


def _calibration(properties: Mapping[str, Any]) -> str:
    """Return the scales from raw to physical values in words, and what is stated of the sensor."""
    stated = []
    for number in range(_MOST_SCALES):
        scale = f"NI_Scale[{number}]_"
        kind = plain(properties.get(f"{scale}Scale_Type"))
        slope, intercept = properties.get(f"{scale}Linear_Slope"), properties.get(f"{scale}Linear_Y_Intercept")
        if kind == "Linear" and slope is not None and intercept is not None:
            stated.append(linear(slope, intercept))
        elif kind:
            stated.append(f"{kind} scale" if kind in _SCALES else f"{kind} scale, not applied")
    stated += [
        f"{name}: {plain(value)}"
        for name, value in properties.items()
        if any(word in name.lower() for word in _SENSOR) and not name.startswith("NI_Scale")
    ]
    return "; ".join(filter(None, stated))


def _names(parts: Sequence[_Part]) -> list[str]:
    """Return the names of parts; where a group has several, with their rate or their length."""
    groups = [part.group for part in parts]
    return [part.group if groups.count(part.group) == 1 else f"{part.group} ({_extent(part)})" for part in parts]


def _extent(part: _Part) -> str:
    """Return the rate of a part; without one, its length."""
    return f"{part.n_rows} rows" if part.sampling_rate is None else f"{part.sampling_rate:.6g} Hz"


def _group(part: _Part, name: str) -> Group:
    """Return a part as it is listed and opened."""
    clock = (part.path, part.n_rows, part.sampling_rate, part.start) if part.sampling_rate else (part.path, name)
    headings = tuple(column.heading for column in part.columns)
    return Group(name, headings, clock, partial(_table, part), part.sampling_rate, part.n_rows)


def _table(part: _Part, channels: Sequence[str] | None) -> Table:
    """Return the table of some channels."""
    columns = chosen(part.path, part.columns, channels)
    paths = [part.channels[part.columns.index(column)] for column in columns]
    return Table(
        part.path,
        columns,
        part.time_heading,
        partial(_blocks, part, paths),
        row_word="sample",
        sampling_rate=part.sampling_rate,
        start=part.start,
        times=partial(_blocks, part, ()) if part.time_channel else None,
        comment=part.comment,
    )


def _blocks(part: _Part, paths: Sequence[str], first: int = 0, last: int | None = None) -> Iterator[Block]:
    """Yield some rows of channels in pieces."""
    until = min(part.n_rows, sys.maxsize if last is None else last)
    with _opened(part.path) as tdms, part.path.open("rb") as file:
        with reported(part.path, "TDMS file"):
            content = mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
            channels = [_Channel(tdms, content, path) for path in paths]
            clock = None if part.time_channel is None else _Channel(tdms, content, part.time_channel)
        for row in range(first, until, _PIECE_ROWS):
            end = min(until, row + _PIECE_ROWS)
            with reported(part.path, f"TDMS file at sample {row + 1}"), silenced(*_LOGGERS):
                values = np.empty((len(channels), end - row))
                for place, channel in zip(values, channels, strict=True):
                    place[:] = channel.values(row, end)
                stamps = None if clock is None else clock.values(row, end)
            yield Block(row + 1, stamps, values)


@dataclass(frozen=True, eq=False, slots=True)
class _Raw:
    """Raw values as npTDMS scales them: of the channel, or of each of its scalers."""

    data: NDArray[Any] | None
    scaler_data: dict[int, NDArray[Any]]


@dataclass(frozen=True, eq=False, slots=True)
class _Stretch:
    """Raw values of a channel in chunks of equal size: a view of the file of shape (chunks, rows), and what follows."""

    view: NDArray[Any]
    finish: Callable[[NDArray[Any]], NDArray[Any]] = np.asarray

    def values(self, first: int, last: int) -> NDArray[Any]:
        """Return the values from one row to before another."""
        rows = self.view.shape[1]
        chunk, end = first // rows, (last - 1) // rows
        if chunk == end:
            return self.finish(self.view[chunk, first - chunk * rows : last - chunk * rows])
        parts = (
            self.view[chunk, first - chunk * rows :],
            self.view[chunk + 1 : end],
            self.view[end, : last - end * rows],
        )
        return self.finish(np.concatenate([part.ravel() for part in parts]))


class _Channel:
    """Values of a channel in a mapped file, in physical units."""

    def __init__(self, tdms: Any, content: mmap.mmap, path: str) -> None:
        scaling = required("nptdms.scaling", purpose="reading TDMS files", extra="tdms")
        (channel,) = [own for group in tdms.groups() for own in group.channels() if own.path == path]
        group = tdms[channel.group_name]
        self._scale = scaling.get_scaling(channel.properties, group.properties, tdms.properties)
        self._holds_stamps = channel.data_type.__name__ == _STAMPS
        self._stretches: dict[int, list[_Stretch]] = {}
        for segment in tdms._reader._segments:
            for scaler, stretch in _stretches(segment, content, path):
                self._stretches.setdefault(scaler, []).append(stretch)
        self._ends = {
            scaler: list(accumulate(stretch.view.size for stretch in own)) for scaler, own in self._stretches.items()
        }

    def values(self, first: int, last: int) -> NDArray[Any]:
        """Return the values from one row to before another, shape (rows,)."""
        raw = {scaler: self._raw(scaler, first, last) for scaler in self._stretches}
        data = raw.pop(_NO_SCALER, None)
        if self._holds_stamps and data is not None:
            return _stamps(data)
        if self._scale is not None:
            return self._scale.scale(_Raw(data, raw))
        if data is None:
            raise ValueError("a channel of raw values has no scale")
        return data

    def _raw(self, scaler: int, first: int, last: int) -> NDArray[Any]:
        """Return the raw values of a scaler from one row to before another."""
        parts = []
        ends = self._ends[scaler]
        for number in range(bisect_right(ends, first), len(ends)):
            stretch = self._stretches[scaler][number]
            begin = ends[number] - stretch.view.size
            parts.append(stretch.values(max(first - begin, 0), min(last, ends[number]) - begin))
            if ends[number] >= last:
                break
        return np.concatenate(parts)


def _stretches(segment: Any, content: mmap.mmap, path: str) -> Iterator[tuple[int, _Stretch]]:
    """Yield the stretches of a channel in a segment, each with the number of its scaler.

    Full chunks follow one another; the last one may be shorter. Channels lie one after another in a chunk, or value by
    value side by side; those of DAQmx side by side in the buffer of their card.
    """
    objects = [item for item in segment.ordered_objects if item.has_data]
    order = ">" if segment.toc_mask & _BIG_ENDIAN else "<"
    chunk_bytes = segment._get_chunk_size()
    shorter = segment.final_chunk_lengths_override
    n_full = segment.num_chunks - (shorter is not None)
    full = {item.path: int(item.number_values) for item in objects}
    if path not in full:
        return
    for first, chunks, lengths in ((0, n_full, full), (n_full, 1, shorter)):
        if not chunks or not lengths or not lengths.get(path):
            continue
        origin = segment.data_position + first * chunk_bytes
        for scaler, offset, stride, dtype, finish in _places(segment, objects, lengths, path, order):
            shape, strides = (chunks, lengths[path]), (chunk_bytes, stride)
            yield scaler, _Stretch(np.ndarray(shape, dtype, content, origin + offset, strides), finish)


def _places(
    segment: Any, objects: Sequence[Any], lengths: Mapping[str, int], path: str, order: str
) -> Iterator[tuple[int, int, int, Any, Callable[[NDArray[Any]], NDArray[Any]]]]:
    """Yield scaler, offset in the chunk, distance of values [bytes], type and last step of the values of a channel."""
    (own,) = [item for item in objects if item.path == path]
    before = objects[: objects.index(own)]
    if segment._have_daqmx_objects():
        daqmx = required("nptdms.daqmx", purpose="reading TDMS files", extra="tdms")
        buffers = daqmx.get_buffer_dimensions(objects)
        for scaler in own.daqmx_metadata.scalers:
            offset = sum(rows * width for rows, width in buffers[: scaler.raw_buffer_index]) + scaler.byte_offset()
            is_raw = own.data_type.__name__ == _DAQMX
            dtype = _dtype(scaler.data_type, order)
            number = scaler.scale_id if is_raw else _NO_SCALER
            yield number, offset, buffers[scaler.raw_buffer_index][1], dtype, scaler.postprocess_data
    elif segment._have_interleaved_data():
        sizes = [item.data_type.size for item in objects]
        yield _NO_SCALER, sum(sizes[: len(before)]), sum(sizes), _dtype(own.data_type, order), np.asarray
    else:
        offset = sum(
            item.data_size if lengths.get(item.path) == item.number_values else item.data_type.size * lengths[item.path]
            for item in before
        )
        yield _NO_SCALER, offset, own.data_type.size, _dtype(own.data_type, order), np.asarray


def _dtype(data_type: Any, order: str) -> Any:
    """Return the type of raw values of numpy."""
    if data_type.__name__ == _STAMPS:
        fields = [("second_fractions", f"{order}u8"), ("seconds", f"{order}i8")]
        return np.dtype(fields if order == "<" else fields[::-1])
    return data_type.nptype.newbyteorder(order)


def _stamps(raw: NDArray[Any]) -> NDArray[Any]:
    """Return time stamps as UTC date-times; fractions count 2^-64 s."""
    fractions = np.round(raw["second_fractions"].astype(np.float64) * (1e9 / 2**64)).astype(np.int64)
    return ((raw["seconds"].astype(np.int64) - _EPOCH) * 10**9 + fractions).view("M8[ns]")
