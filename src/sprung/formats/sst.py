"""Suspension telemetry (.SST): counts of two travel sensors, fork and shock, after a header of 16 bytes."""

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path

import numpy as np

from sprung.errors import FormatError
from sprung.formats.settings import ReadSettings
from sprung.formats.stated import column_group
from sprung.formats.table import Block, Column, Group, reported, row_pieces

NAME, EXTRA = "SST", None
ENDINGS = (".sst",)

#: Signature, version, sampling rate [Hz], padding, time [s since 1970].
_HEADER = struct.Struct("<3sBHHq")
_NAMES = ("fork", "shock")
_BYTES_PER_ROW = 4
#: Times from 2001 to 2100: loggers without a clock write others.
_PLAUSIBLE = (978_307_200, 4_102_444_800)


def recognises(head: bytes) -> bool:
    """Return whether a file has the signature of SST."""
    return head[:3] == b"SST" and len(head) >= _HEADER.size and 1 <= head[3] <= 9


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the only group of an SST file, with the channels `fork` and `shock` in counts.

    Travel in metres needs the geometry of the sensors, which the file does not state. Times before 2001 are those of
    loggers without a clock: the start is then unknown. An incomplete last row is left out.

    Raises
    ------
    FormatError
        If the file does not begin as such a file, or states no sampling rate.
    """
    with reported(path, NAME), path.open("rb") as file:
        head = file.read(_HEADER.size)
        n_rows = (path.stat().st_size - _HEADER.size) // _BYTES_PER_ROW
    _, _, rate, _, seconds = _HEADER.unpack(head)
    if rate == 0 or n_rows == 0:
        raise FormatError(f"{path} cannot be read as SST: it states {rate} Hz and holds {n_rows} samples")
    columns = tuple(Column(name, name, unit="counts") for name in _NAMES)

    def rows(indices: Sequence[int], first: int = 0, last: int | None = None) -> Iterator[Block]:
        return _blocks(path, list(indices), row_pieces(n_rows, first, last))

    start = seconds * 10**9 if _PLAUSIBLE[0] <= seconds <= _PLAUSIBLE[1] else None
    return (
        column_group(
            path, path.name, columns, rows, clock=path.name, n_rows=n_rows, sampling_rate=float(rate), start=start
        ),
    )


def _blocks(path: Path, chosen: list[int], pieces: Iterator[slice]) -> Iterator[Block]:
    """Yield the samples of some channels, counted from 1."""
    with reported(path, NAME), path.open("rb") as file:
        for piece in pieces:
            file.seek(_HEADER.size + piece.start * _BYTES_PER_ROW)
            raw = file.read((piece.stop - piece.start) * _BYTES_PER_ROW)
            counts = np.frombuffer(raw, dtype="<u2").reshape(-1, len(_NAMES))
            yield Block(piece.start + 1, None, counts.T[chosen].astype(np.float64))
