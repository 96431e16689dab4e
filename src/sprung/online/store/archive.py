"""Retention of the files of the monitor's archive of samples."""

import os
import time
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import dataclass
from heapq import heapify, heappop, heappush
from pathlib import Path

from sprung.link.archive import reported
from sprung.online.store.schema import StoreError

# Within the ticks of its disk a folder can change again without a sign [ns].
_SETTLED = 2 * 10**9
_NEVER = 2**63


@dataclass(frozen=True, slots=True)
class _Day:
    """Files of a vehicle and day: time of change of the folder (None: just now), oldest start, bytes."""

    changed: int | None
    oldest: int
    size: int


class Retention:
    """Deletes old files of an archive; the contents of a folder are remembered until it changes.

    Parameters
    ----------
    folder
        Folder of the archive, as `write_archive` writes it.

    Notes
    -----
    The time of a folder changes with every file that is added or removed by any program. So a pass costs one system
    call for each vehicle and day, and one for each file only in folders that changed or lose a file. Nothing of this is
    stored: the first pass after a restart examines every file.
    """

    def __init__(self, folder: Path | str) -> None:
        self._folder = Path(folder)
        self._days: dict[str, _Day] = {}

    def prune(self, *, before: int, most_bytes: int | None = None) -> int:
        """Delete files whose samples begin before a time, then the oldest ones down to a total size.

        Parameters
        ----------
        before
            Time before which samples are deleted, UTC ns.
        most_bytes
            Largest size that may remain [bytes]; None for any.

        Returns
        -------
        int
            Number of files deleted.

        Raises
        ------
        StoreError
            If a file cannot be deleted.
        """
        with reported(self._folder, StoreError):
            self._look()
            remaining, n_deleted = sum(day.size for day in self._days.values()), 0
            # A folder stands for its oldest file, and only what comes first is opened: most never are.
            waiting: list[tuple[int, str, int | None]]
            waiting = [(day.oldest, path, None) for path, day in self._days.items()]
            heapify(waiting)
            while waiting and (waiting[0][0] < before or (most_bytes is not None and remaining > most_bytes)):
                _, path, size = heappop(waiting)
                if size is None:
                    for file in _files(path):
                        heappush(waiting, file)
                    continue
                Path(path).unlink(missing_ok=True)
                with suppress(OSError):  # other files are in it
                    Path(path).parent.rmdir()
                remaining -= size
                n_deleted += 1
        return n_deleted

    def _look(self) -> None:
        """Examine the folders of days that are new or changed."""
        days, settled = {}, time.time_ns() - _SETTLED
        for path, changed in _day_folders(self._folder):
            day = self._days.get(path)
            if day is None or day.changed != changed:
                files = _files(path)
                oldest = min((begin for begin, _, _ in files), default=_NEVER)
                day = _Day(changed if changed < settled else None, oldest, sum(size for _, _, size in files))
            days[path] = day
        self._days = days


def _day_folders(folder: Path) -> Iterator[tuple[str, int]]:
    """Yield the folders of vehicles and days with their times of change."""
    for vehicle in os.scandir(folder) if folder.is_dir() else ():
        for day in os.scandir(vehicle.path) if vehicle.is_dir() else ():
            if day.is_dir():
                yield day.path, day.stat().st_mtime_ns


def _files(folder: str) -> list[tuple[int, str, int]]:
    """Return start, path and size of the files of a day."""
    files = [(file.stat(), file.path) for file in os.scandir(folder) if file.name.endswith((".parquet", ".part"))]
    return [(facts.st_mtime_ns, path, facts.st_size) for facts, path in files]
