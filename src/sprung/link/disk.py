"""System calls of a spool, one in each method, so that tests can substitute a disk that fails."""

import fcntl
import os
import shutil
from pathlib import Path


class Disk:
    """Files on the disk of this machine; every method raises OSError where the system call fails."""

    def make_folder(self, folder: Path) -> None:
        """Create a folder for this user alone where it is missing, with its parents."""
        folder.mkdir(parents=True, exist_ok=True, mode=0o700)

    def lock(self, path: Path) -> int | None:
        """Return a file that is locked by this process until it closes it or ends; None if another one holds it."""
        handle = os.open(path, os.O_RDWR | os.O_CREAT, 0o600)
        try:
            fcntl.flock(handle, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except OSError:
            os.close(handle)
            return None
        return handle

    def names(self, folder: Path) -> list[str]:
        """Return the names of the files in a folder, sorted."""
        return sorted(os.listdir(folder))

    def read(self, path: Path) -> bytes:
        """Return the content of a file."""
        return path.read_bytes()

    def open(self, path: Path) -> int:
        """Return a file to append to, created if it is missing."""
        return os.open(path, os.O_WRONLY | os.O_CREAT | os.O_APPEND, 0o600)

    def write(self, handle: int, data: bytes) -> int:
        """Append data to an open file, and return how many bytes of it were taken."""
        return os.write(handle, data)

    def sync(self, handle: int) -> None:
        """Wait until the data of an open file are on the disk."""
        os.fdatasync(handle)

    def sync_folder(self, folder: Path) -> None:
        """Wait until the names of the files in a folder are on the disk."""
        handle = os.open(folder, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)

    def truncate(self, file: int | Path, size: int) -> None:
        """Cut a file to a size [bytes]."""
        os.truncate(file, size)

    def close(self, handle: int) -> None:
        """Close a file."""
        os.close(handle)

    def rename(self, old: Path, new: Path) -> None:
        """Give a file another name, which replaces the file that had it."""
        old.rename(new)

    def remove(self, path: Path) -> None:
        """Remove a file, if it is there."""
        path.unlink(missing_ok=True)

    def free(self, folder: Path) -> int:
        """Return the free space on the disk of a folder [bytes]."""
        return shutil.disk_usage(folder).free
