"""Recordings of enDAQ (MIDE .IDE) through idelib: a group for each sensor, calibrated, block by block.

Blocks of samples of all channels follow one another, each with the time of its first and last sample. idelib itself
would hold all of them at once.
"""

import logging
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np
from numpy.lib.recfunctions import structured_to_unstructured
from numpy.typing import NDArray

from sprung._arrays import Real
from sprung._checks import required
from sprung.errors import FormatError
from sprung.formats.settings import ReadSettings
from sprung.formats.stated import column_group, distinct, plain, silenced
from sprung.formats.table import Block, Column, Group, reported, stated_column, within

NAME, EXTRA = "IDE", "ide"
ENDINGS = (".ide",)

#: Every EBML document begins with this; the type of document follows within the header.
_SIGNATURE, _TYPE = b"\x1a\x45\xdf\xa3", b"mide"
_HEADER_BYTES = 64
_BLOCK = "ChannelDataBlock"
#: Blocks whose heads are read at once.
_BATCH = 64
_LOGGERS = ("idelib", "idelib.importer", "idelib.dataset", "idelib.parsers", "idelib.transforms", "ebmlite.core")


def recognises(head: bytes) -> bool:
    """Return whether a file has the signature of IDE."""
    return head.startswith(_SIGNATURE) and _TYPE in head[:_HEADER_BYTES]


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the channels of an IDE file, each with its axes.

    Raises
    ------
    FormatError
        If the file is damaged or holds no samples.
    MissingPackageError
        If idelib is not installed.
    """
    with path.open("rb") as file:
        if not recognises(file.read(_HEADER_BYTES)):
            raise FormatError(f"{path} is not an IDE file: it does not begin as a recording of enDAQ does")
    with _opened(path) as document:
        counts = Counter[int]()
        for block in _blocks_of(path, document):
            counts[block.channel] += block.numSamples
        with reported(path, "IDE file"):
            sensors = [_sensor(path, document, number, counts[number]) for number in sorted(document.channels)]
    sensors = [sensor for sensor in sensors if sensor.n_rows]
    if not sensors:
        raise FormatError(f"{path} holds no samples")
    names = distinct([sensor.name for sensor in sensors])
    return tuple(_group(name, sensor) for name, sensor in zip(names, sensors, strict=True))


@dataclass(frozen=True, slots=True)
class _Sensor:
    """Channel of a file: its number, its name, its axes with their places in a sample, and its start [UTC ns]."""

    path: Path
    channel: int
    name: str
    columns: tuple[Column, ...]
    places: tuple[int, ...]
    n_rows: int
    comment: str
    start: int | None


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a file with idelib, which reads its header; its errors become sentences."""
    importer = _importer()
    with path.open("rb") as file:
        with reported(path, "IDE file"), silenced(*_LOGGERS):
            document = importer.openFile(file, quiet=True)
        yield document


def _importer() -> Any:
    """Return the importer of idelib, whose import must not set up the logging of the program."""
    root = logging.getLogger()
    handlers = list(root.handlers)
    importer = required("idelib.importer", purpose="reading IDE files", extra="ide")
    for handler in root.handlers[:]:
        if handler not in handlers:
            root.removeHandler(handler)
    return importer


def _sensor(path: Path, document: Any, number: int, n_rows: int) -> _Sensor:
    """Return a channel of a document."""
    channel = document.channels[number]
    axes = [axis for axis in channel.subchannels if axis is not None]
    names = distinct([_axis_name(axis) for axis in axes])
    start = document.lastSession.utcStartTime
    return _Sensor(
        path,
        number,
        plain(channel.displayName) or f"channel {number}",
        tuple(_column(document, channel, axis, name) for axis, name in zip(axes, names, strict=True)),
        tuple(axis.id for axis in axes),
        n_rows,
        _comment(document),
        None if start is None else round(start * 1e9),
    )


def _axis_name(axis: Any) -> str:
    """Return the name of an axis; where it only has a number, what it measures."""
    name, label = plain(axis.name), plain(axis.units[0])
    return label if label and name.endswith(f":{axis.id:02d}") else name


def _column(document: Any, channel: Any, axis: Any, name: str) -> Column:
    """Return an axis with its unit, its sensor and its calibration."""
    sensor = axis.sensor if hasattr(axis.sensor, "name") else document.sensors.get(axis.sensor)
    about = [plain(getattr(sensor, "name", ""))]
    serial = (getattr(sensor, "traceData", None) or {}).get("serialNum")
    if serial:
        about.append(f"serial number {plain(serial)}")
    transforms = [plain(item) for item in (channel.transform, axis.transform) if hasattr(item, "function")]
    stated = [text for text in transforms if text not in {"", "x", "(x)"}]
    information = document.recorderInfo
    for key, word in (("CalibrationDate", "calibrated"), ("CalibrationExpiry", "expires")):
        if key in information:
            stated.append(f"{word} {datetime.fromtimestamp(information[key], UTC):%Y-%m-%d}")
    return stated_column(
        name, name, plain(axis.units[1]), comment=", ".join(filter(None, about)), calibration="; ".join(stated)
    )


