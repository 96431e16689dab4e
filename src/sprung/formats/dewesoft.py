"""DEWESoft (.d7d, .dxd and their archives .d7z, .dxz) through the library of its maker in dwdatareader.

The library cannot read every channel: those of some CAN cards it refuses. They are named in the comment on the
measurement.
"""

import atexit
import ctypes
import sys
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import ParseError

import numpy as np

from sprung._arrays import Real
from sprung._checks import required
from sprung.errors import FormatError
from sprung.formats.settings import ReadSettings
from sprung.formats.stated import column_group, described, distinct, linear, plain, silenced
from sprung.formats.table import Block, Column, Group, reported, row_pieces, stated_column

NAME, EXTRA = "DEWESoft", "dewesoft"
ENDINGS = (".d7d", ".dxd", ".d7z", ".dxz")

_SIGNATURE, _ARCHIVE = b"MULTI_STREAM_FILE_VER", b"PK\x03\x04"
_NAME_IN_ARCHIVE = slice(30, 286)
#: Types of channels with times of their own, and with one value in all; largest type of data that is a real number.
_ASYNCHRONOUS, _SINGLE_VALUE, _LARGEST_REAL = 1, 2, 8
#: Days from 1899-12-30, from which the format counts, to 1970; a day in ns.
_EPOCH, _DAY = 25_569, 86_400 * 10**9
_EXPORT = "export it from DEWESoft as MAT or UFF 58"


