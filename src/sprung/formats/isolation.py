"""Readers of foreign binary formats in a process of their own, with limits of memory and time.

A damaged or hostile file can crash a native library, make it wait for ever or request any amount of memory. Here it
ends a child process, and the caller gets a sentence. One child serves all files of a process, request by request, over
a connection of `multiprocessing`. It is started as a module, as the start methods of `multiprocessing` would run the
caller's script again.
"""

import atexit
import contextlib
import itertools
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial
from importlib import import_module
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from sprung import errors
from sprung.errors import FormatError, SprungError
from sprung.formats.settings import ReadSettings
from sprung.formats.table import Block, Group, Table, reported

#: Memory [bytes] that a reader may take in addition to what Python needs: at least this, or this multiple of the file.
LEAST_MEMORY = 1 << 30
MEMORY_PER_BYTE = 20
#: Time [s] that a reader may take for one answer: at least this, and longer for a large file [s/byte].
LEAST_TIME = 60.0
TIME_PER_BYTE = 1e-6


@dataclass(frozen=True, slots=True)
class _Source:
    """File with the module that reads it and the settings."""

    module: str
    path: Path
    settings: ReadSettings


def isolated_groups(module: str, path: Path, settings: ReadSettings) -> tuple[Group, ...]:
    """Return the groups of a file, read in a child process.

    Parameters
    ----------
    module
        Name of the module of the format.

    Raises
    ------
    SprungError
        As raised by the module.
    FormatError
        If the reader crashes, or exceeds its limits of memory or time.
    """
    databases = tuple(database.absolute() for database in settings.databases)
    names = None if settings.names is None else settings.names.absolute()
    source = _Source(module, path.absolute(), replace(settings, databases=databases, names=names))
    found: tuple[Group, ...] = _READER.ask(path, "groups", source)
    return tuple(replace(group, open=partial(_open, path, source, number)) for number, group in enumerate(found))


def _open(path: Path, source: _Source, group: int, channels: Sequence[str] | None) -> Table:
    """Return the table of some channels of a group."""
    chosen = source, group, None if channels is None else tuple(channels)
    table, has_times, has_others = _READER.ask(path, "table", *chosen)

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        return _READER.blocks(path, "blocks", *chosen, first, last)

    return replace(
        table,
        path=path,
        blocks=blocks,
        times=partial(_READER.blocks, path, "times", *chosen) if has_times else None,
        others=partial(_open, path, source, group) if has_others else None,
    )


