"""Tables in text: comma, semicolon or tab, decimal point or comma, plain or packed with gzip or zip."""

import csv
import gzip
import io
import re
import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import IO, Any, cast

import numpy as np

from sprung.errors import FormatError
from sprung.formats.settings import ReadSettings
from sprung.formats.table import (
    MISSING,
    Block,
    Group,
    Table,
    chosen_columns,
    is_number,
    is_unit,
    refuse_repeated,
    reported,
    single_group,
    time_column,
    within,
    written_headings,
    written_stamps,
    written_values,
)
from sprung.recording import Recording

NAME, EXTRA = "text", None
ENDINGS = (".csv", ".tsv", ".txt", ".csv.gz", ".tsv.gz", ".txt.gz", ".csv.zip", ".tsv.zip", ".txt.zip")

_HEAD_BYTES = 1 << 18
_HEAD_LINES = 100
_PIECE_BYTES = 1 << 23
_DATE = re.compile(r"\d{4}-\d\d-\d\d([ T]\d\d:\d\d(:\d\d(\.\d*)?)?)?\s*(?P<zone>Z|[+-]\d\d(:?\d\d)?)?")
_DECIMAL_COMMA = re.compile(r"\s*[+-]?\d*,\d+([eE][+-]?\d+)?\s*")


@dataclass(frozen=True, slots=True)
class Layout:
    """Layout of the table in a text file."""

    delimiter: str
    decimal: str
    headings: tuple[str, ...]
    first_line: int
    offset: int
    first_row: tuple[str, ...]


