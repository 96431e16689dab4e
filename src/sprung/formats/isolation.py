"""Readers of foreign binary formats in a process of their own, with limits of memory and time.

A damaged or hostile file can crash a native library, make it wait for ever or request any amount of memory. Here it
ends a child process, and the caller gets a sentence. One child serves all files of a process, request by request; both
sides speak JSON and raw numbers, which execute nothing.

A message is a line of JSON, whose field `sizes` lists the lengths of the blobs of bytes that follow it.
"""

import atexit
import contextlib
import itertools
import json
import os
import signal
import subprocess
import sys
import threading
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import asdict, dataclass
from functools import partial
from importlib import import_module
from pathlib import Path
from select import select
from typing import IO, Any

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
    line: int = 1 << 26  # bytes of a message without its blobs


LIMITS = Limits()


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
    source = {"module": module, "path": str(path.absolute()), "settings": _plain(settings)}
    answer, _ = _READER.ask(path, {"do": "groups", **source})
    return tuple(
        Group(
            group["name"],
            tuple(group["headings"]),
            group["clock"],
            partial(_open, path, {**source, "group": number}),
            group["sampling_rate"],
            group["n_rows"],
        )
        for number, group in enumerate(answer["groups"])
    )


def _plain(settings: ReadSettings) -> dict[str, Any]:
    """Return settings as JSON."""
    plain: dict[str, Any] = json.loads(json.dumps(asdict(settings), default=lambda path: str(path.absolute())))
    return plain


def _open(path: Path, source: Mapping[str, Any], channels: Sequence[str] | None) -> Table:
    """Return the table of some channels of a group."""
    request = {**source, "channels": None if channels is None else list(channels)}
    answer, _ = _READER.ask(path, {"do": "table", **request})
    stated = answer["table"]

    def blocks(first: int = 0, last: int | None = None) -> Iterator[Block]:
        return _READER.blocks(path, {**request, "do": "blocks", "first": first, "last": last})

    def times() -> Iterator[Block]:
        return _READER.blocks(path, {**request, "do": "times"})

    columns = tuple(Column(**column) for column in stated.pop("columns"))
    has_times, has_others = stated.pop("has_times"), stated.pop("has_others")
    return Table(
        path=path,
        columns=columns,
        blocks=blocks,
        times=times if has_times else None,
        others=partial(_open, path, source) if has_others else None,
        notes=tuple(stated.pop("notes")),
        **stated,
    )


class _Reader:
    """The child process, started when it is first needed, and again when it has ended."""

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process: subprocess.Popen[bytes] | None = None
        self._owner = 0
        self._numbers = itertools.count()

    def ask(self, path: Path, request: Mapping[str, Any]) -> tuple[dict[str, Any], list[bytes]]:
        """Return the answer to a request about a file, and the bytes that come with it."""
        with self._lock:
            process = self._running()
            size = path.stat().st_size if path.exists() else 0
            try:
                _write(process.stdin, {**request, "memory": max(LIMITS.memory, LIMITS.memory_per_byte * size)}, [])
                answer, blobs = _read(process.stdout, patience=LIMITS.time + LIMITS.time_per_byte * size)
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
            raise kind(answer["message"].replace(request.get("path", ""), str(path)))
        return answer, blobs

    def blocks(self, path: Path, request: Mapping[str, Any]) -> Iterator[Block]:
        """Yield the blocks that a request begins."""
        stream = next(self._numbers)
        process = None
        try:
            while True:
                answer, blobs = self.ask(path, {**request, "stream": stream, "is_next": process is not None})
                if process is not None and process is not self._process:
                    raise FormatError(f"{path}: its reader was restarted in between: read the file again")
                process = self._process
                if answer["is_last"]:
                    return
                yield _block(answer, blobs)
        finally:
            if process is not None and process is self._process and process.poll() is None:
                with contextlib.suppress(SprungError):
                    self.ask(path, {"do": "close", "stream": stream})

    def close(self) -> None:
        """End the child process, if there is one of this process."""
        with self._lock:
            if self._owner == os.getpid():
                self._stop()

    def _running(self) -> "subprocess.Popen[bytes]":
        """Return the child process."""
        if self._process is None or self._owner != os.getpid() or self._process.poll() is not None:
            self._owner = os.getpid()
            self._process = subprocess.Popen(
                [sys.executable, "-P", "-m", "sprung.formats.isolation"],
                stdin=subprocess.PIPE,
                stdout=subprocess.PIPE,
                stderr=subprocess.DEVNULL,
                env={**os.environ, "PYTHONWARNINGS": "ignore"},
            )
        return self._process

    def _stop(self) -> int | None:
        """End the child process and return its exit code."""
        process, self._process = self._process, None
        if process is None:
            return None
        process.kill()
        process.communicate()
        return process.returncode


_READER = _Reader()
atexit.register(_READER.close)


def _write(stream: IO[bytes] | None, message: Mapping[str, Any], blobs: Sequence[bytes]) -> None:
    """Write a message."""
    if stream is None:
        raise OSError("the pipe is closed")
    line = json.dumps({**message, "sizes": [len(blob) for blob in blobs]}, default=_number)
    stream.write(line.encode() + b"\n")
    for blob in blobs:
        stream.write(blob)
    stream.flush()


