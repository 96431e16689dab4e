"""A table of Parquet files in the Delta format: commits are atomic, and readers never see part of one."""

import json
import math
import time
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any
from urllib.parse import urlsplit
from uuid import uuid4

import pyarrow as pa

from sprung._checks import required
from sprung.errors import DataError, ParameterError

#: Largest size of a file after compaction [bytes], and smallest that compaction leaves alone.
TARGET, LEAST = 1 << 28, 1 << 26


@dataclass(frozen=True, slots=True)
class AddedFile:
    """A Parquet file that a program wrote into the folder of a table, to be committed.

    Parameters
    ----------
    path
        Path relative to the folder of the table.
    n_bytes
        Size of the file.
    n_rows
        Number of its rows.
    partition
        Values of the partition columns, as text.
    """

    path: str
    n_bytes: int
    n_rows: int
    partition: Mapping[str, str | None] = field(default_factory=dict)


class Table:
    """A table of files in a folder or object store.

    Parameters
    ----------
    location
        Folder, or URL of an object store such as s3://bucket/lake.
    schema
        Columns of the table.
    partition_by
        Columns whose values are in the names of folders instead of in the files.
    options
        Settings of the object store, such as its region.
    """

    def __init__(
        self,
        location: str | Path,
        schema: pa.Schema,
        *,
        partition_by: Sequence[str] = (),
        options: Mapping[str, str] | None = None,
    ) -> None:
        self.location = absolute_location(location)
        self.schema, self.partition_by = schema, tuple(partition_by)
        self._options = dict(options or {})

    def __repr__(self) -> str:
        """Return the place of the table."""
        return f"Table at {self.location}"

    @property
    def exists(self) -> bool:
        """Whether anything was committed."""
        with self._reported():
            return bool(_deltalake().DeltaTable.is_deltatable(self.location, self._options or None))

    @property
    def version(self) -> int:
        """Number of the last commit, from 0; -1 before the first."""
        return int(self.open().version()) if self.exists else -1

    def open(self) -> Any:
        """Return the table as `deltalake.DeltaTable`.

        Raises
        ------
        DataError
            If there is no table.
        """
        if not self.exists:
            raise DataError(f"{self.location} holds no table: give the folder of a lake, or import files into it first")
        with self._reported():
            return _deltalake().DeltaTable(self.location, storage_options=self._options or None)

    def create(self) -> None:
        """Create the table without rows, if there is none.

        Raises
        ------
        ParameterError
            If it cannot be written.
        """
        if self.exists:
            return
        try:
            _deltalake().DeltaTable.create(
                self.location,
                self.schema,
                mode="ignore",
                partition_by=list(self.partition_by),
                storage_options=self._options or None,
            )
        except OSError as error:
            raise ParameterError(f"{self.location} cannot be written: {error}: give another location") from None

    def append(self, rows: pa.Table, *, largest_group: int | None = None) -> None:
        """Append rows from memory in one commit.

        Parameters
        ----------
        rows
            Rows with the columns of the schema.
        largest_group
            Largest number of rows in a row group; None: as the library chooses.
        """
        library = _deltalake()
        self.create()
        with self._reported("written"):
            library.write_deltalake(
                self.location,
                rows,
                mode="append",
                storage_options=self._options or None,
                writer_properties=library.WriterProperties(compression="ZSTD", max_row_group_size=largest_group),
            )

    def commit(
        self,
        files: Iterable[AddedFile],
        *,
        replaces: bool = False,
        application: tuple[str, int] | None = None,
    ) -> bool:
        """Make files part of the table, all of them at once.

        Parameters
        ----------
        files
            Files that were written into its folder.
        replaces
            Whether they replace everything that is in the table.
        application
            Name of a writer and the number of its batch: a batch that is in the table already is left out.

        Returns
        -------
        bool
            Whether the table has changed.
        """
        library = _deltalake()
        self.create()
        if application is not None and self.last_batch(application[0]) >= application[1]:
            return False
        table = self.open()
        added = [_action(file) for file in files]
        if not added and not replaces and application is None:
            return False
        done = None if application is None else [library.Transaction(*application)]
        table.create_write_transaction(
            added,
            mode="overwrite" if replaces else "append",
            schema=table.schema(),
            partition_by=list(self.partition_by),
            commit_properties=library.CommitProperties(app_transactions=done),
        )
        return True

    def last_batch(self, application: str) -> int:
        """Return the number of the last batch that a writer committed; -1 before the first."""
        if not self.exists:
            return -1
        number = self.open().transaction_version(application)
        return -1 if number is None else int(number)

    def files(self) -> list[AddedFile]:
        """Return the files of the table, without their rows."""
        if not self.exists:
            return []
        files = []
        for action in pa.table(self.open().get_add_actions(flatten=True)).to_pylist():
            values = {name: action.get(f"partition.{name}") for name in self.partition_by}
            texts = {name: None if value is None else str(value) for name, value in values.items()}
            files.append(AddedFile(action["path"], int(action["size_bytes"]), int(action["num_records"] or 0), texts))
        return files

    def uri(self, file: AddedFile) -> str:
        """Return the whole path or URL of a file of the table."""
        return f"{self.location}/{file.path}"

    def rows(self, columns: Sequence[str] | None = None, *, filter: Any = None) -> pa.Table:  # noqa: A002
        """Return rows in memory, for tables and columns that are small.

        Parameters
        ----------
        columns
            Names of the columns; None: all.
        filter
            Expression of `pyarrow.dataset`.
        """
        if not self.exists:
            return self.schema.empty_table().select(list(columns or self.schema.names))
        with self._reported():
            dataset = self.open().to_pyarrow_dataset()
            return dataset.to_table(columns=None if columns is None else list(columns), filter=filter)

    def each_row(self, *, filter: Any = None, batch_size: int) -> Iterator[dict[str, Any]]:  # noqa: A002
        """Yield rows file by file, a batch of them at a time in memory.

        Parameters
        ----------
        filter
            Expression of `pyarrow.dataset`.
        batch_size
            Largest number of rows in a batch.

        Raises
        ------
        DataError
            If there is no table, or it cannot be read.
        """
        with self._reported():
            dataset = self.open().to_pyarrow_dataset()
            for batch in dataset.to_batches(
                filter=filter, batch_size=batch_size, batch_readahead=1, fragment_readahead=1
            ):
                yield from batch.to_pylist()

    def compact(
        self, *, sort_by: Sequence[str] = (), largest_group: int | None = None, max_bytes: float = math.inf
    ) -> int:
        """Rewrite small files of each partition as large ones, and return how many partitions were.

        Parameters
        ----------
        sort_by
            Columns by which rows are clustered.
        largest_group
            Largest number of rows in a row group; None: as the library chooses.
        max_bytes
            Size above which a partition is left as it is: clustering takes about three times its size in memory.
        """
        if not self.exists:
            return 0
        properties = _deltalake().WriterProperties(compression="ZSTD", max_row_group_size=largest_group)
        partitions = self._scattered(max_bytes)
        for partition in partitions:
            optimise = self.open().optimize
            arguments = {
                "partition_filters": [(name, "=", value) for name, value in partition] or None,
                "target_size": TARGET,
                "writer_properties": properties,
                "max_concurrent_tasks": 1,
            }
            with self._reported("compacted"):
                if sort_by:
                    optimise.z_order(list(sort_by), **arguments)
                else:
                    optimise.compact(**arguments)
        return len(partitions)

    def delete(self, condition: str) -> None:
        """Delete rows; their files stay until `vacuum`.

        Parameters
        ----------
        condition
            Condition of the rows in SQL, such as "date < '2026-01-01'".
        """
        with self._reported("written"):
            self.open().delete(condition)

    def vacuum(self, *, hours: float = 24.0) -> int:
        """Delete files that no longer belong to the table and that no reader of the last hours can need.

        Returns
        -------
        int
            Number of files deleted.
        """
        if not self.exists:
            return 0
        with self._reported("cleaned"):
            gone = self.open().vacuum(
                retention_hours=round(hours), dry_run=False, enforce_retention_duration=False, full=True
            )
        return len(gone)

    @contextmanager
    def _reported(self, act: str = "read") -> Iterator[None]:
        """Raise errors of the disk, the object store and damaged files as DataError."""
        errors = (OSError, pa.ArrowException, _deltalake().exceptions.DeltaError)
        try:
            yield
        except errors as error:
            reason = str(error).strip().split("\n")[0]
            raise DataError(
                f"{self.location} cannot be {act}: {reason}: check the location and its permissions"
            ) from error

    def _scattered(self, max_bytes: float) -> list[tuple[tuple[str, str | None], ...]]:
        """Return the partitions of limited size with several small files."""
        sizes: dict[tuple[tuple[str, str | None], ...], list[int]] = {}
        for file in self.files():
            sizes.setdefault(tuple(file.partition.items()), []).append(file.n_bytes)
        return sorted(
            partition
            for partition, own in sizes.items()
            if sum(size < LEAST for size in own) > 1 and sum(own) <= max_bytes
        )


