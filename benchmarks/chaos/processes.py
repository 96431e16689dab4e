"""Processes that are killed and started again."""

import os
import pwd
import random
import shutil
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

MOSQUITTO = shutil.which("mosquitto") or shutil.which("mosquitto", path="/usr/sbin:/usr/local/sbin")
SPRUNG = [sys.executable, "-c", "from sprung.cli import main; raise SystemExit(main())"]
#: Below the ports that the system gives to outgoing connections, so that a restart finds its port free.
PORTS = range(20000, 30000)


def until(condition: Callable[[], Any], *, timeout: float, what: str) -> Any:
    """Return the first true value of a condition."""
    end = time.monotonic() + timeout
    while not (value := condition()):
        if time.monotonic() > end:
            raise TimeoutError(f"not within {timeout:g} s: {what}")
        time.sleep(0.02)
    return value


def free_port(taken: set[int]) -> int:
    """Return a free port."""
    while True:
        port = random.randrange(PORTS.start, PORTS.stop)
        with socket.socket() as trial:
            if port not in taken and trial.connect_ex(("127.0.0.1", port)) != 0:
                taken.add(port)
                return port


class Program:
    """A process that is started again and again."""

    def __init__(self, name: str, command: Callable[[], list[str]], folder: Path) -> None:
        self.name = name
        self._command, self._folder = command, folder
        self._process: subprocess.Popen[bytes] | None = None

    @property
    def log(self) -> Path:
        return self._folder / f"{self.name}.log"

    @property
    def exit_code(self) -> int | None:
        return None if self._process is None else self._process.poll()

    @property
    def pid(self) -> int | None:
        return None if self._process is None else self._process.pid

    @property
    def children(self) -> list[int]:
        """Numbers of the processes that it has started."""
        if self._process is None:
            return []
        found = Path(f"/proc/{self._process.pid}/task").glob("*/children")
        pids = []
        for path in found:
            with suppress(OSError):
                pids += [int(word) for word in path.read_text().split()]
        return pids

    def start(self) -> None:
        with self.log.open("ab") as log:
            self._process = subprocess.Popen(self._command(), stdin=subprocess.DEVNULL, stdout=log, stderr=log)

    def send(self, number: int) -> None:
        """Send a signal."""
        if self._process is not None:
            self._process.send_signal(number)

    def end(self, number: int = signal.SIGKILL) -> None:
        """Send a signal and wait for the end; a mosquitto that has only just started may miss the first SIGTERM."""
        while self._process is not None and self._process.poll() is None:
            self._process.send_signal(number)
            with suppress(subprocess.TimeoutExpired):
                self._process.wait(10.0)


def broker(name: str, port: int, folder: Path) -> Program:
    """Return a mosquitto that keeps nothing on disk."""
    settings = folder / f"{name}.conf"
    # As root, mosquitto would become a user that may not read the folder.
    settings.write_text(
        f"listener {port} 127.0.0.1\nallow_anonymous true\npersistence false\nlog_dest stdout\n"
        f"max_queued_messages 100000\nuser {pwd.getpwuid(os.geteuid()).pw_name}\n"
    )
    return Program(name, lambda: [str(MOSQUITTO), "-c", str(settings)], folder)


def tail(path: Path) -> str:
    """Return the last lines of a log."""
    return " | ".join(path.read_text(encoding="utf-8", errors="replace").splitlines()[-3:])


def is_alive(pid: int) -> bool:
    """Return whether a process runs."""
    with suppress(OSError):
        return ") Z" not in Path(f"/proc/{pid}/stat").read_text(encoding="utf-8")
    return False
