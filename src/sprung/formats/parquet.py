"""Tables in Apache Parquet; the unit of a column is in the metadata of its field or in its name."""

import itertools
from collections.abc import Iterator, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sprung.errors import FormatError
from sprung.formats.settings import ReadSettings
from sprung.formats.table import (
    PIECE_ROWS,
    Block,
    Column,
    Group,
    Table,
    arrow_values,
    chosen_columns,
    refuse_repeated,
    reported,
    time_column,
    written,
)
from sprung.recording import Recording

NAME, EXTRA = "Parquet", None
ENDINGS = (".parquet", ".pq")

# Name that pandas gives to an index without a name; it is the time if it holds date-times.
_INDEX = "__index_level_0__"
_BUFFER_BYTES = 1_048_576


def recognises(head: bytes) -> bool:
    """Return whether a file has the signature of Parquet."""
    return head.startswith(b"PAR1")


def groups(path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the only table of a Parquet file."""
    with reported(path, "Parquet"), _file(path) as file:
        schema = file.schema_arrow
    names = tuple(field.name for field in schema if field.name != _INDEX)
    refuse_repeated(names, path=path)
    return (Group(path.name, names, path.name, partial(_table, path, schema, settings)),)


def _table(path: Path, schema: Any, settings: ReadSettings, channels: Sequence[str] | None) -> Table:
    """Return the table of the columns of some channels."""
    import pyarrow as pa

    fields = {field.name: field for field in schema}
    names = [name for name in fields if name != _INDEX]
    is_dated = _INDEX in fields and pa.types.is_timestamp(fields[_INDEX].type)
    time = time_column(names, stated=settings.time) or (_INDEX if is_dated else None)
    chosen = chosen_columns(
        names, channels, time=time, units=[_stated(fields[name], "unit") for name in names], path=path
    )
    for column in chosen:
        _check_type(path, column, fields[column.heading].type)
    columns = tuple(
        column.with_facts({key: _stated(fields[column.heading], key) for key in ("comment", "calibration")})
        for column in chosen
    )

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        return _blocks(path, columns, time, first, last)

    return Table(path, columns, time, blocks, comment=_stated(schema, "comment") or "")


def _file(path: Path) -> Any:
    """Open a file so that it is read piece by piece."""
    import pyarrow.parquet as pq

    return pq.ParquetFile(path, buffer_size=_BUFFER_BYTES, pre_buffer=False)


def unpacked_size(path: Path, _most: int) -> int:
    """Return the size of all numbers of a file [bytes], however few bytes it stores them in."""
    with reported(path, "Parquet"), _file(path) as file:
        return int(file.metadata.num_rows * file.metadata.num_columns * np.dtype(np.float64).itemsize)


def _stated(item: Any, name: str) -> str | None:
    """Return a text in the metadata of a field or of the file."""
    text = (item.metadata or {}).get(name.encode())
    return None if text is None else str(text.decode("utf-8", "replace"))


def _check_type(path: Path, column: Column, kind: Any) -> None:
    """Raise if a column does not hold numbers."""
    import pyarrow as pa

    numbers = (pa.types.is_integer, pa.types.is_floating, pa.types.is_boolean, pa.types.is_decimal, pa.types.is_null)
    if not any(is_number(kind) for is_number in numbers):
        raise FormatError(
            f"{path}: column {column.heading!r} holds {kind}, not numbers: leave it out with --channels or convert it"
        )


def _blocks(path: Path, columns: tuple[Column, ...], time: str | None, first: int, last: int | None) -> Iterator[Block]:
    """Yield some rows of some columns, counted from 1; row groups outside them are not read."""
    wanted = [*(column.heading for column in columns), *([time] if time else [])]
    with reported(path, "Parquet"), _file(path) as file:
        sizes = [file.metadata.row_group(number).num_rows for number in range(file.metadata.num_row_groups)]
        ends = list(itertools.accumulate(sizes))
        chosen = [
            number
            for number, (end, size) in enumerate(zip(ends, sizes, strict=True))
            if end > first and (last is None or end - size < last)
        ]
        row = ends[chosen[0]] - sizes[chosen[0]] if chosen else 0
        for batch in file.iter_batches(batch_size=PIECE_ROWS, row_groups=chosen, columns=wanted):
            begin = max(0, first - row)
            end = batch.num_rows if last is None else min(batch.num_rows, last - row)
            if begin < end:
                yield _block(path, batch.slice(begin, end - begin), columns, time, row + begin + 1)
            row += batch.num_rows


def _block(path: Path, batch: Any, columns: tuple[Column, ...], time: str | None, row: int) -> Block:
    """Return the rows of a batch, the first of which has the number `row`."""
    values = np.empty((len(columns), batch.num_rows))
    for index, column in enumerate(columns):
        values[index] = arrow_values(batch.column(column.heading))
    return Block(row, _stamps(path, batch.column(time)) if time else None, values)


def _stamps(path: Path, array: Any) -> NDArray[Any]:
    """Return a time column as numbers, date-times or durations."""
    import pyarrow as pa

    kind = array.type
    if pa.types.is_timestamp(kind):
        array = array.cast(pa.timestamp("ns"))
    elif pa.types.is_decimal(kind):
        array = array.cast(pa.float64())
    elif not (pa.types.is_integer(kind) or pa.types.is_floating(kind) or pa.types.is_duration(kind)):
        raise FormatError(f"{path}: the time column holds {kind}: convert it to seconds or time stamps")
    return arrow_values(array)


def write(recording: Recording, path: Path) -> None:
    """Write a recording as Parquet: a time column, and every channel with its unit in the field's metadata."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    columns = written(recording, has_units=False)
    stamps = pa.array(columns.stamps)
    if pa.types.is_timestamp(stamps.type):
        stamps = stamps.cast(pa.timestamp("ns", "UTC"))
    arrays = [stamps, *map(pa.array, columns.values)]
    fields = [pa.field(columns.time, stamps.type)]
    for channel, unit in zip(recording.channels, columns.units, strict=True):
        stated = {"comment": channel.comment, "calibration": channel.calibration}
        metadata = {"unit": unit, **{name: text for name, text in stated.items() if text}}
        fields.append(pa.field(channel.name, pa.float64(), metadata=metadata))
    schema = pa.schema(fields, metadata={"comment": recording.comment} if recording.comment else None)
    pq.write_table(pa.Table.from_arrays(arrays, schema=schema), path, compression="zstd")
