"""Readers of foreign binary formats in a process of their own, with limits of memory and time.

A damaged or hostile file can crash a native library, make it wait for ever or request any amount of memory. Here it
ends a child process, and the caller gets a sentence. One child serves all files of a process, request by request. Its
answers are JSON and raw numbers, which execute nothing.
"""

import atexit
import contextlib
import itertools
import json
import operator
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass, fields
from functools import partial
from importlib import import_module
from multiprocessing.connection import Connection, Pipe
from pathlib import Path
from typing import Any

import numpy as np

from sprung import errors
from sprung.errors import FormatError, SprungError
from sprung.formats.settings import ReadSettings
from sprung.formats.table import Block, Column, Group, Table, reported


@dataclass(frozen=True, slots=True)
class Limits:
    """What a reader may take for one answer."""

    memory: int = 1 << 30  # memory [bytes] for a small file, in addition to what Python needs
    memory_per_byte: int = 20  # the same for a large one, over its size: decompression and double precision
    time: float = 60.0  # time [s] for a small file: the import of a library on a busy machine
    time_per_byte: float = 1e-6  # further time [s] for each byte: a slow disk
    message: int = 1 << 26  # bytes of an answer without its arrays


LIMITS = Limits()

#: Module of a format, path of a file and settings.
_Source = tuple[str, Path, ReadSettings]


def isolated_groups(module: str, path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the groups of a file, read in a child process.

    Parameters
    ----------
    module
        Name of the module of the format.
    path, settings
        As for the module's own `groups`.

    Raises
    ------
    SprungError
        As raised by the module.
    FormatError
        If the reader crashes, or exceeds its limits of memory or time.
    """
    source = (module, path.absolute(), settings)
    answer, _ = _READER.ask(path, "groups", source)
    return tuple(
        Group(**{**stated, "headings": tuple(stated["headings"])}, open=partial(_open, path, source, number))
        for number, stated in enumerate(answer["groups"])
    )


def _open(path: Path, source: _Source, number: int, channels: Sequence[str] | None) -> Table:
    """Return the table of some channels of a group."""
    stated, _ = _READER.ask(path, "table", source, number, channels)
    columns, notes = tuple(Column(**column) for column in stated.pop("columns")), tuple(stated.pop("notes"))

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        return _READER.blocks(path, (source, number, channels), first, last)

    return Table(path=path, columns=columns, blocks=blocks, notes=notes, **stated)


class _Reader:
    """The child process, started when it is first needed, and again when it has ended."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection[Any, Any] | None = None
        self._owner = 0
        self._numbers = itertools.count()

    def ask(self, path: Path, method: str, *arguments: Any) -> tuple[dict[str, Any], list[bytes]]:
        """Return what a method of `_Child` answers about a file, and the arrays that come with it."""
        with self._lock:
            connection = self._connected()
            size = path.stat().st_size if path.exists() else 0
            try:
                memory = max(LIMITS.memory, LIMITS.memory_per_byte * size)
                connection.send((str(path), memory, method, arguments))
                if not connection.poll(LIMITS.time + LIMITS.time_per_byte * size):
                    raise TimeoutError
                answer = json.loads(connection.recv_bytes(LIMITS.message))
                arrays = [connection.recv_bytes(n_bytes) for n_bytes in answer.pop("sizes")]
            except TimeoutError:
                self._stop()
                raise FormatError(
                    f"{path} cannot be read: its reader took too long: check that it is complete"
                ) from None
            except (OSError, EOFError, ValueError):
                code = self._stop()
                raise FormatError(
                    f"{path} cannot be read: its reader failed (exit code {code}): check that the file is complete"
                ) from None
        if "error" in answer:
            kind: type[SprungError] = getattr(errors, answer["error"])
            raise kind(answer["message"].replace(str(path.absolute()), str(path)), **answer["facts"])
        return answer, arrays

    def blocks(self, path: Path, table: tuple[Any, ...], first: int, last: int | None) -> Iterator[Block]:
        """Yield some rows of a table."""
        stream = next(self._numbers)
        process = None
        try:
            while True:
                answer, arrays = self.ask(path, "block", stream, table, first, last)
                if process not in {None, self._process}:
                    raise FormatError(f"{path}: its reader was restarted in between: read the file again")
                process = self._process
                if not answer:
                    return
                values = np.frombuffer(arrays[0], dtype=np.float64).reshape(answer["shape"])
                stamps = np.frombuffer(arrays[1], dtype=np.dtype(answer["stamps"])) if answer["stamps"] else None
                yield Block(answer["first_row"], stamps, values)
        finally:
            if process is not None and process is self._process and process.poll() is None:
                with contextlib.suppress(SprungError):
                    self.ask(path, "close", stream)

    def close(self) -> None:
        """End the child process, if there is one of this process."""
        with self._lock:
            if self._owner == os.getpid():
                self._stop()

    def _connected(self) -> "Connection[Any, Any]":
        """Return the connection to the child process."""
        if (
            self._connection is None
            or self._process is None
            or self._process.poll() is not None
            or self._owner != os.getpid()
        ):
            self._owner = os.getpid()
            self._connection, theirs = Pipe()
            with theirs:
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "sprung.formats.isolation", str(theirs.fileno())],
                    pass_fds=[theirs.fileno()],
                    stdin=subprocess.DEVNULL,
                    stdout=subprocess.DEVNULL,  # what libraries print
                    stderr=subprocess.DEVNULL,
                    env={**os.environ, "PYTHONWARNINGS": "ignore"},
                )
        return self._connection

    def _stop(self) -> int | None:
        """End the child process and return its exit code."""
        process, self._process = self._process, None
        connection, self._connection = self._connection, None
        if process is None or connection is None:
            return None
        process.kill()
        connection.close()
        return process.wait()


