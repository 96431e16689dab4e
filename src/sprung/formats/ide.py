"""Recordings of enDAQ (MIDE .IDE) through idelib: a group for each sensor, calibrated."""

import logging
from collections.abc import Iterator, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from sprung._checks import required
from sprung.errors import FormatError
from sprung.formats.settings import ReadSettings
from sprung.formats.stated import column_group, distinct, plain, silenced
from sprung.formats.table import Block, Column, Group, reported, row_pieces, stated_column

NAME, EXTRA = "IDE", "ide"
ENDINGS = (".ide",)

#: Every EBML document begins with this; the type of document follows within the header.
_SIGNATURE, _TYPE = b"\x1a\x45\xdf\xa3", b"mide"
_HEADER_BYTES = 64
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
    document = _document(path)
    with reported(path, NAME):
        sensors = [sensor for _, sensor in sorted(document.channels.items()) if len(sensor.getSession())]
        if not sensors:
            raise FormatError(f"{path} holds no samples")
        names = distinct([plain(sensor.displayName) or f"channel {sensor.id}" for sensor in sensors])
        return tuple(_group(path, name, document, sensor) for name, sensor in zip(names, sensors, strict=True))


def _document(path: Path) -> Any:
    """Return the contents of a file; its samples are held as they are stored."""
    importer = _importer()
    with reported(path, NAME), silenced(*_LOGGERS), path.open("rb") as file:
        document = importer.openFile(file, quiet=True)
        importer.readData(document)
        if document.fileDamaged:
            raise ValueError("a block is incomplete")
    return document


def _importer() -> Any:
    """Return the importer of idelib, whose import must not set up the logging of the program."""
    root = logging.getLogger()
    handlers = list(root.handlers)
    importer = required("idelib.importer", purpose="reading IDE files", extra="ide")
    for handler in root.handlers[:]:
        if handler not in handlers:
            root.removeHandler(handler)
    return importer


def _group(path: Path, name: str, document: Any, channel: Any) -> Group:
    """Return the axes of a sensor as they are listed and opened."""
    samples = channel.getSession()
    n_rows = len(samples)
    axes = [axis for axis in channel.subchannels if axis is not None]
    names = distinct([_axis_name(axis) for axis in axes])
    start = document.lastSession.utcStartTime

    def rows(indices: Sequence[int], first: int = 0, last: int | None = None) -> Iterator[Block]:
        places = [axes[k].id for k in indices]
        for part in row_pieces(n_rows, first, last):
            with reported(path, f"IDE file at sample {part.start + 1}"), silenced(*_LOGGERS):
                microseconds, *values = samples.arraySlice(part.start, part.stop)
            yield Block(part.start + 1, microseconds * 1e-6, np.array(values)[places])

    return column_group(
        path,
        name,
        [_column(document, channel, axis, each) for axis, each in zip(axes, names, strict=True)],
        rows,
        clock=(path, channel.id),
        n_rows=n_rows,
        time_heading="time [s]",
        start=None if start is None else round(start * 1e9),
        comment=_comment(document),
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