def _comment(document: Any) -> str:
    """Return the recorder: product, serial number and name."""
    information = document.recorderInfo
    stated = [plain(information.get("ProductName"))]
    if "RecorderSerial" in information:
        stated.append(f"serial number {information['RecorderSerial']}")
    stated.append(plain(information.get("RecorderName")))
    return ", ".join(filter(None, stated))


def _group(name: str, sensor: _Sensor) -> Group:
    """Return the axes of a sensor as they are listed and opened."""

    def rows(indices: Sequence[int], first: int = 0, last: int | None = None) -> Iterator[Block]:
        return within(_rows(sensor, [sensor.places[k] for k in indices], first), first, last)

    return column_group(
        sensor.path,
        name,
        sensor.columns,
        rows,
        clock=(sensor.path, sensor.channel),
        n_rows=sensor.n_rows,
        time_heading="time [s]",
        start=sensor.start,
        comment=sensor.comment,
    )


def _rows(sensor: _Sensor, places: Sequence[int], first: int) -> Iterator[Block]:
    """Yield the samples of a channel block by block; blocks before the row `first` without their values."""
    with _opened(sensor.path) as document:
        with reported(sensor.path, "IDE file"):
            events = document.channels[sensor.channel].getSession()
            if places:
                _load(sensor, document, events)
            document.loading = False  # or idelib leaves values that it cannot calibrate as they are in memory
        row = 0
        for block in _blocks_of(sensor.path, document, sensor.channel):
            with reported(sensor.path, f"IDE file at sample {row + 1}"):
                stamps = np.linspace(block.startTime * 1e-6, block.endTime * 1e-6, block.numSamples)
                values = np.full((len(places), block.numSamples), np.nan)
                if places and row + block.numSamples > first:
                    values[:] = _values(events, block)[list(places)]
            yield Block(row + 1, stamps, values)
            row += block.numSamples


def _load(sensor: _Sensor, document: Any, events: Any) -> None:
    """Load the channels, such as temperature, whose mean is in the calibration of another one."""
    sources = {
        item.channelId
        for item in (events._fullXform, *events._fullXform.polys)
        if getattr(item, "channelId", None) is not None
    } - {sensor.channel}
    for source in sources:
        target = document.channels[source].getSession()
        for block in _blocks_of(sensor.path, document, source):
            with silenced(*_LOGGERS):
                target.append(block)


def _values(events: Any, block: Any) -> Real:
    """Return the calibrated values of a block, shape (axes, samples)."""
    content = block._payloadEl.dump()
    raw: NDArray[Any] = np.frombuffer(content[: len(content) - len(content) % events._npType.itemsize], events._npType)
    if raw.size < block.numSamples:
        raise ValueError(f"a block of {block.numSamples} samples ends after {raw.size}")
    plain_values = structured_to_unstructured(raw[: block.numSamples]).T
    values = np.empty(plain_values.shape)
    with np.errstate(all="ignore"):
        events._fullXform.inplace(plain_values, out=values)
    return values


def _blocks_of(path: Path, document: Any, channel: int | None = None) -> Iterator[Any]:
    """Yield the blocks of samples of a channel, or of all channels; their samples are read only when asked for."""
    parser = document._parsers[_BLOCK]
    for stamps in (parser.timestampOffset, parser.lastStamp):
        stamps.clear()
    blocks = _found(parser, document, channel)
    while True:
        with reported(path, "IDE file"), silenced(*_LOGGERS):
            batch = list(islice(blocks, _BATCH))
        if not batch:
            return
        yield from batch


def _found(parser: Any, document: Any, channel: int | None) -> Iterator[Any]:
    """Yield the blocks with samples of a channel of the document, or of all of them."""
    for element in document.ebmldoc:
        block = _block(parser, element) if element.name == _BLOCK else None
        if block is None or channel not in {None, block.channel} or block.channel not in document.channels:
            continue
        block.numSamples = int(block.payloadSize // document.channels[block.channel].parser.size)
        if block.numSamples:
            yield block


def _block(parser: Any, element: Any) -> Any:
    """Return a block with its times [us]; idelib turns counts that overflow into times."""
    block = parser.product(element)
    block.startTime = block.startTimeOriginal = int(parser.fixOverflow(block, block.startTime))
    block.endTime = block.endTimeOriginal = int(parser.fixOverflow(block, block.endTime))
    return block