def absolute_location(location: str | Path) -> str:
    """Return the absolute path of a folder, which means the same to all processes; URLs of object stores stay.

    Examples
    --------
    >>> absolute_location("/srv/lake/"), absolute_location("s3://fleet/lake/")
    ('/srv/lake', 's3://fleet/lake')
    """
    text = str(location)
    if urlsplit(text).scheme not in {"", "file"}:
        return text.rstrip("/")
    return str(Path(urlsplit(text).path if text.startswith("file:") else text).absolute())


def file_name(partition: Mapping[str, str | None]) -> str:
    """Return a new path for a file of a partition, relative to the folder of its table.

    Examples
    --------
    Every call gives another name:

    >>> partition = {"date": "2026-11-21", "vehicle": "bus-17"}
    >>> file_name(partition).rpartition("/")[0], file_name(partition) == file_name(partition)
    ('date=2026-11-21/vehicle=bus-17', False)
    """
    folders = [f"{name}={value}" for name, value in partition.items()]
    return "/".join([*folders, f"part-{uuid4().hex}.parquet"])


def _action(file: AddedFile) -> Any:
    """Return a file as the log of a table states it."""
    from deltalake.transaction import AddAction

    return AddAction(
        path=file.path,
        size=file.n_bytes,
        partition_values=dict(file.partition),
        modification_time=time.time_ns() // 10**6,
        data_change=True,
        stats=json.dumps({"numRecords": file.n_rows}),
    )


def _deltalake() -> Any:
    """Return the package that reads and writes tables."""
    return required("deltalake", purpose="lakes and tables of a fleet", extra="fleet")