_READER = _Reader()
atexit.register(_READER.close)


class _Child:
    """What the child process has open: the groups of the last file, and rows that are being read, by their number."""

    def __init__(self) -> None:
        self._streams: dict[int, tuple[Path, Iterator[Block]]] = {}
        self._source: _Source | None = None
        self._groups: tuple[Group, ...] = ()

    def groups(self, source: _Source) -> tuple[dict[str, Any], list[bytes]]:
        """Open a file and return its groups."""
        name, path, settings = source
        module = import_module(name)
        with reported(path, module.NAME):
            self._groups = module.groups(path, settings)
        self._source = source
        names = ("name", "headings", "sampling_rate", "n_rows")
        stated = [{"clock": repr(group.clock), **{key: getattr(group, key) for key in names}} for group in self._groups]
        return {"groups": stated}, []

    def table(self, *table: Any) -> tuple[dict[str, Any], list[bytes]]:
        """Return what is known of a table without its rows."""
        opened = self._opened(*table)
        names = {field.name for field in fields(Table)} - {"path", "columns", "blocks"}
        columns = [asdict(column) for column in opened.columns]
        return {"columns": columns, **{name: getattr(opened, name) for name in names}}, []

    def _opened(self, source: _Source, number: int, channels: Sequence[str] | None) -> Table:
        """Return the table of some channels of a group."""
        if source != self._source:
            self.groups(source)
        with reported(source[1], "file"):
            return self._groups[number].open(channels)

    def block(
        self, stream: int, table: tuple[_Source, int, Any], first: int, last: int | None
    ) -> tuple[dict[str, Any], list[bytes]]:
        """Return the next block of some rows of a table; nothing after the last one."""
        if stream not in self._streams:
            self._streams[stream] = table[0][1], self._opened(*table).blocks(first, last)
        path, blocks = self._streams[stream]
        with reported(path, "file"):
            block = next(blocks, None)
        if block is None:
            return self.close(stream)
        stamps = block.stamps
        arrays = [np.asarray(block.values, dtype=np.float64), *([] if stamps is None else [stamps])]
        stated = {
            "first_row": block.first_row,
            "shape": block.values.shape,
            "stamps": "" if stamps is None else stamps.dtype.str,
        }
        return stated, [np.ascontiguousarray(array).tobytes() for array in arrays]

    def close(self, stream: int) -> tuple[dict[str, Any], list[bytes]]:
        """Forget rows that are not read to their end."""
        self._streams.pop(stream, None)
        return {}, []


def _limit_memory(extra: int) -> None:
    """Limit the address space of this process to what it has and some more."""
    try:
        import resource
    except ImportError:  # not a Unix system
        return
    present = int(Path("/proc/self/statm").read_text(encoding="utf-8").split()[0]) * resource.getpagesize()
    _, hard = resource.getrlimit(resource.RLIMIT_AS)
    wanted = present + extra
    resource.setrlimit(resource.RLIMIT_AS, (wanted if hard < 0 else min(wanted, hard), hard))


def _serve(connection: "Connection[Any, Any]") -> None:
    """Answer requests until the other side ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the other side ends this process
    child = _Child()
    while True:
        try:
            path, memory, method, arguments = connection.recv()
        except EOFError:
            return
        arrays: list[bytes] = []
        try:
            _limit_memory(memory)
            answer, arrays = getattr(child, method)(*arguments)
        except SprungError as error:
            answer = {"error": type(error).__name__, "message": str(error), "facts": vars(error)}
        except MemoryError:
            message = f"{path} cannot be read: it takes more memory than its size allows"
            message = f"{message}: check that the file is complete"
            answer = {"error": "FormatError", "message": message, "facts": {}}
        answer["sizes"] = [len(array) for array in arrays]
        connection.send_bytes(json.dumps(answer, default=operator.methodcaller("item")).encode())
        for array in arrays:
            connection.send_bytes(array)


if __name__ == "__main__":
    _serve(Connection(int(sys.argv[1])))
