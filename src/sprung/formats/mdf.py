"""ASAM MDF 2 to 4 through asammdf: signals with the clock of their channel group, and raw CAN frames with a database.

The stamps of every group are seconds since the start of the file, so those of groups with different clocks compare.
"""

import html
import re
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Real
from sprung._checks import required
from sprung.errors import FormatError
from sprung.formats.can import Frames, message_groups
from sprung.formats.settings import ReadSettings
from sprung.formats.stated import column_group, described, distinct, linear, plain, silenced
from sprung.formats.table import Block, Column, Group, reported, stated_column

NAME, EXTRA = "MDF", "mdf"
ENDINGS = (".mf4", ".mdf", ".mf3")

_SIGNATURES = (b"MDF     ", b"UnFinMF ")
#: Bytes of records that are read at once.
_PIECE_BYTES = 8_388_608
#: Event of a bus that is decoded.
_FRAMES = "CAN_DataFrame"
_FRAME_FIELDS = tuple(f"{_FRAMES}.{field}" for field in ("ID", "IDE", "BusChannel", "DataBytes", "DataLength"))
_TEXT = re.compile(r"<TX[^>]*>(.*?)</TX>", re.DOTALL)
_FORMULA = re.compile(r"[\w\s.,+\-*/^%()<>=!&|~]{0,1000}")


@dataclass(frozen=True, slots=True)
class _Codes:
    """Numbers of version 4 of the format."""

    numbers: frozenset[int] = frozenset(range(6))  # data types of integers and floating-point numbers
    kinds: frozenset[int] = frozenset({0, 2, 3, 6})  # channels with one value a record: values, masters, virtual ones
    virtual: frozenset[int] = frozenset({3, 6})  # channels without bytes
    linear: int = 1  # conversion
    conversions: tuple[tuple[int, str], ...] = (
        (2, "rational"),
        (4, "table, interpolated"),
        (5, "table"),
        (6, "table of ranges"),
    )
    time: int = 1  # kind of synchronisation of a master that counts time
    local_time: int = 1  # flag of a start in local time
    bus_event: int = 2  # flag of groups of events on any bus
    identifier: int = 0x1FFFFFFF  # bits of the identifier of a CAN frame
    largest_standard: int = 0x7FF  # largest identifier of 11 bits
    longest_group_name: int = 60  # letters
    hour: int = 3_600 * 10**9  # ns


@dataclass(frozen=True, slots=True)
class _OldCodes(_Codes):
    """Those of versions 2 and 3 that differ."""

    numbers: frozenset[int] = frozenset({0, 1, 2, 3, *range(9, 17)})
    kinds: frozenset[int] = frozenset({0, 1})
    virtual: frozenset[int] = frozenset()
    linear: int = 0
    conversions: tuple[tuple[int, str], ...] = (
        (1, "table, interpolated"),
        (2, "table"),
        (6, "polynomial"),
        (7, "exponential"),
        (8, "logarithmic"),
        (9, "rational"),
    )


_CODES, _OLD_CODES = _Codes(), _OldCodes()