def recognises(head: bytes) -> bool:
    """Return whether the first bytes of a file are text, or packed with gzip or zip."""
    return b"\0" not in head or head.startswith((b"\x1f\x8b", b"PK\x03\x04"))


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the only table of a text file.

    The header is the last line without a number before the first line of numbers; the lines above it are a preamble. A
    line below the header that holds only units is read as the units.
    """
    layout = _layout(path)
    named = [heading for heading in layout.headings if heading]
    refuse_repeated(named, path=path)
    return single_group(path, named, lambda channels: _table(path, layout, named, channels))


def _table(path: Path, layout: Layout, named: list[str], channels: Sequence[str] | None) -> Table:
    """Return the table of the columns of some channels."""
    columns = chosen_columns(named, channels, path=path)
    time = time_column(named, path=path)
    indices = [layout.headings.index(column.heading) for column in columns]
    time_index = None if time is None else layout.headings.index(time)

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        return within(_blocks(path, layout, indices, time_index), first, last)

    return Table(path, columns, time, blocks, row_word="line")


@contextmanager
def _open(path: Path) -> Iterator[IO[bytes]]:
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


def _layout(path: Path) -> Layout:
    """Return the layout that the first lines of a file show."""
    lines = _first_lines(path)
    delimiter = _delimiter(lines)
    rows = [_fields(line, delimiter) for line in lines]
    has_decimal_comma = delimiter != "," and any(_DECIMAL_COMMA.fullmatch(field) for row in rows for field in row)
    decimal = "," if has_decimal_comma else "."
    data = next((i for i, row in enumerate(rows) if _is_data(row, decimal)), None)
    if data is None:
        raise FormatError(f"{path} holds no samples: its first {len(lines)} lines have no line of numbers")
    header = _header(rows[:data], decimal)
    if header is None:
        raise FormatError(
            f"{path}, line {data + 1}: the table begins without column names: put a line with the name of every "
            "column above the numbers"
        )
    headings = _headings(rows, header)
    first = next(i for i in range(header + 1, len(rows)) if lines[i].strip())
    offset = sum(len(line) for line in lines[:first])
    return Layout(delimiter, decimal, headings, first + 1, offset, tuple(rows[data]))


def _first_lines(path: Path) -> list[bytes]:
    """Return the complete first lines of a file, with their ends."""
    with reported(path, "text"), _open(path) as file:
        head = file.read(_HEAD_BYTES)
    if not head:
        raise FormatError(f"{path} is empty")
    if b"\0" in head:
        raise FormatError(f"{path} holds binary data, not text in UTF-8 or Latin-1: export it as CSV in UTF-8")
    lines = head.split(b"\n", _HEAD_LINES)
    complete = [line + b"\n" for line in lines[:-1]]
    if len(head) < _HEAD_BYTES and len(lines) <= _HEAD_LINES and lines[-1]:
        complete.append(lines[-1])
    if not complete:
        raise FormatError(f"{path}, line 1 is longer than {_HEAD_BYTES} bytes: this is not a table")
    return complete


def _decode(line: bytes) -> str:
    """Return a line of text; bytes that are not UTF-8 are Latin-1."""
    try:
        return line.decode("utf-8-sig").rstrip("\r\n")
    except UnicodeDecodeError:
        return line.decode("latin-1").rstrip("\r\n")


def _delimiter(lines: list[bytes]) -> str:
    """Return the delimiter of the last of the lines, which is not part of a preamble."""
    last = next((line for line in reversed(lines) if line.strip()), b"")
    return next((character for character in ";\t" if character.encode() in last), ",")


def _fields(line: bytes, delimiter: str, *, strip: bool = True) -> list[str]:
    """Return the fields of a line; `strip` removes the blanks around them."""
    text = _decode(line)
    try:
        fields = next(csv.reader([text], delimiter=delimiter), [])
    except csv.Error:
        return [text]
    return [field.strip() for field in fields] if strip else fields


def _is_value(field: str, decimal: str) -> bool:
    """Return whether a field is a number or a date-time."""
    return is_number(field.replace(decimal, ".")) or _DATE.fullmatch(field) is not None


def _is_data(row: list[str], decimal: str) -> bool:
    """Return whether more than half of the fields of a row are numbers or missing values."""
    n_values = sum(_is_value(field, decimal) and field not in MISSING for field in row)
    n_missing = sum(field in MISSING for field in row)
    return n_values > 0 and n_values + n_missing > len(row) / 2


def _header(rows: list[list[str]], decimal: str) -> int | None:
    """Return the index of the last row with text and without numbers."""
    for index in reversed(range(len(rows))):
        if any(rows[index]) and not any(_is_value(field, decimal) for field in rows[index]):
            return index
    return None


def _headings(rows: list[list[str]], header: int) -> tuple[str, ...]:
    """Return the headings; where the header holds nothing but units, the names are in the row above it."""
    above = rows[header - 1] if header else []
    if len(above) != len(rows[header]) or not all(is_unit(field) for field in rows[header]):
        return tuple(rows[header])
    units = [field.strip("[]()") for field in rows[header]]
    return tuple(f"{name} [{unit}]" if unit else name for name, unit in zip(above, units, strict=True))


def _blocks(path: Path, layout: Layout, indices: list[int], time_index: int | None) -> Iterator[Block]:
    """Yield the rows of some columns, numbered by their lines."""
    import pyarrow as pa

    types = {index: pa.float64() for index in indices}
    if time_index is not None:
        types[time_index] = _time_type(path, layout, time_index)
    with reported(path, "text"), _open(path) as file:
        file.read(layout.offset)
        for line, text in _texts(path, file, layout.first_line):
            try:
                table = _parse(text, layout, types)
            except pa.ArrowInvalid as error:
                raise _located_error(path, layout, types, line, text) or _unlocated_error(path, line, error) from None
            values = np.empty((len(indices), table.num_rows))
            for row, index in enumerate(indices):
                values[row] = table.column(str(index)).to_numpy()
            yield Block(line, None if time_index is None else table.column(str(time_index)).to_numpy(), values)


def _texts(path: Path, file: IO[bytes], line: int) -> Iterator[tuple[int, bytes]]:
    """Yield pieces of whole lines, each with the number of its first one.

    The pieces are parsed separately, not as a stream, so that an abandoned reader leaves no running threads.
    """
    rest = b""
    while piece := file.read(_PIECE_BYTES):
        text = rest + piece
        end = text.rfind(b"\n") + 1
        if end == 0:
            raise FormatError(
                f"{path}, line {line} is longer than {_PIECE_BYTES} bytes: the text is not a table from there on"
            )
        lines, rest = text[:end], text[end:]
        if not lines.isspace():
            yield line, lines
        line += lines.count(b"\n")
    if rest and not rest.isspace():
        yield line, rest


def _parse(text: bytes, layout: Layout, types: dict[int, Any]) -> Any:
    """Return some columns of lines of text, named by their numbers."""
    import pyarrow as pa
    from pyarrow import csv as arrow

    return arrow.read_csv(
        pa.BufferReader(text),
        read_options=arrow.ReadOptions(column_names=[str(index) for index in range(len(layout.headings))]),
        parse_options=arrow.ParseOptions(delimiter=layout.delimiter),
        convert_options=arrow.ConvertOptions(
            column_types={str(index): kind for index, kind in types.items()},
            include_columns=[str(index) for index in types],
            null_values=list(MISSING),
            decimal_point=layout.decimal,
            check_utf8=False,
        ),
    )


def _time_type(path: Path, layout: Layout, index: int) -> Any:
    """Return the type of the time column: numbers, or date-times with or without a zone."""
    import pyarrow as pa

    text = layout.first_row[index] if index < len(layout.first_row) else ""
    match = _DATE.fullmatch(text)
    if match:
        return pa.timestamp("ns", "UTC" if match["zone"] else None)
    if text in MISSING or is_number(text.replace(layout.decimal, ".")):
        return pa.float64()
    raise FormatError(
        f"{path}: time column {layout.headings[index]!r} holds {text[:40]!r}: write seconds, or date-times as "
        "2024-05-31 12:00:00.250"
    )


def _located_error(path: Path, layout: Layout, types: dict[int, Any], first: int, text: bytes) -> FormatError | None:
    """Return the error that names the first line in `text` that cannot be read; None if all lines look right."""
    import pyarrow as pa

    for line, raw in enumerate(text.split(b"\n"), first):
        fields = _fields(raw, layout.delimiter, strip=False)
        if not any(fields):
            continue
        if len(fields) != len(layout.headings):
            return FormatError(
                f"{path}, line {line} has {len(fields)} fields, but the header has {len(layout.headings)}: correct or "
                "remove the line"
            )
        for index, kind in types.items():
            field = fields[index]
            is_right = is_number(field.replace(layout.decimal, ".")) or field in MISSING
            if pa.types.is_timestamp(kind):
                is_right = _DATE.fullmatch(field) is not None
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
        csv.writer(text, lineterminator="\n").writerow([name, *headings])
        file.write(text.getvalue().encode())
        arrow.write_csv(table, file, arrow.WriteOptions(include_header=False))
