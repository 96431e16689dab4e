"""Spark: sessions with the settings that analyses need, and files that tasks read and write by themselves."""

import os
import shutil
import sys
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import partial
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote, urlsplit

import pyarrow as pa
import pyarrow.parquet as pq

from sprung._checks import required
from sprung.errors import ParameterError
from sprung.fleet.lake import AddedFile, Table, file_name

if TYPE_CHECKING:
    from pyspark.sql import DataFrame, SparkSession

#: Columns that describe a file that a task wrote.
FILE_COLUMNS = pa.schema(
    [("path", pa.string()), ("n_bytes", pa.int64()), ("n_rows", pa.int64()), ("date", pa.string())]
)
#: Attempts at a task before a run fails: a lost worker costs one.
_ATTEMPTS = 4
#: Settings of every session.
_SETTINGS = {
    "spark.app.name": "sprung",
    "spark.sql.session.timeZone": "UTC",
    "spark.task.maxFailures": str(_ATTEMPTS),
    # One linear-algebra thread for each task: matrices are small.
    "spark.executorEnv.OPENBLAS_NUM_THREADS": "1",
    "spark.executorEnv.OMP_NUM_THREADS": "1",
    # Tasks take as long as their windows are many: what is late is not hung.
    "spark.network.timeout": "600s",
    "spark.sql.execution.arrow.pyspark.enabled": "true",
    "spark.sql.streaming.stateStore.providerClass": (
        "org.apache.spark.sql.execution.streaming.state.RocksDBStateStoreProvider"
    ),
}
_OF_ONE_MACHINE = {
    "spark.ui.enabled": "false",
    "spark.driver.bindAddress": "127.0.0.1",
    "spark.driver.host": "127.0.0.1",
    "spark.ui.showConsoleProgress": "false",
    "spark.sql.shuffle.partitions": "8",
}


def spark_session(master: str = "local[*]", *, settings: dict[str, str] | None = None) -> "SparkSession":
    """Return a session of Spark, or the one that this program has.

    Parameters
    ----------
    master
        local[N] for N processes on this machine (* for all cores), or the address of a cluster such as
        spark://HOST:PORT; "" for the one that spark-submit gives.
    settings
        Further settings of Spark.

    Raises
    ------
    MissingPackageError
        If PySpark is not installed.
    ParameterError
        If there is no Java, or no session can be made.

    Examples
    --------
    >>> settings = {"spark.sql.shuffle.partitions": "2"}
    >>> session = spark_session("local[2]", settings=settings)  # doctest: +SKIP
    >>> session.conf.get("spark.sql.session.timeZone")  # doctest: +SKIP
    'UTC'
    >>> session.conf.get("spark.sql.shuffle.partitions")  # doctest: +SKIP
    '2'
    """
    pyspark = required("pyspark", purpose="archives and streams of a fleet", extra="fleet")
    sql = required("pyspark.sql", purpose="archives and streams of a fleet", extra="fleet")
    home = os.environ.get("JAVA_HOME", "")
    if shutil.which("java", path=os.path.join(home, "bin") if home else None) is None:
        place = f"which JAVA_HOME={home} does not hold" if home else "which this machine lacks"
        raise ParameterError(f"Spark needs Java 17 or later, {place}: install default-jre-headless")
    is_local = master.startswith("local")
    is_here = is_local or "//127.0.0.1" in master or "//localhost" in master
    chosen = dict(_SETTINGS)
    if is_here:
        chosen |= _OF_ONE_MACHINE
    if is_here:
        os.environ.setdefault("PYSPARK_PYTHON", sys.executable)
        os.environ.setdefault("SPARK_LOCAL_IP", "127.0.0.1")
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    configuration = pyspark.SparkConf()
    for name, value in {**chosen, **(settings or {})}.items():
        configuration.setIfMissing(name, value)
    if master:
        configuration.setMaster(_with_attempts(master))
    session = sql.SparkSession.getActiveSession() or _started(configuration, is_quiet=is_here)
    session.sparkContext.setLogLevel("OFF" if is_here else "ERROR")
    return session


def _started(configuration: Any, *, is_quiet: bool) -> "SparkSession":
    """Return a new session; what Java says as it starts is shown only where it fails."""
    import pyspark
    from pyspark.java_gateway import launch_gateway
    from pyspark.sql import SparkSession

    with tempfile.TemporaryFile("w+", encoding="utf-8") as said:
        try:
            # One Java for all sessions of a process, as PySpark has it.
            gateway = pyspark.SparkContext._gateway or launch_gateway(  # type: ignore[no-untyped-call]
                configuration, {"stderr": said} if is_quiet else None
            )
            return SparkSession(pyspark.SparkContext(gateway=gateway, conf=configuration))
        except Exception as error:  # whatever Java makes of a wrong address
            said.seek(0)
            words = [line for line in (*str(error).splitlines(), *said.read().splitlines()) if "Exception" in line]
            reason = (words or [type(error).__name__])[-1].strip()[:200]
            where = configuration.get("spark.master", "the cluster")
            raise ParameterError(f"no session of Spark at {where}: {reason}") from None