def recognises(head: bytes) -> bool:
    """Return whether a file has the signature of MDF."""
    return head.startswith(_SIGNATURES)


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the channel groups of an MDF file that hold numbers; raw CAN frames give a group for each message.

    Raises
    ------
    FormatError
        If the file is damaged or holds no samples, or only raw CAN frames that no database decodes.
    MissingPackageError
        If asammdf is not installed, or cantools where there are raw CAN frames and databases.
    """
    with _opened(path) as mdf, reported(path, "MDF file"):
        start, is_local = _start(mdf)
        comment = _comment(mdf, is_local=is_local)
        records = [_records(path, mdf, index) for index in range(len(mdf.groups))]
    records = [item for item in records if item.n_rows]
    signals = [item for item in records if item.columns]
    named = zip(distinct([item.name for item in signals]), signals, strict=True)
    result = [_group(item, name, start, comment) for name, item in named]
    buses = [partial(_frames, item) for item in records if item.frames]
    if buses and (settings.databases or not result):
        result += message_groups(path, buses, settings.databases, start=start, comment=comment)
    if not result:
        raise FormatError(f"{path} holds no samples: none of its channel groups has records of numbers")
    return tuple(result)


@dataclass(frozen=True, slots=True)
class _Records:
    """Records of a channel group: its number, its name, its channels of numbers with their numbers, and its clock."""

    path: Path
    index: int
    name: str
    columns: tuple[Column, ...]
    numbers: tuple[int, ...]
    n_rows: int
    master: int
    has_time: bool
    sampling_rate: float | None
    frames: tuple[tuple[str, int], ...]


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a file with asammdf; whatever it raises becomes a sentence."""
    asammdf = required("asammdf", purpose="reading MDF files", extra="mdf")
    with reported(path, "MDF file"), silenced("asammdf"):
        mdf = asammdf.MDF(path, process_bus_logging=False)
    try:
        mdf.configure(read_fragment_size=_PIECE_BYTES)
        yield mdf
    finally:
        mdf.close()


def _is_old(mdf: Any) -> bool:
    """Return whether a file has the blocks of versions 2 and 3."""
    return bool(mdf.version < "4.00")


def _codes(mdf: Any) -> _Codes:
    """Return the numbers of the version of a file."""
    return _OLD_CODES if _is_old(mdf) else _CODES


def _records(path: Path, mdf: Any, index: int) -> _Records:
    """Return a channel group."""
    group = mdf.groups[index]
    n_rows = int(group.channel_group.cycles_nr)
    owner = index
    if getattr(group.channel_group, "cg_master_index", None) is not None:
        owner = int(group.channel_group.cg_master_index)
    master = mdf.masters_db.get(owner)
    has_time, rate = _time(mdf, owner, master)
    clocks = {master} if owner == index and (has_time or rate) else set()
    is_bus = not _is_old(mdf) and bool(group.channel_group.flags & _CODES.bus_event)
    numbers = [] if is_bus else [k for k in range(len(group.channels)) if k not in clocks and _is_number(mdf, group, k)]
    for number in [*numbers, *([] if master is None or owner != index else [master])]:
        _check_place(path, mdf, group, number)
    channels = [group.channels[k] for k in numbers]
    sources = [plain(getattr(channel.source, "name", "")) for channel in channels]
    names = distinct([channel.name for channel in channels], sources)
    columns = [_column(mdf, channel, name) for channel, name in zip(channels, names, strict=True)]
    frames = [(channel.name, k) for k, channel in enumerate(group.channels) if channel.name in _FRAME_FIELDS]
    return _Records(
        path,
        index,
        _group_name(group, index),
        tuple(columns),
        tuple(numbers),
        n_rows,
        owner,
        has_time,
        rate,
        tuple(frames) if {_FRAME_FIELDS[0], _FRAME_FIELDS[3]} <= {name for name, _ in frames} else (),
    )


def _check_place(path: Path, mdf: Any, group: Any, number: int) -> None:
    """Raise if a channel lies outside the records of its group: the compiled code of asammdf does not check that."""
    channel = group.channels[number]
    if channel.channel_type in _codes(mdf).virtual or channel.bit_count == 0:
        return
    if _is_old(mdf):
        end = channel.start_offset + 8 * getattr(channel, "additional_byte_offset", 0) + channel.bit_count
    else:
        end = 8 * channel.byte_offset + channel.bit_offset + channel.bit_count
    place = mdf._mdf._prepare_record(group)[number]
    if place is not None:
        end = max(end, 8 * (place[1] + place[2]))
    if end > 8 * group.channel_group.samples_byte_nr:
        raise FormatError(
            f"{path} cannot be read as MDF (channel {plain(channel.name)!r} lies outside its records): check that "
            "the file is complete"
        )


