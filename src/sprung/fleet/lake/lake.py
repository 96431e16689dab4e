"""The lake of a fleet: windows of samples of many vehicles, by date and vehicle, and those that wait for it."""

import math
import os
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from datetime import UTC, date, datetime
from fcntl import LOCK_EX, LOCK_NB, flock
from pathlib import Path
from typing import TypeVar

import pyarrow as pa
import pyarrow.compute as pc

from sprung.errors import DataError
from sprung.fleet.lake.table import AddedFile, Table
from sprung.fleet.lake.windows import KEY, SCHEMA, LakeWindow

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
        Folder, or URL of an object store.
    options
        Settings of the object store.
    """

    def __init__(self, location: str | Path, *, options: Mapping[str, str] | None = None) -> None:
        self.table = Table(location, SCHEMA, partition_by=["date"], options=options)

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
