"""NI TDMS through npTDMS: a group for the channels of a group that have equal times."""

from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from sprung._checks import required
from sprung.errors import FormatError
from sprung.formats.settings import TIME_UNITS, ReadSettings
from sprung.formats.stated import column_group, described, distinct, linear, plain, silenced
from sprung.formats.table import Block, Column, Group, is_time, reported, row_pieces, stated_column

NAME = "TDMS"
EXTRA = "tdms"
ENDINGS = (".tdms",)

_SIGNATURE = b"TDSm"
#: Rows that are read at once: npTDMS reads the whole chunk in which they lie.
_PIECE_ROWS = 1_048_576
#: Loggers of npTDMS that print warnings on damaged files.
_LOGGERS = tuple(f"nptdms.{name}" for name in ("reader", "tdms_segment", "base_segment", "scaling", "types", "tdms"))
#: Bytes at the head of a segment, and the size in it where the logger never wrote one.
_LEAD_BYTES = 28
_UNKNOWN_SIZE = b"\xff" * 8
_BIG_ENDIAN = 1 << 6
_STAMPS = "TimeStamp"
_EPOCH = np.datetime64("1904-01-01", "s")
#: Sample intervals [s] that are plausible.
_SHORTEST = 1e-12
_LONGEST = 1e9
_UNITS = ("unit_string", "NI_UnitDescription", "unit")
_COMMENTS = ("description", "Description", "comment", "Comment")
_ABOUT = ("title", "author", "project")
_SENSOR = ("sensitivity", "calibration", "serial")
#: Scales that npTDMS applies.
_SCALES = (
    *("Linear", "Polynomial", "RTD", "Strain", "Table", "Thermistor", "Thermocouple"),
    *("Add", "Subtract", "AdvancedAPI"),
)


def recognises(head: bytes) -> bool:
    """Return whether a file has the signature of TDMS."""
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
    note = _check_segments(path)
    with _opened(path) as tdms:
        comment = described(_about(tdms.properties, (*_COMMENTS, *_ABOUT)), note)
        parts = [(group, *clock, own) for group in tdms.groups() for clock, own in _clocks(group).items()]
        names = distinct(
            [plain(group.name) or "group" for group, *_ in parts],
            [f"{rate:.6g} Hz" if rate else f"{n_rows} rows" for _, n_rows, rate, *_ in parts],
        )
        result = tuple(
            _group(path, name, group, own, rate=rate, start=start, comment=comment)
            for name, (group, _, rate, start, own) in zip(names, parts, strict=True)
        )
    if not result:
        raise FormatError(f"{path} holds no channel of numbers with samples")
    return result


@contextmanager
def _opened(path: Path) -> Iterator[Any]:
    """Open a file with npTDMS, without the index file that may lie next to it; its errors become sentences."""
    nptdms = required("nptdms", purpose="reading TDMS files", extra="tdms")
    with reported(path, "TDMS file"), silenced(*_LOGGERS), path.open("rb") as file:
        yield nptdms.TdmsFile.open(file, raw_timestamps=True)


def _check_segments(path: Path) -> str:
    """Return a note if the logger never finished the last segment; raise if the file was cut short."""
    size = path.stat().st_size
    position = end = 0
    with path.open("rb") as file:
        while end < size:
            position = end
            file.seek(position)
            lead = file.read(_LEAD_BYTES)
            if not recognises(lead):
                raise FormatError(f"{path} is not a TDMS file: it does not hold TDSm at byte {position}")
            stated = lead[12:20]
            if stated == _UNKNOWN_SIZE:
                return "the logger did not finish the last segment"
            is_big_endian = len(lead) > 4 and lead[4] & _BIG_ENDIAN
            end = position + _LEAD_BYTES + int.from_bytes(stated, "big" if is_big_endian else "little")
    if end > size or not end:
        raise FormatError(f"{path} ends within the segment at byte {position}: check that the file is complete")
    return ""


def _clocks(group: Any) -> dict[tuple[int, float | None, int | None], list[Any]]:
    """Return the channels of numbers of a group by length, rate and start."""
    clocks: dict[tuple[int, float | None, int | None], list[Any]] = {}
    for channel in group.channels():
        if len(channel) and channel.dtype.kind in "biuf" and not _is_clock(channel):
            clocks.setdefault((len(channel), *_waveform(channel.properties)), []).append(channel)
    return clocks