def _time(mdf: Any, group: int, master: int | None) -> tuple[bool, float | None]:
    """Return whether a group has stamps, and the sampling rate where it states that in place of stamps."""
    if master is None:
        return False, None
    channel = mdf.groups[group].channels[master]
    if not _is_old(mdf):
        return channel.sync_type == _CODES.time, None
    if channel.bit_count == 0:
        return False, 1 / channel.sampling_rate if channel.sampling_rate > 0 else None
    return True, None


def _is_number(mdf: Any, group: Any, index: int) -> bool:
    """Return whether a channel has one number in each record."""
    channel, codes = group.channels[index], _codes(mdf)
    is_value = channel.data_type in codes.numbers and channel.channel_type in codes.kinds
    return is_value and not group.channel_dependencies[index]


def _group_name(group: Any, index: int) -> str:
    """Return the name of a channel group: of its acquisition, its comment, or its number."""
    block = group.channel_group
    stated = plain(getattr(block, "acq_name", "")) or _text(block.comment)
    return stated[: _CODES.longest_group_name] or f"group {index + 1}"


def _column(mdf: Any, channel: Any, name: str) -> Column:
    """Return a channel with its unit, comment and conversion."""
    conversion = channel.conversion
    unit = plain(getattr(conversion, "unit", "")) or plain(getattr(channel, "unit", ""))
    comment = _text(channel.comment) or _text(getattr(channel, "description", ""))
    return stated_column(name, name, unit, comment=comment, calibration=_calibration(conversion, _codes(mdf)))


def _calibration(conversion: Any, codes: _Codes) -> str:
    """Return how raw values become physical ones, in words; nothing where they are the same."""
    kind = None if conversion is None else conversion.conversion_type
    if kind == codes.linear:
        rule = linear(conversion.a, conversion.b)
    elif getattr(conversion, "formula", ""):
        rule = plain(conversion.formula)
        if not _FORMULA.fullmatch(rule):
            raise FormatError(f"the formula {rule[:60]!r} of a conversion is not arithmetic")
    else:
        rule = "" if kind is None else dict(codes.conversions).get(kind, "")
    return ", ".join(filter(None, (plain(getattr(conversion, "name", "")), rule)))


def _text(comment: Any) -> str:
    """Return the text of a comment, which may be XML."""
    stated = comment.decode("latin-1").split("\0")[0] if isinstance(comment, bytes) else str(comment or "")
    if not stated.lstrip().startswith("<"):
        return plain(stated)
    return plain(" ".join(html.unescape(text) for text in _TEXT.findall(stated)))


def _start(mdf: Any) -> tuple[int | None, bool]:
    """Return the start of the measurement [ns since 1970], and whether that is local time of an unknown zone."""
    header = mdf.header
    stated = int(getattr(header, "abs_time", 0))
    if not _is_old(mdf):
        return stated or None, bool(stated and header.time_flags & _CODES.local_time)
    try:
        text = f"{header.date.decode('ascii')} {header.time.decode('ascii')}".replace("\0", "")
        local = int(datetime.strptime(text, "%d:%m:%Y %H:%M:%S").replace(tzinfo=UTC).timestamp()) * 10**9
    except ValueError:
        return stated or None, False
    if not stated:
        return local, True
    # The format counts local time here, some programs write UTC: the text beside it is local in both.
    return stated - (header.tz_offset * _CODES.hour if abs(stated - local) < 10**9 else 0), False


def _comment(mdf: Any, *, is_local: bool) -> str:
    """Return the comment on the measurement, with who measured what, and a note on a start that is not UTC."""
    header = mdf.header
    stated = [_text(header.description)]
    for word in ("author", "department", "project", "subject"):
        value = plain(getattr(header, word, ""))
        if value:
            stated.append(f"{word}: {value}")
    if is_local:
        stated.append("start in local time of an unknown zone")
    return described(*stated)


