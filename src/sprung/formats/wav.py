"""Sound files (WAV): RIFF, RIFX, RF64 and BW64 with samples in PCM or floating point."""

import mmap
import re
import struct
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Real
from sprung.errors import FormatError
from sprung.formats.settings import ReadSettings
from sprung.formats.stated import column_group, decoded, described, mapped, plain, utc
from sprung.formats.table import Block, Column, Group, reported, row_pieces

NAME, EXTRA = "WAV", None
ENDINGS = (".wav", ".wave", ".rf64", ".bwf")

_FORMS = {b"RIFF": "<", b"RIFX": ">", b"RF64": "<", b"BW64": "<"}
_PCM, _FLOAT, _EXTENSIBLE = 1, 3, 0xFFFE
#: Size of a chunk that is stated elsewhere, or was unknown when the file was written.
_UNKNOWN_SIZE = 0xFFFFFFFF
_MOST_CHUNKS = 10_000
_LONGEST_TEXT = 1 << 16
#: Texts of a list INFO: name, subject, comment, date, artist.
_NOTES = (b"INAM", b"ISBJ", b"ICMT", b"ICRD", b"IART")
_MOMENT = re.compile(r"(\d{4})\D(\d\d)\D(\d\d) (\d\d)\D(\d\d)\D(\d\d)")
_DAY = 86_400 * 10**9


@dataclass(frozen=True, slots=True)
class _Header:
    """Layout of the samples, start [ns since 1970, UTC], comment."""

    order: str
    is_float: bool
    width: int  #: Bytes of a value.
    n_channels: int
    sampling_rate: float
    begin: int
    n_samples: int
    start: int | None
    comment: str


