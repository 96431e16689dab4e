"""A disk with a cache: a kill keeps what was written, a power cut only what was synced, and perhaps more of it."""

import errno
import os
from collections.abc import Callable
from pathlib import Path

from chance import Chance, Crash

from sprung.link.spool import Disk


class File:
    """Content of a file as programs see it, and as it is on the disk.

    Attributes
    ----------
    cached
        What programs read.
    durable
        What is on the disk for certain.
    bad
        Where the part begins that a failed sync gave up: later syncs succeed without it; None: nowhere.
    """

    def __init__(self, content: bytes = b"") -> None:
        self.cached, self.durable = content, content
        self.bad: int | None = None

    def sync(self) -> None:
        whole = self.cached
        self.durable = whole if self.bad is None else whole[: self.bad] + bytes(len(whole) - self.bad)

    def truncate(self, size: int) -> None:
        self.cached = self.cached[:size]
        if self.bad is not None and self.bad >= size:
            self.bad = None

    def after_power_cut(self, chance: Chance) -> bytes:
        """Return what the disk holds: what was synced, and any part of what came after."""
        if not self.cached.startswith(self.durable) or self.bad is not None:
            return chance.random.choice((self.durable, self.cached))
        rest = self.cached[len(self.durable) :]
        kept = chance.random.randint(0, len(rest))
        zeros = chance.random.choice((0, len(rest) - kept))
        return self.durable + rest[:kept] + bytes(zeros)


class SimulatedDisk(Disk):
    """The disk of one box.

    Parameters
    ----------
    chance
        Decides what fails.
    where
        Name of the box in the trace.
    on_remove
        Function that receives the content of each file of records that is removed.
    """

    def __init__(self, chance: Chance, where: str, *, on_remove: Callable[[bytes], None]) -> None:
        self._chance, self._where, self._on_remove = chance, where, on_remove
        self._files: dict[str, File] = {}
        self._durable: dict[str, File] = {}
        #: Changes of the folder that are not synced, in order: old name, new name, file.
        self._changes: list[tuple[str, str, File | None]] = []
        self._handles: dict[int, File] = {}
        self._number = 0
        self._is_locked = False
        self.is_full = self.is_read_only = False
        self.n_errors = 0

    @property
    def size(self) -> int:
        """Bytes in files of records."""
        return sum(len(file.cached) for name, file in self._files.items() if name.endswith(".spool"))

    def contents(self) -> list[bytes]:
        """Return the contents of all files of records, in order of their names."""
        return [file.cached for name, file in sorted(self._files.items()) if name.endswith(".spool")]

    def kill(self) -> None:
        """The process ends: its files are closed, and what it wrote stays."""
        self._handles.clear()
        self._is_locked = False

    def cut_power(self) -> None:
        """The power fails: some of what was not synced is lost, and changes of the folder from some point on."""
        self.kill()
        for old, new, file in self._changes[: self._chance.random.randint(0, len(self._changes))]:
            self._change(self._durable, old, new, file)
        self._changes.clear()
        self._files = {name: File(file.after_power_cut(self._chance)) for name, file in sorted(self._durable.items())}
        self._durable = dict(self._files)

    def make_folder(self, folder: Path) -> None:
        self._call("mkdir")

    def lock(self, path: Path) -> int | None:
        self._call("lock")
        if self._is_locked:
            return None
        self._is_locked = True
        return 0

    def names(self, folder: Path) -> list[str]:
        self._call("list")
        return sorted(self._files)

    def read(self, path: Path) -> bytes:
        self._call("read")
        if path.name not in self._files:
            raise FileNotFoundError(errno.ENOENT, os.strerror(errno.ENOENT))
        return self._files[path.name].cached

    def open(self, path: Path) -> int:
        self._call("open", is_writing=True)
        if path.name not in self._files:
            file = File()
            self._files[path.name] = file
            self._changes.append(("", path.name, file))
        self._number += 1
        self._handles[self._number] = self._files[path.name]
        self._crash("open")
        return self._number

    def write(self, handle: int, data: bytes) -> int:
        file = self._handles[handle]
        part = self._chance.random.randint(0, len(data))
        try:
            self._call("write", is_writing=True)
        except (Crash, OSError):
            file.cached += data[:part]  # torn
            raise
        if self.is_full and part < len(data):
            file.cached += data[:part]
            self._fail(errno.ENOSPC)
        n_written = part if part and self._chance.happens("write is short", self._where) else len(data)
        file.cached += data[:n_written]
        self._crash("write")
        return n_written

    def sync(self, handle: int) -> None:
        file = self._handles[handle]
        self._crash("sync")
        if self._chance.happens("sync fails", self._where):
            file.bad = min(len(file.durable), len(file.cached)) if file.bad is None else file.bad
            self._fail(errno.EIO)
        file.sync()
        self._crash("sync")

    def sync_folder(self, folder: Path) -> None:
        self._call("sync folder")
        for old, new, file in self._changes:
            self._change(self._durable, old, new, file)
        self._changes.clear()
        self._crash("sync folder")

    def truncate(self, file: int | Path, size: int) -> None:
        self._call("truncate", is_writing=True)
        (self._handles[file] if isinstance(file, int) else self._files[file.name]).truncate(size)
        self._crash("truncate")

    def close(self, handle: int) -> None:
        self._is_locked = self._is_locked and handle != 0
        self._handles.pop(handle, None)

    def rename(self, old: Path, new: Path) -> None:
        self._call("rename", is_writing=True)
        self._move(old.name, new.name, self._files[old.name])
        self._crash("rename")

    def remove(self, path: Path) -> None:
        if path.name not in self._files:
            return
        content = self._files[path.name].cached if path.name.endswith(".spool") else b""
        try:
            self._call("remove")
        except OSError:
            self._on_remove(content)  # it stays, but the box holds it no more until it starts again
            raise
        self._on_remove(content)
        self._move(path.name, "", None)
        self._crash("remove")

    def free(self, folder: Path) -> int:
        return 10**9

    def _move(self, old: str, new: str, file: File | None) -> None:
        self._change(self._files, old, new, file)
        self._changes.append((old, new, file))

    @staticmethod
    def _change(names: dict[str, File], old: str, new: str, file: File | None) -> None:
        """Change the names of a folder."""
        names.pop(old, None)
        if new and file is not None:
            names[new] = file

    def _call(self, call: str, *, is_writing: bool = False) -> None:
        """Let a call fail before it did anything."""
        self._crash(call)
        if self.is_read_only and is_writing:
            self._fail(errno.EROFS)
        if self._chance.happens("call to the disk fails", f"{self._where} {call}"):
            self._fail(errno.EIO)

    def _crash(self, call: str) -> None:
        """End the process at this call, before or after it."""
        if self._chance.happens("box killed at a call", f"{self._where} {call}"):
            raise Crash("kill")
        if self._chance.happens("box loses power at a call", f"{self._where} {call}"):
            raise Crash("power")

    def _fail(self, number: int) -> None:
        self.n_errors += 1
        raise OSError(number, os.strerror(number))
