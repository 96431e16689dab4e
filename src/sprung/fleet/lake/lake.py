"""The lake of a fleet: windows of samples by date and vehicle in a Delta table, and those that wait for it.

Commits to the table are atomic, and readers never see part of one.
"""

import json
import math
import os
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import UTC, date, datetime
from fcntl import LOCK_EX, LOCK_NB, flock
from pathlib import Path
from typing import Any, TypeVar
from urllib.parse import urlsplit
from uuid import uuid4

import pyarrow as pa
import pyarrow.compute as pc

from sprung._checks import required
from sprung.errors import DataError, ParameterError
from sprung.fleet.lake.windows import KEY, SCHEMA, LakeWindow

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
    """

    def __init__(self, location: str | Path, schema: pa.Schema, *, partition_by: Sequence[str] = ()) -> None:
        self.location = absolute_location(location)
        self.schema, self.partition_by = schema, tuple(partition_by)

    def __repr__(self) -> str:
        """Return the place of the table."""
        return f"Table at {self.location}"

    @property
    def exists(self) -> bool:
        """Whether anything was committed."""
        with self._reported():
            return bool(_deltalake().DeltaTable.is_deltatable(self.location))

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
            return _deltalake().DeltaTable(self.location)

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


_Item = TypeVar("_Item")
#: Largest number of rows in a row group: one window is read without many others.
ROWS_IN_GROUP = 4
#: Size of samples in memory after which they are written [bytes].
_WRITTEN_TOGETHER = 1 << 28
#: Size of waiting windows that are moved into a lake in one commit [bytes].
_MOVED_TOGETHER = 1 << 27


@dataclass(frozen=True, slots=True)
class LakeFacts:
    """What a lake holds.

    Parameters
    ----------
    n_windows, n_files, n_bytes
        Numbers of windows and files, and the size of the files.
    first, last
        First and last date with samples, as YYYY-mm-dd; None in an empty lake.
    """

    n_windows: int
    n_files: int
    n_bytes: int
    first: str | None
    last: str | None


@dataclass(frozen=True, slots=True)
class VehicleFacts:
    """What a lake holds for a vehicle.

    Parameters
    ----------
    vehicle
        Its name.
    n_windows
        Number of its windows.
    first, last
        Times of the first sample of its first and last window, UTC ns.
    """

    vehicle: str
    n_windows: int
    first: int
    last: int


class Lake:
    """Windows of samples of many vehicles, one row each, in files by date and clustered by vehicle.

    Parameters
    ----------
    location
        Folder, or URL of an object store, whose settings are variables of the environment.
    """

    def __init__(self, location: str | Path) -> None:
        self.table = Table(location, SCHEMA, partition_by=["date"])

    @property
    def location(self) -> str:
        """Folder or URL."""
        return self.table.location

    @property
    def facts(self) -> LakeFacts:
        """Numbers, size and dates."""
        files = self.table.files()
        days = sorted(str(file.partition["date"]) for file in files)
        return LakeFacts(
            sum(file.n_rows for file in files),
            len(files),
            sum(file.n_bytes for file in files),
            days[0] if days else None,
            days[-1] if days else None,
        )

    def write(self, windows: Iterable[LakeWindow]) -> int:
        """Add windows that the lake does not hold yet, and return how many were added.

        Parameters
        ----------
        windows
            Windows in any order; a few hundred megabytes of them are in memory at a time, and each such part is one
            commit.
        """
        return sum(
            self._append(part) for part in in_parts(windows, size=lambda own: own.n_bytes, limit=_WRITTEN_TOGETHER)
        )

    def missing(self, windows: Sequence[LakeWindow]) -> list[LakeWindow]:
        """Return those of some windows that the lake does not hold yet, once each, by date, vehicle and time."""
        known = self._keys(windows) if windows else set()
        new: dict[tuple[object, ...], LakeWindow] = {}
        for window in windows:
            key = tuple(window.row[name] for name in KEY)
            if key not in known:
                new.setdefault(key, window)
        return sorted(new.values(), key=lambda window: (window.day, window.vehicle, window.row["start"]))

    def windows(
        self, *, vehicle: str | None = None, since: int | None = None, until: int | None = None
    ) -> Iterator[LakeWindow]:
        """Yield the windows that begin in a period, a few at a time in memory.

        Parameters
        ----------
        vehicle
            Name of the vehicle; None: all.
        since, until
            Begin and end of the period, UTC ns; None: open.

        Raises
        ------
        DataError
            If there is no lake.
        """
        rule = pc.field("start") >= (0 if since is None else since)
        if since is not None:
            rule &= pc.field("date") >= _date(since)
        if until is not None:
            rule &= (pc.field("start") <= until) & (pc.field("date") <= _date(until))
        if vehicle is not None:
            rule &= pc.field("vehicle") == vehicle
        for row in self.table.each_row(filter=rule, batch_size=ROWS_IN_GROUP):
            yield LakeWindow(row["vehicle"], row)

    def vehicles(self) -> list[VehicleFacts]:
        """Return the number of windows and the period of each vehicle, by name."""
        rows = self.table.rows(["vehicle", "start"]).group_by("vehicle")
        facts = rows.aggregate([("start", "count"), ("start", "min"), ("start", "max")]).sort_by("vehicle")
        return [
            VehicleFacts(row["vehicle"], row["start_count"], row["start_min"], row["start_max"])
            for row in facts.to_pylist()
        ]

    def files(self, *, since: int | None = None, until: int | None = None) -> list[AddedFile]:
        """Return the files that hold the dates of a period, by date.

        Parameters
        ----------
        since, until
            Begin and end of the period, UTC ns; None: open.
        """
        first, last = ("" if since is None else _day(since)), ("9999-12-31" if until is None else _day(until))
        chosen = (file for file in self.table.files() if first <= str(file.partition["date"]) <= last)
        return sorted(chosen, key=lambda file: (str(file.partition["date"]), file.path))

    def compact(self, *, max_bytes: float = math.inf) -> int:
        """Rewrite the small files of each date as large ones by vehicle, and return how many dates were.

        Parameters
        ----------
        max_bytes
            Size above which a date is left as it is: this takes about three times its size in memory.
        """
        return self.table.compact(sort_by=["vehicle"], largest_group=ROWS_IN_GROUP, max_bytes=max_bytes)

    def prune(self, *, before: int, hours: float = 24.0) -> int:
        """Delete dates that ended before a time, and return the number of files that no reader needs any more.

        Parameters
        ----------
        before
            Time before which whole dates are deleted, UTC ns.
        hours
            Age above which files that were replaced or deleted are removed from the disk [h].
        """
        if not self.table.exists:
            return 0
        if any(str(file.partition["date"]) < _day(before) for file in self.table.files()):
            self.table.delete(f"date < '{_day(before)}'")
        return self.table.vacuum(hours=hours)

    def _append(self, windows: Sequence[LakeWindow]) -> int:
        """Add windows in one commit."""
        ordered = self.missing(windows)
        if ordered:
            rows = pa.Table.from_pylist([dict(window.row) for window in ordered], schema=SCHEMA)
            self.table.append(rows, largest_group=ROWS_IN_GROUP)
        return len(ordered)

    def _keys(self, windows: Sequence[LakeWindow]) -> set[tuple[object, ...]]:
        """Return the keys that the lake holds of the vehicles and dates of windows."""
        days, vehicles = {window.day for window in windows}, {window.vehicle for window in windows}
        wanted = pc.field("date").isin(sorted(days)) & pc.field("vehicle").isin(sorted(vehicles))
        known = self.table.rows(KEY, filter=wanted)
        return set(zip(*(known[name].to_pylist() for name in KEY), strict=True))


class Outbox:
    """A folder with a file for each window.

    Parameters
    ----------
    folder
        The folder, created with the first window.
    max_bytes
        Size of all windows above which no more are accepted.

    Notes
    -----
    A file is deleted after the commit with its window. After a crash in between the window is in the folder and in the
    lake, which does not add it again.
    """

    def __init__(self, folder: Path | str, *, max_bytes: float) -> None:
        self.folder, self._max_bytes = Path(folder), max_bytes

    @property
    def files(self) -> list[os.DirEntry[str]]:
        """Files of the windows that wait, by time of the window's first sample."""
        if not self.folder.is_dir():
            return []
        with os.scandir(self.folder) as entries:
            return sorted((each for each in entries if each.name.endswith(".arrow")), key=lambda each: each.name)

    def put(self, window: LakeWindow) -> None:
        """Keep a window until it is written; one that is already waiting is replaced.

        Raises
        ------
        DataError
            If too many windows are waiting.
        OSError
            If it cannot be written to the disk.
        """
        if sum(_size(each) for each in self.files) + window.n_bytes > self._max_bytes:
            raise DataError(
                f"windows of {self._max_bytes / 1e9:.3g} GB wait in {self.folder} for the lake: check why they are "
                "not written, or raise keep.raw_gigabytes"
            )
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{window.row['start']:020}-{window.row['digest']}.arrow"
        part = path.with_suffix(".part")
        try:
            with part.open("wb") as file:
                with pa.ipc.new_file(file, SCHEMA) as writer:
                    writer.write_table(pa.Table.from_pylist([dict(window.row)], schema=SCHEMA))
                file.flush()
                os.fsync(file.fileno())
            part.replace(path)
        finally:
            part.unlink(missing_ok=True)

    def move(self, lake: Lake) -> int:
        """Write all windows that wait to a lake, a hundred megabytes in a commit, and return their number.

        A file that is damaged is renamed and left. Nothing is done while another process does this.

        Raises
        ------
        SprungError
            If the lake cannot be written; the windows remain in the folder.
        OSError
            If a file cannot be deleted.
        """
        n_moved = 0
        with self._locked() as is_own:
            waiting = self._waiting() if is_own else iter(())
            for part in in_parts(waiting, size=lambda own: own[1].n_bytes, limit=_MOVED_TOGETHER):
                lake.write([window for _, window in part])
                for path, _ in part:
                    path.unlink(missing_ok=True)
                n_moved += len(part)
        return n_moved

    def _waiting(self) -> Iterator[tuple[Path, LakeWindow]]:
        """Yield the files that wait with their windows."""
        for path in [Path(each.path) for each in self.files]:
            try:
                with pa.ipc.open_file(path) as reader:
                    (row,) = reader.read_all().to_pylist()
            except (pa.ArrowException, ValueError):
                path.replace(path.with_suffix(".damaged"))
                continue
            yield path, LakeWindow(row["vehicle"], row)

    @contextmanager
    def _locked(self) -> Iterator[bool]:
        """Lock the folder against other processes while it is emptied; yield whether that was possible."""
        if not self.folder.is_dir():
            yield False
            return
        with open(self.folder / ".lock", "w", encoding="utf-8") as file:
            try:
                flock(file, LOCK_EX | LOCK_NB)
            except BlockingIOError:
                yield False
                return
            yield True


def in_parts(items: Iterable[_Item], *, size: Callable[[_Item], float], limit: float) -> Iterator[list[_Item]]:
    """Yield items in parts, each of which ends with the item that brings it to the limit.

    Parameters
    ----------
    items
        Items of any number.
    size
        Size of an item.
    limit
        Size of a part.

    Examples
    --------
    >>> list(in_parts(["one", "three", "two", "four"], size=len, limit=6))
    [['one', 'three'], ['two', 'four']]
    """
    part: list[_Item] = []
    total = 0.0
    for item in items:
        part.append(item)
        total += size(item)
        if total >= limit:
            yield part
            part, total = [], 0.0
    if part:
        yield part


def _day(time: int) -> str:
    """Return the date of a time, UTC ns, as YYYY-mm-dd."""
    return f"{_date(time):%Y-%m-%d}"


def _date(time: int) -> date:
    """Return the date of a time, UTC ns."""
    return datetime.fromtimestamp(time // 10**9, UTC).date()


def _size(file: "os.DirEntry[str]") -> int:
    """Return the size of a file; 0 where it was moved meanwhile."""
    try:
        return file.stat().st_size
    except FileNotFoundError:
        return 0
