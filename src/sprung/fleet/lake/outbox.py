"""Windows on the disk of a monitor that wait to be written to a lake together."""

import os
from collections.abc import Iterator
from contextlib import contextmanager
from fcntl import LOCK_EX, LOCK_NB, flock
from pathlib import Path

import pyarrow as pa

from sprung.errors import DataError
from sprung.fleet.lake.lake import Lake
from sprung.fleet.lake.windows import SCHEMA, LakeWindow

#: Size of windows that are written in one commit [bytes].
_WRITTEN_TOGETHER = 1 << 27
_ENDING, _PART, _DAMAGED = ".arrow", ".part", ".damaged"


class Outbox:
    """A folder with a file for each window.

    Parameters
    ----------
    folder
        The folder, created with the first window.
    most_bytes
        Size of all windows above which no more are accepted.

    Notes
    -----
    A file is deleted after the commit with its window. After a crash in between the window is in the folder and in the
    lake, which does not add it again.
    """

    def __init__(self, folder: Path | str, *, most_bytes: float) -> None:
        self.folder, self._most_bytes = Path(folder), most_bytes

    @property
    def files(self) -> list[os.DirEntry[str]]:
        """Files of the windows that wait, by time of the window's first sample."""
        if not self.folder.is_dir():
            return []
        with os.scandir(self.folder) as entries:
            return sorted((each for each in entries if each.name.endswith(_ENDING)), key=lambda each: each.name)

    def put(self, window: LakeWindow) -> None:
        """Keep a window until it is written; one that is already waiting is replaced.

        Raises
        ------
        DataError
            If too many windows are waiting.
        OSError
            If it cannot be written to the disk.
        """
        if sum(_size(each) for each in self.files) + window.n_bytes > self._most_bytes:
            raise DataError(
                f"windows of {self._most_bytes / 1e9:.3g} GB wait in {self.folder} for the lake: check why they are "
                "not written, or raise keep.raw_gigabytes"
            )
        self.folder.mkdir(parents=True, exist_ok=True)
        path = self.folder / f"{window.row['start']:020}-{window.row['digest']}{_ENDING}"
        part = path.with_suffix(_PART)
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
            for paths, windows in self._parts() if is_own else ():
                lake.write(windows)
                for path in paths:
                    path.unlink(missing_ok=True)
                n_moved += len(windows)
        return n_moved

    def _parts(self) -> Iterator[tuple[list[Path], list[LakeWindow]]]:
        """Yield windows with their files, as many as are written together."""
        paths: list[Path] = []
        windows: list[LakeWindow] = []
        for path in [Path(each.path) for each in self.files]:
            try:
                with pa.ipc.open_file(path) as reader:
                    (row,) = reader.read_all().to_pylist()
            except (pa.ArrowException, ValueError):
                path.replace(path.with_suffix(_DAMAGED))
                continue
            paths.append(path)
            windows.append(LakeWindow(row["vehicle"], row))
            if sum(window.n_bytes for window in windows) >= _WRITTEN_TOGETHER:
                yield paths, windows
                paths, windows = [], []
        if windows:
            yield paths, windows

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


def _size(file: "os.DirEntry[str]") -> int:
    """Return the size of a file; 0 where it was moved meanwhile."""
    try:
        return file.stat().st_size
    except FileNotFoundError:
        return 0