def recognises(head: bytes) -> bool:
    """Return whether a file begins as data files of DEWESoft do, or is an archive that begins with one."""
    if head.startswith(_ARCHIVE):
        length = int.from_bytes(head[26:28], "little")
        return head[_NAME_IN_ARCHIVE][:length].lower().endswith((b".d7d", b".dxd"))
    return head.startswith(_SIGNATURE)


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the synchronous channels of each rate, and each asynchronous channel, which has times of its own.

    Raises
    ------
    FormatError
        If the file is damaged, none of its channels can be read, or a wanted one cannot.
    MissingPackageError
        If dwdatareader is not installed.
    """
    with _opened(path) as (library, file), reported(path, "DEWESoft file"):
        names = distinct([plain(channel.name) for channel in file.values()])
        channels = [_channel(library, file, channel, name) for channel, name in zip(file.values(), names, strict=True)]
        start, comment = _start(file, channels), _comment(file)
    unreadable = [channel.column.name for channel in channels if channel.clock is None and channel.n_rows]
    refused = [name for name in settings.channels or () if name in unreadable]
    if refused:
        raise FormatError(f"{path}: channel {refused[0]!r} cannot be read by the library of DEWESoft: {_EXPORT}")
    if unreadable:
        comment = described(comment, f"channels that cannot be read: {', '.join(unreadable)}")
    clocks: dict[Any, list[_Channel]] = {}
    for channel in channels:
        if channel.clock is not None and channel.n_rows:
            clocks.setdefault(channel.clock, []).append(channel)
    if not clocks:
        raise FormatError(f"{path} holds no channel that can be read: {_EXPORT}")
    named = zip(distinct([_group_name(own) for own in clocks.values()]), clocks.values(), strict=True)
    return tuple(_group(path, name, own, start=start, comment=comment) for name, own in named)


@dataclass(frozen=True, slots=True)
class _Channel:
    """Channel of a file: its number in the library, its clock (None where it cannot be read), and its first stamp."""

    index: int
    column: Column
    n_rows: int = 0
    clock: tuple[Any, ...] | None = None
    sampling_rate: float | None = None
    first_stamp: float = 0.0


@contextmanager
def _opened(path: Path) -> Iterator[tuple[Any, Any]]:
    """Open a file; yield the library and the file."""
    package = required("dwdatareader", purpose="reading DEWESoft files", extra="dewesoft")
    with reported(path, "DEWESoft file"), silenced():
        file = package.DWFile(str(path))
    try:
        yield package.DLL, file
    finally:
        file.close()
        atexit.unregister(file.close)


def _channel(library: Any, file: Any, channel: Any, name: str) -> _Channel:
    """Return a channel of a file; those of texts, arrays and single values have no rows."""
    column = stated_column(
        name,
        name,
        plain(channel.unit),
        comment=plain(channel.description),
        calibration=linear(channel.scale, channel.offset),
    )
    kind, n_rows = int(channel.channel_type), int(channel.number_of_samples)
    is_number = channel.array_size == 1 and channel._data_type <= _LARGEST_REAL and kind != _SINGLE_VALUE
    if not is_number or n_rows < 1:
        return _Channel(channel.index, column)
    try:
        stamps, _ = _read(library, file, channel.index, 0, 1)
    except RuntimeError:
        return _Channel(channel.index, column, n_rows)
    rate = None if kind == _ASYNCHRONOUS else _rate(channel)
    return _Channel(channel.index, column, n_rows, (rate, n_rows) if rate else (name,), rate, stamps[0])


def _rate(channel: Any) -> float | None:
    """Return the sampling rate of a synchronous channel [Hz]; None where its description cannot be read."""
    try:
        rate = float(channel.sample_rate)
    except (ParseError, ValueError, ZeroDivisionError):
        return None
    return rate if 0 < rate < np.inf else None


def _read(library: Any, file: Any, index: int, first: int, count: int) -> tuple[Real, Real]:
    """Return the stamps [s] and the scaled values of some samples of a channel.

    Raises
    ------
    RuntimeError
        If the library cannot read the channel.
    """
    stamps, values = np.zeros(count), np.zeros(count)
    status = library.DWIGetScaledSamples(
        file.reader_handle, index, ctypes.c_longlong(first), ctypes.c_longlong(count), values.ctypes, stamps.ctypes
    )
    if status:
        raise RuntimeError(f"the library reports error {status}")
    return stamps, values


def _start(file: Any, channels: Sequence[_Channel]) -> int | None:
    """Return the time of the origin of stamps, UTC ns.

    Stamps count from the start of the measurement, or of storing where that was later: the first stamp shows which.
    """
    measured, stored = file.info._start_measure_time, file.info._start_store_time
    first = next((channel.first_stamp for channel in channels if channel.clock is not None), 0.0)
    later = (stored - measured) * _DAY * 1e-9
    days = measured if later > 0 and abs(first - later) < abs(first) else stored
    nanoseconds = (days - _EPOCH) * _DAY
    return round(nanoseconds / 1000) * 1000 if 0 < nanoseconds < sys.maxsize else None


def _comment(file: Any) -> str:
    """Return what the header of the measurement says."""
    return plain("; ".join(f"{name}: {text}" for name, text in file.header.items()))


def _group_name(channels: Sequence[_Channel]) -> str:
    """Return the name of a group: its rate, or the only channel where that has times of its own."""
    rate = channels[0].sampling_rate
    return channels[0].column.name if rate is None else f"{rate:.6g} Hz"


def _group(path: Path, name: str, channels: Sequence[_Channel], *, start: int | None, comment: str) -> Group:
    """Return channels of one clock as they are listed and opened."""

    def rows(indices: Sequence[int], first: int = 0, last: int | None = None) -> Iterator[Block]:
        return _blocks(path, [channels[k] for k in indices], first, last)

    group = column_group(
        path,
        name,
        [channel.column for channel in channels],
        rows,
        clock=(path, channels[0].clock),
        n_rows=channels[0].n_rows,
        time_heading="time [s]",
        start=start,
        comment=comment,
    )
    return replace(group, sampling_rate=channels[0].sampling_rate)


def _blocks(path: Path, channels: Sequence[_Channel], first: int = 0, last: int | None = None) -> Iterator[Block]:
    """Yield some samples of channels of one clock."""
    with _opened(path) as (library, file):
        for part in row_pieces(channels[0].n_rows, first, last):
            with reported(path, f"DEWESoft file at sample {part.start + 1}"):
                read = [_read(library, file, channel.index, part.start, part.stop - part.start) for channel in channels]
            yield Block(part.start + 1, read[0][0], np.stack([values for _, values in read]))