class _Reader:
    """The child process, started when it is first needed, and again when it has ended."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._connection: Connection[Any, Any] | None = None
        self._owner = 0
        self._numbers = itertools.count()

    def ask(self, path: Path, question: str, *details: Any) -> Any:
        """Return the answer to a question about a file."""
        with self._lock:
            connection = self._running()
            size = path.stat().st_size if path.exists() else 0
            try:
                connection.send((max(LEAST_MEMORY, MEMORY_PER_BYTE * size), question, details))
                if not connection.poll(LEAST_TIME + TIME_PER_BYTE * size):
                    self._stop()
                    raise FormatError(f"{path} cannot be read: its reader took too long: check that it is complete")
                error, answer = connection.recv()
            except (OSError, EOFError):
                code = self._stop()
                raise FormatError(
                    f"{path} cannot be read: its reader failed (exit code {code}): check that the file is complete"
                ) from None
        if error == MemoryError.__name__:
            text = "cannot be read: it takes more memory than its size allows: check that the file is complete"
            raise FormatError(f"{path} {text}")
        if error:
            kind: type[SprungError] = getattr(errors, error)
            raise kind(answer.replace(str(path.absolute()), str(path)))
        return answer

    def blocks(self, path: Path, question: str, *details: Any) -> Iterator[Block]:
        """Yield the blocks of a table."""
        stream = next(self._numbers)
        process = None
        try:
            while True:
                begin = details if process is None else None
                block: Block | None = self.ask(path, question, stream, begin)
                if process is not None and process is not self._process:
                    raise FormatError(f"{path}: its reader was restarted in between: read the file again")
                process = self._process
                if block is None:
                    return
                yield block
        finally:
            if process is not None and process is self._process and process.poll() is None:
                with contextlib.suppress(SprungError):
                    self.ask(path, "close", stream)

    def close(self) -> None:
        """End the child process, if there is one of this process."""
        with self._lock:
            if self._owner == os.getpid():
                self._stop()

    def _running(self) -> "Connection[Any, Any]":
        """Return the connection to the child process."""
        if (
            self._process is None
            or self._connection is None
            or self._owner != os.getpid()
            or self._process.poll() is not None
        ):
            self._owner = os.getpid()
            self._connection, other = Pipe()
            with other:
                self._process = subprocess.Popen(
                    [sys.executable, "-P", "-m", "sprung.formats.isolation"],
                    stdin=other.fileno(),
                    stdout=subprocess.DEVNULL,
                    stderr=subprocess.DEVNULL,
                    env={**os.environ, "PYTHONWARNINGS": "ignore"},
                )
        return self._connection

    def _stop(self) -> int | None:
        """End the child process and return its exit code."""
        process, self._process = self._process, None
        connection, self._connection = self._connection, None
        if connection is not None:
            connection.close()
        if process is None:
            return None
        process.kill()
        return process.wait()


_READER = _Reader()
atexit.register(_READER.close)


@dataclass(slots=True)
class _Child:
    """What the child process has open; its methods answer the questions of their names."""

    streams: dict[int, Iterator[Block]] = field(default_factory=dict)
    opened: tuple[_Source, tuple[Group, ...]] | None = None

    def groups(self, source: _Source) -> tuple[Group, ...]:
        """Return the groups of a file, which stay open until the next one."""
        module = import_module(source.module)
        with reported(source.path, module.NAME):
            self.opened = source, module.groups(source.path, source.settings)
        unopened: Any = None
        return tuple(replace(group, open=unopened) for group in self.opened[1])

    def table(self, *chosen: Any) -> tuple[Table, bool, bool]:
        """Return a table without its functions, and which of them it has."""
        table = self._table(*chosen)
        unread: Any = None
        bare = replace(table, blocks=unread, times=None, others=None)
        return bare, table.times is not None, table.others is not None

    def blocks(self, stream: int, begin: tuple[Any, ...] | None) -> Block | None:
        """Return the next block of a stream, the first one where it begins; None at its end."""
        if begin is not None:
            *chosen, first, last = begin
            self.streams[stream] = _reported(chosen[0].path, self._table(*chosen).blocks(first, last))
        return self._next(stream)

    def times(self, stream: int, begin: tuple[Any, ...] | None) -> Block | None:
        """Return the next block of time stamps."""
        if begin is not None:
            table = self._table(*begin)
            self.streams[stream] = _reported(begin[0].path, (table.times or table.blocks)())
        return self._next(stream)

    def close(self, stream: int) -> None:
        """End a stream."""
        self.streams.pop(stream, None)

    def _table(self, source: _Source, group: int, channels: Sequence[str] | None) -> Table:
        if self.opened is None or self.opened[0] != source:
            self.groups(source)
        with reported(source.path, "file"):
            return self.opened[1][group].open(channels)  # type: ignore[index]

    def _next(self, stream: int) -> Block | None:
        block = next(self.streams[stream], None)
        if block is None:
            del self.streams[stream]
        return block


def _reported(path: Path, blocks: Iterator[Block]) -> Iterator[Block]:
    """Yield blocks; errors become sentences."""
    with reported(path, "file"):
        yield from blocks


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


def _serve() -> None:
    """Answer questions until the other side ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the other side ends this process
    connection: Connection[Any, Any] = Connection(os.dup(sys.stdin.fileno()))
    child = _Child()
    while True:
        try:
            memory, question, details = connection.recv()
        except EOFError:
            return
        try:
            _limit_memory(memory)
            answer = "", getattr(child, question)(*details)
        except SprungError as error:
            answer = type(error).__name__, str(error)
        except MemoryError:
            answer = MemoryError.__name__, ""
        connection.send(answer)


if __name__ == "__main__":
    _serve()
