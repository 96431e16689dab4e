"""Tables as CSV, Parquet and JSON files, written in pieces."""

import csv
import io
import json
from collections.abc import Iterable, Iterator, Mapping
from datetime import UTC, datetime
from typing import Any, Literal, TypeAlias

#: Kind of the values of a column: text, time [UTC ns], number, whole number.
Kind: TypeAlias = Literal["text", "time", "number", "integer"]
Columns: TypeAlias = dict[str, Kind]
Row: TypeAlias = Mapping[str, Any]
Rows: TypeAlias = Iterator[list[Row]]

#: Beginnings of cells that spreadsheets would take for formulas.
_FORMULAS = ("=", "+", "-", "@", "\t", "\r")


def iso_time(time: int) -> str:
    """Return a time (UTC ns) in the form of ISO 8601, to the nanosecond.

    Examples
    --------
    >>> iso_time(1_000_000_001)
    '1970-01-01T00:00:01.000000001Z'
    """
    seconds, rest = divmod(time, 10**9)
    return f"{datetime.fromtimestamp(seconds, tz=UTC):%Y-%m-%dT%H:%M:%S}.{rest:09d}Z"


def csv_pieces(columns: Columns, rows: Rows) -> Iterator[bytes]:
    """Yield a CSV file in pieces; an apostrophe precedes text that a spreadsheet would take for a formula."""
    buffer = io.StringIO()
    writer = csv.writer(buffer, lineterminator="\r\n")
    writer.writerow([_cell(name, "text") for name in columns])
    yield _emptied(buffer)
    for piece in rows:
        writer.writerows([_cell(row.get(name), kind) for name, kind in columns.items()] for row in piece)
        yield _emptied(buffer)


def _emptied(buffer: io.StringIO) -> bytes:
    """Return the contents of a buffer, and empty it."""
    text = buffer.getvalue()
    buffer.seek(0)
    buffer.truncate()
    return text.encode()


def _cell(value: Any, kind: Kind) -> Any:
    """Return a cell of a CSV file: no text begins like a formula."""
    if value is None:
        return ""
    if kind == "time":
        return iso_time(value)
    if kind == "text":
        text = str(value)
        return f"'{text}" if text.startswith(_FORMULAS) else text
    return value


def json_pieces(columns: Columns, rows: Rows, *, head: Mapping[str, str]) -> Iterator[bytes]:
    """Yield a JSON document in pieces: `head`, the names of the `columns`, and the `rows` as objects."""
    begin = json.dumps({**head, "columns": list(columns)})[:-1]
    yield f'{begin}, "rows": ['.encode()
    before = "\n"
    for piece in rows:
        texts = []
        for row in piece:
            values = {name: _plain_value(row.get(name), kind) for name, kind in columns.items()}
            texts.append(before + json.dumps(values, allow_nan=False))
            before = ",\n"
        yield "".join(texts).encode()
    yield b"\n]}\n"


def _plain_value(value: Any, kind: Kind) -> Any:
    """Return a value of a JSON document."""
    return iso_time(value) if kind == "time" and value is not None else value


class _Sink(io.RawIOBase):
    """A file that keeps what is written until it is taken."""

    def __init__(self) -> None:
        self._parts: list[bytes] = []
        self._n_bytes = 0

    def writable(self) -> bool:
        return True

    def write(self, data: Any) -> int:
        self._parts.append(bytes(data))
        self._n_bytes += len(self._parts[-1])
        return len(self._parts[-1])

    def tell(self) -> int:
        return self._n_bytes

    def take(self) -> bytes:
        """Return what was written since the last time."""
        taken, self._parts = b"".join(self._parts), []
        return taken


def parquet_pieces(columns: Columns, rows: Rows) -> Iterator[bytes]:
    """Yield a Parquet file in pieces, a row group each."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    types = {"text": pa.string(), "time": pa.timestamp("ns", "UTC"), "number": pa.float64(), "integer": pa.int64()}
    schema = pa.schema([(name, types[kind]) for name, kind in columns.items()])
    sink = _Sink()
    with pq.ParquetWriter(sink, schema, compression="zstd") as writer:
        for piece in rows:
            if piece:
                writer.write_table(_arrow_table(piece, schema))
            yield sink.take()
    yield sink.take()


def _arrow_table(rows: Iterable[Row], schema: Any) -> Any:
    """Return rows as a table."""
    import pyarrow as pa

    listed = list(rows)
    arrays = [pa.array([row.get(field.name) for row in listed], type=field.type) for field in schema]
    return pa.Table.from_arrays(arrays, schema=schema)
