"""Tables in text: any usual delimiter, decimal point or comma, with or without names, plain or packed."""

import codecs
import csv
import gzip
import io
import re
import zipfile
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import IO, Any, cast

import numpy as np

from sprung.errors import FormatError
from sprung.formats.columns import names_time, stated_unit
from sprung.formats.dialects import (
    BLANK,
    COMMENT_MARKS,
    DAY_FIRST,
    MONTH_FIRST,
    YEAR_FIRST,
    Layout,
    fields,
    is_comment,
    kind_of,
    layout_of,
    moments,
    parsed,
    possible_orders,
    single_blanks,
    stated_line,
)
from sprung.formats.settings import ReadSettings
from sprung.formats.table import (
    MISSING,
    Block,
    Column,
    Group,
    Table,
    chosen_columns,
    is_number,
    is_time,
    refuse_repeated,
    reported,
    single_group,
    split_heading,
    time_column,
    within,
    written_headings,
    written_stamps,
    written_values,
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
    layout = layout_of(path, _first_lines(path))
    named = [heading for heading in layout.headings if heading]
    refuse_repeated(named, path=path)
    return single_group(path, named, lambda channels: _table(path, layout, channels, settings))


def _table(path: Path, layout: Layout, channels: Sequence[str] | None, settings: ReadSettings) -> Table:
    """Return the table of the columns of some channels."""
    time, notes = _time_of(path, layout, settings, partial(_column_of_texts, path, layout))
    texts = [heading for heading, kind in _named_columns(layout) if kind != "number" and not is_time(heading)]
    others = [heading for heading in texts if layout.headings.index(heading) not in (time.indices if time else ())]
    wanted = [heading for heading, kind in _named_columns(layout) if kind == "number" or channels is not None]
    columns = chosen_columns(wanted, channels, path=path)
    indices = [layout.headings.index(column.heading) for column in columns]
    if others and channels is None:
        notes.append(f"left out, as they hold no numbers: {', '.join(repr(heading) for heading in others)}")
    end = _end(path, layout)
    if end is not None:
        notes.append("last line left out: it was cut off")

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        return within(_blocks(path, layout, indices, time, end), first, last)

    return Table(
        path,
        tuple(_described(column, layout) for column in columns),
        None if time is None else layout.headings[time.indices[-1]],
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


def _named_columns(layout: Layout) -> list[tuple[str, str]]:
    """Return heading and kind of the columns that have a name."""
    return [item for item in zip(layout.headings, layout.kinds, strict=True) if item[0]]


def _time_of(
    path: Path, layout: Layout, settings: ReadSettings, texts: Callable[[int], Iterable[Any]]
) -> tuple[_TextTime | None, list[str]]:
    """Return the time column that names, or texts of dates, show, with notes for the history; None without one.

    `texts` yields a column, by its index, as arrays of texts.
    """
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
    notes = (
        []
        if is_time(heading) and len(indices) == 1
        else [f"time: {names}, by {'its' if len(indices) == 1 else 'their'} dates and times"]
    )
    if len(indices) == 1 and _ISO.fullmatch(layout.first_row[index]):
        return _TextTime(indices, ""), notes
    order = _order(texts(indices[0])) if kind != "time of day" or len(indices) == 2 else YEAR_FIRST
    if order is None and settings.sampling_rate is None:
        raise FormatError(
            f"{path}: column {layout.headings[indices[0]]!r} holds dates such as {layout.first_row[indices[0]]!r}, of "
            "which day and month cannot be distinguished: write them as 2024-12-31, or state the sampling rate with "
            "--sampling-rate"
        )
    if order is None:
        return None, [f"dates in {names} left out: day and month cannot be distinguished"]
    if order != YEAR_FIRST:
        notes.append(f"dates in {layout.headings[indices[0]]!r} read as {order}")
    return _TextTime(indices, order), notes


def _time_heading(path: Path, layout: Layout, settings: ReadSettings) -> str | None:
    """Return the heading of the time column: stated, by its name, or because it holds dates and times."""
    columns = _named_columns(layout)
    named = [heading for heading, _ in columns]
    stated = [name for name in named if settings.time in (name, split_heading(name)[0])]
    if stated:
        return stated[0] if is_time(stated[0]) or layout.kinds[layout.headings.index(stated[0])] != "number" else None
    by_name = time_column(named, path=path, stated=settings.time)
    if by_name is not None or settings.time is not None:
        return by_name
    if any(kind == "number" and names_time(heading) and stated_unit(heading) for heading, kind in columns):
        return None
    texts = {kind: heading for heading, kind in reversed(columns)}
    return texts.get("moment") or texts.get("time of day") or texts.get("date")


def _order(texts: Iterable[Any]) -> str | None:
    """Return the order of day, month and year in a column; None if it does not show."""
    orders = {YEAR_FIRST, DAY_FIRST, MONTH_FIRST}
    for part in texts:
        orders &= possible_orders(part)
        if len(orders) <= 1:
            break
    return next(iter(orders)) if len(orders) == 1 else None


def _described(column: Column, layout: Layout) -> Column:
    """Return a column with the comment and the calibration that the lines above the header state."""
    stated = {kind: text for name, kind, text in layout.stated if name == column.name}
    return replace(column, comment=stated.get("comment", ""), calibration=stated.get("calibration", ""))


def _column_of_texts(path: Path, layout: Layout, index: int) -> Iterator[Any]:
    """Yield one column as texts."""
    import pyarrow as pa

    for _, table in _tables(path, layout, {index: pa.string()}, _end(path, layout)):
        yield table.column(str(index))


@contextmanager
def _open(path: Path) -> Iterator[IO[bytes]]:
    """Open a file, or the only member of an archive, for reading; UTF-16 is read as UTF-8."""
    with _unpacked(path) as file:
        head = file.read(2)
        file.seek(0)
        yield cast(IO[bytes], codecs.EncodedFile(file, "utf-8", "utf-16")) if head in _UTF_16 else file


@contextmanager
def _unpacked(path: Path) -> Iterator[IO[bytes]]:
    """Open a file, or the only member of an archive, for reading."""
    if path.suffix.lower() == ".zip":
        with zipfile.ZipFile(path) as archive:
            members = [member for member in archive.infolist() if not member.is_dir()]
            if len(members) != 1:
                raise FormatError(f"{path} holds {len(members)} files: pack one table into a zip file")
            with archive.open(members[0]) as file:
                yield file
    elif path.suffix.lower() == ".gz":
        with gzip.open(path) as file:
            yield cast(IO[bytes], file)
    else:
        with path.open("rb") as file:
            yield file


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
        types[index] = _time_type(path, layout, index) if time and not time.order else pa.string()
    for line, table in _tables(path, layout, types, end):
        values = np.empty((len(indices), table.num_rows))
        for row, index in enumerate(indices):
            values[row] = table.column(str(index)).to_numpy()
        yield Block(line, None if time is None else _stamps(table, time), values)


def _tables(path: Path, layout: Layout, types: dict[int, Any], end: int | None) -> Iterator[tuple[int, Any]]:
    """Yield some columns piece by piece, each with the number of its first line."""
    import pyarrow as pa

    names = [str(index) for index in range(len(layout.headings))]
    wanted = {str(index): kind for index, kind in types.items()}
    with reported(path, "text"), _open(path) as file:
        for line, text in _texts(path, _pieces(file, layout.offset, end), layout.first_line):
            plain = single_blanks(text) if layout.delimiter == BLANK else text
            try:
                table = parsed(plain, names, wanted, delimiter=layout.delimiter, decimal=layout.decimal)
            except pa.ArrowInvalid as error:
                raise _located_error(path, layout, types, line, text) or _unlocated_error(path, line, error) from None
            yield line, table


def _stamps(table: Any, time: _TextTime) -> Any:
    """Return the time stamps of some rows."""
    import pyarrow.compute as pc

    columns = [table.column(str(index)).combine_chunks() for index in time.indices]
    if not time.order:
        return columns[0].to_numpy(zero_copy_only=False)
    return moments(columns[0] if len(columns) == 1 else pc.binary_join_element_wise(*columns, " "), time.order)


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
    if not any(mark in text for mark in COMMENT_MARKS) or not _COMMENTED.search(text):
        if text and not text.isspace():
            yield line, text
        return
    kept: list[bytes] = []
    for number, row in enumerate(text.splitlines(keepends=True), line):
        if not is_comment(row):
            kept.append(row)
        elif kept:
            yield from _without_comments(number - len(kept), b"".join(kept))
            kept = []
    yield from _without_comments(line + text.count(b"\n") - len(kept) + (not text.endswith(b"\n")), b"".join(kept))


def _time_type(path: Path, layout: Layout, index: int) -> Any:
    """Return the type of the time column: numbers, or ISO date-times with or without a zone."""
    import pyarrow as pa

    text = layout.first_row[index] if index < len(layout.first_row) else ""
    match = _ISO.fullmatch(text)
    return pa.timestamp("ns", "UTC" if match["zone"] else None) if match else pa.float64()


def _located_error(path: Path, layout: Layout, types: dict[int, Any], first: int, text: bytes) -> FormatError | None:
    """Return the error that names the first line in `text` that cannot be read; None if all lines look right."""
    import pyarrow as pa

    for line, raw in enumerate(text.split(b"\n"), first):
        row = fields(raw, layout.delimiter, strip=False)
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
                is_right = kind_of(field) is not None or field in MISSING
            if not is_right:
                return FormatError(
                    f"{path}, line {line}, column {layout.headings[index]!r}: {field[:40]!r} is not a "
                    f"{'number' if pa.types.is_floating(kind) else 'date-time'}: correct it, or leave it empty where "
                    "nothing was measured"
                )
    return None


def _unlocated_error(path: Path, line: int, error: Exception) -> FormatError:
    """Return the error for lines that look right but cannot be parsed."""
    detail = " ".join(str(error).split())[:120]
    return FormatError(f"{path}, after line {line}: the text is not a table ({detail}): export it again as CSV")


def write(recording: Recording, path: Path) -> None:
    """Write a recording as comma-separated text: a time column, and every channel with its unit."""
    import pyarrow as pa
    from pyarrow import csv as arrow

    headings = written_headings(recording)
    name, stamps = written_stamps(recording)
    kind = pa.timestamp("ns", "UTC") if stamps.dtype.kind == "M" else pa.float64()
    arrays = [pa.array(stamps.astype("i8") if stamps.dtype.kind == "M" else stamps).cast(kind)]
    arrays += [pa.array(row, from_pandas=True) for row in written_values(recording)]
    table = pa.Table.from_arrays(arrays, names=[str(index) for index in range(len(arrays))])
    with path.open("wb") as file:
        text = io.StringIO()
        if recording.comment:
            text.write(stated_line("comment", recording.comment))
        for channel in recording.channels:
            for kind in ("comment", "calibration"):
                if stated := getattr(channel, kind):
                    text.write(stated_line(kind, stated, channel.name))
        csv.writer(text, lineterminator="\n").writerow([name, *headings])
        file.write(text.getvalue().encode())
        arrow.write_csv(table, file, arrow.WriteOptions(include_header=False))
