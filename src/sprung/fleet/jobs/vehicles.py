"""Vehicle files of a fleet: a folder with one file for each vehicle, or a table."""

from collections.abc import Iterator
from hashlib import blake2b
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pyarrow as pa

from sprung.errors import ParameterError, SprungError
from sprung.fleet.jobs.files import filesystem
from sprung.fleet.lake import absolute_location
from sprung.vehicles import vehicle_from_text, vehicle_text

if TYPE_CHECKING:
    from pyspark.sql import DataFrame, SparkSession

#: Columns of the vehicles, as Spark names their types; `type` and `vehicle_file` are digests.
COLUMNS = "vehicle string, vehicle_text string, vehicle_file string, type string, type_name string, reason string"
_SCHEMA = pa.schema([(name.split()[0], pa.string()) for name in COLUMNS.split(", ")])


def vehicles_of(session: "SparkSession", place: str | Path) -> "DataFrame":
    """Return the vehicles of a fleet as a data frame with `COLUMNS`.

    Parameters
    ----------
    session
        Session of Spark.
    place
        Folder with one vehicle file for each vehicle, named VEHICLE.toml; or a table as CSV or Parquet with the columns
        `vehicle` and `file` (relative to the table's folder). All machines of a cluster must reach it.

    Raises
    ------
    ParameterError
        If the place does not exist, or the table lacks a column.

    Notes
    -----
    Vehicles are of one type if their files say the same, apart from the name. A file that cannot be used is a reason,
    in every row of its vehicle.
    """
    from pyspark.sql import functions as f

    text = absolute_location(place)
    if text.endswith((".csv", ".parquet")):
        table = session.read.csv(text, header=True) if text.endswith(".csv") else session.read.parquet(text)
        lacking = sorted({"vehicle", "file"} - set(table.columns))
        if lacking:
            raise ParameterError(f"{place} lacks the column {lacking[0]!r}: give a table with vehicle and file")
        folder = text.rpartition("/")[0]
        paths = f.when(f.col("file").rlike("^(/|[a-z0-9]+://)"), f.col("file")).otherwise(
            f.concat(f.lit(f"{folder}/"), f.col("file"))
        )
        return table.groupBy("vehicle").agg(f.min(paths).alias("path")).mapInArrow(_read, COLUMNS)
    system, folder = filesystem(text)
    if not system.get_file_info(folder).is_file and not _has_files(system, folder):
        raise ParameterError(f"{place} has no vehicle files: give a folder with VEHICLE.toml for each, or a table")
    files = session.read.text(text, wholetext=True, pathGlobFilter="*.toml")
    named = files.select(f.regexp_extract("_metadata.file_name", r"^(.*)\.toml$", 1).alias("vehicle"), "value")
    return named.mapInArrow(_described, COLUMNS)


def _has_files(system: Any, folder: str) -> bool:
    """Return whether a folder has vehicle files."""
    from pyarrow import fs

    listing = system.get_file_info(fs.FileSelector(folder, allow_not_found=True))
    return any(entry.path.endswith(".toml") for entry in listing)


def _read(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
    """Yield the vehicles of paths."""
    for batch in batches:
        rows = []
        for item in batch.to_pylist():
            try:
                system, place = filesystem(item["path"])
                with system.open_input_stream(place) as stream:
                    rows.append(described(item["vehicle"], stream.read().decode()))
            except (OSError, UnicodeDecodeError) as error:
                rows.append(_unusable(item["vehicle"], f"{item['path']} cannot be read: {error}"))
        yield pa.RecordBatch.from_pylist(rows, schema=_SCHEMA)


def _described(batches: Iterator[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
    """Yield the vehicles of texts."""
    for batch in batches:
        rows = [described(item["vehicle"], item["value"]) for item in batch.to_pylist()]
        yield pa.RecordBatch.from_pylist(rows, schema=_SCHEMA)


def described(vehicle: str, text: str) -> dict[str, str]:
    """Return a vehicle with its file as a row of `COLUMNS`.

    Parameters
    ----------
    vehicle
        Name of the vehicle.
    text
        Text of its vehicle file.
    """
    try:
        description = vehicle_from_text(text, source=f"{vehicle}.toml")
    except SprungError as error:
        return {**_unusable(vehicle, str(error)), "vehicle_file": _digest(text)}
    of_type = vehicle_text(description.model_copy(update={"name": "type"}))
    return {
        "vehicle": vehicle,
        "vehicle_text": text,
        "vehicle_file": _digest(text),
        "type": _digest(of_type),
        "type_name": description.name,
        "reason": "",
    }


def _unusable(vehicle: str, reason: str) -> dict[str, str]:
    """Return a vehicle whose file cannot be used."""
    empty = dict.fromkeys(("vehicle_text", "vehicle_file", "type", "type_name"), "")
    return {"vehicle": vehicle, **empty, "reason": reason}


def _digest(text: str) -> str:
    """Return a digest of a text."""
    return blake2b(text.encode(), digest_size=8).hexdigest()