def _group(records: _Records, name: str, start: int | None, comment: str) -> Group:
    """Return a channel group as it is listed and opened."""

    def rows(indices: Sequence[int], first: int = 0, last: int | None = None) -> Iterator[Block]:
        for mdf, row, fragment, stamps in _fragments(records, first, last):
            with reported(records.path, f"MDF file at record {row + 1}"), silenced("asammdf"):
                values = [_physical(mdf, records.index, records.numbers[k], fragment) for k in indices]
                block = Block(row + 1, stamps if records.has_time else None, np.array(values, dtype=np.float64))
            yield block

    return column_group(
        records.path,
        name,
        records.columns,
        rows,
        clock=(records.path, records.master),
        n_rows=records.n_rows,
        sampling_rate=records.sampling_rate,
        time_heading="time [s]" if records.has_time else None,
        row_word="record",
        start=start,
        comment=comment,
    )


def _fragments(records: _Records, first: int, last: int | None) -> Iterator[tuple[Any, int, Any, Real]]:
    """Yield the opened file and the raw bytes of some records in pieces: number of the first, bytes, stamps [s].

    Raises
    ------
    FormatError
        If the file ends before the last record that it declares.
    """
    until = min(records.n_rows, sys.maxsize if last is None else last)
    if first >= until:
        return
    row = first
    with _opened(records.path) as mdf:
        group = mdf.groups[records.index]
        pieces = mdf._mdf._load_data(group, record_offset=first, record_count=until - first)
        while row < until:
            with reported(records.path, f"MDF file at record {row + 1}"), silenced("asammdf"):
                fragment = next(pieces, None)
                stamps = np.array([])
                if fragment is not None:
                    stamps = np.array(mdf.get_master(records.index, data=fragment), dtype=np.float64)
            if not stamps.size:
                raise FormatError(
                    f"{records.path} ends after record {row} of {records.n_rows}: check that the file is complete"
                )
            yield mdf, row, fragment, stamps
            row += stamps.size


def _physical(mdf: Any, group: int, number: int, fragment: Any) -> NDArray[Any]:
    """Return the physical values of a channel in a piece; NaN where the file marks them as invalid."""
    values, invalid = mdf.get(
        group=group, index=number, data=fragment, raw=True, samples_only=True, ignore_invalidation_bits=True
    )
    conversion = mdf.groups[group].channels[number].conversion
    if conversion is not None:
        values = conversion.convert(values, ignore_value2text_conversions=True)
    if invalid is not None:
        values = np.where(np.asarray(invalid, dtype=bool), np.nan, values)
    return values


def _frames(records: _Records, first: int = 0) -> Iterator[Frames]:
    """Yield the CAN frames of a channel group from some record on."""
    for mdf, row, fragment, stamps in _fragments(records, first, None):
        with reported(records.path, f"MDF file at record {row + 1}"), silenced("asammdf"):
            frames = _frames_of(mdf, records, fragment, stamps)
        yield frames


def _frames_of(mdf: Any, records: _Records, fragment: Any, stamps: Real) -> Frames:
    """Return the CAN frames in a piece."""
    values = {
        name.removeprefix(f"{_FRAMES}."): mdf.get(
            group=records.index, index=number, data=fragment, raw=True, samples_only=True
        )[0]
        for name, number in records.frames
    }
    ids = values["ID"].astype(np.uint32)
    extended = values["IDE"].astype(bool) if "IDE" in values else (ids > _CODES.largest_standard)
    payload = np.atleast_2d(values["DataBytes"]).view(np.uint8).reshape(stamps.size, -1)
    n_bytes = values.get("DataLength", np.full(stamps.size, payload.shape[1]))
    buses = values.get("BusChannel", np.zeros(stamps.size)).astype(np.uint8)
    identifiers = (ids & np.uint32(_CODES.identifier)) | (extended.astype(np.uint32) << np.uint32(31))
    return Frames(stamps, buses, identifiers, payload, n_bytes)