def _read(stream: IO[bytes] | None, *, patience: float | None = None) -> tuple[dict[str, Any], list[bytes]]:
    """Return the next message; raise if it does not begin in time."""
    if stream is None:
        raise OSError("the pipe is closed")
    if patience is not None and not select([stream], [], [], patience)[0]:
        raise TimeoutError
    line = stream.readline(LIMITS.line)
    if not line.endswith(b"\n"):
        raise EOFError
    message = json.loads(line)
    blobs = [stream.read(size) for size in message.pop("sizes")]
    return message, blobs


def _block(answer: Mapping[str, Any], blobs: Sequence[bytes]) -> Block:
    """Return the block of an answer."""
    values = np.frombuffer(blobs[0], dtype=np.float64).reshape(answer["n_channels"], answer["n_rows"])
    stamps = np.frombuffer(blobs[1], dtype=np.dtype(answer["stamps"])) if answer["stamps"] else None
    return Block(answer["first_row"], stamps, values)


@dataclass
class _Child:
    """What the child process has open."""

    streams: dict[int, Iterator[Block]]
    opened: tuple[str, tuple[Group, ...]] | None = None

    def answer(self, request: Mapping[str, Any]) -> tuple[dict[str, Any], list[bytes]]:
        """Return the answer to a request."""
        if request["do"] == "close":
            self.streams.pop(request["stream"], None)
            return {}, []
        if request["do"] == "groups":
            return {"groups": [_stated_group(group) for group in self._groups(request, is_new=True)]}, []
        if request["do"] in {"blocks", "times"}:
            return self._next(request)
        return {"table": _stated_table(self._table(request))}, []

    def _groups(self, request: Mapping[str, Any], *, is_new: bool = False) -> tuple[Group, ...]:
        """Return the groups of the requested file, which stay open until the next one."""
        key = json.dumps([request["module"], request["path"], request["settings"]])
        if is_new or self.opened is None or self.opened[0] != key:
            module, settings = import_module(request["module"]), request["settings"]
            settings["databases"] = tuple(Path(name) for name in settings["databases"])
            with reported(Path(request["path"]), module.NAME):
                self.opened = key, module.groups(Path(request["path"]), ReadSettings(**settings))
        return self.opened[1]

    def _table(self, request: Mapping[str, Any]) -> Table:
        """Return the requested table."""
        with reported(Path(request["path"]), "file"):
            return self._groups(request)[request["group"]].open(request["channels"])

    def _next(self, request: Mapping[str, Any]) -> tuple[dict[str, Any], list[bytes]]:
        """Return the next block of a stream."""
        if not request["is_next"]:
            table = self._table(request)
            if request["do"] == "times":
                self.streams[request["stream"]] = (table.times or table.blocks)()
            else:
                self.streams[request["stream"]] = table.blocks(request["first"], request["last"])
        with reported(Path(request["path"]), "file"):
            block = next(self.streams[request["stream"]], None)
        if block is None:
            del self.streams[request["stream"]]
            return {"is_last": True}, []
        stamps = block.stamps
        stated = {
            "is_last": False,
            "first_row": block.first_row,
            "n_channels": block.values.shape[0],
            "n_rows": block.values.shape[1],
            "stamps": "" if stamps is None else stamps.dtype.str,
        }
        blobs = [np.ascontiguousarray(block.values, dtype=np.float64).tobytes()]
        return stated, blobs if stamps is None else [*blobs, np.ascontiguousarray(stamps).tobytes()]


def _stated_group(group: Group) -> dict[str, Any]:
    """Return a group as JSON."""
    names = ("name", "headings", "sampling_rate", "n_rows")
    return {"clock": repr(group.clock), **{name: getattr(group, name) for name in names}}


def _stated_table(table: Table) -> dict[str, Any]:
    """Return what is known of a table without its rows."""
    names = ("time_heading", "row_word", "sampling_rate", "start", "time_factor", "notes", "comment")
    return {
        "columns": [asdict(column) for column in table.columns],
        "has_times": table.times is not None,
        "has_others": table.others is not None,
        **{name: getattr(table, name) for name in names},
    }


def _number(value: np.generic) -> Any:
    """Return a number of NumPy as JSON."""
    return value.item()


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
    """Answer requests until the other side ends."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)  # the other side ends this process
    child = _Child({})
    answers = os.fdopen(os.dup(1), "wb")
    os.dup2(2, 1)  # what libraries print is not an answer
    while True:
        try:
            request, _ = _read(sys.stdin.buffer)
        except EOFError:
            return
        try:
            _limit_memory(request["memory"])
            answer, blobs = child.answer(request)
        except SprungError as error:
            answer, blobs = {"error": type(error).__name__, "message": str(error)}, []
        except MemoryError:
            text = f"{request['path']} cannot be read: it takes more memory than its size allows"
            answer, blobs = {"error": "FormatError", "message": f"{text}: check that the file is complete"}, []
        _write(answers, answer, blobs)


if __name__ == "__main__":
    _serve()
