"""Raw CAN frames of a file, decoded with databases: a group of channels for each message.

Frames come in pieces. A first pass counts the frames of each message; the rows of a message are then read from the
piece in which they begin.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from os import PathLike
from pathlib import Path
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray

from sprung._arrays import Booleans, Real
from sprung._checks import required
from sprung.errors import FormatError
from sprung.formats.stated import column_group, described, distinct, linear, plain
from sprung.formats.table import Block, Group, stated_column, within

_EXTENDED = 1 << 31
#: Bits of a 29-bit identifier of J1939 that name the group of parameters; below PDU format 240 the second byte is an
#: address.
_PGN, _PGN_OF_PAIRS, _FIRST_BROADCAST = 0x3FFFF00, 0x3FF0000, 240
#: From this top byte on, values of J1939 mean "error" or "not available" (SAE J1939-71).
_NO_VALUE = 0xFE


@dataclass(frozen=True, eq=False, slots=True)
class Frames:
    """Consecutive frames: stamps [s], numbers of the bus, identifiers (bit 31: extended), payload and its lengths.

    The payload has shape (frames, bytes); bytes beyond the length of a frame have no meaning.
    """

    stamps: Real
    buses: NDArray[np.uint8]
    ids: NDArray[np.uint32]
    payload: NDArray[np.uint8]
    lengths: NDArray[Any]


class Source(Protocol):
    """Function that yields the frames of a file in pieces."""

    def __call__(self, first: int = 0) -> Iterator[Frames]:
        """Yield the frames from `first` on, counted from 0."""


def can_database(path: str | PathLike[str], *, extra: str = "can") -> Any:
    """Return the database of cantools in a file: DBC, KCD, SYM or ARXML.

    Parameters
    ----------
    path
        Path of the file.
    extra
        Extra that installs cantools for the caller's purpose.

    Raises
    ------
    FormatError
        If the file cannot be read, or describes no messages.
    MissingPackageError
        If cantools is not installed.

    Examples
    --------
    >>> from pathlib import Path
    >>> from tempfile import TemporaryDirectory
    >>> text = 'BU_: BOX  BO_ 256 ACC: 2 BOX  SG_ acc_fl : 0|16@1- (0.01,0) [0|0] "m/s^2" BOX'
    >>> with TemporaryDirectory() as folder:
    ...     path = Path(folder, "car.dbc")
    ...     _ = path.write_text(text, encoding="utf-8")
    ...     database = can_database(path)
    >>> [(message.name, [signal.name for signal in message.signals]) for message in database.messages]
    [('ACC', ['acc_fl'])]
    """
    cantools = required("cantools", purpose="a CAN database", extra=extra)
    path = Path(path)
    if not path.is_file():
        raise FormatError(f"{path}: no such file")
    try:
        database = cantools.database.load_file(path)
    except (cantools.Error, OSError, ValueError) as error:
        detail = " ".join(str(error).split())[:200] or type(error).__name__
        raise FormatError(f"{path} cannot be read as a CAN database ({detail}): give a DBC file") from None
    if not getattr(database, "messages", None):
        raise FormatError(f"{path} describes no CAN messages: give the database of the bus")
    return database


def message_groups(
    path: Path, sources: Sequence[Source], databases: Sequence[Path], *, start: int | None, comment: str
) -> list[Group]:
    """Return a group of channels for each message in the raw CAN frames of a file.

    Parameters
    ----------
    path
        Path of the file.
    sources
        Functions that yield the frames of its groups of raw frames.
    databases
        Paths of CAN databases; the first one that has a message describes it.
    start
        Time of the origin of stamps, UTC in nanoseconds since 1970; None where unknown.
    comment
        Comment on the measurement.

    Returns
    -------
    list of Group
        One for each message, bus and identifier; for each value of a multiplexer, a group of its own.

    Raises
    ------
    FormatError
        If there is no database, or none has any of the messages.
    MissingPackageError
        If cantools is not installed.

    Notes
    -----
    Messages of SAE J1939 are found by their parameter group number, whatever their priority and source. Their values
    "error" and "not available" (top byte 0xFE and 0xFF) are missing, and so are values of signals beyond the end of a
    short frame. Values with names (choices) stay numbers.
    """
    if not databases:
        raise FormatError(
            f"{path} holds raw CAN frames: give the database that decodes them with --dbc FILE (in Python: "
            "ReadSettings(databases=[...]))"
        )
    known = _Known([can_database(database, extra="mdf") for database in databases])
    ids: set[int] = set()
    parts = [part for source in sources for part in _counted(source, known, ids) if part.pieces]
    if not parts:
        seen = ", ".join(f"0x{identifier & ~_EXTENDED:X}" for identifier in sorted(ids)[:5])
        raise FormatError(
            f"{path} holds raw CAN frames that no database describes (identifiers {seen}{', ...' * (len(ids) > 5)}): "
            "give the database of this bus with --dbc FILE"
        )
    names = distinct([part.label for part in parts], [f"CAN {part.bus}, {part.number}" for part in parts])
    return [_group(path, name, part, start=start, comment=comment) for name, part in zip(names, parts, strict=True)]


@dataclass(frozen=True, eq=False, slots=True)
class _Part:
    """Signals of a message that come together: in all of its frames, or where multiplexers have some values.

    `pieces` are those of the file in which it has frames: the first frame of the piece, and the number of its own.
    """

    message: Any
    bus: int
    identifier: int
    source: Source
    signals: tuple[Any, ...]
    conditions: tuple[tuple[str, tuple[int, ...]], ...] = ()
    pieces: list[tuple[int, int]] = field(default_factory=list)

    @property
    def label(self) -> str:
        """Name of the message, with the values of its multiplexers."""
        values = "".join(f" {name}={'/'.join(map(str, ids))}" for name, ids in self.conditions)
        return plain(self.message.name) + values

    @property
    def number(self) -> str:
        """Identifier, as people write it."""
        return f"0x{self.identifier & ~_EXTENDED:X}"

    def rows(self, frames: Frames) -> NDArray[np.intp]:
        """Return the indices of its frames."""
        rows = np.flatnonzero((frames.ids == self.identifier) & (frames.buses == self.bus))
        for name, ids in self.conditions:
            selector = self.message.get_signal_by_name(name)
            rows = rows[np.isin(_raw(selector, frames.payload[rows]).astype(np.int64), ids)]
        return rows


class _Known:
    """Messages of databases, by identifier."""

    def __init__(self, databases: Sequence[Any]) -> None:
        messages = [message for database in databases for message in database.messages][::-1]
        self._plain = {
            message.frame_id | (_EXTENDED if message.is_extended_frame else 0): message for message in messages
        }
        self._groups = {
            _parameter_group(message.frame_id): message for message in messages if message.protocol == "j1939"
        }

    def message(self, identifier: int) -> Any:
        """Return the message of an identifier; None if no database has it."""
        if identifier in self._plain:
            return self._plain[identifier]
        return self._groups.get(_parameter_group(identifier)) if identifier & _EXTENDED else None


def _parameter_group(identifier: int) -> int:
    """Return the bits of an identifier that name the parameter group."""
    return identifier & (_PGN if identifier >> 16 & 0xFF >= _FIRST_BROADCAST else _PGN_OF_PAIRS)


def _counted(source: Source, known: _Known, ids: set[int]) -> list[_Part]:
    """Return the parts in the frames of a source; add the identifiers to `ids`."""
    parts: dict[tuple[int, int], list[_Part]] = {}
    first = 0
    for frames in source():
        for bus, identifier in np.unique(np.stack([frames.buses.astype(np.uint32), frames.ids]), axis=1).T.tolist():
            ids.add(identifier)
            if (bus, identifier) not in parts:
                parts[bus, identifier] = _parts(known.message(identifier), bus, identifier, source)
            for part in parts[bus, identifier]:
                if count := part.rows(frames).size:
                    part.pieces.append((first, count))
        first += frames.stamps.size
    return [part for own in parts.values() for part in own]


def _parts(message: Any, bus: int, identifier: int, source: Source) -> list[_Part]:
    """Return the parts of a message; none for None."""
    if message is None:
        return []
    signals: dict[tuple[tuple[str, tuple[int, ...]], ...], list[Any]] = {}
    for signal in message.signals:
        if signal.length <= 64:
            signals.setdefault(_conditions(message, signal), []).append(signal)
    return [_Part(message, bus, identifier, source, tuple(own), conditions) for conditions, own in signals.items()]


def _conditions(message: Any, signal: Any) -> tuple[tuple[str, tuple[int, ...]], ...]:
    """Return the multiplexers that select a signal with their values, the outermost first."""
    if not signal.multiplexer_ids or signal.multiplexer_signal is None:
        return ()
    outer = _conditions(message, message.get_signal_by_name(signal.multiplexer_signal))
    return (*outer, (signal.multiplexer_signal, tuple(sorted(signal.multiplexer_ids))))


def _group(path: Path, name: str, part: _Part, *, start: int | None, comment: str) -> Group:
    """Return the group of a part of a message."""
    columns = tuple(
        stated_column(
            label,
            label,
            plain(signal.unit),
            comment=plain(signal.comment),
            calibration=linear(signal.scale, signal.offset),
        )
        for label, signal in zip(distinct([signal.name for signal in part.signals]), part.signals, strict=True)
    )
    about = described(comment, part.message.comment)

    def rows(indices: Sequence[int], first: int = 0, last: int | None = None) -> Iterator[Block]:
        return _blocks(part, [part.signals[k] for k in indices], first, last)

    return column_group(
        path,
        name,
        columns,
        rows,
        clock=(path, name),
        n_rows=sum(count for _, count in part.pieces),
        time_heading="time [s]",
        row_word=f"frame of {plain(part.message.name)}",
        start=start,
        comment=about,
    )


def _blocks(part: _Part, signals: Sequence[Any], first: int = 0, last: int | None = None) -> Iterator[Block]:
    """Yield some rows of a part of a message, from the piece on in which they begin."""
    before = 0
    for frame, count in part.pieces:
        if before + count > first:
            pieces = _decoded(part, signals, frame, before)
            yield from within(pieces, first - before, None if last is None else last - before)
            return
        before += count


def _decoded(part: _Part, signals: Sequence[Any], frame: int, row: int) -> Iterator[Block]:
    """Yield the rows of a part from some frame on, of which the first has the number `row`."""
    for frames in part.source(frame):
        rows = part.rows(frames)
        if not rows.size:
            continue
        values = np.empty((len(signals), rows.size))
        for place, signal in zip(values, signals, strict=True):
            place[:] = _physical(part.message, signal, frames.payload[rows], frames.lengths[rows])
        yield Block(row + 1, frames.stamps[rows], values)
        row += rows.size


def _physical(message: Any, signal: Any, payload: NDArray[np.uint8], lengths: NDArray[Any]) -> Real:
    """Return the physical values of a signal; NaN where a frame is too short or states that there is no value."""
    raw = _raw(signal, payload)
    missing: Booleans = lengths < _bytes_of(signal)[1]
    if message.protocol == "j1939" and signal.length >= 8 and not signal.is_float and not signal.is_signed:
        missing |= raw >= _NO_VALUE << (signal.length - 8)
    with np.errstate(invalid="ignore"):  # bits of a floating-point signal may be no number
        values: Real = raw.astype(np.float64) * signal.scale + signal.offset
    values[missing] = np.nan
    return values


def _bytes_of(signal: Any) -> tuple[int, int, int]:
    """Return the first byte of a signal, the byte after its last one, and its first bit within the first byte.

    Bits count from the lowest one of the byte for the byte order of Intel, from the highest one for that of Motorola,
    where a database states the place of the highest bit of the signal.
    """
    bit = signal.start % 8 if signal.byte_order == "little_endian" else 7 - signal.start % 8
    first = signal.start // 8
    return first, first + (bit + signal.length + 7) // 8, bit


def _raw(signal: Any, payload: NDArray[np.uint8]) -> NDArray[Any]:
    """Return the raw numbers of a signal in frames, shape (frames,)."""
    first, end, bit = _bytes_of(signal)
    own = np.zeros((len(payload), end - first), dtype=np.uint8)
    part = payload[:, first:end]
    own[:, : part.shape[1]] = part
    is_little = signal.byte_order == "little_endian"
    bits = np.unpackbits(own, axis=1, bitorder="little" if is_little else "big")[:, bit : bit + signal.length]
    words = np.zeros((len(payload), 64), dtype=np.uint8)
    words[:, : signal.length] = bits if is_little else bits[:, ::-1]
    raw = np.packbits(words, axis=1, bitorder="little").view("<u8")[:, 0]
    if signal.is_float:
        return raw.astype(f"<u{signal.length // 8}").view(f"<f{signal.length // 8}")
    if signal.is_signed:
        unused = np.uint64(64 - signal.length)
        return (raw << unused).view(np.int64) >> unused.astype(np.int64)
    return raw