def _with_attempts(master: str) -> str:
    """Return a local master that repeats tasks, as clusters do."""
    if master == "local":
        return f"local[1,{_ATTEMPTS}]"
    if master.startswith("local[") and "," not in master:
        return f"{master.removesuffix(']')},{_ATTEMPTS}]"
    return master


#: Rows in a file of a table of vehicles.
_ROWS_IN_FILE = 5000


def read(session: "SparkSession", table: Table, *, files: Iterable[AddedFile] | None = None) -> "DataFrame":
    """Return files of a table as a data frame; None: all files."""
    chosen = table.files() if files is None else list(files)
    return read_files(session, table.schema, [table.uri(file) for file in chosen], base=table.location)


def read_files(session: "SparkSession", schema: pa.Schema, paths: list[str], *, base: str | None = None) -> "DataFrame":
    """Return Parquet files as a data frame.

    Parameters
    ----------
    session
        Session of Spark.
    schema
        Columns of the files, and those that the names of their folders state.
    paths
        Files; none give an empty data frame.
    base
        Folder below which the names of folders are values of columns; None: there are no such columns.
    """
    columns = spark_schema(schema)
    if not paths:
        return session.createDataFrame([], columns).limit(0)  # known to be empty, so that no join with it is computed
    reader = session.read.schema(columns)
    return (reader if base is None else reader.option("basePath", base)).parquet(*paths)


def spark_schema(schema: pa.Schema) -> Any:
    """Return an Arrow schema as Spark names it."""
    from pyspark.sql.pandas.types import from_arrow_schema

    return from_arrow_schema(schema)


def write(frame: "DataFrame", table: Table, *, n_rows: int | None = None) -> list[AddedFile]:
    """Write a data frame into the folder of a table, to be committed.

    Parameters
    ----------
    frame
        Rows with the columns of the table.
    table
        Table that they are for; not partitioned.
    n_rows
        Number of rows, which decides on the number of files; None: as many files as the frame has partitions.
    """
    if n_rows is not None:
        frame = frame.repartition(max(1, -(-n_rows // _ROWS_IN_FILE)))
    return write_files(frame, table.location, table.schema)


def write_files(frame: "DataFrame", location: str, schema: pa.Schema) -> list[AddedFile]:
    """Write a data frame as one file for each of its partitions.

    Parameters
    ----------
    frame
        Rows with the columns of the schema.
    location
        Folder or URL.
    schema
        Columns of the files.
    """
    writing = partial(_written, location=location, schema=schema)
    rows = frame.select(*schema.names).mapInArrow(writing, spark_schema(FILE_COLUMNS)).collect()
    return [AddedFile(row["path"], row["n_bytes"], row["n_rows"]) for row in rows]


def write_rows(
    rows: Sequence[Mapping[str, Any]], *, location: str, schema: pa.Schema, partition: Mapping[str, str | None]
) -> AddedFile:
    """Write rows of one partition as a file in the folder of a table.

    Parameters
    ----------
    rows
        Rows with columns of the schema; those that are absent are null.
    location
        Folder or URL of the table.
    schema
        Columns of the table.
    partition
        Values of the partition columns.
    """
    return write_table(pa.Table.from_pylist(list(rows), schema=schema), location=location, partition=partition)


def write_table(data: pa.Table, *, location: str, partition: Mapping[str, str | None]) -> AddedFile:
    """Write a table of one partition as a file in the folder of a table; parameters as for `write_rows`."""
    path = file_name(partition)
    system, place = filesystem(f"{location}/{path}")
    system.create_dir(place.rpartition("/")[0], recursive=True)
    with system.open_output_stream(place) as stream:
        pq.write_table(data.drop_columns(list(partition)), stream, compression="zstd")
    size = system.get_file_info(place).size
    return AddedFile(path, size, data.num_rows, partition)


def filesystem(uri: str) -> tuple[Any, str]:
    """Return the file system of a path or URL, and the path in it."""
    from pyarrow import fs

    if urlsplit(uri).scheme in {"", "file"}:
        return fs.LocalFileSystem(), unquote(urlsplit(uri).path) if uri.startswith("file:") else uri
    system, place = fs.FileSystem.from_uri(uri)
    return system, place


def described(file: AddedFile) -> dict[str, Any]:
    """Return a file as a row of `FILE_COLUMNS`."""
    return {
        "path": file.path,
        "n_bytes": file.n_bytes,
        "n_rows": file.n_rows,
        "date": next(iter(file.partition.values()), None),
    }


def _written(batches: Iterator[pa.RecordBatch], *, location: str, schema: pa.Schema) -> Iterator[pa.RecordBatch]:
    """Write the rows of a task as one file, and yield its description."""
    held = [pa.Table.from_batches([batch]) for batch in batches]
    data = pa.concat_tables(held).select(schema.names).cast(schema) if held else schema.empty_table()
    files = [described(write_table(data, location=location, partition={}))] if data.num_rows else []
    yield pa.RecordBatch.from_pylist(files, schema=FILE_COLUMNS)