def _is_clock(channel: Any) -> bool:
    """Whether a channel holds time stamps."""
    return channel.data_type.__name__ == _STAMPS or is_time(plain(channel.name))


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
    seconds = int(stamp.seconds) + int(_EPOCH.astype(np.int64))
    result = seconds * 10**9 + round(int(stamp.second_fractions) * 10**9 / 2**64)
    return result if 0 < result < np.iinfo(np.int64).max else None


def _property(properties: Mapping[str, Any], names: Sequence[str]) -> str:
    """Return the text of the first property that has one."""
    return next((text for text in (plain(properties.get(name)) for name in names) if text), "")


def _about(properties: Mapping[str, Any], names: Sequence[str]) -> str:
    """Return a description, and the other properties of some names with them."""
    stated = [_property(properties, _COMMENTS)]
    stated += [f"{name}: {plain(properties[name])}" for name in names if name not in _COMMENTS and name in properties]
    return described(*stated)


def _calibration(properties: Mapping[str, Any]) -> str:
    """Return the scales from raw to physical values in words, and what is stated of the sensor."""
    stated = []
    for name, value in properties.items():
        scale, _, entry = name.rpartition("_Scale_Type")
        kind = plain(value)
        slope = properties.get(f"{scale}_Linear_Slope")
        intercept = properties.get(f"{scale}_Linear_Y_Intercept")
        if not scale.startswith("NI_Scale[") or entry or not kind:
            continue
        if kind == "Linear" and slope is not None and intercept is not None:
            stated.append(linear(slope, intercept))
        else:
            stated.append(f"{kind} scale" if kind in _SCALES else f"{kind} scale, not applied")
    stated += [
        f"{name}: {plain(value)}"
        for name, value in properties.items()
        if any(word in name.lower() for word in _SENSOR) and not name.startswith("NI_Scale")
    ]
    return described(*stated)


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


def _group(
    path: Path, name: str, group: Any, channels: Sequence[Any], *, rate: float | None, start: int | None, comment: str
) -> Group:
    """Return channels with equal times; without a rate, with the channel of time stamps of their length."""
    n_rows = len(channels[0])
    same_length = [channel for channel in group.channels() if len(channel) == n_rows]
    time = None if rate else next(filter(_is_clock, same_length), None)
    heading = None
    if time is not None:
        unit = _property(time.properties, _UNITS)
        heading = plain(time.name) or "time"
        if unit in TIME_UNITS and time.data_type.__name__ != _STAMPS:
            heading = f"{heading} [{unit}]"
    places = [(channel.group_name, channel.name) for channel in channels]
    time_place = None if time is None else (time.group_name, time.name)

    def rows(indices: Sequence[int], first: int = 0, last: int | None = None) -> Iterator[Block]:
        with _opened(path) as tdms:
            for part in row_pieces(n_rows, first, last, size=_PIECE_ROWS):
                values = np.empty((len(indices), part.stop - part.start))
                for place, index in zip(values, indices, strict=True):
                    place[:] = _samples(tdms, places[index], part)
                yield Block(part.start + 1, None if time_place is None else _samples(tdms, time_place, part), values)

    return column_group(
        path,
        name,
        [_column(*pair) for pair in zip(channels, distinct([channel.name for channel in channels]), strict=True)],
        rows,
        clock=(n_rows, rate, start) if rate else name,
        n_rows=n_rows,
        sampling_rate=rate,
        time_heading=heading,
        start=start,
        comment=described(comment, _about(group.properties, _COMMENTS)),
    )


def _samples(tdms: Any, place: tuple[str, str], part: slice) -> Any:
    """Return some samples of a channel in physical units, or UTC."""
    group, channel = place
    samples = tdms[group][channel][part]
    if not hasattr(samples, "second_fractions"):
        return samples
    # npTDMS counts the fractions of 2^-64 s in whole steps of a date-time: they are rounded here.
    fractions = np.round(samples.second_fractions.astype(np.float64) * (1e9 / 2**64)).astype("m8[ns]")
    return _EPOCH + samples.seconds.astype("m8[s]") + fractions