def recognises(head: bytes) -> bool:
    """Return whether a file has the signature of WAV."""
    return head[:4] in _FORMS and head[8:12] == b"WAVE"


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the only group of a WAV file, with the channels `channel_1` ...

    Full scale is 1, whatever the width of the samples: the factor to a unit belongs in the vehicle file. The start is
    that in a chunk `bext` (Broadcast Wave), which has no time zone and counts as UTC; comments are those of `bext` and
    `INFO`.

    Raises
    ------
    FormatError
        If the file is damaged, or its samples are compressed.
    """
    with reported(path, NAME), mapped(path) as content:
        header = _header(path, content)
    columns = tuple(
        Column(name, name, unit="full scale") for name in (f"channel_{k}" for k in range(1, header.n_channels + 1))
    )

    def rows(indices: Sequence[int], first: int = 0, last: int | None = None) -> Iterator[Block]:
        return _blocks(path, header, indices, row_pieces(header.n_samples, first, last))

    group = column_group(
        path,
        path.name,
        columns,
        rows,
        clock=path.name,
        n_rows=header.n_samples,
        sampling_rate=header.sampling_rate,
        start=header.start,
        comment=header.comment,
    )
    return (group,)


def _chunks(content: mmap.mmap | bytes, order: str, position: int) -> Iterator[tuple[bytes, int, int]]:
    """Yield name, offset and declared size [bytes] of the chunks from a position on."""
    sizes: dict[bytes, int] = {}
    for _ in range(_MOST_CHUNKS):
        if position + 8 > len(content):
            return
        name, size = struct.unpack(f"{order}4sI", content[position : position + 8])
        begin = position + 8
        if name == b"ds64":
            _, sizes[b"data"], _ = struct.unpack("<3Q", content[begin : begin + 24])
        if size == _UNKNOWN_SIZE:
            size = sizes.get(name, len(content) - begin)
        yield name, begin, size
        position = begin + size + size % 2


def _header(path: Path, content: mmap.mmap) -> _Header:
    """Return what the chunks of a file state.

    Raises
    ------
    FormatError
        If the file is not a WAV file or incomplete, or its samples are compressed.
    """
    order = _FORMS[content[:4]]
    layout, data, texts = b"", None, list[str]()
    date, time, n_before = "", "", 0
    for name, begin, size in _chunks(content, order, 12):
        if name == b"fmt ":
            layout = content[begin : begin + min(size, 40)]
        elif name == b"data" and data is None:
            data = begin, size
        elif name == b"LIST" and content[begin : begin + 4] == b"INFO":
            notes = content[begin : begin + min(size, _LONGEST_TEXT)]
            texts += [_text(notes[at : at + n]) for key, at, n in _chunks(notes, order, 4) if key in _NOTES]
        elif name == b"bext" and size >= 346:
            texts.append(_text(content[begin : begin + 256]))
            date, time = (_text(content[begin + at : begin + at + n]) for at, n in ((320, 10), (330, 8)))
            n_before = struct.unpack(f"{order}Q", content[begin + 338 : begin + 346])[0]
    if len(layout) < 16 or data is None:
        raise FormatError(f"{path} cannot be read as WAV: it has no complete chunk {'data' if layout else 'fmt'!r}")
    code, n_channels, rate, _, frame, bits = struct.unpack(f"{order}HHIIHH", layout[:16])
    if code == _EXTENSIBLE and len(layout) == 40:
        code = struct.unpack(f"{order}H", layout[24:26])[0]
    width = frame // n_channels if n_channels else 0
    if code not in {_PCM, _FLOAT} or width not in ({4, 8} if code == _FLOAT else {1, 2, 3, 4}):
        raise FormatError(
            f"{path} holds samples of {bits} bits in the format {code:#06x}: convert them to PCM of 8 to 32 bits or to "
            "floating point"
        )
    if rate == 0 or frame != n_channels * width:
        raise FormatError(
            f"{path} cannot be read as WAV: it states {rate} Hz and {n_channels} channels in {frame} bytes"
        )
    begin, size = data
    if begin + size > len(content):
        raise FormatError(
            f"{path} cannot be read as WAV: it declares {size // frame} samples, but holds "
            f"{(len(content) - begin) // frame}: the file is incomplete"
        )
    start = _start(date, time, n_before / rate)
    return _Header(
        order,
        code == _FLOAT,
        width,
        n_channels,
        float(rate),
        begin,
        size // frame,
        start,
        described(*texts, "start in local time" if start is not None else ""),
    )


def _text(raw: bytes) -> str:
    """Return a text up to its first zero byte, in one line."""
    return plain(decoded(raw.partition(b"\0")[0]), None)


def _start(date: str, time: str, exact: float) -> int | None:
    """Return a date and a time of day as UTC [ns]; by the exact seconds since midnight where they say the same."""
    match = _MOMENT.fullmatch(f"{date} {time}")
    start = utc(*match.groups()) if match else None
    if start is None:
        return None
    late = round(1e9 * exact) - start % _DAY
    return start + (late if abs(late) < 10**9 else 0)


def _blocks(path: Path, header: _Header, chosen: Sequence[int], pieces: Iterator[slice]) -> Iterator[Block]:
    """Yield the samples of some channels, counted from 1."""
    frame = header.width * header.n_channels
    with reported(path, NAME), mapped(path) as content:
        for piece in pieces:
            raw = content[header.begin + piece.start * frame : header.begin + piece.stop * frame]
            frames = np.frombuffer(raw, dtype=np.uint8).reshape(-1, header.n_channels, header.width)
            yield Block(piece.start + 1, None, np.stack([_values(frames[:, k], header) for k in chosen]))


def _values(raw: NDArray[np.uint8], header: _Header) -> Real:
    """Return the values of one channel from their bytes, shape (samples, width); full scale of PCM is 1."""
    if header.is_float:
        values: Real = np.ascontiguousarray(raw).view(f"{header.order}f{header.width}")[:, 0].astype(np.float64)
        return values
    if header.width == 1:
        return (raw[:, 0].astype(np.float64) - 128) / 128
    words = np.zeros((len(raw), 4), dtype=np.uint8)
    columns = slice(4 - header.width, None) if header.order == "<" else slice(0, header.width)
    words[:, columns] = raw
    scaled: Real = words.view(f"{header.order}i4")[:, 0] / 2.0**31
    return scaled
