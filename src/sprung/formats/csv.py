"""Tables in text: any usual delimiter, decimal point or comma, with or without names, plain or packed."""

import codecs
import csv
import gzip
import io
import itertools
import re
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import IO, Any, cast

import numpy as np

from sprung._arrays import Real
from sprung.errors import FormatError
from sprung.formats import dialects
from sprung.formats.columns import names_time, stated_unit
from sprung.formats.dialects import Layout
from sprung.formats.settings import ReadSettings
from sprung.formats.table import (
    MISSING,
    Block,
    Group,
    Table,
    arrow_values,
    chosen_columns,
    is_number,
    is_time,
    refuse_repeated,
    reported,
    split_heading,
    time_column,
    within,
    written,
)
from sprung.recording import Recording

NAME = "text"
EXTRA = None
ENDINGS = (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz", ".txt.gz", ".csv.zip", ".tsv.zip", ".txt.zip")

_UTF_16 = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


@dataclass(frozen=True, slots=True)
class _Limits:
    """Parts of a file that are read at once."""

    head: int = 1 << 18  # first bytes, which show the layout
    head_lines: int = 5000  # lines within them
    first: int = 1 << 20  # bytes of the first piece: short, for those who want the first rows only
    piece: int = 1 << 23  # bytes of all others, and of the longest line
    tail: int = 1 << 16  # last bytes, in which a last line that was cut off is found
    packing: int = 1032  # largest size over that of packed text (deflate)


_LIMITS = _Limits()
#: Date-time that is read as it is.
_ISO = re.compile(r"\d{4}-\d\d-\d\d([ T]\d\d:\d\d(:\d\d(\.\d*)?)?)?\s*(?P<zone>Z|[+-]\d\d(:?\d\d)?)?")
_COMMENTED = re.compile(rb"(?m)^[ \t]*(#|%|//)")


def recognises(head: bytes) -> bool:
    """Return whether the first bytes of a file are text, or packed with gzip or zip."""
    return b"\0" not in head or head.startswith((b"\x1f\x8b", b"PK\x03\x04", *_UTF_16))


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the only table of a text file.

    The header is the last line without a number before the first line of numbers; the lines above it are a preamble. A
    line below the header that holds only units is read as the units. Without a header the columns are called column_1,
    column_2 ... A last line that was cut off is left out.
    """
    layout = dialects.layout_of(path, _first_lines(path))
    named = tuple(filter(None, layout.headings))
    refuse_repeated(named, path=path)
    return (Group(path.name, named, path.name, partial(_table, path, layout, settings)),)


def _table(path: Path, layout: Layout, settings: ReadSettings, channels: Sequence[str] | None) -> Table:
    """Return the table of the columns of some channels."""
    time, notes = _time_of(path, layout, settings)
    times = [layout.headings[index] for index in time.indices] if time else []
    kinds = layout.kinds_by_heading()
    others = [each for each, kind in kinds.items() if kind != "number" and not is_time(each) and each not in times]
    wanted = [heading for heading, kind in kinds.items() if kind == "number" or channels is not None]
    columns = chosen_columns(wanted, channels, time=times[-1] if times else None, path=path)
    places = {heading: index for index, heading in enumerate(layout.headings)}
    indices = [places[column.heading] for column in columns]
    if others and channels is None:
        notes.append(f"left out, as they hold no numbers: {', '.join(repr(heading) for heading in others)}")
    end = _end(path, layout)
    if end is not None:
        notes.append("last line left out: it was cut off")

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        return within(_blocks(path, layout, indices, time, end), first, last)

    return Table(
        path,
        tuple(column.with_facts(layout.stated.get(column.name, {})) for column in columns),
        times[-1] if times else None,
        blocks,
        row_word="line",
        comment=layout.comment,
        notes=tuple(notes),
    )


@dataclass(frozen=True, slots=True)
class _TextTime:
    """Time column of a text file.

    Parameters
    ----------
    indices
        Indices of its one or two columns, such as those of date and time of day.
    order
        Order of day, month and year; empty for numbers and ISO date-times, which are read as they are.
    """

    indices: tuple[int, ...]
    order: str


def _time_of(path: Path, layout: Layout, settings: ReadSettings) -> tuple[_TextTime | None, list[str]]:
    """Return the time column that names, or texts of dates, show, with notes for the history; None without one."""
    heading = _time_heading(path, layout, settings)
    if heading is None:
        return None, []
    index = layout.headings.index(heading)
    kind = layout.kinds[index]
    if kind == "number":
        return _TextTime((index,), ""), []
    if kind == "text":
        raise FormatError(
            f"{path}: time column {heading!r} holds {layout.first_row[index][:40]!r}: write seconds, or date-times as "
            "2024-05-31 12:00:00.250"
        )
    indices: tuple[int, ...] = (index,)
    if kind == "time of day" and "date" in layout.kinds:
        indices = (layout.kinds.index("date"), index)
    elif kind == "date" and "time of day" in layout.kinds:
        indices = (index, layout.kinds.index("time of day"))
    names = " and ".join(repr(layout.headings[k]) for k in indices)
    notes = []
    if not is_time(heading) or len(indices) == 2:
        notes.append(f"time: {names}, by {'its' if len(indices) == 1 else 'their'} dates and times")
    if len(indices) == 1 and _ISO.fullmatch(layout.first_row[index]):
        return _TextTime(indices, ""), notes
    order = _order(path, layout, indices[0]) if kind != "time of day" or len(indices) == 2 else dialects.YEAR_FIRST
    if order is None and settings.sampling_rate is None:
        raise FormatError(
            f"{path}: column {layout.headings[indices[0]]!r} holds dates such as {layout.first_row[indices[0]]!r}, of "
            "which day and month cannot be distinguished: write them as 2024-12-31, or state the sampling rate with "
            "--sampling-rate"
        )
    if order is None:
        return None, [f"dates in {names} left out: day and month cannot be distinguished"]
    if order != dialects.YEAR_FIRST:
        notes.append(f"dates in {layout.headings[indices[0]]!r} read as {order}")
    return _TextTime(indices, order), notes


def _time_heading(path: Path, layout: Layout, settings: ReadSettings) -> str | None:
    """Return the heading of the time column: stated, by its name, or because it holds dates and times."""
    kinds = layout.kinds_by_heading()
    stated = [name for name in kinds if settings.time in (name, split_heading(name)[0])]
    if stated:
        return stated[0] if is_time(stated[0]) or kinds[stated[0]] != "number" else None
    by_name = time_column(kinds, stated=settings.time)
    if by_name is not None or settings.time is not None:
        return by_name
    if any(kind == "number" and names_time(name) and stated_unit(name) for name, kind in kinds.items()):
        return None
    texts = {kind: name for name, kind in reversed(kinds.items())}
    return texts.get("moment") or texts.get("time of day") or texts.get("date")


def _order(path: Path, layout: Layout, index: int) -> str | None:
    """Return the order of day, month and year in a column; None if it does not show."""
    import pyarrow as pa

    orders = {dialects.YEAR_FIRST, dialects.DAY_FIRST, dialects.MONTH_FIRST}
    for _, table in tables(path, layout, {index: pa.string()}, _end(path, layout)):
        orders &= dialects.possible_orders(table.column(str(index)))
        if len(orders) <= 1:
            break
    return next(iter(orders)) if len(orders) == 1 else None


@contextmanager
def _open(path: Path) -> Iterator[IO[bytes]]:
    """Open a file, or the only member of an archive, for reading; UTF-16 is read as UTF-8."""
    with ExitStack() as opened:
        if path.suffix.lower() == ".zip":
            archive = opened.enter_context(zipfile.ZipFile(path))
            members = [member for member in archive.infolist() if not member.is_dir()]
            if len(members) != 1:
                raise FormatError(f"{path} holds {len(members)} files: pack one table into a zip file")
            file: Any = opened.enter_context(archive.open(members[0]))
        else:
            file = opened.enter_context(path.open("rb"))
            if path.suffix.lower() == ".gz":
                file = opened.enter_context(gzip.GzipFile(fileobj=file))
        head = file.read(2)
        file.seek(0)
        yield cast(IO[bytes], codecs.EncodedFile(file, "utf-8", "utf-16")) if head in _UTF_16 else file


def unpacked_size(path: Path, most: int) -> int:
    """Return the size of a text [bytes], that of packed text once it is unpacked, up to more than the most."""
    size = path.stat().st_size
    if not path.name.lower().endswith((".gz", ".zip")) or size * _LIMITS.packing <= most:
        return size
    unpacked = 0
    with reported(path, "text"), _open(path) as file:
        while unpacked <= most and (piece := file.read(_LIMITS.head)):
            unpacked += len(piece)
    return max(size, unpacked)


def _first_lines(path: Path) -> list[bytes]:
    """Return the complete first lines of a file, with their ends."""
    with reported(path, "text"), _open(path) as file:
        head = file.read(_LIMITS.head)
    if not head:
        raise FormatError(f"{path} is empty")
    if b"\0" in head:
        raise FormatError(f"{path} holds binary data, not text in UTF-8 or Latin-1: export it as CSV in UTF-8")
    lines = head.split(b"\n", _LIMITS.head_lines)
    complete = [line + b"\n" for line in lines[:-1]]
    if len(head) < _LIMITS.head and len(lines) <= _LIMITS.head_lines and lines[-1]:
        complete.append(lines[-1])
    if not complete:
        raise FormatError(f"{path}, line 1 is longer than {_LIMITS.head} bytes: this is not a table")
    return complete


def _end(path: Path, layout: Layout) -> int | None:
    """Return the offset of a last line that was cut off; None if the last line is whole or the file is packed."""
    if path.suffix.lower() in {".gz", ".zip"}:
        return None
    size = path.stat().st_size
    with path.open("rb") as file:
        is_utf_16 = file.read(2) in _UTF_16
        file.seek(max(0, size - _LIMITS.tail))
        tail = file.read()
    last = tail[tail.rfind(b"\n") + 1 :]
    begin = size - len(last)
    if is_utf_16 or not last.strip() or begin <= layout.offset or not layout.is_unfinished(last):
        return None
    return begin


def _blocks(path: Path, layout: Layout, indices: list[int], time: _TextTime | None, end: int | None) -> Iterator[Block]:
    """Yield the rows of some columns, numbered by their lines."""
    import pyarrow as pa

    types = {index: pa.float64() for index in indices}
    for index in time.indices if time else ():
        match = _ISO.fullmatch(layout.first_row[index]) if index < len(layout.first_row) else None
        iso = pa.timestamp("ns", "UTC" if match["zone"] else None) if match else pa.float64()
        types[index] = pa.string() if time and time.order else iso
    for line, table in tables(path, layout, types, end):
        yield Block(line, None if time is None else _stamps(table, time), numbers(table, indices))


def numbers(table: Any, indices: Sequence[int]) -> Real:
    """Return some columns of a table of Arrow, which are called by their indices, as rows."""
    values = np.empty((len(indices), table.num_rows))
    for row, index in enumerate(indices):
        values[row] = arrow_values(table.column(str(index)))
    return values


def tables(path: Path, layout: Layout, types: dict[int, Any], end: int | None) -> Iterator[tuple[int, Any]]:
    """Yield some columns piece by piece, called by their indices, each with the number of its first line."""
    import pyarrow as pa

    with reported(path, "text"), _open(path) as file:
        for line, text in _texts(path, _pieces(file, layout.offset, end), layout.first_line):
            try:
                table = layout.parsed(text, types)
            except pa.ArrowInvalid as error:
                detail = " ".join(str(error).split())[:120]
                unlocated = f"{path}, after line {line}: the text is not a table ({detail}): export it again as CSV"
                raise _located_error(path, layout, types, line, text) or FormatError(unlocated) from None
            yield line, table


def _stamps(table: Any, time: _TextTime) -> Any:
    """Return the time stamps of some rows."""
    columns = [table.column(str(index)).combine_chunks() for index in time.indices]
    if not time.order:
        return arrow_values(columns[0])
    if len(columns) == 1:
        return dialects.moments(columns[0], time.order)
    import pyarrow.compute as pc

    return dialects.moments(pc.binary_join_element_wise(*columns, " "), time.order)


def _pieces(file: IO[bytes], offset: int, end: int | None) -> Iterator[bytes]:
    """Yield the bytes from `offset` to before `end`; recoded files give pieces of any length."""
    place, size = 0, _LIMITS.first
    while piece := file.read(size):
        size = _LIMITS.piece
        first = max(0, offset - place)
        last = len(piece) if end is None else max(0, end - place)
        place += len(piece)
        if first < last and first < len(piece):
            yield piece[first:last]


def _texts(path: Path, pieces: Iterator[bytes], line: int) -> Iterator[tuple[int, bytes]]:
    """Yield pieces of whole lines without comments, each with the number of its first one.

    The pieces are parsed separately, not as a stream, so that an abandoned reader leaves no running threads.
    """
    rest = b""
    for piece in pieces:
        text = rest + piece
        end = text.rfind(b"\n") + 1
        if end == 0 and len(piece) >= _LIMITS.piece:
            raise FormatError(
                f"{path}, line {line} is longer than {_LIMITS.piece} bytes: not tabular from line {line} on"
            )
        lines, rest = text[:end], text[end:]
        yield from _without_comments(line, lines)
        line += lines.count(b"\n")
    yield from _without_comments(line, rest)


def _without_comments(line: int, text: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield lines between comments, each piece with the number of its first line."""
    pieces = [(line, text)]
    if any(mark in text for mark in dialects.COMMENT_MARKS) and _COMMENTED.search(text):
        numbered = enumerate(text.splitlines(keepends=True), line)
        between = itertools.groupby(numbered, key=lambda row: dialects.is_comment(row[1]))
        groups = [list(rows) for is_note, rows in between if not is_note]
        pieces = [(rows[0][0], b"".join(row for _, row in rows)) for rows in groups]
    yield from (piece for piece in pieces if piece[1] and not piece[1].isspace())


def _located_error(path: Path, layout: Layout, types: dict[int, Any], first: int, text: bytes) -> FormatError | None:
    """Return the error that names the first line in `text` that cannot be read; None if all lines look right."""
    import pyarrow as pa

    for line, raw in enumerate(layout.regular(text).split(b"\n"), first):
        row = dialects.fields(raw, layout.delimiter, strip=False)
        if not any(row):
            continue
        if len(row) != len(layout.headings):
            return FormatError(
                f"{path}, line {line} has {len(row)} fields, but the header has {len(layout.headings)}: correct or "
                "remove the line"
            )
        for index, kind in types.items():
            field = row[index]
            is_right = is_number(field.replace(layout.decimal, ".")) or field in MISSING
            if pa.types.is_timestamp(kind):
                is_right = _ISO.fullmatch(field) is not None
            elif pa.types.is_string(kind):
                is_right = dialects.kind_of(field) is not None or field in MISSING
            if not is_right:
                return FormatError(
                    f"{path}, line {line}, column {layout.headings[index]!r}: {field[:40]!r} is not a "
                    f"{'number' if pa.types.is_floating(kind) else 'date-time'}: correct it, or leave it empty where "
                    "nothing was measured"
                )
    return None


def write(recording: Recording, path: Path) -> None:
    """Write a recording as comma-separated text: a time column, and every channel with its unit."""
    import pyarrow as pa
    from pyarrow import csv as arrow

    columns = written(recording, has_units=True)
    stamps = pa.array(columns.stamps)
    if pa.types.is_timestamp(stamps.type):
        stamps = stamps.cast(pa.timestamp("ns", "UTC"))
    arrays = [stamps, *(pa.array(row, from_pandas=True) for row in columns.values)]
    table = pa.Table.from_arrays(arrays, names=[str(index) for index in range(len(arrays))])
    with path.open("wb") as file:
        text = io.StringIO()
        if recording.comment:
            text.write(dialects.stated_line("comment", recording.comment))
        for channel in recording.channels:
            for kind in ("comment", "calibration"):
                if stated := getattr(channel, kind):
                    text.write(dialects.stated_line(kind, stated, channel.name))
        csv.writer(text, lineterminator="\n").writerow([columns.time, *columns.headings])
        file.write(text.getvalue().encode())
        arrow.write_csv(table, file, arrow.WriteOptions(include_header=False))
